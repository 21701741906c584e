//! A state-space model beside a log.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::Recursion;
use crate::Error;
use crate::data::{JointRecord, Log, Record, Rows, measured};
use crate::model::{Orders, PolynomialModel, Signal, StateSpace, StateSpaceModel};
use crate::respond::{
    Forecast, Horizon, InitialCondition, Innovations, Response,
    on_log::{OnLog, Tested, known_ahead},
    predict::check_steps,
};

/// A state-space model beside a log of which its offsets were taken.
#[derive(Debug)]
pub(crate) struct StateSpaceOnLog<'l> {
    model: Cow<'l, StateSpaceModel>,
    matrices: StateSpace,
    /// What predictions are made from.
    ahead: JointRecord<'l>,
    /// The rows of free runs, in which outputs may be missing.
    free_runs: Vec<Range<usize>>,
    asked: Option<InitialCondition>,
    /// What is left one step ahead, once somebody asked.
    innovations: OnceCell<Segments>,
}

/// The innovations of each output in each segment, and the state after the last.
#[derive(Debug, Clone, Default)]
struct Segments {
    errors: Vec<Vec<Vec<f64>>>,
    state: Vec<f64>,
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
        let innovations = OnceCell::new();
        let matrices = model.matrices();
        Ok(Self { model, matrices, ahead, free_runs, asked, innovations })
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

    /// What is left one step ahead.
    fn left(&self, start: InitialCondition) -> Segments {
        let (record, signals) = (&self.ahead, self.ahead.signals());
        let mut predictor = Recursion::predictor(&self.matrices);
        let mut found = Segments::default();
        for segment in &record.segments {
            Self::begin(&mut predictor, &signals, &record.outputs, segment, start);
            let mut errors = vec![Vec::with_capacity(segment.len()); self.outputs()];
            for row in segment.clone() {
                let each = errors.iter_mut().zip(predictor.step(&signals, row));
                each.for_each(|(errors, error)| errors.push(*error));
            }
            found.errors.push(errors);
        }
        found.state = predictor.state().to_vec();
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
        let longest = self.ahead.segments.iter().map(Range::len).max().unwrap_or(0);
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

    fn predict(&self, steps: usize, start: InitialCondition) -> Vec<Response> {
        let found = self.innovations(start);
        let psi = self.disturbance_response(steps);
        let mut responses = self.empty();
        for (segment, errors) in self.ahead.segments.iter().zip(&found.errors) {
            let rows = (segment.start + (steps - 1).min(segment.len()))..segment.end;
            for (output, response) in responses.iter_mut().enumerate() {
                for row in rows.clone() {
                    let t = row - segment.start;
                    let mut unseen = errors[output][t];
                    for (j, psi) in (1..).zip(&psi).take_while(|(j, _)| *j <= t) {
                        unseen += (0..errors.len())
                            .map(|other| psi[(output, other)] * errors[other][t - j])
                            .sum::<f64>();
                    }
                    response.values[row] = self.ahead.outputs[output][row] - unseen;
                }
                if !rows.is_empty() {
                    response.counted.push(rows.clone());
                }
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

    /// The deviations of each output 1 … `steps` steps ahead; less than that many where the last stands for those after it.
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
        for segment in &self.ahead.segments {
            for (deviations, spread) in deviations.iter_mut().zip(&spread) {
                deviations[segment.start + (steps - 1).min(segment.len())..segment.end].fill(*spread);
            }
        }
        Ok(deviations)
    }

    fn quantile(&self, level: f64) -> f64 {
        self.model.quantile(level) / self.model.student_factor()
    }

    fn noise(&self, output: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.model.noise_covariance[output][output];
        (variance, mse.map(|mse| mse / variance))
    }

    /// The errors of each output, as a model without parameters that sees the same inputs leaves them.
    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        let (model, record) = (&*self.model, &self.ahead);
        let found = self.innovations(self.natural());
        let inputs = model.inputs.len();
        let orders = Orders::arx(0, &vec![1; inputs], &vec![0; inputs])?;
        let each = model.outputs.iter().enumerate().map(|(output, signal)| {
            let mut alone =
                PolynomialModel::from_parameters(&orders, &vec![0.0; inputs], None, 1.0, model.sample_time)?;
            alone.inputs.clone_from(&model.inputs);
            alone.output = signal.clone();
            let innovations: Vec<Innovations> = (record.segments.iter().zip(&found.errors))
                .map(|(rows, errors)| {
                    Innovations::alone(rows.clone(), vec![rows.clone()], errors[output].clone())
                })
                .collect();
            let record = Record {
                output: record.outputs[output],
                inputs: record.inputs.clone(),
                past: vec![0; record.segments.len()],
                segments: record.segments.clone(),
            };
            Ok(Tested { model: Cow::Owned(alone), record, innovations: Cow::Owned(innovations) })
        });
        each.collect()
    }

    fn forecast(
        &self,
        log: &Log,
        rows: &[Rows],
        steps: usize,
        start: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        let Some(first) = self.ahead.segments.last().map(|segment| segment.end) else { return Ok(None) };
        let driving: Vec<&str> = self.model.inputs.iter().map(|input| input.name.as_str()).collect();
        let known = known_ahead(log, rows, &driving, first, steps)?;
        if known == 0 {
            return Ok(None);
        }
        check_steps("horizon", known)?;
        let StateSpace { f, g, h, d, .. } = &self.matrices;
        let mut state = DVector::from_column_slice(&self.innovations(start).state);
        let spread = self.spread(known);
        let empty = Forecast { values: Vec::new(), standard_deviations: Vec::new() };
        let mut forecasts = vec![empty; self.outputs()];
        for row in first..first + known {
            let spread = &spread[(row - first).min(spread.len() - 1)];
            let inputs = self.ahead.inputs.iter().map(|input| input[row]);
            let input = DVector::from_iterator(self.ahead.inputs.len(), inputs);
            let output = h * &state + d * &input;
            for (forecast, (value, spread)) in forecasts.iter_mut().zip(output.iter().zip(spread)) {
                forecast.values.push(*value);
                forecast.standard_deviations.push(*spread);
            }
            state = f * state + g * input;
        }
        Ok(Some((first, forecasts)))
    }
}
