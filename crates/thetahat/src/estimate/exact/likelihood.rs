//! The exact likelihood of the outputs of a record as a function of the parameters.

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, DMatrix};
use thetahat_numerics::optimize::{Objective, normal};
use thetahat_numerics::regression::{condition, divide, divide_from};

use super::kalman::{Filter, Process};
use crate::data::Record;
use crate::estimate::{
    polynomials::{Polynomials, Unusable},
    stability_boundary::StabilityBoundary,
};
use crate::model::{Orders, polynomial::is_stable};

/// What the response to the inputs starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InitialCondition {
    /// Rest: inputs before the segment, and their response, are zero.
    Rest,
    /// An unknown state, estimated for each segment; inputs that were measured before it are used.
    Free,
}

/// A segment, with the rows before it whose inputs are used.
#[derive(Debug)]
struct Section<'a> {
    output: &'a [f64],
    inputs: Vec<&'a [f64]>,
    /// The first row of the segment itself.
    first: usize,
    measured: usize,
    /// The weights of impulses into 1/A in its first rows: of the current point, and tried.
    free: Vec<f64>,
    trial: Vec<f64>,
    /// For the normal equations: the factor of the weights' own matrix, its part with the parameters, and the
    /// right-hand side.
    factor: Vec<f64>,
    cross: Vec<f64>,
    right: Vec<f64>,
}

/// v = level + slope t in row t of a section, before it and in it.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    level: f64,
    slope: f64,
}

impl Line {
    /// The line x with A x = self: A(q) t = A(1) t - sum_i i a_i.
    fn over(self, a: &[f64]) -> Self {
        let gain: f64 = a.iter().sum();
        let delay: f64 = a.iter().enumerate().map(|(lag, a)| lag as f64 * a).sum();
        let slope = self.slope / gain;
        Self { level: (self.level + slope * delay) / gain, slope }
    }

    fn before(self, count: usize) -> impl Iterator<Item = f64> {
        (1..=count).rev().map(move |lag| self.level - self.slope * lag as f64)
    }

    fn plus(self, weight: f64, other: Self) -> Self {
        Self { level: self.level + weight * other.level, slope: self.slope + weight * other.slope }
    }
}

/// The sums of one pass over the record.
#[derive(Debug, Default)]
struct Sums {
    /// sum v^2/f and sum ln f.
    squares: f64,
    logarithms: f64,
}

/// The exact likelihood: see the module above. Everything is in the units of a sum of squares,
///
/// ```text
/// cost = S exp(sum ln f/N),   S = sum v^2/f,   -2 ln L = N (ln(2 pi cost/N) + 1)
/// ```
#[derive(Debug)]
pub(super) struct Likelihood<'a> {
    orders: Orders,
    /// How many of the inputs, the last ones, are lines that go on before the record.
    lines: usize,
    polynomials: Polynomials,
    sections: Vec<Section<'a>>,
    samples: usize,
    sums: Sums,
    matrix: Vec<f64>,
    right: Vec<f64>,
    scratch: Vec<f64>,
    stability_boundary: StabilityBoundary,
}

impl<'a> Likelihood<'a> {
    /// Segments without more measured outputs than they have initial-condition responses are left out.
    pub(super) fn new(record: &Record<'a>, orders: &Orders, lines: usize, begin: InitialCondition) -> Self {
        let driving = 0..orders.inputs() - lines;
        let lag = driving.map(|input| orders.maximum_input_lag(input)).max();
        let mut sections = Vec::new();
        for (segment, past) in record.segments.iter().zip(&record.past) {
            let known = if begin == InitialCondition::Rest { 0 } else { lag.unwrap_or(0).min(*past) };
            let free = match (begin, lag) {
                (InitialCondition::Free, Some(lag)) if lag > 0 => orders.na.max(lag - known),
                _ => 0,
            };
            let rows = segment.start - known..segment.end;
            let measured = record.output[segment.clone()].iter().filter(|y| !y.is_nan()).count();
            if measured > free {
                sections.push(Section {
                    output: &record.output[rows.clone()],
                    inputs: record.inputs.iter().map(|input| &input[rows.clone()]).collect(),
                    first: known,
                    measured,
                    free: vec![0.0; free],
                    trial: vec![0.0; free],
                    factor: Vec::new(),
                    cross: Vec::new(),
                    right: Vec::new(),
                });
            }
        }
        let parameters = orders.parameters();
        Self {
            samples: sections.iter().map(|section| section.measured).sum(),
            polynomials: Polynomials::new(orders, &vec![0.0; parameters]),
            orders: orders.clone(),
            lines,
            sections,
            sums: Sums::default(),
            matrix: vec![0.0; parameters * parameters],
            right: vec![0.0; parameters],
            scratch: Vec::new(),
            stability_boundary: StabilityBoundary::new(orders, true),
        }
    }

    /// sum v^2/f at what was evaluated last.
    pub(super) fn squares(&self) -> f64 {
        self.sums.squares
    }

    /// The inverse of the matrix of the normal equations, row by row, and the condition number of a psi with this Gram
    /// matrix; none where it is singular to rounding.
    pub(super) fn inverse(&self) -> Option<(DMatrix<f64>, f64)> {
        let size = self.right.len();
        let matrix = DMatrix::from_row_slice(size, size, &self.matrix);
        let scales = matrix.diagonal().map(f64::sqrt);
        if !scales.iter().all(|scale| *scale > 0.0) {
            return None;
        }
        let unit = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] / scales[i] / scales[j]);
        let factor = Cholesky::new(unit)?;
        let condition = condition(&factor.l().transpose(), self.samples)?;
        let inverse = factor.inverse();
        let covariance = DMatrix::from_fn(size, size, |i, j| inverse[(i, j)] / scales[i] / scales[j]);
        Some((covariance, condition))
    }

    /// Where the coefficients of A and C stand among the parameters.
    fn places(&self) -> Vec<usize> {
        let after = self.orders.na + self.orders.nb.iter().sum::<usize>();
        (0..self.orders.na).chain(after..after + self.orders.nc).collect()
    }
}

/// The signals of a section that the response to the inputs and its derivatives are made of. Each begins `lead` rows
/// before the section, with zeros or as a line.
struct Signals {
    lead: usize,
    /// x, what the inputs do to the output.
    response: Vec<f64>,
    /// x/A; none where no derivatives are wanted.
    twice: Vec<f64>,
    /// u_j/A.
    inputs: Vec<Vec<f64>>,
    /// An impulse into 1/A.
    impulse: Vec<f64>,
}

impl Signals {
    fn new(
        section: &Section<'_>,
        orders: &Orders,
        lines: usize,
        polynomials: &Polynomials,
        slopes: bool,
    ) -> Self {
        let Polynomials { a, b, .. } = polynomials;
        let rows = section.output.len();
        let lead = orders.maximum_lag().max(1);
        let driving = orders.inputs() - lines;
        let mut beyond = Line::default();
        let mut response = vec![0.0; lead + rows];
        let mut impulse = vec![0.0; if section.free.is_empty() { 0 } else { rows - section.first }];
        if let Some(first) = impulse.first_mut() {
            *first = 1.0;
            divide(a, &mut impulse);
        }
        let mut inputs = Vec::with_capacity(orders.inputs());
        for (input, u) in section.inputs.iter().enumerate() {
            if orders.nb[input] == 0 {
                inputs.push(Vec::new());
                continue;
            }
            let mut own = vec![0.0; lead];
            own.extend_from_slice(u);
            if input < driving {
                divide(a, &mut own[lead..]);
            } else {
                let last = rows - 1;
                let slope = if last > 0 { (u[last] - u[0]) / last as f64 } else { 0.0 };
                let line = Line { level: u[0], slope }.over(a);
                own.iter_mut().zip(line.before(lead)).for_each(|(own, before)| *own = before);
                let (before, after) = own.split_at_mut(lead);
                divide_from(&a[1..], before, after);
                beyond = beyond.plus(b[input][0], line);
            }
            for (lag, b) in (orders.nk[input]..).zip(&b[input]) {
                // What a line does before the section is what it does in the first sample before, and so on.
                let known = lag.min(lead + rows);
                let moved = response[known..].iter_mut().zip(&own);
                moved.for_each(|(sum, own)| *sum += b * own);
            }
            inputs.push(own);
        }
        for (delay, weight) in section.trial.iter().enumerate() {
            let from = lead + section.first + delay;
            response.iter_mut().skip(from).zip(&impulse).for_each(|(sum, own)| *sum += weight * own);
        }
        let mut twice = Vec::new();
        if slopes && orders.na > 0 {
            twice.clone_from(&response);
            let (before, after) = twice.split_at_mut(lead);
            before.iter_mut().zip(beyond.over(a).before(lead)).for_each(|(own, line)| *own = line);
            divide_from(&a[1..], before, after);
        }
        Self { lead, response, twice, inputs, impulse }
    }

    /// The derivatives of x in a row of the section, with the other sign.
    fn negative_slopes(&self, section: &Section<'_>, orders: &Orders, row: usize, slopes: &mut [f64]) {
        let at = self.lead + row;
        let (a, rest) = slopes.split_at_mut(orders.na);
        for (lag, slope) in a.iter_mut().enumerate() {
            *slope = self.twice[at - lag - 1];
        }
        let (mut b, rest) = rest.split_at_mut(orders.nb.iter().sum());
        for (input, (&nb, &nk)) in self.inputs.iter().zip(orders.nb.iter().zip(&orders.nk)) {
            let (own, others) = std::mem::take(&mut b).split_at_mut(nb);
            for (lag, slope) in (nk..).zip(own) {
                *slope = -input[at - lag];
            }
            b = others;
        }
        let (_, free) = rest.split_at_mut(orders.nc);
        for (delay, slope) in free.iter_mut().enumerate() {
            let since = row.checked_sub(section.first + delay);
            *slope = since.map_or(0.0, |since| -self.impulse[since]);
        }
    }
}

impl Objective for Likelihood<'_> {
    type Refusal = Unusable;

    fn samples(&self) -> usize {
        self.samples
    }

    fn initial_conditions(&self) -> usize {
        self.sections.iter().map(|section| section.free.len()).sum()
    }

    fn linear(&self) -> Range<usize> {
        self.orders.na..self.orders.na + self.orders.nb.iter().sum::<usize>()
    }

    fn restart(&mut self) {
        for section in &mut self.sections {
            section.free.fill(0.0);
            section.trial.fill(0.0);
        }
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.polynomials.set(parameters);
        let Polynomials { a, c, .. } = &self.polynomials;
        if ![a, c].into_iter().all(|monic| is_stable(monic, &mut self.scratch)) {
            return Err(Unusable::Unstable);
        }
        let process = Process::new(a, c, false).ok_or(Unusable::Overflow)?;
        let mut sums = Sums::default();
        for section in &self.sections {
            let signals = Signals::new(section, &self.orders, self.lines, &self.polynomials, false);
            let mut filter = Filter::new(&process, 0, &[]);
            for (row, y) in section.output.iter().enumerate().skip(section.first) {
                if y.is_nan() {
                    filter.missing();
                    continue;
                }
                let innovation = filter.measured(y - signals.response[signals.lead + row], &[]);
                sums.squares += innovation.value * innovation.value / innovation.variance;
                sums.logarithms += innovation.variance.ln();
            }
        }
        self.sums = sums;
        let cost = self.sums.squares * (self.sums.logarithms / self.samples as f64).exp();
        if cost.is_finite() { Ok(cost) } else { Err(Unusable::Overflow) }
    }

    /// With dv and df the derivatives of an innovation and of its variance, the information of the parameters, var e
    /// known up to its own estimate S/N, is
    ///
    /// ```text
    /// I = N/S sum dv dv'/f + 1/2 sum df df'/f^2 - 1/(2 N) (sum df/f) (sum df/f)'
    /// ```
    ///
    /// (Harvey 1989, section 3.4.5, and the part of var e taken out), and -grad ln L = N/2 grad ln cost. So the normal
    /// equations of a Gauss-Newton step of the cost are those of Fisher scoring times cost/N.
    fn linearize(&mut self) -> Result<f64, Unusable> {
        let (size, places) = (self.right.len(), self.places());
        let (samples, Sums { squares, logarithms }) = (self.samples as f64, &self.sums);
        let scale = (logarithms / samples).exp();
        let cost = squares * scale;
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        let Polynomials { a, c, .. } = &self.polynomials;
        // Where it was evaluated, it has a covariance.
        let Some(process) = Process::new(a, c, true) else { return Ok(0.0) };
        let known = places.len();
        let mut variances = vec![0.0; known * known];
        let mut logarithm_slopes = vec![0.0; known];
        let mut gain = 0.0;
        for section in &mut self.sections {
            section.free.copy_from_slice(&section.trial);
            let free = section.free.len();
            let columns = size + free;
            let signals = Signals::new(section, &self.orders, self.lines, &self.polynomials, true);
            let mut filter = Filter::new(&process, columns, &places);
            let mut slopes = vec![0.0; columns];
            let mut matrix = vec![0.0; columns * columns];
            let mut right = vec![0.0; columns];
            for (row, y) in section.output.iter().enumerate().skip(section.first) {
                if y.is_nan() {
                    filter.missing();
                    continue;
                }
                signals.negative_slopes(section, &self.orders, row, &mut slopes);
                let innovation = filter.measured(y - signals.response[signals.lead + row], &slopes);
                let (v, f) = (innovation.value, innovation.variance);
                for (i, slope) in innovation.slopes.iter().enumerate() {
                    let weighted = slope / f;
                    right[i] -= scale * v * weighted;
                    let own = matrix[i * columns..][..=i].iter_mut().zip(innovation.slopes);
                    own.for_each(|(sum, other)| *sum += scale * weighted * other);
                }
                for (i, slope) in innovation.variance_slopes.iter().enumerate() {
                    let relative = slope / f;
                    right[places[i]] += 0.5 * scale * v * v / f * relative;
                    logarithm_slopes[i] += relative;
                    for (j, other) in innovation.variance_slopes.iter().enumerate() {
                        variances[i * known + j] += relative * other / f;
                    }
                }
            }
            let entry = |i: usize, j: usize| matrix[i.max(j) * columns + i.min(j)];
            section.factor = (0..free * free).map(|at| entry(size + at / free, size + at % free)).collect();
            section.cross = (0..free * size).map(|at| entry(size + at / size, at % size)).collect();
            section.right = right[size..].to_vec();
            normal::factor(&mut section.factor, free);
            // H_ff^-1 of each column of H_fp, and of the right-hand side.
            let mut best = section.right.clone();
            normal::solve(&section.factor, free, &mut best);
            gain += best.iter().zip(&section.right).map(|(best, right)| best * right).sum::<f64>();
            for (i, own) in right.iter().enumerate().take(size) {
                let mut solved: Vec<f64> = (0..free).map(|k| section.cross[k * size + i]).collect();
                normal::solve(&section.factor, free, &mut solved);
                let through = |column: &dyn Fn(usize) -> f64| -> f64 {
                    solved.iter().enumerate().map(|(k, solved)| solved * column(k)).sum()
                };
                self.right[i] += own - through(&|k| section.right[k]);
                for j in 0..size {
                    self.matrix[i * size + j] += entry(i, j) - through(&|k| section.cross[k * size + j]);
                }
            }
        }
        for (i, place) in places.iter().enumerate() {
            self.right[*place] -= 0.5 * cost / samples * logarithm_slopes[i];
            for (j, other) in places.iter().enumerate() {
                let both = variances[i * known + j] - logarithm_slopes[i] * logarithm_slopes[j] / samples;
                self.matrix[place * size + other] += 0.5 * cost / samples * both;
            }
        }
        Ok(gain)
    }

    fn try_free(&mut self, step: &[f64]) {
        for section in &mut self.sections {
            let size = step.len();
            let mut best = section.right.clone();
            for (k, best) in best.iter_mut().enumerate() {
                let row = &section.cross[k * self.right.len()..][..size];
                *best -= row.iter().zip(step).map(|(cross, step)| cross * step).sum::<f64>();
            }
            normal::solve(&section.factor, section.free.len(), &mut best);
            section.trial.copy_from_slice(&section.free);
            section.trial.iter_mut().zip(&best).for_each(|(trial, best)| *trial += best);
        }
    }

    fn keep_free(&mut self) {
        self.sections.iter_mut().for_each(|section| section.trial.copy_from_slice(&section.free));
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn is_outside(refusal: &Unusable) -> bool {
        *refusal == Unusable::Unstable
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        self.stability_boundary.draw_in(from, trial)
    }
}
