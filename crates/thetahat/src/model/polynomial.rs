//! Polynomials in q^-1, lowest power first.

use faer::Mat;
use thetahat_core::nalgebra::{Complex, ComplexField};

const NEWTON_STEPS: usize = 4;

/// The finite roots in z of p0 + p1 z^-1 + … + pn z^-n, that is of p0 z^n + p1 z^(n-1) + … + pn.
///
/// Leading zeros (a delay) are left out, and so is a leading coefficient so small that its root overflows. The roots are
/// the eigenvalues of the scaled companion matrix (Edelman and Murakami, Polynomial roots from companion
/// matrix eigenvalues, Mathematics of Computation 64, 1995), improved by Newton steps while these lower the
/// polynomial's size. Largest first; of a conjugate pair the positive imaginary part first. O(n^3).
/// `None` if the iteration does not converge, which no polynomial is known to cause.
pub(crate) fn roots(polynomial: &[f64]) -> Option<Vec<Complex<f64>>> {
    let trimmed = |polynomial: &[f64]| {
        let largest = polynomial.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        polynomial.iter().take_while(|value| !(largest / **value).is_finite()).count()
    };
    let polynomial = &polynomial[trimmed(polynomial)..];
    // Trailing zeros are roots at the origin.
    let at_origin = polynomial.iter().rev().take_while(|value| **value == 0.0).count();
    let polynomial = &polynomial[..polynomial.len() - at_origin];
    let mut roots = vec![Complex::new(0.0, 0.0); at_origin];
    if let [lead, rest @ ..] = polynomial
        && !rest.is_empty()
    {
        // In units of s = max |p_k/p_0|^(1/k), here a power of two, all roots lie within |w| <= 4 (Fujiwara 1916) and
        // nothing overflows.
        let sizes = rest.iter().zip(1..).map(|(value, k)| (value / lead).abs().log2() / f64::from(k));
        let unit = sizes.fold(f64::NEG_INFINITY, f64::max).round();
        let scaled: Vec<f64> = std::iter::once(1.0)
            .chain(rest.iter().zip(1..).map(|(value, k)| {
                // In two steps: a single factor may be beyond the range.
                let half = (-0.5 * f64::from(k) * unit).floor();
                value / lead * half.exp2() * (-f64::from(k) * unit - half).exp2()
            }))
            .collect();
        let companion = Mat::from_fn(rest.len(), rest.len(), |row, column| match row {
            0 => -scaled[column + 1],
            _ => f64::from(u8::from(row == column + 1)),
        });
        let eigenvalues = companion.eigenvalues().ok()?;
        let restored = eigenvalues.iter().map(|root| polished(&scaled, *root) * unit.exp2());
        roots.extend(restored.filter(|root| root.modulus().is_finite()));
    }
    roots.sort_by(|a, b| {
        b.modulus().total_cmp(&a.modulus()).then(b.re.total_cmp(&a.re)).then(b.im.total_cmp(&a.im))
    });
    Some(roots)
}

/// A root after the Newton steps that lower |p|. A real root stays real.
fn polished(polynomial: &[f64], mut root: Complex<f64>) -> Complex<f64> {
    let evaluate = |z: Complex<f64>| {
        let zero = Complex::new(0.0, 0.0);
        polynomial
            .iter()
            .fold((zero, zero), |(value, slope), coefficient| (value * z + coefficient, slope * z + value))
    };
    let (mut value, mut slope) = evaluate(root);
    for _ in 0..NEWTON_STEPS {
        let next = root - value / slope;
        let (next_value, next_slope) = evaluate(next);
        if next_value.modulus() < value.modulus() {
            (root, value, slope) = (next, next_value, next_slope);
        } else {
            // No better, or not a number where the slope vanishes.
            break;
        }
    }
    root
}

/// The product of two polynomials.
pub(crate) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            product[i + j] += a * b;
        }
    }
    product
}

/// The first `length` coefficients of the series 1 / A, A monic.
pub(crate) fn inverse_series(a: &[f64], length: usize) -> Vec<f64> {
    let mut series: Vec<f64> = Vec::with_capacity(length);
    for t in 0..length {
        let start = if t == 0 { 1.0 } else { 0.0 };
        let past: f64 = a.iter().skip(1).zip(series.iter().rev()).map(|(a, h)| a * h).sum();
        series.push(start - past);
    }
    series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_roots_come_back() {
        // (1 - 0.9 z^-1) (1 - 1.6 z^-1 + 0.8 z^-2) z^-2: the delay has no root.
        let polynomial = product(&[0.0, 0.0, 1.0, -0.9], &[1.0, -1.6, 0.8]);
        let roots = roots(&polynomial).unwrap();
        let expected = [Complex::new(0.9, 0.0), Complex::new(0.8, 0.4), Complex::new(0.8, -0.4)];
        assert_eq!(roots.len(), 3);
        for (root, expected) in roots.iter().zip(expected) {
            assert!((root - expected).modulus() < 1e-14, "{root}");
        }
        assert_eq!(roots[1], roots[2].conj());
    }

    #[test]
    fn odd_polynomials_have_their_roots() {
        assert_eq!(roots(&[]).unwrap(), []);
        assert_eq!(roots(&[0.0, 0.0]).unwrap(), []);
        assert_eq!(roots(&[3.0]).unwrap(), []);
        assert_eq!(roots(&[2.0, 0.0, 0.0]).unwrap(), [Complex::new(0.0, 0.0); 2]);
        assert_eq!(roots(&[1e-320, 1.0, -0.5]).unwrap(), [Complex::new(0.5, 0.0)]);
        assert_eq!(roots(&[1.0, -1e200]).unwrap(), [Complex::new(1e200, 0.0)]);
    }

    #[test]
    fn many_roots_on_a_circle_are_exact() {
        let mut polynomial = vec![0.0; 41];
        polynomial[0] = 1.0;
        polynomial[40] = -1.0;
        for root in roots(&polynomial).unwrap() {
            assert!((root.modulus() - 1.0).abs() < 1e-13, "{root}");
        }
    }

    #[test]
    fn a_series_times_its_polynomial_is_one() {
        let a = [1.0, -1.5, 0.7];
        let identity = product(&a, &inverse_series(&a, 30));
        assert!((identity[0] - 1.0).abs() < 1e-15);
        assert!(identity[1..30].iter().all(|value| value.abs() < 1e-14));
    }
}
