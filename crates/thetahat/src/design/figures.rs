//! What a signal is as an input.

use std::slice;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::regression::sum;

use crate::inspect::{SpectrumPoint, excitation, order_with_mean};

/// What a signal is as an input of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SignalFigures {
    /// The mean.
    pub mean: f64,
    /// The root mean square of the deviations from it.
    pub rms: f64,
    /// The largest deviation over their root mean square: 1 for two levels with mean in the middle, sqrt 2 for a
    /// sinusoid. None for a constant.
    pub crest_factor: Option<f64>,
    /// The order of persistence of excitation, the mean being part of the signal: the number of parameters that it can
    /// determine. No more than `highest`.
    pub order: usize,
    /// The highest order tried: 50, or a fourth of the samples.
    pub highest: usize,
    /// The power spectral density of the deviations, by Welch's method; empty for fewer than 32 samples.
    pub spectrum: Vec<SpectrumPoint>,
}

impl SignalFigures {
    /// The figures of a signal with this sample time in seconds.
    ///
    /// The order of persistence of excitation is the rank of the matrix of mean products u(t - i) u(t - j), i, j = 0 …
    /// n - 1 (Ljung, System Identification, 2nd ed. 1999, section 13.2): a constant has 1, a sinusoid 2, k sinusoids 2
    /// k, white noise n. As for an [inspected](crate::inspect::Excitation) log it is not above the number of times that
    /// the signal changes, here with its level. O(N n) for n = 50.
    ///
    /// ```
    /// use thetahat::design::SignalFigures;
    ///
    /// let of = |value: fn(f64) -> f64| -> Vec<f64> { (0..200).map(|t| value(f64::from(t))).collect() };
    /// let order = |values: Vec<f64>| SignalFigures::of(&values, 1.0).order;
    /// assert_eq!((order(of(|_| 3.0)), order(of(|t| (0.3 * t).sin()))), (1, 2));
    /// assert_eq!(order(of(|t| 3.0 + (0.3 * t).sin() + (0.7 * t).cos())), 5);
    /// ```
    pub fn of(values: &[f64], sample_time: f64) -> Self {
        let count = values.len().max(1) as f64;
        let mean = sum(values.iter().copied()) / count;
        let rms = (sum(values.iter().map(|value| (value - mean).powi(2))) / count).sqrt();
        let peak = values.iter().fold(0.0_f64, |peak, value| peak.max((value - mean).abs()));
        let (order, highest) = order_with_mean(values);
        let all = 0..values.len();
        let spectrum = excitation("", values, slice::from_ref(&all), sample_time).spectrum;
        let crest_factor = Some(peak / rms).filter(|crest| crest.is_finite());
        Self { mean, rms, crest_factor, order, highest, spectrum }
    }

    /// Between which frequencies nine tenths of the power lie, in radians per second: from where a twentieth is below
    /// to where a twentieth is above. None where there is no spectrum.
    pub fn main_band(&self) -> Option<[f64; 2]> {
        let mut powers = vec![0.0];
        for pair in self.spectrum.windows(2) {
            let width = pair[1].frequency - pair[0].frequency;
            let so_far = powers.last().copied().unwrap_or(0.0);
            powers.push(so_far + 0.5 * (pair[0].density + pair[1].density) * width);
        }
        let whole = powers.last().copied().filter(|whole| *whole > 0.0)?;
        let at = |share: f64| {
            let position = powers.partition_point(|power| *power < share * whole);
            self.spectrum.get(position).map(|point| point.frequency)
        };
        Some([at(0.05)?, at(0.95)?])
    }
}
