//! What a model says of the rows of a log, whatever its kind: all that its figures, tests and pages rest on.

use std::sync::OnceLock;

use super::forecast::forecast_if_possible;
use super::innovations::{Innovations, innovations};
use super::predict::{check_start, check_steps, predicted};
use super::sensitivities::{deviations_of, prediction_deviations};
use super::tested::Tested;
use super::{Forecast, Horizon, InitialCondition, Response, predict, simulate};
use crate::Error;
use crate::data::{Log, Record, Rows};
use crate::model::{PolynomialModel, Signal};

/// A model beside a log of which its offsets were taken.
///
/// Lists have an entry for each output, signals a value for each row of the log.
pub(crate) trait OnLog: Sync {
    /// The outputs.
    fn outputs(&self) -> &[Signal];

    /// Whether inputs act on them.
    fn is_driven(&self) -> bool;

    /// The default initial condition of a response.
    fn natural_start(&self, horizon: Horizon) -> InitialCondition;

    /// What was measured of an output, as a deviation from its offset.
    fn measured(&self, output: usize) -> &[f64];

    /// The responses, as such deviations.
    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error>;

    /// The same where nothing else is asked for: what deviations and tests would need is not kept.
    fn respond_alone(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        self.respond(horizon, start)
    }

    /// The standard deviations of the errors of predictions, including the uncertainty of the parameters; NaN where
    /// there is none.
    fn deviations(&self, steps: usize, start: InitialCondition) -> Result<Vec<Vec<f64>>, Error>;

    /// The same of a free run from that start; none where nothing tells them.
    fn run_deviations(&self, _start: InitialCondition) -> Option<Vec<Vec<f64>>> {
        None
    }

    /// How many of these deviations from a prediction the end of an interval lies that holds the output with
    /// probability `level`.
    fn quantile(&self, level: f64) -> f64;

    /// The variance that the model expects of an error one step ahead, in the mean, and how many times larger the
    /// squared errors are of which `mse` is the mean.
    fn noise(&self, output: usize, mse: Option<f64>) -> (f64, Option<f64>);

    /// The one-step residuals of each output.
    fn tested(&self) -> Result<Vec<Tested<'_>>, Error>;

    /// What is expected after the last usable row of `rows`, at most this many steps ahead, and the row (0-based) that
    /// it begins with; none where there is nothing to start from, or predictions reach there by themselves.
    fn forecast(
        &self,
        log: &Log,
        rows: &[Rows],
        steps: usize,
        start: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error>;

    /// The share of the samples of an output's response for which the model read what lies outside of what it was
    /// fitted to; none where that does not matter.
    fn outside(&self, _output: usize, _responses: &[Response], _horizon: Horizon) -> Option<f64> {
        None
    }

    /// In how many samples the last free run was kept within the range of what the model was fitted to; none where it
    /// is not.
    fn clamped(&self) -> Option<usize> {
        None
    }
}

/// A model of polynomials beside a log.
#[derive(Debug)]
pub(crate) struct PolynomialOnLog<'l> {
    model: &'l PolynomialModel,
    /// What predictions are made from, and what they start from.
    ahead: Record<'l>,
    start: InitialCondition,
    /// The one-step residuals, computed when they are first needed.
    innovations: OnceLock<Vec<Innovations>>,
    /// What free runs are made from.
    free_run: Record<'l>,
}

impl<'l> PolynomialOnLog<'l> {
    /// A model beside some rows of a log; responses start naturally unless it is said otherwise.
    ///
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there.
    pub(crate) fn new(
        model: &'l PolynomialModel,
        log: &'l Log,
        rows: &[Rows],
        asked: Option<InitialCondition>,
    ) -> Result<Self, Error> {
        let start = |horizon| asked.unwrap_or_else(|| InitialCondition::natural(model, horizon));
        let one = Horizon::Steps { steps: 1 };
        let record = |horizon| record_for(model, log, rows, horizon, start(horizon));
        Ok(Self {
            model,
            ahead: record(one)?,
            start: start(one),
            innovations: OnceLock::new(),
            free_run: record(Horizon::FreeRun)?,
        })
    }

    /// Predictions from another record, and start from something else.
    pub(crate) fn with_predictions(self, ahead: Record<'l>, start: InitialCondition) -> Self {
        Self { ahead, start, innovations: OnceLock::new(), ..self }
    }

    /// What is left one step ahead: predictions, their deviations and the tests rest on it, and it is computed once.
    fn innovations(&self) -> Result<&[Innovations], Error> {
        if let Some(found) = self.innovations.get() {
            return Ok(found);
        }
        let found = innovations(self.model, &self.ahead, 1, self.start)?;
        Ok(self.innovations.get_or_init(|| found))
    }

    fn record(&self, horizon: Horizon) -> &Record<'l> {
        match horizon {
            Horizon::Steps { .. } => &self.ahead,
            Horizon::FreeRun => &self.free_run,
        }
    }
}

impl OnLog for PolynomialOnLog<'_> {
    fn outputs(&self) -> &[Signal] {
        std::slice::from_ref(&self.model.output)
    }

    fn is_driven(&self) -> bool {
        self.model.orders.nb.iter().any(|&nb| nb > 0)
    }

    fn natural_start(&self, horizon: Horizon) -> InitialCondition {
        match horizon {
            Horizon::Steps { .. } => self.start,
            Horizon::FreeRun => InitialCondition::natural(self.model, horizon),
        }
    }

    fn measured(&self, _: usize) -> &[f64] {
        self.ahead.output
    }

    fn respond(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        let record = self.record(horizon);
        let response = match horizon {
            Horizon::Steps { steps: 1 } if start == self.start => {
                check_start(self.model, start)?;
                predicted(self.model, record, 1, self.innovations()?)
            }
            Horizon::Steps { steps } => predict(self.model, record, steps, start)?,
            Horizon::FreeRun => simulate(self.model, record, start)?,
        };
        Ok(vec![response])
    }

    fn respond_alone(&self, horizon: Horizon, start: InitialCondition) -> Result<Vec<Response>, Error> {
        match horizon {
            Horizon::Steps { steps } => Ok(vec![predict(self.model, &self.ahead, steps, start)?]),
            Horizon::FreeRun => self.respond(horizon, start),
        }
    }

    fn deviations(&self, steps: usize, start: InitialCondition) -> Result<Vec<Vec<f64>>, Error> {
        let (model, record) = (self.model, &self.ahead);
        // An open offset makes another model, whose innovations have more inputs.
        if (steps, start) == (1, self.start) && model.offset_covariance.is_none() {
            return Ok(vec![deviations_of(model, record, 1, start, self.innovations()?)?]);
        }
        Ok(vec![prediction_deviations(model, record, steps, start)?])
    }

    fn quantile(&self, level: f64) -> f64 {
        // The deviations are those of Student's distribution, the quantiles are in units of its scale.
        self.model.quantile(level) / self.model.student_factor()
    }

    fn noise(&self, _: usize, mse: Option<f64>) -> (f64, Option<f64>) {
        let variance = self.model.noise_variance;
        (variance, mse.map(|mse| mse / variance))
    }

    fn tested(&self) -> Result<Vec<Tested<'_>>, Error> {
        Ok(vec![Tested::of_polynomials(self.model, self.ahead.clone(), self.innovations()?)])
    }

    fn forecast(
        &self,
        log: &Log,
        rows: &[Rows],
        steps: usize,
        start: InitialCondition,
    ) -> Result<Option<(usize, Vec<Forecast>)>, Error> {
        let (model, record) = (self.model, &self.ahead);
        let Some(first) = record.segments.last().map(|segment| segment.end) else { return Ok(None) };
        let driving = model.inputs.iter().zip(&model.orders.nb).filter(|(_, nb)| **nb > 0);
        let driving: Vec<&str> = driving.map(|(input, _)| input.name.as_str()).collect();
        let known = known_ahead(log, rows, &driving, first, steps)?;
        if known == 0 {
            return Ok(None);
        }
        check_steps("horizon", known)?;
        let future: Vec<&[f64]> =
            record.inputs.iter().map(|u| &u[first..(first + known).min(u.len())]).collect();
        // Values of an input that drives nothing may be missing, and are not needed.
        let future: Vec<&[f64]> =
            future.iter().zip(&model.orders.nb).map(|(u, nb)| if *nb > 0 { *u } else { &[] }).collect();
        let forecast = forecast_if_possible(model, record, &future, known, start)?;
        Ok(forecast.map(|forecast| (first, vec![forecast])))
    }
}

/// How many of so many steps from row `first` on have known inputs, which go on without a gap.
pub(super) fn known_ahead(
    log: &Log,
    rows: &[Rows],
    driving: &[&str],
    first: usize,
    steps: usize,
) -> Result<usize, Error> {
    let segments = log.segments(driving, rows)?;
    let segment = segments.into_iter().find(|segment| segment.contains(&(first - 1)));
    let end = segment.map_or(first, |segment| segment.end);
    Ok(if driving.is_empty() && end == log.rows() { steps } else { steps.min(end - first) })
}

/// The record that a response of a model is made from. It goes on through missing outputs where no past one is needed.
pub(crate) fn record_for<'l>(
    model: &PolynomialModel,
    log: &'l Log,
    rows: &[Rows],
    horizon: Horizon,
    start: InitialCondition,
) -> Result<Record<'l>, Error> {
    let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
    let needed = match horizon {
        Horizon::Steps { .. } => model.orders.needs_past_outputs(),
        Horizon::FreeRun => start == InitialCondition::Drop,
    };
    let output = &model.output.name;
    if needed { log.record(&inputs, output, rows) } else { log.driven_record(&inputs, output, rows) }
}
