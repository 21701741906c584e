//! Where a search begins.
//!
//! The recipes of `start` lead to the same place where the plant is in the model set. Where they do not, the sum of
//! squares has several minima or long valleys, and costs at the starts say little about where a search from them ends.
//! Then optima of nested models are further starts (see `nested`), and all starts are compared after a few steps of
//! Levenberg and Marquardt, the promising ones after some more.

use rayon::prelude::*;
use thetahat_numerics::optimize::{
    Algorithm, Found, Search, Stopped, best_free, best_linear, predicted_decrease,
};

use super::nested::{is_long, thinned};
use super::{Job, Problem, TrackStart, hopeless};
use crate::Error;
use crate::estimate::experiment_data::PredictionErrors;
use crate::estimate::outcome::StartOutcome;
use crate::estimate::predictor::InitialCondition;
use crate::estimate::restart::restarts;
use crate::estimate::start::candidates;
use crate::estimate::thinning::filled;
use crate::model::Orders;

/// Starts of which the costs differ by more than this fraction of the lowest may lead to different minima.
const DISAGREEMENT: f64 = 1e-3;
/// A search that may lower the cost by more than this fraction may lead anywhere.
const FAR: f64 = 1e-2;
/// Starts of which the costs differ by less than this fraction are one.
const SAME_COST: f64 = 1e-6;
/// Rounds of a comparison: iterations of each start, and of what it reaches in them the largest ratio to the lowest
/// cost with which a start goes on.
const ROUNDS: [(usize, f64); 2] = [(4, 1.2), (10, 1.05)];
/// The same where there is no F: iterations are cheap, and starts are few.
const LONG_ROUND: [(usize, f64); 1] = [(100, 1.0)];

/// What the name of a start ends with that is followed in the coordinates of the objective too.
pub(in crate::estimate) const TWIN: &str = "-orthogonal";

/// The name of the start that was given.
const GIVEN: &str = "initial-parameters";
/// The name of those from smaller models.
const NESTED: &str = "nested";
/// The name of what a search has found, among other starts.
const FOUND: &str = "found";

/// A start and how far it was followed.
#[derive(Debug, Clone)]
pub(super) struct Start {
    pub(super) outcome: StartOutcome,
    pub(super) parameters: Vec<f64>,
    /// sum e^2 there; infinite where it cannot be computed.
    cost: f64,
    /// Whether it is followed in the coordinates of the objective.
    pub(super) orthogonal: bool,
}

impl Job<'_> {
    /// The starts, the best first. If more than one is asked for, searches from this many and takes what the best
    /// search found.
    pub(super) fn ranked(
        &self,
        problem: Problem<'_, '_>,
        predictor: &mut impl PredictionErrors,
    ) -> Result<TrackStart, Error> {
        let Problem { record, orders, .. } = problem;
        let given = self.options.initial_parameters.iter().map(|given| (GIVEN, given.clone()));
        let recipes = filled(record, |record| candidates(record, orders, self.deadline));
        let found = match recipes {
            Err(error) if self.options.initial_parameters.is_none() => return Err(error),
            found => found.unwrap_or_default(),
        };
        let unstable_pole = found.iter().filter_map(|candidate| candidate.unstable_pole).reduce(f64::max);
        let recipes = found.into_iter().map(|candidate| (candidate.name, candidate.parameters));
        let mut starts: Vec<Start> = Vec::new();
        for (name, parameters) in given.chain(recipes) {
            if self.deadline.is_over() && starts.iter().any(|start| start.cost.is_finite()) {
                break;
            }
            starts.push(Start::new(name, parameters, predictor));
        }
        sort(&mut starts);
        let has_f = orders.has_f();
        // Who asks for another algorithm wants to see it at work.
        let comparison: usize = ROUNDS.iter().map(|(iterations, _)| iterations).sum();
        let default = self.options.algorithm == Algorithm::LevenbergMarquardt
            && self.options.max_iterations > comparison;
        // What was given and costs least comes from a search.
        let several = self.options.starts > 0;
        let known = !several && starts.first().is_some_and(|start| start.outcome.name == GIVEN);
        let mut compared = !has_f || !default || several;
        let may_compare = (has_f || starts.len() > 1) && default && !known && !self.deadline.is_over();
        let doubtful = may_compare && is_doubtful(problem, &starts, predictor);
        if doubtful
            && !(has_f || several)
            && is_long(record)
            && let Ok(found) = self.search(predictor, &starts[0].parameters, false)?
        {
            let best = &mut starts[0];
            (best.cost, best.parameters) = (found.cost(), found.parameters.clone());
            best.outcome.reached = Some(best.cost / predictor.samples() as f64);
            if leaves_white_errors(orders, &found, predictor) {
                return Ok(TrackStart {
                    parameters: found.parameters.clone(),
                    orthogonal: false,
                    starts: starts.into_iter().map(|start| start.outcome).collect(),
                    unstable_pole,
                    samples: None,
                    compared: true,
                    found: Some(found),
                });
            }
        }
        if doubtful || may_compare && several {
            starts.extend(self.nested_starts(problem, predictor)?);
            if doubtful {
                sort(&mut starts);
                let twins: Vec<Start> =
                    starts.iter().filter(|start| has_f && start.cost.is_finite()).map(Start::twin).collect();
                starts.extend(twins);
                let rounds = if has_f { &ROUNDS[..] } else { &LONG_ROUND };
                self.compare(predictor, &mut starts, rounds)?;
            }
            sort(&mut starts);
            compared = true;
        }
        let Some(best) = starts.first() else { return Err(hopeless(orders)) };
        if !self.deadline.is_over() {
            let missing = (self.options.starts + 1).saturating_sub(starts.len());
            let more: Vec<_> = restarts(orders, &best.parameters, self.options.seed, missing).collect();
            let more = more.into_iter().enumerate().map(|(number, mut parameters)| {
                // A start without a cost is ranked by that.
                let _ = best_linear(predictor, &mut parameters);
                Start::new(&format!("random-{}", number + 1), parameters, predictor)
            });
            let more: Vec<Start> = more.collect();
            starts.extend(more);
        }
        let samples = None;
        if self.options.starts == 0 {
            let (parameters, orthogonal) = (starts[0].parameters.clone(), starts[0].orthogonal);
            let starts = starts.into_iter().map(|start| start.outcome).collect();
            return Ok(TrackStart {
                parameters,
                orthogonal,
                starts,
                unstable_pole,
                samples,
                compared,
                found: None,
            });
        }
        let (winner, found) = self.searched(problem, &mut starts)?;
        starts[..=winner].rotate_right(1);
        let parameters =
            found.as_ref().map_or_else(|| starts[0].parameters.clone(), |f| f.parameters.clone());
        let orthogonal = starts[0].orthogonal;
        let starts = starts.into_iter().map(|start| start.outcome).collect();
        Ok(TrackStart { parameters, orthogonal, starts, unstable_pole, samples, compared, found })
    }

    fn nested_starts(
        &self,
        problem: Problem<'_, '_>,
        predictor: &mut impl PredictionErrors,
    ) -> Result<Vec<Start>, Error> {
        let nested = self.nested(problem)?;
        Ok(nested.into_iter().map(|parameters| Start::new(NESTED, parameters, predictor)).collect())
    }

    /// The best start from nested models after some iterations, if they lead below what was found. On a longer record
    /// only those do that lead below on segments of it.
    pub(super) fn nested_below(
        &self,
        problem: Problem<'_, '_>,
        predictor: &mut impl PredictionErrors,
        found: Option<&Found>,
    ) -> Result<Option<Start>, Error> {
        let mut starts = self.nested(problem)?;
        if let (Some(thin), Some(found)) = (thinned(problem.record), found) {
            let thin = thin.record();
            let problem = Problem { record: &thin, begin: InitialCondition::Unknown, ..problem };
            let mut small = problem.predictor();
            let mut own = [Start::new(FOUND, found.parameters.clone(), &mut small)];
            self.compare(&mut small, &mut own, &ROUNDS)?;
            let mut others: Vec<Start> =
                starts.into_iter().map(|parameters| Start::new(NESTED, parameters, &mut small)).collect();
            self.compare(&mut small, &mut others, &ROUNDS)?;
            others.retain(|other| other.cost < (1.0 - SAME_COST) * own[0].cost);
            starts = others.into_iter().map(|start| start.parameters).collect();
        }
        let starts = starts.into_iter().map(|parameters| Start::new(NESTED, parameters, predictor));
        let mut starts: Vec<Start> = starts.collect();
        self.compare(predictor, &mut starts, &ROUNDS)?;
        let lowest = found.map_or(f64::INFINITY, Found::cost);
        Ok(starts.into_iter().next().filter(|start| start.cost < lowest))
    }

    /// Follows the starts for a few iterations, and those that are close to the best of them for some more; sorts them
    /// by what they reach.
    fn compare(
        &self,
        predictor: &mut impl PredictionErrors,
        starts: &mut [Start],
        rounds: &[(usize, f64)],
    ) -> Result<(), Error> {
        let samples = predictor.samples() as f64;
        let mut limit = f64::INFINITY;
        for &(iterations, within) in rounds {
            sort(starts);
            let (mut before, mut lowest) = ([f64::NEG_INFINITY; 2], f64::INFINITY);
            for start in starts.iter_mut().filter(|start| start.cost.is_finite() && start.cost <= limit) {
                let same = start.cost - before[usize::from(start.orthogonal)] <= SAME_COST * start.cost;
                before[usize::from(start.orthogonal)] = start.cost;
                if same || self.deadline.is_over() {
                    continue;
                }
                let search =
                    Search { max_iterations: iterations, orthogonal: start.orthogonal, ..Search::default() };
                let Ok(found) = self.search_with(predictor, &start.parameters, &search)? else { continue };
                start.cost = found.cost();
                start.parameters = found.parameters;
                start.outcome.reached = Some(start.cost / samples);
                lowest = lowest.min(start.cost);
            }
            limit = within * lowest;
        }
        sort(starts);
        Ok(())
    }

    /// Searches from as many starts as are asked for, in parallel. Gives the one that won, and what it found.
    fn searched(
        &self,
        problem: Problem<'_, '_>,
        starts: &mut [Start],
    ) -> Result<(usize, Option<Found>), Error> {
        let results = starts.par_iter().enumerate().map(|(number, start)| {
            // Those that were given or come from smaller models are not left out for others that cost less.
            let chosen =
                number <= self.options.starts || [GIVEN, NESTED].contains(&start.outcome.name.as_str());
            if !chosen || number > 0 && self.deadline.is_over() {
                return Ok(None);
            }
            let mut predictor = problem.predictor();
            let samples = predictor.samples() as f64;
            let found = self.search(&mut predictor, &start.parameters, start.orthogonal)?;
            Ok(found.ok().map(|found| (found, samples)))
        });
        let results = results.collect::<Result<Vec<_>, Error>>()?;
        let mut winner: Option<(usize, Found)> = None;
        for (number, (start, result)) in starts.iter_mut().zip(results).enumerate() {
            let Some((found, samples)) = result else { continue };
            start.outcome.reached = Some(found.cost() / samples);
            if winner.as_ref().is_none_or(|(_, best)| found.cost() < best.cost()) {
                winner = Some((number, found));
            }
        }
        winner.map(|(number, found)| (number, Some(found))).ok_or_else(|| hopeless(problem.orders))
    }
}

impl Start {
    fn new(name: &str, parameters: Vec<f64>, predictor: &mut impl PredictionErrors) -> Self {
        let cost = best_free(predictor, &parameters).ok();
        let outcome = StartOutcome {
            name: name.to_owned(),
            cost: cost.map(|cost| cost / predictor.samples() as f64),
            reached: None,
        };
        Self { outcome, parameters, cost: cost.unwrap_or(f64::INFINITY), orthogonal: false }
    }
}

impl Start {
    /// The same, followed in the coordinates of the objective.
    fn twin(&self) -> Self {
        let mut twin = Self { orthogonal: true, ..self.clone() };
        twin.outcome.name += TWIN;
        twin
    }
}

/// By their costs. Stable: of equal ones the first stays first; those without a cost come last.
fn sort(starts: &mut [Start]) {
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}

/// Whether searches from these sorted starts may end in different places, or far from where they begin: where they lead
/// is predicted by a step of Gauss and Newton, for a long record on segments of it.
fn is_doubtful(problem: Problem<'_, '_>, starts: &[Start], predictor: &mut impl PredictionErrors) -> bool {
    let mut recipes: Vec<(&str, &Start)> = Vec::new();
    for start in starts.iter().filter(|start| start.cost.is_finite()) {
        let recipe = start.outcome.name.trim_end_matches("-refined");
        if recipes.iter().all(|(other, _)| *other != recipe) {
            recipes.push((recipe, start));
        }
    }
    if recipes.is_empty() || starts.len() == 1 && problem.orders.has_f() {
        return true;
    }
    let recipes: Vec<&Start> = recipes.into_iter().map(|(_, start)| start).collect();
    if !problem.orders.has_f() {
        // Errors may have several minima over C, which no step from elsewhere shows.
        return recipes.iter().any(|start| start.cost > (1.0 + DISAGREEMENT) * recipes[0].cost);
    }
    match thinned(problem.record) {
        Some(thin) => {
            let thin = thin.record();
            let problem = Problem { record: &thin, begin: InitialCondition::Unknown, ..problem };
            lead_apart(&recipes, &mut problem.predictor())
        }
        None => lead_apart(&recipes, predictor),
    }
}

/// Whether a search has converged and its errors are white. Of a long record these say that no other minimum is lower:
/// there is nothing left to explain but what a few parameters take of the noise.
fn leaves_white_errors(orders: &Orders, found: &Found, predictor: &impl PredictionErrors) -> bool {
    let taken = orders.parameters() + predictor.initial_conditions();
    let is_white = || predictor.autoregression(taken).is_some_and(|colour| colour.order() == 0);
    found.stopped == Stopped::Converged && is_white()
}

fn lead_apart(recipes: &[&Start], predictor: &mut impl PredictionErrors) -> bool {
    // The cost at a start, and where it leads.
    let mut followed = |start: &Start| {
        let cost = best_free(predictor, &start.parameters).ok()?;
        Some((cost, cost - predicted_decrease(predictor)))
    };
    let Some((cost, lowest)) = followed(recipes[0]) else { return true };
    lowest < (1.0 - FAR) * cost
        || recipes[1..].iter().any(|start| {
            start.cost > (1.0 + DISAGREEMENT) * recipes[0].cost
                && followed(start).is_none_or(|(_, reached)| (reached / lowest - 1.0).abs() > DISAGREEMENT)
        })
}
