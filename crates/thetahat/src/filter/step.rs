use thetahat_core::nalgebra::DVector;

use super::estimate::StateEstimate;
use super::estimator::{Engine, Estimator};
use super::kind::{Division, Gaussian, Kind, Motion, Sample};
use super::linearization::Work;
use super::model::StateModel;
use super::past::Past;
use super::row::{Certainty, Row, Told};
use super::totals::Totals;
use crate::Error;
use crate::data::Offset;

/// An estimator of the state of a model, fed row by row.
///
/// ```text
/// first row     correct x0, P0 with y(1)
/// later rows    predict over the step from the row before, with that row's u; then correct with y(k) and u(k)
/// ```
///
/// Inputs are held from their row to the next. A NaN among the outputs is a missing element, which is skipped alone. A
/// NaN among the inputs is replaced by that input's last value, and before the first one by its offset, which is zero
/// but for reports.
///
/// **Steps.** A model in equations with `dt` or `[derivative]` takes steps of any length. Any other takes whole
/// multiples of its sample time, within 1 %: it predicts as many times.
///
/// **Filters.** Where the noises are correlated, as in a report's innovations form, what a measurement tells of the
/// process noise is used in the prediction after it. The covariance is kept factored: see
/// [`ExtendedKalmanFilter`](thetahat_core::ExtendedKalmanFilter).
///
/// **Observer.** In predictor form a row's measurement corrects the state of the next row: there is no filtered state,
/// and no noise, standard deviation or normalised innovation squared. Over a step of several sample times the
/// measurement counts in the first of them.
///
/// ```
/// use thetahat::filter::{Estimator, StateFilter, StateModel};
///
/// // The yearly flow of the Nile as a level that walks (Durbin and Koopman, 2nd ed. 2012, section 2.2).
/// let model = StateModel::from_toml(
///     "sample_time = 1
///      states = ['level']
///      outputs = ['y']
///      F = [[1]]
///      H = [[1]]
///      Q = [[1469.1]]
///      R = [[15099]]
///      P0 = [[1e7]]",
/// )?;
/// let mut filter = StateFilter::new(model, Estimator::Kalman)?;
/// let estimate = filter.step(None, &[], &[1120.0])?;
/// let level = estimate.filtered.unwrap();
/// assert!((level.values[0] - 1118.311462).abs() < 1e-6);
/// assert!((level.standard_deviations.unwrap()[0].powi(2) - 15076.236391).abs() < 1e-6);
/// filter.step(None, &[], &[1160.0])?;
/// assert_eq!(filter.summary().rows, 2);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct StateFilter {
    pub(super) model: StateModel,
    /// The word for the estimator that was asked for.
    pub(super) estimator: &'static str,
    pub(super) engine: Engine,
    /// The time of the first row.
    pub(super) origin: f64,
    /// The row before, from which the next prediction starts.
    pub(super) previous: Option<Sample>,
    pub(super) totals: Totals,
    pub(super) row: Row,
    /// Where the next row is worked out: a step that fails leaves the last one as it is.
    pub(super) next: Row,
    pub(super) told: Option<Told>,
    /// The inputs of rows before, where the model needs them.
    pub(super) past: Past,
    work: Work,
    /// All rows with the step before each, for a smoother.
    pub(super) history: Option<Vec<(Option<Division>, Sample)>>,
}

impl StateFilter {
    /// An estimator that stands before the first row.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model is not for this estimator, or an observer's poles or gain do not fit the model.
    pub fn new(model: StateModel, estimator: Estimator) -> Result<Self, Error> {
        let (word, engine) = (estimator.word(), Engine::new(&model, estimator)?);
        let (row, past) = (Row::new(&model), model.kind.past());
        Ok(Self {
            model,
            past,
            estimator: word,
            engine,
            origin: 0.0,
            previous: None,
            totals: Totals::default(),
            next: row.clone(),
            row,
            told: None,
            work: Work::new(),
            history: None,
        })
    }

    /// The same, and it remembers all rows from now on, for [`smooth`](StateFilter::smooth).
    pub fn recording(self) -> Self {
        Self { history: Some(Vec::new()), ..self }
    }

    /// The same, and its first row is at this time in seconds: for rows that are not the first ones of their log, where
    /// equations have `t`, or a report offsets that are lines in time. 0 if it is not said.
    pub fn starting_at(self, seconds: f64) -> Self {
        Self { origin: seconds, ..self }
    }

    /// The model.
    pub fn model(&self) -> &StateModel {
        &self.model
    }

    /// What it has seen so far.
    pub(super) fn totals(&self) -> &Totals {
        &self.totals
    }

    /// What it knows after the latest row; none before the first.
    pub fn latest(&self) -> Option<StateEstimate<'_>> {
        let time = self.previous.as_ref()?.time;
        Some(self.row.estimate(self.totals.rows, time, self.engine.certainty(), self.told.as_ref()?))
    }

    /// The word for the estimator that was asked for.
    pub(super) fn estimator(&self) -> &'static str {
        self.estimator
    }

    /// Whether it knows the likelihood of a row.
    pub(super) fn is_gaussian(&self) -> bool {
        self.engine.certainty() == Certainty::Deviations
    }

    /// The rows that it remembers, with the step before each.
    pub(super) fn history(&self) -> Option<&[(Option<Division>, Sample)]> {
        self.history.as_deref()
    }

    /// Takes a row: its inputs and outputs in the order of the model's channels, NaN where one is missing, and the
    /// seconds since the row before; none: one sample time. They do not count for the first row.
    ///
    /// The model's functions and their derivatives, and the cost of the filter's
    /// [`predict`](thetahat_core::ExtendedKalmanFilter::predict) and
    /// [`correct`](thetahat_core::ExtendedKalmanFilter::correct).
    ///
    /// # Errors
    /// After which nothing has changed: [`Error::Data`] if a value is infinite, the step does not fit the model, or the
    /// model or the filter has no finite answer; [`Error::Argument`] for another number of inputs or outputs.
    pub fn step(
        &mut self,
        step_seconds: Option<f64>,
        inputs: &[f64],
        outputs: &[f64],
    ) -> Result<StateEstimate<'_>, Error> {
        let row = self.totals.rows + 1;
        check("inputs", self.model.inputs(), inputs, row)?;
        check("outputs", self.model.outputs(), outputs, row)?;
        let in_row = |error: Error| match error {
            Error::Data { message, .. } => Error::Data { channel: None, row: Some(row), message },
            other => other,
        };
        let refused = |error: thetahat_core::Error| {
            let why = match error {
                thetahat_core::Error::NotFinite { argument } => format!(
                    "the {argument} is not finite: at this estimate the equations divide by 0, or leave what a root, a \
                     logarithm or a power is defined for"
                ),
                thetahat_core::Error::TooLarge { .. } | thetahat_core::Error::Overflow => {
                    "its numbers overflow".to_owned()
                }
                other => other.to_string(),
            };
            Error::Data {
                channel: None,
                row: Some(row),
                message: format!("the estimate cannot go on: {why}"),
            }
        };
        let seconds = step_seconds.unwrap_or(self.model.sample_time());
        let division = match self.previous {
            Some(_) => Some(self.model.kind.division(seconds).map_err(in_row)?),
            None => None,
        };
        let time = self.previous.as_ref().map_or(self.origin, |previous| previous.time + seconds);
        let sample = self.sample(time, inputs, outputs);
        let Self { model: StateModel { kind }, engine, previous, next, past, work, .. } = self;
        let from = previous.as_ref().zip(division);

        // On copies, as a failed step must change nothing.
        let (mut engine, mut past) = (engine.clone(), past.clone());
        past.push(&sample);
        let told = match &mut engine {
            Engine::Filter(filter) => {
                filtered(kind, filter, from, &sample, next, (&past, work)).map_err(refused)?
            }
            Engine::Unscented(filter) => {
                filtered(kind, filter, from, &sample, next, (&past, work)).map_err(refused)?
            }
            Engine::Bounded(bounded) => match kind {
                Kind::Sampled(frame, Motion::Linear(linear)) => {
                    bounded.take((frame, linear), from, &sample, next).map_err(refused)?
                }
                // Refused when it was made.
                _ => Told::nothing(&sample),
            },
            Engine::Observer { observer, poles } => {
                if let Some((previous, division)) = from {
                    kind.observe(observer, poles.as_ref(), previous, &sample, division, (&past, work))
                        .map_err(refused)?;
                }
                next.predicted.copy_from_slice(observer.state().as_slice());
                let outputs = kind.outputs(observer.state(), &sample, (&past, work)).map_err(refused)?;
                if !outputs.iter().all(|output| output.is_finite()) {
                    return Err(refused(thetahat_core::Error::Overflow));
                }
                next.seen(&outputs, &sample);
                Told::nothing(&sample)
            }
        };
        next.finish(kind, time, inputs);
        (self.engine, self.past) = (engine, past);
        std::mem::swap(&mut self.row, &mut self.next);
        if let Some(history) = &mut self.history {
            history.push((division, sample.clone()));
        }
        self.previous = Some(sample);
        let told = self.told.insert(told);
        let estimate = self.row.estimate(row, time, self.engine.certainty(), told);
        self.totals.add(&estimate);
        Ok(estimate)
    }

    /// A row as the model sees it.
    fn sample(&self, time: f64, inputs: &[f64], outputs: &[f64]) -> Sample {
        let (input_offsets, output_offsets) = self.model.kind.offsets();
        let offset =
            |offsets: &[Offset], index: usize| offsets.get(index).map_or(0.0, |offset| offset.at(time));
        let last = |index: usize| self.previous.as_ref().map_or(0.0, |previous| previous.inputs[index]);
        let inputs = DVector::from_fn(inputs.len(), |index, _| match inputs[index] {
            missing if missing.is_nan() => last(index),
            input => input - offset(input_offsets, index),
        });
        let outputs =
            DVector::from_fn(outputs.len(), |index, _| outputs[index] - offset(output_offsets, index));
        Sample { time, inputs, outputs }
    }
}

/// A row as a filter takes it, from the row before over this step.
fn filtered(
    kind: &Kind,
    filter: &mut impl Gaussian,
    from: Option<(&Sample, Division)>,
    sample: &Sample,
    row: &mut Row,
    (past, work): (&Past, &mut Work),
) -> Result<Told, thetahat_core::Error> {
    if let Some((previous, division)) = from {
        kind.predict(filter, previous, sample, division, (past, work))?;
    }
    row.predicted(filter)?;
    let innovation = kind.correct(filter, sample, (past, work), |expected| row.expected(expected, sample))?;
    row.filtered(filter);
    row.parameters(kind);
    Ok(Told::of(&innovation))
}

/// That there are as many values as channels, and that none is infinite.
fn check(argument: &str, channels: &[String], values: &[f64], row: usize) -> Result<(), Error> {
    if channels.len() != values.len() {
        let message = format!("there are {}, but the model has {}", values.len(), channels.len());
        return Err(Error::argument(argument, message));
    }
    match channels.iter().zip(values).find(|(_, value)| value.is_infinite()) {
        None => Ok(()),
        Some((channel, _)) => Err(Error::in_channel(
            channel,
            Some(row),
            format!("'{channel}' is infinite in row {row}; leave the value out if it is missing"),
        )),
    }
}
