//! Processes in continuous time: the least errors of a free run.
//!
//! ```text
//! min over shape, theta, weights of sum e(t)^2,   e = y - sum_j w_j'c_j(t; shape_j, theta_j) - level - slope (t - t_m) - free response
//! ```
//!
//! Gains, level, slope and the free response enter linearly and are least squares for each shape and dead time:
//! variable projection (Golub and Pereyra 1973), with Kaufman's derivative (1975), psi less its part in the span of
//! these columns. The search moves the logarithms of time constants, and the dead times. It starts from the best of a
//! grid with one lag, and adds lags one by one.
//!
//! Residuals of a plant that nobody drives by noise alone have a colour, and there the covariance of white noise is far
//! too small. It is that of errors e = v/A(q), A an autoregression of the residuals (see `uncertainty`), and no
//! standard error is less than that of white errors.

mod objective;
mod refined;
mod starts;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Algorithm, Deadline, Found, Monitor, Search, Step, Stopped};
use thetahat_numerics::regression::{Span, condition, sum_of_squares};

use super::prediction_error::backward_products;
use super::response_points::ResponsePoints;
use super::uncertainty::{Autoregression, coloured, restricted};
use crate::Error;
use crate::model::{Parts, ProcessStructure, is_covariance};
use crate::respond::process::HeldLog;
pub(crate) use objective::Background;
use objective::ProcessObjective;

/// How a process was found: by the least errors of its free run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProcessOutcome {
    /// The standard errors of the parameters if the errors were white, in their order: those of the model are for
    /// errors of any colour.
    pub white_standard_errors: Vec<Option<f64>>,
    /// The order of the autoregression that the colour of the errors was taken from.
    pub noise_order: usize,
    /// Free responses that were estimated, of logs that do not begin at rest.
    pub initial_conditions: usize,
    /// Whether, in a frequency response without errors of its own, errors were taken for relative to each point.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub relative: bool,
    /// How steps were chosen.
    pub algorithm: Algorithm,
    /// The step length of steepest descent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Step>,
    /// The relative decrease of the cost at which to stop.
    pub tolerance: f64,
    /// Iterations allowed, for each start.
    pub max_iterations: usize,
    /// Iterations done, from the start that won.
    pub iterations: usize,
    /// The mean of e^2 at that start and after each iteration.
    pub costs: Vec<f64>,
    /// Why it stopped.
    pub stopped: Stopped,
}

/// Processes and what is beside them: all that a free run at rest takes.
#[derive(Debug, Clone)]
pub(crate) struct FreeRun {
    /// The parameters of all inputs, one after the other.
    pub(crate) parameters: Vec<f64>,
    /// The level at the middle of the rows, and the slope, as far as they were estimated.
    pub(crate) level: Option<f64>,
    pub(crate) slope: Option<f64>,
    pub(crate) middle: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub(crate) struct ProcessEstimate {
    pub(crate) run: FreeRun,
    /// The fraction of the squared errors that a first state of each log would explain.
    pub(crate) explained_by_starts: f64,
    /// Of the parameters, the level and the slope.
    pub(crate) covariance: Option<Vec<Vec<f64>>>,
    pub(crate) noise_variance: f64,
    /// N, and the unknowns that are estimated.
    pub(crate) samples: usize,
    pub(crate) unknowns: usize,
    pub(crate) mse: f64,
    pub(crate) condition: Option<f64>,
    pub(crate) outcome: ProcessOutcome,
}

/// Fits processes from held inputs, which are deviations, to an output; `output` and `held` are of the same whole log.
///
/// # Errors
/// [`Error::Undetermined`] if there are too few samples, or they do not determine a parameter; [`Error::Data`] if
/// squares leave the range of numbers; [`Error::Interrupted`] if the monitor says so.
pub(crate) fn least_free_run(
    structures: &[ProcessStructure],
    names: &[String],
    (held, output): (&[HeldLog], &[f64]),
    background: Background,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<ProcessEstimate, Error> {
    let objective = ProcessObjective::new(structures.to_vec(), held, output, background)?;
    least(objective, structures, names, background.columns(held, structures), options, monitor)
}

/// The same from the parameters of another fit, whose dead times it has, and without any uncertainty. None where a time
/// constant moves by more than a factor of 1.5: these samples do not determine it.
///
/// # Errors
/// As for [`least_free_run`].
pub(crate) fn least_free_run_from(
    start: &[f64],
    structures: &[ProcessStructure],
    (held, output): (&[HeldLog], &[f64]),
    background: Background,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Option<FreeRun>, Error> {
    let mut objective = ProcessObjective::new(structures.to_vec(), held, output, background)?;
    starts::searched_from(&mut objective, structures, start, options, monitor)?;
    Ok((!objective.is_at_a_limit()).then(|| free_run(&objective, structures)))
}

fn free_run(objective: &ProcessObjective<'_>, structures: &[ProcessStructure]) -> FreeRun {
    let (level, slope) = objective.level();
    let parameters =
        structures.iter().zip(objective.parts()).flat_map(|(structure, parts)| structure.put_together(parts));
    FreeRun { parameters: parameters.collect(), level, slope, middle: objective.middle() }
}

/// Fits processes to measured frequency responses, one for each structure.
///
/// # Errors
/// As for logs.
pub(crate) fn least_response_errors(
    structures: &[ProcessStructure],
    names: &[String],
    points: &[ResponsePoints],
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<ProcessEstimate, Error> {
    let objective = ProcessObjective::of_points(structures.to_vec(), points)?;
    least(objective, structures, names, 0, options, monitor)
}

fn least(
    mut objective: ProcessObjective<'_>,
    structures: &[ProcessStructure],
    names: &[String],
    beside: usize,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<ProcessEstimate, Error> {
    options.check_numbers()?;
    let samples = objective.outputs().len();
    let unknowns = names.len() + beside;
    if samples <= unknowns {
        let more = if objective.is_of_points() { "more points" } else { "a longer log" };
        let message = format!(
            "{unknowns} unknowns need more than {samples} measured values; give {more}, or a simpler structure"
        );
        return Err(Error::undetermined(names.to_vec(), message));
    }
    if !sum_of_squares(objective.outputs()).is_finite() {
        return Err(Error::data("squares of the output leave the range of numbers; scale it towards one"));
    }
    let deadline = Deadline::after(options.time_limit);
    let found = starts::searched(&mut objective, structures, options, deadline, monitor)?;
    let parts = objective.parts().to_vec();
    let run = free_run(&objective, structures);
    if let Some((name, value)) = names.iter().zip(&run.parameters).find(|(_, value)| !value.is_finite()) {
        return Err(Error::undetermined(
            vec![name.clone()],
            format!("{name} comes to {value}: the log does not determine it; take a simpler structure"),
        ));
    }
    let squares = sum_of_squares(objective.residuals());
    let Uncertainty { covariance, white, colour, condition } =
        uncertainty(&objective, structures, names, &parts, unknowns, squares)?;
    let noise_variance = squares / (samples - unknowns) as f64;
    if !noise_variance.is_finite() {
        return Err(Error::data("the noise variance overflows; scale the output towards one"));
    }
    Ok(ProcessEstimate {
        run,
        explained_by_starts: objective.explained_by_starts(),
        covariance,
        noise_variance,
        samples,
        unknowns,
        mse: squares / samples as f64,
        condition,
        outcome: outcome(
            options,
            &found,
            white,
            colour.order(),
            beside - objective.background().offsets(),
            (samples, objective.is_relative()),
        ),
    })
}

fn outcome(
    options: &Search,
    found: &Found,
    white: Vec<Option<f64>>,
    noise_order: usize,
    initial_conditions: usize,
    (samples, relative): (usize, bool),
) -> ProcessOutcome {
    ProcessOutcome {
        white_standard_errors: white,
        noise_order,
        initial_conditions,
        relative,
        algorithm: options.algorithm,
        step: (options.algorithm == Algorithm::Gradient).then_some(options.step),
        tolerance: options.tolerance,
        max_iterations: options.max_iterations,
        iterations: found.costs.len() - 1,
        costs: found.costs.iter().map(|cost| cost / samples as f64).collect(),
        stopped: found.stopped,
    }
}

/// Where the dead times of outputs that jump with their input stand among the parameters, and which input it is.
fn jumping_dead_times(structures: &[ProcessStructure]) -> Vec<(usize, usize)> {
    let mut end = 0;
    let places = structures.iter().enumerate().filter_map(|(input, structure)| {
        end += structure.parameters();
        // It is the last one.
        (structure.acts_at_once() && structure.has_dead_time()).then_some((end - 1, input))
    });
    places.collect()
}

struct Uncertainty {
    covariance: Option<Vec<Vec<f64>>>,
    white: Vec<Option<f64>>,
    colour: Autoregression,
    condition: Option<f64>,
}

/// The covariance of a fit to points, whose errors are as large as the points say, and larger where they are missed by
/// more; those that are not known, and relative to each point, are as large as the fit misses them:
///
/// ```text
/// (Psi' Psi)^-1 (sum rho_kl psi_k psi_l') (Psi' Psi)^-1
/// ```
///
/// with the correlations rho of the points' errors, which is (Psi' Psi)^-1 where these are independent (White 1980).
fn of_points(
    root: Option<DMatrix<f64>>,
    spread: &DMatrix<f64>,
    used: &[usize],
    count: usize,
    (variance, is_relative): (f64, bool),
    condition: Option<f64>,
) -> Uncertainty {
    let colour = Autoregression { monic: vec![1.0], variance };
    let independent = root.map(|root| &root * root.transpose());
    let inverse = independent.as_ref().map(|inverse| coloured(inverse, 1.0, spread));
    let place = |index: usize| used.iter().position(|own| *own == index);
    let entry = |i: usize, j: usize| Some(inverse.as_ref()?[(place(i)?, place(j)?)]);
    let larger = if is_relative { variance } else { variance.max(1.0) };
    let alone = if is_relative { variance } else { 1.0 };
    let rows: Option<Vec<Vec<f64>>> =
        (0..count).map(|i| (0..count).map(|j| Some(larger * entry(i, j)?)).collect()).collect();
    let white =
        (0..count).map(|i| Some((alone * independent.as_ref()?[(place(i)?, place(i)?)]).sqrt())).collect();
    Uncertainty { covariance: rows.filter(|rows| is_covariance(rows)), white, colour, condition }
}

/// The covariance of the parameters, the level and the slope, the free responses taken out.
fn uncertainty(
    objective: &ProcessObjective<'_>,
    structures: &[ProcessStructure],
    names: &[String],
    parts: &[Parts<f64>],
    unknowns: usize,
    squares: f64,
) -> Result<Uncertainty, Error> {
    let psi = objective.slopes(structures, parts);
    let kept = names.len() + objective.background().offsets();
    // The columns of unit norm, those of level, slope and free responses first: what follows is what they leave. Last
    // the dead times of outputs that jump, which others may stand for: see `past_jumps`.
    let norms: Vec<f64> = psi.iter().map(|column| sum_of_squares(column).sqrt()).collect();
    let jumping = jumping_dead_times(structures);
    // An integrator's own state is a level: that is kept of the two.
    let first = (names.len()..psi.len())
        .chain((0..names.len()).filter(|place| !jumping.iter().any(|(own, _)| own == place)));
    let order: Vec<usize> = first.chain(jumping.iter().map(|(place, _)| *place)).collect();
    let mut span = Span::default();
    let mut used = Vec::new();
    let mut open = Vec::new();
    for (number, &place) in order.iter().enumerate() {
        let unit: Vec<f64> = psi[place].iter().map(|value| value / norms[place]).collect();
        let has = span.take_from(&mut unit.clone());
        if span.add(unit) {
            used.push(place);
        } else if let Some((_, input)) = jumping.iter().find(|(own, _)| *own == place) {
            // Moved by one second, it is made up for by so much of the others.
            let mut moves = vec![0.0; kept];
            let weights = span.weights(&has);
            for (own, weight) in order[..number].iter().zip(weights).filter(|(own, _)| **own < kept) {
                moves[*own] = -weight * norms[place] / norms[*own];
            }
            moves[place] = 1.0;
            let [low, high] = objective.gap(*input, parts[*input].dead_time);
            // As if it could be anywhere in between.
            open.push((moves, (high - low).powi(2) / 12.0));
        } else if let Some(name) = names.get(place) {
            let nothing = 2.0 * objective.least_time_constant();
            let lags =
                structures.iter().zip(parts).filter(|(structure, _)| !structure.is_transfer_function());
            let vanished =
                lags.map(|(_, parts)| parts).any(|parts| parts.shape.iter().any(|value| *value < nothing));
            let advice = if vanished && !objective.background().free {
                "a time constant comes to nothing beside the samples; take one lag less, or, if the log does not begin at rest, estimate \
                 the state that it begins in"
            } else if vanished {
                "a time constant comes to nothing beside the samples; take one lag less"
            } else {
                "other values explain it as well; take a simpler structure, or a log in which the input moves more"
            };
            return Err(Error::undetermined(
                vec![name.clone()],
                format!("the log does not determine {name}: {advice}"),
            ));
        }
    }
    let triangle = span.triangle();
    let condition = condition(&triangle, objective.outputs().len());
    let size = used.len();
    let samples = objective.outputs().len();
    let variance = squares / (samples - unknowns) as f64;
    let root = triangle.solve_upper_triangular(&DMatrix::identity(size, size)).map(|mut root| {
        root.row_iter_mut().zip(&used).for_each(|(mut row, place)| row /= norms[*place]);
        root
    });
    if objective.is_of_points() {
        let columns: Vec<&Vec<f64>> = used.iter().map(|place| &psi[*place]).collect();
        let spread = ResponsePoints::spread(objective.points(), &columns);
        let own = (variance, objective.is_relative());
        return Ok(of_points(root, &spread, &used, names.len(), own, condition));
    }
    let (residuals, columns, segments) = objective.by_segments(&psi, &used);
    let whole: Vec<usize> = (0..size).collect();
    let stacked =
        || whole.iter().map(|column| columns.iter().flat_map(|own| own[*column].clone()).collect()).collect();
    let colour = restricted(&residuals, stacked, &segments, unknowns);
    let Some(root) = root else {
        return Ok(Uncertainty { covariance: None, white: vec![None; names.len()], colour, condition });
    };
    let plain = &root * root.transpose() * variance;
    let products = backward_products(&columns, &colour.monic);
    let inverse = &root * root.transpose();
    let spread = coloured(&inverse, colour.variance * colour.inflation(samples, unknowns), &products);
    let place = |index: usize| used.iter().position(|own| *own == index);
    // The uncertainty of a jumping dead time alone is in `open`.
    let is_open = |index: usize| {
        open.iter().any(|(moves, _): &(Vec<f64>, f64)| place(index).is_none() && moves[index] != 0.0)
    };
    let entry = |matrix: &DMatrix<f64>, i: usize, j: usize| {
        let own = match (place(i), place(j)) {
            (Some(i), Some(j)) => matrix[(i, j)],
            (None, _) if is_open(i) => 0.0,
            (_, None) if is_open(j) => 0.0,
            _ => return None,
        };
        let further = open.iter().map(|(moves, variance)| variance * moves[i] * moves[j]);
        Some(own + further.sum::<f64>())
    };
    // What a wrong structure leaves may be predicted by its past so well that nothing seems open. No error is less than
    // for white errors.
    let larger = |i: usize| {
        let ratio =
            entry(&plain, i, i).zip(entry(&spread, i, i)).map(|(plain, spread)| (plain / spread).sqrt());
        ratio.filter(|ratio| ratio.is_finite()).map_or(1.0, |ratio| ratio.max(1.0))
    };
    let larger: Vec<f64> = (0..kept).map(larger).collect();
    let scaled = |i: usize, j: usize| entry(&spread, i, j).map(|value| larger[i] * larger[j] * value);
    let rows: Option<Vec<Vec<f64>>> = (0..kept).map(|i| (0..kept).map(|j| scaled(i, j)).collect()).collect();
    let white = (0..names.len()).map(|i| entry(&plain, i, i).map(f64::sqrt)).collect();
    Ok(Uncertainty { covariance: rows.filter(|rows| is_covariance(rows)), white, colour, condition })
}
