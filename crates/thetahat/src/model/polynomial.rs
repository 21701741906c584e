//! Polynomials in q^-1, lowest power first.

use std::f64::consts::TAU;

use thetahat_core::nalgebra::{Complex, ComplexField};

/// Sweeps over all roots. Twenty are common; clusters of equal roots take more.
const MAXIMUM_SWEEPS: usize = 200;

/// The finite roots in z of p0 + p1 z^-1 + … + pn z^-n, that is of p0 z^n + p1 z^(n-1) + … + pn.
///
/// Leading zeros (a delay) are left out, and so is a leading coefficient so small that its root overflows. All roots are
/// improved at once,
///
/// ```text
/// z_i <- z_i - N_i / (1 - N_i sum_j 1/(z_i - z_j)),   N_i = p(z_i)/p'(z_i),
/// ```
///
/// from starts on the circles of the Newton polygon, until |p(z_i)| is below its rounding (Aberth 1973; Bini,
/// Numerical computation of polynomial zeros by means of Aberth's method, Numerical Algorithms 13, 1996). So each root is
/// exact for coefficients that differ from the given ones by rounding, each relative to itself. Eigenvalues of the
/// companion matrix are not: a B with one small leading coefficient has a large zero, beside which they lose the others.
///
/// Largest first; of a conjugate pair the positive imaginary part first. O(n^2) for each sweep.
/// `None` if a coefficient is not finite, or the iteration does not converge, which no polynomial is known to cause.
pub(crate) fn roots(polynomial: &[f64]) -> Option<Vec<Complex<f64>>> {
    if !polynomial.iter().all(|value| value.is_finite()) {
        return None;
    }
    let (unit, mut rising) = scaled(polynomial);
    // Constants that are zero are roots at the origin.
    let at_origin = rising.iter().take_while(|value| **value == 0.0).count();
    rising.drain(..at_origin);
    let mut roots = starts(&rising);
    let mut moving: Vec<usize> = (0..roots.len()).collect();
    for _ in 0..MAXIMUM_SWEEPS {
        moving.retain(|&index| improve(&rising, &mut roots, index));
    }
    if !moving.is_empty() {
        return None;
    }
    let mut roots = in_pairs(roots);
    roots.extend(std::iter::repeat_n(Complex::new(0.0, 0.0), at_origin));
    roots.iter_mut().for_each(|root| *root *= unit);
    roots.retain(|root| root.modulus().is_finite());
    roots.sort_by(|a, b| {
        b.modulus().total_cmp(&a.modulus()).then(b.re.total_cmp(&a.re)).then(b.im.total_cmp(&a.im))
    });
    Some(roots)
}

/// The unit of z in which the roots have a geometric mean near 1, and the coefficients of z / unit, lowest power
/// first, none far above 1. All factors are powers of two. What overflows or underflows is left to the ends, as zeros.
fn scaled(polynomial: &[f64]) -> (f64, Vec<f64>) {
    let size = |value: f64| value.abs().log2();
    let used = || polynomial.iter().enumerate().filter(|(_, value)| **value != 0.0);
    let (Some((first, lead)), Some((last, constant))) = (used().next(), used().next_back()) else {
        return (1.0, Vec::new());
    };
    let unit =
        ((size(*constant) - size(*lead)) / (last - first).max(1) as f64).round().clamp(-1000.0, 1000.0);
    let highest = |k: usize, value: f64| size(value) - k as f64 * unit;
    let peak = used().map(|(k, value)| highest(k, *value)).fold(f64::NEG_INFINITY, f64::max).floor();
    let shifted = |(k, value): (usize, &f64)| {
        // In three steps: a single factor may be beyond the range, where the product is not.
        let shift = (-peak - k as f64 * unit).clamp(-3000.0, 3000.0);
        let third = (shift / 3.0).floor();
        value * third.exp2() * third.exp2() * (shift - 2.0 * third).exp2()
    };
    let mut rising: Vec<f64> = polynomial.iter().enumerate().map(shifted).collect();
    rising.reverse();
    // Leading zeros are a delay.
    rising.truncate(rising.iter().rposition(|value| *value != 0.0).map_or(0, |last| last + 1));
    (unit.exp2(), rising)
}

/// Points near the roots: as many on each circle as the Newton polygon, the upper convex hull of (k, log |c_k|), has
/// steps on the edge of that slope.
fn starts(rising: &[f64]) -> Vec<Complex<f64>> {
    let height = |k: usize| rising[k].abs().log2();
    let slope = |from: usize, to: usize| (height(to) - height(from)) / (to - from) as f64;
    let mut hull: Vec<usize> = Vec::new();
    for k in (0..rising.len()).filter(|&k| rising[k] != 0.0) {
        while let [.., before, last] = hull[..]
            && slope(before, last) <= slope(last, k)
        {
            hull.pop();
        }
        hull.push(k);
    }
    let edges = hull.windows(2).enumerate();
    edges
        .flat_map(|(edge, ends)| {
            let (count, radius) = (ends[1] - ends[0], (-slope(ends[0], ends[1])).exp2());
            // Turned from the real axis, so that no symmetry holds two roots together.
            let turn = 0.7 + TAU * edge as f64 / rising.len() as f64;
            (0..count).map(move |k| Complex::from_polar(radius, turn + TAU * k as f64 / count as f64))
        })
        .collect()
}

/// 1/z without overflow of |z|^2.
fn reciprocal(z: Complex<f64>) -> Complex<f64> {
    let square = z.norm_sqr();
    if square.is_normal() {
        return z.conj() / square;
    }
    let modulus = z.modulus();
    z.conj() / modulus / modulus
}

/// One step of a root; whether it has further to go.
fn improve(rising: &[f64], roots: &mut [Complex<f64>], index: usize) -> bool {
    let root = roots[index];
    // Outside the unit circle the polynomial in 1/z: p(z) = z^n q(y), y = 1/z, p/p' = 1/(y (n - y q'/q)).
    let inside = root.modulus() <= 1.0;
    let at = if inside { root } else { reciprocal(root) };
    let (mut value, mut slope, mut rounding) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0), 0.0);
    let mut step = |coefficient: f64| {
        slope = slope * at + value;
        value = value * at + coefficient;
        rounding = rounding * at.modulus() + value.modulus();
    };
    if inside {
        rising.iter().rev().for_each(|&coefficient| step(coefficient));
    } else {
        rising.iter().for_each(|&coefficient| step(coefficient));
    }
    if value.modulus() <= 4.0 * f64::EPSILON * rounding {
        return false;
    }
    // p'/p, so that a vanishing slope does no harm.
    let logarithmic = if inside {
        slope * reciprocal(value)
    } else {
        at * ((rising.len() - 1) as f64 - at * slope * reciprocal(value))
    };
    let others = roots.iter().map(|other| root - other).filter(|apart| *apart != Complex::new(0.0, 0.0));
    let repulsion: Complex<f64> = others.map(reciprocal).sum();
    let correction = reciprocal(logarithmic - repulsion);
    if !correction.modulus().is_finite() {
        return true;
    }
    roots[index] = root - correction;
    correction.modulus() > f64::EPSILON * root.modulus()
}

/// Roots of a real polynomial are real or conjugate: each joins the mirror image that is nearest, which may be its own.
fn in_pairs(mut roots: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    let mut paired = Vec::with_capacity(roots.len());
    roots.sort_by(|a, b| a.im.abs().total_cmp(&b.im.abs()));
    while let Some(root) = roots.pop() {
        let distance = |other: &Complex<f64>| (other.conj() - root).modulus();
        let nearest = (0..roots.len()).min_by(|&i, &j| distance(&roots[i]).total_cmp(&distance(&roots[j])));
        match nearest {
            Some(nearest) if distance(&roots[nearest]) < distance(&root) => {
                let middle = (root + roots.remove(nearest).conj()) * 0.5;
                paired.extend([middle, middle.conj()]);
            }
            _ => paired.push(Complex::new(root.re, 0.0)),
        }
    }
    paired
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
