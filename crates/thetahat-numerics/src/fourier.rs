//! The discrete Fourier transform of real signals, of any length.

use std::sync::Arc;

pub use rustfft::Fft;
use rustfft::{FftPlanner, FftPlannerScalar};
use thetahat_core::nalgebra::Complex;

/// The transforms of two real signals of L samples at once:
///
/// ```text
/// X_k = sum_t x(t) exp(-i 2 pi k t/L),   k = 0 … L - 1
/// ```
///
/// They are the real and imaginary parts of one complex signal z, and by their symmetry X_k = (Z_k + conj Z_{L-k})/2
/// and Y_k = (Z_k - conj Z_{L-k})/(2i) (Press et al. 2007, Numerical Recipes, section 12.3.1). Rounding errors are of
/// the size of the larger one: signals should be scaled alike. O(L log L) for every L, memory O(L).
pub struct PairTransform {
    plan: Arc<dyn Fft<f64>>,
    values: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

/// The transforms of a pair of signals.
pub struct Pair<'a>(&'a [Complex<f64>]);

impl PairTransform {
    /// For signals of this length, at least 1.
    pub fn new(length: usize) -> Self {
        let plan = FftPlanner::new().plan_fft_forward(length);
        let scratch = vec![Complex::default(); plan.get_inplace_scratch_len()];
        Self { plan, values: vec![Complex::default(); length], scratch }
    }

    /// The transforms of pairs of samples; those that are missing at the end are zeros, further ones are left out.
    pub fn of(&mut self, samples: impl Iterator<Item = (f64, f64)>) -> Pair<'_> {
        let mut samples = samples.map(|(x, y)| Complex::new(x, y));
        self.values.fill_with(|| samples.next().unwrap_or_default());
        self.plan.process_with_scratch(&mut self.values, &mut self.scratch);
        Pair(&self.values)
    }
}

impl Pair<'_> {
    /// (X_k, Y_k) for k below L.
    #[inline]
    pub fn at(&self, k: usize) -> (Complex<f64>, Complex<f64>) {
        let mirrored = if k == 0 { self.0[0] } else { self.0[self.0.len() - k] };
        let (here, mirrored) = (self.0[k], mirrored.conj());
        let (sum, difference) = (here + mirrored, here - mirrored);
        (sum.scale(0.5), Complex::new(0.5 * difference.im, -0.5 * difference.re))
    }
}

/// The transform of complex signals of this length, at least 1, and its inverse times that length: without instruction
/// sets of their own, so that they have the same bits on every processor.
pub fn portable(length: usize) -> [Arc<dyn Fft<f64>>; 2] {
    let mut planner = FftPlannerScalar::new();
    [planner.plan_fft_forward(length), planner.plan_fft_inverse(length)]
}

/// The least length from this on with small factors only, of which transforms are fast.
pub fn suitable(length: usize) -> usize {
    let smooth = |mut length: usize| {
        for factor in [2, 3, 5] {
            while length.is_multiple_of(factor) {
                length /= factor;
            }
        }
        length == 1
    };
    (length..).find(|&length| smooth(length)).unwrap_or(length)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn it_is_the_sum_that_defines_it() {
        for length in [1, 2, 3, 4, 8, 60, 97, 1024] {
            let x = |t: usize| (0.7 * t as f64).sin() + ((t * t) as f64).cos();
            let y = |t: usize| (0.3 * t as f64).cos() - 0.2 * (t % 3) as f64;
            let mut transform = PairTransform::new(length);
            // What came before leaves nothing.
            let _ = transform.of((0..length).map(|_| (3.0, -1.0)));
            let found = transform.of((0..length).map(|t| (x(t), y(t))));
            for k in 0..length {
                let sum = |of: &dyn Fn(usize) -> f64| -> Complex<f64> {
                    // The product is taken modulo L: an angle of 10^6 would have lost digits.
                    let turn = |t: usize| {
                        let angle = -TAU * (k * t % length) as f64 / length as f64;
                        Complex::new(angle.cos(), angle.sin())
                    };
                    (0..length).map(|t| turn(t) * of(t)).sum()
                };
                let (first, second) = found.at(k);
                // Of the largest that it can be.
                let tolerance = 1e-14 * 2.0 * length as f64;
                assert!((first - sum(&x)).norm() < tolerance, "{length} {k}");
                assert!((second - sum(&y)).norm() < tolerance, "{length} {k}");
            }
        }
    }

    #[test]
    fn short_signals_are_padded() {
        let found = |samples: &[(f64, f64)]| PairTransform::new(4).of(samples.iter().copied()).at(1);
        assert_eq!(found(&[(1.0, 2.0)]), found(&[(1.0, 2.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)]));
    }
}
