//! Training: a search for all numbers of a map, those of its functions too, and for the least errors of longer runs.

mod objective;
mod starts;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Deadline, Found, Monitor, Objective, Search, best_linear, lowest, search};

use self::objective::RunErrors;
pub(crate) use self::starts::Units;
use super::super::start::plant::inverse;
use super::{Chosen, Count, RunFigures, Samples, Solved, TermStep, TrainingOutcome, as_rows};
use crate::Error;
use crate::figures::short;
use crate::model::{Activation, Map, NonlinearArxModel, Parameter, is_covariance};
use crate::respond::Horizon;

/// Iterations one step ahead, and over windows, before those of longer runs.
const FIRST_ITERATIONS: usize = 50;
/// The samples of such a window.
const WINDOW: usize = 50;
/// Fewer samples need no windows.
const LEAST_WINDOWED: usize = 4000;
/// A cost of this fraction of the output's is nothing.
const NOTHING: f64 = 1e-24;

/// How a map is trained.
#[derive(Clone, Copy)]
pub(crate) struct Training<'p> {
    /// How far runs go from what was measured.
    pub(crate) horizon: Horizon,
    /// What the square of each number but the constant weighs, in samples; those that are tried.
    pub(crate) ridges: &'p [f64],
    pub(crate) search: &'p Search,
    pub(crate) monitor: Monitor<'p>,
}

/// A trained map.
#[derive(Debug, Clone)]
struct Trained {
    map: Map,
    found: Found,
    starts: Vec<Option<f64>>,
}

impl Samples<'_> {
    /// Trains functions of which the numbers are free: as many of them, and with the ridge, as `count` says. Of all
    /// starts that with the least cost is kept. Where `chosen_on` has other samples, these are compared there, and the
    /// chosen one is trained on all.
    ///
    /// # Errors
    /// [`Error::Undetermined`] for too few samples, or where no start leads anywhere;
    /// [`Error::Interrupted`].
    pub(crate) fn train(
        &self,
        units: Units,
        sizes: &[usize],
        training: Training<'_>,
        count: &Count,
        chosen_on: Option<&Self>,
    ) -> Result<(Chosen, Solved, TrainingOutcome), Error> {
        let deadline = Deadline::after(training.search.time_limit);
        let first = chosen_on.unwrap_or(self);
        let tried: Vec<(usize, f64)> =
            sizes.iter().flat_map(|size| training.ridges.iter().map(|ridge| (*size, *ridge))).collect();
        let largest = sizes.iter().map(|size| units.numbers(self.regressors(), *size)).max().unwrap_or(0);
        first.check_numbers(largest)?;
        let seed = training.search.seed;
        let draws = |samples: &Self, size: usize| -> Vec<Map> {
            let each = 0..=training.search.starts as u64;
            each.map(|start| units.draw(samples, size, seed, start)).collect()
        };
        let starts: Vec<(Map, f64)> = tried
            .iter()
            .flat_map(|(size, ridge)| draws(first, *size).into_iter().map(|map| (map, *ridge)))
            .collect();
        let from_each = |samples: &Self, starts: Vec<(Map, f64)>| {
            let each = starts.into_par_iter();
            each.map(|(map, ridge)| samples.train_from(map, ridge, training, deadline))
                .collect::<Result<Vec<_>, Error>>()
        };
        let found = from_each(first, starts)?;
        let trained: Vec<Option<Trained>> = found.chunks(training.search.starts + 1).map(best).collect();
        let mut steps = Vec::new();
        for (tried, trained) in tried.iter().zip(&trained) {
            steps.push(first.tried(units, *tried, trained.as_ref(), count)?);
        }
        let taken = count.best(&steps, 1, self.count());
        let (size, ridge) = tried[taken - 1];
        let mut chosen = trained.into_iter().nth(taken - 1).flatten();
        if let Some(own) = &chosen
            && chosen_on.is_some()
        {
            // It goes on from where it is with all samples, and from fresh starts.
            let fresh = draws(self, size).into_iter();
            let starts = std::iter::once(own.map.clone()).chain(fresh).map(|map| (map, ridge));
            chosen = best(&from_each(self, starts.collect())?);
        }
        let Some(trained) = chosen else {
            return Err(Error::undetermined(
                Vec::new(),
                "no start leads to a run that keeps within bounds; train for shorter runs (`focus`), take another `ridge`, or other lags",
            ));
        };
        let outcome = outcome(&trained, training);
        let solved = self.solved(&trained, ridge, training.horizon)?;
        Ok((Chosen { map: trained.map, steps, taken }, solved, outcome))
    }

    /// Trains the parameters of functions that are known, from those of the least errors one step ahead.
    ///
    /// # Errors
    /// As for [`train`](Self::train).
    pub(crate) fn train_parameters(
        &self,
        map: Map,
        training: Training<'_>,
    ) -> Result<(Solved, TrainingOutcome), Error> {
        self.check_numbers(map.parameters(self.regressors()))?;
        let deadline = Deadline::after(training.search.time_limit);
        let ridge = training.ridges.first().copied().unwrap_or(0.0);
        let found = self.train_from(map, ridge, training, deadline)?;
        let Some(trained) = best(&[found]) else {
            return Err(Error::undetermined(
                Vec::new(),
                "the free run grows without bound wherever the training starts; take fewer terms, or leave `focus` at prediction",
            ));
        };
        let outcome = outcome(&trained, training);
        Ok((self.solved(&trained, ridge, training.horizon)?, outcome))
    }

    /// Refuses more numbers than samples tell apart.
    fn check_numbers(&self, numbers: usize) -> Result<(), Error> {
        if numbers < self.count() {
            return Ok(());
        }
        Err(Error::undetermined(
            Vec::new(),
            format!(
                "{numbers} numbers are trained, and {} samples have all regressors; take fewer `units` or `terms`, fewer lags, or more rows",
                self.count()
            ),
        ))
    }

    /// Trains from one start: one step ahead, then over windows where samples are many, then over runs of the horizon.
    /// None where no run from there keeps within bounds.
    ///
    /// The parameters of the map are solved for at the start alone, and searched for with the others then. To solve for
    /// them after each step of the first stage, too (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973), took fewer
    /// steps and more time: as many starts came to the same optimum of the cascaded tanks, 3 to 34 % later with 2 to 8
    /// units, and of 65,000 samples 76 % later.
    fn train_from(
        &self,
        map: Map,
        ridge: f64,
        training: Training<'_>,
        deadline: Deadline,
    ) -> Result<Option<(Map, Found)>, Error> {
        let regressors = self.regressors();
        let linear = map.parameters(regressors);
        let smallest = NOTHING * self.rows.iter().map(|t| self.signals[0][*t].powi(2)).sum::<f64>();
        let mut numbers = vec![0.0; linear];
        numbers.extend(map.shape());
        let one = Horizon::ONE_STEP;
        let last = training.horizon;
        if best_linear(&mut RunErrors::new(self, &map, one, ridge), &mut numbers).is_err() {
            return Ok(None);
        }
        let windows = Horizon::Steps { steps: WINDOW };
        let is_long = match last {
            Horizon::Steps { steps } => steps > WINDOW,
            Horizon::FreeRun => true,
        };
        let mut stages = vec![last];
        if last != one {
            if is_long && self.count() > LEAST_WINDOWED {
                stages.insert(0, windows);
            }
            if numbers.len() > linear {
                stages.insert(0, one);
            }
        }
        let mut found = None;
        let mut at = 0;
        while let Some(stage) = stages.get(at).copied() {
            let mut runs = RunErrors::new(self, &map, stage, ridge);
            let most = if at + 1 < stages.len() {
                FIRST_ITERATIONS.min(training.search.max_iterations)
            } else {
                training.search.max_iterations
            };
            let options = Search { max_iterations: most, ..training.search.clone() };
            match search(&mut runs, &numbers, &options, smallest, deadline, training.monitor)? {
                Ok(own) => {
                    numbers.copy_from_slice(&own.parameters);
                    found = Some(own);
                    at += 1;
                }
                // A free run that is lost may be found from that of windows.
                Err(_) if is_long && stage == last && !stages.contains(&windows) => {
                    stages.insert(at, windows);
                }
                Err(_) => return Ok(None),
            }
        }
        Ok(found.map(|found| (map.with_shape(regressors, &numbers[linear..]), found)))
    }

    /// A row of the table of what was tried.
    fn tried(
        &self,
        units: Units,
        (size, ridge): (usize, f64),
        trained: Option<&Trained>,
        count: &Count,
    ) -> Result<TermStep, Error> {
        let with = if ridge > 0.0 { format!(", ridge {}", short(ridge)) } else { String::new() };
        let term = format!("{size} {}{with}", units.word(size));
        let parameters = units.numbers(self.regressors(), size);
        let Some(trained) = trained else {
            return Ok(TermStep {
                term,
                parameters,
                error_reduction: 0.0,
                aliases: Vec::new(),
                rmse: self.mean_square(&self.rows).sqrt(),
                free_run: None,
                held_out: None,
            });
        };
        let model = self.model(trained.map.clone(), self.named(trained));
        let mut ahead = RunErrors::new(self, &trained.map, Horizon::ONE_STEP, 0.0);
        let squares = ahead.evaluate(&trained.found.parameters).unwrap_or(f64::INFINITY);
        let squares = squares * self.scale.powi(2) / self.count() as f64;
        let held_out = match count {
            Count::HeldOut(rows) => Some(RunFigures::of(&model, self.log, rows)?),
            _ => None,
        };
        Ok(TermStep {
            term,
            parameters,
            error_reduction: 1.0 - squares / self.mean_square(&self.rows),
            aliases: Vec::new(),
            rmse: squares.sqrt(),
            free_run: Some(RunFigures::of(&model, self.log, &as_rows(&self.rows))?),
            held_out,
        })
    }

    /// The parameters of a trained map by their names.
    fn named(&self, trained: &Trained) -> Vec<Parameter> {
        let names = trained.map.names(&self.names());
        let each = names.into_iter().zip(&trained.found.parameters);
        each.map(|(name, value)| Parameter { name, value: *value, standard_error: None }).collect()
    }

    /// The model of trained numbers, with the covariance of Gauss and Newton, s^2 (G + R)^-1, where the map is smooth.
    fn solved(&self, trained: &Trained, ridge: f64, horizon: Horizon) -> Result<Solved, Error> {
        let numbers = &trained.found.parameters;
        let lost =
            |_| Error::data("the run of the trained map leaves the range of numbers; scale the signals");
        let mut runs = RunErrors::new(self, &trained.map, horizon, ridge);
        runs.evaluate(numbers).map_err(lost)?;
        let squares = runs.squares();
        let size = numbers.len();
        let degrees = self.count() - size;
        let smooth =
            !matches!(trained.map, Map::Network { activation: Activation::Relu | Activation::Step, .. });
        let variance = squares / degrees as f64;
        let covariance = (smooth && runs.linearize().is_ok())
            .then(|| DMatrix::from_row_slice(size, size, runs.matrix()))
            .and_then(|matrix| {
                let squares: Vec<f64> = matrix.diagonal().iter().copied().collect();
                inverse(&matrix, [squares.clone(), squares])
            })
            .map(|inverse| {
                let row = |i: usize| inverse.row(i).iter().map(|entry| entry * variance).collect();
                (0..size).map(row).collect::<Vec<Vec<f64>>>()
            })
            .filter(|rows| is_covariance(rows));
        let mut ahead = RunErrors::new(self, &trained.map, Horizon::ONE_STEP, 0.0);
        let left = ahead.evaluate(numbers).map_err(lost)?;
        let mut parameters = self.named(trained);
        for (place, parameter) in parameters.iter_mut().enumerate() {
            parameter.standard_error = covariance.as_ref().map(|rows| rows[place][place].sqrt());
        }
        let scale = self.scale;
        Ok(Solved {
            mse: left * scale * scale / self.count() as f64,
            condition: None,
            model: NonlinearArxModel {
                noise_covariance: vec![vec![left / degrees as f64 * scale * scale]],
                degrees_of_freedom: Some(degrees),
                covariance,
                ..self.model(trained.map.clone(), parameters)
            },
        })
    }
}

/// The start with the least cost, and the cost of each.
fn best(found: &[Option<(Map, Found)>]) -> Option<Trained> {
    let starts = found.iter().map(|found| found.as_ref().map(|(_, found)| found.cost())).collect();
    let least = lowest(found.iter().map(|found| found.as_ref().map(|(_, found)| found)))?;
    let (map, found) = found[least].clone()?;
    Some(Trained { map, found, starts })
}

fn outcome(trained: &Trained, training: Training<'_>) -> TrainingOutcome {
    let Trained { found, starts, .. } = trained;
    TrainingOutcome {
        horizon: training.horizon,
        algorithm: training.search.algorithm,
        tolerance: training.search.tolerance,
        seed: training.search.seed,
        cost: found.cost(),
        gradient_norm: found.gradient_norm,
        iterations: found.costs.len() - 1,
        stopped: found.stopped,
        starts: starts.clone(),
    }
}
