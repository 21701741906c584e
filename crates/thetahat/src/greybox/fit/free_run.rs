//! The model on its own: driven by the inputs from a start.
//!
//! The start is the one that explains the outputs best without any noise inside, what is known of it before included:
//!
//! ```text
//! x0 = argmin sum (y - h(x))^2/r + sum (x0 - m)^2/s^2,   x(k+1) = f(x(k))
//! ```
//!
//! by Levenberg and Marquardt's method with the exact slopes dx(k)/dx0 = F(k-1) … F(0). A state whose start is known (s = 0)
//! keeps it.

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::experiment::Experiment;
use crate::GreyBox;
use crate::estimate::{FIRST_DAMPING, LARGEST_DAMPING, SMALLEST_DAMPING};

const MOST_STEPS: usize = 30;
/// The start is found when a step would lower the sum by less than this fraction.
const TOLERANCE: f64 = 1e-9;

/// A response to the inputs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FreeRun {
    pub(super) start: Vec<f64>,
    /// Row after row.
    pub(super) outputs: Vec<f64>,
}

/// None where the response leaves the range of numbers. O(N (n^3 + m n^2)) for each of a few iterations.
pub(super) fn free_run(model: &GreyBox, experiment: &Experiment, z: &[f64]) -> Option<FreeRun> {
    let mut simulation = Simulation::new(model, experiment, z);
    let mut start = model.start().0.to_vec();
    let mut cost = simulation.run(&start, true)?;
    let mut damping = FIRST_DAMPING;
    'search: for _ in 0..MOST_STEPS {
        let (matrix, right) = (simulation.matrix.clone(), simulation.right.clone());
        loop {
            if damping > LARGEST_DAMPING {
                break 'search;
            }
            let mut damped = matrix.clone();
            (0..start.len()).for_each(|index| damped[(index, index)] *= 1.0 + damping);
            let Some(factor) = damped.cholesky() else {
                damping *= 10.0;
                continue;
            };
            let step = factor.solve(&right);
            if step.dot(&right) <= TOLERANCE * cost {
                break 'search;
            }
            let trial: Vec<f64> = start.iter().zip(step.iter()).map(|(start, step)| start + step).collect();
            match simulation.run(&trial, true) {
                Some(lower) if lower < cost => {
                    (start, cost) = (trial, lower);
                    damping = (damping / 10.0).max(SMALLEST_DAMPING);
                    break;
                }
                _ => damping *= 10.0,
            }
        }
    }
    simulation.run(&start, false)?;
    Some(FreeRun { start, outputs: simulation.outputs })
}

/// A run from one start, its slopes, and the memory that it takes.
struct Simulation<'a> {
    model: &'a GreyBox,
    experiment: &'a Experiment,
    z: &'a [f64],
    /// The normal equations of a step.
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    /// dx(k)/dx0, and the same a step later.
    slopes: DMatrix<f64>,
    moved: DMatrix<f64>,
    /// dh(x(k))/dx0 of one output.
    slope: Vec<f64>,
    state: Vec<f64>,
    next: Vec<f64>,
    state_matrix: DMatrix<f64>,
    output_matrix: DMatrix<f64>,
    outputs: Vec<f64>,
    work: Vec<f64>,
}

impl<'a> Simulation<'a> {
    fn new(model: &'a GreyBox, experiment: &'a Experiment, z: &'a [f64]) -> Self {
        let (n, m) = (model.states().len(), model.outputs().len());
        Self {
            model,
            experiment,
            z,
            matrix: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            slopes: DMatrix::zeros(n, n),
            moved: DMatrix::zeros(n, n),
            slope: vec![0.0; n],
            state: vec![0.0; n],
            next: vec![0.0; n],
            state_matrix: DMatrix::zeros(n, n),
            output_matrix: DMatrix::zeros(m, n),
            outputs: vec![0.0; experiment.rows() * m],
            work: Vec::new(),
        }
    }

    /// The sum of squares from a start, and the normal equations there if `sloped`; none where a number is not finite.
    fn run(&mut self, start: &[f64], sloped: bool) -> Option<f64> {
        let (n, m) = (self.model.states().len(), self.model.outputs().len());
        let mut cost = self.begin(start);
        for row in 0..self.experiment.rows() {
            for (time, step) in self.experiment.steps(row) {
                let input = self.experiment.input(row - 1);
                let (next, matrix) = (&mut self.next, self.state_matrix.as_mut_slice());
                self.model.advance(&self.state, self.z, input, time, step, next, matrix, &mut self.work);
                std::mem::swap(&mut self.state, &mut self.next);
                if sloped {
                    self.state_matrix.mul_to(&self.slopes, &mut self.moved);
                    std::mem::swap(&mut self.slopes, &mut self.moved);
                }
            }
            let (input, time) = (self.experiment.input(row), self.experiment.times[row]);
            let outputs = &mut self.outputs[row * m..(row + 1) * m];
            let matrix = self.output_matrix.as_mut_slice();
            self.model.observe(&self.state, self.z, input, time, outputs, matrix, &mut self.work);
            if !self.state.iter().chain(&*outputs).all(|value| value.is_finite()) {
                return None;
            }
            let variances = self.model.measurement_variances().iter();
            for (output, (&measured, variance)) in
                self.experiment.output(row).iter().zip(variances).enumerate()
            {
                if measured.is_nan() {
                    continue;
                }
                let error = measured - self.outputs[row * m + output];
                cost += error * error / variance;
                if !sloped {
                    continue;
                }
                for (slope, column) in self.slope.iter_mut().zip(self.slopes.column_iter()) {
                    *slope = (0..n).map(|k| self.output_matrix[(output, k)] * column[k]).sum();
                }
                for (i, slope) in self.slope.iter().enumerate() {
                    self.right[i] += slope * error / variance;
                    for (j, other) in self.slope.iter().enumerate() {
                        self.matrix[(i, j)] += slope * other / variance;
                    }
                }
            }
        }
        let known = !sloped || self.matrix.iter().chain(&self.right).all(|value| value.is_finite());
        (cost.is_finite() && known).then_some(cost)
    }

    /// Goes to a start; gives what is known of it before as a part of the sum.
    fn begin(&mut self, start: &[f64]) -> f64 {
        self.state.copy_from_slice(start);
        self.matrix.fill(0.0);
        self.slopes.fill(0.0);
        let (mean, deviations) = self.model.start();
        let mut cost = 0.0;
        for (index, (mean, &deviation)) in mean.iter().zip(deviations).enumerate() {
            // One that is known has no slope, and so no step.
            let free = deviation > 0.0;
            let weight = if free { deviation.powi(-2) } else { 1.0 };
            let away = mean - start[index];
            cost += weight * away * away;
            self.matrix[(index, index)] = weight;
            self.right[index] = weight * away;
            self.slopes[(index, index)] = f64::from(u8::from(free));
        }
        cost
    }
}
