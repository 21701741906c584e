//! The power spectral density of a signal.

use std::f64::consts::PI;
use std::ops::Range;

use super::SpectrumPoint;
use super::moments::samples;
use crate::fourier::PairTransform;
use crate::regression::sum;

/// The longest window, in samples: it gives 513 frequencies.
const LONGEST: usize = 1024;
/// The shortest.
const SHORTEST: usize = 8;

/// Welch's estimate (Welch 1967): the mean of the periodograms of windows that overlap by half,
///
/// ```text
/// S(w_k) = T/pi |sum_t h(t) x(t) exp(-i 2 pi k t/L)|^2 / sum_t h(t)^2,   w_k = 2 pi k/(L T),   k = 0 … L/2
/// ```
///
/// with Hann's window h. It is one-sided: by the trapezoidal rule, its integral from 0 to pi/T is the variance (that of the windowed
/// samples, exactly). L is the largest power of two up to 1024 and a fourth of the samples that fits into a segment. No window
/// reaches across the boundary of two segments. Empty if there are fewer than eight samples to a window, or a density leaves
/// the range of numbers. O(N log L).
///
/// `deviations` are of mean zero and have sizes up to 1, in units of `unit`.
pub(super) fn spectrum(
    deviations: &[f64],
    segments: &[Range<usize>],
    unit: f64,
    sample_time: f64,
) -> Vec<SpectrumPoint> {
    let longest = segments.iter().map(Range::len).max().unwrap_or(0);
    let most = LONGEST.min(samples(segments) / 4).min(longest);
    let length = if most == 0 { 0 } else { 1 << most.ilog2() };
    if length < SHORTEST {
        return Vec::new();
    }
    let window: Vec<f64> = (0..length).map(|t| (PI * t as f64 / length as f64).sin().powi(2)).collect();
    let weight = sum(window.iter().map(|h| h * h));
    let mut transform = PairTransform::new(length);
    let mut powers = vec![0.0; length / 2 + 1];
    let mut count = 0;
    for segment in segments {
        let mut first = segment.start;
        while first + length <= segment.end {
            let own = window.iter().zip(&deviations[first..first + length]);
            let found = transform.of(own.map(|(h, x)| (h * x, 0.0)));
            powers.iter_mut().enumerate().for_each(|(k, sum)| *sum += found.at(k).0.norm_sqr());
            count += 1;
            first += length / 2;
        }
    }
    let density = |power: f64| power / (weight * f64::from(count)) * unit * unit * (sample_time / PI);
    let points: Vec<SpectrumPoint> = powers
        .iter()
        .enumerate()
        .map(|(k, &power)| SpectrumPoint {
            frequency: 2.0 * PI * k as f64 / (length as f64 * sample_time),
            density: density(power),
        })
        .collect();
    let finite = points.iter().all(|point| point.frequency.is_finite() && point.density.is_finite());
    if finite { points } else { Vec::new() }
}
