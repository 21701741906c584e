//! The lagged products of all signals of a record, and the vector ARX models of all lengths that they hold.

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector};
use thetahat_numerics::optimize::normal;

use super::data::SubspaceData;

/// What is left of a variance by rounding in a Gram matrix, as a fraction of it.
pub(in crate::estimate) const ROUNDING: f64 = 1e-13;

/// y(t) = D u(t) + M_1 z(t-1) + … + M_p z(t-p) + e(t) with z = [u; y]: m inputs, l outputs, q = m + l.
///
/// The lagged products of all signals, each divided by its root mean square, are the normal equations of this
/// regression for every p. A Cholesky factor of them, with y(t) last, holds the sums of squares of all these p at once:
/// what the columns beyond those of p and the diagonal block leave of y.
#[derive(Debug)]
pub(in crate::estimate) struct LaggedProducts {
    pub(in crate::estimate) inputs: usize,
    pub(in crate::estimate) outputs: usize,
    /// The largest p.
    pub(super) past: usize,
    /// The samples that the products are sums of.
    pub(in crate::estimate) samples: usize,
    /// The products of z(t), …, z(t-p), lag by lag, over the number of samples; with a constant in the regression those
    /// of the deviations from their means.
    pub(in crate::estimate) products: DMatrix<f64>,
    /// These means, where there is a constant.
    pub(in crate::estimate) means: Option<DVector<f64>>,
    /// The root mean squares of u and y.
    pub(in crate::estimate) scales: Vec<f64>,
}

/// A Cholesky factor of some lagged signals, in which dependent ones are left out.
#[derive(Debug)]
pub(in crate::estimate) struct Factor {
    /// L, row by row.
    entries: Vec<f64>,
    size: usize,
}

impl Factor {
    /// L of the products of the signals at these places.
    pub(in crate::estimate) fn new(products: &DMatrix<f64>, places: &[usize]) -> Self {
        let size = places.len();
        let mut entries = vec![0.0; size * size];
        for (row, entries) in entries.chunks_exact_mut(size).enumerate() {
            for (entry, column) in entries.iter_mut().zip(&places[..=row]) {
                *entry = products[(places[row], *column)];
            }
        }
        normal::factor(&mut entries, size);
        Self { entries, size }
    }

    /// An entry of L, zero in the columns that are left out.
    fn entry(&self, row: usize, column: usize) -> f64 {
        let entry = self.entries[row * self.size + column];
        if entry.is_finite() { entry } else { 0.0 }
    }

    /// Some rows and columns of L.
    pub(in crate::estimate) fn block(&self, rows: Range<usize>, columns: Range<usize>) -> DMatrix<f64> {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
            let (row, column) = (rows.start + i, columns.start + j);
            if column > row { 0.0 } else { self.entry(row, column) }
        })
    }

    /// What the first `known` signals leave of those from `first` on.
    fn left(&self, first: usize, known: usize) -> DMatrix<f64> {
        let count = self.size - first;
        DMatrix::from_fn(count, count, |i, j| {
            let together = known..=first + i.min(j);
            together.map(|k| self.entry(first + i, k) * self.entry(first + j, k)).sum()
        })
    }
}

/// ln det of a covariance of signals of unit variance, as far as rounding lets it be seen.
pub(in crate::estimate) fn log_determinant(covariance: &DMatrix<f64>) -> f64 {
    let size = covariance.nrows();
    let seen = covariance + DMatrix::identity(size, size) * ROUNDING;
    Cholesky::new(seen)
        .map_or(f64::INFINITY, |factor| factor.l_dirty().diagonal().iter().map(|root| 2.0 * root.ln()).sum())
}

/// X of X L = right for a lower triangular L, zero in the columns where L is.
pub(in crate::estimate) fn divided(mut right: DMatrix<f64>, factor: &DMatrix<f64>) -> DMatrix<f64> {
    for column in (0..factor.ncols()).rev() {
        let (mut own, later) = right.columns_range_pair_mut(column, column + 1..);
        own.gemv(-1.0, &later, &factor.view_range(column + 1.., column), 1.0);
        let pivot = factor[(column, column)];
        own *= if pivot > 0.0 { pivot.recip() } else { 0.0 };
    }
    right
}

/// Products of signals that are divided by their scales.
fn rescaled(mut products: DMatrix<f64>, scales: &[f64]) -> DMatrix<f64> {
    for column in 0..products.ncols() {
        for row in 0..products.nrows() {
            products[(row, column)] /= scales[row % scales.len()] * scales[column % scales.len()];
        }
    }
    products
}

impl LaggedProducts {
    /// None where a signal is zero at all of these samples, or its squares leave the range of numbers.
    pub(in crate::estimate) fn new(data: &impl SubspaceData, past: usize, constant: bool) -> Option<Self> {
        Self::scaled(data.channels(), past, data.samples(past), data.mean_products(past, constant))
    }

    /// The same of the mean products of so many inputs and outputs, and their means where these were taken off.
    pub(in crate::estimate) fn scaled(
        (inputs, outputs): (usize, usize),
        past: usize,
        samples: usize,
        (products, means): (DMatrix<f64>, Option<DVector<f64>>),
    ) -> Option<Self> {
        let scales: Vec<f64> =
            (0..inputs + outputs).map(|signal| products[(signal, signal)].sqrt()).collect();
        if !scales.iter().all(|scale| thetahat_numerics::regression::SAFE_NORMS.contains(scale)) {
            return None;
        }
        let products = rescaled(products, &scales);
        let means = means.map(|mut means| {
            means.iter_mut().zip(scales.iter().cycle()).for_each(|(mean, scale)| *mean /= scale);
            means
        });
        Some(Self { inputs, outputs, past, samples, products, means, scales })
    }

    /// The products of more lags of the same data, with the same scales.
    pub(super) fn longer(&self, data: &impl SubspaceData, longest: usize) -> DMatrix<f64> {
        rescaled(data.mean_products(longest, self.means.is_some()).0, &self.scales)
    }

    pub(in crate::estimate) fn width(&self) -> usize {
        self.inputs + self.outputs
    }

    /// The places of z(t-1), …, z(t-p).
    pub(super) fn lags(&self, past: usize) -> Range<usize> {
        self.width()..self.width() * (past + 1)
    }

    /// The places of u(t), and of y(t).
    fn now(&self) -> (Range<usize>, Range<usize>) {
        (0..self.inputs, self.inputs..self.width())
    }

    /// The p of the least AIC = N ln det cov e + 2 k, with k parameters (Akaike 1974). O((q p)^3).
    pub(super) fn akaike(&self, feedthrough: bool) -> usize {
        let (u, y) = self.now();
        let direct = if feedthrough { self.inputs } else { 0 };
        let places: Vec<usize> = u.take(direct).chain(self.lags(self.past)).chain(y).collect();
        let factor = Factor::new(&self.products, &places);
        let first = places.len() - self.outputs;
        let criterion = |past: usize| {
            let known = direct + self.width() * past;
            let parameters = known * self.outputs;
            self.samples as f64 * log_determinant(&factor.left(first, known)) + 2.0 * parameters as f64
        };
        let all = (1..=self.past).map(|past| (past, criterion(past)));
        all.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(1, |(past, _)| past)
    }

    /// Whether u(t) is worth its m l parameters of y(t) by MDL, and past outputs say nothing of u(t): where they do,
    /// the inputs are fed back, and u(t) may tell of y(t) because it depends on it.
    pub(super) fn has_feedthrough(&self) -> bool {
        let (u, y) = self.now();
        let before = self.lags(self.past).len();
        let places: Vec<usize> = self.lags(self.past).chain(u.clone()).chain(y).collect();
        let factor = Factor::new(&self.products, &places);
        let first = places.len() - self.outputs;
        let fall = log_determinant(&factor.left(first, before))
            - log_determinant(&factor.left(first, before + self.inputs));
        self.is_worth(fall, self.inputs * self.outputs) && !self.is_fed_back()
    }

    /// Whether a fall of ln det is worth so many parameters by MDL (Rissanen 1978).
    fn is_worth(&self, fall: f64, parameters: usize) -> bool {
        let samples = self.samples as f64;
        samples * fall > parameters as f64 * samples.ln()
    }

    /// Whether past outputs tell of the inputs what past inputs do not (Granger, Econometrica 37, 1969), with any
    /// number of lags.
    fn is_fed_back(&self) -> bool {
        let is_input = |place: &usize| place % self.width() < self.inputs;
        (1..=self.past).any(|past| {
            let (own, others): (Vec<usize>, Vec<usize>) = self.lags(past).partition(is_input);
            let (u, _) = self.now();
            let places: Vec<usize> = own.iter().chain(&others).copied().chain(u).collect();
            let factor = Factor::new(&self.products, &places);
            let (known, first) = (own.len(), own.len() + others.len());
            let fall =
                log_determinant(&factor.left(first, known)) - log_determinant(&factor.left(first, first));
            self.is_worth(fall, self.inputs * others.len())
        })
    }

    /// M_1 … M_p side by side, l x q p, and the covariance of e.
    pub(super) fn coefficients(&self, feedthrough: bool) -> (DMatrix<f64>, DMatrix<f64>) {
        let (u, y) = self.now();
        let direct = if feedthrough { self.inputs } else { 0 };
        let places: Vec<usize> = u.take(direct).chain(self.lags(self.past)).chain(y).collect();
        let factor = Factor::new(&self.products, &places);
        let known = places.len() - self.outputs;
        let seen = factor.block(known..places.len(), 0..known);
        let solved = divided(seen, &factor.block(0..known, 0..known));
        (solved.columns(direct, known - direct).into_owned(), factor.left(known, known))
    }

    /// L of the products of z(t-1), …, z(t-p) = L L', with zeros in the columns of what depends on others.
    pub(super) fn past_factor(&self) -> DMatrix<f64> {
        let places: Vec<usize> = self.lags(self.past).collect();
        Factor::new(&self.products, &places).block(0..places.len(), 0..places.len())
    }
}
