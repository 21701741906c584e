//! Prediction errors as what a search makes small.

use std::ops::Range;

use thetahat_numerics::optimize::Objective;

use super::Predictor;
use crate::estimate::polynomials::Unusable;

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
