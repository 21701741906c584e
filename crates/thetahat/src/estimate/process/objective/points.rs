//! What a measured frequency response says of one input.

use crate::respond::Correlation;
use crate::respond::process::Points;

/// Measured points of the frequency response from one input.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ResponsePoints {
    /// In rad/s, and the points themselves.
    pub(crate) frequencies: Vec<f64>,
    pub(crate) values: Vec<[f64; 2]>,
    /// What each is multiplied by: one over its standard deviation, or over its size.
    pub(crate) weights: Vec<f64>,
    /// Whether the standard deviations are known.
    pub(crate) known: bool,
    /// Half the shortest period that could be seen, in seconds: a sample time where there are samples.
    pub(crate) sample_time: f64,
    /// Whether the input is held that long; else it is a sine in continuous time.
    pub(crate) held: bool,
    /// How the errors of the points are correlated.
    pub(crate) correlation: Correlation,
}

impl ResponsePoints {
    /// As a process takes them.
    pub(super) fn at(&self) -> Points<'_> {
        (&self.frequencies, self.held.then_some(self.sample_time))
    }

    /// Real and imaginary parts, times their weights.
    pub(crate) fn measured(&self) -> impl Iterator<Item = f64> {
        self.values.iter().zip(&self.weights).flat_map(|(value, weight)| value.map(|part| part * weight))
    }
}
