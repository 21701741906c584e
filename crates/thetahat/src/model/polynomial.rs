//! Polynomials in q^-1, lowest power first.

use std::f64::consts::TAU;

use thetahat_core::nalgebra::{Complex, ComplexField};

/// Sweeps over all roots. Twenty are common; clusters of equal roots take more.
const MAXIMUM_SWEEPS: usize = 200;
/// Beside a largest coefficient near 1 the reciprocal of a smaller one may overflow.
const NEGLIGIBLE: f64 = 1e-290;
const NEWTON_STEPS: usize = 2;

/// The finite roots in z of p0 + p1 z^-1 + … + pn z^-n, that is of p0 z^n + p1 z^(n-1) + … + pn.
///
/// Leading zeros (a delay) are left out, and so is a leading coefficient so small that its root overflows. All roots
/// are improved at once,
///
/// ```text
/// z_i <- z_i - N_i / (1 - N_i sum_j 1/(z_i - z_j)),   N_i = p(z_i)/p'(z_i),
/// ```
///
/// from starts on the circles of the Newton polygon, until |p(z_i)| is below its rounding (Aberth 1973; Bini, Numerical
/// computation of polynomial zeros by means of Aberth's method, Numerical Algorithms 13, 1996). So each root is exact
/// for coefficients that differ from the given ones by rounding, each relative to itself. Eigenvalues of the companion
/// matrix are not: a B with one small leading coefficient has a large zero, beside which they lose the others.
///
/// Largest first; of a conjugate pair the positive imaginary part first. O(n^2) for each sweep.
/// `None` if a coefficient is not finite, or the iteration does not converge, which no polynomial is known to cause.
pub(crate) fn roots(polynomial: &[f64]) -> Option<Vec<Complex<f64>>> {
    Roots::default().of(polynomial).map(<[_]>::to_vec)
}

/// Memory for the roots of one polynomial after another.
#[derive(Debug, Clone, Default)]
pub(crate) struct Roots {
    rising: Vec<f64>,
    hull: Vec<usize>,
    moving: Vec<usize>,
    unpaired: Vec<Complex<f64>>,
    roots: Vec<Complex<f64>>,
}

impl Roots {
    /// With memory for polynomials of this many coefficients.
    pub(crate) fn with_capacity(coefficients: usize) -> Self {
        Self {
            rising: Vec::with_capacity(coefficients),
            hull: Vec::with_capacity(coefficients),
            moving: Vec::with_capacity(coefficients),
            unpaired: Vec::with_capacity(coefficients),
            roots: Vec::with_capacity(coefficients),
        }
    }

    /// As [`roots`].
    pub(crate) fn of(&mut self, polynomial: &[f64]) -> Option<&[Complex<f64>]> {
        if !polynomial.iter().all(|value| value.is_finite()) {
            return None;
        }
        let Self { rising, hull, moving, unpaired, roots } = self;
        let unit = scale(polynomial, rising);
        // Constants that are zero are roots at the origin.
        let at_origin = rising.iter().take_while(|value| **value == 0.0).count();
        rising.drain(..at_origin);
        start(rising, hull, unpaired);
        moving.clear();
        moving.extend(0..unpaired.len());
        for _ in 0..MAXIMUM_SWEEPS {
            moving.retain(|&index| improve(rising, unpaired, index));
        }
        if !moving.is_empty() {
            return None;
        }
        roots.clear();
        pair(rising, unpaired, roots);
        roots.extend(std::iter::repeat_n(Complex::new(0.0, 0.0), at_origin));
        roots.iter_mut().for_each(|root| *root *= unit);
        roots.retain(|root| root.modulus().is_finite());
        roots.sort_by(|a, b| {
            b.modulus().total_cmp(&a.modulus()).then(b.re.total_cmp(&a.re)).then(b.im.total_cmp(&a.im))
        });
        Some(roots)
    }
}

/// The unit of z in which the roots have a geometric mean near 1; writes the coefficients of z / unit, lowest power
/// first, none far above 1. All factors are powers of two. What overflows or underflows is left to the ends, as zeros.
fn scale(polynomial: &[f64], rising: &mut Vec<f64>) -> f64 {
    let size = |value: f64| value.abs().log2();
    let used = || polynomial.iter().enumerate().filter(|(_, value)| **value != 0.0);
    rising.clear();
    let (Some((first, lead)), Some((last, constant))) = (used().next(), used().next_back()) else {
        return 1.0;
    };
    let unit =
        ((size(*constant) - size(*lead)) / (last - first).max(1) as f64).round().clamp(-1000.0, 1000.0);
    let highest = |k: usize, value: f64| size(value) - k as f64 * unit;
    let peak = used().map(|(k, value)| highest(k, *value)).fold(f64::NEG_INFINITY, f64::max).floor();
    let shifted = |(k, value): (usize, &f64)| {
        // In three steps: a single factor may be beyond the range, where the product is not.
        let shift = (-peak - k as f64 * unit).clamp(-3000.0, 3000.0);
        let third = (shift / 3.0).floor();
        let value = value * third.exp2() * third.exp2() * (shift - 2.0 * third).exp2();
        if value.abs() < NEGLIGIBLE { 0.0 } else { value }
    };
    rising.extend(polynomial.iter().enumerate().map(shifted));
    rising.reverse();
    // Leading zeros are a delay.
    rising.truncate(rising.iter().rposition(|value| *value != 0.0).map_or(0, |last| last + 1));
    unit.exp2()
}

/// Points near the roots: as many on each circle as the Newton polygon, the upper convex hull of (k, log |c_k|), has
/// steps on the edge of that slope.
fn start(rising: &[f64], hull: &mut Vec<usize>, points: &mut Vec<Complex<f64>>) {
    let height = |k: usize| rising[k].abs().log2();
    let slope = |from: usize, to: usize| (height(to) - height(from)) / (to - from) as f64;
    hull.clear();
    for k in (0..rising.len()).filter(|&k| rising[k] != 0.0) {
        while let [.., before, last] = hull[..]
            && slope(before, last) <= slope(last, k)
        {
            hull.pop();
        }
        hull.push(k);
    }
    points.clear();
    for (edge, ends) in hull.windows(2).enumerate() {
        let (count, radius) = (ends[1] - ends[0], (-slope(ends[0], ends[1])).exp2());
        // Turned from the real axis, so that no symmetry holds two roots together.
        let turn = 0.7 + TAU * edge as f64 / rising.len() as f64;
        points.extend((0..count).map(|k| {
            let (sine, cosine) = (turn + TAU * k as f64 / count as f64).sin_cos();
            Complex::new(radius * cosine, radius * sine)
        }));
    }
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

/// A polynomial at a point: |p| as a fraction of what rounding may make of it, and p'/p.
fn evaluate(rising: &[f64], z: Complex<f64>) -> (f64, Complex<f64>) {
    let zero = Complex::new(0.0, 0.0);
    // Outside the unit circle in y = 1/z: p(z) = z^n q(y), p'/p = y (n - y q'/q).
    let inside = z.modulus() <= 1.0;
    let at = if inside { z } else { reciprocal(z) };
    let (size, mut value, mut slope, mut rounding) = (at.modulus(), zero, zero, 0.0);
    let mut step = |coefficient: &f64| {
        slope = slope * at + value;
        value = value * at + coefficient;
        rounding = rounding * size + value.modulus();
    };
    if inside {
        rising.iter().rev().for_each(&mut step);
    } else {
        rising.iter().for_each(&mut step);
    }
    // The inverse of Newton's step, so that a slope that vanishes does no harm.
    let inverse = slope * reciprocal(value);
    let inverse = if inside { inverse } else { at * ((rising.len() - 1) as f64 - at * inverse) };
    (value.modulus() / rounding / (4.0 * f64::EPSILON), inverse)
}

/// One step of a root; whether it has further to go.
fn improve(rising: &[f64], roots: &mut [Complex<f64>], index: usize) -> bool {
    let root = roots[index];
    let (size, inverse) = evaluate(rising, root);
    if size <= 1.0 {
        return false;
    }
    let others = roots.iter().map(|other| root - other).filter(|apart| *apart != Complex::new(0.0, 0.0));
    let repulsion: Complex<f64> = others.map(reciprocal).sum();
    let correction = reciprocal(inverse - repulsion);
    if !correction.modulus().is_finite() {
        return true;
    }
    roots[index] = root - correction;
    correction.modulus() > (f64::EPSILON * root.modulus()).max(f64::MIN_POSITIVE)
}

/// A root after Newton steps, as long as they lower |p|: they take what rounding left.
fn polished(rising: &[f64], mut root: Complex<f64>) -> Complex<f64> {
    let (mut size, mut inverse) = evaluate(rising, root);
    for _ in 0..NEWTON_STEPS {
        let next = root - reciprocal(inverse);
        let (next_size, next_inverse) = evaluate(rising, next);
        if next_size < size {
            (root, size, inverse) = (next, next_size, next_inverse);
        } else {
            // No better, or not a number, as at an exact root.
            break;
        }
    }
    root
}

/// Roots of a real polynomial are real or conjugate: each joins the mirror image that is nearest, which may be its own.
fn pair(rising: &[f64], roots: &mut Vec<Complex<f64>>, paired: &mut Vec<Complex<f64>>) {
    roots.sort_by(|a, b| a.im.abs().total_cmp(&b.im.abs()));
    while let Some(root) = roots.pop() {
        let distance = |other: &Complex<f64>| (other.conj() - root).modulus();
        let nearest = (0..roots.len()).min_by(|&i, &j| distance(&roots[i]).total_cmp(&distance(&roots[j])));
        match nearest {
            Some(nearest) if distance(&roots[nearest]) < distance(&root) => {
                let middle = (root + roots.remove(nearest).conj()) * 0.5;
                let middle = polished(rising, middle);
                paired.extend([middle, middle.conj()]);
            }
            _ => paired.push(Complex::new(polished(rising, Complex::new(root.re, 0.0)).re, 0.0)),
        }
    }
}

/// Whether all roots of a monic polynomial lie inside the unit circle, by the step-down recursion
///
/// ```text
/// k_n = p_n,   p_i <- (p_i - k_n p_{n-i}) / (1 - k_n^2),   |k_n| < 1 for n, n-1, …, 1
/// ```
///
/// (Schur and Cohn; Kay, Modern Spectral Estimation, 1988, section 6.3). `scratch` is overwritten. O(n^2).
pub(crate) fn is_stable(monic: &[f64], scratch: &mut Vec<f64>) -> bool {
    scratch.clear();
    scratch.extend_from_slice(monic.get(1..).unwrap_or(&[]));
    while let Some(reflection) = scratch.pop() {
        let rest = 1.0 - reflection * reflection;
        // A NaN is not stable.
        if rest.is_nan() || rest <= 0.0 {
            return false;
        }
        let count = scratch.len();
        for low in 0..count.div_ceil(2) {
            let high = count - 1 - low;
            let (a, b) = (scratch[low], scratch[high]);
            scratch[low] = (a - reflection * b) / rest;
            scratch[high] = (b - reflection * a) / rest;
        }
    }
    true
}

/// Writes the monic polynomial of some roots.
pub(crate) fn multiply_out(roots: impl Iterator<Item = Complex<f64>>, product: &mut Vec<Complex<f64>>) {
    product.clear();
    product.push(Complex::new(1.0, 0.0));
    for root in roots {
        product.push(Complex::new(0.0, 0.0));
        for k in (1..product.len()).rev() {
            let before = product[k - 1];
            product[k] -= before * root;
        }
    }
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
#[cfg(test)]
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
mod tests;
