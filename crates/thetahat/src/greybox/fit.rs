//! Fits of models in equations by prediction errors.

mod criterion;
mod document;
mod experiment;
mod figures;
mod free_run;
mod predictor;
mod search;
#[cfg(test)]
mod tests;
mod uncertainty;
mod warnings;

use criterion::{Criterion, Failure};
pub use document::{GreyFit, GreyOutput, GreyParameter, GreyReport, GreySearch, GreyState};
use experiment::Experiment;
use figures::Figures;
use search::search;
use uncertainty::covariance;

use super::{GreyBox, Scale, Unknown};
use crate::estimate::Monitor;
use crate::{Document, Error, Recording, Source};

/// Iterations at most.
const MAX_ITERATIONS: usize = 100;
/// The relative decrease of the criterion at which to stop.
const TOLERANCE: f64 = 1e-8;

/// Finds the unknown parameters of a model in equations from one or several logs, by prediction errors.
///
/// The predictor is the extended Kalman filter with the noises of the model. With its innovations e and their variances S
/// over all values of outputs that were measured, the estimate is
///
/// ```text
/// p^ = argmin V(p),   V = 1/2 sum (e^2/S + ln 2 pi S)
/// ```
///
/// the maximum-likelihood estimate where innovations are Gaussian. Without process noise that is output error with an
/// estimated initial state, of which the model knows `start` and `sd`. Each log starts from there anew. Of an unknown
/// parameter the fit uses `start`, where the search begins, and its bounds: `sd` and `walk` are for a filter that estimates it
/// with the state. A search finds the minimum that its start leads to; another start may find a lower one.
///
/// **Rows.** The state of the first row is the model's start. Each further row is predicted over the time from the row before,
/// with that row's inputs, and then corrected by its own outputs. The clock may be irregular. A missing output (NaN)
/// is left out alone; a missing input holds the value before it, zero before the first.
///
/// **Search.** Fisher scoring with the damping of Levenberg and Marquardt. Derivatives of e and S are exact: the filter is
/// computed in dual numbers. `monitor` is told of V divided by the number of readings before each iteration.
///
/// **Standard errors** come from the inverse of the information, with e_i and S_i the derivatives by parameter i,
///
/// ```text
/// I_ij = sum (e_i e_j/S + S_i S_j/(2 S^2))
/// ```
///
/// which holds if the noises of the model are those of the log. Then the mean of e^2/S is 1. Where it is above 1, the covariance is multiplied by it: that is
/// right if all noises are too small by one factor, and a good guess else. Where it is below 1 the covariance stays, as too
/// large a noise must not make an estimate look certain. The report has the plain ones too.
///
/// For n states, m outputs, p parameters and N rows an iteration costs O(N (n^3 + m n^2) p).
///
/// Source: Ljung, System Identification, 2nd ed. 1999, sections 7.2 to 7.4; Gupta and Mehra 1974; Segal and Weinstein 1989.
///
/// # Errors
/// [`Error::Argument`] if nothing in the model is unknown, or there is no log; [`Error::Data`] if a channel is not there, the clock
/// does not run forward, a step is not one that the model can take, or the filter leaves the range of numbers where the search
/// starts; [`Error::Undetermined`] with the parameters that the logs leave open, or that ran away to where they have no effect; [`Error::Interrupted`] if the monitor says so.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::{Channel, GreyBox, Recording, Times, fit_grey};
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
/// let log = Recording { channels: vec![channel("u", u), channel("y", y)], times: Times::Uniform(1.0) };
/// let report = fit_grey(&model, &[log], &[], &|_| ControlFlow::Continue(()))?;
/// assert!((report.parameters[0].value - 2.0).abs() < 1e-3);
/// assert!(report.fitted_model()?.unknown().next().is_none());
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_grey(
    model: &GreyBox,
    logs: &[Recording],
    sources: &[Source],
    monitor: Monitor<'_>,
) -> Result<GreyReport, Error> {
    let unknown = model.parameters();
    if unknown.is_empty() {
        return Err(Error::argument(
            "model",
            "none of its parameters is unknown; give one as { start = …, sd = …, unknown = true }",
        ));
    }
    if logs.is_empty() {
        return Err(Error::argument("logs", "there is none; give at least one"));
    }
    let inputs = model.inputs();
    let experiments: Vec<Experiment> = logs
        .iter()
        .map(|log| Experiment::new(log, inputs, model.outputs(), |step| model.division(step)))
        .collect::<Result<_, Error>>()?;
    let names: Vec<String> = unknown.iter().map(|unknown| unknown.name.clone()).collect();
    let start: Vec<f64> = unknown.iter().map(|unknown| unknown.start_variable().0).collect();
    let bounded: Vec<bool> = unknown.iter().map(|unknown| unknown.scale != Scale::Free).collect();
    let mut criterion = Criterion::new(model, &experiments);
    let readings = criterion.readings;
    if readings <= names.len() {
        let message = format!(
            "{} unknown parameters need more than {readings} measured values; give a longer log",
            names.len()
        );
        return Err(Error::undetermined(names, message));
    }
    let failed = |failure: Failure| failure.error(&experiments);
    let found =
        search(&mut criterion, &start, &bounded, MAX_ITERATIONS, TOLERANCE, monitor)?.map_err(failed)?;
    let slopes: Vec<f64> = unknown.iter().zip(&found.z).map(|(unknown, z)| unknown.scale.slope(*z)).collect();
    // Of the parameters in their own units, as if the noises of the model were those of the log.
    let covariance = covariance(&criterion.information, &slopes, &names)?;
    uncertainty::check(unknown, &found.z, &covariance)?;
    let figures = Figures::of(model, &experiments, &found.z).map_err(failed)?;

    let factor = figures.nis.map_or(1.0, |nis| nis.relative().max(1.0));
    let parameters = unknown.iter().zip(&found.z).enumerate().map(|(index, (unknown, &z))| {
        let nominal = covariance[(index, index)].sqrt();
        unknown.reported(z, nominal * factor.sqrt(), nominal)
    });
    let states = model.states().iter().enumerate().map(|(index, name)| GreyState {
        name: name.clone(),
        starts: figures.starts.iter().map(|start| start.as_ref().map(|start| start[index])).collect(),
    });
    let mut report = GreyReport {
        schema: GreyReport::SCHEMA.to_owned(),
        generator: concat!("thetahat ", env!("CARGO_PKG_VERSION")).to_owned(),
        logs: sources.to_vec(),
        rows: experiments.iter().map(Experiment::rows).sum(),
        model: model.text().to_owned(),
        known: model.known.iter().cloned().collect(),
        parameters: parameters.collect(),
        covariance: covariance
            .row_iter()
            .map(|row| row.iter().map(|value| value * factor).collect())
            .collect(),
        log_likelihood: -found.value(),
        readings,
        nis: figures.nis,
        covariance_factor: factor,
        outputs: figures.outputs,
        states: states.collect(),
        search: GreySearch {
            max_iterations: MAX_ITERATIONS,
            iterations: found.values.len() - 1,
            tolerance: TOLERANCE,
            stopped: found.stopped,
            log_likelihoods: found.values.iter().map(|value| -value).collect(),
        },
        warnings: Vec::new(),
    };
    for (position, input) in inputs.iter().enumerate() {
        let held: usize = experiments.iter().map(|experiment| experiment.held[position]).sum();
        if held > 0 {
            report.warnings.push(format!(
                "channel '{input}' misses {held} of {} values; the value before each was held",
                report.rows
            ));
        }
    }
    let walking: Vec<String> =
        unknown.iter().filter(|unknown| unknown.walk > 0.0).map(|unknown| unknown.name.clone()).collect();
    let words = warnings::warnings(&report, &walking);
    report.warnings.extend(words);
    Ok(report)
}

impl Unknown {
    fn reported(&self, z: f64, standard_error: f64, nominal_standard_error: f64) -> GreyParameter {
        let (min, max) = match self.scale {
            Scale::Free => (None, None),
            Scale::Above(min) => (Some(min), None),
            Scale::Below(max) => (None, Some(max)),
            Scale::Between(min, max) => (Some(min), Some(max)),
        };
        // What rounds to a bound is the number next to it: bounds are not reached.
        let mut value = self.scale.value(z);
        value = min.map_or(value, |min| value.max(min.next_up()));
        value = max.map_or(value, |max| value.min(max.next_down()));
        GreyParameter {
            name: self.name.clone(),
            value,
            standard_error,
            nominal_standard_error,
            start: self.start,
            min,
            max,
            change_of_variable: self.change_of_variable(),
        }
    }
}

impl Failure {
    fn error(self, experiments: &[Experiment]) -> Error {
        let before: usize = experiments.iter().take(self.log).map(Experiment::rows).sum();
        let row = before + self.row + 1;
        let message = format!(
            "the filter leaves the range of numbers in row {row}; give start values that are closer, shorter integration steps \
             (substeps), or larger noises"
        );
        Error::Data { channel: None, row: Some(row), message }
    }
}
