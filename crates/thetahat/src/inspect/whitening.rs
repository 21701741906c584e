//! A filter that makes a signal white.

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::regression::{Lagged, Presample, Taps, add_filtered};

use super::moments::samples;

/// The highest order of an autoregression.
pub(super) const HIGHEST: usize = 30;
/// Samples for each order tried.
const SAMPLES: usize = 10;
/// Of the square of a signal, what an autoregression leaves is rounding below this fraction.
const ROUNDING: f64 = 1e-10;

/// The autoregression A(q) x(t) = e(t) of order 0 … 30 with the least MDL = k ln(N)/N + ln(sum e^2/N), all orders on
/// the same samples: A, monic. It is a filter without feedback, so A need not be stable.
///
/// The factor of the normal equations of a lower order is a part of that of the highest. Where a lag depends on those
/// before it (a sum of sinusoids), or nothing but rounding is left, no higher order is tried. O(N).
pub(crate) fn autoregression(signal: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let total = samples(segments);
    let lagged = |count| {
        let taps = vec![Taps { signal: 0, first: 1, count, sign: -1.0 }];
        Lagged::new(&[signal], taps, segments, Presample::Drop)
    };
    // Of short segments not too much is left out.
    let enough = |count: &usize| 2 * lagged(*count).rows() >= total;
    let highest = (1..=HIGHEST.min(total / SAMPLES)).rev().find(enough).unwrap_or(0);
    let lagged = lagged(highest);
    of_products(lagged.normal_equations(), lagged.rows())
}

/// The same for the normal equations of the highest order.
pub(super) fn of_products(
    (matrix, right, square): (DMatrix<f64>, DVector<f64>, f64),
    rows: usize,
) -> Vec<f64> {
    let highest = right.len();
    let count = rows.max(1) as f64;
    let length = |order: usize, left: f64| order as f64 * count.ln() / count + (left / count).ln();
    // L L' = G row by row, and L w = g with it: order k leaves the square less w_1^2 + … + w_k^2.
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut rotated: Vec<f64> = Vec::new();
    let mut left = square;
    let (mut best, mut least) = (0, length(0, left));
    while rows.len() < highest && left > ROUNDING * square {
        let next = rows.len();
        let mut row: Vec<f64> = Vec::with_capacity(next + 1);
        for (j, earlier) in rows.iter().enumerate() {
            let taken: f64 = row.iter().zip(earlier).map(|(a, b)| a * b).sum();
            row.push((matrix[(next, j)] - taken) / earlier[j]);
        }
        let pivot = matrix[(next, next)] - row.iter().map(|value| value * value).sum::<f64>();
        if pivot.is_nan() || pivot <= ROUNDING * matrix[(next, next)] {
            break;
        }
        let taken: f64 = row.iter().zip(&rotated).map(|(a, b)| a * b).sum();
        let value = (right[next] - taken) / pivot.sqrt();
        row.push(pivot.sqrt());
        rows.push(row);
        rotated.push(value);
        left -= value * value;
        let cost = length(rows.len(), left.max(ROUNDING * square));
        if cost < least {
            (best, least) = (rows.len(), cost);
        }
    }
    let mut monic = rotated;
    monic.truncate(best);
    for k in (0..best).rev() {
        let later: f64 = (k + 1..best).map(|i| rows[i][k] * monic[i]).sum();
        monic[k] = (monic[k] - later) / rows[k][k];
    }
    monic.insert(0, 1.0);
    monic
}

/// A(q) x(t), zero where a segment has too little past for it.
pub(super) fn filtered(monic: &[f64], signal: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let mut filtered = vec![0.0; signal.len()];
    for segment in shortened(segments, monic.len() - 1) {
        add_filtered(&mut filtered[segment.clone()], &segment, monic, signal, 0);
    }
    filtered
}

/// The segments without their first samples.
pub(super) fn shortened(segments: &[Range<usize>], by: usize) -> Vec<Range<usize>> {
    segments
        .iter()
        .map(|segment| segment.start + by..segment.end)
        .filter(|segment| !segment.is_empty())
        .collect()
}
