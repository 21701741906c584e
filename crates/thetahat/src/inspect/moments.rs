//! Mean, standard deviation and trend without loss of digits or range.

use std::ops::Range;

use thetahat_numerics::regression::sum;

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

/// Whether a signal of this range is not constant to rounding.
pub(super) fn moves(minimum: f64, maximum: f64) -> bool {
    maximum - minimum > ROUNDING * minimum.abs().max(maximum.abs())
}

/// How many samples some segments have.
pub(super) fn samples(segments: &[Range<usize>]) -> usize {
    segments.iter().map(Range::len).sum()
}

/// The mean of values that are there, in two passes: the second takes the rounding of the first away.
pub(super) fn mean(values: &[f64]) -> f64 {
    mean_of(|| values.iter().copied())
}

/// The mean of values that can be asked for again.
pub(super) fn mean_of<I: Iterator<Item = f64>>(values: impl Fn() -> I) -> f64 {
    let count = values().count().max(1) as f64;
    // From the first value: the mean of a constant is then that constant, to the bit.
    let base = values().next().unwrap_or(0.0);
    let first = base + sum(values().map(|value| value - base)) / count;
    first + sum(values().map(|value| value - first)) / count
}

/// The least-squares line through points: its slope, and the fraction of the variance that it explains.
///
/// ```text
/// slope = sum (t - mean t) (x - mean x) / sum (t - mean t)^2
/// share = slope^2 sum (t - mean t)^2 / sum (x - mean x)^2
/// ```
///
/// None if all t, or all x, are the same. `time` gives t at a position.
pub(super) fn line(time: impl Fn(usize) -> f64, values: &[f64]) -> Option<(f64, f64)> {
    let span = (0..values.len()).fold(0.0_f64, |span, position| span.max(time(position).abs()));
    let time = |position: usize| time(position) / span;
    let times = || (0..values.len()).map(time);
    let (middle, level) = (mean_of(times), mean(values));
    let spread = sum(times().map(|time| (time - middle) * (time - middle)));
    let square = sum(values.iter().map(|value| (value - level) * (value - level)));
    if !(spread > 0.0 && square > 0.0) {
        return None;
    }
    let product = sum(times().zip(values).map(|(time, value)| (time - middle) * (value - level)));
    let slope = product / spread;
    Some((slope / span, (slope * product / square).min(1.0)))
}

/// What one unit of a signal's deviations is in its own units: the ratio of their ranges. None where it does not
/// change.
pub(super) fn unit(values: &[f64], deviations: &[f64], segments: &[Range<usize>]) -> Option<f64> {
    let range = |signal: &[f64]| {
        let inside = || segments.iter().flat_map(|segment| &signal[segment.clone()]);
        inside().copied().fold(f64::NEG_INFINITY, f64::max) - inside().copied().fold(f64::INFINITY, f64::min)
    };
    Some(range(values) / range(deviations)).filter(|unit| unit.is_normal())
}

/// A signal's deviations from its mean over the segments, as fractions of the largest; zero outside of them, and
/// everywhere if it is constant to rounding.
pub(super) fn deviations(values: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let inside = || segments.iter().flat_map(|segment| values[segment.clone()].iter().copied());
    let scale = scale(inside());
    let scaled = || inside().map(|value| scale * value);
    let mean = mean_of(scaled);
    let largest = scaled().fold(0.0_f64, |largest, value| largest.max((value - mean).abs()));
    let mut deviations = vec![0.0; values.len()];
    let size = scaled().fold(0.0_f64, |size, value| size.max(value.abs()));
    if largest > ROUNDING * size {
        for segment in segments {
            for (deviation, value) in deviations[segment.clone()].iter_mut().zip(&values[segment.clone()]) {
                *deviation = (scale * value - mean) / largest;
            }
        }
    }
    deviations
}
