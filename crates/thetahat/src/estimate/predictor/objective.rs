//! Prediction errors as what a search makes small.

use std::ops::Range;

use super::Predictor;
use crate::estimate::polynomials::Unusable;
use crate::optimize::{Objective, normal};

impl Objective for Predictor<'_> {
    type Refusal = Unusable;

    fn samples(&self) -> usize {
        self.samples()
    }

    fn initial_conditions(&self) -> usize {
        self.initial_conditions()
    }

    fn linear(&self) -> Range<usize> {
        let orders = self.orders();
        0..orders.na + orders.nb.iter().sum::<usize>()
    }

    fn restart(&mut self) {
        self.restart();
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.evaluate(parameters)
    }

    fn linearize(&mut self) -> Result<f64, Unusable> {
        Ok(self.linearize())
    }

    fn try_free(&mut self, step: &[f64]) {
        self.try_free(step);
    }

    fn keep_free(&mut self) {
        self.keep_free();
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn is_outside(refusal: &Unusable) -> bool {
        *refusal == Unusable::Unstable
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        self.border.draw_in(from, trial)
    }
}

impl Predictor<'_> {
    /// By how much a full Gauss-Newton step from what was evaluated last would lower the cost, to first order.
    pub(in crate::estimate) fn predicted_decrease(&mut self) -> f64 {
        let size = self.right.len();
        let free_gain = self.linearize();
        let mut factor = self.matrix.clone();
        let mut step = self.right.clone();
        normal::factor(&mut factor, size);
        normal::solve(&factor, size, &mut step);
        free_gain + step.iter().zip(&self.right).map(|(step, right)| step * right).sum::<f64>()
    }
}
