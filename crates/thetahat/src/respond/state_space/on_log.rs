//! A state-space model beside a log.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::OnceLock;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::Recursion;
use super::covariance::{StateCovariance, added};
use crate::Error;
use crate::data::{JointRecord, Log, Rows, measured};
use crate::model::{Signal, StateSpace, StateSpaceModel};
use crate::respond::{
    Forecast, Horizon, InitialCondition, Innovations, Response,
    on_log::{OnLog, known_ahead},
    predict::check_steps,
    tested::{Tested, record_of},
};

/// A state-space model beside a log of which its offsets were taken.
#[derive(Debug)]
pub(crate) struct StateSpaceOnLog<'l> {
    model: Cow<'l, StateSpaceModel>,
    matrices: StateSpace,
    /// What predictions are made from.
    ahead: JointRecord<'l>,
    /// The rows of predictions, in which outputs may be missing: each segment begins and ends with a row in which one
    /// is measured.
    segments: Vec<Range<usize>>,
    /// Where outputs are missing in these.
    covariance: Option<StateCovariance>,
    /// The rows of free runs, in which outputs may be missing.
    free_runs: Vec<Range<usize>>,
    asked: Option<InitialCondition>,
    /// The one-step residuals, computed when they are first needed.
    innovations: OnceLock<Segments>,
    /// The contribution of an uncertain state to their variances, computed when it is first needed.
    added: OnceLock<Vec<Vec<f64>>>,
}

/// The innovations of each output in each segment, and the state after the last.
#[derive(Debug, Clone, Default)]
struct Segments {
    /// A missing output counts as zero: its innovation is the prediction with another sign.
    errors: Vec<Vec<Vec<f64>>>,
    /// What innovations did to the next state beside what K did, with the samples of each segment in which that is not
    /// zero.
    corrections: Vec<Vec<(usize, DVector<f64>)>>,
    state: Vec<f64>,
    /// What is not known of that state; none where it is known.
    covariance: Option<DMatrix<f64>>,
}

impl<'l> StateSpaceOnLog<'l> {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there, and an irregular clock.
    pub(crate) fn new(
        model: &'l StateSpaceModel,
        log: &'l Log,
        rows: &[Rows],
        asked: Option<InitialCondition>,
    ) -> Result<Self, Error> {
        Self::of(Cow::Borrowed(model), log, rows, asked)
    }

    /// The same for a model that may be of its own.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub(crate) fn of(
        model: Cow<'l, StateSpaceModel>,
        log: &'l Log,
        rows: &[Rows],
        asked: Option<InitialCondition>,
    ) -> Result<Self, Error> {
        let names = |signals: &[Signal]| -> Vec<String> {
            signals.iter().map(|signal| signal.name.clone()).collect()
        };
        let inputs = names(&model.inputs);
        let ahead = log.joint_record(&inputs, &names(&model.outputs), rows)?;
        let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
        let free_runs = log.segments(&inputs, rows)?;
        let matrices = model.matrices();
        let missing = free_runs.iter().any(|rows| ahead.outputs.iter().any(|output| misses(output, rows)));
        let mut covariance = missing.then(|| StateCovariance::new(&matrices));
        let segments = match &mut covariance {
            Some(covariance) => through_missing_outputs(covariance, &ahead.outputs, &free_runs),
            None => ahead.segments.clone(),
        };
        let (innovations, added) = (OnceLock::new(), OnceLock::new());
        Ok(Self { model, matrices, ahead, segments, covariance, free_runs, asked, innovations, added })
    }

    fn outputs(&self) -> usize {
        self.model.outputs.len()
    }

    fn empty(&self) -> Vec<Response> {
        let samples = self.ahead.outputs.first().map_or(0, |output| output.len());
        vec![Response { values: vec![f64::NAN; samples], counted: Vec::new() }; self.outputs()]
    }

    /// Starts a segment.
    fn begin(
        recursion: &mut Recursion,
        signals: &[&[f64]],
        outputs: &[&[f64]],
        rows: &Range<usize>,
        start: InitialCondition,
    ) {
        match start {
            InitialCondition::Zero => recursion.start(&vec![0.0; recursion.state().len()]),
            _ => recursion.start_at_best(signals, outputs, rows.clone()),
        }
    }

    /// The one-step residuals.
    fn left(&self, start: InitialCondition) -> Segments {
        let (record, signals) = (&self.ahead, self.ahead.signals());
        let mut predictor = Recursion::predictor(&self.matrices);
        if let Some(covariance) = &self.covariance {
            predictor = predictor.through_missing_outputs(covariance.clone());
        }
        let mut found = Segments::default();
        for segment in &self.segments {
            Self::begin(&mut predictor, &signals, &record.outputs, segment, start);
            let mut errors = vec![Vec::with_capacity(segment.len()); self.outputs()];
            let mut corrections = Vec::new();
            for row in segment.clone() {
                let each = errors.iter_mut().zip(predictor.step(&signals, row));
                each.for_each(|(errors, error)| errors.push(*error));
                if let Some(correction) = predictor.correction() {
                    corrections.push((row - segment.start, correction.clone()));
                }
            }
            found.errors.push(errors);
            found.corrections.push(corrections);
        }
        found.state = predictor.state().to_vec();
        found.covariance = predictor.covariance().cloned();
        found
    }

    /// The same, computed once for the start that is natural or asked for.
    fn innovations(&self, start: InitialCondition) -> Cow<'_, Segments> {
        if start == self.natural() {
            Cow::Borrowed(self.innovations.get_or_init(|| self.left(start)))
        } else {
            Cow::Owned(self.left(start))
        }
    }

    fn natural(&self) -> InitialCondition {
        self.asked.unwrap_or(InitialCondition::Estimate)
    }

    /// Psi_1 … Psi_(k-1): what innovations do to later outputs, until nothing is left of it.
    fn disturbance_response(&self, steps: usize) -> Vec<DMatrix<f64>> {
        let StateSpace { f, h, k, .. } = &self.matrices;
        let longest = self.longest();
        let mut state = k.clone();
        let mut after = k.clone();
        let first = k.norm();
        let mut response = Vec::new();
        for _ in 1..steps.min(longest + 1) {
            response.push(h * &state);
            after.gemm(1.0, f, &state, 0.0);
            std::mem::swap(&mut state, &mut after);
            if state.norm() <= f64::EPSILON * f64::EPSILON * first {
                break;
            }
        }
        response
    }

    fn longest(&self) -> usize {
        self.segments.iter().map(Range::len).max().unwrap_or(0)
    }

    /// H, H F, … H F^(k-1): what states do to later outputs, until nothing is left of it.
    fn state_response(&self, steps: usize) -> Vec<DMatrix<f64>> {
        let StateSpace { f, h, .. } = &self.matrices;
        let mut response = vec![h.clone()];
        for _ in 1..steps.min(self.longest() + 1) {
            let next = &response[response.len() - 1] * f;
            if next.norm() <= f64::EPSILON * f64::EPSILON * h.norm() {
                break;
            }
            response.push(next);
        }
        response
    }

    /// What uncertain states add to the variances of predictions: a value for each row of each output, zero where
    /// states are known. None where no output is missing.
    fn added(&self, steps: usize) -> Option<Cow<'_, [Vec<f64>]>> {
        let covariance = self.covariance.as_ref()?;
        let compute = || {
            let mut added_to = vec![vec![0.0; self.ahead.outputs[0].len()]; self.outputs()];
            // Nothing is left of a state that is more steps away.
            let response = self.state_response(steps);
            let Some(seen) = response.get(steps - 1) else { return added_to };
            let mut covariance = covariance.clone();
            for segment in &self.segments {
                covariance.reset();
                for row in segment.start..(segment.end - (steps - 1).min(segment.len())) {
                    if let Some(covariance) = covariance.next() {
                        for (output, values) in added_to.iter_mut().enumerate() {
                            values[row + steps - 1] = added(seen, covariance, output);
                        }
                    }
                    covariance.step(&self.ahead.outputs, row);
                }
            }
            added_to
        };
        Some(if steps == 1 {
            Cow::Borrowed(self.added.get_or_init(compute).as_slice())
        } else {
            Cow::Owned(compute())
        })
    }

    fn predict(&self, steps: usize, start: InitialCondition) -> Vec<Response> {
        let found = self.innovations(start);
        let psi = self.disturbance_response(steps);
        let response = if self.covariance.is_some() { self.state_response(steps) } else { Vec::new() };
        let mut responses = self.empty();
        for ((segment, errors), corrections) in
            self.segments.iter().zip(&found.errors).zip(&found.corrections)
        {
            let rows = (segment.start + (steps - 1).min(segment.len()))..segment.end;
            for (output, values) in responses.iter_mut().enumerate() {
                let measured_here = self.ahead.outputs[output];
                for row in rows.clone() {
                    let t = row - segment.start;
                    let mut unseen = errors[output][t];
                    for (j, psi) in (1..).zip(&psi).take_while(|(j, _)| *j <= t) {
                        unseen += (0..errors.len())
                            .map(|other| psi[(output, other)] * errors[other][t - j])
                            .sum::<f64>();
                    }
                    let recent = corrections.partition_point(|(sample, _)| *sample + steps <= t);
                    for (sample, correction) in
                        corrections[recent..].iter().take_while(|(sample, _)| *sample < t)
                    {
                        if let Some(seen) = response.get(t - sample - 1) {
                            unseen +=
                                seen.row(output).iter().zip(correction).map(|(a, b)| a * b).sum::<f64>();
                        }
                    }
                    let value = measured_here[row];
                    values.values[row] = if value.is_nan() { -unseen } else { value - unseen };
                }
                values.counted.extend(measured(measured_here, &rows));
            }
        }
        responses
    }

    fn simulate(&self, start: InitialCondition) -> Vec<Response> {
        let mut simulator = Recursion::simulator(&self.matrices);
        let (inputs, outputs) = (&self.ahead.inputs, &self.ahead.outputs);
        let mut responses = self.empty();
        for rows in &self.free_runs {
            Self::begin(&mut simulator, inputs, outputs, rows, start);
            for row in rows.clone() {
                let each = responses.iter_mut().zip(simulator.step(inputs, row));
                each.for_each(|(response, value)| response.values[row] = *value);
            }
            for (response, output) in responses.iter_mut().zip(outputs) {
                response.counted.extend(measured(output, rows));
            }
        }
        responses
    }

    /// The deviations of each output 1 … `steps` steps ahead; less than that many where the last stands for those after
    /// it.
    fn spread(&self, steps: usize) -> Vec<Vec<f64>> {
        let noise = &self.matrices.noise_covariance;
        let mut covariance = noise.clone();
        let factor = self.model.student_factor();
        let now = |covariance: &DMatrix<f64>| -> Vec<f64> {
            covariance.diagonal().iter().map(|variance| factor * variance.max(0.0).sqrt()).collect()
        };
        let mut spread = vec![now(&covariance)];
        for psi in self.disturbance_response(steps) {
            covariance += &psi * noise * psi.transpose();
            spread.push(now(&covariance));
        }
        spread
    }

    /// The deviation of a prediction whose variance a state adds to.
    fn with_added(&self, deviation: f64, added: f64) -> f64 {
        deviation.hypot(self.model.student_factor() * added.sqrt())
    }
}

/// Whether an output misses a value in some rows.
fn misses(output: &[f64], rows: &Range<usize>) -> bool {
    output[rows.clone()].iter().any(|value| value.is_nan())
}

/// The rows that are gone through from where a state is estimated to where none is left to predict: from the first in
/// which an output is measured to the last. Where a state is lost, as that of an unstable model in a long hole, they
/// end with the last row in which an output was measured, and others begin with the next in which all are.
fn through_missing_outputs(
    covariance: &mut StateCovariance,
    outputs: &[&[f64]],
    driven: &[Range<usize>],
) -> Vec<Range<usize>> {
    let is_measured = |row: usize| outputs.iter().any(|output| !output[row].is_nan());
    let is_complete = |row: usize| outputs.iter().all(|output| !output[row].is_nan());
    let mut segments = Vec::new();
    for rows in driven {
        let Some(mut end) = rows.clone().rev().find(|row| is_measured(*row)) else { continue };
        end += 1;
        let mut begin = rows.clone().find(|row| is_measured(*row));
        while let Some(first) = begin.take() {
            covariance.reset();
            let lost = (first..end).find(|row| {
                covariance.step(outputs, *row);
                covariance.is_lost()
            });
            let last = (first..lost.map_or(end, |lost| lost + 1)).rev().find(|row| is_measured(*row));
            segments.extend(last.map(|last| first..last + 1));
            begin = lost.and_then(|lost| (lost + 1..end).find(|row| is_complete(*row)));
        }
    }
    segments
}

impl OnLog for StateSpaceOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        &self.model.outputs
    }

    fn is_driven(&self) -> bool {
        !self.model.inputs.is_empty()
    }

    fn natural_start(&self, horizon: Horizon) -> InitialCondition {
        match horizon {
            Horizon::Steps { .. } => self.natural(),
            Horizon::FreeRun => InitialCondition::Estimate,
        }
    }

    fn measured(&self, output: usize) -> &[f64] {
        self.ahead.outputs[output]
    }

    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        if start == InitialCondition::Drop {
            return Err(Error::argument(
                "initial",
                "a state-space model starts from a state, not from measured samples; take estimate, or zero, which is at rest",
            ));
        }
        let responses = match horizon {
            Horizon::Steps { steps: 0 } => {
                return Err(Error::argument("horizon", "a prediction looks at least one step ahead"));
            }
            Horizon::Steps { steps } => {
                check_steps("horizon", steps)?;
                self.predict(steps, start)
            }
            Horizon::FreeRun => self.simulate(start),
        };
        let finite = |response: &Response| {
            response.counted.iter().cloned().flatten().all(|row| response.values[row].is_finite())
        };
        if !responses.iter().all(finite) {
            return Err(Error::data("the response grows out of the range of numbers"));
        }
        Ok(responses)
    }

    fn deviations(&self, steps: usize, _: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let spread = self.spread(steps).pop().unwrap_or_default();
        let samples = self.ahead.outputs.first().map_or(0, |output| output.len());
        let mut deviations = vec![vec![f64::NAN; samples]; self.outputs()];
        for segment in &self.segments {
            for (deviations, spread) in deviations.iter_mut().zip(&spread) {
                deviations[segment.start + (steps - 1).min(segment.len())..segment.end].fill(*spread);
            }
        }
        if let Some(added) = self.added(steps) {
            for (deviations, added) in deviations.iter_mut().zip(&*added) {
                for (deviation, added) in deviations.iter_mut().zip(added).filter(|(_, added)| **added > 0.0)
                {
                    *deviation = self.with_added(*deviation, *added);
                }
            }
        }
        Ok(deviations)
    }

    fn quantile(&self, level: f64) -> f64 {
        self.model.quantile(level) / self.model.student_factor()
    }

    fn noise(&self, output: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.model.noise_covariance[output][output];
        let Some(added) = self.added(1) else { return (variance, mse.map(|mse| mse / variance)) };
        // The variance of each innovation is its own.
        let found = self.innovations(self.natural());
        let (mut count, mut expected, mut ratio) = (0.0, 0.0, 0.0);
        for (segment, errors) in self.segments.iter().zip(&found.errors) {
            let rows = segment.clone().zip(&errors[output]);
            for (row, error) in rows.filter(|(row, _)| !self.ahead.outputs[output][*row].is_nan()) {
                let own = variance + added[output][row];
                count += 1.0;
                expected += own;
                ratio += error * error / own;
            }
        }
        if count == 0.0 { (variance, None) } else { (expected / count, mse.map(|_| ratio / count)) }
    }

    /// Where a state is uncertain errors are as many times smaller as their deviation is larger: those of all rows are
    /// then alike.
    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let (model, record) = (&*self.model, &self.ahead);
        let found = self.innovations(self.natural());
        let added = self.added(1);
        let each = model.outputs.iter().enumerate().map(|(output, signal)| {
            let measured_here = record.outputs[output];
            let variance = model.noise_covariance[output][output];
            let innovations = (self.segments.iter().zip(&found.errors))
                .map(|(rows, errors)| {
                    let mut errors = errors[output].clone();
                    if let Some(added) = &added {
                        for (row, error) in rows.clone().zip(&mut errors) {
                            let added = added[output][row];
                            if measured_here[row].is_nan() {
                                *error = 0.0;
                            } else if added > 0.0 && variance > 0.0 {
                                *error *= (variance / (variance + added)).sqrt();
                            }
                        }
                    }
                    Innovations::alone(rows.clone(), measured(measured_here, rows), errors)
                })
                .collect();
            let record = record_of(measured_here, record.inputs.clone(), self.segments.clone());
            Tested::errors(signal, &model.inputs, record, innovations)
        });
        Ok(each.collect())
    }

    fn forecast(
        &self,
        log: &Log,
        rows: &[Rows],
        steps: usize,
        start: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        let Some(first) = self.segments.last().map(|segment| segment.end) else { return Ok(None) };
        let driving: Vec<&str> = self.model.inputs.iter().map(|input| input.name.as_str()).collect();
        let known = known_ahead(log, rows, &driving, first, steps)?;
        if known == 0 {
            return Ok(None);
        }
        check_steps("horizon", known)?;
        let StateSpace { f, g, h, d, .. } = &self.matrices;
        let found = self.innovations(start);
        let mut state = DVector::from_column_slice(&found.state);
        let mut uncertain = found.covariance.clone();
        let spread = self.spread(known);
        let empty = Forecast { values: Vec::new(), standard_deviations: Vec::new() };
        let mut forecasts = vec![empty; self.outputs()];
        for row in first..first + known {
            let spread = &spread[(row - first).min(spread.len() - 1)];
            let inputs = self.ahead.inputs.iter().map(|input| input[row]);
            let input = DVector::from_iterator(self.ahead.inputs.len(), inputs);
            let output = h * &state + d * &input;
            for (place, (value, spread)) in output.iter().zip(spread).enumerate() {
                let added = uncertain.as_ref().map_or(0.0, |covariance| added(h, covariance, place));
                let deviation = if added > 0.0 { self.with_added(*spread, added) } else { *spread };
                forecasts[place].values.push(*value);
                forecasts[place].standard_deviations.push(deviation);
            }
            state = f * state + g * input;
            uncertain = uncertain.map(|covariance| f * covariance * f.transpose());
        }
        Ok(Some((first, forecasts)))
    }
}
