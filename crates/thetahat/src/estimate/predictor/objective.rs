//! Prediction errors as what a search makes small.

use std::ops::Range;

use thetahat_numerics::optimize::Objective;

use super::Predictor;
use crate::estimate::polynomials::Unusable;
use crate::estimate::reflection;
use crate::model::Orders;

/// Where the coefficients of C and of each F stand among the parameters.
fn monic(orders: &Orders) -> impl Iterator<Item = Range<usize>> + use<> {
    let first = orders.na + orders.nb.iter().sum::<usize>();
    let c = first..first + orders.nc;
    let mut next = c.end + orders.nd;
    let f: Vec<usize> = orders.nf.clone();
    std::iter::once(c).chain(f.into_iter().map(move |nf| {
        next += nf;
        next - nf..next
    }))
}

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

    fn linear_equations(&mut self, matrix: &mut [f64], right: &mut [f64]) -> Result<(), Unusable> {
        self.write_linear_equations(matrix, right);
        Ok(())
    }

    fn triangle(&mut self, into: &mut [f64]) -> bool {
        self.write_triangle(into);
        true
    }

    /// C and each F by their reflection coefficients, the others as they are.
    fn coordinates(&mut self, parameters: &[f64], into: &mut [f64]) -> bool {
        into.copy_from_slice(parameters);
        let mut stable = monic(self.orders());
        stable.all(|own| reflection::coordinates(&parameters[own.clone()], &mut into[own]))
    }

    fn is_curved(&self, place: usize) -> bool {
        monic(self.orders()).any(|own| own.contains(&place))
    }

    fn parameters(&mut self, coordinates: &[f64], into: &mut [f64], mut slopes: Option<&mut [f64]>) {
        let size = coordinates.len();
        into.copy_from_slice(coordinates);
        if let Some(slopes) = &mut slopes {
            slopes.fill(0.0);
            (0..size).for_each(|place| slopes[place * (size + 1)] = 1.0);
        }
        for own in monic(self.orders()) {
            let slopes = slopes.as_mut().filter(|_| !own.is_empty());
            let slopes = slopes.map(|slopes| (&mut slopes[own.start * (size + 1)..], size));
            reflection::coefficients(&coordinates[own.clone()], &mut into[own], slopes);
        }
    }

    fn is_outside(refusal: &Unusable) -> bool {
        *refusal == Unusable::Unstable
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        self.stability_boundary.draw_in(from, trial)
    }
}
