//! Mean, standard deviation and trend without loss of digits or range.

use std::ops::Range;

use crate::regression::sum;

/// Below this fraction of its largest value, what a channel's mean leaves is rounding.
const ROUNDING: f64 = 1e-13;

/// A power of two by which values are near 1 or below, so that their squares neither overflow nor vanish.
pub(super) fn scale(values: impl Iterator<Item = f64>) -> f64 {
    let largest = values.fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if largest == 0.0 {
        return 1.0;
    }
    // 2^1000 at most: the scale and its inverse stay finite.
    (-largest.log2().round().clamp(-1000.0, 1000.0)).exp2()
}

/// The mean of values that are there, in two passes: the second takes the rounding of the first away.
pub(super) fn mean(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    // From the first value: the mean of a constant is then that constant, to the bit.
    let base = values.first().copied().unwrap_or(0.0);
    let first = base + sum(values.iter().map(|value| value - base)) / count;
    first + sum(values.iter().map(|value| value - first)) / count
}

/// The least-squares line through points: its slope, and the fraction of the variance that it explains.
///
/// ```text
/// slope = sum (t - mean t) (x - mean x) / sum (t - mean t)^2
/// share = slope^2 sum (t - mean t)^2 / sum (x - mean x)^2
/// ```
///
/// None if all t, or all x, are the same.
pub(super) fn line(times: &[f64], values: &[f64]) -> Option<(f64, f64)> {
    let span = times.iter().fold(0.0_f64, |span, time| span.max(time.abs()));
    let times: Vec<f64> = times.iter().map(|time| time / span).collect();
    let (middle, level) = (mean(&times), mean(values));
    let products = |left: &[f64], right: &[f64], (a, b): (f64, f64)| {
        sum(left.iter().zip(right).map(|(left, right)| (left - a) * (right - b)))
    };
    let spread = products(&times, &times, (middle, middle));
    let square = products(values, values, (level, level));
    if !(spread > 0.0 && square > 0.0) {
        return None;
    }
    let product = products(&times, values, (middle, level));
    let slope = product / spread;
    Some((slope / span, (slope * product / square).min(1.0)))
}

/// A signal's deviations from its mean over the segments, as fractions of the largest; zero outside of them, and everywhere
/// if it is constant to rounding.
pub(super) fn deviations(values: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let inside = || segments.iter().flat_map(|segment| values[segment.clone()].iter().copied());
    let scale = scale(inside());
    let scaled: Vec<f64> = inside().map(|value| scale * value).collect();
    let mean = mean(&scaled);
    let largest = scaled.iter().fold(0.0_f64, |largest, value| largest.max((value - mean).abs()));
    let mut deviations = vec![0.0; values.len()];
    let size = scaled.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    if largest > ROUNDING * size {
        let mut next = scaled.iter();
        for segment in segments {
            for (deviation, value) in deviations[segment.clone()].iter_mut().zip(next.by_ref()) {
                *deviation = (value - mean) / largest;
            }
        }
    }
    deviations
}
