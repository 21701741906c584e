//! Innovations of a stationary process that was measured without a gap, in O(m) for each sample.
//!
//! With the innovation v of variance f and the gain M/f of the filter of [`Arma`], whose state begins with its
//! stationary covariance, the covariance changes by a matrix of rank one, P(t+1) - P(t) = X L L':
//!
//! ```text
//! M(1) = T P h' + g,  f(1) = r(0),  L(1) = M(1),  X(1) = -1/f(1),  h = (1, 0, …, 0)
//! z = h L,  f(t+1) = f + z^2 X,  M(t+1) = M + T L X z,  L(t+1) = T L - M(t+1) z/f(t+1),  X(t+1) = X f(t+1)/f
//! ```
//!
//! (Morf, Sidhu and Kailath, IEEE Trans. Automatic Control 19 (1974); Pearlman, Biometrika 67 (1980)). T moves its
//! argument up by one and subtracts A times the first entry. Where L has died away the filter is e = A/C w, of which
//! only the coefficients that are not zero cost anything.

use super::Scanned;
use super::arma::{Arma, Terms, terms};

/// The filter stays as it is where the covariance would change by less than this, in units of var e.
const SETTLED: f64 = 1e-24;
/// After so many samples it is looked at again.
const EVERY: usize = 8;

/// x <- T x, without its part of A: moves up by one.
fn shift(x: &mut [f64]) {
    let last = x.len() - 1;
    x.copy_within(1.., 0);
    x[last] = 0.0;
}

/// x <- x - factor A.
fn subtract(x: &mut [f64], a: &Terms, factor: f64) {
    for (lag, a) in a {
        x[lag - 1] -= a * factor;
    }
}

/// x <- x + factor y.
fn add(x: &mut [f64], y: &[f64], factor: f64) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x += factor * y);
}

/// What changes with a parameter.
struct Slope {
    a: Terms,
    c: Terms,
    x: Vec<f64>,
    m: Vec<f64>,
    l: Vec<f64>,
    f: f64,
    scale: f64,
}

/// The innovations of `w`, what the filter makes of `columns`, and, with slopes, their derivatives.
pub(super) fn scan(arma: &Arma, w: &[f64], columns: &[Vec<f64>], with_slopes: bool) -> Scanned {
    let rows = w.len();
    let a = terms(&arma.a);
    let slopes = if with_slopes { &arma.slopes[..] } else { &[] };
    let mut found = Scanned::new(rows, columns.len(), slopes.len());
    let mut m = arma.first_gain();
    let mut f = arma.variance;
    let mut l = m.clone();
    let mut scale = -1.0 / f;
    let mut x = vec![0.0; arma.order];
    let mut others = vec![vec![0.0; arma.order]; columns.len()];
    let mut slopes: Vec<Slope> = slopes
        .iter()
        .map(|slope| {
            let gain = arma.first_gain_slope(slope);
            Slope {
                a: terms(&slope.a),
                c: terms(&slope.c),
                x: x.clone(),
                l: gain.clone(),
                m: gain,
                f: slope.variance,
                scale: slope.variance / (f * f),
            }
        })
        .collect();
    let mut end = rows;
    for t in 0..rows {
        if t >= end {
            break;
        }
        let v = w[t] - x[0];
        let k = v / f;
        found.errors[t] = v;
        found.variances[t] = f;
        let (z, first) = (l[0], x[0]);
        // h = T L, in the place of L.
        shift(&mut l);
        subtract(&mut l, &a, z);
        let next = f + z * z * scale;
        let weight = z / next;
        for (slope, (errors, variances)) in
            slopes.iter_mut().zip(found.error_slopes.iter_mut().zip(&mut found.variance_slopes))
        {
            let v_slope = -slope.x[0];
            errors[t] = v_slope;
            variances[t] = slope.f;
            let k_slope = (v_slope - k * slope.f) / f;
            let x_first = slope.x[0];
            shift(&mut slope.x);
            subtract(&mut slope.x, &slope.a, first);
            subtract(&mut slope.x, &a, x_first);
            add(&mut slope.x, &slope.m, k);
            add(&mut slope.x, &m, k_slope);
            let z_slope = slope.l[0];
            shift(&mut slope.l);
            subtract(&mut slope.l, &slope.a, z);
            subtract(&mut slope.l, &a, z_slope);
            let f_slope = slope.f + 2.0 * z * z_slope * scale + z * z * slope.scale;
            let weight_slope = (z_slope - weight * f_slope) / next;
            let own = slope.scale * z + scale * z_slope;
            for (((m, l), h), base) in slope.m.iter_mut().zip(&mut slope.l).zip(&l).zip(&m) {
                *m += *l * scale * z + h * own;
                // M(t+1) of the process itself is M + h X z.
                *l -= *m * weight + (base + h * scale * z) * weight_slope;
            }
            slope.scale = slope.scale * next / f + scale * (f_slope - next / f * slope.f) / f;
            slope.f = f_slope;
        }
        shift(&mut x);
        subtract(&mut x, &a, first);
        add(&mut x, &m, k);
        for ((x, u), out) in others.iter_mut().zip(columns).zip(&mut found.columns) {
            let (first, own) = (x[0], u[t] - x[0]);
            out[t] = own;
            shift(x);
            subtract(x, &a, first);
            add(x, &m, own / f);
        }
        for (m, l) in m.iter_mut().zip(&mut l) {
            *m += *l * scale * z;
            *l -= *m * weight;
        }
        scale *= next / f;
        f = next;
        if end == rows && t % EVERY == 0 {
            let largest = |l: &[f64]| l.iter().fold(0.0_f64, |largest, l| largest.max(l.abs()));
            let own = slopes.iter().map(|slope| largest(&slope.l)).fold(largest(&l), f64::max);
            if scale.abs() * own * own < SETTLED {
                // Then what the state holds is that of the last m samples alone.
                end = rows.min(t + 1 + arma.order);
            }
        }
    }
    if end < rows {
        settled(arma, (w, columns), &slopes, end, &mut found);
    }
    found
}

/// The rest of the samples, from `first` on: e = A/C w.
fn settled(arma: &Arma, (w, columns): (&[f64], &[Vec<f64>]), slopes: &[Slope], first: usize, found: &mut Scanned) {
    let (a, c) = (terms(&arma.a), terms(&arma.c));
    let at = |terms: &Terms, signal: &[f64], t: usize| -> f64 {
        terms.iter().map(|(lag, value)| value * signal[t - lag]).sum()
    };
    found.variances[first..].fill(1.0);
    for t in first..w.len() {
        found.errors[t] = w[t] + at(&a, w, t) - at(&c, &found.errors, t);
    }
    for (u, out) in columns.iter().zip(&mut found.columns) {
        for t in first..w.len() {
            out[t] = u[t] + at(&a, u, t) - at(&c, out, t);
        }
    }
    for (slope, errors) in slopes.iter().zip(&mut found.error_slopes) {
        for t in first..w.len() {
            errors[t] = at(&slope.a, w, t) - at(&slope.c, &found.errors, t) - at(&c, errors, t);
        }
    }
}
