//! The likelihood as what a search makes small, with its normal equations.

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, Complex, ComplexField, DMatrix};
use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::condition;

use super::{ArimaData, expected};
use crate::model::polynomial::{Roots, is_stable, multiply_out};
use crate::model::{ArimaOrders, Factor};
use crate::respond::arima::ArimaProcess;

/// Roots of factors are inside this circle.
const INSIDE: f64 = 1.0 - 1e-6;
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
    logarithms: f64,
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
            logarithms: 0.0,
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
            let at = |row: usize| delta.iter().enumerate().filter(|(_, delta)| **delta != 0.0).map(move |(lag, delta)| (row - lag, *delta));
            rows.clone().map(|row| at(row).map(|(row, delta)| delta * values[row]).sum()).collect()
        };
        let section = |section: &Section<'_>| {
            let columns = section.columns.iter().map(|column| of(column, &section.rows)).collect();
            (of(section.values, &section.rows), columns)
        };
        self.sections.iter().map(section).collect()
    }

    /// The inverse of the matrix of the normal equations, and the condition number of a psi with this Gram matrix; none
    /// where it is singular to rounding.
    pub(super) fn inverse(&self) -> Option<(DMatrix<f64>, f64)> {
        let size = self.right.len();
        if size == 0 {
            return Some((DMatrix::zeros(0, 0), 1.0));
        }
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

    /// z of a section: its values less what the columns say of them.
    fn noise(&self, section: &Section<'_>) -> Vec<f64> {
        let mut noise = section.values.to_vec();
        for (column, weight) in section.columns.iter().zip(&self.parameters) {
            noise.iter_mut().zip(*column).for_each(|(noise, column)| *noise -= weight * column);
        }
        noise
    }

    /// Makes each factor stable whose roots are not: those of a moving average are reflected at the unit circle, which
    /// leaves the likelihood as it is, those of an autoregression move back to it, nearer than those of `from`.
    pub(super) fn drawn_in(orders: &ArimaOrders, from: Option<&[f64]>, trial: &mut [f64]) -> bool {
        let factors = orders.factors(trial);
        let before = from.map(|from| orders.factors(from));
        let mut place = 0;
        let (mut scratch, mut product) = (Vec::new(), Vec::new());
        for (number, (factor, monic)) in Factor::ALL.into_iter().zip(&factors).enumerate() {
            let count = monic.len() - 1;
            if !is_stable(monic, &mut scratch) {
                let mut memory = Roots::with_capacity(count + 1);
                let outermost = |monic: &[f64], memory: &mut Roots| {
                    Some(memory.of(monic)?.iter().fold(0.0_f64, |most, root| most.max(root.modulus())))
                };
                let radius = match &before {
                    Some(before) => {
                        let Some(outermost) = outermost(&before[number], &mut memory) else { return false };
                        1.0 - NEARER * (1.0 - outermost)
                    }
                    None => INSIDE,
                };
                let Some(found) = memory.of(monic) else { return false };
                let moved = |root: &Complex<f64>| {
                    let modulus = root.modulus();
                    if modulus < 1.0 {
                        *root
                    } else if factor.is_autoregressive() {
                        *root * (radius.min(INSIDE) / modulus)
                    } else {
                        *root * ((1.0 / modulus).min(INSIDE) / modulus)
                    }
                };
                multiply_out(found.iter().map(moved), &mut product);
                let sign = if factor.is_autoregressive() { -1.0 } else { 1.0 };
                for (value, own) in trial[place..place + count].iter_mut().zip(&product[1..]) {
                    *value = sign * own.re;
                }
            }
            place += count;
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
        let own = &parameters[self.columns..];
        let mut scratch = Vec::new();
        if !self.orders.factors(own).iter().all(|monic| is_stable(monic, &mut scratch)) {
            return Err(Unusable::Unstable);
        }
        let process = ArimaProcess::new(&self.orders, own, false).ok_or(Unusable::Unstable)?;
        let (mut squares, mut logarithms) = (0.0, 0.0);
        for section in &self.sections {
            let found = process.scan(&self.noise(section), &[], section.rows.clone(), false);
            for (v, f) in found.errors.iter().zip(&found.variances).filter(|(v, _)| !v.is_nan()) {
                squares += v * v / f;
                logarithms += f.ln();
            }
        }
        (self.squares, self.logarithms) = (squares, logarithms);
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
        let scale = (self.logarithms / samples).exp();
        let cost = self.squares * scale;
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
                let (of_columns, of_factors) = slopes.split_at_mut(columns);
                of_columns.iter_mut().zip(&found.columns).for_each(|(slope, column)| *slope = -column[t]);
                of_factors.iter_mut().zip(&found.error_slopes).for_each(|(slope, own)| *slope = own[t]);
                relative.iter_mut().zip(&found.variance_slopes).for_each(|(slope, own)| *slope = own[t] / f);
                for (i, slope) in slopes.iter().enumerate() {
                    let weighted = scale * slope / f;
                    self.right[i] -= v * weighted;
                    let row = self.matrix[i * size..][..=i].iter_mut().zip(&slopes);
                    row.for_each(|(sum, other)| *sum += weighted * other);
                }
                for (i, slope) in relative.iter().enumerate() {
                    self.right[columns + i] += 0.5 * scale * v * v / f * slope;
                    logarithm_slopes[i] += slope;
                    let row = variances[i * own..][..=i].iter_mut().zip(&relative);
                    row.for_each(|(sum, other)| *sum += slope * other);
                }
            }
        }
        for i in 0..own {
            self.right[columns + i] -= 0.5 * cost / samples * logarithm_slopes[i];
            for j in 0..=i {
                let both = variances[i * own + j] - logarithm_slopes[i] * logarithm_slopes[j] / samples;
                self.matrix[(columns + i) * size + columns + j] += 0.5 * cost / samples * both;
            }
        }
        for i in 0..size {
            for j in 0..i {
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
        Self::drawn_in(&self.orders, Some(&from[columns..]), &mut trial[columns..])
    }
}
