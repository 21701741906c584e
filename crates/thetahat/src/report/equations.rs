//! Fits of models in equations.

mod response;
#[cfg(test)]
mod tests;
mod warnings;

pub use response::fit_equations_to_response;

use thetahat_numerics::distribution::chi_square_interval;
use thetahat_numerics::optimize::{Monitor, Search};

use super::evaluate::evaluate;
use super::schema::{Estimation, Report};
use super::shares::Shares;
use crate::Error;
use crate::data::{Log, Rows, Source, Split};
use crate::estimate::{
    Answer, Ask, Criteria, DistributedLikelihood, EquationsOutcome, Holders, NullDistribution, Procedure,
    ProfileInterval, Question,
    equations::{
        EquationsEstimate, Likelihood, LikelihoodObjective, intervals, largest_likelihood,
        largest_likelihood_of,
    },
};
use crate::model::{EquationsModel, GreyBox};
use crate::respond::{
    NisCount, NisSummary,
    equations::{EquationsOnLog, Experiment, Failure, Predictor, experiments, walk},
};
use crate::select::Focus;
use crate::validate::{Part, Residuals};

/// Lags of the test of whiteness that a fit warns by, and its levels.
const LAGS: usize = 20;
const LEVEL: f64 = 0.05;

/// What to fit a model in equations to, and how.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EquationsPlan {
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// Cuts the rows to estimate on into parts: the fit is to the first two, and evaluated on the third.
    pub split: Option<Split>,
    /// How to search; `initial_parameters` and `plant_first` do not apply.
    pub search: Search,
    /// Whether searches from the start of the model alone are left at that, where it leads to no maximum.
    pub own_start_only: bool,
    /// Whether intervals by profile likelihood are computed.
    pub profile: bool,
}

impl EquationsPlan {
    /// The rows of a log of so many that a fit is to.
    ///
    /// # Errors
    /// [`Error::Argument`] for rows that are not there.
    pub fn fitted_rows(&self, rows: usize) -> Result<Vec<Rows>, Error> {
        Ok(Shares::of(&self.estimate, &self.validate, self.split, rows)?.estimation)
    }
}

/// Finds the unknown parameters of a model in equations in a log, or in several that are joined, and reports on it.
///
/// The predictor is the extended Kalman filter with the noises of the model. With its innovations e and their variances
/// S over all values of outputs that were measured, the estimate is
///
/// ```text
/// p^ = argmin V(p),   V = 1/2 sum (e^2/S + ln 2 pi S)
/// ```
///
/// the maximum-likelihood estimate where innovations are Gaussian. Without process noise that is output error with an
/// estimated initial state, of which the model knows `start` and `sd`. Each log starts from there anew. Of an unknown
/// parameter the fit uses `start`, where the search begins, and its bounds; `walk` is for a filter that estimates it
/// with the state. A search finds the minimum that its start leads to. Further starts, as many as `search.starts` says,
/// are drawn from what the model knows of the parameters, start and `sd` after the change of variable; the largest
/// likelihood that is reached wins. Where none are asked for and the search leads to no maximum that explains the log,
/// some are drawn over three decades, unless `own_start_only` says otherwise.
///
/// **Rows.** The state of the first row that is estimated on is the model's start, in each log. Rows of it that are not
/// asked for but stand after go through the filter and do not count; so is the model evaluated on other rows of these
/// logs. Each further row is predicted over the time from the row before, with that row's inputs, and then corrected by
/// its own outputs. The clock may be irregular ([`Log::recorded`](crate::data::Log::recorded)). A missing output (NaN)
/// is left out alone; a missing input holds the value before it, zero before the first.
///
/// **Search.** Fisher scoring with the damping of Levenberg and Marquardt, unless `search.algorithm` says otherwise:
/// the information stands for the Gauss-Newton matrix; Newton and Raphson's Hessian comes from differences of the
/// gradient. Derivatives of e and S are exact: the filter is computed in dual numbers. `monitor` is told of V divided
/// by the number of measured values before each iteration, on the thread that searches.
///
/// **Standard errors** come from the inverse of the information, with e_i and S_i the derivatives by parameter i,
///
/// ```text
/// I_ij = sum (e_i e_j/S + S_i S_j/(2 S^2))
/// ```
///
/// which holds if the noises of the model are those of the log. Then the mean of e^2/S is 1. Where it is above 1, the
/// covariance is multiplied by it: that is right if all noises are too small by one factor, and a good guess else.
/// Where it is below 1 the covariance stays, as too large a noise must not make an estimate look certain. The report
/// has the plain ones too.
///
/// For n states, m outputs, p parameters and N rows an iteration costs O(N (n^3 + m n^2) p).
///
/// Source: Ljung, System Identification, 2nd ed. 1999, sections 7.2 to 7.4; Gupta and Mehra 1974; Segal and Weinstein
/// 1989.
///
/// # Errors
/// [`Error::Argument`] if nothing in the model is unknown, or for rows that are not there; [`Error::Data`] if a channel
/// is not there, the clock does not run forward, a step is not one that the model can take, or the filter leaves the
/// range of numbers where the search starts; [`Error::Undetermined`] with the parameters that the logs leave open, or
/// that ran away to where they have no effect; [`Error::Interrupted`] if the monitor says so.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::GreyBox;
/// use thetahat::report::{EquationsPlan, fit_equations};
///
/// let model = GreyBox::from_toml(
///     "sample_time = 1
///      [states]
///      level = { start = 0, sd = 0.1 }
///      [inputs]
///      flow = \"u\"
///      [parameters]
///      area = { start = 1, sd = 1, unknown = true, min = 0 }
///      [next]
///      level = \"level + dt * (flow - 0.1 * level) / area\"
///      [outputs]
///      y = \"level\"
///      [noise]
///      measurement = { y = 0.01 }",
/// )?;
/// // A tank of 2 m^2.
/// let u: Vec<f64> = (0..100).map(|t| f64::from(t / 10 % 3)).collect();
/// let mut y = vec![0.0];
/// for t in 1..u.len() {
///     y.push(y[t - 1] + (u[t - 1] - 0.1 * y[t - 1]) / 2.0);
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
/// let report = fit_equations(&model, &log, &[], &EquationsPlan::default(), &|_| ControlFlow::Continue(()))?;
/// assert!((report.model.parameters()[0].value - 2.0).abs() < 1e-3);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_equations(
    model: &GreyBox,
    log: &Log,
    sources: &[Source],
    plan: &EquationsPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    fit(
        model,
        log,
        sources,
        plan,
        |experiments| {
            let criterion = || LikelihoodObjective::new(model, experiments);
            let failed = |failure: Failure| failure.error(experiments);
            largest_likelihood(model, criterion, failed, &plan.search, plan.own_start_only, monitor)
        },
        monitor,
    )
}

/// The same, but others compute the likelihood and its slopes for each point where the search stands: each holder has
/// some of the logs that `log` is [joined](Log::join) of, `counts` of them, in their order, and gives an
/// [`answer_equations`] to what `ask` hands on. One search begins after the other. For logs of a few rows too: a row
/// costs O((n^3 + m n^2) p) operations.
///
/// # Errors
/// As for [`fit_equations`], and what `ask` says; [`Error::Argument`] for a plan with rows to fit to or to validate on,
/// or counts of other logs.
pub fn fit_equations_distributed(
    model: &GreyBox,
    (log, sources): (&Log, &[Source]),
    plan: &EquationsPlan,
    counts: &[usize],
    ask: Ask<'_>,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    if !plan.estimate.is_empty() || !plan.validate.is_empty() || plan.split.is_some() {
        let message = "all rows serve for the fit; cut the experiments, and validate the model on other ones";
        return Err(Error::argument("rows", message));
    }
    if plan.profile {
        return Err(Error::argument(
            "profile",
            "it needs the logs themselves, which others hold; leave it out",
        ));
    }
    if counts.iter().sum::<usize>() != log.logs().count() {
        return Err(Error::argument(
            "counts",
            "they are not those of the logs; count the logs of each holder",
        ));
    }
    fit(
        model,
        log,
        sources,
        plan,
        |experiments| {
            let holders = Holders::new(ask, counts.len());
            let criterion = DistributedLikelihood::new(&holders, counts, model, experiments);
            let failed = |failure: Failure| failure.error(experiments);
            let found = largest_likelihood_of(criterion, model.parameters(), failed, &plan.search, monitor);
            holders.failure().map_or(found, Err)
        },
        monitor,
    )
}

/// What the logs of one holder answer, see [`fit_equations_distributed`].
///
/// # Errors
/// [`Error::Argument`] if the question is about another model; [`Error::Data`] for a channel that is not there, and a
/// step that the model cannot take.
pub fn answer_equations(model: &GreyBox, log: &Log, question: &Question) -> Result<Answer, Error> {
    let all = [Rows::new(1, log.rows())?];
    question.answered_by_equations(model, &experiments(model, log, &all, &all)?)
}

/// That there is something to fit.
fn something_unknown(model: &GreyBox) -> Result<(), Error> {
    if model.parameters().is_empty() {
        return Err(Error::argument(
            "model",
            "none of its parameters is unknown; give one as { start = …, sd = …, unknown = true }",
        ));
    }
    Ok(())
}

/// The report of what a search finds in the experiments of a log.
fn fit(
    model: &GreyBox,
    log: &Log,
    sources: &[Source],
    plan: &EquationsPlan,
    search: impl FnOnce(&[Experiment]) -> Result<EquationsEstimate, Error>,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    something_unknown(model)?;
    let names: Vec<&str> = model.inputs().iter().chain(model.outputs()).map(String::as_str).collect();
    let absent: Vec<&str> = names.iter().filter(|name| !log.has(name)).copied().collect();
    if let Some(name) = absent.first() {
        let found: Vec<&str> = log.channels().iter().map(|channel| channel.name.as_str()).collect();
        let message = format!(
            "the model needs channel '{name}', the log has: {}; rename one of them",
            found.join(", ")
        );
        return Err(Error::in_channel(name, None, message));
    }
    let shares = Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let fitted_to = experiments(model, log, &shares.estimation, &shares.estimation)?;
    let found = search(&fitted_to)?;
    let Errors { nis, mse, noise } = errors(model, &fitted_to, &found)?;
    let factor = nis.map_or(1.0, |nis| nis.relative().max(1.0));
    let profile = if plan.profile {
        let criterion = || LikelihoodObjective::new(model, &fitted_to);
        profiled(model, criterion, &found, factor, &plan.search, monitor)?
    } else {
        Vec::new()
    };
    let covariance = found.covariance.row_iter().map(|row| row.iter().map(|value| value * factor).collect());
    let fitted = EquationsModel::new(model, &found.values, covariance.collect(), &noise);

    let segments = fitted_to.iter().flat_map(|experiment| {
        let rows = experiment.counted().iter();
        rows.map(|rows| Rows::from_positions(&(rows.start + experiment.first..rows.end + experiment.first)))
    });
    let data = shares.into_data((log, sources), &names, "none".to_owned(), segments.collect())?;
    let own = EquationsOnLog::new(&fitted, log, &data.estimation, &data.estimation)?;
    let unknown = model.parameters().iter().enumerate();
    let unknown = unknown.map(|(index, unknown)| unknown.reported(found.covariance[(index, index)].sqrt()));
    let samples = found.samples as f64;
    // The mean square of errors of which the Gaussian likelihood is this one.
    let cost = (2.0 * found.value / samples - 1.0 - std::f64::consts::TAU.ln()).exp();
    let estimation = Estimation {
        procedure: Procedure::from(EquationsOutcome {
            log_likelihood: -found.value,
            nis,
            covariance_factor: factor,
            unknown: unknown.collect(),
            profile,
            starts: own.starts(),
            search: found.search,
        }),
        initial: None,
        level: None,
        slope: None,
        samples: found.samples,
        mse,
        criteria: Criteria::new(cost, found.values.len(), found.samples),
        condition: Some(found.condition),
    };
    let walking: Vec<String> = model
        .parameters()
        .iter()
        .filter(|unknown| unknown.walk > 0.0)
        .map(|unknown| unknown.name.clone())
        .collect();
    let mut words = warnings::of_inputs(model, &fitted_to, log.rows());
    words.extend(warnings::of_fit(&fitted, &estimation, &walking));
    words.extend(warnings::of_colour(&own, |tested| {
        let residuals = Residuals::of(tested, NullDistribution::Known, LAGS, &[LEVEL], LEVEL);
        residuals.ok().map(|residuals| residuals.ljung_box)
    }));
    let mut report = Report::new(data, fitted.clone(), estimation);
    report.warnings.extend(words);
    evaluate(&mut report, &own, Part::Estimation, Focus::Auto);
    for (part, rows) in report.data.held_out() {
        let on_log = EquationsOnLog::new(&fitted, log, &rows, &report.data.estimation)?;
        evaluate(&mut report, &on_log, part, Focus::Auto);
    }
    Ok(report.with_purpose())
}

/// The intervals of the parameters by profile likelihood.
fn profiled<L: Likelihood>(
    model: &GreyBox,
    criterion: impl Fn() -> L + Sync,
    found: &EquationsEstimate,
    factor: f64,
    search: &Search,
    monitor: Monitor<'_>,
) -> Result<Vec<ProfileInterval>, Error> {
    let named = model.unknown().zip(intervals(model, criterion, found, factor, search, monitor)?);
    Ok(named.map(|(name, [low, high])| ProfileInterval { name: name.to_owned(), low, high }).collect())
}

/// How large the innovations of a fit are.
struct Errors {
    /// Of each row with something measured, the sum of e^2/S: as the filter's elements come one after the other, each
    /// with the variance that is left by those before, this is the normalised innovation squared of the row.
    nis: Option<NisSummary>,
    /// The mean of (y - h(x^))^2.
    mse: f64,
    /// The mean variance of the noise of each output.
    noise: Vec<f64>,
}

fn errors(model: &GreyBox, experiments: &[Experiment], found: &EquationsEstimate) -> Result<Errors, Error> {
    let mut count = NisCount::default();
    let mut row = None;
    let (mut nis, mut measured) = (0.0, 0);
    let mut squares = 0.0;
    let mut noise = vec![(0.0, 0.0); model.outputs().len()];
    let bounds: Vec<_> = (0..=model.outputs().len()).map(chi_square_interval).collect();
    let mut add = |nis: f64, measured: usize| {
        if let Some(bounds) = bounds[measured] {
            count.add(nis, measured, bounds);
        }
    };
    walk(model, experiments, &mut Predictor::new(model), &found.z, |at, prediction, innovation| {
        if row.replace((at.log, at.row)).is_some_and(|row| row != (at.log, at.row)) {
            add(nis, measured);
            (nis, measured) = (0.0, 0);
        }
        nis += innovation.error * innovation.error / innovation.variance;
        measured += 1;
        noise[at.output].0 += innovation.noise;
        noise[at.output].1 += 1.0;
        squares += (experiments[at.log].output(at.row)[at.output] - prediction).powi(2);
    })
    .map_err(|failure| failure.error(experiments))?;
    add(nis, measured);
    let noise = noise.into_iter().map(|(sum, count)| if count == 0.0 { 0.0 } else { sum / count }).collect();
    Ok(Errors { nis: count.summary(), mse: squares / found.samples as f64, noise })
}
