//! The covariance of an estimate whose errors are coloured.
//!
//! With theta-hat - theta = L sum_t z(t) v(t), and errors v = e/A(q) of some colour, e white of variance sigma^2,
//!
//! ```text
//! sum_t z(t) v(t) = sum_t zeta(t) e(t),   zeta = z/A(q^+1),   cov = L (sigma^2 sum zeta zeta') L'
//! ```
//!
//! as moving the filter 1/A from v to z turns it backwards in time. For output errors z = psi and L = (sum psi psi')^-1
//! (Ljung, System Identification, 2nd ed. 1999, section 9.3); for instrumental variables z are the instruments and L =
//! (sum z phi')^-1 (Söderström and Stoica, Instrumental Variable Methods for System Identification, 1983, chapter 5).
//! A is an autoregression of the residuals, its order chosen by MDL.
//!
//! Of short logs the fit takes a part of v with it, that in the directions of psi: v^ = v - psi'(theta-hat - theta) has
//! too little there, and the intervals were too short. For output errors A is that of v instead, by the restricted
//! likelihood of Patterson and Thompson (Biometrika 58 (1971)), found by expectation and maximisation (Dempster, Laird
//! and Rubin, J. Royal Statistical Society B 39 (1977)). Given A, v^ + psi'delta has the weights delta ~ (delta^, C) of
//! a regression filtered by A, and the next A is that of the expected products
//!
//! ```text
//! E v(t - k) v(t - l) = v~(t - k) v~(t - l) + psi(t - k)' C psi(t - l),   v~ = v^ - psi'delta^
//! ```
//!
//! Where outputs are missing, A is found in the same way, their errors being among what is not known (see `holes`).
//!
//! sigma^2 is then as uncertain as a spectrum of few independent samples is: N/s of them, s = sum_k rho_k^2 over all
//! lags (Bayley and Hammersley, J. Royal Statistical Society, Supplement 8 (1946)), where white errors have N. The
//! covariance is as much larger as the variance of Student's distribution of these degrees of freedom.

mod holes;

use std::ops::Range;

use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector};
use thetahat_numerics::regression::{Lagged, Presample, Taps, divide_from, sum, sum_of_squares};

use holes::Holes;

use super::start::reduced::Factor;
use super::start::stable;
use crate::data::measured;
use crate::model::polynomial::product;

/// The highest order of an autoregression of residuals.
pub(super) const HIGHEST: usize = 10;
/// Rows in memory at once.
const ROWS: usize = 1024;
/// From this many samples on, what the fit takes of v is nothing beside what is left.
const MANY: usize = 20_000;
/// How often expected products are formed; four digits of A stand after as many, or after twice as many where outputs
/// are missing.
const ROUNDS: usize = 6;
/// The least degrees of freedom that Student's distribution is taken with.
const FEWEST_DEGREES: f64 = 4.0;
/// Below this fraction of sum v^2, what an autoregression leaves is rounding.
const ROUNDING: f64 = 1e-14;

/// v = e/A.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Autoregression {
    /// A, monic and stable.
    pub(crate) monic: Vec<f64>,
    /// The variance of e.
    pub(crate) variance: f64,
}

impl Autoregression {
    /// The order.
    pub(super) fn order(&self) -> usize {
        self.monic.len() - 1
    }

    /// S(0)/var v, the spectral density at frequency zero over its mean: by so much the mean of many v is less certain
    /// than that of white noise.
    pub(super) fn at_zero(&self) -> f64 {
        1.0 / (self.monic.iter().sum::<f64>().powi(2) * power(&self.monic))
    }

    /// By how much the variance of an estimate from `samples` is larger than that of white errors would be, `taken`
    /// degrees of freedom being used, as their variance is less certain.
    pub(super) fn inflation(&self, samples: usize, taken: usize) -> f64 {
        // sum rho_k^2 = int S^2/(int S)^2, the first that of 1/A^2.
        let spread = power(&product(&self.monic, &self.monic)) / power(&self.monic).powi(2);
        let student = |degrees: f64| {
            let degrees = degrees.max(FEWEST_DEGREES);
            degrees / (degrees - 2.0)
        };
        let all = samples as f64;
        let inflation = student(all / spread - taken as f64) / student(all - taken as f64);
        if inflation.is_finite() { inflation } else { 1.0 }
    }
}

/// The power of white noise of variance 1 after 1/A, by the reflection coefficients of A; infinite for an unstable one.
fn power(monic: &[f64]) -> f64 {
    let mut rest = monic.get(1..).unwrap_or(&[]).to_vec();
    let mut power = 1.0;
    while let Some(reflection) = rest.pop() {
        let left = 1.0 - reflection * reflection;
        if left.is_nan() || left <= 0.0 {
            return f64::INFINITY;
        }
        power /= left;
        let down = |k: usize| (rest[k] - reflection * rest[rest.len() - 1 - k]) / left;
        rest = (0..rest.len()).map(down).collect();
    }
    power
}

/// The autoregression of order 0 … 10 with the least MDL = k ln(N)/N + ln(sum e^2/N), all orders on the same samples.
///
/// `taken` degrees of freedom were used by what left the residuals: sigma^2 = sum e^2/(N - k - taken). O(N).
pub(crate) fn autoregression(residuals: &[f64], segments: &[Range<usize>], taken: usize) -> Autoregression {
    let highest = highest(residuals, segments, taken);
    ErrorProducts::new(residuals, segments, highest).autoregression(taken)
}

/// What an autoregression of errors needs of some of them. That of all is the sum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ErrorProducts {
    /// For each order from 0 on, how many errors have so many before them.
    rows: Vec<usize>,
    known: usize,
    /// The normal equations of the order, row by row.
    matrix: Vec<f64>,
    right: Vec<f64>,
    square: f64,
}

impl ErrorProducts {
    pub(super) fn new(residuals: &[f64], segments: &[Range<usize>], order: usize) -> Self {
        let (matrix, right, square) = lagged(residuals, segments, order).normal_equations();
        Self {
            rows: (0..=HIGHEST).map(|order| lagged(residuals, segments, order).rows()).collect(),
            known: residuals.iter().filter(|error| !error.is_nan()).count(),
            matrix: matrix.as_slice().to_vec(),
            right: right.as_slice().to_vec(),
            square,
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.rows.iter_mut().zip(&other.rows).for_each(|(own, more)| *own += more);
        self.known += other.known;
        self.matrix.iter_mut().zip(&other.matrix).for_each(|(own, more)| *own += more);
        self.right.iter_mut().zip(&other.right).for_each(|(own, more)| *own += more);
        self.square += other.square;
    }

    /// The highest order for this many samples: of short segments not too much is left out.
    pub(super) fn highest(&self, taken: usize) -> usize {
        let rows = |order: usize| self.rows.get(order).copied().unwrap_or(0);
        highest_of(rows, [rows(0), self.known], taken)
    }

    /// The order of the least MDL and its autoregression.
    pub(super) fn autoregression(self, taken: usize) -> Autoregression {
        let order = self.right.len();
        let rows = self.rows.get(order).copied().unwrap_or(0);
        let matrix = DMatrix::from_vec(order, order, self.matrix);
        chosen(&matrix, DVector::from_vec(self.right), self.square, [rows; 2], taken)
    }
}

fn lagged<'a>(residuals: &'a [f64], segments: &'a [Range<usize>], count: usize) -> Lagged<'a> {
    let taps = vec![Taps { signal: 0, first: 1, count, sign: -1.0 }];
    Lagged::new(&[residuals], taps, segments, Presample::Drop)
}

/// The highest order for this many samples: of short segments not too much is left out.
fn highest(residuals: &[f64], segments: &[Range<usize>], taken: usize) -> usize {
    let samples: usize = segments.iter().map(Range::len).sum();
    let known = residuals.iter().filter(|error| !error.is_nan()).count();
    highest_of(|order| lagged(residuals, segments, order).rows(), [samples, known], taken)
}

/// The same, where it is known how many errors have so many before them.
fn highest_of(rows: impl Fn(usize) -> usize, [samples, known]: [usize; 2], taken: usize) -> usize {
    let enough = |order: &usize| 2 * rows(*order) >= samples && known.min(samples) > 4 * order + taken;
    (1..=HIGHEST).rev().find(enough).unwrap_or(0)
}

/// The order of the least MDL and its autoregression, from the normal equations of the highest over `rows`, `samples`
/// errors being known.
fn chosen(
    matrix: &DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    [rows, samples]: [usize; 2],
    taken: usize,
) -> Autoregression {
    let highest = right.len();
    let variance = |squares: f64, order: usize| squares / rows.saturating_sub(order + taken).max(1) as f64;
    let white = Autoregression { monic: vec![1.0], variance: variance(square, 0) };
    let Some(factor) = Factor::new(matrix) else { return white };
    let mut rotated = right;
    factor.forward(rotated.as_mut_slice());
    // What each order leaves: the factor of a lower order is a part of that of the highest.
    let left: Vec<f64> = std::iter::once(square)
        .chain(rotated.iter().scan(square, |left, value| {
            *left = (*left - value * value).max(ROUNDING * square);
            Some(*left)
        }))
        .collect();
    let count = samples as f64;
    let length = |order: usize| order as f64 * count.ln() / count + (left[order] / rows as f64).ln();
    let order = (0..=highest).min_by(|&i, &j| length(i).total_cmp(&length(j))).unwrap_or(0);
    let mut coefficients = rotated.as_slice()[..order].to_vec();
    factor.backward(&mut coefficients);
    coefficients.insert(0, 1.0);
    match stable(&coefficients) {
        Some((monic, _)) => Autoregression { monic, variance: variance(left[order], order) },
        None => white,
    }
}

/// The autoregression of the errors v of which a fit has left `residuals` (see above), `psi` giving the derivatives of
/// the fitted values, a list for each parameter, of the same samples. Residuals are NaN and psi is zero where an output
/// is missing. For very many samples, or if they do not determine the parameters, that of the residuals. O(N n^2 p^2)
/// for p parameters and n = 11 lags.
pub(super) fn restricted(
    residuals: &[f64],
    psi: impl FnOnce() -> Vec<Vec<f64>>,
    segments: &[Range<usize>],
    taken: usize,
) -> Autoregression {
    let runs: Vec<Range<usize>> = segments.iter().flat_map(|segment| measured(residuals, segment)).collect();
    let mut found = autoregression(residuals, &runs, taken);
    let highest = highest(residuals, segments, taken);
    let samples: usize = runs.iter().map(Range::len).sum();
    let mut holes = Holes::new(residuals, segments, highest);
    let many = samples > MANY;
    if many && holes.is_empty() || highest == 0 {
        return found;
    }
    let psi = if many { Vec::new() } else { psi() };
    let residuals: Vec<f64> =
        residuals.iter().map(|error| if error.is_nan() { 0.0 } else { *error }).collect();
    // Columns as large as the residuals, so that nothing is lost in their products.
    let size = |values: &[f64]| sum_of_squares(values).sqrt();
    let whole = size(&residuals);
    let scaled = psi.iter().map(|column| {
        let scale = whole / size(column);
        column.iter().map(|value| if scale.is_finite() { scale * value } else { 0.0 }).collect::<Vec<f64>>()
    });
    let mut signals: Vec<Vec<f64>> = std::iter::once(residuals.clone()).chain(scaled).collect();
    let lags = highest + 1;
    let products_of = |signals: &[Vec<f64>]| {
        let views: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
        let taps = (0..views.len()).map(|signal| Taps { signal, first: 0, count: lags, sign: 1.0 });
        Lagged::new(&views, taps.collect(), segments, Presample::Drop).normal_equations().0
    };
    let mut products = products_of(&signals);
    let (rows, size) = (lagged(&residuals, segments, highest).rows(), psi.len());
    for _ in 0..if holes.is_empty() { ROUNDS } else { 2 * ROUNDS } {
        if !holes.is_empty() {
            holes.fill(&mut signals, &found.monic);
            products = products_of(&signals);
        }
        let entry = |(i, k): (usize, usize), (j, l): (usize, usize)| products[(i * lags + k, j * lags + l)];
        let filtered = |i: usize, j: usize| -> f64 {
            let each = found.monic.iter().enumerate();
            let row = |(k, a): (usize, &f64)| {
                a * found.monic.iter().enumerate().map(|(l, b)| b * entry((i, k), (j, l))).sum::<f64>()
            };
            each.map(row).sum()
        };
        let gram = DMatrix::from_fn(size, size, |i, j| filtered(i + 1, j + 1));
        let Some(factor) = Cholesky::new(gram) else { return found };
        let weights = factor.solve(&DVector::from_fn(size, |i, _| filtered(i + 1, 0)));
        let spread = factor.inverse() * found.variance;
        let weight = |i: usize, j: usize| match (i.checked_sub(1), j.checked_sub(1)) {
            (None, None) => 1.0,
            (Some(i), None) | (None, Some(i)) => -weights[i],
            (Some(i), Some(j)) => weights[i] * weights[j] + spread[(i, j)],
        };
        let all = DMatrix::from_fn(size + 1, size + 1, weight);
        let expected = DMatrix::from_fn(lags, lags, |k, l| {
            let row = |i: usize| (0..=size).map(|j| all[(i, j)] * entry((i, k), (j, l))).sum::<f64>();
            (0..=size).map(row).sum::<f64>() + found.variance * holes.spread()[(k, l)]
        });
        let right = DVector::from_fn(highest, |k, _| -expected[(k + 1, 0)]);
        let matrix = expected.view((1, 1), (highest, highest)).into_owned();
        let next = chosen(&matrix, right, expected[(0, 0)], [rows, rows.min(samples)], 0);
        if !next.variance.is_finite() {
            return found;
        }
        found = next;
    }
    found
}

/// Columns of psi over `rows`, as [`backward_filtered_products`] has them before the filter.
pub(super) fn columns(
    signals: &[&[f64]],
    taps: &[Taps],
    segment: &Range<usize>,
    rows: &Range<usize>,
    combination: Option<&DMatrix<f64>>,
) -> Vec<Vec<f64>> {
    let shifted = |(signal, lag, sign): (usize, usize, f64)| -> Vec<f64> {
        let at = |row: usize| if row < segment.start + lag { 0.0 } else { sign * signals[signal][row - lag] };
        rows.clone().map(at).collect()
    };
    let each = taps.iter().flat_map(|taps| (0..taps.count).map(|i| (taps.signal, taps.first + i, taps.sign)));
    let raw: Vec<Vec<f64>> = each.map(shifted).collect();
    let Some(combination) = combination else { return raw };
    let combined = combination.row_iter().map(|weights| {
        let mut sum = vec![0.0; rows.len()];
        for (weight, column) in weights.iter().zip(&raw).filter(|(weight, _)| **weight != 0.0) {
            sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
        }
        sum
    });
    combined.collect()
}

/// sum zeta zeta' over the samples from the first to the last of `runs`, where zeta = `combination` psi, zero outside
/// the runs, filtered backwards in time by 1/A(q^+1):
///
/// ```text
/// zeta(t) = M psi(t) - a1 zeta(t + 1) - … - an zeta(t + n),   zeta = 0 after the last sample
/// ```
///
/// The columns of psi are `sign * s(t - lag)`, zero before the first sample of the segment. Blocks of rows from the
/// end backwards: O(N (n p + p^2)) time, no memory for N rows.
pub(crate) fn backward_filtered_products(
    signals: &[&[f64]],
    taps: &[Taps],
    segment: &Range<usize>,
    runs: &[Range<usize>],
    combination: Option<&DMatrix<f64>>,
    monic: &[f64],
) -> DMatrix<f64> {
    let columns: Vec<(&[f64], usize, f64)> = taps
        .iter()
        .flat_map(|taps| (0..taps.count).map(move |i| (signals[taps.signal], taps.first + i, taps.sign)))
        .collect();
    let size = combination.map_or(columns.len(), DMatrix::nrows);
    let weights = monic.get(1..).unwrap_or(&[]);
    let mut products = DMatrix::zeros(size, size);
    let (Some(start), Some(last)) = (runs.first(), runs.last()) else { return products };
    let (start, mut end) = (start.start, last.end);
    let mut raw = vec![Vec::with_capacity(ROWS); columns.len()];
    let mut combined = vec![Vec::with_capacity(ROWS); size];
    // The zeta after each block, the earliest last.
    let mut after: Vec<Vec<f64>> = vec![Vec::new(); size];
    while end > start {
        let first = end.saturating_sub(ROWS).max(start);
        for (values, &(signal, lag, sign)) in raw.iter_mut().zip(&columns) {
            values.clear();
            // Backwards, so that the recursion runs forwards.
            let known = (segment.start + lag).clamp(first, end);
            values.extend((known..end).rev().map(|row| sign * signal[row - lag]));
            values.resize(end - first, 0.0);
            let next = runs.partition_point(|run| run.end <= first);
            let gaps = runs[next..].windows(2).map(|pair| pair[0].end..pair[1].start);
            for gap in gaps.take_while(|gap| gap.start < end) {
                values[end - gap.end.min(end)..end - gap.start].fill(0.0);
            }
        }
        let filtered = match combination {
            None => &mut raw,
            Some(combination) => {
                for (row, into) in combination.row_iter().zip(&mut combined) {
                    into.clear();
                    into.resize(end - first, 0.0);
                    for (weight, values) in row.iter().zip(&raw).filter(|(weight, _)| **weight != 0.0) {
                        into.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                    }
                }
                &mut combined
            }
        };
        for (values, after) in filtered.iter_mut().zip(&mut after) {
            divide_from(weights, after, values);
            after.extend_from_slice(&values[values.len().saturating_sub(weights.len())..]);
            after.drain(..after.len().saturating_sub(weights.len()));
        }
        for (i, left) in filtered.iter().enumerate() {
            for (j, right) in filtered.iter().enumerate().take(i + 1) {
                products[(i, j)] += sum(left.iter().zip(right).map(|(left, right)| left * right));
            }
        }
        end = first;
    }
    products.fill_upper_triangle_with_lower_triangle();
    products
}

/// `L (sigma^2 S) L'`, `products` being S = sum zeta zeta'.
pub(crate) fn coloured(left: &DMatrix<f64>, variance: f64, products: &DMatrix<f64>) -> DMatrix<f64> {
    let covariance = left * products * left.transpose() * variance;
    // Symmetric to the last bit.
    (&covariance + covariance.transpose()) * 0.5
}

#[cfg(test)]
mod tests;
