//! Random numbers that are the same for the same seed, on every machine and for any number of threads.

use std::f64::consts::TAU;

use oorandom::Rand64;

/// A stream of random numbers.
#[derive(Debug)]
pub struct Random(Rand64);

impl Random {
    /// The stream of this number: those of one seed have nothing in common.
    pub fn of(seed: u64, number: u64) -> Self {
        let high = mixed(seed);
        Self(Rand64::new(u128::from(high) << 64 | u128::from(mixed(high ^ number))))
    }

    /// Uniform in 0 … 1, 1 excluded.
    pub fn uniform(&mut self) -> f64 {
        self.0.rand_float()
    }

    /// Gaussian, of variance 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        // 1 - u is above 0.
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

/// All bits of a number in every bit (Steele, Lea and Flood 2014, SplitMix64).
pub fn mixed(number: u64) -> u64 {
    let mut bits = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
