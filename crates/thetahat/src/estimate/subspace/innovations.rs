//! The prediction errors of a state-space model along a record.

use thetahat_core::nalgebra::DMatrix;

use crate::data::JointRecord;
use crate::model::StateSpace;
use crate::respond::state_space::Recursion;

/// The sums of the products of the innovations of outputs from their levels, each segment from the state that leaves
/// least of them. None where they leave the range of numbers. O(N (n + l) (n + m + l)).
pub(crate) fn products(model: &StateSpace, record: &JointRecord<'_>, levels: &[f64]) -> Option<DMatrix<f64>> {
    let outputs = record.outputs.len();
    let mut sums = vec![0.0; outputs * outputs];
    let mut predictor = Recursion::predictor(model).with_levels(levels);
    let signals = record.signals();
    for segment in &record.segments {
        predictor.start_at_best(&signals, &record.outputs, segment.clone());
        for row in segment.clone() {
            let errors = predictor.step(&signals, row);
            for (sums, left) in sums.chunks_exact_mut(outputs).zip(errors) {
                sums.iter_mut().zip(errors).for_each(|(sum, right)| *sum += left * right);
            }
        }
    }
    sums.iter().all(|sum| sum.is_finite()).then(|| DMatrix::from_row_slice(outputs, outputs, &sums))
}
