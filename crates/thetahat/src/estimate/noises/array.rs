//! The Kalman filter of a linear model as one triangular factorisation for each row, in any kind of number.
//!
//! With P = U D U' (U unit lower triangular, D diagonal), and the noises [v; w] = L e of unit variances, what is
//! measured and the next state have, around what is expected of them, the covariance
//!
//! ```text
//! [ H U  L_v ] [ D   ] [ H U  L_v ]'     [ 1       ] [ S     ] [ 1       ]'
//! [ F U  L_w ] [   1 ] [ F U  L_w ]   =  [ K  U⁺   ] [    D⁺ ] [ K  U⁺   ]
//! ```
//!
//! The right side, with unit lower triangular matrices in the place of 1 and U⁺, is found by the modified weighted
//! Gram-Schmidt process on the rows of the left one, from the first row on. S are the variances of the elements of y,
//! each given those before it, and with their errors e, each less what those before it tell of it,
//!
//! ```text
//! x⁺ = F x + G u + K e,   P⁺ = U⁺ D⁺ U⁺'
//! ```
//!
//! Nothing is subtracted from a variance, cov(v, w) needs no case of its own, and an element that is missing is a row
//! that is left out. (Kailath, Sayed and Hassibi, Linear Estimation, 2000, section 12.3: array algorithms; Bierman,
//! Factorization Methods for Discrete Sequential Estimation, 1977, chapter VI: the weighted process, which takes no
//! roots, so that it has derivatives where a variance is 0.)

use thetahat_core::Number;
use thetahat_core::nalgebra::{DMatrix, DVector};

/// A variance that counts as none: its square, by which derivatives are divided, is no number above 0 any more.
const NEGLIGIBLE: f64 = 1e-140;

/// x(k+1) = F x(k) + G u(k) + w(k), y(k) = H x(k) + D u(k) + v(k), from x ~ (x0, A A').
#[derive(Debug, Clone)]
pub(crate) struct Plant {
    pub(crate) f: DMatrix<f64>,
    pub(crate) g: DMatrix<f64>,
    pub(crate) h: DMatrix<f64>,
    pub(crate) d: DMatrix<f64>,
    pub(crate) x0: DVector<f64>,
    /// A, lower triangular.
    pub(crate) start: DMatrix<f64>,
}

/// What is expected of the next row, and the workspace of a step. Matrices are row after row.
#[derive(Debug, Clone)]
pub(super) struct ArrayFilter<S> {
    /// x, and F x + G u.
    state: Vec<S>,
    next: Vec<S>,
    /// U and D.
    factor: Vec<S>,
    variances: Vec<S>,
    /// y - H x - D u of the elements that are there, which they are, and how many.
    errors: Vec<S>,
    there: Vec<usize>,
    /// The rows of the array, and the weights of its columns.
    rows: Vec<S>,
    weights: Vec<S>,
}

impl<S: Number<f64>> ArrayFilter<S> {
    /// For a plant whose noises are made of so many.
    pub(super) fn new(plant: &Plant, noises: usize) -> Self {
        let (m, n) = plant.h.shape();
        let zeros = |count: usize| vec![S::from(0.0); count];
        Self {
            state: zeros(n),
            next: zeros(n),
            factor: zeros(n * n),
            variances: zeros(n),
            errors: zeros(m),
            there: Vec::with_capacity(m),
            rows: zeros((m + n) * (n + noises)),
            weights: vec![S::from(1.0); n + noises],
        }
    }

    /// Goes to the start of a log.
    pub(super) fn restart(&mut self, plant: &Plant) {
        let n = self.state.len();
        self.state.iter_mut().zip(&plant.x0).for_each(|(state, &start)| *state = S::from(start));
        self.variances.fill(S::from(1.0));
        for (index, entry) in self.factor.iter_mut().enumerate() {
            *entry = S::from(plant.start[(index / n, index % n)]);
        }
    }

    /// Takes what was measured in a row, NaN where nothing was, and goes on to the next one. `noise` is L, row after
    /// row, those of the outputs first. `told` hears e and S of each element. None where an S is not positive or a
    /// number not finite: then the filter is of no more use. About (m + n)² (2 n + m) multiply-adds.
    pub(super) fn step(
        &mut self,
        plant: &Plant,
        noise: &[S],
        inputs: &[f64],
        measured: &[f64],
        mut told: impl FnMut(S, S),
    ) -> Option<()> {
        let (n, width) = (self.state.len(), self.weights.len());
        let (zero, noises) = (S::from(0.0), width - n);
        let m = plant.h.nrows();
        self.there.clear();
        self.there.extend((0..m).filter(|&output| !measured[output].is_nan()));
        let outputs = self.there.len();
        let along = |matrix: &DMatrix<f64>, row: usize, values: &[S], sum: S| {
            values.iter().enumerate().fold(sum, |sum, (column, &value)| sum + value * matrix[(row, column)])
        };
        let driven = |matrix: &DMatrix<f64>, row: usize| -> f64 {
            inputs.iter().enumerate().map(|(column, input)| matrix[(row, column)] * input).sum()
        };
        for row in 0..outputs + n {
            let (matrix, from, source) = match self.there.get(row) {
                Some(&output) => (&plant.h, output, output),
                None => (&plant.f, row - outputs, m + row - outputs),
            };
            let own = &mut self.rows[row * width..(row + 1) * width];
            for (column, entry) in own[..n].iter_mut().enumerate() {
                *entry = (0..n).fold(zero, |sum, k| sum + self.factor[k * n + column] * matrix[(from, k)]);
            }
            own[n..].copy_from_slice(&noise[source * noises..(source + 1) * noises]);
            if row < outputs {
                let expected = along(matrix, from, &self.state, S::from(driven(&plant.d, from)));
                self.errors[row] = -(expected - measured[from]);
            } else {
                self.next[from] = along(matrix, from, &self.state, S::from(driven(&plant.g, from)));
            }
        }
        self.weights[..n].copy_from_slice(&self.variances);
        self.factor.fill(zero);
        for index in 0..outputs + n {
            let (before, after) = self.rows.split_at_mut((index + 1) * width);
            let own = &before[index * width..];
            let weighted = |other: &[S]| {
                let products = other.iter().zip(own).zip(&self.weights);
                products.fold(zero, |sum, ((&other, &own), &weight)| sum + other * own * weight)
            };
            let pivot = weighted(own);
            if index < outputs {
                let (error, variance) = (self.errors[index], pivot);
                let (e, s) = (error.value(), variance.value());
                // Not for NaN either.
                if !(s > 0.0 && s.is_finite() && (e * e / s).is_finite()) {
                    return None;
                }
                told(error, variance);
            } else {
                let state = index - outputs;
                self.variances[state] = pivot;
                self.factor[state * n + state] = S::from(1.0);
            }
            // Where nothing is uncertain, the column does not matter.
            if pivot.value() <= NEGLIGIBLE {
                continue;
            }
            for (offset, other) in after.chunks_mut(width).take(outputs + n - index - 1).enumerate() {
                let row = index + 1 + offset;
                let entry = weighted(other) / pivot;
                other.iter_mut().zip(own).for_each(|(other, &own)| *other -= entry * own);
                match (index.checked_sub(outputs), row.checked_sub(outputs)) {
                    (Some(from), Some(state)) => self.factor[state * n + from] = entry,
                    (_, Some(state)) => self.next[state] += entry * self.errors[index],
                    (_, None) => {
                        let known = entry * self.errors[index];
                        self.errors[row] -= known;
                    }
                }
            }
        }
        std::mem::swap(&mut self.state, &mut self.next);
        self.state.iter().all(|state| state.value().is_finite()).then_some(())
    }
}
