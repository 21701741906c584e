//! A process beside a log.

use std::ops::Range;
use std::sync::OnceLock;

use thetahat_numerics::regression::Span;

use super::held::{HeldLog, at_rest, held_logs, modes, sensitivities};
use crate::Error;
use crate::data::{Log, Rows, measured};
use crate::model::{Parts, ProcessModel, Signal};
use crate::respond::{Forecast, Horizon, InitialCondition, Response, on_log::OnLog, tested::Tested};

/// A process beside a log of which its offsets were taken. Its errors do not depend on past outputs, so predictions are
/// free runs.
#[derive(Debug)]
pub(crate) struct ProcessOnLog<'l> {
    model: &'l ProcessModel,
    parts: Vec<Parts<f64>>,
    log: &'l Log,
    held: Vec<HeldLog>,
    output: &'l [f64],
    /// The inputs, a missing value held.
    inputs: Vec<Vec<f64>>,
    at_rest: OnceLock<Vec<f64>>,
}

impl<'l> ProcessOnLog<'l> {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there, and an input without a value.
    pub(crate) fn new(model: &'l ProcessModel, log: &'l Log, rows: &[Rows]) -> Result<Self, Error> {
        let names: Vec<&str> = model.inputs.iter().map(|input| input.name.as_str()).collect();
        let held = held_logs(log, &names, rows)?;
        let mut inputs = vec![vec![0.0; log.rows()]; names.len()];
        for part in &held {
            for (whole, own) in inputs.iter_mut().zip(&part.inputs) {
                whole[part.rows.clone()].copy_from_slice(own);
            }
        }
        let output = &log.channel(&model.output.name)?.values;
        Ok(Self { model, parts: model.parts(), log, held, output, inputs, at_rest: OnceLock::new() })
    }

    /// The response of a process that was at rest before the first row of each log.
    fn run_at_rest(&self) -> &[f64] {
        self.at_rest.get_or_init(|| {
            let mut response = vec![0.0; self.log.rows()];
            at_rest(&self.model.structures, &self.parts, &self.held, &mut response);
            response
        })
    }

    /// Adds to a response what the state that explains the outputs best in the rows that count does to it, of all logs
    /// or of those that begin after a pause.
    fn add_free(&self, response: &mut [f64], all: bool) {
        for part in self.held.iter().filter(|part| all || part.after_pause) {
            let first = part.rows.start;
            let rows: Vec<usize> =
                part.counted.iter().cloned().flatten().filter(|row| !self.output[*row].is_nan()).collect();
            let all: Vec<Vec<f64>> = self
                .model
                .structures
                .iter()
                .zip(&self.parts)
                .flat_map(|(structure, parts)| modes(structure, &parts.shape, &part.times))
                .collect();
            let mut span = Span::default();
            for mode in &all {
                span.add(rows.iter().map(|row| mode[row - first]).collect());
            }
            let mut left: Vec<f64> = rows.iter().map(|row| self.output[*row] - response[*row]).collect();
            let has = span.take_from(&mut left);
            for (mode, weight) in all.iter().zip(span.weights(&has)) {
                let own = &mut response[part.rows.clone()];
                own.iter_mut().zip(mode).for_each(|(value, mode)| *value += weight * mode);
            }
        }
    }

    fn segments(&self) -> impl Iterator<Item = Range<usize>> {
        self.held.iter().flat_map(|part| part.counted.iter().cloned())
    }

    /// The rows that count and have a measured output.
    fn counted(&self) -> Vec<Range<usize>> {
        self.segments().flat_map(|rows| measured(self.output, &rows)).collect()
    }
}

impl OnLog for ProcessOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        std::slice::from_ref(&self.model.output)
    }

    fn is_driven(&self) -> bool {
        true
    }

    fn natural_start(&self, _: Horizon) -> InitialCondition {
        if self.model.free_start { InitialCondition::Estimate } else { InitialCondition::Zero }
    }

    fn measured(&self, _: usize) -> &[f64] {
        self.output
    }

    fn respond(&self, _: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        let mut response = self.run_at_rest().to_vec();
        match start {
            InitialCondition::Zero => self.add_free(&mut response, false),
            InitialCondition::Estimate => self.add_free(&mut response, true),
            InitialCondition::Drop => {
                return Err(Error::argument(
                    "initial",
                    "a process needs no measured samples to start from; take zero, which is at rest, or estimate",
                ));
            }
        }
        if response.iter().any(|value| !value.is_finite()) {
            return Err(Error::data("the response grows out of the range of numbers"));
        }
        let mut values = vec![f64::NAN; self.log.rows()];
        self.segments().for_each(|rows| values[rows.clone()].copy_from_slice(&response[rows]));
        Ok(vec![Response { values, counted: self.counted() }])
    }

    /// The root of var e + g'P g, with g the slopes of the response by the parameters and the offset.
    fn deviations(&self, _: usize, _: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let model = self.model;
        let mut deviations = vec![f64::NAN; self.log.rows()];
        let offset = model.offset_covariance.as_ref();
        let covariance = offset.map(|open| open.covariance.as_slice()).or(model.covariance.as_deref());
        let size = covariance.map_or(0, <[Vec<f64>]>::len);
        let factor = model.student_factor();
        for part in &self.held {
            let mut slopes = vec![0.0; part.rows.len() * size];
            let mut first = 0;
            for ((structure, parts), input) in model.structures.iter().zip(&self.parts).zip(&part.inputs) {
                if size > 0 {
                    sensitivities(
                        structure,
                        parts,
                        (&part.times, input),
                        |row, columns, shape, dead_time| {
                            let own = &mut slopes[row * size + first..];
                            structure.own_slopes(parts, columns, shape, dead_time, own);
                        },
                    );
                }
                first += structure.parameters();
            }
            for row in part.counted.iter().cloned().flatten() {
                let own = row - part.rows.start;
                let slopes = &mut slopes[own * size..(own + 1) * size];
                if let Some(open) = offset {
                    slopes[first] = 1.0;
                    if let (Some(middle), Some(slope)) = (open.middle, slopes.get_mut(first + 1)) {
                        *slope = self.log.elapsed(row) - middle;
                    }
                }
                let mut variance = model.noise_variance;
                for (entries, slope) in covariance.unwrap_or(&[]).iter().zip(&*slopes) {
                    variance +=
                        slope * entries.iter().zip(&*slopes).map(|(entry, slope)| entry * slope).sum::<f64>();
                }
                deviations[row] = factor * variance.max(0.0).sqrt();
            }
        }
        Ok(vec![deviations])
    }

    fn quantile(&self, level: f64) -> f64 {
        self.model.quantile(level) / self.model.student_factor()
    }

    fn noise(&self, _: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.model.noise_variance;
        (variance, mse.map(|mse| mse / variance))
    }

    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let start = self.natural_start(Horizon::FreeRun);
        let response = self.respond(Horizon::FreeRun, start)?.remove(0);
        let (model, inputs) = (self.model, self.inputs.iter().map(Vec::as_slice).collect());
        Ok(vec![Tested::of_response(&model.output, &model.inputs, self.output, inputs, &response)])
    }

    /// Predictions reach as far as the inputs.
    fn forecast(
        &self,
        _: &Log,
        _: &[Rows],
        _: usize,
        _: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        Ok(None)
    }
}
