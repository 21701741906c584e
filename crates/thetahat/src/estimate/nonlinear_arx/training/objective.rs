//! The errors of runs of a map as a cost of all its numbers.

use std::ops::Range;

use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};
use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::product;

use super::super::Samples;
use crate::model::{Evaluator, Map};
use crate::respond::Horizon;

/// Samples whose slopes are summed at once.
const BLOCK: usize = 256;
/// An error of so many times the scale of the output: the run has left the range of sense.
const LOST: f64 = 1e4;

/// Why numbers have no cost: a run of theirs grows without bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lost;

/// The cost of the numbers theta of a map: its parameters, and after them those of its functions,
///
/// ```text
/// J = sum_k e(k)^2 + sum_j r_j theta_j^2,   e(k) = y(k) - g(z(k), theta)
/// ```
///
/// over runs that begin at what was measured: within a run z has outputs of the run itself. With s = dg(z(k))/dtheta
/// along it,
///
/// ```text
/// s(k) = dg/dtheta + sum_i dg/dy(k-i) s(k-i),   s = 0 before the run
/// ```
///
/// (Williams and Zipser, Neural Computation 1, 1989; Narendra and Parthasarathy, IEEE Trans. Neural Networks 1, 1990),
/// g = s'e and G = s's. Runs of one sample are errors one step ahead, a run of all samples is the free run.
///
/// Cost of an evaluation: g of each sample; of the normal equations N (p^2 + 2 na p) flops, of which the first are a
/// product of matrices. Nothing allocates but what products of matrices keep.
pub(super) struct RunErrors<'s> {
    y: &'s [f64],
    /// For each regressor its signal, its lag, and whether it is the output.
    taps: Vec<(&'s [f64], usize, bool)>,
    /// The rows of each run.
    runs: Vec<Range<usize>>,
    samples: usize,
    /// The longest lag of the output.
    lags: usize,
    evaluator: Evaluator,
    /// Parameters of the map, and all numbers.
    linear: usize,
    all: Vec<f64>,
    /// What the square of each number weighs.
    penalty: Vec<f64>,
    /// g at each sample, run after run.
    said: Vec<f64>,
    z: Vec<f64>,
    slopes: Vec<f64>,
    /// s of the samples of a block, column after column, after those of the last ones before it; and their errors.
    columns: Vec<f64>,
    errors: Vec<f64>,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl<'s> RunErrors<'s> {
    /// Runs of a map over samples, each as long as the horizon.
    pub(super) fn new(samples: &'s Samples<'_>, map: &Map, horizon: Horizon, ridge: f64) -> Self {
        let linear = map.parameters(samples.regressors());
        let size = linear + map.shape().len();
        let taps: Vec<(&[f64], usize, bool)> = samples
            .taps
            .iter()
            .map(|(source, lag)| (&*samples.signals[*source], *lag, *source == 0))
            .collect();
        let lags = match horizon {
            Horizon::ONE_STEP => 0,
            _ => taps.iter().filter(|tap| tap.2).map(|tap| tap.1).max().unwrap_or(0),
        };
        let constant = map.names(&samples.names()).iter().position(|name| name == "1");
        let mut penalty = vec![ridge; size];
        if let Some(constant) = constant {
            penalty[constant] = 0.0;
        }
        Self {
            y: &samples.signals[0],
            runs: runs(&samples.rows, horizon),
            samples: samples.rows.len(),
            lags,
            evaluator: Evaluator::new(map, vec![0.0; linear]),
            linear,
            all: vec![0.0; size],
            penalty,
            said: vec![0.0; samples.rows.len()],
            z: vec![0.0; taps.len()],
            slopes: vec![0.0; taps.len()],
            columns: vec![0.0; size * (lags + BLOCK)],
            errors: vec![0.0; BLOCK],
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
            taps,
        }
    }

    /// The sum of squared errors at the numbers evaluated last.
    pub(super) fn squares(&self) -> f64 {
        let rows = self.runs.iter().cloned().flatten();
        rows.zip(&self.said).map(|(t, said)| (self.y[t] - said).powi(2)).sum()
    }

    /// z at row t of a run that began at row `first`, where g of row t stands at `place`.
    #[inline]
    fn read(
        z: &mut [f64],
        taps: &[(&[f64], usize, bool)],
        said: &[f64],
        first: usize,
        t: usize,
        place: usize,
    ) {
        for (z, (signal, lag, own)) in z.iter_mut().zip(taps) {
            *z = if *own && t - lag >= first { said[place - lag] } else { signal[t - lag] };
        }
    }

    /// Adds the products of the first `count` columns of a block to the normal equations, and moves the last columns to
    /// its front.
    fn add(&mut self, count: usize) {
        let size = self.all.len();
        let own = &self.columns[self.lags * size..(self.lags + count) * size];
        let columns = MatRef::from_column_major_slice(own, size, count);
        // The lower triangle of a matrix by columns is the upper one by rows.
        let matrix = MatMut::from_column_major_slice_mut(&mut self.matrix, size, size);
        matmul(
            matrix,
            BlockStructure::TriangularLower,
            Accum::Add,
            columns,
            BlockStructure::Rectangular,
            columns.transpose(),
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
        for (column, error) in own.chunks_exact(size).zip(&self.errors) {
            self.right.iter_mut().zip(column).for_each(|(right, s)| *right += s * error);
        }
        self.columns.copy_within(count * size..(count + self.lags) * size, 0);
    }
}

impl Objective for RunErrors<'_> {
    type Refusal = Lost;

    fn samples(&self) -> usize {
        self.samples
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Lost> {
        self.all.copy_from_slice(parameters);
        self.evaluator.assign(parameters);
        let Self { y, taps, runs, evaluator, said, z, .. } = self;
        let (mut cost, mut place) = (0.0, 0);
        for run in runs.iter() {
            for t in run.clone() {
                Self::read(z, taps, said, run.start, t, place);
                said[place] = evaluator.value(z);
                let error = y[t] - said[place];
                // One that is no number is lost, too.
                if error.is_nan() || error.abs() > LOST {
                    return Err(Lost);
                }
                cost += error * error;
                place += 1;
            }
        }
        let penalty = self.penalty.iter().zip(parameters).map(|(penalty, value)| penalty * value * value);
        let cost = cost + penalty.sum::<f64>();
        if cost.is_finite() { Ok(cost) } else { Err(Lost) }
    }

    fn linearize(&mut self) -> Result<f64, Lost> {
        let size = self.all.len();
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        let (mut place, mut count) = (0, 0);
        for index in 0..self.runs.len() {
            let run = self.runs[index].clone();
            for t in run.clone() {
                Self::read(&mut self.z, &self.taps, &self.said, run.start, t, place);
                let at = self.lags + count;
                let (before, own) = self.columns.split_at_mut(at * size);
                let own = &mut own[..size];
                self.evaluator.gradient(&self.z, own);
                let since = (t - run.start).min(self.lags);
                if since > 0 {
                    self.evaluator.slopes_of_gradient(&self.z, own, &mut self.slopes);
                    for ((_, lag, _), slope) in
                        self.taps.iter().zip(&self.slopes).filter(|((_, lag, own), _)| *own && *lag <= since)
                    {
                        let earlier = &before[(at - lag) * size..][..size];
                        own.iter_mut().zip(earlier).for_each(|(own, earlier)| *own += slope * earlier);
                    }
                }
                self.errors[count] = self.y[t] - self.said[place];
                place += 1;
                count += 1;
                if count == BLOCK {
                    self.add(count);
                    count = 0;
                }
            }
        }
        if count > 0 {
            self.add(count);
        }
        for row in 0..size {
            for column in row + 1..size {
                self.matrix[column * size + row] = self.matrix[row * size + column];
            }
            self.matrix[row * size + row] += self.penalty[row];
            self.right[row] -= self.penalty[row] * self.all[row];
        }
        let sound = product(&self.right, &self.right).is_finite();
        if sound && self.matrix.iter().all(|value| value.is_finite()) { Ok(0.0) } else { Err(Lost) }
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn linear(&self) -> Range<usize> {
        0..self.linear
    }
}

/// Segments of samples without a gap, each cut into runs of the horizon.
fn runs(rows: &[usize], horizon: Horizon) -> Vec<Range<usize>> {
    let longest = match horizon {
        Horizon::Steps { steps } => steps.max(1),
        Horizon::FreeRun => usize::MAX,
    };
    let mut runs: Vec<Range<usize>> = Vec::new();
    for &t in rows {
        match runs.last_mut() {
            Some(run) if run.end == t && run.len() < longest => run.end += 1,
            _ => runs.push(t..t + 1),
        }
    }
    runs
}
