//! Signals to simulate with.

use std::f64::consts::TAU;

/// SplitMix64 (Steele, Lea and Flood 2014) and the polar form of Box and Muller.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        ((bits >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
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
