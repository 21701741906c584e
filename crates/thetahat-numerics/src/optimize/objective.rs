//! What a search makes small: a sum of squares, or a cost that has normal equations like one.

use std::ops::Range;

/// A cost J of the parameters with a Gauss-Newton approximation
///
/// ```text
/// J(theta + s) = J(theta) - 2 g's + s'G s
/// ```
///
/// G is positive semidefinite. For a sum of squared errors e with psi = -de/dtheta, g = psi'e and G = psi'psi; for -2
/// ln L, twice the negative logarithm of a likelihood, g is the gradient of ln L and G the information.
///
/// An objective may have unknowns of its own beside the parameters, the weights of free responses, which enter the
/// errors linearly: [`evaluate`](Self::evaluate) takes trial weights, [`linearize`](Self::linearize) makes these, and
/// the parameters evaluated last, the current point.
pub trait Objective {
    /// Why parameters have no cost.
    type Refusal;

    /// How the lengths of its steps are found: for sums of squares, unless it says otherwise.
    const STEP_RULES: StepRules = StepRules { shortenings: 3, lengthens: false };

    /// N, the samples that count.
    fn samples(&self) -> usize;

    /// J at these parameters and the trial weights.
    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Self::Refusal>;

    /// Forms the normal equations at the parameters evaluated last. Gives by how much the free responses alone can
    /// lower J.
    fn linearize(&mut self) -> Result<f64, Self::Refusal>;

    /// G, row by row, the free responses taken out.
    fn matrix(&self) -> &[f64];

    /// g: minus half the gradient of J.
    fn right(&self) -> &[f64];

    /// What the tolerance is a fraction of, where J was linearised last: J itself, unless J may be zero or negative at
    /// its minimum for other reasons than a perfect fit.
    fn scale(&self, cost: f64) -> f64 {
        cost
    }

    /// J as a monitor is told of it: for each sample.
    fn mean(&self, cost: f64) -> f64 {
        cost / self.samples() as f64
    }

    /// The free responses of all segments.
    fn initial_conditions(&self) -> usize {
        0
    }

    /// The parameters that minimise J, given the others, where their part of the normal equations is solved.
    fn linear(&self) -> Range<usize> {
        0..0
    }

    /// The normal equations of these alone, at the parameters evaluated last: writes their part of G, row by row, and
    /// of g. What else [`linearize`](Self::linearize) forms need not be there afterwards.
    fn linear_equations(&mut self, matrix: &mut [f64], right: &mut [f64]) -> Result<(), Self::Refusal> {
        self.linearize()?;
        let (size, linear) = (self.right().len(), self.linear());
        let whole = self.matrix().chunks_exact(size.max(1)).skip(linear.start);
        for (own, whole) in matrix.chunks_exact_mut(linear.len().max(1)).zip(whole) {
            own.copy_from_slice(&whole[linear.clone()]);
        }
        right.copy_from_slice(&self.right()[linear]);
        Ok(())
    }

    /// Writes R and Q'e with psi = Q R, the free responses taken out, as exact as an orthogonal method, at the current
    /// point: a row of R and its number of Q'e, one row after the other. Says whether there is one: not where J is no
    /// sum of squares.
    fn triangle(&mut self, _into: &mut [f64]) -> bool {
        false
    }

    /// The coordinates of a search: where parameters have a region, none has a boundary. Says whether there are any but
    /// the parameters themselves.
    fn coordinates(&mut self, _parameters: &[f64], _into: &mut [f64]) -> bool {
        false
    }

    /// Whether a coordinate is another number than the parameter in its place.
    fn is_curved(&self, _place: usize) -> bool {
        false
    }

    /// The parameters of these coordinates, and into `slopes`, row by row, their derivatives.
    fn parameters(&mut self, _coordinates: &[f64], _into: &mut [f64], _slopes: Option<&mut [f64]>) {}

    /// Sets the weights of the free responses to zero.
    fn restart(&mut self) {}

    /// Sets the trial weights to those that are best for a step of the parameters, to first order.
    fn try_free(&mut self, _step: &[f64]) {}

    /// Sets the trial weights back to those of the current point.
    fn keep_free(&mut self) {}

    /// Whether parameters were refused as they are outside the region where they have a meaning, such as that of
    /// stability.
    fn is_outside(_refusal: &Self::Refusal) -> bool {
        false
    }

    /// Moves parameters that are outside that region back into it, nearer to its boundary than those of `from`. Says
    /// whether that was possible.
    fn draw_in(&mut self, _from: &[f64], _trial: &mut [f64]) -> bool {
        false
    }
}

/// How the length of a step is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepRules {
    /// A damped step is halved so often before it is damped more.
    pub shortenings: usize,
    /// Whether a step that lowers J by more than predicted is doubled as long as J falls further. For objectives
    /// without free responses.
    pub lengthens: bool,
}
