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
use super::arma::{Arma, ArmaSlopes, Terms, terms};

/// The filter stays as it is where the covariance would change by less than this, in units of var e.
const SETTLED: f64 = 1e-18;
/// After so many samples it is looked at again.
const EVERY: usize = 8;

/// The state, the gain and L, of which the first is moved up in each step: one zero more than they have entries.
struct Moving {
    x: Vec<f64>,
    m: Vec<f64>,
    l: Vec<f64>,
}

impl Moving {
    fn new(gain: &[f64]) -> Self {
        let order = gain.len();
        let mut l = gain.to_vec();
        l.push(0.0);
        Self { x: vec![0.0; order + 1], m: gain.to_vec(), l }
    }
}

/// What changes with a parameter.
struct Slope {
    a: Terms,
    c: Terms,
    own: Moving,
    f: f64,
    scale: f64,
}

/// A step of the filter: what all that it moves has in common.
struct Step<'s> {
    a: &'s Terms,
    /// v/f, the first entry of x, and z.
    k: f64,
    first: f64,
    z: f64,
    /// f of this sample and of the next, X, X z, and z/f of the next.
    f: f64,
    next: f64,
    scale: f64,
    scaled: f64,
    weight: f64,
    /// M before, M after, and T L.
    before: &'s [f64],
    after: &'s [f64],
    h: &'s [f64],
}

impl Slope {
    /// Moves on by a step. Gives dv and df of the sample.
    fn step(&mut self, step: &Step<'_>) -> (f64, f64) {
        let &Step { k, first, z, f, next, scale, scaled, weight, .. } = step;
        let Moving { x, m, l } = &mut self.own;
        let (x_first, z_slope) = (x[0], l[0]);
        let (v_slope, f_before) = (-x_first, self.f);
        let k_slope = (v_slope - k * f_before) / f;
        let f_slope = f_before + 2.0 * z * z_slope * scale + z * z * self.scale;
        let weight_slope = (z_slope - weight * f_slope) / next;
        let scaled_slope = self.scale * z + scale * z_slope;
        let order = m.len();
        let (x, l) = (&mut x[..=order], &mut l[..=order]);
        let (before, after, h) = (&step.before[..order], &step.after[..order], &step.h[..order]);
        for i in 0..order {
            let moved = l[i + 1];
            x[i] = x[i + 1] + m[i] * k + before[i] * k_slope;
            m[i] += moved * scaled + h[i] * scaled_slope;
            l[i] = moved - m[i] * weight - after[i] * weight_slope;
        }
        let mut subtract = |terms: &Terms, of_x: f64, of_l: f64| {
            for (lag, a) in terms {
                x[lag - 1] -= a * of_x;
                m[lag - 1] -= a * of_l * scaled;
                l[lag - 1] -= a * of_l * (1.0 - scaled * weight);
            }
        };
        subtract(&self.a, first, z);
        subtract(step.a, x_first, z_slope);
        self.scale = self.scale * next / f + scale * (f_slope - next / f * f_before) / f;
        self.f = f_slope;
        (v_slope, f_before)
    }

    fn new(arma: &Arma, slope: &ArmaSlopes) -> Self {
        Self {
            a: terms(&slope.a),
            c: terms(&slope.c),
            own: Moving::new(&arma.first_gain_slope(slope)),
            f: slope.variance,
            scale: slope.variance / (arma.variance * arma.variance),
        }
    }
}

/// The innovations of `w`, what the filter makes of `columns`, and, with slopes, their derivatives.
pub(super) fn scan(arma: &Arma, w: &[f64], columns: &[Vec<f64>], with_slopes: bool) -> Scanned {
    let (rows, order) = (w.len(), arma.order);
    let a = terms(&arma.a);
    let slopes = if with_slopes { &arma.slopes[..] } else { &[] };
    let mut found = Scanned::new(rows, columns.len(), slopes.len());
    let Moving { mut x, m: mut before, mut l } = Moving::new(&arma.first_gain());
    let (mut f, mut scale) = (arma.variance, -1.0 / arma.variance);
    let (mut after, mut h) = (vec![0.0; order], vec![0.0; order]);
    let mut others = vec![vec![0.0; order + 1]; columns.len()];
    let mut slopes: Vec<Slope> = slopes.iter().map(|slope| Slope::new(arma, slope)).collect();
    let mut end = rows;
    let mut t = 0;
    while t < end {
        let (z, first) = (l[0], x[0]);
        let v = w[t] - first;
        let (k, next) = (v / f, f + z * z * scale);
        (found.errors[t], found.variances[t]) = (v, f);
        let (scaled, weight) = (scale * z, z / next);
        h.copy_from_slice(&l[1..]);
        a.iter().for_each(|(lag, a)| h[lag - 1] -= a * z);
        for i in 0..order {
            after[i] = before[i] + h[i] * scaled;
            l[i] = h[i] - after[i] * weight;
            x[i] = x[i + 1] + before[i] * k;
        }
        a.iter().for_each(|(lag, a)| x[lag - 1] -= a * first);
        let step = Step {
            a: &a,
            k,
            first,
            z,
            f,
            next,
            scale,
            scaled,
            weight,
            before: &before,
            after: &after,
            h: &h,
        };
        for (place, slope) in slopes.iter_mut().enumerate() {
            let (v_slope, f_slope) = slope.step(&step);
            found.error_slopes[place][t] = v_slope;
            found.variance_slopes[place][t] = f_slope;
        }
        for ((x, u), out) in others.iter_mut().zip(columns).zip(&mut found.columns) {
            let (first, own) = (x[0], u[t] - x[0]);
            out[t] = own;
            for i in 0..order {
                x[i] = x[i + 1] + before[i] * own / f;
            }
            a.iter().for_each(|(lag, a)| x[lag - 1] -= a * first);
        }
        std::mem::swap(&mut before, &mut after);
        scale *= next / f;
        f = next;
        if end == rows && t % EVERY == 0 {
            let largest = |l: &[f64]| l.iter().fold(0.0_f64, |largest, l| largest.max(l.abs()));
            let own = slopes.iter().map(|slope| largest(&slope.own.l)).fold(largest(&l), f64::max);
            if scale.abs() * own * own < SETTLED {
                // Then what the state holds is that of the last m samples alone.
                end = rows.min(t + 1 + order);
            }
        }
        t += 1;
    }
    if end < rows {
        settled(arma, (w, columns), &slopes, end, &mut found);
    }
    found
}

/// The rest of the samples, from `first` on: e = A/C w.
fn settled(
    arma: &Arma,
    (w, columns): (&[f64], &[Vec<f64>]),
    slopes: &[Slope],
    first: usize,
    found: &mut Scanned,
) {
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
