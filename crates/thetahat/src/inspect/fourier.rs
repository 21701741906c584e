//! The discrete Fourier transform of real signals.

use std::f64::consts::PI;

use thetahat_core::nalgebra::Complex;

/// The transform of L real samples, where L is a power of two and 4 at least:
///
/// ```text
/// X_k = sum_t x(t) exp(-i 2 pi k t/L),   k = 0 … L/2
/// ```
///
/// Even and odd samples are the real and imaginary parts of a complex signal of half the length, which is transformed by
/// radix 2 (Cooley and Tukey 1965) and taken apart again (Press et al. 2007, Numerical Recipes, section 12.3). O(L log L).
/// There is one length in one place, and no need for speed: a library for all lengths would be a sixth of what the compiler
/// makes of this crate.
pub(super) struct RealTransform {
    /// exp(-i pi k/m) at m + k, for each power of two m up to L/2 and k = 0 … m - 1.
    turns: Vec<Complex<f64>>,
    /// Of half the length.
    halves: Vec<Complex<f64>>,
}

impl RealTransform {
    /// For signals of this length.
    pub(super) fn new(length: usize) -> Self {
        debug_assert!(length.is_power_of_two() && length >= 4);
        let turn = |position: usize| {
            let size = 1_usize << position.checked_ilog2().unwrap_or(0);
            unit(-PI * (position % size) as f64 / size as f64)
        };
        Self { turns: (0..length).map(turn).collect(), halves: vec![Complex::default(); length / 2] }
    }

    /// |X_k|^2 of a signal, for each k.
    pub(super) fn powers(&mut self, signal: &[f64]) -> impl Iterator<Item = f64> {
        let half = self.halves.len();
        let unused = usize::BITS - half.ilog2();
        for (k, pair) in signal.chunks_exact(2).enumerate() {
            self.halves[k.reverse_bits() >> unused] = Complex::new(pair[0], pair[1]);
        }
        let mut size = 1;
        while size < half {
            let turns = &self.turns[size..2 * size];
            for block in self.halves.chunks_exact_mut(2 * size) {
                let (even, odd) = block.split_at_mut(size);
                for ((even, odd), turn) in even.iter_mut().zip(odd).zip(turns) {
                    let turned = *odd * turn;
                    (*even, *odd) = (*even + turned, *even - turned);
                }
            }
            size *= 2;
        }
        (0..=half).map(move |k| {
            let (here, mirrored) = (self.halves[k % half], self.halves[(half - k) % half].conj());
            let (even, odd) = ((here + mirrored).scale(0.5), (here - mirrored).scale(0.5));
            // At k = L/2 the turn is by pi.
            let turn = self.turns.get(half + k).copied().unwrap_or(Complex::new(-1.0, 0.0));
            let turned = Complex::<f64>::i() * turn * odd;
            (even - turned).norm_sqr()
        })
    }
}

/// exp(i angle).
fn unit(angle: f64) -> Complex<f64> {
    let (sine, cosine) = angle.sin_cos();
    Complex::new(cosine, sine)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn it_is_the_sum_that_defines_it() {
        for length in [4, 8, 64, 1024] {
            let signal: Vec<f64> =
                (0..length).map(|t| (0.7 * t as f64).sin() + ((t * t) as f64).cos()).collect();
            let found: Vec<f64> = RealTransform::new(length).powers(&signal).collect();
            assert_eq!(found.len(), length / 2 + 1);
            for (k, found) in found.into_iter().enumerate() {
                let terms = signal.iter().enumerate().map(|(t, x)| {
                    // The product is taken modulo L: an angle of 10^6 would have lost digits.
                    unit(-TAU * (k * t % length) as f64 / length as f64) * *x
                });
                let expected = terms.sum::<Complex<f64>>().norm_sqr();
                // Of the largest that it can be.
                let scale = signal.iter().map(|x| x.abs()).sum::<f64>().powi(2);
                assert!((found - expected).abs() < 1e-14 * scale, "{length} {k}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_second_signal_owes_nothing_to_the_first() {
        let mut transform = RealTransform::new(16);
        let constant = [1.0; 16];
        let _ = transform.powers(&[3.0; 16]).count();
        let powers: Vec<f64> = transform.powers(&constant).collect();
        assert!((powers[0] - 256.0).abs() < 1e-12 && powers[1..].iter().all(|power| *power < 1e-24));
    }
}
