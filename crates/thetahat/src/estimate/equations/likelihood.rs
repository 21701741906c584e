//! The criterion, its gradient and the information.
//!
//! With e and S of every scalar element that was measured:
//!
//! ```text
//! V(z)  = 1/2 sum (e^2/S + ln 2 pi S)
//! V_i   = sum (e e_i/S + (1 - e^2/S) S_i/(2 S))                      e_i = de/dz_i, S_i = dS/dz_i
//! I_ij  = sum (e_i e_j/S + S_i S_j/(2 S^2))
//! ```
//!
//! V is the negative logarithm of the likelihood if the innovations are Gaussian; I, what is expected of its Hessian at
//! the truth (Gupta and Mehra, Computational aspects of maximum likelihood estimation, IEEE Transactions on Automatic
//! Control 19, 1974; Segal and Weinstein, A new method for evaluating the log-likelihood gradient, the Hessian, and the
//! Fisher information matrix for linear dynamic systems, IEEE Transactions on Information Theory 35, 1989; Ljung,
//! System Identification, 2nd ed. 1999, sections 7.4 and 7.6).

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use thetahat_core::Dual;

use crate::model::GreyBox;
use crate::respond::equations::{Experiment, Failure, Predictor, reach, step, walk};

/// Derivatives that are computed together.
const LANE: usize = 4;

/// V of a model as a function of the variables z, wherever the logs are.
pub(crate) trait Likelihood {
    /// The elements that are measured in rows that count.
    fn measurements(&self) -> usize;

    /// V.
    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure>;

    /// Finds the slopes.
    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure>;

    /// Those where V was linearised last.
    fn slopes(&self) -> &Slopes;
}

/// What V does where it was linearised: sums over all elements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Slopes {
    /// The sum of e^2/S.
    pub(crate) squares: f64,
    /// V_i.
    pub(crate) gradient: Vec<f64>,
    /// I, row by row.
    pub(crate) information: Vec<f64>,
}

impl Slopes {
    pub(crate) fn zero(size: usize) -> Self {
        Self { squares: 0.0, gradient: vec![0.0; size], information: vec![0.0; size * size] }
    }

    fn clear(&mut self) {
        self.squares = 0.0;
        self.gradient.fill(0.0);
        self.information.fill(0.0);
    }

    /// Sums of these and of others, which are as many.
    pub(crate) fn add(&mut self, other: &Self) {
        let add =
            |all: &mut [f64], more: &[f64]| all.iter_mut().zip(more).for_each(|(all, more)| *all += more);
        self.squares += other.squares;
        add(&mut self.gradient, &other.gradient);
        add(&mut self.information, &other.information);
    }
}

/// V of a model on some logs, with the memory that it takes.
#[derive(Debug)]
pub(crate) struct LikelihoodObjective<'a> {
    model: &'a GreyBox,
    experiments: &'a [Experiment],
    /// The elements that are measured in rows that count.
    measurements: usize,
    plain: Predictor<f64>,
    lanes: Vec<Predictor<Dual<f64, LANE>>>,
    /// The parameters as the lanes see them: variables in one, constants in the others.
    variables: Vec<Vec<Dual<f64, LANE>>>,
    /// e_i and S_i.
    error_slopes: Vec<f64>,
    variance_slopes: Vec<f64>,
    slopes: Slopes,
}

impl<'a> LikelihoodObjective<'a> {
    pub(crate) fn new(model: &'a GreyBox, experiments: &'a [Experiment]) -> Self {
        let size = model.parameters().len();
        let lanes = size.div_ceil(LANE);
        let measurements = |experiment: &Experiment| -> usize {
            (0..model.outputs().len()).map(|output| experiment.measurements(output)).sum()
        };
        Self {
            model,
            experiments,
            measurements: experiments.iter().map(measurements).sum(),
            plain: Predictor::new(model),
            lanes: (0..lanes).map(|_| Predictor::new(model)).collect(),
            variables: vec![vec![Dual::from(0.0); size]; lanes],
            error_slopes: vec![0.0; size],
            variance_slopes: vec![0.0; size],
            slopes: Slopes::zero(size),
        }
    }
}

impl Likelihood for LikelihoodObjective<'_> {
    fn measurements(&self) -> usize {
        self.measurements
    }

    /// V. O(N (n^3 + m n^2)) and the model.
    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure> {
        let mut sum = 0.0;
        walk(self.model, self.experiments, &mut self.plain, z, |_, _, innovation| {
            sum += innovation.error * innovation.error / innovation.variance;
            sum += (TAU * innovation.variance).ln();
        })?;
        Ok(sum / 2.0)
    }

    /// V_i and I_ij for p parameters: p/4 times the filter in numbers of five parts, and N p^2. Slopes that are not
    /// finite are a failure too.
    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure> {
        for (lane, variables) in self.variables.iter_mut().enumerate() {
            for (index, (variable, &value)) in variables.iter_mut().zip(z).enumerate() {
                *variable = Dual::from(value);
                if index / LANE == lane {
                    variable.derivatives[index % LANE] = 1.0;
                }
            }
        }
        let size = self.slopes.gradient.len();
        self.slopes.clear();
        for (log, experiment) in self.experiments.iter().enumerate() {
            for (lane, variables) in self.lanes.iter_mut().zip(&self.variables) {
                lane.restart(self.model, variables);
            }
            for row in 0..experiment.rows() {
                let failure = Failure { log, row };
                if !experiment.counts(row) {
                    for (lane, variables) in self.lanes.iter_mut().zip(&self.variables) {
                        step(self.model, experiment, lane, variables, row, |_, _, _| {}).ok_or(failure)?;
                    }
                    continue;
                }
                for (lane, variables) in self.lanes.iter_mut().zip(&self.variables) {
                    reach(self.model, experiment, lane, variables, row);
                }
                for (index, &measured) in experiment.output(row).iter().enumerate() {
                    if measured.is_nan() {
                        continue;
                    }
                    let (mut error, mut variance) = (0.0, 0.0);
                    let slopes =
                        self.error_slopes.chunks_mut(LANE).zip(self.variance_slopes.chunks_mut(LANE));
                    for (lane, (by_error, by_variance)) in self.lanes.iter_mut().zip(slopes) {
                        let innovation = lane.absorb(index, measured).ok_or(failure)?;
                        (error, variance) = (innovation.error.value, innovation.variance.value);
                        by_error.copy_from_slice(&innovation.error.derivatives[..by_error.len()]);
                        by_variance.copy_from_slice(&innovation.variance.derivatives[..by_variance.len()]);
                    }
                    self.slopes.squares += error * error / variance;
                    let variance_weight = (1.0 - error * error / variance) / (2.0 * variance);
                    for i in 0..size {
                        let (e, s) = (self.error_slopes[i], self.variance_slopes[i]);
                        self.slopes.gradient[i] += error * e / variance + variance_weight * s;
                        let (by_error, by_variance) = (e / variance, s / (2.0 * variance * variance));
                        for j in 0..=i {
                            self.slopes.information[i * size + j] +=
                                by_error * self.error_slopes[j] + by_variance * self.variance_slopes[j];
                        }
                    }
                }
                // What is not a number stays in the sums.
                let sums = self.slopes.gradient.iter().chain(&self.slopes.information);
                if !sums.copied().all(f64::is_finite) {
                    return Err(failure);
                }
            }
        }
        for i in 0..size {
            for j in 0..i {
                self.slopes.information[j * size + i] = self.slopes.information[i * size + j];
            }
        }
        Ok(())
    }

    fn slopes(&self) -> &Slopes {
        &self.slopes
    }
}
