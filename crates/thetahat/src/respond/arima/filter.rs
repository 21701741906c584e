//! The Kalman filter of a seasonal ARIMA process through missing values.
//!
//! Let w = Delta z be the differences of z and A w = C e. In the state space of [`Arma`] with A Delta in the place of A
//! z itself has the state
//!
//! ```text
//! x(t) = A * s + x_w(t),   s_j = -sum_(l >= j) delta_l z(t-1+j-l),   j = 1 … n
//! ```
//!
//! where x_w is the state of w, * is the product of series cut after their first entries, and n is the degree of Delta.
//! So after n consecutive measured values the covariance of x is that of x_w, which is stationary, and the filter goes
//! on from there on z itself: no difference has to be known (Ansley and Kohn, Annals of Statistics 13 (1985), where the
//! first values are all measured). O(m^2) for each sample while the covariance changes, O(m) after that.

use super::arma::{Arma, Terms, terms};
use crate::model::polynomial::product;

/// A covariance below this, in units of var e, is rounding.
const NOTHING: f64 = 1e-13;

/// What changes with a parameter.
#[derive(Debug, Clone)]
struct Slope {
    a: Vec<f64>,
    c: Vec<f64>,
    x: Vec<f64>,
    p: Vec<f64>,
}

/// An innovation: its value, its variance in units of var e, and their derivatives.
#[derive(Debug, Clone, Default)]
pub(super) struct Innovation {
    pub(super) value: f64,
    pub(super) variance: f64,
    pub(super) slopes: Vec<(f64, f64)>,
    /// What the filter makes of the columns.
    pub(super) columns: Vec<f64>,
}

/// The filter, where the next value is about to be known.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    order: usize,
    a: Vec<f64>,
    c: Vec<f64>,
    a_terms: Terms,
    x: Vec<f64>,
    others: Vec<Vec<f64>>,
    p: Vec<f64>,
    /// The covariance is zero.
    settled: bool,
    slopes: Vec<Slope>,
}

impl Filter {
    /// The filter after as many values as Delta has lags, of z and of columns beside it.
    pub(super) fn new(
        arma: &Arma,
        difference: &[f64],
        first: &[f64],
        columns: &[Vec<f64>],
        slopes: bool,
    ) -> Self {
        let a = product(&arma.a, difference);
        let order = a.len() - 1;
        let padded = |polynomial: &[f64]| {
            let mut padded = polynomial.to_vec();
            padded.resize(order + 1, 0.0);
            padded
        };
        let wide = |p: &[f64]| {
            let mut wide = vec![0.0; order * order];
            for (row, own) in p.chunks_exact(arma.order).enumerate() {
                wide[row * order..][..arma.order].copy_from_slice(own);
            }
            wide
        };
        let changes = |values: &[f64]| -> Vec<f64> {
            let n = difference.len() - 1;
            (1..=n).map(|j| -(j..=n).map(|l| difference[l] * values[n - 1 + j - l]).sum::<f64>()).collect()
        };
        let start = |a: &[f64], changes: &[f64]| -> Vec<f64> {
            let mut x = vec![0.0; order];
            for (j, change) in changes.iter().enumerate() {
                x[j..].iter_mut().zip(a).for_each(|(x, a)| *x += a * change);
            }
            x
        };
        let own = changes(first);
        let slope = |slope: &super::arma::ArmaSlopes| Slope {
            a: product(&slope.a, difference),
            c: padded(&slope.c),
            x: start(&slope.a, &own),
            p: wide(&arma.covariance_slope(slope)),
        };
        let slopes = if slopes { arma.slopes.iter().map(slope).collect() } else { Vec::new() };
        let mut filter = Self {
            order,
            c: padded(&arma.c),
            a_terms: terms(&a),
            x: start(&arma.a, &own),
            others: columns.iter().map(|column| start(&arma.a, &changes(column))).collect(),
            p: wide(&arma.covariance()),
            settled: false,
            slopes,
            a,
        };
        filter.settle();
        filter
    }

    /// The next value is `value`, those of the columns are `columns`.
    pub(super) fn measured(&mut self, value: f64, columns: &[f64]) -> Innovation {
        let below = self.first_column();
        let f = self.p[0] + 1.0;
        let v = value - self.x[0];
        let (k, first, top) = (v / f, self.x[0], self.p[0]);
        let gain = self.gain(&below, top);
        let mut slopes = Vec::with_capacity(self.slopes.len());
        let mut moved = std::mem::take(&mut self.slopes);
        for slope in &mut moved {
            let (v_slope, f_slope) = (-slope.x[0], slope.p[0]);
            slopes.push((v_slope, f_slope));
            let own = self.gain_slope(slope, top);
            let k_slope = (v_slope - k * f_slope) / f;
            self.propagate_slope(slope, &below, (&gain, &own, f, f_slope));
            shifted(&mut slope.x, &self.a_terms);
            for (i, x) in slope.x.iter_mut().enumerate() {
                *x += own[i] * k + gain[i] * k_slope - slope.a[i + 1] * first;
            }
        }
        self.slopes = moved;
        self.propagate(&below, Some((&gain, f)));
        let step = |x: &mut Vec<f64>, value: f64| {
            let own = value - x[0];
            shifted(x, &self.a_terms);
            x.iter_mut().zip(&gain).for_each(|(x, gain)| *x += gain * own / f);
            own
        };
        step(&mut self.x, value);
        let columns = self.others.iter_mut().zip(columns).map(|(x, value)| step(x, *value)).collect();
        self.settle();
        Innovation { value: v, variance: f, slopes, columns }
    }

    /// The next value is not known.
    pub(super) fn missing(&mut self) {
        let below = self.first_column();
        let first = self.x[0];
        let mut moved = std::mem::take(&mut self.slopes);
        for slope in &mut moved {
            self.propagate_slope(slope, &below, (&[], &[], 1.0, 0.0));
            shifted(&mut slope.x, &self.a_terms);
            slope.x.iter_mut().zip(&slope.a[1..]).for_each(|(x, a)| *x -= a * first);
        }
        self.slopes = moved;
        self.propagate(&below, None);
        shifted(&mut self.x, &self.a_terms);
        self.others.iter_mut().for_each(|x| shifted(x, &self.a_terms));
        self.settled = false;
    }

    /// P_(i+1)1, i = 1 … m.
    fn first_column(&self) -> Vec<f64> {
        column(&self.p, self.order)
    }

    /// M = T P h' + g.
    fn gain(&self, below: &[f64], top: f64) -> Vec<f64> {
        (0..self.order).map(|i| below[i] - self.a[i + 1] * (top + 1.0) + self.c[i + 1]).collect()
    }

    fn gain_slope(&self, slope: &Slope, top: f64) -> Vec<f64> {
        let below = column(&slope.p, self.order);
        let entry =
            |i: usize| below[i] - slope.a[i + 1] * (top + 1.0) - self.a[i + 1] * slope.p[0] + slope.c[i + 1];
        (0..self.order).map(entry).collect()
    }

    /// P <- T P T' + g g', less M M'/f after a measured value.
    fn propagate(&mut self, below: &[f64], update: Option<(&[f64], f64)>) {
        if self.settled && update.is_some() {
            return;
        }
        let (m, top) = (self.order, self.p[0]);
        let Self { a, c, p, .. } = self;
        for i in 0..m {
            let (ai, gi) = (a[i + 1], c[i + 1] - a[i + 1]);
            for j in 0..=i {
                let (aj, gj) = (a[j + 1], c[j + 1] - a[j + 1]);
                let inner = if i + 1 < m { p[(i + 1) * m + j + 1] } else { 0.0 };
                let mut value = inner - aj * below[i] - ai * below[j] + ai * aj * top + gi * gj;
                if let Some((gain, f)) = update {
                    value -= gain[i] * gain[j] / f;
                }
                p[i * m + j] = value;
            }
        }
        mirror(p, m);
    }

    /// The derivative of that, before P itself has moved.
    fn propagate_slope(&self, slope: &mut Slope, below: &[f64], update: (&[f64], &[f64], f64, f64)) {
        if self.settled && slope.p.iter().all(|p| *p == 0.0) && !update.0.is_empty() {
            return;
        }
        let (m, top) = (self.order, self.p[0]);
        let (a, c) = (&self.a, &self.c);
        let below_slope = column(&slope.p, m);
        let top_slope = slope.p[0];
        let (gain, gain_slope, f, f_slope) = update;
        let Slope { a: a_slope, c: c_slope, p, .. } = slope;
        for i in 0..m {
            let (ai, dai) = (a[i + 1], a_slope[i + 1]);
            let (gi, dgi) = (c[i + 1] - ai, c_slope[i + 1] - dai);
            for j in 0..=i {
                let (aj, daj) = (a[j + 1], a_slope[j + 1]);
                let (gj, dgj) = (c[j + 1] - aj, c_slope[j + 1] - daj);
                let inner = if i + 1 < m { p[(i + 1) * m + j + 1] } else { 0.0 };
                let mut value =
                    inner - daj * below[i] - aj * below_slope[i] - dai * below[j] - ai * below_slope[j]
                        + (dai * aj + ai * daj) * top
                        + ai * aj * top_slope
                        + dgi * gj
                        + gi * dgj;
                if !gain.is_empty() {
                    let own = gain[i] * gain[j] / f;
                    value -= (gain_slope[i] * gain[j] + gain[i] * gain_slope[j] - own * f_slope) / f;
                }
                p[i * m + j] = value;
            }
        }
        mirror(p, m);
    }

    /// Whether the covariance has become zero, up to rounding; and makes it that.
    fn settle(&mut self) {
        let nothing = |p: &[f64]| p.iter().all(|p| p.abs() <= NOTHING);
        if !self.settled && nothing(&self.p) && self.slopes.iter().all(|slope| nothing(&slope.p)) {
            self.p.fill(0.0);
            self.slopes.iter_mut().for_each(|slope| slope.p.fill(0.0));
            self.settled = true;
        }
    }
}

/// The first column of P below its first entry, and zero.
fn column(p: &[f64], order: usize) -> Vec<f64> {
    (1..=order).map(|i| p.get(i * order).copied().unwrap_or(0.0)).collect()
}

/// x <- T x.
fn shifted(x: &mut [f64], a: &Terms) {
    let first = x[0];
    let last = x.len() - 1;
    x.copy_within(1.., 0);
    x[last] = 0.0;
    a.iter().for_each(|(lag, a)| x[lag - 1] -= a * first);
}

/// Copies what is below the diagonal above it.
fn mirror(p: &mut [f64], order: usize) {
    for i in 0..order {
        for j in 0..i {
            p[j * order + i] = p[i * order + j];
        }
    }
}

/// What is expected of later values.
impl Filter {
    /// How the state is seen so many steps from here, h T^(k-1); and the variance of what e adds until there and with
    /// it, sum_(i<k) h_i^2 of C/(A Delta).
    pub(super) fn ahead(&self, steps: usize) -> (Vec<f64>, f64) {
        let mut seen = vec![0.0; self.order];
        seen[0] = 1.0;
        let mut variance = 1.0;
        for _ in 1..steps {
            let own: f64 = (0..self.order).map(|i| seen[i] * (self.c[i + 1] - self.a[i + 1])).sum();
            variance += own * own;
            self.look_on(&mut seen);
        }
        (seen, variance)
    }

    /// h T^k of h T^(k-1).
    fn look_on(&self, seen: &mut [f64]) {
        let first = -self.a_terms.iter().map(|(lag, a)| a * seen[lag - 1]).sum::<f64>();
        let last = seen.len() - 1;
        seen.copy_within(..last, 1);
        seen[0] = first;
    }

    /// What is expected where the state is seen so.
    pub(super) fn seen(&self, seen: &[f64]) -> f64 {
        seen.iter().zip(&self.x).map(|(seen, x)| seen * x).sum()
    }

    /// The variance that the state has there.
    pub(super) fn spread(&self, seen: &[f64]) -> f64 {
        if self.settled {
            return 0.0;
        }
        let row = |row: &[f64]| row.iter().zip(seen).map(|(p, seen)| p * seen).sum::<f64>();
        let spread =
            self.p.chunks_exact(self.order).zip(seen).map(|(own, seen)| seen * row(own)).sum::<f64>();
        spread.max(0.0)
    }

    /// The next values as they are expected, and their variances in units of var e.
    pub(super) fn forecast(&self, steps: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut seen, mut noise) = self.ahead(1);
        let (mut values, mut variances) = (Vec::with_capacity(steps), Vec::with_capacity(steps));
        for _ in 0..steps {
            values.push(self.seen(&seen));
            variances.push(noise + self.spread(&seen));
            let own: f64 = (0..self.order).map(|i| seen[i] * (self.c[i + 1] - self.a[i + 1])).sum();
            noise += own * own;
            self.look_on(&mut seen);
        }
        (values, variances)
    }
}
