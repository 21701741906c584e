//! The exact likelihood of AR, ARMA, ARX and ARMAX models, through missing outputs.
//!
//! ```text
//! y = x + z,   A x = sum_j B_j u_j,   A z = C e,   e Gaussian and white
//! ```
//!
//! z is stationary, and no sample of it is known or left out: its likelihood is that of the Kalman filter that begins
//! with the stationary covariance and goes on through missing values (`kalman`; Harvey, Forecasting, Structural Time
//! Series Models and the Kalman Filter, 1989, sections 3.3 and 3.4). With innovations v of variance f var e over the N
//! outputs that were measured, and var e at its best, S/N with S = sum v^2/f,
//!
//! ```text
//! -2 ln L = N (ln 2 pi + 1) + N ln(S/N) + sum ln f
//! ```
//!
//! What is minimised is S exp(sum ln f/N), which is S where f = 1: by Fisher scoring with exact derivatives
//! (`likelihood`), in the search of all other estimates, from the least sum of squared errors, without missing outputs
//! or with lines drawn through them.
//!
//! x is no process: inputs are known. With `Initial::Zero` it begins at rest with the segment. With `Initial::Estimate`
//! the impulses into 1/A that stand for its past are estimated: na of them where the nb + nk - 1 inputs before the
//! segment were measured, max(na, nb + nk - 1) where none was. Auto estimates them where rows stand before a segment,
//! or where they are worth it, N ln(cost_zero/cost_estimate) > n ln N. A constant and a trend have always been there: x
//! is their line.
//!
//! A process with a root of A on the unit circle has no stationary covariance, and the likelihood goes to zero there: A
//! stays stable, and an integrator comes out as a slow pole.
//!
//! The covariance of the parameters is the inverse of their information, with var e = S/(N - p - n).

mod kalman;
mod likelihood;
#[cfg(test)]
mod tests;

use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{ComplexField, DVector};
use thetahat_numerics::optimize::{Deadline, Found, Monitor, Objective, Search, Stopped, best_free, search};

use super::arx::{out_of_range, rows, signals};
use super::outcome::{SearchOutcome, StartOutcome, search_outcome};
use super::polynomials::Polynomials;
use super::prediction_error::{ON_CIRCLE, flat, prediction_error, told};
use super::thinning::{energy, filled};
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::{Record, measured};
use crate::model::{
    Orders, Structure,
    polynomial::{multiply_out, roots},
};
use crate::respond::{NOTHING_LEFT, are_worth};
use likelihood::{InitialCondition, Likelihood};

/// Starts have roots of A and C inside this circle.
const INSIDE: f64 = 0.99;
/// How often a search goes on from there.
const AGAIN: usize = 3;

/// How an estimate of largest exact likelihood was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LikelihoodOutcome {
    /// ln L, the logarithm of the likelihood of all measured outputs; none where the model fits them without an error.
    pub log_likelihood: Option<f64>,
    /// The search, whose costs are S/N exp(sum ln f/N): the variance of e times the geometric mean of f.
    pub search: SearchOutcome,
}

impl LikelihoodOutcome {
    /// The mean of e^2 of a conditional fit with the same likelihood, of which criteria are made.
    pub(crate) fn cost(&self) -> Option<f64> {
        self.search.costs.last().copied()
    }
}

/// Fits A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + C(q) e(t) by its exact likelihood. The last inputs, `lines` of them,
/// are those of a constant and a trend.
pub(super) fn exact(
    record: &Record<'_>,
    lines: usize,
    orders: &Orders,
    initial: Initial,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    let driven = orders.nb.iter().take(orders.inputs() - lines).any(|&nb| nb > 0);
    check(orders, driven, initial)?;
    options.check(&orders.names())?;
    signals(record, orders)?;
    let energy = energy(record);
    if !energy.is_normal() && energy != 0.0 {
        return Err(out_of_range());
    }
    let job = Job {
        record,
        orders,
        lines,
        options,
        smallest: NOTHING_LEFT * energy,
        started: Instant::now(),
        deadline: Deadline::after(options.time_limit),
        monitor,
    };
    let begin =
        if driven && initial != Initial::Zero { InitialCondition::Free } else { InitialCondition::Rest };
    let widest = Likelihood::new(record, orders, lines, begin);
    if initial != Initial::Auto || widest.initial_conditions() == 0 {
        enough(&widest, orders)?;
    } else {
        enough(&Likelihood::new(record, orders, lines, InitialCondition::Rest), orders)?;
    }
    let starts = job.starts()?;
    let in_the_middle = record.past.iter().any(|past| *past > 0);
    let reached = if initial == Initial::Auto && begin == InitialCondition::Free && !in_the_middle {
        job.choose(&starts)?
    } else {
        let found = job.best(begin, &starts)?;
        found.ok_or_else(|| hopeless(orders))?
    };
    job.finish(reached)
}

/// As [`beside`](super::prediction_error::beside) of an estimate of least squared errors: `lines` of the inputs are a
/// constant and a trend.
pub(super) fn beside(
    record: &Record<'_>,
    lines: usize,
    orders: &Orders,
    estimate: &Estimate,
    parameters: &[f64],
) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
    let begin =
        if estimate.initial() == Initial::Zero { InitialCondition::Rest } else { InitialCondition::Free };
    let mut likelihood = Likelihood::new(record, orders, lines, begin);
    let cost = best_free(&mut likelihood, parameters).ok()?;
    likelihood.linearize().ok()?;
    let (inverse, _) = likelihood.inverse()?;
    let step = &inverse * DVector::from_column_slice(likelihood.right());
    let covariance = inverse * (estimate.noise_variance() * cost / likelihood.squares());
    Some((rows(&covariance), step.as_slice().to_vec()))
}

fn check(orders: &Orders, driven: bool, initial: Initial) -> Result<(), Error> {
    let structure = orders.structure();
    if !matches!(structure, Structure::Ar | Structure::Arma | Structure::Arx | Structure::Armax) {
        return Err(Error::argument(
            "likelihood",
            format!(
                "exact is for ar, arma, arx and armax, A y = B u + C e; this model, {orders}, has D or F: leave it out, or \
                 leave D and F out"
            ),
        ));
    }
    match initial {
        Initial::Drop => Err(Error::argument(
            "initial",
            "drop leaves samples out, and the exact likelihood is that of all of them; use auto, zero or estimate",
        )),
        Initial::Estimate if !driven => Err(Error::argument(
            "initial",
            "of a model without inputs the exact likelihood has nothing to estimate before the first sample; use auto",
        )),
        _ => Ok(()),
    }
}

/// There must be more measured outputs than parameters and initial conditions.
fn enough(likelihood: &Likelihood<'_>, orders: &Orders) -> Result<(), Error> {
    let (parameters, conditions) = (orders.parameters(), likelihood.initial_conditions());
    if likelihood.samples() > parameters + conditions {
        return Ok(());
    }
    Err(Error::undetermined(
        orders.names(),
        format!(
            "too few rows for the orders: {parameters} parameters and {conditions} initial conditions need more measured \
             outputs than that, and there are {}; give more rows, or lower the orders",
            likelihood.samples()
        ),
    ))
}

fn hopeless(orders: &Orders) -> Error {
    Error::undetermined(
        orders.names(),
        "no start of the search has a finite likelihood; scale the channels towards one, or lower the orders",
    )
}

/// What all searches of an estimate share.
struct Job<'j, 'r> {
    record: &'j Record<'r>,
    orders: &'j Orders,
    lines: usize,
    options: &'j Search,
    smallest: f64,
    started: Instant,
    deadline: Deadline,
    monitor: Monitor<'j>,
}

/// Where a search has ended. The likelihood stands there.
struct Reached<'r> {
    likelihood: Likelihood<'r>,
    found: Found,
    begin: InitialCondition,
    starts: Vec<StartOutcome>,
}

impl<'r> Job<'_, 'r> {
    /// Parameters to start from, by name: those of least squared errors over what follows on itself without a missing
    /// output, and with lines drawn through missing ones.
    fn starts(&self) -> Result<Vec<(&'static str, Vec<f64>)>, Error> {
        let record = self.record;
        let runs: Vec<_> =
            record.segments.iter().flat_map(|segment| measured(record.output, segment)).collect();
        let holes = runs.len() != record.segments.len() || runs.iter().ne(&record.segments);
        let mut starts = Vec::new();
        let mut refused = None;
        let mut add = |name: &'static str, record: &Record<'_>| {
            match self.conditional(record) {
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(error) => refused = refused.take().or(Some(error)),
                Ok(parameters) => starts.push((name, parameters)),
            }
            Ok(())
        };
        let past = vec![0; runs.len()];
        let inputs = record.inputs.clone();
        add("conditional", &Record { output: record.output, inputs, segments: runs, past })?;
        if holes {
            filled(record, |record| add("conditional-filled", record))?;
        }
        if let Some(initial) = &self.options.initial_parameters {
            starts.push(("initial-parameters", initial.clone()));
        }
        match refused {
            Some(error) if starts.is_empty() => Err(error),
            _ => Ok(starts),
        }
    }

    /// The parameters of least squared errors, with A and C made stable.
    fn conditional(&self, record: &Record<'_>) -> Result<Vec<f64>, Error> {
        let mut options = self.options.clone();
        options.time_limit = options.time_limit.map(|limit| limit.saturating_sub(self.started.elapsed()));
        let found = prediction_error(record, self.orders, Initial::Auto, &options, self.monitor)?;
        let mut polynomials = Polynomials::new(self.orders, found.parameters());
        drawn_in(&mut polynomials.a);
        drawn_in(&mut polynomials.c);
        Ok(polynomials.parameters())
    }

    /// The best that searches from these starts find.
    fn best(
        &self,
        begin: InitialCondition,
        starts: &[(&'static str, Vec<f64>)],
    ) -> Result<Option<Reached<'r>>, Error> {
        let mut best: Option<Reached<'r>> = None;
        let mut outcomes = Vec::new();
        let mut winner = 0;
        for (number, (name, start)) in starts.iter().enumerate() {
            let mut likelihood = Likelihood::new(self.record, self.orders, self.lines, begin);
            let samples = likelihood.samples() as f64;
            let found = self.search(&mut likelihood, start)?;
            outcomes.push(StartOutcome {
                name: (*name).to_owned(),
                cost: found.as_ref().map(|found| found.costs[0] / samples),
                reached: found.as_ref().map(|found| found.cost() / samples),
            });
            if let Some(found) = found
                && best.as_ref().is_none_or(|best| found.cost() < best.found.cost())
            {
                winner = number;
                best = Some(Reached { likelihood, found, begin, starts: Vec::new() });
            }
        }
        outcomes.swap(0, winner);
        Ok(best.map(|best| Reached { starts: outcomes, ..best }))
    }

    /// A search that ends at the boundary of stability goes on from inside of it as long as that leads below.
    fn search(&self, likelihood: &mut Likelihood<'r>, start: &[f64]) -> Result<Option<Found>, Error> {
        let mut search = |start: &[f64]| {
            search(likelihood, start, self.options, self.smallest, self.deadline, self.monitor)
        };
        let Ok(mut found) = search(start)? else { return Ok(None) };
        for _ in 0..AGAIN {
            if found.stopped != Stopped::NoDescent || self.deadline.is_over() {
                break;
            }
            let mut polynomials = Polynomials::new(self.orders, &found.parameters);
            drawn_in(&mut polynomials.a);
            drawn_in(&mut polynomials.c);
            match search(&polynomials.parameters())? {
                Ok(again) if again.cost() < found.cost() => {
                    let costs = [&found.costs[..], &[again.cost()]].concat();
                    found = Found { costs, ..again };
                }
                _ => {
                    let _ = best_free(likelihood, &found.parameters);
                    break;
                }
            }
        }
        Ok(Some(found))
    }

    /// At rest, or from a state that is estimated where that is worth it.
    fn choose(&self, starts: &[(&'static str, Vec<f64>)]) -> Result<Reached<'r>, Error> {
        let rest = self.best(InitialCondition::Rest, starts)?;
        let widest = Likelihood::new(self.record, self.orders, self.lines, InitialCondition::Free);
        let (samples, more) = (widest.samples(), widest.initial_conditions());
        if more == 0 || samples <= self.orders.parameters() + more {
            return rest.ok_or_else(|| hopeless(self.orders));
        }
        let mut from = starts.to_vec();
        from.extend(rest.iter().map(|rest| ("rest", rest.found.parameters.clone())));
        let free = self.best(InitialCondition::Free, &from)?;
        match (rest, free) {
            (Some(rest), Some(free)) => {
                let count = rest.likelihood.samples() as f64;
                let (without, with) = (rest.found.cost() / count, free.found.cost() / samples as f64);
                let worth = are_worth(samples, without, with, more, self.smallest / count);
                Ok(if worth { free } else { rest })
            }
            (rest, free) => rest.or(free).ok_or_else(|| hopeless(self.orders)),
        }
    }

    /// The estimate of a search.
    fn finish(&self, reached: Reached<'_>) -> Result<Estimate, Error> {
        let Reached { mut likelihood, found, begin, starts } = reached;
        let found = told(self.orders, found);
        // Steps that were tried last may have left it elsewhere. It has normal equations.
        let _ = likelihood.linearize();
        let (size, samples) = (found.parameters.len(), likelihood.samples());
        let left = (samples - size - likelihood.initial_conditions()) as f64;
        let cost = found.cost();
        let known = likelihood.inverse();
        let settled =
            matches!(found.stopped, Stopped::Converged | Stopped::NoDescent) && !found.stability_bound;
        if known.is_none() && settled {
            return Err(flat(self.orders, &found.parameters));
        }
        let (covariance, condition) = known.unzip();
        let squares = likelihood.squares();
        let mean = cost / samples as f64;
        let count = samples as f64;
        let log_likelihood = (mean > 0.0).then(|| -0.5 * count * ((std::f64::consts::TAU * mean).ln() + 1.0));
        let outcome = LikelihoodOutcome {
            log_likelihood,
            search: search_outcome(self.options, &found, &likelihood, starts),
        };
        Ok(Estimate {
            covariance: covariance.map(|covariance| rows(&(covariance * (cost / left)))),
            noise_variance: squares / left,
            samples,
            mse: squares / count,
            condition,
            initial: if begin == InitialCondition::Rest { Initial::Zero } else { Initial::Estimate },
            procedure: Procedure::ExactLikelihood(outcome),
            parameters: found.parameters,
        })
    }
}

/// Moves the roots of a polynomial that are on the unit circle or outside onto a circle inside of it.
fn drawn_in(monic: &mut [f64]) {
    let Some(found) = roots(monic) else { return };
    if found.iter().all(|root| root.modulus() < 1.0 - ON_CIRCLE) {
        return;
    }
    let mut product = Vec::new();
    multiply_out(found.iter().map(|root| *root * (INSIDE / root.modulus()).min(1.0)), &mut product);
    monic.iter_mut().zip(&product).for_each(|(value, product)| *value = product.re);
}
