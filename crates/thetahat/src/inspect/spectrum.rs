//! The power spectral density of a signal.

use std::f64::consts::PI;
use std::ops::Range;

use thetahat_numerics::fourier::PairTransform;
use thetahat_numerics::regression::sum;

use super::SpectrumPoint;
use super::moments::samples;

/// The longest window, in samples: it gives 513 frequencies.
pub(super) const LONGEST: usize = 1024;
/// The shortest.
const SHORTEST: usize = 8;

/// Welch's estimate (Welch 1967): the mean of the periodograms of windows that overlap by half,
///
/// ```text
/// S(w_k) = T/pi |sum_t h(t) x(t) exp(-i 2 pi k t/L)|^2 / sum_t h(t)^2,   w_k = 2 pi k/(L T),   k = 0 … L/2
/// ```
///
/// with Hann's window h. It is one-sided: by the trapezoidal rule, its integral from 0 to pi/T is the variance (that of
/// the windowed samples, exactly). L is the largest power of two up to 1024 and a fourth of the samples that fits into
/// a segment. No window reaches across the boundary of two segments. Empty if there are fewer than eight samples to a
/// window, or a density leaves the range of numbers. O(N log L).
///
/// `deviations` are of mean zero and have sizes up to 1, in units of `unit`.
pub(super) fn spectrum(
    deviations: &[f64],
    segments: &[Range<usize>],
    unit: f64,
    sample_time: f64,
) -> Vec<SpectrumPoint> {
    let Some(mut periodograms) = Periodograms::new(samples(segments), segments) else { return Vec::new() };
    for segment in segments {
        periodograms.add(deviations, segment.clone());
    }
    periodograms.points(unit, sample_time)
}

/// The sum of the periodograms of windows.
pub(super) struct Periodograms {
    window: Vec<f64>,
    weight: f64,
    transform: PairTransform,
    powers: Vec<f64>,
    /// Of the real parts of the first two transforms, the only ones that an offset has a part in.
    lowest: [f64; 2],
    count: u32,
}

impl Periodograms {
    /// Of windows that go with so many samples, and fit into one of these segments.
    pub(super) fn new(samples: usize, segments: &[Range<usize>]) -> Option<Self> {
        let longest = segments.iter().map(Range::len).max().unwrap_or(0);
        let most = LONGEST.min(samples / 4).min(longest);
        let length = if most == 0 { 0 } else { 1 << most.ilog2() };
        if length < SHORTEST {
            return None;
        }
        let window: Vec<f64> = (0..length).map(|t| (PI * t as f64 / length as f64).sin().powi(2)).collect();
        let weight = sum(window.iter().map(|h| h * h));
        let transform = PairTransform::new(length);
        Some(Self {
            window,
            weight,
            transform,
            powers: vec![0.0; length / 2 + 1],
            lowest: [0.0; 2],
            count: 0,
        })
    }

    /// Adds those of the windows inside of some rows, and gives where the next one would begin.
    pub(super) fn add(&mut self, values: &[f64], rows: Range<usize>) -> usize {
        let length = self.window.len();
        let mut first = rows.start;
        while first + length <= rows.end {
            let own = self.window.iter().zip(&values[first..first + length]);
            let found = self.transform.of(own.map(|(h, x)| (h * x, 0.0)));
            self.powers.iter_mut().enumerate().for_each(|(k, sum)| *sum += found.at(k).0.norm_sqr());
            self.lowest.iter_mut().enumerate().for_each(|(k, sum)| *sum += found.at(k).0.re);
            self.count += 1;
            first += length / 2;
        }
        first
    }

    /// Takes an offset from the values: Hann's window has a transform of L/2 and -L/4 at k = 0 and 1, and none
    /// elsewhere.
    pub(super) fn remove(&mut self, offset: f64) {
        let length = self.window.len() as f64;
        let count = f64::from(self.count);
        for ((power, real), part) in
            self.powers.iter_mut().zip(&mut self.lowest).zip([0.5 * length, -0.25 * length])
        {
            let taken = offset * part;
            *power = (*power - 2.0 * taken * *real + count * taken * taken).max(0.0);
            *real -= count * taken;
        }
    }

    /// The mean of the periodograms, for values in units of `unit`.
    pub(super) fn points(&self, unit: f64, sample_time: f64) -> Vec<SpectrumPoint> {
        let length = self.window.len();
        let density =
            |power: f64| power / (self.weight * f64::from(self.count)) * unit * unit * (sample_time / PI);
        let points: Vec<SpectrumPoint> = self
            .powers
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
}
