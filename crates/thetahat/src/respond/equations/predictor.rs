//! The extended Kalman filter as a predictor, in any kind of number.
//!
//! With P = U D U' (U unit upper triangular, D diagonal), a step and a scalar element y = h(x) + v of a measurement:
//!
//! ```text
//! x <- f(x),   P <- F P F' + Q                              F = df/dx at the filtered state
//! e = y - h(x),   S = H P H' + r,   x <- x + P H' e/S,   P <- P - P H' H P/S     H = dh/dx at the predicted state
//! ```
//!
//! Elements of one measurement are used one after the other, all linearised about the predicted state, so that those
//! after the first are corrected for what it moved: e_j = y_j - h_j(x^) - H_j (x - x^). In dual numbers the same
//! operations give de/dz and dS/dz, exact but for rounding.
//!
//! Time update: Thornton's modified weighted Gram-Schmidt on [F U | U_q] with the weights (D, D_q), Q = U_q D_q U_q'.
//! Measurement update: Bierman's. Both keep D from going negative (Bierman, Factorization Methods for Discrete
//! Sequential Estimation, 1977, chapters V and VI).
//!
//! thetahat-core updates the same factors by other arithmetic, made for plain numbers on small processors: reciprocals
//! for divisions, four rows of U at a time, a threshold below which variances count as zero, and F P F' + Q factored
//! anew where nothing cancels. Here derivatives take most of the time, and a branch on a threshold would be one more
//! place where V is not smooth. The test `value_is_the_likelihood_of_the_filter` holds both to the same likelihood.

use thetahat_core::Number;

use super::settled::Settling;
use crate::model::{
    GreyBox,
    equations::{Drive, Work},
};

/// A variance that counts as none: without process noise, that of a state which forgets its start goes down until its
/// square, by which derivatives are divided, is no number above 0 any more.
const NEGLIGIBLE: f64 = 1e-140;

/// The estimate of the state and its covariance, and the workspace of a step. Matrices are column after column.
#[derive(Debug, Clone)]
pub(crate) struct Predictor<S> {
    /// x^.
    pub(crate) state: Vec<S>,
    /// D on the diagonal, U above it; zero below.
    factor: Vec<S>,
    /// x^ where the measurement was linearised.
    origin: Vec<S>,
    /// h(x^).
    pub(crate) output: Vec<S>,
    /// H, m x n.
    output_matrix: Vec<S>,
    next: Vec<S>,
    /// F, n x n.
    state_matrix: Vec<S>,
    /// The process noise of the step, U_q and its variances, and the variance of the noise of each output.
    process_factor: Vec<S>,
    process: Vec<S>,
    measurement: Vec<S>,
    /// The rows of [F U | U_q], one after the other, and the weights of their columns.
    rows: Vec<S>,
    weights: Vec<S>,
    /// U'h.
    projected: Vec<S>,
    /// P h and S of each element, about what those before it have left.
    gains: Vec<S>,
    variances: Vec<S>,
    settling: Settling<S>,
    /// Whether the covariance stays as it is: then gains and S are those of the last row.
    is_held: bool,
    work: Work<S>,
}

/// e and S of one element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Innovation<S> {
    pub(crate) error: S,
    pub(crate) variance: S,
    /// The part of S that is noise of the measurement.
    pub(crate) noise: S,
}

impl<S: Number<f64>> Predictor<S> {
    pub(crate) fn new(model: &GreyBox) -> Self {
        let (n, m) = (model.states().len(), model.outputs().len());
        let zeros = |count: usize| vec![S::from(0.0); count];
        Self {
            state: zeros(n),
            factor: zeros(n * n),
            origin: zeros(n),
            output: zeros(m),
            output_matrix: zeros(m * n),
            next: zeros(n),
            state_matrix: zeros(n * n),
            process_factor: zeros(n * n),
            process: zeros(n),
            measurement: zeros(m),
            rows: zeros(2 * n * n),
            weights: zeros(2 * n),
            projected: zeros(n),
            gains: zeros(m * n),
            variances: zeros(m),
            settling: Settling::new(model.has_constant_covariances(), model.keeps_certainty(), n * n),
            is_held: false,
            work: Work::new(),
        }
    }

    /// Goes to the start of a log: x0, and P diagonal.
    pub(crate) fn restart(&mut self, model: &GreyBox, z: &[S]) {
        let n = self.state.len();
        self.settling.restart();
        self.is_held = false;
        model.start(z, &mut self.state, &mut self.process, &mut self.work);
        self.factor.fill(S::from(0.0));
        self.factor.iter_mut().step_by(n + 1).zip(&self.process).for_each(|(own, &variance)| *own = variance);
    }

    /// Takes over the estimate of another.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.state.copy_from_slice(&other.state);
        self.factor.copy_from_slice(&other.factor);
    }

    /// Begins a row. Where the covariance has settled in rows like this one, the state alone goes on, until the row
    /// [ends](Self::end). n (n + 2 m) multiply-adds instead of the others.
    pub(crate) fn begin(&mut self, is_alike: impl Fn(usize) -> bool) {
        self.is_held = self.settling.holds(is_alike);
    }

    /// Ends a row in which everything that was measured is taken.
    pub(crate) fn end(&mut self, row: usize, is_alike: impl Fn(usize) -> bool) {
        if !std::mem::take(&mut self.is_held) {
            self.settling.note(row, &self.factor, is_alike);
        }
    }

    /// Whether the covariance is at its limit.
    #[cfg(test)]
    pub(super) fn has_settled(&self) -> bool {
        self.settling.is_there
    }

    /// H P H' + r of one output about the predicted state: the variance of what is measured of it. n^2 multiply-adds.
    pub(crate) fn variance(&self, output: usize) -> S {
        let (n, m) = (self.state.len(), self.output.len());
        let mut variance = self.measurement[output];
        for column in 0..n {
            let known = (0..column)
                .map(|k| self.factor[column * n + k] * self.output_matrix[k * m + output])
                .fold(self.output_matrix[column * m + output], |sum, product| sum + product);
            variance += known * self.factor[column * n + column] * known;
        }
        variance
    }

    /// Over a step of `dt` seconds from the time `t`, with the input held. About 4 n^3 multiply-adds beside the model.
    pub(crate) fn predict(&mut self, model: &GreyBox, z: &[S], u: Drive<'_>, t: f64, dt: f64) {
        if !self.is_held {
            let (factor, variances) = (&mut self.process_factor, &mut self.process);
            model.process_noise(&self.state, z, u, t, dt, factor, variances, &mut self.work);
        }
        model.advance(&self.state, z, u, t, dt, &mut self.next, &mut self.state_matrix, &mut self.work);
        std::mem::swap(&mut self.state, &mut self.next);
        if !self.is_held {
            self.spread();
        }
    }

    /// P <- F P F' + Q.
    fn spread(&mut self) {
        self.settling.is_there = false;
        let n = self.state.len();
        let zero = S::from(0.0);
        let width = 2 * n;
        for row in 0..n {
            for column in 0..n {
                let known = (0..column)
                    .map(|k| self.state_matrix[k * n + row] * self.factor[column * n + k])
                    .fold(self.state_matrix[column * n + row], |sum, product| sum + product);
                self.rows[row * width + column] = known;
            }
            self.rows[row * width + n..(row + 1) * width].fill(zero);
            self.weights[row] = self.factor[row * n + row];
        }
        // One column for each direction that noise enters.
        let mut columns = n;
        for (index, &variance) in self.process.iter().enumerate() {
            if variance.value() > 0.0 {
                for row in 0..=index {
                    self.rows[row * width + columns] = self.process_factor[index * n + row];
                }
                self.weights[columns] = variance;
                columns += 1;
            }
        }
        for index in (0..n).rev() {
            let (before, own) = self.rows.split_at_mut(index * width);
            let own = &own[..columns];
            let weighted = |other: &[S], weights: &[S]| {
                let products = other.iter().zip(own).zip(weights);
                products.fold(zero, |sum, ((&other, &own), &weight)| sum + other * own * weight)
            };
            let pivot = weighted(own, &self.weights);
            self.factor[index * n + index] = if pivot.value() > NEGLIGIBLE { pivot } else { zero };
            for row in 0..index {
                let other = &mut before[row * width..][..columns];
                // Where nothing is uncertain, the column does not matter.
                let entry =
                    if pivot.value() > NEGLIGIBLE { weighted(other, &self.weights) / pivot } else { zero };
                self.factor[index * n + row] = entry;
                other.iter_mut().zip(own).for_each(|(other, &own)| *other -= entry * own);
            }
        }
    }

    /// Linearises the measurement about the predicted state.
    pub(crate) fn observe(&mut self, model: &GreyBox, z: &[S], u: Drive<'_>, t: f64) {
        model.observe(&self.state, z, u, t, &mut self.output, &mut self.output_matrix, &mut self.work);
        if !self.is_held {
            model.measurement_variances(&self.state, z, u, t, &mut self.measurement, &mut self.work);
        }
        self.origin.copy_from_slice(&self.state);
    }

    /// Takes element `index` of the measurement. Gives its innovation; none where S is not positive or a number not
    /// finite: then the filter is of no more use. 2 n^2 multiply-adds.
    pub(crate) fn absorb(&mut self, index: usize, measured: f64) -> Option<Innovation<S>> {
        let (n, m) = (self.state.len(), self.output.len());
        let mut error = -(self.output[index] - measured);
        for column in 0..n {
            error -= self.output_matrix[column * m + index] * (self.state[column] - self.origin[column]);
        }
        if !self.is_held {
            self.sharpen(index);
        }
        let variance = self.variances[index];
        let (e, s) = (error.value(), variance.value());
        // Not for NaN either.
        if !(s > 0.0 && s.is_finite() && (e * e / s).is_finite()) {
            return None;
        }
        let scale = error / variance;
        for (state, &gain) in self.state.iter_mut().zip(&self.gains[index * n..]) {
            *state += gain * scale;
        }
        Some(Innovation { error, variance, noise: self.measurement[index] })
    }

    /// P h and S of an element, and P <- P - P h h' P/S.
    fn sharpen(&mut self, index: usize) {
        self.settling.is_there = false;
        let (n, m) = (self.state.len(), self.output.len());
        let zero = S::from(0.0);
        let first = index * n;
        let noise = self.measurement[index];
        let mut variance = noise;
        for column in 0..n {
            let known = (0..column)
                .map(|k| self.factor[column * n + k] * self.output_matrix[k * m + index])
                .fold(self.output_matrix[column * m + index], |sum, product| sum + product);
            self.projected[column] = known;
            self.gains[first + column] = self.factor[column * n + column] * known;
            variance += known * self.gains[first + column];
        }
        self.variances[index] = variance;
        let mut before = noise;
        for column in 0..n {
            let (f, v) = (self.projected[column], self.gains[first + column]);
            let after = before + f * v;
            // Where a_(j-1) is 0, nothing is known to be uncertain yet: all b are 0.
            let (kept, p) = if before.value() > 0.0 { (before / after, -f / before) } else { (zero, zero) };
            if after.value() > 0.0 {
                self.factor[column * n + column] *= kept;
            }
            for row in 0..column {
                let given = self.factor[column * n + row];
                self.factor[column * n + row] = given + self.gains[first + row] * p;
                self.gains[first + row] += given * v;
            }
            before = after;
        }
    }

    /// Whether the state is made of numbers.
    pub(crate) fn is_finite(&self) -> bool {
        self.state.iter().all(|state| state.value().is_finite())
    }
}

impl Predictor<f64> {
    /// L = U D^(1/2) with P = L L', column after column.
    pub(crate) fn root(&self) -> Vec<f64> {
        let n = self.state.len();
        let mut root = self.factor.clone();
        for column in 0..n {
            let deviation = self.factor[column * n + column].max(0.0).sqrt();
            for row in 0..column {
                root[column * n + row] *= deviation;
            }
            root[column * n + column] = deviation;
        }
        root
    }
}
