//! The prediction errors of a state-space model along a record.

use thetahat_core::nalgebra::{DMatrix, DVector};

use crate::data::JointRecord;
use crate::model::StateSpace;
use crate::optimize::normal;

/// The sums of the products of the innovations,
///
/// ```text
/// e(t) = y(t) - H x(t) - D u(t),   x(t+1) = F x(t) + G u(t) + K e(t),
/// ```
///
/// each segment from the state that leaves least of them. With M(t) = H (F - K H)^t they are e0(t) - M(t) x(0), those from rest less what
/// the state adds, which is least squares. None where they leave the range of numbers. O(N (n (n + m + 2 l) + l m)).
pub(super) fn products(model: &StateSpace, record: &JointRecord<'_>) -> Option<DMatrix<f64>> {
    let outputs = record.outputs.len();
    let mut sums = DMatrix::zeros(outputs, outputs);
    let mut run = Run::new(model);
    for segment in &record.segments {
        run.start_at_best(model, record, segment);
        for row in segment.clone() {
            run.step(model, record, row);
            sums.ger(1.0, &run.error, &run.error, 1.0);
        }
    }
    sums.iter().all(|sum| sum.is_finite()).then_some(sums)
}

/// A state that goes on, and what it is computed with.
#[derive(Debug)]
struct Run {
    state: DVector<f64>,
    next: DVector<f64>,
    error: DVector<f64>,
    input: DVector<f64>,
}

impl Run {
    fn new(model: &StateSpace) -> Self {
        let state = DVector::zeros(model.f.nrows());
        let (error, input) = (DVector::zeros(model.h.nrows()), DVector::zeros(model.g.ncols()));
        Self { next: state.clone(), state, error, input }
    }

    /// The innovation of a row, and the state after it.
    fn step(&mut self, model: &StateSpace, record: &JointRecord<'_>, row: usize) {
        self.input.iter_mut().zip(&record.inputs).for_each(|(value, input)| *value = input[row]);
        self.error.iter_mut().zip(&record.outputs).for_each(|(value, output)| *value = output[row]);
        self.error.gemv(-1.0, &model.h, &self.state, 1.0);
        self.error.gemv(-1.0, &model.d, &self.input, 1.0);
        self.next.gemv(1.0, &model.f, &self.state, 0.0);
        self.next.gemv(1.0, &model.g, &self.input, 1.0);
        self.next.gemv(1.0, &model.k, &self.error, 1.0);
        std::mem::swap(&mut self.state, &mut self.next);
    }

    /// The state at the start of a segment. Rows count as long as the state is seen in them.
    fn start_at_best(
        &mut self,
        model: &StateSpace,
        record: &JointRecord<'_>,
        segment: &std::ops::Range<usize>,
    ) {
        let n = model.f.nrows();
        let between = &model.f - &model.k * &model.h;
        let mut seen = model.h.clone();
        let (mut matrix, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        self.state.fill(0.0);
        let first = seen.norm();
        for row in segment.clone() {
            self.step(model, record, row);
            matrix.gemm_tr(1.0, &seen, &seen, 1.0);
            right.gemv_tr(1.0, &seen, &self.error, 1.0);
            seen = &seen * &between;
            if seen.norm() <= f64::EPSILON * first {
                break;
            }
        }
        // The matrix is symmetric.
        let mut factor = matrix.as_slice().to_vec();
        normal::factor(&mut factor, n);
        normal::solve(&factor, n, right.as_mut_slice());
        self.state.copy_from(&right);
    }
}
