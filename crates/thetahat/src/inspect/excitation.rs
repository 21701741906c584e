//! How rich an input is.

use std::ops::Range;
use std::slice;

use rayon::prelude::*;
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::regression::{Lagged, Presample, Taps, sum, sum_of_squares};

use super::moments::{self, samples};
use super::{Excitation, spectrum};

/// The highest order tried.
pub(super) const HIGHEST: usize = 50;
/// Samples for each order tried.
const SAMPLES: usize = 4;
/// An eigenvalue below this fraction of the largest counts as zero.
const TOLERANCE: f64 = 1e-6;

/// Up to this order of excitation an input is a sum of a few sinusoids: of three.
const SINUSOIDS: usize = 6;
/// As many rows show of a long log that it is none.
const FIRST: usize = 20_000;

/// Of the square of a signal, what is left by another one is rounding below this fraction.
pub(super) const SAME: f64 = 1e-20;
/// The mean squares of signals that are the same differ by less than this fraction.
const ALIKE: f64 = 1e-6;

/// The order of persistence of excitation (Ljung, System Identification, 2nd ed. 1999, section 13.2; Söderström and
/// Stoica, System Identification, 1989, section 5.4): the rank of the covariance matrix of
///
/// ```text
/// [u(t), u(t - 1), …, u(t - n + 1)],
/// ```
///
/// each lag less its mean, n = 50, or less of a short log. The mean is removed, as a fit removes it: a constant has
/// order 0, a sum of k sinusoids 2k, white noise n. Of a finite record the matrix is the sum over the samples that have
/// all their lags, without zeros in place of others, so that a sinusoid has rank 2 to rounding.
///
/// Eigenvalues above 1e-6 of the largest count: below lies what rounding to three digits leaves (a direction excited at
/// a thousandth of the amplitude of the strongest), above is all of a first-order process with a pole at 0.999 sampled
/// as often as that. Nor is the order above the number of times that the input changes: each step of a step test is
/// seen once, and to excite persistently is to do so over and over. O(N n + n^3).
pub(crate) fn excitation(
    name: &str,
    values: &[f64],
    segments: &[Range<usize>],
    sample_time: f64,
) -> Excitation {
    let deviations = moments::deviations(values, segments);
    let highest = highest(segments);
    let pairs = || segments.iter().flat_map(|segment| values[segment.clone()].windows(2));
    let changes = pairs().filter(|pair| pair[0] != pair[1]).count();
    let present = || segments.iter().flat_map(|segment| values[segment.clone()].iter().copied());
    let scale = moments::scale(present());
    let unit = unit(|| present().map(|value| scale * value)) / scale;
    Excitation {
        input: name.to_owned(),
        order: rank(&deviations, segments, highest, Level::Removed).min(changes),
        highest,
        changes: changes as f64 / pairs().count().max(1) as f64,
        spectrum: spectrum::spectrum(&deviations, segments, unit, sample_time),
        same_as: None,
    }
}

/// Whether a signal is a sum of a few sinusoids, about its mean: then it shows the response at their frequencies, and
/// nothing of that at rest, nor of delays. A signal of few changes is that of a step test, and none.
pub(crate) fn is_few_sinusoids(values: &[f64], segments: &[Range<usize>]) -> bool {
    let pairs = || segments.iter().flat_map(|segment| values[segment.clone()].windows(2));
    let changes = pairs().filter(|pair| pair[0] != pair[1]).count();
    let highest = highest(segments);
    if 2 * changes < pairs().count() || highest <= SINUSOIDS {
        return false;
    }
    let order = |values: &[f64], segments: &[Range<usize>]| {
        let highest = highest.min(self::highest(segments));
        rank(&moments::deviations(values, segments), segments, highest, Level::Removed)
    };
    // What the first rows of a long log hold is in all of them: so most signals are known without a copy.
    if let Some(first) = segments.first().filter(|first| first.len() > 4 * FIRST) {
        let first = first.start..first.start + FIRST;
        if order(&values[..first.end], std::slice::from_ref(&first)) > SINUSOIDS {
            return false;
        }
    }
    (1..=SINUSOIDS).contains(&order(values, segments))
}

/// Inputs that are the same as an earlier one but for scale and offset, each with the first such one. `segments` gives
/// those in which none of some signals misses a value.
///
/// Of the same rows they have the same mean square in units of the largest deviation. So no more are compared than have
/// about the same, or miss values. O(M N + M log M) for M inputs, if few are alike.
pub(super) fn copies(
    signals: &[&[f64]],
    segments: impl Fn(&[&[f64]]) -> Vec<Range<usize>>,
) -> Vec<(usize, usize)> {
    let whole = segments(&[]);
    let level = |signal: &&[f64]| -> Option<f64> {
        let misses = signal.iter().any(|value| value.is_nan());
        (!misses).then(|| sum_of_squares(&moments::deviations(signal, &whole)))
    };
    let levels: Vec<Option<f64>> = signals.par_iter().map(level).collect();
    let mut sorted: Vec<(f64, usize)> =
        levels.iter().enumerate().filter_map(|(position, level)| Some(((*level)?, position))).collect();
    sorted.sort_unstable_by(|(left, _), (right, _)| left.total_cmp(right));
    let missing: Vec<usize> = (0..signals.len()).filter(|&position| levels[position].is_none()).collect();
    let mut copies = Vec::new();
    for (position, level) in levels.iter().enumerate() {
        let mut earlier: Vec<usize> = match level {
            None => (0..position).collect(),
            Some(level) => {
                let first = sorted.partition_point(|(other, _)| *other < level * (1.0 - ALIKE));
                let alike = sorted[first..].iter().take_while(|(other, _)| *other <= level * (1.0 + ALIKE));
                let alike = alike.map(|(_, other)| *other);
                alike.chain(missing.iter().copied()).filter(|other| *other < position).collect()
            }
        };
        earlier.sort_unstable();
        for other in earlier {
            let segments = segments(&[signals[other], signals[position]]);
            if are_the_same(signals[other], signals[position], &segments) {
                copies.push((position, other));
                break;
            }
        }
    }
    copies
}

/// Whether two signals are the same but for scale and offset, to rounding: their correlation is 1 or -1. O(N).
pub(super) fn are_the_same(left: &[f64], right: &[f64], segments: &[Range<usize>]) -> bool {
    let (left, right) = (moments::deviations(left, segments), moments::deviations(right, segments));
    let (square, whole) = (sum_of_squares(&left), sum_of_squares(&right));
    let scale = sum(left.iter().zip(&right).map(|(left, right)| left * right)) / square;
    let rest = sum(left.iter().zip(&right).map(|(left, right)| (right - scale * left).powi(2)));
    square > 0.0 && whole > 0.0 && rest <= SAME * whole
}

/// The highest order that this many samples tell of: of short segments not too much may be left out.
pub(super) fn highest(segments: &[Range<usize>]) -> usize {
    let total = samples(segments);
    let full = |order: usize| -> usize {
        segments.iter().map(|segment| (segment.len() + 1).saturating_sub(order)).sum()
    };
    (1..=HIGHEST.min(total / SAMPLES)).rev().find(|&order| 2 * full(order) >= total).unwrap_or(0)
}

/// The largest deviation from the mean: the unit of [`moments::deviations`].
fn unit<I: Iterator<Item = f64>>(values: impl Fn() -> I) -> f64 {
    let mean = moments::mean_of(&values);
    values().fold(0.0, |largest: f64, value| largest.max((value - mean).abs()))
}

/// The order of persistence of excitation as textbooks count it, the mean being a part of the signal: a constant has
/// order 1, a sinusoid 2, both together 3; and the highest order tried. Else as [`excitation`].
///
/// A mean above the largest deviation counts as if it were that: the order does not depend on how large it is, and
/// beside a larger one the deviations would be rounding.
pub(crate) fn order_with_mean(values: &[f64]) -> (usize, usize) {
    let all = 0..values.len();
    let segments = slice::from_ref(&all);
    let highest = highest(segments);
    let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let scale = moments::scale(values.iter().copied());
    let scaled = || values.iter().map(|value| scale * value);
    let (mean, unit) = (moments::mean_of(scaled), unit(scaled));
    let level = if unit > 0.0 { (mean / unit).clamp(-1.0, 1.0) } else { mean.abs().min(1.0) };
    let signal: Vec<f64> =
        moments::deviations(values, segments).iter().map(|deviation| deviation + level).collect();
    (rank(&signal, segments, highest, Level::Kept).min(changes + 1), highest)
}

/// What the rank makes of the mean of each lag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    Removed,
    Kept,
}

/// The rank of the matrix of products of this many lags.
fn rank(deviations: &[f64], segments: &[Range<usize>], lags: usize, level: Level) -> usize {
    let ones = vec![1.0; deviations.len()];
    let taps = vec![
        Taps { signal: 0, first: 0, count: lags, sign: 1.0 },
        Taps { signal: 1, first: 0, count: 1, sign: 1.0 },
    ];
    let lagged = Lagged::new(&[deviations, &ones], taps, segments, Presample::Drop);
    let rows = lagged.rows();
    if lags == 0 || rows == 0 {
        return 0;
    }
    let (products, _, _) = lagged.normal_equations();
    let moments = DMatrix::from_fn(lags, lags, |i, j| match level {
        Level::Removed => {
            (products[(i, j)] - products[(i, lags)] * products[(j, lags)] / rows as f64) / rows as f64
        }
        Level::Kept => products[(i, j)] / rows as f64,
    });
    rank_of(moments)
}

/// The rank of a matrix of moments.
pub(super) fn rank_of(moments: DMatrix<f64>) -> usize {
    let eigenvalues = moments.symmetric_eigenvalues();
    let largest = eigenvalues.max();
    eigenvalues.iter().filter(|value| **value > TOLERANCE * largest).count()
}
