use statrs::distribution::{ChiSquared, ContinuousCDF};
use thetahat_core::nalgebra::{Complex, DMatrix, DVector};
use thetahat_core::{Action, Innovation};

use super::engine::{Division, Filter, Moment, Observer};
use super::estimate::{StateEstimate, Totals, Values};
use super::estimator::{Estimator, ObserverGain};
use super::look::Work;
use super::model::{Kind, StateModel};
use crate::Error;
use crate::data::Offset;

/// An estimator of the state of a model, fed row by row.
///
/// ```text
/// first row     correct x0, P0 with y(1)
/// later rows    predict over the step from the row before, with that row's u; then correct with y(k) and u(k)
/// ```
///
/// Inputs are held from their row to the next. A NaN among the outputs is a missing element, which is skipped alone. A NaN
/// among the inputs is replaced by that input's last value, and before the first one by its offset, which is zero but for
/// reports.
///
/// **Steps.** A model in equations with `dt` or `[derivative]` takes steps of any length. Any other takes whole multiples of
/// its sample time, within 1 %: it predicts as many times.
///
/// **Filters.** Where the noises are correlated, as in a report's innovations form, what a measurement tells of the process
/// noise is used in the prediction behind it. The covariance is kept factored: see
/// [`ExtendedKalmanFilter`](thetahat_core::ExtendedKalmanFilter).
///
/// **Observer.** In predictor form a row's measurement corrects the state of the next row: there is no filtered state, and
/// no noise, standard deviation or normalised innovation squared. Over a step of several sample times the measurement
/// counts in the first of them.
///
/// ```
/// use thetahat::{Estimator, StateFilter, StateModel};
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
/// assert_eq!(filter.totals().rows, 2);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct StateFilter {
    model: StateModel,
    engine: Engine,
    /// The row before, from which the next prediction starts.
    previous: Option<Moment>,
    totals: Totals,
    /// The 95 % bounds of the normalised innovation squared of 1, 2 … elements.
    bounds: Vec<(f64, f64)>,
    row: Row,
    told: Option<Told>,
    work: Work,
    /// All rows with the step before each, for a smoother.
    history: Option<Vec<(Option<Division>, Moment)>>,
}

#[derive(Debug, Clone)]
enum Engine {
    Filter(Filter),
    Observer { observer: Observer, poles: Option<DVector<Complex<f64>>> },
}

/// What an estimate shows.
#[derive(Debug, Clone)]
struct Row {
    /// Of the states, and behind them of the parameters after the change of variable.
    predicted: Vec<f64>,
    predicted_deviations: Vec<f64>,
    filtered: Vec<f64>,
    filtered_deviations: Vec<f64>,
    parameters: Vec<f64>,
    parameter_deviations: Vec<f64>,
    outputs: Vec<f64>,
    output_deviations: Vec<f64>,
    innovations: Vec<f64>,
    held: Vec<bool>,
    covariance: Vec<f64>,
}

impl StateFilter {
    /// An estimator that stands before the first row.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model is not for this estimator, or an observer's poles or gain do not fit the model.
    pub fn new(model: StateModel, estimator: Estimator) -> Result<Self, Error> {
        let filter = model.kind.started().map_err(|error| Error::argument("start", error.to_string()))?;
        let unknown: Vec<&str> = model.unknown().collect();
        let engine = match estimator {
            Estimator::Kalman if !model.is_linear() => {
                let reason = match unknown.as_slice() {
                    [] => "the model is not linear in its state".to_owned(),
                    names => format!("the model has unknown parameters ({})", names.join(", ")),
                };
                let message = format!("{reason}: use the extended Kalman filter (ekf)");
                return Err(Error::argument("estimator", message));
            }
            Estimator::Kalman | Estimator::Extended => Engine::Filter(filter),
            Estimator::Luenberger(_) if !unknown.is_empty() => {
                return Err(Error::argument(
                    "estimator",
                    format!(
                        "an observer estimates no parameters ({}): use the extended Kalman filter (ekf), or make them known",
                        unknown.join(", ")
                    ),
                ));
            }
            Estimator::Luenberger(gain) => observer(&model, filter.state(), gain)?,
        };
        let [n, p, k, m] = model.kind.sizes();
        let bounds = (1..=m).map(chi_square_bounds).collect::<Result<_, _>>()?;
        let zeros = |size: usize| vec![0.0; size];
        let row = Row {
            predicted: zeros(n + p),
            predicted_deviations: zeros(n + p),
            filtered: zeros(n + p),
            filtered_deviations: zeros(n + p),
            parameters: zeros(p),
            parameter_deviations: zeros(p),
            outputs: zeros(m),
            output_deviations: zeros(m),
            innovations: zeros(m),
            held: vec![false; k],
            covariance: zeros((n + p) * (n + p)),
        };
        let (totals, work) = (Totals::none(), Work::default());
        Ok(Self { model, engine, previous: None, totals, bounds, row, told: None, work, history: None })
    }

    /// The same, and it remembers all rows from now on, for [`smooth`](StateFilter::smooth).
    pub fn recording(self) -> Self {
        Self { history: Some(Vec::new()), ..self }
    }

    /// The model.
    pub fn model(&self) -> &StateModel {
        &self.model
    }

    /// What it has seen so far.
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// What it knows after the latest row; none before the first.
    pub fn latest(&self) -> Option<StateEstimate<'_>> {
        let told = self.told.as_ref()?;
        let time = self.previous.as_ref()?.time;
        let certain = !self.is_observer();
        let states = self.model.states().len();
        Some(self.row.estimate(self.totals.rows, time, states, certain, told, &self.bounds))
    }

    /// The word for the estimator.
    pub(super) fn estimator(&self) -> &'static str {
        match &self.engine {
            Engine::Filter(_) if self.model.is_linear() => "kalman",
            Engine::Filter(_) => "ekf",
            Engine::Observer { .. } => "luenberger",
        }
    }

    /// Whether it knows no noises.
    pub(super) fn is_observer(&self) -> bool {
        matches!(self.engine, Engine::Observer { .. })
    }

    /// The rows that it remembers, with the step before each.
    pub(super) fn history(&self) -> Option<&[(Option<Division>, Moment)]> {
        self.history.as_deref()
    }

    /// Takes a row: its inputs and outputs in the order of the model's channels, NaN where one is missing, and the seconds
    /// since the row before; none: one sample time. They do not count for the first row.
    ///
    /// The model's functions and their derivatives, and the cost of the filter's
    /// [`predict`](thetahat_core::ExtendedKalmanFilter::predict) and [`correct`](thetahat_core::ExtendedKalmanFilter::correct).
    ///
    /// # Errors
    /// After which nothing has changed: [`Error::Data`] if a value is infinite, the step does not fit the model, or the model
    /// or the filter has no finite answer; [`Error::Argument`] for another number of inputs or outputs.
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
        let refused = |error: thetahat_core::Error| Error::Data {
            channel: None,
            row: Some(row),
            message: format!("the estimate cannot go on at row {row}: {error}"),
        };
        let seconds = step_seconds.unwrap_or(self.model.sample_time());
        let division = match self.previous {
            Some(_) => Some(self.model.kind.division(seconds).map_err(in_row)?),
            None => None,
        };
        let time = self.previous.as_ref().map_or(0.0, |previous| previous.time + seconds);
        let moment = self.moment(time, inputs, outputs);
        let Self { model: StateModel { kind }, engine, previous, row: shown, work, .. } = self;
        let from = previous.as_ref().zip(division);

        // On a copy, as a failed step must change nothing.
        let mut engine = engine.clone();
        let told = match &mut engine {
            Engine::Filter(filter) => {
                if let Some((previous, division)) = from {
                    kind.predict(filter, previous, division, work).map_err(refused)?;
                }
                shown.predicted(filter).map_err(refused)?;
                let show = |outputs: &DVector<f64>, h: &DMatrix<f64>| {
                    shown.seen(outputs, &moment);
                    shown.output_deviations(kind, h);
                };
                let innovation = kind.correct(filter, &moment, work, show).map_err(refused)?;
                shown.filtered(filter);
                shown.parameters(kind);
                Told::of(&innovation)
            }
            Engine::Observer { observer, poles } => {
                if let Some((previous, division)) = from {
                    kind.observe(observer, poles.as_ref(), previous, division, work).map_err(refused)?;
                }
                shown.predicted.copy_from_slice(observer.state().as_slice());
                let outputs = kind.outputs(observer.state(), &moment, work).map_err(refused)?;
                if !outputs.iter().all(|output| output.is_finite()) {
                    return Err(refused(thetahat_core::Error::Overflow));
                }
                shown.seen(&outputs, &moment);
                Told::nothing(&moment)
            }
        };
        self.engine = engine;
        if let Some(history) = &mut self.history {
            history.push((division, moment.clone()));
        }
        self.row.add_offsets(&self.model.kind, time);
        self.previous = Some(moment);
        for (held, input) in self.row.held.iter_mut().zip(inputs) {
            *held = input.is_nan();
        }
        let certain = matches!(self.engine, Engine::Filter(_));
        let told = self.told.insert(told);
        let estimate = self.row.estimate(row, time, self.model.states().len(), certain, told, &self.bounds);
        self.totals.add(&estimate);
        Ok(estimate)
    }

    /// A row as the model sees it.
    fn moment(&self, time: f64, inputs: &[f64], outputs: &[f64]) -> Moment {
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
        Moment { time, inputs, outputs }
    }
}

impl Kind {
    /// What is taken from the channels; nothing where there is no offset.
    fn offsets(&self) -> (&[Offset], &[Offset]) {
        match self {
            Kind::Linear(linear) => (&linear.input_offsets, &linear.output_offsets),
            Kind::Grey(_) => (&[], &[]),
        }
    }
}

/// What a measurement told.
#[derive(Debug, Clone, Copy)]
struct Told {
    nis: Option<f64>,
    log_likelihood: Option<f64>,
    action: Action,
}

impl Told {
    fn of(innovation: &Innovation<f64, DVector<f64>>) -> Self {
        let measured = innovation.action != Action::Missing;
        let log_likelihood = Some(innovation.log_likelihood());
        Self { nis: measured.then_some(innovation.nis), log_likelihood, action: innovation.action }
    }

    /// By an observer, which knows no noise.
    fn nothing(moment: &Moment) -> Self {
        let missing = moment.outputs.iter().all(|output| output.is_nan());
        let action = if missing { Action::Missing } else { Action::Updated };
        Self { nis: None, log_likelihood: None, action }
    }
}

impl Row {
    fn predicted(&mut self, filter: &Filter) -> Result<(), thetahat_core::Error> {
        self.predicted.copy_from_slice(filter.state().as_slice());
        filter.covariance().write_into(&mut self.covariance)?;
        let diagonal = self.covariance.iter().step_by(self.predicted.len() + 1);
        for (deviation, variance) in self.predicted_deviations.iter_mut().zip(diagonal) {
            *deviation = variance.sqrt();
        }
        Ok(())
    }

    fn filtered(&mut self, filter: &Filter) {
        self.filtered.copy_from_slice(filter.state().as_slice());
        for (deviation, variance) in self.filtered_deviations.iter_mut().zip(&filter.covariance().variances())
        {
            *deviation = variance.sqrt();
        }
    }

    /// p(z), and |dp/dz| times the standard deviation of z.
    fn parameters(&mut self, kind: &Kind) {
        let Kind::Grey(grey) = kind else { return };
        let states = self.filtered.len() - self.parameters.len();
        for (index, parameter) in grey.parameters().iter().enumerate() {
            let (z, deviation) = (self.filtered[states + index], self.filtered_deviations[states + index]);
            self.parameters[index] = parameter.scale.value(z);
            self.parameter_deviations[index] = parameter.scale.slope(z).abs() * deviation;
        }
    }

    /// The outputs as predicted, and what they are off.
    fn seen(&mut self, outputs: &DVector<f64>, moment: &Moment) {
        self.outputs.copy_from_slice(outputs.as_slice());
        for ((innovation, measured), output) in self.innovations.iter_mut().zip(&moment.outputs).zip(outputs)
        {
            *innovation = measured - output;
        }
    }

    /// The roots of S_ii = h_i'P h_i + R_ii, with the covariance of the prediction.
    fn output_deviations(&mut self, kind: &Kind, h: &DMatrix<f64>) {
        let (size, outputs) = (self.predicted.len(), self.output_deviations.len());
        let h = h.as_slice();
        for (output, deviation) in self.output_deviations.iter_mut().enumerate() {
            let mut variance = 0.0;
            for i in 0..size {
                let row = h.iter().skip(output).step_by(outputs);
                let column = &self.covariance[i * size..(i + 1) * size];
                variance += h[output + i * outputs] * column.iter().zip(row).map(|(p, h)| p * h).sum::<f64>();
            }
            *deviation = (variance.max(0.0) + kind.output_variance(output)).sqrt();
        }
    }

    fn add_offsets(&mut self, kind: &Kind, time: f64) {
        for (output, offset) in self.outputs.iter_mut().zip(kind.offsets().1) {
            *output += offset.at(time);
        }
    }

    fn estimate(
        &self,
        row: usize,
        time: f64,
        states: usize,
        certain: bool,
        told: &Told,
        bounds: &[(f64, f64)],
    ) -> StateEstimate<'_> {
        fn values<'a>(values: &'a [f64], deviations: &'a [f64], certain: bool) -> Values<'a> {
            Values { values, standard_deviations: certain.then_some(deviations) }
        }
        let measured = self.innovations.iter().filter(|innovation| !innovation.is_nan()).count();
        let filtered = values(&self.filtered[..states], &self.filtered_deviations[..states], true);
        StateEstimate {
            row,
            time,
            predicted: values(&self.predicted[..states], &self.predicted_deviations[..states], certain),
            filtered: certain.then_some(filtered),
            parameters: values(&self.parameters, &self.parameter_deviations, certain),
            outputs: values(&self.outputs, &self.output_deviations, certain),
            innovations: &self.innovations,
            measured,
            nis: told.nis,
            nis_bounds: told.nis.and(measured.checked_sub(1)).and_then(|place| bounds.get(place)).copied(),
            log_likelihood: told.log_likelihood,
            action: told.action,
            held: &self.held,
        }
    }
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

/// Between which a chi-square number of so many degrees of freedom lies in 95 % of all cases.
fn chi_square_bounds(degrees: usize) -> Result<(f64, f64), Error> {
    let distribution = ChiSquared::new(degrees as f64)
        .map_err(|error| Error::argument("outputs", format!("no bounds for {degrees} of them: {error}")))?;
    Ok((distribution.inverse_cdf(0.025), distribution.inverse_cdf(0.975)))
}

/// An observer with its gain; for a model in equations the poles are placed later, at each estimate.
fn observer(model: &StateModel, start: &DVector<f64>, gain: ObserverGain) -> Result<Engine, Error> {
    let [n, _, k, m] = model.kind.sizes();
    let wrong = |error: thetahat_core::Error| Error::argument("gain", error.to_string());
    match gain {
        ObserverGain::Matrix(rows) => {
            if rows.len() != n || rows.iter().any(|row| row.len() != m) {
                let message =
                    format!("it must have {n} rows, one for each state, of {m} numbers, one for each output");
                return Err(Error::argument("gain", message));
            }
            let gain = DMatrix::from_row_iterator(n, m, rows.into_iter().flatten());
            let observer = Observer::new(start.clone(), gain).map_err(wrong)?;
            Ok(Engine::Observer { observer, poles: None })
        }
        ObserverGain::Poles(poles) => {
            if poles.len() != n {
                let message =
                    format!("there are {}, but the model has {n} states: give one for each", poles.len());
                return Err(Error::argument("poles", message));
            }
            let mut observer = Observer::new(start.clone(), DMatrix::zeros(n, m)).map_err(wrong)?;
            let poles = DVector::from_vec(poles);
            let none = DVector::zeros(k);
            let wrong = |error: thetahat_core::Error| Error::argument("poles", error.to_string());
            match &model.kind {
                Kind::Linear(linear) => {
                    let weights = model.kind.weights();
                    let placed =
                        observer.place(&linear.transition, &linear.observation, &none, &weights, &poles);
                    placed.map_err(wrong)?;
                    Ok(Engine::Observer { observer, poles: None })
                }
                Kind::Grey(_) => {
                    check_poles(&poles)?;
                    Ok(Engine::Observer { observer, poles: Some(poles) })
                }
            }
        }
    }
}

/// That poles lie inside the unit circle, and complex ones beside their conjugates.
fn check_poles(poles: &DVector<Complex<f64>>) -> Result<(), Error> {
    let mut rest = poles.iter();
    while let Some(pole) = rest.next() {
        let modulus = pole.re.hypot(pole.im);
        if modulus >= 1.0 || modulus.is_nan() {
            return Err(Error::argument("poles", format!("{pole} is not inside the unit circle")));
        }
        if pole.im != 0.0 && rest.next() != Some(&pole.conj()) {
            return Err(Error::argument("poles", format!("{pole} needs its conjugate beside it")));
        }
    }
    Ok(())
}
