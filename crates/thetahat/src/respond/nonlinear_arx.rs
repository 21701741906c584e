//! A nonlinear ARX model beside a log.
//!
//! Predictions k steps ahead run the model k steps from what was measured, with e = 0. To first order in e and in the
//! parameters, with A_i = dg/dy(t-i) along the run, a matrix where there are several outputs,
//!
//! ```text
//! e(t|t-k) = e(t) + sum_i A_i e(t-i|t-k),   dy(t|t-k)/dtheta = f(z) + sum_i A_i dy(t-i|t-k)/dtheta
//! ```
//!
//! and the covariance of the errors is that of the first, by its covariance over the last lags, plus g' P g with the
//! second (Ljung, System Identification, 2nd ed. 1999, section 9.4, for a predictor that is not linear). That takes e
//! for noise that drives the plant. Where rows were held out, runs over them say how far those of two samples and more
//! are off, whatever e is: by the length of the run alone.

mod errors;
mod runner;

use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use thetahat_numerics::distribution::{student_factor, student_two_sided};

use super::on_log::OnLog;
use super::predict::check_steps;
use super::tested::Tested;
use super::{Forecast, Horizon, InitialCondition, Response};
use crate::Error;
use crate::data::{Log, Record, Rows, measured};
use crate::model::{NonlinearArxModel, RunError, Signal};
use errors::Errors;
pub(crate) use runner::within;
use runner::{Runner, Signals, Walk};

/// How long the runs are of which the errors are measured, and how many samples of each are run at most.
const RUNS: [usize; 10] = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const SAMPLES: usize = 50_000;
/// Fewer runs of a length say little.
const FEWEST: usize = 20;

/// Samples that are predicted on one thread.
const PART: usize = 1024;

/// The next output, less its offset, where one regressor moves through its range and the others stay in the middle of
/// theirs; with where it is in its range, from 0 to 1.
#[cfg(feature = "present")]
pub(crate) fn slice(
    model: &NonlinearArxModel,
    output: usize,
    place: usize,
    points: usize,
) -> Vec<(f64, f64)> {
    let runner = Runner::new(model);
    let middle = |regressor: &crate::model::Regressor| {
        f64::midpoint(regressor.range[0], regressor.range[1]) / regressor.scale
    };
    let mut z: Vec<f64> = model.regressors.iter().map(middle).collect();
    let Some(regressor) = model.regressors.get(place) else { return Vec::new() };
    let [low, high] = regressor.range;
    let mut next = vec![0.0; model.outputs.len()];
    let at = |point: usize| {
        let share = point as f64 / (points - 1).max(1) as f64;
        z[place] = (low + share * (high - low)) / regressor.scale;
        runner.next(&z, &mut next);
        (share, next[output])
    };
    (0..points).map(at).collect()
}

/// Where an expression has no value, and what to do; rows are counted from 0.
pub(crate) fn no_number(expression: &str, row: usize) -> Error {
    Error::data(format!(
        "{expression} is no number in row {}; name other rows, or write an expression that has a value there, as sqrt(max(u, 0)) has \
         for sqrt(u)",
        row + 1
    ))
}

/// A nonlinear ARX model beside a log of which its offsets were taken.
#[derive(Debug)]
pub(crate) struct NonlinearArxOnLog<'l> {
    runner: Runner<'l>,
    signals: Signals<'l>,
    /// What predictions look at, in which the other outputs stand after the inputs, and what free runs do.
    ahead: Record<'l>,
    free_run: Record<'l>,
    one_step: OnceLock<Vec<Response>>,
    /// Whether outputs that are fed back are kept within the range of the estimation rows, and in how many samples they
    /// were.
    clamp: bool,
    clamped: AtomicUsize,
}

impl<'l> NonlinearArxOnLog<'l> {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there, and where an expression has no value.
    pub(crate) fn new(model: &'l NonlinearArxModel, log: &'l Log, rows: &[Rows]) -> Result<Self, Error> {
        let runner = Runner::new(model);
        let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
        let (first, others) =
            model.outputs.split_first().ok_or_else(|| Error::report("a model has outputs"))?;
        let others = others.iter().map(|output| output.name.clone());
        let all: Vec<String> = inputs.iter().cloned().chain(others).collect();
        let ahead = log.record(&all, &first.name, rows)?;
        let mut free_run = log.driven_record(&inputs, &first.name, rows)?;
        let values = |signal: &Signal| Ok(log.channel(&signal.name)?.values.as_slice());
        let outputs = model.outputs.iter().map(values).collect::<Result<_, Error>>()?;
        free_run.inputs.truncate(inputs.len());
        let signals = runner.signals(outputs, free_run.inputs.clone());
        for (place, values) in signals.expressions.iter().enumerate() {
            let reads_outputs =
                runner.expressions[place].channels().iter().any(|channel| *channel < model.outputs.len());
            let segments = if reads_outputs { &ahead.segments } else { &free_run.segments };
            if let Some(row) = segments.iter().cloned().flatten().find(|row| !values[*row].is_finite()) {
                return Err(no_number(&model.expressions[place].name, row));
            }
        }
        Ok(Self {
            runner,
            signals,
            ahead,
            free_run,
            one_step: OnceLock::new(),
            clamp: false,
            clamped: AtomicUsize::new(0),
        })
    }

    /// The same with free runs of which the outputs are kept within 1.1 times the range of the estimation rows.
    pub(crate) fn with_clamp(self) -> Self {
        Self { clamp: true, ..self }
    }

    /// The samples of each segment that have a prediction `steps` ahead.
    fn counted(&self, steps: usize) -> Vec<Range<usize>> {
        let each = self.ahead.segments.iter().zip(&self.ahead.past);
        let each = each.map(|(segment, past)| {
            // The run begins after the last measured output, and reads as far back as the lags.
            let needed = self.runner.lags + steps - 1;
            (segment.start + needed.saturating_sub(*past)).min(segment.end)..segment.end
        });
        each.filter(|rows| !rows.is_empty()).collect()
    }

    /// The same in parts that are not long.
    fn parts(&self, steps: usize) -> Vec<Range<usize>> {
        let each = self.counted(steps).into_iter();
        let parts = each
            .flat_map(|rows| rows.clone().step_by(PART).map(move |first| first..rows.end.min(first + PART)));
        parts.collect()
    }

    fn predict(&self, steps: usize) -> Vec<Response> {
        let (runner, signals) = (&self.runner, &self.signals);
        let empty =
            Response { values: vec![f64::NAN; self.ahead.output.len()], counted: self.counted(steps) };
        let mut responses = vec![empty; runner.outputs()];
        let parts = self.parts(steps);
        let said: Vec<Vec<f64>> = (parts.par_iter())
            .map(|rows| {
                let mut all = Vec::with_capacity(rows.len() * runner.outputs());
                ahead(runner, signals, rows.clone(), steps, None, |said, _| all.extend(said));
                all
            })
            .collect();
        for (rows, said) in parts.into_iter().zip(said) {
            for (t, said) in rows.zip(said.chunks_exact(runner.outputs())) {
                responses.iter_mut().zip(said).for_each(|(response, said)| response.values[t] = *said);
            }
        }
        responses
    }

    /// The errors of runs over the rows of each output, by their length; none where a run grows without bound.
    pub(crate) fn run_errors(&self) -> Vec<Vec<RunError>> {
        let (runner, signals) = (&self.runner, &self.signals);
        let mut errors = vec![Vec::new(); runner.outputs()];
        for steps in RUNS {
            let rows: Vec<usize> = self.counted(steps).into_iter().flatten().collect();
            let apart = (rows.len() * steps).div_ceil(SAMPLES).max(1);
            let rows: Vec<usize> = rows.into_iter().step_by(apart).collect();
            if rows.len() < FEWEST {
                break;
            }
            let squares = |t: &usize| {
                let mut squares = Vec::new();
                ahead(runner, signals, *t..*t + 1, steps, None, |said, _| {
                    let each = said.iter().zip(&signals.outputs);
                    squares.extend(each.map(|(said, y)| (y[*t] - said).powi(2)));
                });
                squares
            };
            let squares: Vec<Vec<f64>> = rows.par_iter().map(squares).collect();
            for (output, errors) in errors.iter_mut().enumerate() {
                let sum: f64 = squares.iter().map(|squares| squares[output]).sum();
                errors.push(RunError { steps, rmse: (sum / rows.len() as f64).sqrt() });
            }
        }
        if errors.iter().flatten().any(|error| !error.rmse.is_finite()) {
            errors.iter_mut().for_each(Vec::clear);
        }
        errors
    }

    /// What runs over held-out rows say of the deviations of each output so many samples ahead. One sample ahead e says
    /// it.
    fn measured_deviations(&self, steps: usize) -> Option<Vec<f64>> {
        let maps = (steps > 1).then_some(&self.runner.model.maps)?;
        maps.iter().map(|map| map.run_error(steps)).collect()
    }

    fn one_step(&self) -> &[Response] {
        self.one_step.get_or_init(|| self.predict(1))
    }

    /// The rows of each free run.
    fn free_runs(&self, start: InitialCondition) -> impl Iterator<Item = Range<usize>> {
        let record = &self.free_run;
        record.segments.iter().zip(&record.past).filter_map(move |(segment, past)| {
            if start == InitialCondition::Zero {
                return Some(segment.clone());
            }
            let from = segment.start + self.runner.lags.saturating_sub(*past);
            Some(self.runner.first_known(&self.signals, from, segment.end)?..segment.end)
        })
    }

    fn simulate(&self, start: InitialCondition) -> Vec<Response> {
        let record = &self.free_run;
        let empty = Response { values: vec![f64::NAN; record.output.len()], counted: Vec::new() };
        let mut responses = vec![empty; self.runner.outputs()];
        let mut clamped = 0;
        for rows in self.free_runs(start) {
            let at_rest = start == InitialCondition::Zero;
            let run = self.runner.run(&self.signals, rows.clone(), at_rest, self.clamp);
            clamped += run.clamped;
            for (i, (response, values)) in responses.iter_mut().zip(run.outputs).enumerate() {
                response.values[rows.clone()].copy_from_slice(&values);
                response.counted.extend(measured(self.signals.outputs[i], &rows));
            }
        }
        self.clamped.store(clamped, Ordering::Relaxed);
        responses
    }
}

/// Calls `take` with what is said of the outputs at each of some rows from what is known `steps` before, and with the
/// variances of the errors if those are wanted.
fn ahead(
    runner: &Runner<'_>,
    signals: &Signals<'_>,
    rows: Range<usize>,
    steps: usize,
    mut errors: Option<&mut Errors>,
    mut take: impl FnMut(&[f64], &[f64]),
) {
    let mut walk = Walk::new(runner, errors.is_none());
    let (mut next, mut variances) = (vec![0.0; runner.outputs()], vec![0.0; runner.outputs()]);
    if steps == 1 {
        walk.begin(signals, rows.clone(), rows.end, false);
    }
    for t in rows {
        let first = t + 1 - steps;
        if steps > 1 {
            walk.begin(signals, first..t + 1, first, false);
        }
        if let Some(errors) = errors.as_deref_mut() {
            errors.begin();
        }
        for at in first..=t {
            walk.read(at);
            runner.next(&walk.z, &mut next);
            if let Some(errors) = errors.as_deref_mut() {
                errors.step(runner, &mut walk, at, &mut variances);
            }
            if steps > 1 {
                walk.write(at, &next);
            }
        }
        take(&next, &variances);
    }
}

impl OnLog for NonlinearArxOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        &self.runner.model.outputs
    }

    fn is_driven(&self) -> bool {
        self.runner.model.is_driven()
    }

    fn natural_start(&self, _: Horizon) -> InitialCondition {
        InitialCondition::Drop
    }

    fn measured(&self, output: usize) -> &[f64] {
        self.signals.outputs[output]
    }

    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        match (horizon, start) {
            (_, InitialCondition::Estimate) => Err(Error::argument(
                "initial",
                "nonlinear ARX models start from measured samples, and estimate none; take drop, or zero for a free run from rest",
            )),
            (Horizon::Steps { steps: 1 }, _) => Ok(self.one_step().to_vec()),
            (Horizon::Steps { steps }, _) => {
                check_steps("horizon", steps)?;
                Ok(self.predict(steps))
            }
            (Horizon::FreeRun, start) => Ok(self.simulate(start)),
        }
    }

    fn deviations(&self, steps: usize, _: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let (runner, signals) = (&self.runner, &self.signals);
        let factor = student_factor(runner.model.degrees_of_freedom);
        let mut deviations = vec![vec![f64::NAN; self.ahead.output.len()]; runner.outputs()];
        if let Some(measured) = self.measured_deviations(steps) {
            for (deviations, measured) in deviations.iter_mut().zip(measured) {
                self.counted(steps).into_iter().for_each(|rows| deviations[rows].fill(measured));
            }
            return Ok(deviations);
        }
        let parts = self.parts(steps);
        let found: Vec<Vec<f64>> = (parts.par_iter())
            .map(|rows| {
                let (mut all, mut errors) = (Vec::new(), Errors::new(runner));
                ahead(runner, signals, rows.clone(), steps, Some(&mut errors), |_, variances| {
                    all.extend(variances);
                });
                all
            })
            .collect();
        for (rows, found) in parts.into_iter().zip(found) {
            for (t, variances) in rows.zip(found.chunks_exact(runner.outputs())) {
                let each = deviations.iter_mut().zip(variances);
                each.for_each(|(deviations, variance)| deviations[t] = factor * variance.sqrt());
            }
        }
        Ok(deviations)
    }

    fn run_deviations(&self, start: InitialCondition) -> Option<Vec<Vec<f64>>> {
        let each = self.runner.model.maps.iter().map(|map| {
            let mut deviations = vec![f64::NAN; self.free_run.output.len()];
            for rows in self.free_runs(start) {
                for (t, steps) in rows.zip(1..) {
                    deviations[t] = map.run_error(steps)?;
                }
            }
            Some(deviations)
        });
        each.collect()
    }

    fn quantile(&self, level: f64) -> f64 {
        let degrees = self.runner.model.degrees_of_freedom;
        student_two_sided(1.0 - level, degrees) / student_factor(degrees)
    }

    fn noise(&self, output: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.runner.model.noise_covariance[output][output];
        (variance, mse.map(|mse| mse / variance))
    }

    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let model = self.runner.model;
        let driving = &self.ahead.inputs[..model.inputs.len()];
        let each = self.one_step().iter().zip(&model.outputs).zip(&self.signals.outputs);
        let each = each.map(|((response, signal), output)| {
            Tested::of_response(signal, &model.inputs, output, driving.to_vec(), response)
        });
        Ok(each.collect())
    }

    fn forecast(
        &self,
        log: &Log,
        rows: &[Rows],
        steps: usize,
        _: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        let record = &self.ahead;
        let (Some(segment), Some(past)) = (record.segments.last(), record.past.last()) else {
            return Ok(None);
        };
        let first = segment.end;
        if segment.len() + past < self.runner.lags {
            return Ok(None);
        }
        let driving: Vec<&str> = self.runner.model.inputs.iter().map(|input| input.name.as_str()).collect();
        let known = super::on_log::known_ahead(log, rows, &driving, first, steps)?;
        if known == 0 {
            return Ok(None);
        }
        check_steps("horizon", known)?;
        let factor = student_factor(self.runner.model.degrees_of_freedom);
        let outputs = self.runner.outputs();
        let empty = Forecast { values: Vec::new(), standard_deviations: Vec::new() };
        let mut forecasts = vec![empty; outputs];
        let (mut walk, mut errors) = (Walk::new(&self.runner, false), Errors::new(&self.runner));
        let (mut next, mut variances) = (vec![0.0; outputs], vec![0.0; outputs]);
        walk.begin(&self.signals, first..first + known, first, false);
        for t in first..first + known {
            walk.read(t);
            self.runner.next(&walk.z, &mut next);
            errors.step(&self.runner, &mut walk, t, &mut variances);
            walk.write(t, &next);
            let deviations = self.measured_deviations(t + 1 - first);
            for (output, forecast) in forecasts.iter_mut().enumerate() {
                forecast.values.push(next[output]);
                let propagated = factor * variances[output].sqrt();
                let deviation = deviations.as_ref().map_or(propagated, |deviations| deviations[output]);
                forecast.standard_deviations.push(deviation);
            }
        }
        Ok(Some((first, forecasts)))
    }

    fn outside(&self, output: usize, responses: &[Response], horizon: Horizon) -> Option<f64> {
        let counted = &responses.get(output)?.counted;
        if let Horizon::Steps { .. } = horizon {
            return self.runner.outside(&self.signals, counted);
        }
        // Before the run it read what was measured.
        let outputs: Vec<Vec<f64>> = (responses.iter().zip(&self.signals.outputs))
            .map(|(said, y)| {
                let each = said.values.iter().zip(*y);
                each.map(|(said, y)| if said.is_nan() { *y } else { *said }).collect()
            })
            .collect();
        let outputs = outputs.iter().map(Vec::as_slice).collect();
        self.runner.outside(&self.runner.signals(outputs, self.signals.inputs.clone()), counted)
    }

    fn clamped(&self) -> Option<usize> {
        self.clamp.then(|| self.clamped.load(Ordering::Relaxed))
    }
}
