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

use std::ops::Range;

use thetahat_core::nalgebra::DMatrix;

use super::start::reduced::Factor;
use super::start::stable;
use crate::regression::{Lagged, Presample, Taps, divide_from, sum};

/// The highest order of an autoregression of residuals.
const HIGHEST: usize = 10;
/// Rows in memory at once.
const ROWS: usize = 1024;
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
}

/// The autoregression of order 0 … 10 with the least MDL = k ln(N)/N + ln(sum e^2/N), all orders on the same samples.
///
/// `taken` degrees of freedom were used by what left the residuals: sigma^2 = sum e^2/(N - k - taken). O(N).
pub(crate) fn autoregression(residuals: &[f64], segments: &[Range<usize>], taken: usize) -> Autoregression {
    let samples: usize = segments.iter().map(Range::len).sum();
    let lagged = |count| {
        let taps = vec![Taps { signal: 0, first: 1, count, sign: -1.0 }];
        Lagged::new(&[residuals], taps, segments, Presample::Drop)
    };
    // Of short segments not too much is left out.
    let enough = |count: &usize| 2 * lagged(*count).rows() >= samples && samples > 4 * count + taken;
    let highest = (1..=HIGHEST).rev().find(enough).unwrap_or(0);
    let lagged = lagged(highest);
    let (matrix, right, square) = lagged.normal_equations();
    let rows = lagged.rows();
    let variance = |squares: f64, order: usize| squares / rows.saturating_sub(order + taken).max(1) as f64;
    let white = Autoregression { monic: vec![1.0], variance: variance(square, 0) };
    let Some(factor) = Factor::new(&matrix) else { return white };
    let mut rotated = right;
    factor.forward(rotated.as_mut_slice());
    // What each order leaves: the factor of a lower order is a part of that of the highest.
    let left: Vec<f64> = std::iter::once(square)
        .chain(rotated.iter().scan(square, |left, value| {
            *left = (*left - value * value).max(ROUNDING * square);
            Some(*left)
        }))
        .collect();
    let count = rows as f64;
    let length = |order: usize| order as f64 * count.ln() / count + (left[order] / count).ln();
    let order = (0..=highest).min_by(|&i, &j| length(i).total_cmp(&length(j))).unwrap_or(0);
    let mut coefficients = rotated.as_slice()[..order].to_vec();
    factor.backward(&mut coefficients);
    coefficients.insert(0, 1.0);
    match stable(&coefficients) {
        Some((monic, _)) => Autoregression { monic, variance: variance(left[order], order) },
        None => white,
    }
}

/// sum zeta zeta' over the samples `rows`, where zeta = `combination` psi filtered backwards in time by 1/A(q^+1):
///
/// ```text
/// zeta(t) = M psi(t) - a1 zeta(t + 1) - … - an zeta(t + n),   zeta = 0 behind the last sample
/// ```
///
/// The columns of psi are `sign * s(t - lag)`, zero before the first sample of the segment. Blocks of rows from the
/// end backwards: O(N (n p + p^2)) time, no memory for N rows.
pub(crate) fn backward_filtered_products(
    signals: &[&[f64]],
    taps: &[Taps],
    segment: &Range<usize>,
    rows: &Range<usize>,
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
    let mut raw = vec![Vec::with_capacity(ROWS); columns.len()];
    let mut combined = vec![Vec::with_capacity(ROWS); size];
    // The zeta behind each block, the earliest last.
    let mut behind: Vec<Vec<f64>> = vec![Vec::new(); size];
    let mut end = rows.end;
    while end > rows.start {
        let first = end.saturating_sub(ROWS).max(rows.start);
        for (values, &(signal, lag, sign)) in raw.iter_mut().zip(&columns) {
            values.clear();
            // Backwards, so that the recursion runs forwards.
            let known = (segment.start + lag).clamp(first, end);
            values.extend((known..end).rev().map(|row| sign * signal[row - lag]));
            values.resize(end - first, 0.0);
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
        for (values, behind) in filtered.iter_mut().zip(&mut behind) {
            divide_from(weights, behind, values);
            behind.extend_from_slice(&values[values.len().saturating_sub(weights.len())..]);
            behind.drain(..behind.len().saturating_sub(weights.len()));
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
pub(super) fn coloured(left: &DMatrix<f64>, variance: f64, products: &DMatrix<f64>) -> DMatrix<f64> {
    let covariance = left * products * left.transpose() * variance;
    // Symmetric to the last bit.
    (&covariance + covariance.transpose()) * 0.5
}

#[cfg(test)]
mod tests;
