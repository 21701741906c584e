//! The sum of squared errors of free runs as what a search makes small.

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::Objective;

use super::machine::{Machine, Run};
use crate::model::symmetric_eigen;

/// It as a function of the parameters, and of x(0) of each run after them.
#[derive(Debug)]
pub(super) struct FreeRunErrors<'a> {
    machine: &'a Machine,
    runs: &'a [Run],
    samples: usize,
    theta: Vec<f64>,
    matrix: Vec<f64>,
    right: Vec<f64>,
    sums: Sums,
}

/// A run that grows without end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grows;

impl<'a> FreeRunErrors<'a> {
    pub(super) fn new(machine: &'a Machine, runs: &'a [Run]) -> Self {
        let size = machine.parameters() + machine.states * runs.len();
        Self {
            machine,
            runs,
            samples: measured(runs),
            theta: vec![0.0; size],
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
            sums: Sums::new(machine.parameters() + machine.states),
        }
    }
}

impl FreeRunErrors<'_> {
    /// How many directions of the parameters leave the errors as they are, to first order.
    pub(super) fn open_directions(&mut self, theta: &[f64]) -> usize {
        let (shared, all) = (self.machine.parameters(), theta.len());
        if self.evaluate(theta).is_err() || self.linearize().is_err() {
            return all;
        }
        let entry = |i: usize, j: usize| self.matrix[i * all + j];
        let size = |i: usize| entry(i, i).sqrt().max(f64::MIN_POSITIVE);
        let scaled = DMatrix::from_fn(shared, shared, |i, j| entry(i, j) / size(i) / size(j));
        let small = |(values, _): (DVector<f64>, _)| values.iter().filter(|value| **value < OPEN).count();
        symmetric_eigen(&scaled).map_or(all, small)
    }
}

/// An eigenvalue of the normal equations, scaled to ones on the diagonal, below which nothing is said about a
/// direction.
const OPEN: f64 = 1e-10;

/// How many values of the output were measured.
pub(super) fn measured(runs: &[Run]) -> usize {
    runs.iter().flat_map(|run| &run.output).filter(|value| value.is_finite()).count()
}

impl Objective for FreeRunErrors<'_> {
    type Refusal = Grows;

    fn samples(&self) -> usize {
        self.samples
    }

    fn evaluate(&mut self, theta: &[f64]) -> Result<f64, Grows> {
        self.theta.copy_from_slice(theta);
        let (shared, starts) = theta.split_at(self.machine.parameters());
        let mut cost = 0.0;
        for (run, start) in self.runs.iter().zip(starts.chunks_exact(self.machine.states)) {
            let error = |row: usize, y: f64| Some(run.output[row] - y).filter(|error| error.is_finite());
            let done = self.machine.run(shared, start, run, |row, _, _, y| {
                cost += error(row, y).map_or(0.0, |error| error * error);
            });
            if !done {
                return Err(Grows);
            }
        }
        Ok(cost)
    }

    /// O(N p^2) beside the derivatives.
    fn linearize(&mut self) -> Result<f64, Grows> {
        let (shared, n, all) = (self.machine.parameters(), self.machine.states, self.theta.len());
        let size = shared + n;
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        for (number, run) in self.runs.iter().enumerate() {
            let start = &self.theta[shared + number * n..][..n];
            let sums = &mut self.sums;
            sums.clear();
            let done = self.machine.slopes(&self.theta[..shared], start, run, |row, y, slopes| {
                let error = run.output[row] - y;
                if error.is_finite() {
                    sums.take(error, slopes);
                }
            });
            if !done {
                return Err(Grows);
            }
            // The parameters, and x(0) of this run.
            let place = |index: usize| if index < shared { index } else { index + number * n };
            for i in 0..size {
                self.right[place(i)] += sums.right[i];
                for j in i..size {
                    self.matrix[place(i) * all + place(j)] += sums.matrix[i * size + j];
                }
            }
        }
        for i in 0..all {
            for j in 0..i {
                self.matrix[i * all + j] = self.matrix[j * all + i];
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
}

/// The normal equations of one run, above the diagonal and on it.
#[derive(Debug)]
struct Sums {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Sums {
    fn new(size: usize) -> Self {
        Self { matrix: vec![0.0; size * size], right: vec![0.0; size] }
    }

    fn clear(&mut self) {
        self.matrix.fill(0.0);
        self.right.fill(0.0);
    }

    fn take(&mut self, error: f64, slopes: &[f64]) {
        let size = slopes.len();
        for (i, &slope) in slopes.iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
            self.right[i] += slope * error;
            let row = &mut self.matrix[i * size + i..(i + 1) * size];
            row.iter_mut().zip(&slopes[i..]).for_each(|(sum, other)| *sum += slope * other);
        }
    }
}
