//! What a search makes small: a sum of squares, or a cost that has normal equations like one.

use std::ops::Range;

use crate::model::Orders;

/// A cost of the parameters, and of the weights of free responses, which it keeps itself: [`evaluate`](Self::evaluate) takes
/// trial weights, [`linearize`](Self::linearize) makes these, and the parameters evaluated last, the current point.
pub(super) trait Objective {
    fn orders(&self) -> &Orders;
    /// N, the samples that count.
    fn samples(&self) -> usize;
    /// The free responses of all segments.
    fn initial_conditions(&self) -> usize;
    /// Whether A has to be stable, as C and F have to be.
    fn needs_stable_a(&self) -> bool;
    /// The parameters that minimise the cost, given the others, where their part of the normal equations is solved.
    fn linear(&self) -> Range<usize>;
    /// Sets the weights of the free responses to zero.
    fn restart(&mut self);
    /// The cost at these parameters and the trial weights.
    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable>;
    /// Forms the normal equations. Gives by how much the free responses alone can lower the cost.
    fn linearize(&mut self) -> f64;
    /// Sets the trial weights to those that are best for a step of the parameters, to first order.
    fn try_free(&mut self, step: &[f64]);
    /// Sets the trial weights back to those of the current point.
    fn keep_free(&mut self);
    /// The matrix of the normal equations, row by row, the free responses taken out.
    fn matrix(&self) -> &[f64];
    /// Their right-hand side: minus half the gradient of the cost.
    fn right(&self) -> &[f64];
}

/// Why parameters have no cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unusable {
    /// C or F has a root outside the unit circle.
    Unstable,
    /// The errors overflow.
    Overflow,
}
