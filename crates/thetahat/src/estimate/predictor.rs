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
//! A segment starts with samples that nothing is known of. What they do to x_j is a combination of free responses
//! q^-i (1/F_j) delta, i = 0, 1, …, with weights that are estimated too, apart for each segment: they enter e linearly and are
//! eliminated from the normal equations. For the other polynomials v = D w is set to zero in the first r samples, which
//! do not count; nor need some after them, while what 1/C makes of that dies away. Then psi is a shifted copy only up to what the mask cuts off. With z the signal before the mask and g the impulse
//! response of 1/C from sample r on,
//!
//! ```text
//! (1/C) mask(q^-i z) = q^-i (1/C) mask(z) + sum_{k < i} z(r + k - i) q^-k g,
//! ```
//!
//! so that shifts of g complete the Gram matrix exactly.

mod columns;
mod section;
#[cfg(test)]
mod tests;
mod weighted;

use std::ops::Range;

use rayon::prelude::*;
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{Cholesky, DMatrix, Dyn};

use super::uncertainty::{backward_filtered_products, columns};
use crate::Orders;
use crate::data::Record;
use crate::model::polynomial::is_stable;
use crate::regression::{Products, Taps, factor_rows};
use section::Section;

/// Samples from which threads pay for themselves.
const PARALLEL_FROM: usize = 1 << 15;

/// The polynomials of a parameter vector.
#[derive(Debug)]
pub(super) struct Polynomials {
    pub(super) a: Vec<f64>,
    /// Without the leading zeros.
    pub(super) b: Vec<Vec<f64>>,
    pub(super) c: Vec<f64>,
    pub(super) d: Vec<f64>,
    pub(super) f: Vec<Vec<f64>>,
}

impl Polynomials {
    pub(super) fn new(orders: &Orders, parameters: &[f64]) -> Self {
        let monic = |order: usize| [vec![1.0], vec![0.0; order]].concat();
        let mut polynomials = Self {
            a: monic(orders.na),
            b: orders.nb.iter().map(|&nb| vec![0.0; nb]).collect(),
            c: monic(orders.nc),
            d: monic(orders.nd),
            f: orders.nf.iter().map(|&nf| monic(nf)).collect(),
        };
        polynomials.set(parameters);
        polynomials
    }

    fn set(&mut self, mut parameters: &[f64]) {
        let mut fill = |values: &mut [f64]| {
            let (own, rest) = parameters.split_at(values.len());
            values.copy_from_slice(own);
            parameters = rest;
        };
        fill(&mut self.a[1..]);
        self.b.iter_mut().for_each(|b| fill(b));
        fill(&mut self.c[1..]);
        fill(&mut self.d[1..]);
        self.f.iter_mut().for_each(|f| fill(&mut f[1..]));
    }

    /// The parameters in their order.
    pub(super) fn parameters(&self) -> Vec<f64> {
        let mut parameters = self.a[1..].to_vec();
        self.b.iter().for_each(|b| parameters.extend(b));
        parameters.extend(&self.c[1..]);
        parameters.extend(&self.d[1..]);
        self.f.iter().for_each(|f| parameters.extend(&f[1..]));
        parameters
    }

    /// Whether the predictor is stable: C and every F are.
    fn are_stable(&self, scratch: &mut Vec<f64>) -> bool {
        is_stable(&self.c, scratch) && self.f.iter().all(|f| is_stable(f, scratch))
    }
}

/// Which signals there are, and which columns of psi are made of them.
#[derive(Debug)]
struct Layout {
    orders: Orders,
    /// Those of the parameters in their order, then of the free responses, then of g. Signal 0 is e.
    taps: Vec<Taps>,
    /// Signal, position among the products, lag and sign, one for each column.
    columns: Vec<Column>,
    products: Products,
    parameters: usize,
    free: usize,
    /// r, the first samples in which e = 0.
    masked: usize,
    /// The first sample that counts, r or later.
    counted: usize,
    /// From where on errors count linearly; none: they count by their squares.
    bound: Option<f64>,
    /// Whether there are free responses that begin before it, beside the mask.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    /// All earlier samples are zero, and all samples count.
    Zero,
    /// Nothing is known of earlier samples.
    Unknown,
}

impl Layout {
    fn new(orders: &Orders, begin: Begin, silent: usize, counted: usize) -> Self {
        let inputs = orders.inputs();
        let unknown = begin == Begin::Unknown;
        let masked = if unknown { silent.max(orders.conditioned()) } else { 0 };
        let free = |input: usize| if unknown { orders.free_responses(input) } else { 0 };
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
        let zero = frees.iter().enumerate();
        taps.extend(zero.map(|(input, &signal)| Taps { signal, first: 0, count: free(input), sign: 1.0 }));
        let used = taps.iter().filter(|taps| taps.count > 0);
        let longest = used.map(|taps| taps.first + taps.count - 1).max().unwrap_or(0);
        let corrections = if masked > 0 { longest } else { 0 };
        taps.push(Taps { signal: impulse, first: 0, count: corrections, sign: 1.0 });
        let products = Products::new(&taps);
        let columns = taps.iter().flat_map(|taps| {
            let products = &products;
            (0..taps.count).map(move |i| {
                let (signal, lag) = (taps.signal, taps.first + i);
                Column { signal, position: products.position(signal, lag), lag, sign: taps.sign }
            })
        });
        let used = |signal: &usize| taps.iter().any(|taps| taps.signal == *signal && taps.count > 0);
        let all = || std::iter::once(output).chain(own.iter().chain(&responses).copied());
        let filtered = all().chain([error, disturbance]).filter(used).collect();
        Self {
            filtered,
            with_noise_denominator: all().filter(used).collect(),
            columns: columns.collect(),
            parameters: orders.parameters(),
            free: (0..inputs).map(free).sum(),
            orders: orders.clone(),
            taps,
            products,
            masked,
            counted: counted.max(masked),
            bound: None,
            faded: counted > masked && (0..inputs).any(|input| free(input) > 0),
            output,
            inputs: own,
            error,
            disturbance,
            responses,
            frees,
            impulse,
            signals,
        }
    }
}

/// The prediction errors of a record as a function of the parameters. Memory is taken when it is made; nothing that it
/// does afterwards takes more, unless errors count linearly from somewhere on.
#[derive(Debug)]
pub(super) struct Predictor<'a> {
    layout: Layout,
    polynomials: Polynomials,
    /// -B, for the inputs without F.
    negative: Vec<Vec<f64>>,
    sections: Vec<Section<'a>>,
    samples: usize,
    stability: Vec<f64>,
    /// The normal equations of the parameters, the free responses taken out.
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
}

impl<'a> Predictor<'a> {
    /// Segments without a sample that counts, or with no more than the free responses need, are left out.
    pub(super) fn new(record: &Record<'a>, orders: &Orders, begin: Begin) -> Self {
        Self::counting(record, orders, begin, 0, 0)
    }

    /// The same with e = 0 in so many first samples of each segment, or more; and so many of them, or more, do not count.
    pub(super) fn counting(
        record: &Record<'a>,
        orders: &Orders,
        begin: Begin,
        silent: usize,
        counted: usize,
    ) -> Self {
        let layout = Layout::new(orders, begin, silent, counted);
        let needed = layout.counted.max(layout.free);
        let usable = record.segments.iter().filter(|segment| segment.len() > needed);
        let sections: Vec<Section<'a>> =
            usable.clone().map(|segment| Section::new(record, segment, &layout)).collect();
        let parameters = layout.parameters;
        Self {
            samples: usable.map(|segment| segment.len() - layout.counted).sum(),
            polynomials: Polynomials::new(orders, &vec![0.0; parameters]),
            negative: orders.nb.iter().map(|&nb| vec![0.0; nb]).collect(),
            stability: Vec::with_capacity(orders.nf.iter().copied().fold(orders.nc, usize::max)),
            matrix: vec![0.0; parameters * parameters],
            right: vec![0.0; parameters],
            layout,
            sections,
        }
    }

    /// N, the samples that count.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// The initial conditions of all segments.
    pub(super) fn initial_conditions(&self) -> usize {
        self.layout.free * self.sections.len()
    }

    /// ln det(I + `ratio` G) of the free responses' part G of the Gram matrix, at the current point, over all segments.
    pub(super) fn free_information(&self, ratio: f64) -> f64 {
        let (parameters, free) = (self.layout.parameters, self.layout.free);
        let of = |section: &Section<'_>| {
            let entry =
                |i: usize, j: usize| section.gram[(parameters + i) * (parameters + free) + parameters + j];
            let one = DMatrix::identity(free, free);
            let matrix = one + ratio * DMatrix::from_fn(free, free, entry);
            Cholesky::new(matrix)
                .map_or(f64::INFINITY, |factor| 2.0 * factor.l().diagonal().map(f64::ln).sum())
        };
        self.sections.iter().map(of).sum()
    }

    /// Forgets the weights of the free responses.
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
        let (layout, polynomials, negative) = (&self.layout, &self.polynomials, &self.negative);
        let each = |section: &mut Section<'_>| {
            if layout.faded {
                section.project(layout, polynomials, negative);
            }
            section.evaluate(layout, polynomials, negative);
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
    /// free responses alone can lower the cost.
    pub(super) fn linearize(&mut self) -> f64 {
        let (layout, polynomials) = (&self.layout, &self.polynomials);
        let each = |section: &mut Section<'_>| {
            section.free.copy_from_slice(&section.trial);
            section.linearize(layout, polynomials);
        };
        if self.sections.len() > 1 && self.samples >= PARALLEL_FROM {
            self.sections.par_iter_mut().for_each(each);
        } else {
            self.sections.iter_mut().for_each(each);
        }
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        for section in &self.sections {
            section.add_normal(layout, &mut self.matrix, &mut self.right);
        }
        self.sections.iter().map(|section| section.free_gain).sum()
    }

    /// The errors that count, and the stretches of them that follow one another.
    pub(super) fn residuals(&self) -> (Vec<f64>, Vec<Range<usize>>) {
        let mut residuals = Vec::with_capacity(self.samples);
        let segments = self.sections.iter().map(|section| {
            let first = residuals.len();
            residuals.extend_from_slice(&section.signals[0][self.layout.counted..]);
            first..residuals.len()
        });
        let segments = segments.collect();
        (residuals, segments)
    }

    /// psi without the free responses over the samples that count, a list for each parameter. For models of output error, at the
    /// current point.
    pub(super) fn sensitivities(&self) -> Vec<Vec<f64>> {
        let (parameters, free) = (self.layout.parameters, self.layout.free);
        let mut all = vec![Vec::with_capacity(self.samples); parameters];
        for section in &self.sections {
            let signals: Vec<&[f64]> = section.signals.iter().map(Vec::as_slice).collect();
            let (whole, rows) = (0..section.output.len(), self.layout.counted..section.output.len());
            let combination = section.without_free(parameters, free);
            let own = columns(&signals, &self.layout.taps, &whole, &rows, Some(&combination));
            all.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
        }
        all
    }

    /// sum zeta zeta' over all samples, zeta being psi without the free responses, filtered backwards in time by
    /// 1/A(q^+1), A = `monic`. For models of output error, at the current point.
    pub(super) fn backward_filtered_products(&self, monic: &[f64]) -> DMatrix<f64> {
        let (parameters, free) = (self.layout.parameters, self.layout.free);
        let mut sum = DMatrix::zeros(parameters, parameters);
        for section in &self.sections {
            let combination = section.without_free(parameters, free);
            let signals: Vec<&[f64]> = section.signals.iter().map(Vec::as_slice).collect();
            let all = 0..section.output.len();
            let taps = &self.layout.taps;
            sum += backward_filtered_products(&signals, taps, &all, &all, Some(&combination), monic);
        }
        sum
    }

    /// The triangular factor of psi without the free responses, at the current point, as exact as Householder QR.
    /// 2 N (p + n)^2 flops for n free responses in a segment.
    ///
    /// # Errors
    /// If an entry is not finite, or too large for squares to be summed without overflow.
    pub(super) fn factor(&self) -> Result<LeastSquares<f64, Dyn>, thetahat_core::Error> {
        let layout = &self.layout;
        let (parameters, free) = (layout.parameters, layout.free);
        let count = parameters + free;
        let (columns, shifts) = layout.columns.split_at(count);
        let mut whole = LeastSquares::with_size(Dyn(parameters));
        for section in &self.sections {
            let entry = |row: usize, column: usize| {
                // The free responses come first: what is left of the parameters stands below them in the factor.
                let index = if column < free { parameters + column } else { column - free };
                let Some(Column { signal, lag, sign, .. }) = columns.get(index) else {
                    return section.signals[0][row];
                };
                let at = |signal: usize, lag: usize| {
                    if row < lag { 0.0 } else { section.signals[signal][row - lag] }
                };
                let weights = &section.corrections[index * shifts.len()..][..shifts.len()];
                let corrections =
                    shifts.iter().zip(weights).map(|(shift, weight)| weight * at(shift.signal, shift.lag));
                sign * at(*signal, *lag) + corrections.sum::<f64>()
            };
            let rows = layout.counted..section.output.len();
            let own = factor_rows(rows.clone(), entry, count + 1)?;
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

    /// Sets the weights of the free responses to those that are best for a step of the parameters, to first order.
    pub(super) fn try_free(&mut self, step: &[f64]) {
        self.sections.iter_mut().for_each(|section| section.try_free(step));
    }

    /// Sets the weights back to those of the current point.
    pub(super) fn keep_free(&mut self) {
        self.sections.iter_mut().for_each(|section| section.trial.copy_from_slice(&section.free));
    }
}

/// Why parameters have no cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unusable {
    /// C or F has a root outside the unit circle.
    Unstable,
    /// The errors overflow.
    Overflow,
}
