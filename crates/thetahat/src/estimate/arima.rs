//! The exact likelihood of seasonal ARIMA models.
//!
//! ```text
//! y(t) = sum_j beta_j x_j(t) + z(t),   A(q) Delta(q) z(t) = C(q) e(t),   e Gaussian and white
//! A = phi(q) Phi(q^s),   C = theta(q) Theta(q^s),   Delta = (1 - q^-1)^d (1 - q^-s)^D
//! ```
//!
//! The x_j are a constant, a line and inputs. The differences w = Delta z are stationary, and their likelihood begins
//! with the stationary covariance; through missing outputs it is that of z given the first values that differencing
//! needs. With innovations v of variance f var e over N values, and var e at its best, S/N with S = sum v^2/f,
//!
//! ```text
//! -2 ln L = N (ln 2 pi + 1) + N ln(S/N) + sum ln f
//! ```
//!
//! What is minimised is S exp(sum ln f/N), by Fisher scoring with exact derivatives by the parameters of the factors
//! (`likelihood`), from those of Hannan and Rissanen and from their mirror image (`start`), and from small ones where
//! that ends on the unit circle. Each factor stays stable and invertible: its roots are inside the unit circle.
//!
//! The covariance of the parameters is the inverse of their information, the observed one. sigma^2 is S/N, the estimate
//! of largest likelihood.
//!
//! Box and Jenkins, Time Series Analysis: Forecasting and Control, 1970, chapters 7 and 9; Harvey, Forecasting,
//! Structural Time Series Models and the Kalman Filter, 1989, sections 3.3 and 3.4.

mod likelihood;
mod start;
#[cfg(test)]
mod tests;

use std::ops::Range;

use thetahat_core::nalgebra::ComplexField;
use thetahat_numerics::optimize::{Deadline, Found, Monitor, Objective, Search, Stopped, best_free, search};

use super::LikelihoodOutcome;
use super::arx::{out_of_range, rows};
use super::outcome::{StartOutcome, search_outcome};
use crate::Error;
use crate::model::{ArimaOrders, Factor, polynomial::roots};
use crate::respond::NOTHING_LEFT;
use crate::respond::arima::ArimaProcess;
use likelihood::Likelihood;

/// A root at a distance from the unit circle of less than this over the number of its lags in the data is on it.
const ON_CIRCLE: f64 = 0.1;

/// The tolerance of searches after the first, until they find less.
const ROUGH: f64 = 1e-4;
/// How often a search that ended there goes on.
const AGAIN: usize = 3;

/// What is fitted: values with columns beside them, one value a row.
#[derive(Debug, Clone)]
pub(crate) struct ArimaData<'a> {
    /// The output; NaN where it is missing.
    pub(crate) output: &'a [f64],
    /// x_j.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Rows that follow on one another, in which the columns have values.
    pub(crate) segments: Vec<Range<usize>>,
    /// The names of beta_j, then of the parameters of the factors.
    pub(crate) names: Vec<String>,
}

/// What was found.
#[derive(Debug, Clone)]
pub(crate) struct ArimaEstimate {
    /// beta_j, then the parameters of the factors.
    pub(crate) parameters: Vec<f64>,
    pub(crate) covariance: Option<Vec<Vec<f64>>>,
    pub(crate) noise_variance: f64,
    /// N.
    pub(crate) samples: usize,
    pub(crate) condition: Option<f64>,
    /// Which parameters are of a factor with a root on the unit circle: they have no standard error, and those of the
    /// others are as if they were known.
    pub(crate) held: Vec<bool>,
    pub(crate) outcome: LikelihoodOutcome,
}

/// Fits a seasonal ARIMA model by its exact likelihood.
///
/// # Errors
/// [`Error::Undetermined`] if there are too few values, or they do not determine the parameters, which are named;
/// [`Error::Data`] if squares leave the range of numbers; [`Error::Interrupted`].
pub(crate) fn arima(
    data: &ArimaData<'_>,
    orders: &ArimaOrders,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<ArimaEstimate, Error> {
    options.check(&data.names)?;
    let mut likelihood = Likelihood::new(data, orders);
    enough(&likelihood, data, orders)?;
    let begin = start::begin(&likelihood, data)?;
    let energy = begin.energy;
    if !energy.is_normal() {
        return Err(if energy == 0.0 { nothing_left(orders) } else { out_of_range() });
    }
    let deadline = Deadline::after(options.time_limit);
    let samples = likelihood.samples() as f64;
    let smallest = NOTHING_LEFT * energy;
    let mut best: Option<Found> = None;
    let mut outcomes = Vec::new();
    let mut winner = 0;
    let given = options.initial_parameters.iter().map(|given| ("initial-parameters", given.clone()));
    let settled = |found: &Found| {
        let held = on_circle(orders, &found.parameters, samples);
        found.stopped == Stopped::Converged && !held.contains(&true)
    };
    let rough = Search { tolerance: options.tolerance.max(ROUGH), ..options.clone() };
    for (number, (name, start)) in given.chain(begin.starts).enumerate() {
        if name == start::SPARE && best.as_ref().is_some_and(settled) {
            continue;
        }
        let mut run =
            |start: &[f64], how: &Search| search(&mut likelihood, start, how, smallest, deadline, monitor);
        let mut found = match &best {
            None => run(&start, options)?.ok(),
            // A second search need not end where the first did once more.
            Some(best) => match run(&start, &rough)?.ok() {
                Some(near) if near.cost() < best.cost() => {
                    run(&near.parameters, options)?.ok().or(Some(near))
                }
                other => other,
            },
        };
        // What ends on the unit circle goes on from inside of it as long as that leads further.
        for _ in 0..AGAIN {
            let Some(ended) = found.as_ref().filter(|found| found.stopped == Stopped::NoDescent) else {
                break;
            };
            let mut inside = ended.parameters.clone();
            start::inside(orders, &mut inside[data.columns.len()..]);
            match run(&inside, options)? {
                Ok(again) if again.cost() < (1.0 - options.tolerance) * ended.cost() => {
                    let costs = [&ended.costs[..], &[again.cost()]].concat();
                    found = Some(Found { costs, ..again });
                }
                _ => break,
            }
        }
        outcomes.push(StartOutcome {
            name: name.to_owned(),
            cost: found.as_ref().map(|found| found.costs[0] / samples),
            reached: found.as_ref().map(|found| found.cost() / samples),
        });
        if let Some(found) = found
            && best.as_ref().is_none_or(|best| found.cost() < best.cost())
        {
            winner = number;
            best = Some(found);
        }
    }
    outcomes.swap(0, winner);
    let found = best.ok_or_else(|| {
        Error::undetermined(
            data.names.clone(),
            "no start of the search has a finite likelihood; scale the channels towards one, or lower the orders",
        )
    })?;
    // Another start may have been the last.
    if best_free(&mut likelihood, &found.parameters).is_err() {
        return Err(out_of_range());
    }
    let held = on_circle(orders, &found.parameters, samples);
    let stability_bound = held.contains(&true);
    // There the likelihood is flat, as it is the same on both sides.
    let ended = stability_bound && found.stopped == Stopped::NoDescent;
    let stopped = if ended { Stopped::Converged } else { found.stopped };
    finish(likelihood, Found { stability_bound, stopped, ..found }, held, options, outcomes)
}

/// The estimate of a search that has ended where the likelihood stands.
fn finish(
    mut likelihood: Likelihood<'_>,
    found: Found,
    held: Vec<bool>,
    options: &Search,
    starts: Vec<StartOutcome>,
) -> Result<ArimaEstimate, Error> {
    let _ = likelihood.linearize();
    let samples = likelihood.samples();
    let (count, cost) = (samples as f64, found.cost());
    let mut known = likelihood.inverse(&held);
    if let Some((covariance, _)) = &known {
        let errors: Vec<f64> = covariance.diagonal().iter().map(|own| (own * cost / count).sqrt()).collect();
        likelihood.observe(&found.parameters, &errors);
        known = likelihood.inverse(&held);
    }
    if known.is_none() && found.stopped == Stopped::Converged {
        return Err(Error::undetermined(
            Vec::new(),
            "the likelihood is flat: other parameters fit as well, the data cannot tell them apart; lower p and q, or P and Q, \
             by one each",
        ));
    }
    let (covariance, condition) = known.unzip();
    let mean = cost / count;
    let log_likelihood = (mean > 0.0).then(|| -0.5 * count * ((std::f64::consts::TAU * mean).ln() + 1.0));
    let noise_variance = likelihood.squares() / count;
    let search = search_outcome(options, &found, &likelihood, starts);
    Ok(ArimaEstimate {
        covariance: covariance.map(|covariance| rows(&(covariance * mean))),
        parameters: found.parameters,
        noise_variance,
        samples,
        condition,
        held,
        outcome: LikelihoodOutcome { log_likelihood, search },
    })
}

/// There must be more values with an expectation than parameters.
fn enough(likelihood: &Likelihood<'_>, data: &ArimaData<'_>, orders: &ArimaOrders) -> Result<(), Error> {
    let (samples, parameters) = (likelihood.samples(), data.names.len());
    if samples > parameters {
        return Ok(());
    }
    let differences = match orders.differences() {
        0 => String::new(),
        n => format!(", and differencing takes the first {n} of each part without a gap"),
    };
    Err(Error::undetermined(
        data.names.clone(),
        format!(
            "too few rows for {orders}: {parameters} parameters need more measured outputs than that, and there are \
             {samples}{differences}; give more rows, or lower the orders"
        ),
    ))
}

fn nothing_left(orders: &ArimaOrders) -> Error {
    let what = if orders.integrations() > 0 {
        "its differences are"
    } else {
        "its deviations from the constant are"
    };
    Error::undetermined(
        Vec::new(),
        format!("the output has no noise to describe: {what} zero; name other rows, or another output"),
    )
}

/// Which parameters are of a factor with a root on the unit circle, as far as so many values tell.
fn on_circle(orders: &ArimaOrders, parameters: &[f64], samples: f64) -> Vec<bool> {
    let own = parameters.len() - orders.parameters();
    let factors = orders.factors(&parameters[own..]);
    let mut held = vec![false; own];
    for (factor, monic) in Factor::ALL.iter().zip(&factors) {
        let (count, rows) = orders.factor(*factor);
        let near = |distance: f64| distance * samples < ON_CIRCLE * rows as f64;
        let any = roots(monic).unwrap_or_default().iter().any(|root| near(1.0 - root.modulus()));
        held.extend(std::iter::repeat_n(any, count));
    }
    held
}

/// The rows of a segment with an expectation, and those before it that it needs.
fn expected(output: &[f64], segment: &Range<usize>, differences: usize) -> Option<Range<usize>> {
    ArimaProcess::expected(&output[segment.clone()], differences)
}
