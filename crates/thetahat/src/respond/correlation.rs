//! How the errors of neighbouring points of a measured frequency response are correlated.
//!
//! An estimate that is smooth over a band has the same noise in all points of it. With rho(d) the correlation over a
//! distance d, and as the noise at -omega is the conjugate of that at omega, the real parts of the points k and l, in
//! standard deviations, have the covariance rho(omega_k - omega_l) + rho(omega_k + omega_l), the imaginary parts
//! rho(omega_k - omega_l) - rho(omega_k + omega_l), and the two none. It is
//!
//! ```text
//! rho(x b) = 1 - x/2 - 5/3 x^2 + 5/4 x^3 - 5/48 x^5     of a parabola fitted to lines within b on either side, x < 2
//! rho(x pi/(M T)) = s(x) + 2/3 (s(x-1) + s(x+1)) + 1/6 (s(x-2) + s(x+2))         of Hann's window of M lags
//! ```
//!
//! and the square of the latter, with M = L/2, of averages over Hann's windows of L rows: s(x) = sin(pi x)/(pi x). The
//! first is that of least squares, the second the transform of w^2 over the window.
//!
//! Sources: Fan and Gijbels, Local Polynomial Modelling and Its Applications, 1996, section 3.2; Priestley, Spectral
//! Analysis and Time Series, 1981, section 6.2.4.

use std::f64::consts::{PI, TAU};

/// Over which distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Correlation {
    /// The points are independent.
    None,
    /// Parabolas over lines within so many rad/s on either side.
    Parabolas(f64),
    /// Hann's window of so many seconds of lags.
    Lags(f64),
    /// Hann's windows of so many seconds.
    Windows(f64),
}

impl Correlation {
    /// Of two distances in rad/s, with the signs of real and imaginary parts: the correlations of both parts.
    pub(crate) fn of_parts(self, one: f64, other: f64) -> [f64; 2] {
        let (apart, mirrored) = (self.at((one - other).abs()), self.at(one + other));
        [apart + mirrored, apart - mirrored]
    }

    fn at(self, distance: f64) -> f64 {
        match self {
            Self::None => f64::from(distance == 0.0),
            Self::Parabolas(width) => {
                let x = distance / width;
                let polynomial =
                    1.0 - x / 2.0 - 5.0 / 3.0 * x.powi(2) + 1.25 * x.powi(3) - 5.0 / 48.0 * x.powi(5);
                if x < 2.0 { polynomial } else { 0.0 }
            }
            Self::Lags(seconds) => hann(distance * seconds / PI),
            Self::Windows(seconds) => hann(distance * seconds / TAU).powi(2),
        }
    }

    /// The sum of rho psi_k psi_l' over all pairs of points and their two parts, row by row. `slopes` are those of the
    /// real and the imaginary part of each point by each of so many parameters, in standard deviations. O(K^2 p^2)
    /// where errors are correlated.
    pub(crate) fn spread(self, frequencies: &[f64], slopes: &[[f64; 2]], size: usize) -> Vec<f64> {
        let mut sum = vec![0.0; size * size];
        let of = |point: usize| &slopes[point * size..(point + 1) * size];
        for (one, &frequency) in frequencies.iter().enumerate() {
            for (other, &beside) in frequencies.iter().enumerate() {
                let correlations = match self {
                    // Each point for itself, be there others of its frequency.
                    Self::None if one == other => [1.0; 2],
                    Self::None => continue,
                    _ => self.of_parts(frequency, beside),
                };
                if correlations == [0.0; 2] {
                    continue;
                }
                for (i, row) in of(one).iter().enumerate() {
                    for (j, column) in of(other).iter().enumerate() {
                        let parts = correlations.iter().zip(row).zip(column);
                        sum[i * size + j] +=
                            parts.map(|((rho, row), column)| rho * row * column).sum::<f64>();
                    }
                }
            }
        }
        sum
    }
}

/// The transform of the fourth power of a cosine, 1 at 0.
fn hann(x: f64) -> f64 {
    let s = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
    s(x) + 2.0 / 3.0 * (s(x - 1.0) + s(x + 1.0)) + (s(x - 2.0) + s(x + 2.0)) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_the_sums_that_they_stand_for() {
        // Weights of a parabola at its middle, over many lines; and the transform of w^2.
        const LINES: i32 = 2000;
        let weight = |k: i32| {
            let x = f64::from(k) / f64::from(LINES);
            if x.abs() <= 1.0 { 9.0 - 15.0 * x * x } else { 0.0 }
        };
        let product = |shift: i32| (-LINES..=LINES).map(|k| weight(k) * weight(k + shift)).sum::<f64>();
        for part in [0.0, 0.3, 1.0, 1.7, 2.4] {
            let expected = product((part * f64::from(LINES)) as i32) / product(0);
            assert!((Correlation::Parabolas(0.5).at(0.5 * part) - expected).abs() < 2e-3, "{part}");
        }
        const LAGS: i32 = 400;
        let window = |tau: i32| (0.5 * (1.0 + (PI * f64::from(tau) / f64::from(LAGS)).cos())).powi(2);
        let transform = |angle: f64| -> f64 {
            (-LAGS..=LAGS).map(|tau| window(tau) * (angle * f64::from(tau)).cos()).sum()
        };
        for x in [0.0, 0.4, 1.0, 1.6, 2.5, 4.2] {
            let expected = transform(x * PI / f64::from(LAGS)) / transform(0.0);
            let own = Correlation::Lags(0.1 * f64::from(LAGS)).at(x * PI / (0.1 * f64::from(LAGS)));
            assert!((own - expected).abs() < 1e-3, "{x}: {own} {expected}");
            let windows = Correlation::Windows(0.2 * f64::from(LAGS)).at(x * PI / (0.1 * f64::from(LAGS)));
            assert!((windows - expected * expected).abs() < 1e-3, "{x}: {windows}");
        }
    }

    #[test]
    fn independent_points_add_up() {
        let slopes = [[1.0, 2.0], [0.5, -1.0], [3.0, 0.0], [2.0, 1.0]];
        let sum = Correlation::None.spread(&[1.0, 1.0], &slopes, 2);
        assert_eq!(sum, [1.0 + 4.0 + 9.0, 0.5 - 2.0 + 6.0, 0.5 - 2.0 + 6.0, 0.25 + 1.0 + 4.0 + 1.0]);
        // Points that are one have twice the spread of two: the same error counts twice.
        let wide = Correlation::Lags(1e-6).spread(&[1e3, 1e3], &[[1.0, 0.0], [1.0, 0.0]], 1);
        assert!((wide[0] - 8.0).abs() < 1e-3, "{wide:?}");
    }
}
