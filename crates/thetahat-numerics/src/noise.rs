//! Random numbers for tests: the same on every machine.

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct Noise(
    /// The state: a seed before the first number.
    pub u64,
);

impl Noise {
    /// Uniform in -1 … 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Gaussian, of variance 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let mut uniform = || 0.5 * (1.0 + self.uniform());
        // 1 - u is above 0.
        (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
    }

    /// This many uniform ones.
    pub fn take(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.uniform()).collect()
    }

    /// This many Gaussian ones.
    pub fn take_normal(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.normal()).collect()
    }
}
