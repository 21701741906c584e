//! Prediction errors of experiments that others hold, in other processes or on other machines.
//!
//! A search asks of the data, at each point, J = sum e^2, half its gradient, and the Gram matrix of psi = -de/dtheta: sums over
//! all samples, and so sums of what each holder of experiments finds in its own. The weights of the initial-condition responses of
//! an experiment are its own affair but for the steps that the search takes: where they stand goes out with the parameters, and how
//! they follow a step comes back with the sums. So a holder keeps nothing from one question to the next: who is lost is replaced,
//! and the same questions have the same answers. p^2 + n (p + 1) numbers for p parameters and n initial conditions go back.
//!
//! An answer has the normal equations at once, as nearly all points that a search tries are taken.

mod answer;
mod likelihood;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};

pub(crate) use likelihood::DistributedLikelihood;
use likelihood::LikelihoodSums;

use super::border::Border;
use super::experiments::{Experiments, PredictionErrors};
use super::polynomials::{Polynomials, Unusable};
use super::prediction_error::prediction_error;
use super::predictor::{InitialCondition, Predictor};
use super::uncertainty::{Autoregression, ErrorProducts, HIGHEST};
use super::{Estimate, Initial, Method, Monitor};
use crate::Error;
use crate::data::Record;
use crate::model::Orders;
use crate::optimize::Objective;

/// How many answers are kept.
const LATEST: usize = 16;

/// What is asked of the experiments that somebody holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question(pub(super) Asked);

/// The answer to a [`Question`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer(pub(super) Found);

impl Question {
    /// As bytes, for another process that runs the same version.
    ///
    /// # Errors
    /// [`Error::Data`] if it cannot be written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        written(self)
    }

    /// # Errors
    /// [`Error::Data`] if these are no question, or another version's.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        read(bytes)
    }
}

impl Answer {
    /// As bytes, for another process that runs the same version.
    ///
    /// # Errors
    /// [`Error::Data`] if it cannot be written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        written(self)
    }

    /// # Errors
    /// [`Error::Data`] if these are no answer, or another version's.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        read(bytes)
    }
}

fn written(message: &impl Serialize) -> Result<Vec<u8>, Error> {
    postcard::to_stdvec(message).map_err(|error| Error::data(format!("a message cannot be written: {error}")))
}

fn read<'m, M: Deserialize<'m>>(bytes: &'m [u8]) -> Result<M, Error> {
    postcard::from_bytes(bytes).map_err(|error| {
        Error::data(format!(
            "a message between processes cannot be read ({error}); run the same version of thetahat in all of them"
        ))
    })
}

/// Asks every holder its question: an answer for each, in their order.
pub type Ask<'a> = &'a dyn Fn(&[Question]) -> Result<Vec<Answer>, Error>;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum Asked {
    /// Some rows of the channels, and the energy of the output in all.
    Rows(Vec<Range<usize>>),
    /// Of the errors of a model.
    Errors(ModelErrors, AboutErrors),
    /// Of the likelihood of a model in equations: its value, and its slopes if these are wanted.
    Likelihood { z: Vec<f64>, slopes: bool },
}

/// The errors of a model as a function of the parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ModelErrors {
    orders: Orders,
    begin: InitialCondition,
    /// How many of the last inputs are ones.
    constants: usize,
}

/// Parameters, and the weights of the initial-condition responses one experiment after the other.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Point {
    parameters: Vec<f64>,
    free: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum AboutErrors {
    /// How many count, and how many initial conditions there are.
    Size,
    /// J and the normal equations.
    Sums(Point),
    /// The factor of psi.
    Factor(Point),
    /// What an autoregression of this order needs.
    Autoregression(Point, usize),
    /// The products of combinations of psi, filtered.
    Filtered { at: Point, weights: Vec<Vec<f64>>, monic: Vec<f64> },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum Found {
    Rows {
        channels: Vec<Vec<f64>>,
        energy: f64,
    },
    /// The samples that count; the sum of their outputs, and that of the squares.
    Size {
        samples: usize,
        free: Vec<usize>,
        output: [f64; 2],
    },
    /// None where the errors overflow.
    Sums(Option<Sums>),
    Factor(Option<Factor>),
    Autoregression(Option<ErrorProducts>),
    Filtered(Option<Vec<Vec<f64>>>),
    Likelihood(LikelihoodSums),
}

/// J and the normal equations at a point, the initial-condition responses taken out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Sums {
    cost: f64,
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// The diagonal of the Gram matrix before they were taken out.
    diagonal: Vec<f64>,
    free_gain: f64,
    /// For each experiment, the step of its weights for no change of the parameters, then for each of them.
    free_steps: Vec<f64>,
}

/// A triangular factor and what belongs to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Factor {
    triangle: Vec<f64>,
    rotated: Vec<f64>,
    residual_norm: f64,
    rows: usize,
}

/// Those who hold the data, and why one of them has no answer.
pub(crate) struct Holders<'a> {
    ask: Ask<'a>,
    count: usize,
    failed: RefCell<Option<Error>>,
    /// The latest questions with their answers: a search comes back to where it was.
    latest: RefCell<VecDeque<(Vec<Question>, Vec<Answer>)>>,
}

impl<'a> Holders<'a> {
    /// So many.
    pub(crate) fn new(ask: Ask<'a>, count: usize) -> Self {
        Self { ask, count, failed: RefCell::new(None), latest: RefCell::default() }
    }

    /// What made an answer fail, if one did: nothing that was found since then is of any worth.
    pub(crate) fn failure(&self) -> Option<Error> {
        self.failed.take()
    }

    /// The answers; none once one has failed.
    fn answers<T>(
        &self,
        question: impl Fn(usize) -> Asked,
        read: impl Fn(Found) -> Option<T>,
    ) -> Option<Vec<T>> {
        if self.failed.borrow().is_some() {
            return None;
        }
        let questions: Vec<Question> = (0..self.count).map(|holder| Question(question(holder))).collect();
        let other =
            || Error::data("an answer is to another question; ask with one version of thetahat alone");
        let known = self
            .latest
            .borrow()
            .iter()
            .find(|(asked, _)| *asked == questions)
            .map(|(_, found)| found.clone());
        let found = known.map_or_else(
            || {
                let found = (self.ask)(&questions)?;
                let mut latest = self.latest.borrow_mut();
                latest.truncate(LATEST - 1);
                latest.push_front((questions, found.clone()));
                Ok(found)
            },
            Ok,
        );
        let found = found.and_then(|answers| {
            let right = answers.len() == self.count;
            let read: Option<Vec<T>> = answers.into_iter().map(|answer| read(answer.0)).collect();
            read.filter(|_| right).ok_or_else(other)
        });
        match found {
            Ok(found) => Some(found),
            Err(error) => {
                *self.failed.borrow_mut() = Some(error);
                None
            }
        }
    }

    /// The root of the sum of squares of the output about its mean, over the samples that count.
    ///
    /// # Errors
    /// What made an answer fail.
    pub(crate) fn output_spread(&self, orders: &Orders, at_rest: bool) -> Result<f64, Error> {
        let begin = if at_rest { InitialCondition::Zero } else { InitialCondition::Unknown };
        let model = ModelErrors { orders: orders.clone(), begin, constants: 0 };
        let found = self.answers(
            |_| Asked::Errors(model.clone(), AboutErrors::Size),
            |found| {
                if let Found::Size { samples, output, .. } = found { Some((samples, output)) } else { None }
            },
        );
        let found = found.ok_or_else(|| self.failure().unwrap_or(Error::Interrupted))?;
        let [mut count, mut sum, mut squares] = [0.0; 3];
        for (samples, [own, own_squares]) in found {
            count += samples as f64;
            sum += own;
            squares += own_squares;
        }
        Ok((squares - sum * sum / count).max(0.0).sqrt())
    }

    /// Some rows of each holder, one channel after the other, the output last; and the energy of the output in all rows.
    ///
    /// # Errors
    /// What made an answer fail.
    pub(crate) fn rows(
        &self,
        rows: &[Vec<Range<usize>>],
        channels: usize,
    ) -> Result<(Vec<Vec<f64>>, f64), Error> {
        let question = |holder: usize| Asked::Rows(rows.get(holder).cloned().unwrap_or_default());
        let found = self.answers(question, |found| match found {
            Found::Rows { channels: own, energy } if own.len() == channels => Some((own, energy)),
            _ => None,
        });
        let found = found.ok_or_else(|| self.failure().unwrap_or(Error::Interrupted))?;
        let (mut joined, mut energy) = (vec![Vec::new(); channels], 0.0);
        for (own, more) in found {
            joined.iter_mut().zip(own).for_each(|(all, mut own)| all.append(&mut own));
            energy += more;
        }
        Ok((joined, energy))
    }
}

/// The data of experiments that others hold.
pub(crate) struct Distributed<'a> {
    holders: &'a Holders<'a>,
    /// Rows that are at hand, enough for starts.
    thin: Record<'a>,
    energy: f64,
    constants: usize,
}

impl<'a> Distributed<'a> {
    pub(crate) fn new(holders: &'a Holders<'a>, thin: Record<'a>, energy: f64) -> Self {
        Self { holders, thin, energy, constants: 0 }
    }
}

impl Experiments for Distributed<'_> {
    type Errors<'e>
        = DistributedErrors<'e>
    where
        Self: 'e;
    type Wider<'e>
        = Distributed<'e>
    where
        Self: 'e;

    fn record(&self) -> Option<&Record<'_>> {
        None
    }

    fn thinned(&self) -> Option<Record<'_>> {
        Some(self.thin.clone())
    }

    fn with_inputs<'e>(&'e self, signals: &'e [Vec<f64>]) -> Distributed<'e> {
        let Self { holders, energy, constants, .. } = *self;
        let thin = Record::with_inputs(&self.thin, signals);
        Distributed { holders, thin, energy, constants: constants + signals.len() }
    }

    fn check(&self, orders: &Orders) -> Result<(), Error> {
        self.thin.check(orders)
    }

    fn errors<'e>(&'e self, orders: &Orders, begin: InitialCondition) -> DistributedErrors<'e> {
        DistributedErrors::new(self, orders, begin)
    }

    fn estimate(
        &self,
        _: &[String],
        orders: &Orders,
        method: &Method,
        initial: Initial,
        monitor: Monitor<'_>,
    ) -> Result<Estimate, Error> {
        let found = match method {
            Method::PredictionError(search) if !orders.is_linear() => {
                prediction_error(self, orders, initial, search, monitor)
            }
            _ => Err(Error::argument("method", "experiments that others hold are fitted by a search")),
        };
        self.holders.failure().map_or(found, Err)
    }

    fn energy(&self) -> f64 {
        self.energy
    }

    /// Nothing: all rows of the experiments are of the fit.
    fn past(&self) -> &[usize] {
        &[0]
    }
}

/// The prediction errors of experiments that others hold.
pub(crate) struct DistributedErrors<'e> {
    holders: &'e Holders<'e>,
    model: ModelErrors,
    samples: usize,
    /// Of each holder, the initial conditions of its experiments.
    conditions: Vec<Vec<usize>>,
    polynomials: Polynomials,
    stability: Vec<f64>,
    border: Border,
    /// Where the errors were evaluated last, and what the holders said.
    parameters: Vec<f64>,
    evaluated: Vec<Vec<f64>>,
    last: Vec<Sums>,
    /// The weights to be tried next, and those of the current point.
    trial: Vec<Vec<f64>>,
    free: Vec<Vec<f64>>,
    free_steps: Vec<Vec<f64>>,
    matrix: Vec<f64>,
    right: Vec<f64>,
    diagonal: Vec<f64>,
}

impl<'e> DistributedErrors<'e> {
    fn new(data: &'e Distributed<'_>, orders: &Orders, begin: InitialCondition) -> Self {
        let (holders, parameters) = (data.holders, orders.parameters());
        let model = ModelErrors { orders: orders.clone(), begin, constants: data.constants };
        let sizes = holders.answers(
            |_| Asked::Errors(model.clone(), AboutErrors::Size),
            |found| if let Found::Size { samples, free, .. } = found { Some((samples, free)) } else { None },
        );
        let (samples, conditions): (Vec<usize>, Vec<Vec<usize>>) =
            sizes.unwrap_or_default().into_iter().unzip();
        let zeros: Vec<Vec<f64>> = conditions.iter().map(|own| vec![0.0; own.iter().sum()]).collect();
        Self {
            holders,
            model,
            samples: samples.iter().sum(),
            polynomials: Polynomials::new(orders, &vec![0.0; parameters]),
            stability: Vec::new(),
            border: Border::new(orders, false),
            parameters: vec![0.0; parameters],
            evaluated: zeros.clone(),
            last: Vec::new(),
            trial: zeros.clone(),
            free_steps: zeros.iter().map(|own| vec![0.0; own.len() * (parameters + 1)]).collect(),
            free: zeros,
            conditions,
            matrix: vec![0.0; parameters * parameters],
            right: vec![0.0; parameters],
            diagonal: vec![0.0; parameters],
        }
    }

    /// Answers about the errors where they were evaluated last.
    fn about<T>(
        &self,
        about: impl Fn(Point) -> AboutErrors,
        read: impl Fn(Found) -> Option<T>,
    ) -> Option<Vec<T>> {
        let point = |holder: usize| Point {
            parameters: self.parameters.clone(),
            free: self.evaluated.get(holder).cloned().unwrap_or_default(),
        };
        self.holders.answers(|holder| Asked::Errors(self.model.clone(), about(point(holder))), read)
    }

    fn products(&self, order: usize) -> Option<ErrorProducts> {
        let found = self.about(
            |at| AboutErrors::Autoregression(at, order),
            |found| if let Found::Autoregression(own) = found { Some(own) } else { None },
        )?;
        let mut found = found.into_iter();
        let mut sum = found.next()??;
        for own in found {
            sum.add(&own?);
        }
        Some(sum)
    }
}

impl Objective for DistributedErrors<'_> {
    type Refusal = Unusable;

    fn samples(&self) -> usize {
        self.samples
    }

    fn initial_conditions(&self) -> usize {
        self.conditions.iter().flatten().sum()
    }

    fn linear(&self) -> Range<usize> {
        let orders = &self.model.orders;
        0..orders.na + orders.nb.iter().sum::<usize>()
    }

    fn restart(&mut self) {
        self.free.iter_mut().chain(&mut self.trial).for_each(|own| own.fill(0.0));
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.polynomials.set(parameters);
        if !self.polynomials.are_stable(&mut self.stability) {
            return Err(Unusable::Unstable);
        }
        self.parameters.copy_from_slice(parameters);
        self.evaluated.clone_from(&self.trial);
        let sums = self.about(AboutErrors::Sums, |found| match found {
            Found::Sums(sums) => Some(sums),
            _ => None,
        });
        let sums: Option<Vec<Sums>> = sums.and_then(|sums| sums.into_iter().collect());
        self.last = sums.ok_or(Unusable::Overflow)?;
        let cost: f64 = self.last.iter().map(|sums| sums.cost).sum();
        if cost.is_finite() { Ok(cost) } else { Err(Unusable::Overflow) }
    }

    fn linearize(&mut self) -> Result<f64, Unusable> {
        self.free.clone_from(&self.trial);
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        self.diagonal.fill(0.0);
        let mut gain = 0.0;
        for (sums, steps) in self.last.iter().zip(&mut self.free_steps) {
            let add =
                |all: &mut [f64], own: &[f64]| all.iter_mut().zip(own).for_each(|(all, own)| *all += own);
            add(&mut self.matrix, &sums.matrix);
            add(&mut self.right, &sums.right);
            add(&mut self.diagonal, &sums.diagonal);
            steps.clone_from(&sums.free_steps);
            gain += sums.free_gain;
        }
        Ok(gain)
    }

    fn try_free(&mut self, step: &[f64]) {
        let parameters = self.right.len();
        let holders = self.conditions.iter().zip(&mut self.trial).zip(self.free.iter().zip(&self.free_steps));
        for ((conditions, trial), (free, steps)) in holders {
            let (mut first, mut steps) = (0, steps.as_slice());
            for &count in conditions {
                let (own, rest) = steps.split_at(count * (parameters + 1));
                steps = rest;
                for index in 0..count {
                    let moved = step.iter().enumerate().map(|(k, step)| step * own[(k + 1) * count + index]);
                    trial[first + index] = free[first + index] + own[index] - moved.sum::<f64>();
                }
                first += count;
            }
        }
    }

    fn keep_free(&mut self) {
        self.trial.clone_from(&self.free);
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

impl PredictionErrors for DistributedErrors<'_> {
    fn cancellation(&self) -> f64 {
        let size = self.right.len();
        let ratio = |k: usize| self.diagonal[k] / self.matrix[k * size + k];
        (0..size).map(ratio).fold(1.0, f64::max).sqrt()
    }

    fn factor(&self) -> Option<LeastSquares<f64, Dyn>> {
        let size = self.right.len();
        let found = self.about(AboutErrors::Factor, |found| match found {
            Found::Factor(factor) => Some(factor),
            _ => None,
        })?;
        let mut whole = LeastSquares::with_size(Dyn(size));
        for own in found {
            let Factor { triangle, rotated, residual_norm, rows } = own?;
            if triangle.len() != size * size || rotated.len() != size {
                return None;
            }
            let triangle = DMatrix::from_row_slice(size, size, &triangle);
            let own = LeastSquares::from_factor(&triangle, &DVector::from_vec(rotated), residual_norm, rows);
            whole.merge(&own.ok()?).ok()?;
        }
        Some(whole)
    }

    fn autoregression(&self, taken: usize) -> Option<Autoregression> {
        let mut found = self.products(HIGHEST)?;
        let highest = found.highest(taken);
        if highest < HIGHEST {
            found = self.products(highest)?;
        }
        Some(found.autoregression(taken))
    }

    /// That of the errors that are left: of so many samples what the fit has taken is nothing.
    fn restricted_autoregression(&self, taken: usize) -> Option<Autoregression> {
        self.autoregression(taken)
    }

    fn backward_filtered_products(&self, weights: &DMatrix<f64>, monic: &[f64]) -> Option<DMatrix<f64>> {
        let size = weights.nrows();
        let rows: Vec<Vec<f64>> = weights.row_iter().map(|row| row.iter().copied().collect()).collect();
        let found = self.about(
            |at| AboutErrors::Filtered { at, weights: rows.clone(), monic: monic.to_vec() },
            |found| if let Found::Filtered(own) = found { Some(own) } else { None },
        )?;
        let mut sum = DMatrix::zeros(size, size);
        for own in found {
            let own = own?;
            if own.len() != size || own.iter().any(|row| row.len() != size) {
                return None;
            }
            sum += DMatrix::from_fn(size, size, |i, j| own[i][j]);
        }
        Some(sum)
    }
}

impl Predictor<'_> {
    /// At a point; none where the errors overflow.
    fn stand_at(&mut self, at: &Point) -> Option<f64> {
        self.set_free(&at.free);
        let cost = self.evaluate(&at.parameters).ok()?;
        self.linearize();
        Some(cost)
    }
}
