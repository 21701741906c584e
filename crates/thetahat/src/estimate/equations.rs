//! Models in equations: the parameters of the largest likelihood.

mod likelihood;
mod objective;
mod profile;
mod response;
mod uncertainty;

use oorandom::Rand64;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{
    Algorithm, Deadline, Found, Monitor, Search, Step, Stopped, lowest, normal_number, search,
};

use crate::Error;
use crate::model::{
    GreyBox,
    equations::{Scale, Unknown},
};
use crate::respond::{NisSummary, equations::Failure};
pub(crate) use likelihood::{LANE, Likelihood, LikelihoodObjective, Slopes};
use objective::Deviance;
pub(crate) use profile::intervals;
pub(crate) use response::{EquationsPoint, EquationsResponse, ResponseLikelihood};
pub(crate) use uncertainty::listed;

/// How the parameters of a model in equations were found: those of the largest likelihood of its innovations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EquationsOutcome {
    /// The sum over all measured values of -1/2 (ln 2 pi S + e^2/S).
    pub log_likelihood: f64,
    /// The normalised innovations squared of the rows: their mean is above the expected one if the noises of the log
    /// are larger than those of the model. None where nothing was measured, and of frequency responses.
    pub nis: Option<NisSummary>,
    /// What the covariance of the parameters was multiplied by: max(1, nis.mean/nis.expected). Of frequency responses
    /// it is the mean square of the errors in their standard deviations, 1 at least where these were measured.
    pub covariance_factor: f64,
    /// What was known of the parameters before the fit, in their order.
    pub unknown: Vec<UnknownParameter>,
    /// The intervals of the parameters by profile likelihood, in their order, where they were asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profile: Vec<ProfileInterval>,
    /// Where the states start in the free runs on the estimation rows: a list for each state, with an entry for each
    /// run; none where it grows out of range. Empty of frequency responses.
    pub starts: Vec<Vec<Option<f64>>>,
    /// How the search went.
    pub search: LikelihoodSearch,
}

/// What was known of a parameter before a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnknownParameter {
    /// Its name.
    pub name: String,
    /// Where the search started.
    pub start: f64,
    /// The lower bound, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// The upper bound, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// How it is kept within its bounds, such as `mass = 0.1 + exp(z)`, z being the variable that the search moved;
    /// none for one without.
    pub change_of_variable: Option<String>,
    /// The standard error of the estimate if the noises of the model are those of the log: not multiplied by the
    /// covariance factor.
    pub nominal_standard_error: f64,
    /// Its unit, if the model tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

/// The values of a parameter, of level 95 %, with which the likelihood is not significantly below its largest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProfileInterval {
    /// The parameter's name.
    pub name: String,
    /// The lower end; none where the likelihood does not fall so far before the parameter's bound, or at all.
    pub low: Option<f64>,
    /// The upper end; none likewise.
    pub high: Option<f64>,
}

/// How the search for the largest likelihood went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LikelihoodSearch {
    /// How steps were chosen.
    #[serde(default)]
    pub algorithm: Algorithm,
    /// The step length of steepest descent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Step>,
    /// Iterations allowed, for each start.
    pub max_iterations: usize,
    /// Iterations done, from the start that won.
    pub iterations: usize,
    /// It stops when a step would raise the log-likelihood by no more than this fraction of half the measured values,
    /// or of half the sum of e^2/S where that is larger.
    pub tolerance: f64,
    /// Why it stopped.
    pub stopped: Stopped,
    /// The log-likelihood at the start that won and after each iteration from there.
    pub log_likelihoods: Vec<f64>,
    /// The seed of random starts, if there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The log-likelihood that each start led to, that of the model first; none where the filter does not work at the
    /// start. Empty if there was but one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reached: Vec<Option<f64>>,
}

/// Where a model's own start leads to no maximum: how many further points are drawn, from how many of them searches
/// begin, and within what factor of the model's own they lie, either way.
const DRAWN: usize = 60;
const FURTHER: usize = 6;
const FACTOR: f64 = 30.0;
/// Errors that are four times as large as the noises of the model say may be those of a maximum far below the
/// largest.
const HOPELESS: f64 = 16.0;

/// A noise without which the logarithm of the likelihood falls by no more than this is none.
const VANISHING: f64 = 1e-6;

/// What was found.
#[derive(Debug, Clone)]
pub(crate) struct EquationsEstimate {
    /// The parameters after the change of variable, and in their own units.
    pub(crate) z: Vec<f64>,
    pub(crate) values: Vec<f64>,
    /// Their covariance in their own units, as if the noises of the model were those of the log.
    pub(crate) covariance: DMatrix<f64>,
    /// The ratio of the longest to the shortest direction of psi, its columns scaled to unit norm.
    pub(crate) condition: f64,
    /// V, the negative logarithm of the likelihood.
    pub(crate) value: f64,
    /// The sum of e^2/S.
    pub(crate) squares: f64,
    /// How many values were measured.
    pub(crate) samples: usize,
    pub(crate) search: LikelihoodSearch,
}

/// The unknown parameters of the largest likelihood, which `criterion` computes; `failed` says where it cannot.
///
/// The search starts where the model says, and from `starts` further points: there the variables are drawn from what
/// the model knows of them, N(z, sd). What reaches the largest likelihood wins, the first of them where several do. All
/// of them are searched side by side; the result does not depend on how many threads there are.
///
/// Where no further ones are asked for or, with `own_start_only`, ruled out, and the model's own start leads to no
/// maximum, because the filter does not work there, the log does not tell the parameters apart where it ends, no step
/// raises the likelihood, or errors are far larger than the noises, further points are drawn over a wide range, and
/// searches begin at the best of them.
///
/// # Errors
/// As for [`fit_equations`](crate::report::fit_equations).
pub(crate) fn largest_likelihood<L: Likelihood + Send>(
    model: &GreyBox,
    criterion: impl Fn() -> L + Sync,
    failed: impl Fn(Failure) -> Error,
    options: &Search,
    own_start_only: bool,
    monitor: Monitor<'_>,
) -> Result<EquationsEstimate, Error> {
    let unknown = model.parameters();
    let starts = checked_starts(unknown, &criterion(), options)?;
    let deadline = Deadline::after(options.time_limit);
    let from = |starts: Vec<Vec<f64>>| -> Result<Vec<Result<Found, Failure>>, Error> {
        let searched = starts.into_par_iter().map(|start| {
            let mut deviance = Deviance::new(unknown, criterion());
            // No likelihood is so large that it cannot be larger.
            search(&mut deviance, &start, options, f64::NEG_INFINITY, deadline, monitor)
        });
        searched.collect()
    };
    let mut searched = from(starts)?;
    let explains = |ended: &L| ended.slopes().squares <= HOPELESS * ended.measurements() as f64;
    let mut ended = criterion();
    let own = estimate_of(unknown, &failed, options, searched.clone(), &mut ended);
    let is_a_maximum = own.as_ref().is_ok_and(|own| own.search.stopped != Stopped::NoDescent);
    if own_start_only || options.starts > 0 || (is_a_maximum && explains(&ended)) || deadline.is_over() {
        return own;
    }
    let further = further_starts(unknown, options.seed, &criterion);
    let options = Search { starts: further.len(), ..options.clone() };
    searched.extend(from(further)?);
    let best = estimate_of(unknown, &failed, &options, searched, &mut ended);
    // Where nothing explains the log, what is to be said is of the model's own start.
    if best.is_ok() && (own.is_ok() || explains(&ended)) { best } else { own }
}

/// The points with the largest likelihood of many that lie far around the start of the model: the distances to a bound,
/// or from zero, are spread evenly on a logarithmic scale.
fn further_starts<L: Likelihood>(
    unknown: &[Unknown],
    seed: u64,
    criterion: impl Fn() -> L + Sync,
) -> Vec<Vec<f64>> {
    let mut random = Rand64::new(u128::from(seed));
    let mut drawn = || -> Vec<f64> {
        let far = |unknown: &Unknown| {
            let (z, deviation) = unknown.start_variable();
            let spread = FACTOR.ln() * (2.0 * random.rand_float() - 1.0);
            match unknown.scale {
                Scale::Free if unknown.start == 0.0 => z + deviation * spread,
                Scale::Free => z * spread.exp(),
                // The variables of bounds are logarithms.
                _ => z + spread,
            }
        };
        unknown.iter().map(far).collect()
    };
    let points: Vec<Vec<f64>> = (0..DRAWN).map(|_| drawn()).collect();
    let values = points.par_iter().map(|point| criterion().evaluate(point).ok().filter(|v| v.is_finite()));
    let values: Vec<Option<f64>> = values.collect();
    let mut known: Vec<(f64, Vec<f64>)> =
        values.into_iter().zip(points).filter_map(|(value, point)| Some((value?, point))).collect();
    known.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    known.into_iter().take(FURTHER).map(|(_, point)| point).collect()
}

/// The same with a likelihood that others compute, from one start after the other. `failed` says where the filter
/// ceases to work.
pub(crate) fn largest_likelihood_of(
    criterion: impl Likelihood,
    unknown: &[Unknown],
    failed: impl Fn(Failure) -> Error,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<EquationsEstimate, Error> {
    let starts = checked_starts(unknown, &criterion, options)?;
    let deadline = Deadline::after(options.time_limit);
    let mut deviance = Deviance::new(unknown, criterion);
    let searched = starts
        .iter()
        .map(|start| search(&mut deviance, start, options, f64::NEG_INFINITY, deadline, monitor));
    let searched = searched.collect::<Result<_, Error>>()?;
    estimate_of(unknown, &failed, options, searched, &mut deviance.criterion)
}

/// The starts of a search that may begin.
fn checked_starts(
    unknown: &[Unknown],
    criterion: &impl Likelihood,
    options: &Search,
) -> Result<Vec<Vec<f64>>, Error> {
    options.check_numbers()?;
    let samples = criterion.measurements();
    if samples > unknown.len() {
        return Ok(starts(unknown, options));
    }
    let names: Vec<String> = unknown.iter().map(|unknown| unknown.name.clone()).collect();
    let message = format!(
        "{} unknown parameters need more than {samples} measured values; give more of them",
        names.len()
    );
    Err(Error::undetermined(names, message))
}

/// The estimate of the best search.
fn estimate_of(
    unknown: &[Unknown],
    failed: &impl Fn(Failure) -> Error,
    options: &Search,
    searched: Vec<Result<Found, Failure>>,
    criterion: &mut impl Likelihood,
) -> Result<EquationsEstimate, Error> {
    let names: Vec<String> = unknown.iter().map(|unknown| unknown.name.clone()).collect();
    let log_likelihood = |cost: f64| -cost / 2.0;
    let reached: Vec<Option<f64>> =
        searched.iter().map(|found| found.as_ref().ok().map(|found| log_likelihood(found.cost()))).collect();
    // The failure of the model's own start is what there is to say if no start works.
    let best = lowest(searched.iter().map(|found| found.as_ref().ok())).unwrap_or(0);
    let best =
        searched.into_iter().nth(best).ok_or_else(|| Error::data("there is no start to search from"))?;
    let mut found = best.map_err(failed)?;

    let vanishing = without_noises(unknown, &mut found.parameters, criterion);
    criterion.linearize(&found.parameters).map_err(failed)?;
    let slopes: Vec<f64> =
        unknown.iter().zip(&found.parameters).map(|(unknown, z)| unknown.scale.slope(*z)).collect();
    let information = &criterion.slopes().information;
    let (covariance, condition) = uncertainty::covariance(information, &slopes, &names, &vanishing)?;
    uncertainty::check(unknown, &found.parameters, &covariance)?;
    Ok(EquationsEstimate {
        values: unknown.iter().zip(&found.parameters).map(|(unknown, &z)| unknown.inside(z)).collect(),
        covariance,
        condition,
        value: found.cost() / 2.0,
        squares: criterion.slopes().squares,
        samples: criterion.measurements(),
        search: LikelihoodSearch {
            algorithm: options.algorithm,
            step: (options.algorithm == Algorithm::Gradient).then_some(options.step),
            max_iterations: options.max_iterations,
            iterations: found.costs.len() - 1,
            tolerance: options.tolerance,
            stopped: found.stopped,
            log_likelihoods: found.costs.iter().map(|cost| log_likelihood(*cost)).collect(),
            seed: (options.starts > 0).then_some(options.seed),
            reached: if options.starts > 0 { reached } else { Vec::new() },
        },
        z: found.parameters,
    })
}

/// Noises that are drawn to their lower bound go there, if the likelihood does not fall by it: the search only comes
/// near. Which of them did.
fn without_noises(unknown: &[Unknown], z: &mut [f64], criterion: &mut impl Likelihood) -> Vec<bool> {
    let mut vanishing = vec![false; z.len()];
    let Ok(value) = criterion.evaluate(z) else { return vanishing };
    for (index, unknown) in unknown.iter().enumerate() {
        let has_bound = matches!(unknown.scale, Scale::Above(_) | Scale::Between(..));
        if !(unknown.of_noise && has_bound) {
            continue;
        }
        let found = std::mem::replace(&mut z[index], f64::NEG_INFINITY);
        let falls = criterion.evaluate(z).map_or(f64::INFINITY, |without| without - value);
        // Not for NaN either.
        vanishing[index] = falls <= VANISHING;
        if !vanishing[index] {
            z[index] = found;
        }
    }
    vanishing
}

/// The start that the model says, and random ones.
fn starts(unknown: &[Unknown], options: &Search) -> Vec<Vec<f64>> {
    let mut random = Rand64::new(u128::from(options.seed));
    let own = unknown.iter().map(|unknown| unknown.start_variable().0).collect();
    let mut drawn = || {
        let near = |unknown: &Unknown| {
            let (z, deviation) = unknown.start_variable();
            z + deviation * normal_number(&mut random)
        };
        unknown.iter().map(near).collect()
    };
    let more: Vec<Vec<f64>> = (0..options.starts).map(|_| drawn()).collect();
    std::iter::once(own).chain(more).collect()
}

impl Unknown {
    /// The value of a variable. What rounds to a bound is the number next to it: none but a noise that vanishes reaches
    /// its bound.
    fn inside(&self, z: f64) -> f64 {
        let (min, max) = self.bounds();
        let mut value = self.scale.value(z);
        if z == f64::NEG_INFINITY {
            return value;
        }
        value = min.map_or(value, |min| value.max(min.next_up()));
        max.map_or(value, |max| value.min(max.next_down()))
    }

    fn bounds(&self) -> (Option<f64>, Option<f64>) {
        match self.scale {
            Scale::Free => (None, None),
            Scale::Above(min) => (Some(min), None),
            Scale::Below(max) => (None, Some(max)),
            Scale::Between(min, max) => (Some(min), Some(max)),
        }
    }

    /// What was known of it, beside a standard error.
    pub(crate) fn reported(&self, nominal_standard_error: f64) -> UnknownParameter {
        let (min, max) = self.bounds();
        UnknownParameter {
            name: self.name.clone(),
            start: self.start,
            min,
            max,
            change_of_variable: self.change_of_variable(),
            nominal_standard_error,
            unit: self.unit.clone(),
        }
    }
}
