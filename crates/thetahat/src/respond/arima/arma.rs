//! A stationary process A(q) w(t) = C(q) e(t), var e = 1, in state space, with its covariances.
//!
//! ```text
//! x_i(t+1) = x_(i+1)(t) - a_i w(t) + c_i e(t),   w(t) = x_1(t) + e(t),   i = 1 … m,  m = max(na, nc)
//! ```
//!
//! so that x(t+1) = T x + g e with g = c - a and T the companion matrix of A (Ljung, System Identification, 2nd ed.
//! 1999, section 4.3). What a filter begins with is the stationary covariance P of x. With the autocovariances r of w
//! and the impulse response h of C/A, its first column is
//!
//! ```text
//! P_i1 = sum_(j >= i) (-a_j r(j+1-i) + c_j h(j+1-i)),   r(k) = sum_(i,j) c_i c_j rho(k+i-j)
//! ```
//!
//! where rho are the autocovariances of 1/A e: of the step-down recursion rho(0) = prod 1/(1 - k_n^2), and with the
//! predictors a^(n) of each lower order rho(n) = -sum_j a_j^(n) rho(n-j) (Kay, Modern Spectral Estimation, 1988,
//! section 6.3). Their derivatives follow from the autocovariances of 1/A^2 e, since d(1/A) = -dA/A^2.

use crate::model::Expanded;
use crate::model::polynomial::product as multiplied;

/// Lags of a polynomial with their coefficients, where these are not zero, without the leading 1.
pub(super) type Terms = Vec<(usize, f64)>;

/// A stationary process, and its derivatives by the parameters of its polynomials.
#[derive(Debug, Clone)]
pub(super) struct Arma {
    /// m, at least 1.
    pub(super) order: usize,
    pub(super) a: Vec<f64>,
    pub(super) c: Vec<f64>,
    /// r(0).
    pub(super) variance: f64,
    /// P_i1.
    pub(super) column: Vec<f64>,
    pub(super) slopes: Vec<ArmaSlopes>,
}

/// The derivatives by a parameter.
#[derive(Debug, Clone)]
pub(super) struct ArmaSlopes {
    pub(super) a: Vec<f64>,
    pub(super) c: Vec<f64>,
    pub(super) variance: f64,
    pub(super) column: Vec<f64>,
}

/// The terms of a polynomial.
pub(super) fn terms(polynomial: &[f64]) -> Terms {
    polynomial.iter().copied().enumerate().skip(1).filter(|(_, value)| *value != 0.0).collect()
}

fn padded(polynomial: &[f64], order: usize) -> Vec<f64> {
    let mut padded = polynomial.to_vec();
    padded.resize(order + 1, 0.0);
    padded
}

/// The terms with the leading 1.
fn with_one(monic: &[f64]) -> Terms {
    std::iter::once((0, 1.0)).chain(terms(monic)).collect()
}

impl Arma {
    /// None if the process is not stationary. O(m^2).
    pub(super) fn new(expanded: &Expanded) -> Option<Self> {
        let order = (expanded.a.len().max(expanded.c.len()) - 1).max(1);
        let (a, c) = (padded(&expanded.a, order), padded(&expanded.c, order));
        let rho = autocovariances(&expanded.a, 2 * order)?;
        let (a_terms, c_terms) = (terms(&a), with_one(&c));
        let products = lagged(&c_terms, &c_terms, order);
        let r = summed(&products, &rho, order);
        let h = impulse_response(&a_terms, &c);
        let column = first_column((&a, &c), (&r, &h));
        let crossed = match expanded.slopes.iter().any(|(a, _)| a.iter().any(|value| *value != 0.0)) {
            true => crossed(&expanded.a, order)?,
            false => Vec::new(),
        };
        let slope = |(a_slope, c_slope): &(Vec<f64>, Vec<f64>)| {
            let (a_slope, c_slope) = (padded(a_slope, order), padded(c_slope, order));
            let (own, mut h_slope) = (terms(&a_slope), c_slope.clone());
            let mixed = lagged(&terms(&c_slope), &c_terms, order);
            let mixed: Vec<f64> = mixed.iter().zip(mixed.iter().rev()).map(|(one, two)| one + two).collect();
            let mut r_slope = summed(&mixed, &rho, order);
            if !own.is_empty() {
                let middle = 3 * order;
                let of = |k: usize| -> f64 {
                    own.iter().map(|(i, a)| a * (crossed[middle + k - i] + crossed[middle - k - i])).sum()
                };
                let rho_slope: Vec<f64> = (0..=2 * order).map(|k| -of(k)).collect();
                let more = summed(&products, &rho_slope, order);
                r_slope.iter_mut().zip(more).for_each(|(slope, more)| *slope += more);
                for (lag, a) in &own {
                    h_slope[*lag..].iter_mut().zip(&h).for_each(|(slope, h)| *slope -= a * h);
                }
            }
            let h_slope = impulse_response(&a_terms, &h_slope);
            let one = first_column((&a_slope, &c_slope), (&r, &h));
            let two = first_column((&a, &c), (&r_slope, &h_slope));
            let column = one.iter().zip(&two).map(|(one, two)| one + two).collect();
            ArmaSlopes { variance: r_slope[0], a: a_slope, c: c_slope, column }
        };
        let slopes = expanded.slopes.iter().map(slope).collect();
        let found = Self { order, variance: r[0], column, slopes, a, c };
        (found.variance.is_finite() && found.column.iter().all(|value| value.is_finite())).then_some(found)
    }

    /// M = T P Z' + g, and its derivative by a parameter: what a filter of the first sample has for a gain, times r(0).
    pub(super) fn first_gain(&self) -> Vec<f64> {
        self.gain(self.variance, &self.column, (&self.a, &self.c))
    }

    pub(super) fn first_gain_slope(&self, slope: &ArmaSlopes) -> Vec<f64> {
        let mut gain = self.gain(slope.variance, &slope.column, (&self.a, &slope.c));
        gain.iter_mut().zip(&slope.a[1..]).for_each(|(gain, a)| *gain -= a * self.variance);
        gain
    }

    /// P_(i+1)1 - a_i r(0) + c_i.
    fn gain(&self, variance: f64, column: &[f64], (a, c): (&[f64], &[f64])) -> Vec<f64> {
        let below = column.iter().skip(1).chain([&0.0]);
        below.zip(a[1..].iter().zip(&c[1..])).map(|(below, (a, c))| below - a * variance + c).collect()
    }

    /// P, row by row, of P = T P T' + g g': along its diagonals from the last row on.
    pub(super) fn covariance(&self) -> Vec<f64> {
        let m = self.order;
        let mut p = vec![0.0; m * m];
        let at = |p: &[f64], i: usize, j: usize| if i < m && j < m { p[i * m + j] } else { 0.0 };
        let below = |i: usize| self.column.get(i + 1).copied().unwrap_or(0.0);
        for i in (0..m).rev() {
            for j in (0..=i).rev() {
                let (ai, aj, ci, cj) = (self.a[i + 1], self.a[j + 1], self.c[i + 1], self.c[j + 1]);
                let value =
                    at(&p, i + 1, j + 1) - aj * below(i) - ai * below(j) + ai * aj * self.variance + ci * cj
                        - ai * cj
                        - aj * ci;
                (p[i * m + j], p[j * m + i]) = (value, value);
            }
        }
        p
    }

    /// The derivative of P.
    pub(super) fn covariance_slope(&self, slope: &ArmaSlopes) -> Vec<f64> {
        let m = self.order;
        let mut p = vec![0.0; m * m];
        let at = |p: &[f64], i: usize, j: usize| if i < m && j < m { p[i * m + j] } else { 0.0 };
        let below = |column: &[f64], i: usize| column.get(i + 1).copied().unwrap_or(0.0);
        for i in (0..m).rev() {
            for j in (0..=i).rev() {
                // Each product (-a_j below_i), and so on, has two factors that change.
                let part = |i: usize, j: usize| {
                    let (a, da) = (self.a[j + 1], slope.a[j + 1]);
                    let (other, c, dc) = (self.a[i + 1], self.c[i + 1], slope.c[i + 1]);
                    -da * below(&self.column, i) - a * below(&slope.column, i) + da * other * self.variance
                        - da * c
                        - a * dc
                        + dc * self.c[j + 1]
                };
                let value = at(&p, i + 1, j + 1)
                    + part(i, j)
                    + part(j, i)
                    + self.a[i + 1] * self.a[j + 1] * slope.variance;
                (p[i * m + j], p[j * m + i]) = (value, value);
            }
        }
        p
    }
}

/// rho(0 … lags) of 1/A e; none if A is not stable.
fn autocovariances(a: &[f64], lags: usize) -> Option<Vec<f64>> {
    let end = a.iter().rposition(|value| *value != 0.0).unwrap_or(0);
    let a = &a[..=end];
    let mut rho = Vec::with_capacity(lags + 1);
    let mut first = 1.0;
    // The predictor of each order, the highest first.
    let mut levels: Vec<Vec<f64>> = vec![a[1..].to_vec()];
    while let Some(level) = levels.last() {
        let Some((reflection, lower)) = level.split_last() else { break };
        let rest = 1.0 - reflection * reflection;
        if rest.is_nan() || rest <= 0.0 {
            return None;
        }
        first /= rest;
        let step = lower.iter().zip(lower.iter().rev()).map(|(one, other)| (one - reflection * other) / rest);
        let next = step.collect();
        levels.push(next);
    }
    rho.push(first);
    let own = terms(a);
    for n in 1..=lags {
        let value: f64 = match levels.len().checked_sub(n + 1) {
            Some(place) => levels[place].iter().zip(rho.iter().rev()).map(|(a, rho)| a * rho).sum(),
            None => own.iter().map(|(lag, a)| a * rho[n - lag]).sum(),
        };
        rho.push(-value);
    }
    Some(rho)
}

/// E[u(t) v(t-n)] of u = 1/A^2 e and v = 1/A e, n = -3 m … 2 m: sum_j a_j E[u(t) u(t-n-j)].
fn crossed(a: &[f64], order: usize) -> Option<Vec<f64>> {
    let square = autocovariances(&multiplied(a, a), 4 * order)?;
    let terms = with_one(a);
    let of = |place: usize| terms.iter().map(|(j, a)| a * square[(place + j).abs_diff(3 * order)]).sum();
    Some((0..=5 * order).map(of).collect())
}

/// sum_j left_(j+l) right_j, l = -m … m.
fn lagged(left: &Terms, right: &Terms, order: usize) -> Vec<f64> {
    let mut products = vec![0.0; 2 * order + 1];
    for (i, left) in left {
        for (j, right) in right {
            products[order + i - j] += left * right;
        }
    }
    products
}

/// r(k) = sum_l products(l) rho(k-l), k = 0 … m.
fn summed(products: &[f64], rho: &[f64], order: usize) -> Vec<f64> {
    let mut r = vec![0.0; order + 1];
    for (place, product) in products.iter().enumerate().filter(|(_, product)| **product != 0.0) {
        for (k, r) in r.iter_mut().enumerate() {
            *r += product * rho[(k + order).abs_diff(place)];
        }
    }
    r
}

/// The series C/A as far as C is given.
fn impulse_response(a: &Terms, c: &[f64]) -> Vec<f64> {
    let mut h = c.to_vec();
    for t in 0..h.len() {
        h[t] -= a.iter().take_while(|(lag, _)| *lag <= t).map(|(lag, a)| a * h[t - lag]).sum::<f64>();
    }
    h
}

/// sum_(j >= i) (-a_j r(j+1-i) + c_j h(j+1-i)), i = 1 … m.
fn first_column((a, c): (&[f64], &[f64]), (r, h): (&[f64], &[f64])) -> Vec<f64> {
    let order = a.len() - 1;
    let mut column = vec![0.0; order];
    for (j, a) in terms(a) {
        (1..=j).for_each(|i| column[i - 1] -= a * r[j + 1 - i]);
    }
    for (j, c) in terms(c) {
        (1..=j).for_each(|i| column[i - 1] += c * h[j + 1 - i]);
    }
    column
}
