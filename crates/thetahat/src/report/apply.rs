use std::borrow::Cow;

use super::fitted_rows::rows_of_fit;
use super::schema::Report;
use super::suited::{check_offsets, check_sample_time};
use crate::Error;
use crate::data::{Detrend, Log, Offset, Rows, checked};
use crate::model::{Model, PolynomialModel, ProcessModel};
use crate::respond::{Horizon, InitialCondition, Response};
use crate::validate::Fit;

/// What a model says of a log, in the log's own units.
#[derive(Debug, Clone, PartialEq)]
pub struct Applied {
    /// What it says of each output.
    pub outputs: Vec<AppliedOutput>,
    /// How many rows after the end of the log are forecast.
    pub beyond: usize,
    /// The rows asked for, in rising order.
    pub rows: Vec<Rows>,
    /// How many values a [clamped run](Report::clamped_run) kept within its range; none otherwise.
    pub clamped: Option<usize>,
}

/// What a model says of an output.
#[derive(Debug, Clone, PartialEq)]
pub struct AppliedOutput {
    /// Its name.
    pub name: String,
    /// The measured output, one value for each row of the log; NaN where it is missing. None if the log does not have it.
    pub measured: Option<Vec<f64>>,
    /// The response, one value for each row of the log and then for each of the `beyond` rows after it; NaN outside the
    /// rows asked for, in gaps, and before a start. Gaps of the output alone are none for free runs, for models without A,
    /// C and D, and for those in equations.
    pub predicted: Vec<f64>,
    /// The standard deviations of the errors of `predicted`, those of the parameters among them, for the steps that each value
    /// looks ahead, as [`prediction_deviations`](crate::respond::prediction_deviations) and [`forecast`](crate::respond::forecast) have them;
    /// NaN where there is none. Of a free run those that a nonlinear ARX model has measured on rows that were held out, else None.
    pub standard_deviations: Option<Vec<f64>>,
    /// How close they are. None if the log does not have the output.
    pub fit: Option<Fit>,
}

/// Predicts or simulates a log with a model.
///
/// `rows` are those to respond to; none: all. The model's own offsets are used unless `detrend` says how to find
/// others on these rows. A free run also works on a log without the model's outputs, from [`InitialCondition::Zero`].
///
/// A prediction k steps ahead is also a forecast of the k samples after the last usable row, each as many steps
/// ahead as it lies after that row: of rows asked for that have the inputs but not the output, and, for a model that
/// no input drives and if the log's last row was asked for, of rows after the log's end, in its own time step. There
/// is no forecast where the last segment without a gap is too short to start from. A model without A, C and D needs no past
/// output: it has a value in every row that its inputs reach. So has one in equations, of which every prediction starts from what its
/// filter knows k rows before.
///
/// A model in equations begins in the state that it says in the first row of a log; [`Report::apply`] knows where it was fitted.
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, a sample time that differs from the model's by more than
/// 1 %, or a clock that the model cannot follow; and as for [`predict`](crate::respond::predict), [`simulate`](crate::respond::simulate) and
/// [`forecast`](crate::respond::forecast).
pub fn apply(
    model: &Model,
    log: &Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    horizon: Horizon,
    initial: InitialCondition,
) -> Result<Applied, Error> {
    applied(model, log, rows, detrend, (horizon, initial), (&[], false))
}

impl Report {
    /// [`apply`] of its model to a log of which it may have been fitted to some rows: there a model in equations begins with the first
    /// of them.
    ///
    /// # Errors
    /// As for [`apply`].
    pub fn apply(
        &self,
        log: &Log,
        rows: &[Rows],
        detrend: Option<Detrend>,
        horizon: Horizon,
        initial: InitialCondition,
    ) -> Result<Applied, Error> {
        applied(&self.model, log, rows, detrend, (horizon, initial), (&rows_of_fit(self, log)?, false))
    }

    /// A free run of a nonlinear ARX model of which each output that is fed back is kept within 1.1 times the range of the estimation rows,
    /// about its middle: finite, if not good, where the free run leaves the data. `clamped` counts the values that were.
    ///
    /// # Errors
    /// As for [`apply`]; [`Error::Argument`] for models of other kinds.
    pub fn clamped_run(
        &self,
        log: &Log,
        rows: &[Rows],
        detrend: Option<Detrend>,
        initial: InitialCondition,
    ) -> Result<Applied, Error> {
        applied(&self.model, log, rows, detrend, (Horizon::FreeRun, initial), (&[], true))
    }
}

fn applied(
    model: &Model,
    log: &Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    (horizon, initial): (Horizon, InitialCondition),
    (fitted, clamp): (&[Rows], bool),
) -> Result<Applied, Error> {
    let Prepared { rows, log: deviations, levels } = prepared(model, log, rows, detrend, (horizon, initial))?;
    let model = &of_offsets(model, detrend);
    let on_log = match clamp {
        true => model.clamped_on_log(&deviations, &rows)?,
        false => model.on_log(&deviations, &rows, Some(initial), fitted)?,
    };
    let responses = on_log.respond(horizon, initial)?;
    let clamped = on_log.clamped();
    let outside: Vec<Option<f64>> =
        (0..responses.len()).map(|index| on_log.outside(index, &responses, horizon)).collect();
    let (each, forecast) = match horizon {
        Horizon::FreeRun => (on_log.run_deviations(initial), None),
        Horizon::Steps { steps } => {
            (Some(on_log.deviations(steps, initial)?), on_log.forecast(&deviations, &rows, steps, initial)?)
        }
    };
    let last = log.rows() - 1;
    let mut each = each.map(Vec::into_iter);
    let outputs = responses.into_iter().zip(on_log.outputs()).zip(&levels).enumerate();
    let outputs = outputs.map(|(index, ((response, output), level))| {
        let measured = log.channel(&output.name).ok().map(|channel| channel.values.clone());
        let fit = measured.is_some().then(|| {
            let fit =
                Fit::new(&output.name, on_log.measured(index), &response, &rows, None, (horizon, initial));
            Fit { outside: outside[index], ..fit }
        });
        let Response { values: mut predicted, .. } = response;
        let mut standard_deviations = each.as_mut().and_then(Iterator::next);
        if let (Some(deviations), Some((first, ahead))) = (&mut standard_deviations, &forecast) {
            let ahead = &ahead[index];
            let end = first + ahead.values.len();
            for (all, new) in
                [(&mut predicted, &ahead.values), (&mut *deviations, &ahead.standard_deviations)]
            {
                all.resize(end.max(log.rows()), f64::NAN);
                all[*first..end].copy_from_slice(new);
            }
        }
        for (row, value) in predicted.iter_mut().enumerate() {
            let beyond = row.saturating_sub(last) as f64 * log.sample_time();
            *value += level.at(log.elapsed(row.min(last)) + beyond);
        }
        AppliedOutput { name: output.name.clone(), measured, predicted, standard_deviations, fit }
    });
    let outputs: Vec<AppliedOutput> = outputs.collect();
    let beyond = outputs.first().map_or(0, |output| output.predicted.len() - log.rows());
    Ok(Applied { outputs, beyond, rows, clamped })
}

/// The model as it is beside offsets that are its own, or that were found elsewhere: of those it says nothing.
pub(super) fn of_offsets(model: &Model, detrend: Option<Detrend>) -> Cow<'_, Model> {
    match (model, detrend) {
        (Model::Polynomial(model), Some(_)) => {
            Cow::Owned(PolynomialModel { offset_covariance: None, ..(**model).clone() }.into())
        }
        (Model::Process(model), Some(_)) => {
            Cow::Owned(ProcessModel { offset_covariance: None, ..(**model).clone() }.into())
        }
        _ => Cow::Borrowed(model),
    }
}

/// A log of which the offsets were taken.
pub(super) struct Prepared {
    /// The rows to respond to.
    pub(super) rows: Vec<Rows>,
    /// The channels of the model; an output that is not there is missing in every row.
    pub(super) log: Log,
    /// What was taken from each output.
    pub(super) levels: Vec<Offset>,
}

/// Takes the offsets from the channels of a model.
pub(super) fn prepared(
    model: &Model,
    log: &Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    (horizon, initial): (Horizon, InitialCondition),
) -> Result<Prepared, Error> {
    check_sample_time(model, log)?;
    let all = vec![Rows::new(1, log.rows())?];
    let rows = checked("rows", if rows.is_empty() { &all } else { rows }, log.rows())?;
    for input in model.inputs() {
        log.channel(&input.name)?;
    }
    let absent = model.outputs().iter().find(|output| !log.has(&output.name));
    if let Some(output) = absent.filter(|_| horizon != Horizon::FreeRun || initial != InitialCondition::Zero)
    {
        return Err(Error::data(format!(
            "the log has no output '{}': only a free run from zero can do without it",
            output.name
        )));
    }
    let signals = || model.inputs().iter().chain(model.outputs());
    let offsets: Vec<Offset> = match detrend {
        None => signals().map(|signal| signal.offset).collect(),
        Some(detrend) => {
            check_offsets(model)?;
            let here: Vec<&str> = model.channels().filter(|name| log.has(name)).collect();
            let segments = log.segments(&here, &rows)?;
            let offset = |name: &str| match segments.is_empty() || !log.has(name) {
                true => Ok(Offset::default()),
                false => Offset::estimate(detrend, log, name, &segments),
            };
            signals().map(|signal| offset(&signal.name)).collect::<Result<_, Error>>()?
        }
    };
    let names = model.channels().zip(offsets.iter().copied());
    Ok(Prepared { log: log.deviations(names)?, rows, levels: offsets[model.inputs().len()..].to_vec() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Channel;
    use crate::model::Orders;
    use crate::respond::prediction_deviation;

    /// A(q) y = B(q) u + e around levels and slopes, with an input if there is a B.
    fn model(a: f64, b: &[f64]) -> PolynomialModel {
        let nk = [1];
        let orders = Orders::arx(1, &[b.len()][..b.len().min(1)], &nk[..b.len().min(1)]).unwrap();
        let parameters = [&[a], b].concat();
        let mut model = PolynomialModel::from_parameters(&orders, &parameters, None, 0.25, 2.0).unwrap();
        model.output.name = "y".to_owned();
        model.output.offset = Offset { level: 5.0, slope: 0.1 };
        for input in &mut model.inputs {
            input.name = "u".to_owned();
            input.offset = Offset { level: -1.0, slope: 0.0 };
        }
        model
    }

    fn channel(name: &str, values: &[f64]) -> Channel {
        Channel { name: name.to_owned(), values: values.to_vec() }
    }

    /// What `y` is measured from in a row (0-based).
    fn level(row: usize) -> f64 {
        5.0 + 0.1 * 2.0 * row as f64
    }

    fn predicted(model: &PolynomialModel, log: &Log, rows: &[Rows], steps: usize) -> One {
        one(apply(&model.clone().into(), log, rows, None, Horizon::Steps { steps }, InitialCondition::Drop)
            .unwrap())
    }

    /// What is said of the only output.
    struct One {
        beyond: usize,
        measured: Option<Vec<f64>>,
        predicted: Vec<f64>,
        standard_deviations: Option<Vec<f64>>,
        fit: Option<Fit>,
    }

    fn one(applied: Applied) -> One {
        let [AppliedOutput { name, measured, predicted, standard_deviations, fit }] =
            <[AppliedOutput; 1]>::try_from(applied.outputs).unwrap();
        assert_eq!(name, "y");
        One { beyond: applied.beyond, measured, predicted, standard_deviations, fit }
    }

    fn near(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-12 || (found.is_nan() && expected.is_nan())
    }

    #[test]
    fn a_series_is_forecast_beyond_its_end() {
        let model = model(-0.5, &[]);
        let y = [6.0, 4.0, 7.0, 6.5, 5.5];
        let log = Log::new(vec![channel("y", &y)], 2.0).unwrap();
        let applied = predicted(&model, &log, &[], 3);
        let deviations = applied.standard_deviations.unwrap();
        assert_eq!((applied.beyond, applied.predicted.len(), deviations.len()), (3, 8, 8));
        assert_eq!(applied.measured.unwrap(), y);
        let known = [f64::NAN, f64::NAN, f64::NAN, y[0] - level(0), y[1] - level(1)].map(|y| y / 8.0);
        let last = y[4] - level(4);
        let ahead = [last / 2.0, last / 4.0, last / 8.0];
        for (row, expected) in known.iter().chain(&ahead).enumerate() {
            assert!(near(applied.predicted[row], expected + level(row)), "{row}");
        }
        let spread = [3, 3, 1, 2, 3].map(|steps| prediction_deviation(&model, steps).unwrap());
        assert!(deviations[..3].iter().all(|deviation| deviation.is_nan()));
        assert_eq!(deviations[3..], spread);
        // The last two values are missing: two of three steps lie in the log.
        let log = Log::new(vec![channel("y", &[y[0], y[1], y[4], f64::NAN, f64::NAN])], 2.0).unwrap();
        let applied = predicted(&model, &log, &[], 3);
        assert_eq!((applied.beyond, applied.predicted.len()), (1, 6));
        let last = y[4] - level(2);
        for (step, expected) in [last / 2.0, last / 4.0, last / 8.0].into_iter().enumerate() {
            assert!(near(applied.predicted[3 + step], expected + level(3 + step)));
            assert_eq!(applied.standard_deviations.as_ref().unwrap()[3 + step], spread[2 + step]);
        }
        assert_eq!(applied.fit.unwrap().samples, 0);
        // One step of three.
        assert_eq!(predicted(&model, &log, &[], 1).beyond, 0);
        assert!(predicted(&model, &log, &[], 1).predicted[4].is_nan());
    }

    #[test]
    fn rows_that_were_not_asked_for_are_not_forecast() {
        let model = model(-0.5, &[]);
        let log = Log::new(vec![channel("y", &[1.0, 2.0, 3.0, 4.0])], 2.0).unwrap();
        let rows = |text: &str| [text.parse().unwrap()];
        let applied = predicted(&model, &log, &rows("1..3"), 2);
        assert_eq!((applied.beyond, applied.predicted.len()), (0, 4));
        assert!(applied.predicted[3].is_nan());
        assert_eq!(predicted(&model, &log, &rows("2..4"), 2).beyond, 2);
        // One row is enough for this model, and none is not.
        assert_eq!(predicted(&model, &log, &rows("4..4"), 2).beyond, 2);
        let none = Log::new(vec![channel("y", &[f64::NAN; 4])], 2.0).unwrap();
        assert_eq!(predicted(&model, &none, &[], 2).beyond, 0);
        let far = apply(
            &model.into(),
            &log,
            &[],
            None,
            Horizon::Steps { steps: usize::MAX },
            InitialCondition::Drop,
        );
        assert!(matches!(far, Err(Error::Argument { argument, .. }) if argument == "horizon"));
    }

    #[test]
    fn missing_outputs_at_the_end_are_forecast_from_their_inputs() {
        let model = model(-0.5, &[2.0]);
        let nan = f64::NAN;
        let u = [0.0, 1.0, -1.0, 2.0, 3.0, 1.0, 0.0];
        let y = [5.0, 6.0, 7.0, nan, nan, nan, nan];
        let log = |u: &[f64]| Log::new(vec![channel("u", u), channel("y", &y)], 2.0).unwrap();
        let applied = predicted(&model, &log(&u), &[], 3);
        assert_eq!((applied.beyond, applied.predicted.len()), (0, 7));
        let mut last = y[2] - level(2);
        for row in 3..6 {
            last = 0.5 * last + 2.0 * (u[row - 1] + 1.0);
            assert!(near(applied.predicted[row], last + level(row)), "{row}");
            let deviation = applied.standard_deviations.as_ref().unwrap()[row];
            assert_eq!(deviation, prediction_deviation(&model, row - 2).unwrap());
        }
        // Farther than the horizon there is nothing, nor after a gap in the input.
        assert!(applied.predicted[6].is_nan());
        let gap = predicted(&model, &log(&[u[0], u[1], u[2], u[3], nan, u[5], u[6]]), &[], 3);
        assert!(gap.predicted[3].is_finite() && gap.predicted[4..].iter().all(|value| value.is_nan()));
        // A horizon beyond the log is no error where the inputs end it.
        assert!(predicted(&model, &log(&u), &[], usize::MAX).predicted[6].is_finite());
    }

    #[test]
    fn a_jump_of_the_clock_ends_the_forecast() {
        let nan = f64::NAN;
        let time = vec![0.0, 2.0, 4.0, 6.0, 20.0, 22.0];
        let y = channel("y", &[1.0, 2.0, 3.0, nan, nan, nan]);
        let log = Log::with_time(vec![y], time).unwrap();
        let applied = predicted(&model(-0.5, &[]), &log, &[], 4);
        assert_eq!(applied.beyond, 0);
        assert!(applied.predicted[3].is_finite() && applied.predicted[4].is_nan());
    }

    #[test]
    fn free_runs_have_no_deviations_and_from_zero_they_grow() {
        let polynomial = model(-0.5, &[2.0]);
        let model = polynomial.clone().into();
        let y = [5.0, 6.0, 7.0, 5.0, 4.0];
        let log = Log::new(vec![channel("u", &[1.0; 5]), channel("y", &y)], 2.0).unwrap();
        let run = one(apply(&model, &log, &[], None, Horizon::FreeRun, InitialCondition::Estimate).unwrap());
        assert_eq!((run.beyond, run.standard_deviations, run.predicted.len()), (0, None, 5));
        let inputs = Log::new(vec![channel("u", &[1.0; 5])], 2.0).unwrap();
        let run = one(apply(&model, &inputs, &[], None, Horizon::FreeRun, InitialCondition::Zero).unwrap());
        assert_eq!((run.measured, run.standard_deviations, run.predicted.len()), (None, None, 5));
        let zero =
            one(apply(&model, &log, &[], None, Horizon::Steps { steps: 2 }, InitialCondition::Zero).unwrap());
        let steps = [1, 2, 2, 2, 2].map(|steps| prediction_deviation(&polynomial, steps).unwrap());
        assert_eq!(zero.standard_deviations.unwrap(), steps);
    }
}
