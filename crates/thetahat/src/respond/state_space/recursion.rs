use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::normal;

use super::covariance::StateCovariance;
use crate::model::StateSpace;

/// Rows that are added up together.
const BLOCK: usize = 4;

/// One over the deviation of an innovation; 1 for one without noise.
fn weight(variance: f64) -> f64 {
    if variance > 0.0 { 1.0 / variance.sqrt() } else { 1.0 }
}

/// A model that is stepped along the rows of a log.
///
/// Row by row it makes [x(t+1); y(t)] of [x(t); u(t)], with e = 0; or, as a predictor, [x(t+1); e(t)] of [x(t); u(t);
/// y(t)] with
///
/// ```text
/// x(t+1) = (F - K H) x(t) + (G - K D) u(t) + K y(t),   e(t) = y(t) - H x(t) - D u(t)
/// ```
///
/// A step is one product with a matrix, (n + l) (n + m + l) multiply-adds, in memory of its own. Four rows of the
/// matrix stand together: the sums of a block stay in registers, and each is that of its row, one column after the
/// other.
///
/// [Through missing outputs](Self::through_missing_outputs) the gain is that of each row.
#[derive(Debug, Clone)]
pub(crate) struct Recursion {
    states: usize,
    /// The matrix, in blocks of four rows, each column by column; zeros below the last row.
    blocks: Vec<[f64; BLOCK]>,
    /// What is there whatever state and signals are.
    constant: Vec<[f64; BLOCK]>,
    /// What is left of a state one row later: F, or F - K H.
    between: DMatrix<f64>,
    /// H.
    seen: DMatrix<f64>,
    /// One over the deviations of e, which outputs are compared in.
    weights: Vec<f64>,
    /// Whether it is fed with what was measured.
    predicts: bool,
    /// What is not known of the state, where outputs may be missing.
    covariance: Option<Box<StateCovariance>>,
    /// The innovations of a row with a gain of its own.
    left: DVector<f64>,
    /// What they do to the next state beside what K does.
    correction: DVector<f64>,
    /// The state, then the signals of a row.
    values: Vec<f64>,
    /// The next state, and what comes out.
    next: Vec<[f64; BLOCK]>,
}

impl Recursion {
    /// Driven by inputs and what was measured; gives innovations.
    pub(crate) fn predictor(model: &StateSpace) -> Self {
        let StateSpace { f, g, h, d, k, .. } = model;
        let l = h.nrows();
        let mut matrix = DMatrix::zeros(f.nrows() + l, f.nrows() + g.ncols() + l);
        let between = f - k * h;
        let (n, m) = g.shape();
        matrix.view_mut((0, 0), (n, n)).copy_from(&between);
        matrix.view_mut((0, n), (n, m)).copy_from(&(g - k * d));
        matrix.view_mut((0, n + m), (n, l)).copy_from(k);
        matrix.view_mut((n, 0), (l, n)).copy_from(&-h);
        matrix.view_mut((n, n), (l, m)).copy_from(&-d);
        matrix.view_mut((n, n + m), (l, l)).fill_with_identity();
        Self::of(model, &matrix, between, true)
    }

    /// Driven by the inputs alone; gives outputs.
    pub(crate) fn simulator(model: &StateSpace) -> Self {
        let StateSpace { f, g, h, d, .. } = model;
        let (n, m) = g.shape();
        let l = h.nrows();
        let mut matrix = DMatrix::zeros(n + l, n + m);
        matrix.view_mut((0, 0), (n, n)).copy_from(f);
        matrix.view_mut((0, n), (n, m)).copy_from(g);
        matrix.view_mut((n, 0), (l, n)).copy_from(h);
        matrix.view_mut((n, n), (l, m)).copy_from(d);
        Self::of(model, &matrix, f.clone(), false)
    }

    /// A predictor of outputs that are measured from elsewhere: y - level in the place of y.
    pub(crate) fn with_levels(mut self, levels: &[f64]) -> Self {
        for (constant, block) in self.constant.iter_mut().zip(self.blocks.chunks_exact(self.values.len())) {
            for (column, level) in block.iter().rev().zip(levels.iter().rev()) {
                constant.iter_mut().zip(column).for_each(|(sum, entry)| *sum -= entry * level);
            }
        }
        self
    }

    /// A predictor of outputs that may be missing, each of them: the gain of a row is that of what was measured in it
    /// and before.
    pub(super) fn through_missing_outputs(self, covariance: StateCovariance) -> Self {
        Self { covariance: Some(Box::new(covariance)), ..self }
    }

    fn of(model: &StateSpace, matrix: &DMatrix<f64>, between: DMatrix<f64>, predicts: bool) -> Self {
        let (rows, columns) = matrix.shape();
        let states = model.f.nrows();
        let count = rows.div_ceil(BLOCK);
        let entry = |row: usize, column: usize| if row < rows { matrix[(row, column)] } else { 0.0 };
        let block = |first: usize| {
            (0..columns).map(move |column| std::array::from_fn(|row| entry(first * BLOCK + row, column)))
        };
        Self {
            states,
            blocks: (0..count).flat_map(block).collect(),
            constant: vec![[0.0; BLOCK]; count],
            between,
            seen: model.h.clone(),
            weights: model.noise_covariance.diagonal().iter().map(|variance| weight(*variance)).collect(),
            predicts,
            covariance: None,
            left: DVector::zeros(model.h.nrows()),
            correction: DVector::zeros(states),
            values: vec![0.0; columns],
            next: vec![[0.0; BLOCK]; count],
        }
    }

    /// The state before the next step.
    pub(crate) fn state(&self) -> &[f64] {
        &self.values[..self.states]
    }

    /// What is not known of it; none where it is known.
    pub(super) fn covariance(&self) -> Option<&DMatrix<f64>> {
        self.covariance.as_ref().and_then(|covariance| covariance.next())
    }

    /// What the innovations of the last row did to the state beside what K did; none where the gain was K.
    pub(super) fn correction(&self) -> Option<&DVector<f64>> {
        self.varying().map(|_| &self.correction)
    }

    /// Goes on from another state, which is known.
    pub(crate) fn start(&mut self, state: &[f64]) {
        self.values[..self.states].copy_from_slice(state);
        if let Some(covariance) = &mut self.covariance {
            covariance.reset();
        }
    }

    /// Where the last row has a gain of its own.
    fn varying(&self) -> Option<&StateCovariance> {
        self.covariance.as_deref().filter(|covariance| covariance.varies())
    }

    /// What comes out of a row: the innovations, or the outputs. The signals are inputs, then outputs as far as it is
    /// fed with them.
    ///
    /// Where outputs may be missing, one that is counts as zero in what comes out: the prediction with another sign.
    pub(crate) fn step(&mut self, signals: &[&[f64]], row: usize) -> &[f64] {
        let varies = self.covariance.as_mut().is_some_and(|covariance| {
            let outputs = &signals[signals.len() - self.seen.nrows()..];
            covariance.step(outputs, row)
        });
        let (state, fed) = self.values.split_at_mut(self.states);
        fed.iter_mut().zip(signals).for_each(|(value, signal)| *value = signal[row]);
        if varies {
            fed.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = 0.0);
        }
        let next = self.next.iter_mut().zip(&self.constant);
        for ((next, constant), block) in next.zip(self.blocks.chunks_exact(state.len() + fed.len())) {
            let mut sums = *constant;
            for (column, value) in block.iter().zip(state.iter().chain(&*fed)) {
                sums.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * value);
            }
            *next = sums;
        }
        let (next, out) = self.next.as_flattened().split_at(self.states);
        state.copy_from_slice(next);
        let out = &out[..self.seen.nrows()];
        if let Some(covariance) = self.covariance.as_deref().filter(|_| varies) {
            self.left.copy_from_slice(out);
            self.correction.gemv(1.0, covariance.change(), &self.left, 0.0);
            state.iter_mut().zip(&self.correction).for_each(|(value, more)| *value += more);
        }
        out
    }

    /// Starts a segment from the state that explains its outputs best: with M(t) = H A^t, A the matrix of the
    /// recursion, what is left of them is r(t) - M(t) x(0), with r what is left from rest, and the state that of
    /// weighted least squares. `outputs` may miss values. Rows count as long as the state is seen in them. Through
    /// missing outputs A is that of each row, and so is the variance of what is left. O(T n (n + m + l + l n)) for T of
    /// these.
    pub(crate) fn start_at_best(&mut self, signals: &[&[f64]], outputs: &[&[f64]], rows: Range<usize>) {
        let n = self.states;
        let (mut matrix, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let (mut seen, mut left) = (self.seen.clone(), vec![0.0; outputs.len()]);
        let mut after = seen.clone();
        let mut weighted = seen.clone();
        let first = seen.norm();
        self.start(&vec![0.0; n]);
        for row in rows {
            left.copy_from_slice(self.step(signals, row));
            for (place, output) in outputs.iter().enumerate() {
                if !self.predicts {
                    left[place] = output[row] - left[place];
                }
                // A missing output says nothing.
                let weight = match self.varying() {
                    _ if output[row].is_nan() => 0.0,
                    Some(covariance) => weight(covariance.variance(place)),
                    None => self.weights[place],
                };
                left[place] = if weight == 0.0 { 0.0 } else { weight * left[place] };
                weighted.row_mut(place).zip_apply(&seen.row(place), |entry, seen| *entry = weight * seen);
            }
            matrix.gemm_tr(1.0, &weighted, &weighted, 1.0);
            for (place, left) in left.iter().enumerate() {
                right
                    .iter_mut()
                    .zip(weighted.row(place).iter())
                    .for_each(|(sum, entry)| *sum += entry * left);
            }
            let between = self.varying().map_or(&self.between, StateCovariance::between);
            after.gemm(1.0, &seen, between, 0.0);
            std::mem::swap(&mut seen, &mut after);
            let size = seen.norm();
            if size <= f64::EPSILON * first || !size.is_finite() {
                break;
            }
        }
        // The matrix is symmetric.
        let mut factor = matrix.as_slice().to_vec();
        normal::factor(&mut factor, n);
        normal::solve(&factor, n, right.as_mut_slice());
        self.start(right.as_slice());
    }
}
