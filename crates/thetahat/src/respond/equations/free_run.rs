//! The model on its own: driven by the inputs from a start.
//!
//! What is known of the state in the first row is N(m, P), P = L L'. The start is the one that explains the outputs
//! best without any noise inside, what is known of it before included:
//!
//! ```text
//! x0 = m + L s,   s = argmin sum (y - h(x))^2/r + |s|^2,   x(k+1) = f(x(k))
//! ```
//!
//! by Levenberg and Marquardt's method with the exact slopes dx(k)/ds = F(k-1) … F(0) L. A state that is known (a row
//! of zeros in L) stays as it is. In the first row of a log the model says m and P, in a later one the filter up to
//! there.

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::experiment::Experiment;
use super::predictor::Predictor;
use super::walk::{reach, step};
use crate::model::{GreyBox, equations::Work};

const MOST_STEPS: usize = 30;
/// The start is found when a step would lower the sum by less than this fraction.
const TOLERANCE: f64 = 1e-9;
/// The damping: first, least and most.
const DAMPING: (f64, f64, f64) = (1e-8, 1e-12, 1e12);

/// How a free run begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum InitialState {
    /// As the model says.
    Given,
    /// With the state that explains the outputs best.
    Estimated,
}

/// A free run: the response to the inputs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FreeRun {
    /// The initial state.
    pub(crate) start: Vec<f64>,
    /// The rows of the run, and the outputs in them, row after row.
    pub(crate) rows: Range<usize>,
    pub(crate) outputs: Vec<f64>,
}

/// A run through each segment of rows that count. None where a response leaves the range of numbers. O(N (n^3 + m n^2))
/// for each of a few iterations.
pub(crate) fn free_run(
    model: &GreyBox,
    experiment: &Experiment,
    z: &[f64],
    begin: InitialState,
) -> Option<Vec<FreeRun>> {
    let mut filter = Predictor::new(model);
    filter.restart(model, z);
    let mut reached = 0;
    let mut runs = Vec::new();
    for rows in experiment.counted() {
        if begin == InitialState::Given {
            let mut simulation = Simulation::new(model, experiment, z, rows.clone(), Vec::new());
            let mut start = vec![0.0; model.states().len()];
            model.start(z, &mut start, &mut [], &mut simulation.work);
            simulation.run(&start, None)?;
            runs.push(FreeRun { start, rows: rows.clone(), outputs: simulation.outputs });
            continue;
        }
        // The filter up to the first row, without its measurement.
        for row in reached..rows.start {
            step(model, experiment, &mut filter, z, row, |_, _, _| {})?;
        }
        reached = rows.start;
        let mut before = filter.clone();
        reach(model, experiment, &mut before, z, rows.start);
        runs.push(best(model, experiment, z, rows, before.state.clone(), before.root())?);
    }
    Some(runs)
}

/// The run from the best start.
fn best(
    model: &GreyBox,
    experiment: &Experiment,
    z: &[f64],
    rows: &Range<usize>,
    mean: Vec<f64>,
    root: Vec<f64>,
) -> Option<FreeRun> {
    let n = mean.len();
    let root = DMatrix::from_column_slice(n, n, &root);
    let mean = DVector::from_vec(mean);
    let start_of = |s: &DVector<f64>| -> Vec<f64> { (&mean + &root * s).iter().copied().collect() };
    let mut simulation = Simulation::new(model, experiment, z, rows.clone(), root.as_slice().to_vec());
    let mut s = DVector::zeros(n);
    let mut cost = simulation.run(&start_of(&s), Some(&s))?;
    let (mut damping, least, most) = DAMPING;
    'search: for _ in 0..MOST_STEPS {
        let (matrix, right) = (simulation.matrix.clone(), simulation.right.clone());
        loop {
            if damping > most {
                break 'search;
            }
            let mut damped = matrix.clone();
            (0..n).for_each(|index| damped[(index, index)] *= 1.0 + damping);
            let Some(factor) = damped.cholesky() else {
                damping *= 10.0;
                continue;
            };
            let step = factor.solve(&right);
            if step.dot(&right) <= TOLERANCE * cost {
                break 'search;
            }
            let trial = &s + &step;
            match simulation.run(&start_of(&trial), Some(&trial)) {
                Some(lower) if lower < cost => {
                    (s, cost) = (trial, lower);
                    damping = (damping / 10.0).max(least);
                    break;
                }
                _ => damping *= 10.0,
            }
        }
    }
    let start = start_of(&s);
    simulation.run(&start, None)?;
    Some(FreeRun { start, rows: rows.clone(), outputs: simulation.outputs })
}

/// A run from one start, its slopes, and the memory that it takes.
struct Simulation<'a> {
    model: &'a GreyBox,
    experiment: &'a Experiment,
    z: &'a [f64],
    rows: Range<usize>,
    /// L, column after column.
    root: Vec<f64>,
    /// The normal equations of a step of s.
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    /// dx(k)/ds, and the same a step later.
    slopes: DMatrix<f64>,
    moved: DMatrix<f64>,
    /// dh(x(k))/ds of one output.
    slope: Vec<f64>,
    state: Vec<f64>,
    next: Vec<f64>,
    state_matrix: DMatrix<f64>,
    output_matrix: DMatrix<f64>,
    outputs: Vec<f64>,
    /// The variances of the noise of the outputs in a row.
    variances: Vec<f64>,
    work: Work<f64>,
}

impl<'a> Simulation<'a> {
    fn new(
        model: &'a GreyBox,
        experiment: &'a Experiment,
        z: &'a [f64],
        rows: Range<usize>,
        root: Vec<f64>,
    ) -> Self {
        let (n, m) = (model.states().len(), model.outputs().len());
        Self {
            model,
            experiment,
            z,
            root,
            matrix: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            slopes: DMatrix::zeros(n, n),
            moved: DMatrix::zeros(n, n),
            slope: vec![0.0; n],
            state: vec![0.0; n],
            next: vec![0.0; n],
            state_matrix: DMatrix::zeros(n, n),
            output_matrix: DMatrix::zeros(m, n),
            outputs: vec![0.0; rows.len() * m],
            variances: vec![0.0; m],
            rows,
            work: Work::new(),
        }
    }

    /// The sum of squares from a start, and the normal equations there if it is told by s; none where a number is not
    /// finite.
    fn run(&mut self, start: &[f64], s: Option<&DVector<f64>>) -> Option<f64> {
        let (n, m) = (self.model.states().len(), self.model.outputs().len());
        self.state.copy_from_slice(start);
        let mut cost = 0.0;
        if let Some(s) = s {
            cost = s.norm_squared();
            self.matrix.fill_with_identity();
            self.right.copy_from(s);
            self.right.neg_mut();
            self.slopes.as_mut_slice().copy_from_slice(&self.root);
        }
        for (place, row) in self.rows.clone().enumerate() {
            let steps = self.experiment.steps(row).filter(|_| place > 0);
            for (time, step) in steps {
                let input = self.experiment.drive(row - 1);
                let (next, matrix) = (&mut self.next, self.state_matrix.as_mut_slice());
                self.model.advance(&self.state, self.z, input, time, step, next, matrix, &mut self.work);
                std::mem::swap(&mut self.state, &mut self.next);
                if s.is_some() {
                    self.state_matrix.mul_to(&self.slopes, &mut self.moved);
                    std::mem::swap(&mut self.slopes, &mut self.moved);
                }
            }
            let (input, time) = (self.experiment.drive(row), self.experiment.times[row]);
            let outputs = &mut self.outputs[place * m..(place + 1) * m];
            let matrix = self.output_matrix.as_mut_slice();
            self.model.observe(&self.state, self.z, input, time, outputs, matrix, &mut self.work);
            if !self.state.iter().chain(&*outputs).all(|value| value.is_finite()) {
                return None;
            }
            let variances = &mut self.variances;
            self.model.measurement_variances(&self.state, self.z, input, time, variances, &mut self.work);
            for (output, (&measured, variance)) in
                self.experiment.output(row).iter().zip(&self.variances).enumerate()
            {
                if measured.is_nan() {
                    continue;
                }
                let error = measured - self.outputs[place * m + output];
                cost += error * error / variance;
                if s.is_none() {
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
        let known = s.is_none() || self.matrix.iter().chain(&self.right).all(|value| value.is_finite());
        (cost.is_finite() && known).then_some(cost)
    }
}
