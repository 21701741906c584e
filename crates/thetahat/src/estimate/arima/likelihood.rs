//! The likelihood as what a search makes small, with its normal equations.

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, ComplexField, DMatrix};
use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::condition;

use super::{ArimaData, expected};
use crate::model::polynomial::{is_stable, multiply_out, roots};
use crate::model::{ArimaOrders, Factor};
use crate::respond::arima::ArimaProcess;

/// Roots of factors are inside this circle.
const INSIDE: f64 = 1.0 - 1e-6;
/// The step of differences of the gradient, in standard errors.
const STEP: f64 = 1e-4;
/// A root that a step takes out of the unit circle is moved back to this fraction of its distance before.
const NEARER: f64 = 0.2;

/// Why parameters have no likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unusable {
    /// A factor is not stable.
    Unstable,
    Overflow,
}

/// Rows that follow on one another.
struct Section<'a> {
    values: &'a [f64],
    columns: Vec<&'a [f64]>,
    /// Those with an expectation.
    rows: Range<usize>,
}

pub(super) struct Likelihood<'a> {
    orders: ArimaOrders,
    sections: Vec<Section<'a>>,
    /// How many columns there are.
    columns: usize,
    samples: usize,
    parameters: Vec<f64>,
    squares: f64,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl<'a> Likelihood<'a> {
    pub(super) fn new(data: &'a ArimaData<'_>, orders: &ArimaOrders) -> Self {
        let of = |segment: &Range<usize>| {
            let rows = expected(data.output, segment, orders.differences())?;
            let columns = data.columns.iter().map(|column| &column[segment.clone()]).collect();
            Some(Section { values: &data.output[segment.clone()], columns, rows })
        };
        let sections: Vec<Section<'a>> = data.segments.iter().filter_map(of).collect();
        let measured = |section: &Section<'_>| {
            section.values[section.rows.clone()].iter().filter(|value| !value.is_nan()).count()
        };
        let size = data.columns.len() + orders.parameters();
        Self {
            orders: *orders,
            samples: sections.iter().map(measured).sum(),
            sections,
            columns: data.columns.len(),
            parameters: vec![0.0; size],
            squares: 0.0,
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
        }
    }

    pub(super) fn orders(&self) -> &ArimaOrders {
        &self.orders
    }

    /// sum v^2/f at what was evaluated last.
    pub(super) fn squares(&self) -> f64 {
        self.squares
    }

    /// The differences of each section: of the values, NaN where one is missing, and of the columns.
    pub(super) fn differenced(&self) -> Vec<(Vec<f64>, Vec<Vec<f64>>)> {
        let delta = self.orders.differencing();
        let of = |values: &[f64], rows: &Range<usize>| -> Vec<f64> {
            let at = |row: usize| {
                delta
                    .iter()
                    .enumerate()
                    .filter(|(_, delta)| **delta != 0.0)
                    .map(move |(lag, delta)| (row - lag, *delta))
            };
            rows.clone().map(|row| at(row).map(|(row, delta)| delta * values[row]).sum()).collect()
        };
        let section = |section: &Section<'_>| {
            let columns = section.columns.iter().map(|column| of(column, &section.rows)).collect();
            (of(section.values, &section.rows), columns)
        };
        self.sections.iter().map(section).collect()
    }

    /// The inverse of the matrix of the normal equations, and the condition number of a psi with this Gram matrix; none
    /// where it is singular to rounding. Parameters that are `held` are taken for known: theirs are zeros.
    pub(super) fn inverse(&self, held: &[bool]) -> Option<(DMatrix<f64>, f64)> {
        let whole = self.right.len();
        let free: Vec<usize> = (0..whole).filter(|place| !held[*place]).collect();
        let size = free.len();
        if size == 0 {
            return Some((DMatrix::zeros(whole, whole), 1.0));
        }
        let matrix = DMatrix::from_fn(size, size, |i, j| self.matrix[free[i] * whole + free[j]]);
        let scales = matrix.diagonal().map(f64::sqrt);
        if !scales.iter().all(|scale| *scale > 0.0) {
            return None;
        }
        let unit = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] / scales[i] / scales[j]);
        let factor = Cholesky::new(unit)?;
        let condition = condition(&factor.l().transpose(), self.samples)?;
        let inverse = factor.inverse();
        let mut covariance = DMatrix::zeros(whole, whole);
        for i in 0..size {
            for j in 0..size {
                covariance[(free[i], free[j])] = inverse[(i, j)] / scales[i] / scales[j];
            }
        }
        Some((covariance, condition))
    }

    /// The information that was observed, half the second derivatives of the cost, in the place of that expected: of
    /// differences of the gradient that was linearised last, a small part of these standard errors away. Stays as it is
    /// where it is not positive definite, or a step leaves the region of stability. Efron and Hinkley (Biometrika 65
    /// (1978)) have why it is the better one.
    pub(super) fn observe(&mut self, at: &[f64], standard_errors: &[f64]) {
        let size = at.len();
        let (expected, here) = (std::mem::take(&mut self.matrix), self.right.clone());
        self.matrix = vec![0.0; size * size];
        let mut observed = vec![0.0; size * size];
        let mut gradient = |place: usize, step: f64| -> Option<Vec<f64>> {
            self.parameters.copy_from_slice(at);
            self.parameters[place] += step;
            if !self.is_inside() {
                return None;
            }
            self.linearize().ok()?;
            Some(self.right.clone())
        };
        let mut all = true;
        // Parameters without one are held.
        for (place, error) in standard_errors.iter().enumerate().filter(|(_, error)| **error > 0.0) {
            let step = STEP * error;
            let Some(there) = gradient(place, step) else {
                all = false;
                break;
            };
            for (other, (here, there)) in here.iter().zip(&there).enumerate() {
                // Half of each from both sides of the diagonal.
                let slope = (here - there) / (2.0 * step);
                observed[place * size + other] += slope;
                observed[other * size + place] += slope;
            }
        }
        for place in (0..size).filter(|place| standard_errors[*place] == 0.0) {
            observed[place * size + place] = 1.0;
        }
        let definite = all && Cholesky::new(DMatrix::from_row_slice(size, size, &observed)).is_some();
        self.parameters.copy_from_slice(at);
        self.matrix = if definite { observed } else { expected };
    }

    /// z of a section: its values less what the columns say of them.
    fn noise(&self, section: &Section<'_>) -> Vec<f64> {
        let mut noise = section.values.to_vec();
        for (column, weight) in section.columns.iter().zip(&self.parameters) {
            noise.iter_mut().zip(*column).for_each(|(noise, column)| *noise -= weight * column);
        }
        noise
    }

    /// Whether all factors are stable and invertible.
    fn is_inside(&self) -> bool {
        let mut scratch = Vec::new();
        let factors = self.orders.factors(&self.parameters[self.columns..]);
        factors.iter().all(|monic| is_stable(monic, &mut scratch))
    }

    /// Moves the roots of each factor of `trial` that is not stable back into the unit circle, nearer to it than those
    /// at `from`. A moving average is not reflected there: where the likelihood is largest on the circle, that ends
    /// halfway.
    fn moved_in(&self, from: &[f64], trial: &mut [f64]) -> bool {
        let orders = &self.orders;
        let (before, after) = (orders.factors(from), orders.factors(trial));
        let mut place = 0;
        let (mut scratch, mut product) = (Vec::new(), Vec::new());
        for ((factor, before), monic) in Factor::ALL.into_iter().zip(&before).zip(&after) {
            let count = monic.len() - 1;
            let own = &mut trial[place..place + count];
            place += count;
            if is_stable(monic, &mut scratch) {
                continue;
            }
            let (Some(were), Some(found)) = (roots(before), roots(monic)) else { return false };
            let outermost = were.iter().fold(0.0_f64, |most, root| most.max(root.modulus()));
            let radius = (1.0 - NEARER * (1.0 - outermost)).min(INSIDE);
            multiply_out(found.iter().map(|root| *root * (radius / root.modulus()).min(1.0)), &mut product);
            let sign = if factor.is_autoregressive() { -1.0 } else { 1.0 };
            own.iter_mut().zip(&product[1..]).for_each(|(value, product)| *value = sign * product.re);
        }
        orders.factors(trial).iter().all(|monic| is_stable(monic, &mut scratch))
    }
}

impl Objective for Likelihood<'_> {
    type Refusal = Unusable;

    fn samples(&self) -> usize {
        self.samples
    }

    fn linear(&self) -> Range<usize> {
        0..self.columns
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.parameters.copy_from_slice(parameters);
        if !self.is_inside() {
            return Err(Unusable::Unstable);
        }
        let own = &parameters[self.columns..];
        let process = ArimaProcess::new(&self.orders, own, false).ok_or(Unusable::Unstable)?;
        let (mut squares, mut logarithms) = (0.0, 0.0);
        for section in &self.sections {
            let found = process.scan(&self.noise(section), &[], section.rows.clone(), false);
            for (v, f) in found.errors.iter().zip(&found.variances).filter(|(v, _)| !v.is_nan()) {
                squares += v * v / f;
                logarithms += f.ln();
            }
        }
        self.squares = squares;
        let cost = squares * (logarithms / self.samples as f64).exp();
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
        let (size, columns) = (self.right.len(), self.columns);
        let samples = self.samples as f64;
        let (mut squares, mut logarithms) = (0.0, 0.0);
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        let own = size - columns;
        let process =
            ArimaProcess::new(&self.orders, &self.parameters[columns..], true).ok_or(Unusable::Unstable)?;
        let mut variances = vec![0.0; own * own];
        let mut logarithm_slopes = vec![0.0; own];
        let (mut slopes, mut relative) = (vec![0.0; size], vec![0.0; own]);
        for section in &self.sections {
            let found = process.scan(&self.noise(section), &section.columns, section.rows.clone(), true);
            for (t, (v, f)) in found.errors.iter().zip(&found.variances).enumerate() {
                if v.is_nan() {
                    continue;
                }
                squares += v * v / f;
                logarithms += f.ln();
                let (of_columns, of_factors) = slopes.split_at_mut(columns);
                of_columns.iter_mut().zip(&found.columns).for_each(|(slope, column)| *slope = -column[t]);
                of_factors.iter_mut().zip(&found.error_slopes).for_each(|(slope, own)| *slope = own[t]);
                relative.iter_mut().zip(&found.variance_slopes).for_each(|(slope, own)| *slope = own[t] / f);
                for (i, slope) in slopes.iter().enumerate() {
                    let weighted = slope / f;
                    self.right[i] -= v * weighted;
                    let row = self.matrix[i * size..][..=i].iter_mut().zip(&slopes);
                    row.for_each(|(sum, other)| *sum += weighted * other);
                }
                for (i, slope) in relative.iter().enumerate() {
                    self.right[columns + i] += 0.5 * v * v / f * slope;
                    logarithm_slopes[i] += slope;
                    let row = variances[i * own..][..=i].iter_mut().zip(&relative);
                    row.for_each(|(sum, other)| *sum += slope * other);
                }
            }
        }
        for i in 0..own {
            self.right[columns + i] -= 0.5 * squares / samples * logarithm_slopes[i];
            for j in 0..=i {
                let both = variances[i * own + j] - logarithm_slopes[i] * logarithm_slopes[j] / samples;
                self.matrix[(columns + i) * size + columns + j] += 0.5 * squares / samples * both;
            }
        }
        // All of it is in units of S so far.
        let scale = (logarithms / samples).exp();
        for i in 0..size {
            self.right[i] *= scale;
            for j in 0..=i {
                self.matrix[i * size + j] *= scale;
                self.matrix[j * size + i] = self.matrix[i * size + j];
            }
        }
        Ok(0.0)
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
        let columns = self.columns;
        self.moved_in(&from[columns..], &mut trial[columns..])
    }
}
