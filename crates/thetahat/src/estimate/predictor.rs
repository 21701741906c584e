//! Prediction errors of the general family and the Gram matrix of their derivatives.
//!
//! ```text
//! e = (D/C) w,   w = A y - sum_j x_j,   x_j = (B_j/F_j) u_j
//! ```
//!
//! With psi = -de/dtheta, every derivative is a shifted copy of one of few filtered signals (Ljung, System
//! Identification, 2nd ed. 1999, section 10.3):
//!
//! ```text
//! a_i: -(D/C) q^-i y       b_ji: (D/(C F_j)) q^-i u_j       f_ji: -(D/(C F_j)) q^-i x_j
//! c_i:  (1/C) q^-i e       d_i: -(1/C) q^-i w
//! ```
//!
//! So an iteration filters once for each polynomial, and the Gram matrix of psi comes from lagged products of these
//! signals: O(N p), and no matrix of N rows.
//!
//! A section is a segment with the measured samples directly before it that its errors reach back to, as far as they
//! are there. Samples before the section are unknown, and zero in all that follows. What they do to x_j is a
//! combination of free responses q^-i (1/F_j) delta, i = s, s + 1, …, with weights that are estimated too, apart for
//! each section: they enter e linearly and are eliminated from the normal equations. The first error that counts needs
//! x_j from sample s on: nf of them are enough where the inputs from nb + nk - 1 samples before s on are known or taken
//! to be zero, and one more for each unknown one is needed where not. The other polynomials reach back to nothing
//! unknown in the samples that count; where there is C, v = D w is set to zero in the r samples before these. Then psi
//! is a shifted copy only up to what the mask cuts off. With z the signal before the mask and g the impulse response of
//! 1/C from sample r on,
//!
//! ```text
//! (1/C) mask(q^-i z) = q^-i (1/C) mask(z) + sum_{k < i} z(r + k - i) q^-k g,
//! ```
//!
//! so that shifts of g complete the Gram matrix exactly.
//!
//! Without A, C and D an error depends on the output of its own sample only. A section goes on through missing outputs
//! then: the samples that count are several runs, with a part of the Gram matrix each.

mod columns;
mod loss;
mod objective;
mod section;
#[cfg(test)]
mod tests;
mod weighted;

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{Cholesky, DMatrix, Dyn};
use thetahat_numerics::regression::{Folding, Products, Taps, factor_rows, sum, sum_of_squares};

use super::polynomials::{Polynomials, Unusable};
use super::stability_boundary::StabilityBoundary;
use super::uncertainty::backward_filtered_products;
use crate::data::{Record, measured};
use crate::model::Orders;
use section::Section;

/// Samples from which threads pay for themselves.
const PARALLEL_FROM: usize = 1 << 15;

/// Which signals there are, and which columns of psi are made of them.
#[derive(Debug, Clone)]
struct Layout {
    orders: Orders,
    /// That of the parameters alone that errors are linear in, A and B; none in that itself.
    linear: Option<Box<Layout>>,
    /// Those of the parameters in their order, then of the initial-condition responses, then of g. Signal 0 is e.
    taps: Vec<Taps>,
    /// Signal, position among the products, lag and sign, one for each column.
    columns: Vec<Column>,
    products: Products,
    parameters: usize,
    free: usize,
    /// How many of the initial-condition responses each input has, and the sample of the section that the first begins
    /// at.
    own_free: Vec<usize>,
    origin: usize,
    /// r, the first samples of the section in which v = 0; none without C.
    conditioned: usize,
    /// The first sample that counts, r or later.
    counted: usize,
    /// From where on errors count linearly; none: they count by their squares.
    bound: Option<f64>,
    /// Whether there are initial-condition responses that begin long before it.
    faded: bool,
    output: usize,
    inputs: Vec<usize>,
    error: usize,
    disturbance: usize,
    responses: Vec<usize>,
    frees: Vec<usize>,
    impulse: usize,
    signals: usize,
    /// The signals that are divided by C, and those of them that are multiplied by D.
    filtered: Vec<usize>,
    with_noise_denominator: Vec<usize>,
}

#[derive(Debug, Clone, Copy)]
struct Column {
    signal: usize,
    position: usize,
    lag: usize,
    sign: f64,
}

/// How a segment starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum InitialCondition {
    /// All earlier samples are zero, and all samples count.
    Zero,
    /// Nothing is known of earlier samples but those that were measured; inputs before these are zero.
    Unknown,
    /// The same, and inputs before those that were measured are unknown too.
    UnknownInputs,
}

/// Samples that are left out in each segment, whatever the model and what is known of its past: the first ones in which
/// v = 0, and the first that counts.
#[derive(Debug, Clone, Copy)]
struct Common {
    left_out: usize,
    counted: usize,
}

impl Layout {
    /// That of sections that begin `past` samples before their segment. Where all F are one, their initial-condition
    /// responses are those of an input.
    fn new(orders: &Orders, begin: InitialCondition, past: usize, common: Option<Common>, one: bool) -> Self {
        let inputs = orders.inputs();
        let unknown = begin != InitialCondition::Zero;
        let left_out = common.map_or(past, |common| common.left_out);
        let skipped = if unknown { left_out.max(orders.conditioned()) } else { 0 };
        let conditioned = if orders.nc > 0 { skipped } else { 0 };
        let counted = common.map_or(skipped, |common| common.counted.max(skipped));
        // Responses begin with the section where nothing is known of it; models on common samples have responses of the
        // same age.
        let at_rest = begin == InitialCondition::Unknown && past == 0;
        let origin = if unknown && common.is_none() && !at_rest { skipped - orders.nd } else { 0 };
        let free = |input: usize| match begin {
            InitialCondition::Zero => 0,
            InitialCondition::Unknown => orders.free_responses(input),
            InitialCondition::UnknownInputs => orders.free_responses_and_inputs(input, origin),
        };
        let mut own_free: Vec<usize> = (0..inputs).map(free).collect();
        if one && let Some(first) = own_free.iter().position(|&free| free > 0) {
            let most = own_free.iter().copied().max().unwrap_or(0);
            own_free.fill(0);
            own_free[first] = most;
        }
        let mut signals = 1;
        let mut next = || {
            signals += 1;
            signals - 1
        };
        let output = next();
        let own: Vec<usize> = (0..inputs).map(|_| next()).collect();
        let (error, disturbance) = (next(), next());
        let responses: Vec<usize> = (0..inputs).map(|_| next()).collect();
        let frees: Vec<usize> = (0..inputs).map(|_| next()).collect();
        let impulse = next();
        let mut taps = vec![Taps { signal: output, first: 1, count: orders.na, sign: -1.0 }];
        let b = own.iter().zip(orders.nk.iter().zip(&orders.nb));
        taps.extend(b.map(|(&signal, (&first, &count))| Taps { signal, first, count, sign: 1.0 }));
        taps.push(Taps { signal: error, first: 1, count: orders.nc, sign: 1.0 });
        taps.push(Taps { signal: disturbance, first: 1, count: orders.nd, sign: -1.0 });
        let f = responses.iter().zip(&orders.nf);
        taps.extend(f.map(|(&signal, &count)| Taps { signal, first: 1, count, sign: -1.0 }));
        let zero = frees.iter().zip(&own_free);
        taps.extend(zero.map(|(&signal, &count)| Taps { signal, first: 0, count, sign: 1.0 }));
        let mut all = Self {
            linear: None,
            filtered: Vec::new(),
            with_noise_denominator: Vec::new(),
            columns: Vec::new(),
            parameters: orders.parameters(),
            free: own_free.iter().sum(),
            faded: counted > skipped && own_free.iter().any(|&free| free > 0),
            own_free,
            origin,
            orders: orders.clone(),
            taps: Vec::new(),
            products: Products::new(&[]),
            conditioned,
            counted,
            bound: None,
            output,
            inputs: own,
            error,
            disturbance,
            responses,
            frees,
            impulse,
            signals,
        };
        let linear = |taps: &Taps| {
            let nonlinear =
                all.responses.contains(&taps.signal) || [error, disturbance].contains(&taps.signal);
            Taps { count: if nonlinear { 0 } else { taps.count }, ..*taps }
        };
        let mut of_linear = Self { parameters: orders.na + orders.nb.iter().sum::<usize>(), ..all.clone() };
        of_linear.lay_out(taps.iter().map(linear).collect());
        all.linear = Some(Box::new(of_linear));
        all.lay_out(taps);
        all
    }

    /// Makes columns of taps, and of shifts of g as many as these need.
    fn lay_out(&mut self, mut taps: Vec<Taps>) {
        let used = taps.iter().filter(|taps| taps.count > 0);
        let longest = used.map(|taps| taps.first + taps.count - 1).max().unwrap_or(0);
        let corrections = if self.conditioned > 0 { longest } else { 0 };
        taps.push(Taps { signal: self.impulse, first: 0, count: corrections, sign: 1.0 });
        let products = Products::new(&taps);
        let columns = taps.iter().flat_map(|taps| {
            let products = &products;
            (0..taps.count).map(move |i| {
                let (signal, lag) = (taps.signal, taps.first + i);
                Column { signal, position: products.position(signal, lag), lag, sign: taps.sign }
            })
        });
        self.columns = columns.collect();
        (self.products, self.taps) = (products, taps);
        let all = || std::iter::once(self.output).chain(self.inputs.iter().chain(&self.responses).copied());
        let used = |signal: &usize| self.uses(*signal);
        let filtered = all().chain([self.error, self.disturbance]).filter(used).collect();
        self.with_noise_denominator = all().filter(used).collect();
        self.filtered = filtered;
    }

    /// Whether there are columns of a signal.
    fn uses(&self, signal: usize) -> bool {
        self.taps.iter().any(|taps| taps.signal == signal && taps.count > 0)
    }

    /// That of the parameters alone that errors are linear in.
    fn linear(&self) -> &Self {
        self.linear.as_deref().unwrap_or(self)
    }
}

/// The prediction errors of a record as a function of the parameters. Memory is taken when it is made; nothing that it
/// does afterwards takes more, unless errors count linearly from somewhere on.
#[derive(Debug)]
pub(crate) struct Predictor<'a> {
    orders: Orders,
    /// One for each past that sections have; mostly one.
    layouts: Vec<Layout>,
    polynomials: Polynomials,
    /// -B, for the inputs without F.
    negative: Vec<Vec<f64>>,
    sections: Vec<Section<'a>>,
    samples: usize,
    stability: Vec<f64>,
    /// The normal equations of the parameters, the initial-condition responses taken out.
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
    stability_boundary: StabilityBoundary,
    /// Memory for the triangle of psi: of all sections, then of one of each layout.
    foldings: Vec<Folding>,
}

impl<'a> Predictor<'a> {
    /// Segments without more samples that count than they have initial-condition responses are left out.
    pub(super) fn new(record: &Record<'a>, orders: &Orders, begin: InitialCondition) -> Self {
        Self::with(record, orders, begin, false)
    }

    /// The same for parameters in which all F are one polynomial.
    pub(super) fn with_one_denominator(
        record: &Record<'a>,
        orders: &Orders,
        begin: InitialCondition,
    ) -> Self {
        Self::with(record, orders, begin, true)
    }

    fn with(record: &Record<'a>, orders: &Orders, begin: InitialCondition, one: bool) -> Self {
        let mut layouts = Vec::new();
        let mut sections = Vec::with_capacity(record.segments.len());
        for (segment, past) in record.segments.iter().zip(&record.past) {
            let past = if begin == InitialCondition::Zero { 0 } else { orders.history().min(*past) };
            let rows = segment.start - past..segment.end;
            // Where earlier inputs would be too many unknowns they are zero.
            for begin in [begin, InitialCondition::Unknown] {
                let index = layout_of(&mut layouts, orders, begin, past, one);
                let (_, layout) = &layouts[index];
                let runs = runs(record, orders, &rows, layout.counted);
                if runs.iter().map(Range::len).sum::<usize>() > layout.free {
                    sections.push(Section::new(record, &rows, runs, layout, index));
                    break;
                }
                if begin != InitialCondition::UnknownInputs {
                    break;
                }
            }
        }
        Self::of_sections(orders, layouts.into_iter().map(|(_, layout)| layout).collect(), sections)
    }

    /// Whether there are more initial conditions where inputs before those that were measured are unknown.
    pub(super) fn has_unknown_inputs(past: &[usize], orders: &Orders) -> bool {
        let mut pasts = past.to_vec();
        pasts.iter_mut().for_each(|past| *past = orders.history().min(*past));
        pasts.sort_unstable();
        pasts.dedup();
        let free = |begin, past| Layout::new(orders, begin, past, None, false).free;
        orders.has_f()
            && pasts.iter().any(|past| {
                free(InitialCondition::UnknownInputs, *past) > free(InitialCondition::Unknown, *past)
            })
    }

    /// The samples that are the same for all models: at least the first `left_out` samples of each segment have e = 0,
    /// and at least the first `counted` do not count. Segments without a sample that counts, or with no more than the
    /// initial-condition responses need, are left out. What was measured before a segment is not used.
    pub(super) fn counting(
        record: &Record<'a>,
        orders: &Orders,
        begin: InitialCondition,
        left_out: usize,
        counted: usize,
    ) -> Self {
        let layout = Layout::new(orders, begin, 0, Some(Common { left_out, counted }), false);
        let needed = layout.counted.max(layout.free);
        let usable = record.segments.iter().filter(|segment| segment.len() > needed);
        let section = |segment: &Range<usize>| {
            let runs = std::iter::once(layout.counted..segment.len()).collect();
            Section::new(record, segment, runs, &layout, 0)
        };
        let sections = usable.map(section).collect();
        Self::of_sections(orders, vec![layout], sections)
    }

    fn of_sections(orders: &Orders, layouts: Vec<Layout>, sections: Vec<Section<'a>>) -> Self {
        let parameters = orders.parameters();
        Self {
            orders: orders.clone(),
            samples: sections.iter().flat_map(|section| &section.runs).map(Range::len).sum(),
            polynomials: Polynomials::new(orders, &vec![0.0; parameters]),
            negative: orders.nb.iter().map(|&nb| vec![0.0; nb]).collect(),
            stability: Vec::with_capacity(orders.nf.iter().copied().fold(orders.nc, usize::max)),
            matrix: vec![0.0; parameters * parameters],
            right: vec![0.0; parameters],
            stability_boundary: StabilityBoundary::new(orders, false),
            foldings: Vec::new(),
            layouts,
            sections,
        }
    }

    pub(super) fn orders(&self) -> &Orders {
        &self.orders
    }

    /// N, the samples that count.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// The initial conditions of all segments.
    pub(super) fn initial_conditions(&self) -> usize {
        self.sections.iter().map(|section| section.free.len()).sum()
    }

    /// ln det(I + `ratio` G) of the initial-condition responses' part G of the Gram matrix, at the current point, over
    /// all segments.
    pub(super) fn free_information(&self, ratio: f64) -> f64 {
        let parameters = self.right.len();
        let of = |section: &Section<'_>| {
            let free = section.free.len();
            let entry =
                |i: usize, j: usize| section.gram[(parameters + i) * (parameters + free) + parameters + j];
            let one = DMatrix::identity(free, free);
            let matrix = one + ratio * DMatrix::from_fn(free, free, entry);
            Cholesky::new(matrix)
                .map_or(f64::INFINITY, |factor| 2.0 * factor.l().diagonal().map(f64::ln).sum())
        };
        self.sections.iter().map(of).sum()
    }

    /// By how much a column of psi is at most larger than what the initial-condition responses leave of it, at the
    /// current point.
    pub(super) fn cancellation(&self) -> f64 {
        let parameters = self.right.len();
        let ratio = |k: usize| self.square_of(k) / self.matrix[k * parameters + k];
        (0..parameters).map(ratio).fold(1.0, f64::max).sqrt()
    }

    /// The square of a column of psi, the initial-condition responses not taken out, at the current point.
    pub(super) fn square_of(&self, column: usize) -> f64 {
        let parameters = self.right.len();
        let square = |section: &Section<'_>| section.gram[column * (parameters + section.free.len() + 1)];
        self.sections.iter().map(square).sum()
    }

    /// The sum of the outputs of the samples that count, and that of their squares.
    pub(super) fn output_sums(&self) -> [f64; 2] {
        let runs = self.sections.iter().flat_map(|own| own.runs.iter().map(|run| &own.output[run.clone()]));
        runs.fold([0.0; 2], |[all, squares], run| {
            [all + sum(run.iter().copied()), squares + sum_of_squares(run)]
        })
    }

    /// The initial conditions of each segment.
    pub(super) fn free_counts(&self) -> impl Iterator<Item = usize> + '_ {
        self.sections.iter().map(|section| section.free.len())
    }

    /// Sets the trial weights of the initial-condition responses, one segment after the other.
    pub(super) fn set_free(&mut self, mut weights: &[f64]) {
        for section in &mut self.sections {
            let (own, rest) = weights.split_at(section.trial.len().min(weights.len()));
            section.trial[..own.len()].copy_from_slice(own);
            weights = rest;
        }
    }

    /// The weights of the initial-condition responses that were evaluated last, one segment after the other.
    pub(super) fn free_weights(&self) -> Vec<f64> {
        self.sections.iter().flat_map(|section| &section.trial).copied().collect()
    }

    /// The steps to the best weights, at the current point: for each segment that for no change of the parameters, then
    /// what each of them takes from it.
    pub(super) fn free_steps(&self) -> Vec<f64> {
        self.sections.iter().flat_map(|section| &section.free_steps).copied().collect()
    }

    /// By how much the initial-condition responses alone can lower the cost, at the current point.
    pub(super) fn free_gain(&self) -> f64 {
        self.sections.iter().map(|section| section.free_gain).sum()
    }

    /// Forgets the weights of the initial-condition responses.
    pub(super) fn restart(&mut self) {
        for section in &mut self.sections {
            section.free.fill(0.0);
            section.trial.fill(0.0);
        }
    }

    /// The sum of squared errors at these parameters and the trial weights; none where C or F is unstable, or the sum
    /// overflows.
    ///
    /// Where samples after the mask do not count, at the weights that are best.
    pub(super) fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.set(parameters)?;
        let (layouts, polynomials, negative) = (&self.layouts, &self.polynomials, &self.negative);
        let each = |section: &mut Section<'_>| {
            let layout = &layouts[section.layout];
            if layout.faded {
                section.project(layout, polynomials, negative);
            } else {
                section.evaluate(layout, polynomials, negative);
            }
        };
        if self.sections.len() > 1 && self.samples >= PARALLEL_FROM {
            self.sections.par_iter_mut().for_each(each);
        } else {
            self.sections.iter_mut().for_each(each);
        }
        let cost: f64 = self.sections.iter().map(|section| section.cost).sum();
        if cost.is_finite() { Ok(cost) } else { Err(Unusable::Overflow) }
    }

    fn set(&mut self, parameters: &[f64]) -> Result<(), Unusable> {
        self.polynomials.set(parameters);
        if !self.polynomials.are_stable(&mut self.stability) {
            return Err(Unusable::Unstable);
        }
        for (negative, b) in self.negative.iter_mut().zip(&self.polynomials.b) {
            negative.iter_mut().zip(b).for_each(|(negative, b)| *negative = -b);
        }
        Ok(())
    }

    /// Takes what was evaluated last as the current point, and forms the normal equations there. Gives by how much the
    /// initial-condition responses alone can lower the cost.
    pub(super) fn linearize(&mut self) -> f64 {
        self.linearize_sections(false);
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        for section in &self.sections {
            section.add_normal(&self.layouts[section.layout], &mut self.matrix, &mut self.right);
        }
        self.free_gain()
    }

    /// The same for the parameters alone that errors are linear in: writes their part.
    fn write_linear_equations(&mut self, matrix: &mut [f64], right: &mut [f64]) {
        self.linearize_sections(true);
        matrix.fill(0.0);
        right.fill(0.0);
        for section in &self.sections {
            section.add_normal(self.layouts[section.layout].linear(), matrix, right);
        }
    }

    fn linearize_sections(&mut self, linear: bool) {
        let (layouts, polynomials) = (&self.layouts, &self.polynomials);
        let each = |section: &mut Section<'_>| {
            let layout = &layouts[section.layout];
            section.free.copy_from_slice(&section.trial);
            section.linearize(if linear { layout.linear() } else { layout }, polynomials);
        };
        if self.sections.len() > 1 && self.samples >= PARALLEL_FROM {
            self.sections.par_iter_mut().for_each(each);
        } else {
            self.sections.iter_mut().for_each(each);
        }
    }

    /// The residuals that count, and the ranges of consecutive samples among them.
    pub(super) fn residuals(&self) -> (Vec<f64>, Vec<Range<usize>>) {
        let mut residuals = Vec::with_capacity(self.samples);
        let runs =
            self.sections.iter().flat_map(|section| section.runs.iter().map(move |run| (section, run)));
        let segments = runs.map(|(section, run)| {
            let first = residuals.len();
            residuals.extend_from_slice(&section.signals[0][run.clone()]);
            first..residuals.len()
        });
        let segments = segments.collect();
        (residuals, segments)
    }

    /// The residuals of each section, from the first that counts to the last: NaN where an output between them is
    /// missing.
    pub(super) fn residuals_by_section(&self) -> (Vec<f64>, Vec<Range<usize>>) {
        let mut errors = Vec::with_capacity(self.samples);
        let each = self.sections.iter().map(|section| {
            let (rows, first) = (section.span(), errors.len());
            errors.resize(first + rows.len(), f64::NAN);
            for run in &section.runs {
                let at = first + run.start - rows.start;
                errors[at..at + run.len()].copy_from_slice(&section.signals[0][run.clone()]);
            }
            first..errors.len()
        });
        let segments = each.collect();
        (errors, segments)
    }

    /// psi without the initial-condition responses for the same samples, a list for each parameter, zero where an
    /// output is missing. For models of output error, at the current point.
    pub(super) fn sensitivities(&self) -> Vec<Vec<f64>> {
        let mut all = vec![Vec::with_capacity(self.samples); self.right.len()];
        for (section, columns) in self.sections.iter().zip(self.columns()) {
            let (first, rows) = (self.layouts[section.layout].counted, section.span());
            for (all, column) in all.iter_mut().zip(columns) {
                all.extend_from_slice(&column[rows.start - first..rows.end - first]);
            }
        }
        all
    }

    /// sum zeta zeta' over all samples, zeta being `weights` psi without the initial-condition responses, zero where
    /// samples do not count, filtered backwards in time by 1/A(q^+1), A = `monic`. For models of output error, at the
    /// current point.
    pub(super) fn backward_filtered_products(&self, weights: &DMatrix<f64>, monic: &[f64]) -> DMatrix<f64> {
        let parameters = self.right.len();
        let mut sum = DMatrix::zeros(weights.nrows(), weights.nrows());
        for section in &self.sections {
            let combination = weights * section.without_free(parameters, section.free.len());
            let signals: Vec<&[f64]> = section.signals.iter().map(Vec::as_slice).collect();
            let all = 0..section.output.len();
            let taps = &self.layouts[section.layout].taps;
            sum += backward_filtered_products(&signals, taps, &all, &section.runs, Some(&combination), monic);
        }
        sum
    }

    /// The triangular factor of psi without the initial-condition responses, at the current point, as exact as
    /// Householder QR. 2 N (p + n)^2 flops for n initial-condition responses in a segment.
    ///
    /// # Errors
    /// If an entry is not finite, or too large for squares to be summed without overflow.
    pub(super) fn factor(&self) -> Result<LeastSquares<f64, Dyn>, thetahat_core::Error> {
        let parameters = self.right.len();
        let mut whole = LeastSquares::with_size(Dyn(parameters));
        for section in &self.sections {
            let layout = &self.layouts[section.layout];
            let free = layout.free;
            let count = parameters + free;
            let rows: Vec<usize> = section.runs.iter().cloned().flatten().collect();
            // Initial conditions take all that so few samples say.
            if rows.len() <= free {
                continue;
            }
            let entry = |number: usize, column: usize| section.sensitivity(layout, rows[number], column);
            let own = factor_rows(0..rows.len(), entry, count + 1)?;
            let triangle = own.factor().view((free, free), (parameters, parameters)).into_owned();
            let rotated = own.rotated_output().rows(free, parameters).into_owned();
            whole.merge(&LeastSquares::from_factor(
                &triangle,
                &rotated,
                own.residual_norm(),
                rows.len() - free,
            )?)?;
        }
        Ok(whole)
    }

    /// Writes the factor of psi and Q'e, with the weights of errors and the initial-condition responses taken out, at
    /// the current point: as exact as [`Self::factor`] but for what is lost over many samples, on memory that is taken
    /// once. 2 N p² flops.
    fn write_triangle(&mut self, into: &mut [f64]) {
        let parameters = self.right.len();
        if self.foldings.is_empty() {
            let sizes = self.layouts.iter().map(|layout| parameters + layout.free + 1);
            self.foldings = std::iter::once(parameters + 1).chain(sizes).map(Folding::new).collect();
        }
        let Some((whole, foldings)) = self.foldings.split_first_mut() else { return };
        whole.clear();
        for section in &self.sections {
            let (layout, own) = (&self.layouts[section.layout], &mut foldings[section.layout]);
            // Initial conditions take all that so few samples say.
            if section.runs.iter().map(Range::len).sum::<usize>() <= layout.free {
                continue;
            }
            own.clear();
            for run in &section.runs {
                for from in run.clone().step_by(Folding::ROWS) {
                    let rows = from..run.end.min(from + Folding::ROWS);
                    own.fold(rows.len(), |column, values| {
                        section.write_column(layout, &rows, column, values);
                        let Some(bound) = layout.bound else { return };
                        for (value, e) in values.iter_mut().zip(&section.signals[0][rows.clone()]) {
                            *value *= loss::weight(*e, bound).sqrt();
                        }
                    });
                }
            }
            for from in (0..parameters).step_by(Folding::ROWS) {
                whole.fold(Folding::ROWS.min(parameters - from), |column, values| {
                    for (value, row) in values.iter_mut().zip(layout.free + from..) {
                        *value = if row <= layout.free + column {
                            own.entry(row, layout.free + column)
                        } else {
                            0.0
                        };
                    }
                });
            }
        }
        for (place, value) in into.iter_mut().enumerate() {
            let (row, column) = (place / (parameters + 1), place % (parameters + 1));
            *value = if row <= column { whole.entry(row, column) } else { 0.0 };
        }
    }

    /// Sets the weights of the initial-condition responses to those that are best for a step of the parameters, to
    /// first order.
    pub(super) fn try_free(&mut self, step: &[f64]) {
        self.sections.iter_mut().for_each(|section| section.try_free(step));
    }

    /// Sets the weights back to those of the current point.
    pub(super) fn keep_free(&mut self) {
        self.sections.iter_mut().for_each(|section| section.trial.copy_from_slice(&section.free));
    }
}

/// Where the layout of sections with this past stands; it is made where there is none yet.
fn layout_of(
    layouts: &mut Vec<((InitialCondition, usize), Layout)>,
    orders: &Orders,
    begin: InitialCondition,
    past: usize,
    one: bool,
) -> usize {
    let known = layouts.iter().position(|(key, _)| *key == (begin, past));
    known.unwrap_or_else(|| {
        layouts.push(((begin, past), Layout::new(orders, begin, past, None, one)));
        layouts.len() - 1
    })
}

/// The samples of a section that count, from one on: those with a measured output.
fn runs(record: &Record<'_>, orders: &Orders, rows: &Range<usize>, first: usize) -> Vec<Range<usize>> {
    let counted = (rows.start + first).min(rows.end)..rows.end;
    let runs = if orders.needs_past_outputs() { vec![counted] } else { measured(record.output, &counted) };
    runs.into_iter().map(|run| run.start - rows.start..run.end - rows.start).collect()
}
