//! The estimate of least squared prediction errors for the general family: starts, search, initial conditions, covariance.

use std::ops::Range;

use rayon::prelude::*;
use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector};

use super::arx::{arx, out_of_range, rows, signals};
use super::optimize::{
    Algorithm, Deadline, Found, Monitor, Search, SearchOutcome, StartOutcome, Stopped, best_free, search,
};
use super::predictor::{Begin, Predictor, Unusable};
use super::restart::restarts;
use super::start::candidates;
use super::uncertainty::{autoregression, backward_filtered_products, coloured, restricted};
use super::{Estimate, Initial, Procedure};
use crate::data::Record;
use crate::model::{cancel, near_cancellation};
use crate::regression::{Taps, condition, sum_of_squares};
use crate::{Error, Model, Orders, Structure};

/// A sum of squared errors below this fraction of the output's is rounding.
pub(super) const NOTHING_LEFT: f64 = 1e-28;
/// From so many samples on, starts see stretches of the record only.
const LONG: usize = 1 << 18;
const STRETCHES: usize = 8;
const STRETCH: usize = 1 << 12;
/// Above this condition number the Gram matrix does not give the covariance to a thousandth.
const MAXIMUM_CONDITION: f64 = 5e6;

pub(crate) fn drop_is_not_for_f() -> Error {
    Error::argument(
        "initial",
        "drop is for models without F, whose errors depend on few samples; use zero, estimate or auto",
    )
}

/// How the initial conditions are treated.
fn begins(orders: &Orders, initial: Initial) -> Result<(Begin, bool), Error> {
    let filtered = orders.nf.iter().any(|&nf| nf > 0);
    match initial {
        Initial::Drop if filtered => Err(drop_is_not_for_f()),
        Initial::Zero => Ok((Begin::Zero, false)),
        Initial::Drop | Initial::Estimate => Ok((Begin::Unknown, false)),
        Initial::Auto => Ok((Begin::Unknown, filtered)),
    }
}

/// Fits A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t) by a search for the least sum of squared prediction
/// errors from several starts; an ARX model in one step.
pub(super) fn prediction_error(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    if orders.is_linear() {
        return arx(record, orders, initial);
    }
    options.check(orders)?;
    signals(record, orders)?;
    let (begin, choose) = begins(orders, initial)?;
    let mut predictor = Predictor::new(record, orders, begin);
    enough(&predictor, orders)?;
    let energy = energy(record);
    if !energy.is_normal() && energy != 0.0 {
        return Err(out_of_range());
    }
    let deadline = Deadline::after(options.time_limit);
    let job = Job { options, smallest: NOTHING_LEFT * energy, deadline, monitor };
    let mut beginning = job.beginning(record, orders, begin, &mut predictor)?;
    if choose {
        return job.choose(record, orders, predictor, beginning);
    }
    let initial = match begin {
        Begin::Zero => Initial::Zero,
        Begin::Unknown if orders.nf.iter().any(|&nf| nf > 0) => Initial::Estimate,
        Begin::Unknown => Initial::Drop,
    };
    let found = job.search_from(&mut predictor, &beginning)?.ok_or_else(|| hopeless(orders))?;
    beginning.reached(found.cost() / predictor.samples() as f64);
    job.finish(orders, &predictor, found, beginning, initial)
}

/// What all searches of an estimate share.
struct Job<'a> {
    options: &'a Search,
    smallest: f64,
    deadline: Deadline,
    monitor: Monitor<'a>,
}

impl Job<'_> {
    /// The best start for the search on the whole record.
    ///
    /// Of a long record the starts see stretches that are spread over it: what they lead to is close to the end, and a few
    /// iterations on all samples are left.
    fn beginning(
        &self,
        record: &Record<'_>,
        orders: &Orders,
        begin: Begin,
        predictor: &mut Predictor<'_>,
    ) -> Result<Beginning, Error> {
        if let Some(thin) = thinned(record) {
            // In the middle of a log nothing is at rest.
            let mut small = Predictor::new(&thin, orders, Begin::Unknown);
            let near = self.ranked(&thin, orders, Begin::Unknown, &mut small).and_then(|beginning| {
                Ok(self.search_from(&mut small, &beginning)?.map(|found| (found, beginning)))
            });
            match near {
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(_) | Ok(None) => {}
                Ok(Some((found, Beginning { mut starts, unstable_pole, .. }))) => {
                    starts[0].reached = Some(found.cost() / small.samples() as f64);
                    let parameters = found.parameters;
                    let samples = Some(small.samples());
                    return Ok(Beginning { parameters, starts, unstable_pole, samples, found: None });
                }
            }
        }
        self.ranked(record, orders, begin, predictor)
    }

    /// Searches from the beginning, if that was not done before. The predictor is left at what was found.
    fn search_from(
        &self,
        predictor: &mut Predictor<'_>,
        beginning: &Beginning,
    ) -> Result<Option<Found>, Error> {
        match &beginning.found {
            Some(found) => {
                let _ = best_free(predictor, &found.parameters);
                predictor.linearize();
                Ok(Some(found.clone()))
            }
            None => Ok(self.search(predictor, &beginning.parameters)?.ok()),
        }
    }

    /// Estimates the initial conditions where that is worth its parameters: N ln(V_zero/V_estimate) > n ln N.
    ///
    /// One of the two searches is done, where a step of the other foretells that it cannot change the answer.
    fn choose(
        &self,
        record: &Record<'_>,
        orders: &Orders,
        mut estimated: Predictor<'_>,
        mut beginning: Beginning,
    ) -> Result<Estimate, Error> {
        let mut resting = Predictor::new(record, orders, Begin::Zero);
        let samples = estimated.samples() as f64;
        let price = estimated.initial_conditions() as f64 * samples.ln();
        let rows = resting.samples() as f64;
        // Costs of both kinds as means; an exact fit from rest needs no better one.
        let worth = |zero: f64, estimate: f64| {
            zero > self.smallest && samples * ((zero / rows) / (estimate / samples)).ln() > price
        };
        let start = beginning.parameters.clone();
        let costs = (best_free(&mut resting, &start), best_free(&mut estimated, &start));
        let at_rest_first =
            beginning.found.is_none() && matches!(costs, (Ok(zero), Ok(free)) if !worth(zero, free));
        let mut at_rest = None;
        if at_rest_first && let Some(found) = self.search_from(&mut resting, &beginning)? {
            let foretold = best_free(&mut estimated, &found.parameters)
                .map_or(f64::INFINITY, |cost| cost - estimated.foretold());
            if !worth(found.cost(), foretold) {
                beginning.reached(found.cost() / rows);
                return self.finish(orders, &resting, found, beginning, Initial::Zero);
            }
            at_rest = Some(found);
        }
        let free = self.search_from(&mut estimated, &beginning)?;
        let Some(free) = free else {
            let found = at_rest.ok_or_else(|| hopeless(orders))?;
            return self.finish(orders, &resting, found, beginning, Initial::Zero);
        };
        if at_rest.is_none() {
            let foretold = best_free(&mut resting, &free.parameters)
                .map_or(f64::INFINITY, |cost| cost - resting.foretold());
            if !worth(foretold, free.cost()) {
                at_rest = self.search(&mut resting, &free.parameters)?.ok();
            }
        }
        if let Some(found) = at_rest.filter(|found| !worth(found.cost(), free.cost())) {
            beginning.reached(found.cost() / rows);
            return self.finish(orders, &resting, found, beginning, Initial::Zero);
        }
        beginning.reached(free.cost() / samples);
        self.finish(orders, &estimated, free, beginning, Initial::Estimate)
    }

    fn search(
        &self,
        predictor: &mut Predictor<'_>,
        parameters: &[f64],
    ) -> Result<Result<Found, Unusable>, Error> {
        search(predictor, parameters, self.options, self.smallest, self.deadline, self.monitor)
    }

    /// The candidates by their cost. If more than one start is asked for, searches from so many and takes what the best
    /// search found.
    fn ranked(
        &self,
        record: &Record<'_>,
        orders: &Orders,
        begin: Begin,
        predictor: &mut Predictor<'_>,
    ) -> Result<Beginning, Error> {
        let samples = predictor.samples() as f64;
        let mut starts = Vec::new();
        let guess = self.options.guess.iter().map(|guess| ("guess", guess.clone()));
        let found = match candidates(record, orders, self.deadline) {
            Err(error) if self.options.guess.is_none() => return Err(error),
            found => found.unwrap_or_default(),
        };
        let unstable_pole = found.iter().filter_map(|candidate| candidate.unstable_pole).reduce(f64::max);
        let candidates = found.into_iter().map(|candidate| (candidate.name, candidate.parameters));
        for (name, parameters) in guess.chain(candidates) {
            if self.deadline.is_over()
                && starts.iter().any(|(start, _): &(StartOutcome, _)| start.cost.is_some())
            {
                break;
            }
            let cost = best_free(predictor, &parameters).ok();
            starts.push((
                StartOutcome { name: name.to_owned(), cost: cost.map(|c| c / samples), reached: None },
                parameters,
            ));
        }
        // Stable: of equal ones the first stays first; those without a cost come last.
        let cost = |start: &StartOutcome| start.cost.unwrap_or(f64::INFINITY);
        starts.sort_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)));
        if let Some((_, best)) = starts.first().filter(|_| !self.deadline.is_over()) {
            let missing = (self.options.starts + 1).saturating_sub(starts.len());
            let more: Vec<_> = restarts(orders, best, self.options.seed, missing).collect();
            for (number, parameters) in more.into_iter().enumerate() {
                let cost = best_free(predictor, &parameters).ok().map(|cost| cost / samples);
                starts.push((
                    StartOutcome { name: format!("random-{}", number + 1), cost, reached: None },
                    parameters,
                ));
            }
        }
        let first =
            starts.first().map(|(_, parameters)| parameters.clone()).ok_or_else(|| hopeless(orders))?;
        if self.options.starts == 0 {
            let starts = starts.into_iter().map(|(start, _)| start).collect();
            return Ok(Beginning { parameters: first, starts, unstable_pole, samples: None, found: None });
        }
        let searched = starts.len().min(self.options.starts + 1);
        let results = starts[..searched].par_iter().enumerate().map(|(number, (_, parameters))| {
            if number > 0 && self.deadline.is_over() {
                return Ok(None);
            }
            Ok(self.search(&mut Predictor::new(record, orders, begin), parameters)?.ok())
        });
        let mut results = results.collect::<Result<Vec<_>, Error>>()?;
        for ((start, _), found) in starts.iter_mut().zip(&results) {
            start.reached = found.as_ref().map(|found| found.cost() / samples);
        }
        let costs =
            results.iter().enumerate().filter_map(|(index, found)| Some((index, found.as_ref()?.cost())));
        let (winner, _) = costs.min_by(|(_, a), (_, b)| a.total_cmp(b)).ok_or_else(|| hopeless(orders))?;
        let mut starts: Vec<StartOutcome> = starts.into_iter().map(|(start, _)| start).collect();
        starts[..=winner].rotate_right(1);
        let found = results.swap_remove(winner);
        let parameters = found.as_ref().map_or(first, |found| found.parameters.clone());
        Ok(Beginning { parameters, starts, unstable_pole, samples: None, found })
    }

    /// The estimate of a search.
    fn finish(
        &self,
        orders: &Orders,
        predictor: &Predictor<'_>,
        found: Found,
        beginning: Beginning,
        initial: Initial,
    ) -> Result<Estimate, Error> {
        let (size, samples) = (found.parameters.len(), predictor.samples());
        let cost = found.cost();
        let initial_conditions = predictor.initial_conditions();
        let noise_variance = cost / (samples - size - initial_conditions) as f64;
        let known = uncertainty(predictor, orders, noise_variance);
        // At a minimum only a flat cost has none; elsewhere it may be a matter of the place.
        let settled = matches!(found.stopped, Stopped::Converged | Stopped::NoDescent);
        if known.is_none() && settled {
            return Err(flat(orders, &found.parameters));
        }
        let (covariance, condition) = known.map(|known| (known.covariance, known.condition)).unzip();
        let outcome = SearchOutcome {
            start_samples: beginning.samples,
            unstable_pole: beginning.unstable_pole,
            ..search_outcome(self.options, &found, predictor, beginning.starts)
        };
        Ok(Estimate {
            parameters: found.parameters,
            covariance,
            noise_variance,
            samples,
            mse: cost / samples as f64,
            condition,
            initial,
            procedure: Procedure::PredictionError(outcome),
        })
    }
}

/// How a search on the whole record went.
pub(super) fn search_outcome(
    options: &Search,
    found: &Found,
    predictor: &Predictor<'_>,
    starts: Vec<StartOutcome>,
) -> SearchOutcome {
    SearchOutcome {
        algorithm: options.algorithm,
        tolerance: options.tolerance,
        max_iterations: options.max_iterations,
        step: (options.algorithm == Algorithm::Gradient).then_some(options.step),
        seed: (options.starts > 0).then_some(options.seed),
        iterations: found.costs.len() - 1,
        costs: found.costs.iter().map(|cost| cost / predictor.samples() as f64).collect(),
        gradient_norm: found.gradient_norm,
        stopped: found.stopped,
        stability_bound: found.stability_bound,
        unstable_steps: found.unstable_steps,
        initial_conditions: predictor.initial_conditions(),
        start_samples: None,
        start: starts.first().map(|start| start.name.clone()).unwrap_or_default(),
        starts,
        unstable_pole: None,
    }
}

/// Where the search on the whole record begins.
struct Beginning {
    parameters: Vec<f64>,
    /// All starts, the best first.
    starts: Vec<StartOutcome>,
    /// The largest modulus of a pole of theirs that had to be reflected.
    unstable_pole: Option<f64>,
    /// How many samples they were compared on, if not on all.
    samples: Option<usize>,
    /// What a search on the whole record has found already.
    found: Option<Found>,
}

impl Beginning {
    /// Notes the mean of e^2 that the search from the best start reached.
    fn reached(&mut self, cost: f64) {
        if let Some(start) = self.starts.first_mut() {
            start.reached = Some(cost);
        }
    }
}

/// The error of a record on which no start works.
fn hopeless(orders: &Orders) -> Error {
    Error::undetermined(
        orders.names(),
        "no start of the search has a finite cost; scale the channels towards one, or lower the orders",
    )
}

/// The covariance matrix of the parameters, and the condition number of psi.
struct Uncertainty {
    covariance: Vec<Vec<f64>>,
    condition: f64,
}

/// sigma^2 G^-1, or its form for coloured errors where there is no model of the noise; none where G is singular to
/// rounding.
fn uncertainty(predictor: &Predictor<'_>, orders: &Orders, noise_variance: f64) -> Option<Uncertainty> {
    let (mut inverse, condition) = inverse(predictor)?;
    if orders.structure() == Structure::Oe {
        let (residuals, segments) = predictor.residuals();
        let taken = orders.parameters() + predictor.initial_conditions();
        let colour = restricted(&residuals, || predictor.sensitivities(), &segments, taken);
        let products = predictor.backward_filtered_products(&colour.monic);
        let variance = colour.variance * colour.inflation(residuals.len(), taken);
        inverse = coloured(&inverse, variance, &products);
    } else {
        inverse *= noise_variance;
    }
    Some(Uncertainty { covariance: rows(&inverse), condition })
}

/// The covariance of an estimate of least squares whose errors are coloured, whatever its structure: of `uncertainty` with
/// psi filtered backwards in time by an autoregression of the errors. None where it cannot be had.
pub(super) fn coloured_covariance(
    record: &Record<'_>,
    orders: &Orders,
    estimate: &Estimate,
) -> Option<Vec<Vec<f64>>> {
    let begin = if estimate.initial() == Initial::Zero { Begin::Zero } else { Begin::Unknown };
    let mut predictor = Predictor::new(record, orders, begin);
    best_free(&mut predictor, estimate.parameters()).ok()?;
    predictor.linearize();
    let (inverse, _) = inverse(&predictor)?;
    let (residuals, segments) = predictor.residuals();
    let taken = orders.parameters() + predictor.initial_conditions();
    let colour = autoregression(&residuals, &segments, taken);
    let products = backward_products(&predictor.columns(), &colour.monic);
    Some(rows(&coloured(&inverse, colour.variance, &products)))
}

/// sum zeta zeta' over all segments, zeta being psi filtered backwards in time by 1/A(q^+1), A = `monic`.
pub(super) fn backward_products(segments: &[Vec<Vec<f64>>], monic: &[f64]) -> DMatrix<f64> {
    let size = segments.first().map_or(0, Vec::len);
    let taps: Vec<Taps> = (0..size).map(|signal| Taps { signal, first: 0, count: 1, sign: 1.0 }).collect();
    let mut sum = DMatrix::zeros(size, size);
    for columns in segments {
        let signals: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let all = 0..signals.first().map_or(0, |column| column.len());
        sum += backward_filtered_products(&signals, &taps, &all, &all, None, monic);
    }
    sum
}

/// Whether the errors tell the parameters apart, where the predictor stands.
pub(super) fn is_determined(predictor: &Predictor<'_>) -> bool {
    inverse(predictor).is_some()
}

/// G^-1, and the condition number of psi. By Cholesky of the Gram matrix, or by QR where that is not exact enough.
pub(super) fn inverse(predictor: &Predictor<'_>) -> Option<(DMatrix<f64>, f64)> {
    let size = predictor.right.len();
    let matrix = DMatrix::from_row_slice(size, size, &predictor.matrix);
    let scales = matrix.diagonal().map(f64::sqrt);
    let scaled = |mut inverse: DMatrix<f64>, scales: &DVector<f64>| {
        for (mut column, scale) in inverse.column_iter_mut().zip(scales) {
            column.component_div_assign(scales);
            column.unscale_mut(*scale);
        }
        inverse
    };
    let unit = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] / scales[i] / scales[j]);
    // What the free responses leave of a column may be nothing but rounding, and its square negative.
    if scales.iter().all(|scale| *scale > 0.0)
        && let Some(factor) = Cholesky::new(unit)
        && let Some(condition) = condition(&factor.l().transpose(), predictor.samples())
        && condition <= MAXIMUM_CONDITION
    {
        return Some((scaled(factor.inverse(), &scales), condition));
    }
    let factor = predictor.factor().ok().filter(|factor| factor.rank().is_full())?;
    let mut triangle = factor.factor();
    let scales = DVector::from_iterator(size, triangle.column_iter().map(|column| column.norm()));
    for (mut column, scale) in triangle.column_iter_mut().zip(&scales) {
        column.unscale_mut(*scale);
    }
    let inverse = triangle.solve_upper_triangular(&DMatrix::identity(size, size))?;
    Some((scaled(&inverse * inverse.transpose(), &scales), factor.condition()))
}

/// Stretches of a long record, spread evenly over its samples; none for a record that is not long.
fn thinned<'a>(record: &Record<'a>) -> Option<Record<'a>> {
    let total: usize = record.segments.iter().map(Range::len).sum();
    if total < LONG { None } else { stretches(record, STRETCHES, STRETCH) }
}

/// So many stretches of at most so many samples, spread evenly over a record; none if of short segments less than half
/// of that would be left.
pub(crate) fn stretches<'a>(record: &Record<'a>, count: usize, length: usize) -> Option<Record<'a>> {
    let total: usize = record.segments.iter().map(Range::len).sum();
    let mut segments = Vec::with_capacity(count);
    let (mut before, mut rest) = (0, record.segments.iter().peekable());
    for position in (0..count).map(|k| k * (total / count)) {
        while let Some(segment) = rest.next_if(|segment| before + segment.len() <= position) {
            before += segment.len();
        }
        if let Some(segment) = rest.peek() {
            let start = segment.start + position - before;
            segments.push(start..segment.end.min(start + length));
        }
    }
    let kept: usize = segments.iter().map(Range::len).sum();
    let (output, inputs) = (record.output, record.inputs.clone());
    let past = vec![0; segments.len()];
    (2 * kept > count * length).then_some(Record { output, inputs, segments, past })
}

/// The sum of squares of the output over all segments.
pub(super) fn energy(record: &Record<'_>) -> f64 {
    record.segments.iter().map(|segment| sum_of_squares(&record.output[segment.clone()])).sum()
}

/// There must be more samples that count than parameters and initial conditions.
fn enough(predictor: &Predictor<'_>, orders: &Orders) -> Result<(), Error> {
    let unknown = orders.parameters() + predictor.initial_conditions();
    if predictor.samples() > unknown {
        return Ok(());
    }
    Err(Error::undetermined(
        orders.names(),
        format!(
            "too few rows for the orders: {} parameters and {} initial conditions need more samples than that, and {} \
             count; give more rows, lower the orders, or start from zero",
            orders.parameters(),
            predictor.initial_conditions(),
            predictor.samples()
        ),
    ))
}

/// The error of a cost that does not depend on some combination of the parameters.
fn flat(orders: &Orders, parameters: &[f64]) -> Error {
    let model = Model::from_parameters(orders, parameters, None, 0.0, 1.0);
    let advice = model.ok().as_ref().and_then(near_cancellation).map_or_else(
        || "lower the orders, or excite the input more".to_owned(),
        |(pole, zero)| format!("{}; lower both orders by one", cancel(&pole, &zero)),
    );
    Error::undetermined(
        Vec::new(),
        format!("the cost is flat: other parameters fit as well, the data cannot tell them apart; {advice}"),
    )
}

#[cfg(test)]
mod tests;
