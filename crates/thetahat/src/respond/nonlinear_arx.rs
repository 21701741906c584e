//! A nonlinear ARX model beside a log.
//!
//! Predictions k steps ahead run the model k steps from what was measured, with e = 0. To first order in e and in the parameters, with
//! a_i = dg/dy(t-i) along the run,
//!
//! ```text
//! e(t|t-k) = e(t) + sum_i a_i e(t-i|t-k),   dy(t|t-k)/dtheta = f(z) + sum_i a_i dy(t-i|t-k)/dtheta
//! ```
//!
//! and the variance of the error is that of the first, by its covariance over the last lags, plus g' P g with the second (Ljung,
//! System Identification, 2nd ed. 1999, section 9.4, for a predictor that is not linear).

use std::borrow::Cow;
use std::cell::OnceCell;
use std::ops::Range;

use rayon::prelude::*;

use super::on_log::{OnLog, Tested};
use super::predict::check_steps;
use super::{Forecast, Horizon, InitialCondition, Innovations, Response};
use crate::Error;
use crate::data::{Log, Record, Rows, measured};
use crate::distribution::{student_factor, student_two_sided};
use crate::model::{Evaluator, NonlinearArxModel, Orders, PolynomialModel, Signal};

/// A free run beyond this many times the largest output of the fit is lost.
const LOST: f64 = 1e6;
/// Predictions that are not worth a thread of their own.
const AT_ONCE: usize = 256;

/// A model laid out for runs along signals, which are deviations from its offsets.
#[derive(Debug)]
pub(crate) struct Runner<'m> {
    model: &'m NonlinearArxModel,
    evaluator: Evaluator,
    /// For each regressor the signal (0 is the output), the lag and the scale.
    taps: Vec<(usize, usize, f64)>,
    output_lags: usize,
    lags: usize,
}

impl<'m> Runner<'m> {
    pub(crate) fn new(model: &'m NonlinearArxModel) -> Self {
        let theta = model.parameters.iter().map(|parameter| parameter.value).collect();
        let each = model.sources().into_iter().zip(&model.regressors);
        Self {
            evaluator: Evaluator::new(&model.map, theta),
            taps: each.map(|(source, regressor)| (source, regressor.lag, regressor.scale)).collect(),
            output_lags: model.output_lags(),
            lags: model.lags(),
            model,
        }
    }

    /// z(t); what stands before the first sample is zero.
    fn regressors(&self, y: &[f64], inputs: &[&[f64]], t: usize, z: &mut [f64]) {
        for (z, (source, lag, scale)) in z.iter_mut().zip(&self.taps) {
            let signal = if *source == 0 { y } else { inputs[*source - 1] };
            *z = t.checked_sub(*lag).map_or(0.0, |at| signal[at]) / scale;
        }
    }

    /// y^(t) from the samples before.
    fn next(&self, y: &[f64], inputs: &[&[f64]], t: usize, z: &mut [f64]) -> f64 {
        self.regressors(y, inputs, t, z);
        self.model.output_scale * self.evaluator.value(z)
    }

    /// Runs from sample `rows.start` on, driven by the inputs and by its own outputs; `y` holds those before. What leaves the range of
    /// sense is NaN to the end. Gives whether all of it is a number.
    pub(crate) fn run(&self, y: &mut [f64], inputs: &[&[f64]], rows: Range<usize>) -> bool {
        let [low, high] = self.model.output_range;
        let lost = LOST * low.abs().max(high.abs()).max(self.model.output_scale);
        // Each sample is divided by its scale once, and not for each lag.
        let mut signals: Vec<(usize, f64)> =
            self.taps.iter().map(|(source, _, scale)| (*source, *scale)).collect();
        signals.sort_unstable_by(|one, other| one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)));
        signals.dedup();
        let scaled = |(source, scale): &(usize, f64)| {
            let signal = if *source == 0 { &y[..rows.start] } else { &inputs[*source - 1][..rows.end] };
            let mut values: Vec<f64> = signal.iter().map(|value| value / scale).collect();
            values.resize(rows.end, 0.0);
            values
        };
        let mut values: Vec<Vec<f64>> = signals.iter().map(scaled).collect();
        let place = |own: (usize, f64)| signals.iter().position(|signal| *signal == own).unwrap_or(0);
        let places = self.taps.iter().map(|(source, _, scale)| place((*source, *scale)));
        let read: Vec<(usize, usize, usize)> = (places.zip(&self.taps).enumerate())
            .map(|(regressor, (signal, (_, lag, _)))| (regressor, signal, *lag))
            .filter(|(regressor, ..)| self.evaluator.reads(*regressor))
            .collect();
        let mut z = vec![0.0; self.taps.len()];
        for t in rows.clone() {
            for (regressor, signal, lag) in &read {
                z[*regressor] = t.checked_sub(*lag).map_or(0.0, |at| values[*signal][at]);
            }
            let value = self.model.output_scale * self.evaluator.value(&z);
            if value.is_nan() || value.abs() > lost {
                y[t..rows.end].fill(f64::NAN);
                return false;
            }
            y[t] = value;
            for (own, (source, scale)) in values.iter_mut().zip(&signals) {
                if *source == 0 {
                    own[t] = value / scale;
                }
            }
        }
        true
    }

    /// The predictions of samples `first`, `first + 1`, … from what is known before, as many as there are in `ahead`, with the variances of
    /// their errors if those are wanted. `y` and inputs reach as far as they are read; `y` is written from `first` on.
    fn ahead(
        &self,
        y: &mut [f64],
        inputs: &[&[f64]],
        first: usize,
        ahead: &mut [(f64, f64)],
        errors: Option<&mut Errors>,
    ) {
        let mut z = vec![0.0; self.taps.len()];
        let Some(errors) = errors else {
            for (t, said) in (first..).zip(ahead) {
                said.0 = self.next(y, inputs, t, &mut z);
                y[t] = said.0;
            }
            return;
        };
        errors.begin();
        let mut functions = vec![0.0; self.evaluator.parameters()];
        let mut slopes = vec![0.0; z.len()];
        for (t, said) in (first..).zip(ahead) {
            let value = self.next(y, inputs, t, &mut z);
            self.evaluator.functions(&z, &mut functions);
            self.evaluator.slopes(&z, &mut slopes);
            *said = (value, errors.step(self, &functions, &slopes));
            y[t] = value;
        }
    }

    /// The first sample from `from` on before which as many outputs were measured as the model reads.
    pub(crate) fn first_known(&self, y: &[f64], from: usize, end: usize) -> Option<usize> {
        let known = |t: &usize| y[*t - self.output_lags..*t].iter().all(|value| !value.is_nan());
        (from.max(self.output_lags)..end).find(known)
    }

    /// The share of samples of which a regressor lies outside the range of the estimation rows; `y` is what the model reads as its output.
    fn outside(&self, y: &[f64], inputs: &[&[f64]], rows: &[Range<usize>]) -> Option<f64> {
        let ends = self.model.regressors.iter().map(|regressor| {
            let [low, high] = regressor.range;
            let rounding = f64::EPSILON * 4.0 * low.abs().max(high.abs());
            (low - rounding, high + rounding)
        });
        let taps: Vec<_> = self.taps.iter().zip(ends).collect();
        let is_beyond = |t: &usize| {
            taps.iter().any(|((source, lag, _), (low, high))| {
                let signal = if *source == 0 { y } else { inputs[*source - 1] };
                let value = t.checked_sub(*lag).map_or(0.0, |at| signal[at]);
                value < *low || value > *high
            })
        };
        let count: usize = rows.iter().map(Range::len).sum();
        let beyond = rows.par_iter().cloned().flatten().filter(is_beyond).count();
        (count > 0).then(|| beyond as f64 / count as f64)
    }
}

/// The next output, less its offset, where one regressor moves through its range and the others stay in the middle of theirs; with where
/// it is in its range, from 0 to 1.
#[cfg(feature = "html")]
pub(crate) fn slice(model: &NonlinearArxModel, place: usize, points: usize) -> Vec<(f64, f64)> {
    let runner = Runner::new(model);
    let middle = |regressor: &crate::model::Regressor| {
        f64::midpoint(regressor.range[0], regressor.range[1]) / regressor.scale
    };
    let mut z: Vec<f64> = model.regressors.iter().map(middle).collect();
    let Some(regressor) = model.regressors.get(place) else { return Vec::new() };
    let [low, high] = regressor.range;
    let at = |point: usize| {
        let share = point as f64 / (points - 1).max(1) as f64;
        z[place] = (low + share * (high - low)) / regressor.scale;
        (share, model.output_scale * runner.evaluator.value(&z))
    };
    (0..points).map(at).collect()
}

/// How far predictions may be off, as they are run.
#[derive(Debug)]
struct Errors {
    lags: usize,
    noise: f64,
    /// The covariance of the parameters, row by row; none where it is not known.
    spread: Option<Vec<Vec<f64>>>,
    /// The covariance of the errors of the last outputs, the latest first, row by row.
    covariance: Vec<f64>,
    /// The slopes of the last outputs by the parameters, the latest first.
    slopes: Vec<Vec<f64>>,
    /// a_i, and their products with the covariance.
    weights: Vec<f64>,
    crossed: Vec<f64>,
}

impl Errors {
    fn new(runner: &Runner<'_>) -> Self {
        let lags = runner.output_lags.max(1);
        Self {
            lags,
            noise: runner.model.noise_variance,
            spread: runner.model.covariance.clone(),
            covariance: vec![0.0; lags * lags],
            slopes: vec![vec![0.0; runner.evaluator.parameters()]; lags],
            weights: vec![0.0; lags],
            crossed: vec![0.0; lags],
        }
    }

    /// All before was measured.
    fn begin(&mut self) {
        self.covariance.fill(0.0);
        self.slopes.iter_mut().for_each(|slopes| slopes.fill(0.0));
    }

    /// The variance of the error of the next output, of which the functions and the slopes by z are given.
    fn step(&mut self, runner: &Runner<'_>, functions: &[f64], slopes: &[f64]) -> f64 {
        let lags = self.lags;
        let scale = runner.model.output_scale;
        let Self { covariance, weights, crossed, .. } = self;
        weights.fill(0.0);
        for ((source, lag, own), slope) in runner.taps.iter().zip(slopes) {
            if *source == 0 {
                weights[*lag - 1] += scale * slope / own;
            }
        }
        for (j, crossed) in crossed.iter_mut().enumerate() {
            *crossed =
                weights.iter().zip(covariance[j..].iter().step_by(lags)).map(|(a, entry)| a * entry).sum();
        }
        let noise = crossed.iter().zip(&*weights).map(|(one, weight)| one * weight).sum::<f64>() + self.noise;
        for i in (1..lags).rev() {
            covariance.copy_within((i - 1) * lags..i * lags - 1, i * lags + 1);
        }
        for j in 1..lags {
            covariance[j] = crossed[j - 1];
            covariance[j * lags] = crossed[j - 1];
        }
        self.covariance[0] = noise;
        let Some(spread) = &self.spread else { return noise };
        let mut own = std::mem::take(&mut self.slopes[lags - 1]);
        for (j, slope) in own.iter_mut().enumerate() {
            // The oldest of the last outputs is overwritten by the sum that it is part of.
            let oldest = self.weights[lags - 1] * *slope;
            let others =
                self.slopes[..lags - 1].iter().zip(&self.weights).map(|(slopes, weight)| weight * slopes[j]);
            *slope = scale * functions[j] + oldest + others.sum::<f64>();
        }
        let mut open = 0.0;
        for (row, slope) in spread.iter().zip(&own) {
            open += slope * row.iter().zip(&own).map(|(entry, slope)| entry * slope).sum::<f64>();
        }
        self.slopes.rotate_right(1);
        self.slopes[0] = own;
        noise + open.max(0.0)
    }
}

/// A nonlinear ARX model beside a log of which its offsets were taken.
#[derive(Debug)]
pub(crate) struct NonlinearArxOnLog<'l> {
    runner: Runner<'l>,
    /// What predictions look at, and what free runs do.
    ahead: Record<'l>,
    free_run: Record<'l>,
    one_step: OnceCell<Response>,
}

impl<'l> NonlinearArxOnLog<'l> {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there.
    pub(crate) fn new(model: &'l NonlinearArxModel, log: &'l Log, rows: &[Rows]) -> Result<Self, Error> {
        let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
        Ok(Self {
            runner: Runner::new(model),
            ahead: log.record(&inputs, &model.output.name, rows)?,
            free_run: log.driven_record(&inputs, &model.output.name, rows)?,
            one_step: OnceCell::new(),
        })
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

    fn predict(&self, steps: usize) -> Response {
        let record = &self.ahead;
        let mut response =
            Response { values: vec![f64::NAN; record.output.len()], counted: self.counted(steps) };
        if steps == 1 {
            let runner = &self.runner;
            for rows in &response.counted {
                let each =
                    response.values[rows.clone()].par_iter_mut().zip(rows.clone()).with_min_len(AT_ONCE);
                let room = || vec![0.0; runner.taps.len()];
                each.for_each_init(room, |z, (value, t)| {
                    *value = runner.next(record.output, &record.inputs, t, z);
                });
            }
            return response;
        }
        let mut y = record.output.to_vec();
        let mut ahead = vec![(0.0, 0.0); steps];
        for t in response.counted.iter().cloned().flatten() {
            let first = t + 1 - steps;
            self.runner.ahead(&mut y, &record.inputs, first, &mut ahead, None);
            response.values[t] = ahead[steps - 1].0;
            y[first..=t].copy_from_slice(&record.output[first..=t]);
        }
        response
    }

    fn one_step(&self) -> &Response {
        self.one_step.get_or_init(|| self.predict(1))
    }

    fn simulate(&self, start: InitialCondition) -> Response {
        let record = &self.free_run;
        let mut response = Response { values: vec![f64::NAN; record.output.len()], counted: Vec::new() };
        for (segment, past) in record.segments.iter().zip(&record.past) {
            let mut y = record.output[..segment.end].to_vec();
            let first = if start == InitialCondition::Zero {
                let known = segment.start.saturating_sub(self.runner.lags.max(1));
                y[known..segment.start].fill(0.0);
                Some(segment.start)
            } else {
                let from = segment.start + self.runner.lags.saturating_sub(*past);
                self.runner.first_known(&y, from, segment.end)
            };
            let Some(first) = first else { continue };
            let rested: Vec<Vec<f64>>;
            let mut inputs: Vec<&[f64]> = record.inputs.clone();
            if start == InitialCondition::Zero {
                let rest = |u: &&[f64]| {
                    let mut u = u[..segment.end].to_vec();
                    u[..segment.start].fill(0.0);
                    u
                };
                rested = record.inputs.iter().map(rest).collect();
                inputs = rested.iter().map(Vec::as_slice).collect();
            }
            self.runner.run(&mut y, &inputs, first..segment.end);
            response.values[first..segment.end].copy_from_slice(&y[first..]);
            response.counted.extend(measured(record.output, &(first..segment.end)));
        }
        response
    }
}

impl OnLog for NonlinearArxOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        std::slice::from_ref(&self.runner.model.output)
    }

    fn is_driven(&self) -> bool {
        self.runner.taps.iter().any(|(source, ..)| *source > 0)
    }

    fn natural_start(&self, _: Horizon) -> InitialCondition {
        InitialCondition::Drop
    }

    fn measured(&self, _: usize) -> &[f64] {
        self.ahead.output
    }

    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        let response = match (horizon, start) {
            (_, InitialCondition::Estimate) => {
                return Err(Error::argument(
                    "initial",
                    "nonlinear ARX models start from measured samples, and estimate none; take drop, or zero for a free run from rest",
                ));
            }
            (Horizon::Steps { steps: 1 }, _) => self.one_step().clone(),
            (Horizon::Steps { steps }, _) => {
                check_steps("horizon", steps)?;
                self.predict(steps)
            }
            (Horizon::FreeRun, start) => self.simulate(start),
        };
        Ok(vec![response])
    }

    fn deviations(&self, steps: usize, _: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let record = &self.ahead;
        let factor = student_factor(self.runner.model.degrees_of_freedom);
        let mut deviations = vec![f64::NAN; record.output.len()];
        let mut y = record.output.to_vec();
        let mut ahead = vec![(0.0, 0.0); steps];
        let mut errors = Errors::new(&self.runner);
        for t in self.counted(steps).into_iter().flatten() {
            let first = t + 1 - steps;
            self.runner.ahead(&mut y, &record.inputs, first, &mut ahead, Some(&mut errors));
            deviations[t] = factor * ahead[steps - 1].1.sqrt();
            y[first..=t].copy_from_slice(&record.output[first..=t]);
        }
        Ok(vec![deviations])
    }

    fn quantile(&self, level: f64) -> f64 {
        let degrees = self.runner.model.degrees_of_freedom;
        student_two_sided(1.0 - level, degrees) / student_factor(degrees)
    }

    fn noise(&self, _: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.runner.model.noise_variance;
        (variance, mse.map(|mse| mse / variance))
    }

    /// The errors, as a model without parameters that sees the same inputs leaves them.
    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let (model, record) = (self.runner.model, &self.ahead);
        let inputs = model.inputs.len();
        let orders = Orders::arx(0, &vec![1; inputs], &vec![0; inputs])?;
        let mut alone =
            PolynomialModel::from_parameters(&orders, &vec![0.0; inputs], None, 1.0, model.sample_time)?;
        alone.inputs.clone_from(&model.inputs);
        alone.output = model.output.clone();
        let response = self.one_step();
        let each = response.counted.iter().map(|rows| {
            let errors = rows.clone().map(|t| record.output[t] - response.values[t]).collect();
            Innovations::alone(rows.clone(), vec![rows.clone()], errors)
        });
        let innovations: Vec<Innovations> = each.collect();
        let segments: Vec<Range<usize>> = response.counted.clone();
        let record = Record { past: vec![0; segments.len()], segments, ..record.clone() };
        Ok(vec![Tested { model: Cow::Owned(alone), record, innovations: Cow::Owned(innovations) }])
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
        let mut y = record.output[..first].to_vec();
        y.resize(first + known, 0.0);
        let inputs: Vec<Vec<f64>> = record
            .inputs
            .iter()
            .map(|u| {
                let mut u = u[..u.len().min(first + known)].to_vec();
                u.resize(first + known, 0.0);
                u
            })
            .collect();
        let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let mut ahead = vec![(0.0, 0.0); known];
        self.runner.ahead(&mut y, &inputs, first, &mut ahead, Some(&mut Errors::new(&self.runner)));
        let factor = student_factor(self.runner.model.degrees_of_freedom);
        let forecast = Forecast {
            values: ahead.iter().map(|(value, _)| *value).collect(),
            standard_deviations: ahead.iter().map(|(_, variance)| factor * variance.sqrt()).collect(),
        };
        Ok(Some((first, vec![forecast])))
    }

    fn outside(&self, _: usize, response: &Response, horizon: Horizon) -> Option<f64> {
        let counted = &response.counted;
        match horizon {
            Horizon::Steps { .. } => self.runner.outside(self.ahead.output, &self.ahead.inputs, counted),
            Horizon::FreeRun => {
                let record = &self.free_run;
                // Before the run it read what was measured.
                let said = response.values.iter().zip(record.output);
                let y: Vec<f64> = said.map(|(said, y)| if said.is_nan() { *y } else { *said }).collect();
                self.runner.outside(&y, &record.inputs, counted)
            }
        }
    }
}
