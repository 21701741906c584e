//! What is not known of a state because outputs are missing.
//!
//! While all outputs are measured the state is known from them, and the gain of the predictor is K. Where only the
//! outputs O are measured, or none, the error of the predicted state has a covariance P, and the best prediction is
//! that of the time-varying Kalman filter of the innovations form: with e ~ (0, R)
//!
//! ```text
//! S  = H_O P H_O' + R_OO,   L = (F P H_O' + K R_O) S^-1         R_O: the columns of R of the outputs O
//! x+ = F x + G u + L (y_O - H_O x - D_O u)
//! P+ = F P F' + K R K' - L S L'
//! ```
//!
//! (Anderson and Moore, Optimal Filtering, 1979, sections 5.5 and 9.3). With W = K R_O R_OO^-1, the gain where P = 0,
//! it is computed as
//!
//! ```text
//! A = F - W H_O,   C = A P H_O' S^-1,   L = W + C
//! P+ = (A - C H_O) P (A - C H_O)' + C R_OO C' + (K - W E_O) R (K - W E_O)'      E_O: picks e_O of e
//! ```
//!
//! which is the same without a difference: P stays symmetric and nonnegative, and where all outputs are measured (W =
//! K) it decays to nothing rather than to rounding. Outputs of which nothing but rounding is left beside others, as
//! where R is singular, have no gain of their own.

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::normal;

use crate::model::StateSpace;

/// A state is known where what is not known of it adds less than this to the outputs of the next n rows, in units of
/// their noise variances, summed over outputs and rows: innovations then differ by less than their twelfth digit.
const KNOWN: f64 = 1e-12;
/// A state is lost where it adds more than this: what follows is better predicted from a state that is estimated anew,
/// and rounding of P would be seen beside R.
const LOST: f64 = 1e12;

/// P along the rows of a log, and what the gain of a row is.
#[derive(Debug, Clone)]
pub(super) struct StateCovariance {
    f: DMatrix<f64>,
    h: DMatrix<f64>,
    k: DMatrix<f64>,
    noise: DMatrix<f64>,
    /// sum_(j<n) (H A^j)' V^-1 H A^j with A = F - K H, V the variances of the outputs' noises: what states do to the
    /// next n rows of outputs.
    weights: DMatrix<f64>,
    /// Of the outputs that were measured in the last row that needed it.
    pattern: Pattern,
    /// P in the row that was taken last, and in the next.
    before: DMatrix<f64>,
    after: DMatrix<f64>,
    /// Whether P is zero in the next row.
    is_zero: bool,
    /// Whether the row that was taken last has a gain of its own.
    varies: bool,
    /// L - K in that row, zero in the place of L for outputs that are missing.
    change: DMatrix<f64>,
    /// F - L H in that row.
    between: DMatrix<f64>,
}

/// What rows have in common in which the same outputs are measured.
#[derive(Debug, Clone)]
struct Pattern {
    measured: Vec<bool>,
    /// H_O.
    seen: DMatrix<f64>,
    /// R_OO.
    noise: DMatrix<f64>,
    /// W - K, zero in the place of W for outputs that are missing.
    change: DMatrix<f64>,
    /// F - W H_O.
    between: DMatrix<f64>,
    /// (K - W E_O) R (K - W E_O)'.
    driven: DMatrix<f64>,
}

impl Pattern {
    fn new(
        measured: Vec<bool>,
        f: &DMatrix<f64>,
        h: &DMatrix<f64>,
        k: &DMatrix<f64>,
        r: &DMatrix<f64>,
    ) -> Self {
        let places: Vec<usize> = (0..measured.len()).filter(|place| measured[*place]).collect();
        let seen = h.select_rows(&places);
        let columns = r.select_columns(&places);
        let noise = columns.select_rows(&places);
        // Exactly K where all are measured.
        let mut change = DMatrix::zeros(k.nrows(), k.ncols());
        if places.len() < measured.len() {
            let gain = divided(k * columns, &noise);
            change -= k;
            for (column, place) in places.iter().enumerate() {
                let mut own = change.column_mut(*place);
                own += gain.column(column);
            }
        }
        let between = f - (k + &change) * h;
        let driven = &change * r * change.transpose();
        Self { measured, seen, noise, change, between, driven }
    }
}

impl StateCovariance {
    pub(super) fn new(model: &StateSpace) -> Self {
        let StateSpace { f, h, k, noise_covariance: noise, .. } = model;
        let (n, outputs) = k.shape();
        let pattern = Pattern::new(vec![true; outputs], f, h, k, noise);
        // An output without noise of its own is compared with what the noise of others does to it.
        let mut variances = noise.diagonal();
        let mut does = k.clone();
        for _ in 0..n {
            let reaches = h * &does;
            let through = &reaches * noise * reaches.transpose();
            for (output, variance) in
                variances.iter_mut().enumerate().filter(|(output, _)| noise[(*output, *output)] <= 0.0)
            {
                *variance += through[(output, output)];
            }
            does = f * does;
        }
        let mut weights = DMatrix::zeros(n, n);
        let mut sees = h.clone();
        for _ in 0..n {
            for (row, variance) in
                sees.row_iter().zip(variances.iter()).filter(|(_, variance)| **variance > 0.0)
            {
                weights.ger(variance.recip(), &row.transpose(), &row.transpose(), 1.0);
            }
            sees = &sees * &pattern.between;
        }
        let nothing = DMatrix::zeros(n, n);
        Self {
            f: f.clone(),
            h: h.clone(),
            k: k.clone(),
            noise: noise.clone(),
            weights,
            before: nothing.clone(),
            after: nothing,
            is_zero: true,
            varies: false,
            change: DMatrix::zeros(n, outputs),
            between: pattern.between.clone(),
            pattern,
        }
    }

    /// The next row has a state that is known.
    pub(super) fn reset(&mut self) {
        if !self.is_zero {
            self.after.fill(0.0);
            self.is_zero = true;
        }
        self.varies = false;
    }

    /// Goes over a row with these outputs, of which some may be missing. Whether it has a gain of its own: where all
    /// are measured and the state is known the gain is K, and nothing is computed. O(n^2 (n + l)) where it has one.
    pub(super) fn step(&mut self, outputs: &[&[f64]], row: usize) -> bool {
        let is_measured = |output: &&[f64]| !output[row].is_nan();
        let complete = outputs.iter().all(is_measured);
        self.varies = !(complete && self.is_zero);
        if !self.varies {
            return false;
        }
        if !outputs.iter().map(is_measured).eq(self.pattern.measured.iter().copied()) {
            let measured = outputs.iter().map(is_measured).collect();
            self.pattern = Pattern::new(measured, &self.f, &self.h, &self.k, &self.noise);
        }
        std::mem::swap(&mut self.before, &mut self.after);
        let Pattern { measured, seen, noise, change, between, driven } = &self.pattern;
        self.change.copy_from(change);
        self.between.copy_from(between);
        self.after.copy_from(driven);
        if self.is_zero {
            self.before.fill(0.0);
        } else {
            let carried = &self.before * seen.transpose();
            let gain = divided(between * &carried, &(seen * carried + noise));
            let places = (0..measured.len()).filter(|place| measured[*place]);
            for (column, place) in places.enumerate() {
                let mut own = self.change.column_mut(place);
                own += gain.column(column);
            }
            self.between.gemm(-1.0, &gain, seen, 1.0);
            let moved = &self.between * &self.before;
            self.after.gemm(1.0, &moved, &self.between.transpose(), 1.0);
            let noisy = &gain * noise;
            self.after.gemm(1.0, &noisy, &gain.transpose(), 1.0);
            if complete && self.weights.dot(&self.after) <= KNOWN {
                self.after.fill(0.0);
            }
        }
        self.after.fill_lower_triangle_with_upper_triangle();
        self.is_zero = self.after.iter().all(|entry| *entry == 0.0);
        true
    }

    /// Whether too little is known of the state of the next row, or P left the range of numbers.
    pub(super) fn is_lost(&self) -> bool {
        // Where it is not a number too.
        let is_few = self.weights.dot(&self.after) <= LOST;
        !(self.is_zero || is_few && self.after.iter().all(|entry| entry.is_finite()))
    }

    /// Whether the row that was taken last has a gain of its own.
    pub(super) fn varies(&self) -> bool {
        self.varies
    }

    /// L - K in that row.
    pub(super) fn change(&self) -> &DMatrix<f64> {
        &self.change
    }

    /// F - L H in that row.
    pub(super) fn between(&self) -> &DMatrix<f64> {
        &self.between
    }

    /// The variance of the innovation of an output in that row: that of H P H' + R.
    pub(super) fn variance(&self, output: usize) -> f64 {
        added(&self.h, &self.before, output) + self.noise[(output, output)]
    }

    /// P in the next row; none where it is zero.
    pub(super) fn next(&self) -> Option<&DMatrix<f64>> {
        (!self.is_zero).then_some(&self.after)
    }
}

/// What an uncertain state adds to the variance of an output: the diagonal entry of H P H'.
pub(super) fn added(seen: &DMatrix<f64>, covariance: &DMatrix<f64>, output: usize) -> f64 {
    let own = seen.row(output);
    let each = covariance.column_iter().zip(own.iter());
    each.map(|(column, weight)| weight * own.iter().zip(column.iter()).map(|(a, b)| a * b).sum::<f64>())
        .sum::<f64>()
        .max(0.0)
}

/// X S^-1 for a symmetric S of which columns may depend on those before them: these have zeros.
fn divided(left: DMatrix<f64>, symmetric: &DMatrix<f64>) -> DMatrix<f64> {
    let size = symmetric.nrows();
    let mut factor = symmetric.as_slice().to_vec();
    normal::factor(&mut factor, size);
    let mut columns = left.transpose();
    for mut column in columns.column_iter_mut() {
        normal::solve(&factor, size, column.as_mut_slice());
    }
    columns.transpose()
}
