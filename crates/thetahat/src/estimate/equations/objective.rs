//! The likelihood as what a search makes small.
//!
//! The cost is 2 V = -2 ln L, whose normal equations are those of Fisher scoring, with the information I for G:
//!
//! ```text
//! A step = -V',   A = I + diag(c_i),   c_i = |V_i| of a parameter with bounds, 0 of the others
//! ```
//!
//! c_i is the most that the curvature of p(z) adds to that of V: for p = min + exp(z), V_p p'' = V_z. It vanishes at a
//! minimum, and keeps a parameter that is drawn to its bound from running away: there I_ii and V_i vanish together, and
//! V_i^2/I_ii does not.
//!
//! Where V falls by more than predicted, as on a plateau far from the minimum, a step is doubled as long as V falls
//! further: there the sum of e_i e_j/S says more about e than about V. That halves the iterations from starts that are
//! far away. Steps that raise V are damped at once: halving them first costs more evaluations, and leads no more starts
//! to the largest likelihood.
//!
//! The search stops when the predicted decrease is below the tolerance times max(N, sum e^2/S), N the elements that
//! were measured. That is 2 V without its logarithms, which may be of either sign.

use thetahat_numerics::optimize::{Objective, StepRules};

use super::likelihood::{Likelihood, Slopes};
use crate::model::{
    GreyBox,
    equations::{Scale, Unknown},
};
use crate::respond::equations::Failure;

/// -2 ln L as a function of the variables z.
#[derive(Debug)]
pub(super) struct Deviance<L> {
    pub(super) criterion: L,
    /// Which parameters have a bound.
    bounded: Vec<bool>,
    /// Where it was evaluated last.
    z: Vec<f64>,
    /// A and -V' where it was linearised last.
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl<L: Likelihood> Deviance<L> {
    pub(super) fn new(unknown: &[Unknown], criterion: L) -> Self {
        Self::of(unknown.iter().map(|unknown| unknown.scale != Scale::Free).collect(), criterion)
    }

    /// The same of all parameters but one.
    pub(super) fn without(model: &GreyBox, index: usize, criterion: L) -> Self {
        let others = model.parameters().iter().enumerate().filter(|(place, _)| *place != index);
        Self::of(others.map(|(_, unknown)| unknown.scale != Scale::Free).collect(), criterion)
    }

    fn of(bounded: Vec<bool>, criterion: L) -> Self {
        let size = bounded.len();
        Self {
            criterion,
            bounded,
            z: vec![0.0; size],
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
        }
    }
}

impl<L: Likelihood> Objective for Deviance<L> {
    type Refusal = Failure;

    const STEP_RULES: StepRules = StepRules { shortenings: 0, lengthens: true };

    fn samples(&self) -> usize {
        self.criterion.measurements()
    }

    /// A point at which the filter does not work has no cost.
    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure> {
        self.z.copy_from_slice(z);
        Ok(2.0 * self.criterion.evaluate(z)?)
    }

    fn linearize(&mut self) -> Result<f64, Failure> {
        self.criterion.linearize(&self.z)?;
        let Slopes { gradient, information, .. } = self.criterion.slopes();
        let size = gradient.len();
        self.matrix.copy_from_slice(information);
        for (index, gradient) in gradient.iter().enumerate() {
            self.right[index] = -gradient;
            if self.bounded[index] {
                self.matrix[index * size + index] += gradient.abs();
            }
        }
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn scale(&self, _cost: f64) -> f64 {
        (self.criterion.measurements() as f64).max(self.criterion.slopes().squares)
    }

    /// -ln L for each element.
    fn mean(&self, cost: f64) -> f64 {
        cost / 2.0 / self.criterion.measurements() as f64
    }
}
