//! Signals to simulate with.

use std::f64::consts::TAU;

use thetahat_numerics::noise::Noise;

/// Numbers of which none is 0, and the polar form of Box and Muller.
pub(crate) struct Random(Noise);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Noise(seed))
    }

    /// Uniform in 0 … 1, in the middle of steps of 2^-53.
    pub(crate) fn uniform(&mut self) -> f64 {
        0.5 * (1.0 + self.0.uniform()) + 0.25 * f64::EPSILON
    }

    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    pub(crate) fn normals(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.normal()).collect()
    }
}

/// numerator/denominator applied to a signal from rest.
pub(crate) fn filtered(numerator: &[f64], denominator: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut response: Vec<f64> = Vec::with_capacity(signal.len());
    for t in 0..signal.len() {
        let driven: f64 = (0..numerator.len().min(t + 1)).map(|i| numerator[i] * signal[t - i]).sum();
        let past: f64 = (1..denominator.len().min(t + 1)).map(|i| denominator[i] * response[t - i]).sum();
        response.push(driven - past);
    }
    response
}

/// A plant runs so long before the log begins, so that it is not at rest.
pub(crate) const BEFORE: usize = 300;
