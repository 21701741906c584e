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
use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::Dual;

use crate::model::GreyBox;
use crate::respond::equations::{Experiment, Failure, Innovation, Predictor, step, walk};

/// Derivatives that are computed together.
pub(crate) const LANE: usize = 4;
/// Rows that lanes go over before their innovations are added: these fit into a cache.
const BLOCK: usize = 1024;

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

    pub(crate) fn clear(&mut self) {
        self.squares = 0.0;
        self.gradient.fill(0.0);
        self.information.fill(0.0);
    }

    /// Adds an element: e and S, and e_i and S_i. Of I what is below the diagonal and on it.
    pub(crate) fn take(&mut self, (error, variance): (f64, f64), (by_error, by_variance): (&[f64], &[f64])) {
        self.squares += error * error / variance;
        let variance_weight = (1.0 - error * error / variance) / (2.0 * variance);
        let size = self.gradient.len();
        for (i, (&e, &s)) in by_error.iter().zip(by_variance).enumerate() {
            self.gradient[i] += error * e / variance + variance_weight * s;
            let (error_weight, variance_weight) = (e / variance, s / (2.0 * variance * variance));
            for j in 0..=i {
                self.information[i * size + j] +=
                    error_weight * by_error[j] + variance_weight * by_variance[j];
            }
        }
    }

    /// Whether all sums are numbers: what is not one stays in them.
    pub(crate) fn is_finite(&self) -> bool {
        self.gradient.iter().chain(&self.information).copied().all(f64::is_finite)
    }

    /// Writes what is above the diagonal of I from what is below.
    pub(crate) fn mirror(&mut self) {
        let size = self.gradient.len();
        for i in 0..size {
            for j in 0..i {
                self.information[j * size + i] = self.information[i * size + j];
            }
        }
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
    lanes: Vec<Lane>,
    /// e_i and S_i.
    error_slopes: Vec<f64>,
    variance_slopes: Vec<f64>,
    slopes: Slopes,
}

/// The filter with the derivatives by some parameters.
#[derive(Debug)]
struct Lane {
    predictor: Predictor<Dual<f64, LANE>>,
    /// All parameters, those of the lane as variables.
    variables: Vec<Dual<f64, LANE>>,
    /// The innovations of some rows that count, element after element.
    innovations: Vec<Innovation<Dual<f64, LANE>>>,
}

impl Lane {
    /// Goes on over some rows of an experiment.
    fn walk(
        &mut self,
        model: &GreyBox,
        (log, experiment): (usize, &Experiment),
        rows: Range<usize>,
    ) -> Result<(), Failure> {
        let Self { predictor, variables, innovations } = self;
        innovations.clear();
        for row in rows {
            let counts = experiment.counts(row);
            step(model, experiment, predictor, variables, row, |_, _, innovation| {
                if counts {
                    innovations.push(innovation);
                }
            })
            .ok_or(Failure { log, row })?;
        }
        Ok(())
    }
}

impl<'a> LikelihoodObjective<'a> {
    pub(crate) fn new(model: &'a GreyBox, experiments: &'a [Experiment]) -> Self {
        let size = model.parameters().len();
        let lane = |_| Lane {
            predictor: Predictor::new(model),
            variables: vec![Dual::from(0.0); size],
            innovations: Vec::new(),
        };
        let measurements = |experiment: &Experiment| -> usize {
            (0..model.outputs().len()).map(|output| experiment.measurements(output)).sum()
        };
        Self {
            model,
            experiments,
            measurements: experiments.iter().map(measurements).sum(),
            plain: Predictor::new(model),
            lanes: (0..size.div_ceil(LANE)).map(lane).collect(),
            error_slopes: vec![0.0; size],
            variance_slopes: vec![0.0; size],
            slopes: Slopes::zero(size),
        }
    }
}

impl LikelihoodObjective<'_> {
    /// Adds what the lanes have found in some rows.
    fn add(&mut self, log: usize, experiment: &Experiment, rows: Range<usize>) -> Result<(), Failure> {
        let mut element = 0;
        for row in rows.filter(|row| experiment.counts(*row)) {
            for _ in experiment.output(row).iter().filter(|measured| !measured.is_nan()) {
                let (mut error, mut variance) = (0.0, 0.0);
                let slopes = self.error_slopes.chunks_mut(LANE).zip(self.variance_slopes.chunks_mut(LANE));
                for (lane, (by_error, by_variance)) in self.lanes.iter().zip(slopes) {
                    let innovation = &lane.innovations[element];
                    (error, variance) = (innovation.error.value, innovation.variance.value);
                    by_error.copy_from_slice(&innovation.error.derivatives[..by_error.len()]);
                    by_variance.copy_from_slice(&innovation.variance.derivatives[..by_variance.len()]);
                }
                element += 1;
                self.slopes.take((error, variance), (&self.error_slopes, &self.variance_slopes));
            }
            if !self.slopes.is_finite() {
                return Err(Failure { log, row });
            }
        }
        Ok(())
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

    /// V_i and I_ij for p parameters: p/4 times the filter in numbers of five parts, side by side, and N p^2. Slopes
    /// that are not finite are a failure too. The sums are those of one thread.
    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure> {
        for (number, lane) in self.lanes.iter_mut().enumerate() {
            for (index, (variable, &value)) in lane.variables.iter_mut().zip(z).enumerate() {
                *variable = Dual::from(value);
                if index / LANE == number {
                    variable.derivatives[index % LANE] = 1.0;
                }
            }
        }
        self.slopes.clear();
        let model = self.model;
        for (log, experiment) in self.experiments.iter().enumerate() {
            self.lanes.iter_mut().for_each(|lane| lane.predictor.restart(model, &lane.variables));
            for first in (0..experiment.rows()).step_by(BLOCK) {
                let rows = first..experiment.rows().min(first + BLOCK);
                self.lanes
                    .par_iter_mut()
                    .try_for_each(|lane| lane.walk(model, (log, experiment), rows.clone()))?;
                self.add(log, experiment, rows)?;
            }
        }
        self.slopes.mirror();
        Ok(())
    }

    fn slopes(&self) -> &Slopes {
        &self.slopes
    }
}
