use std::borrow::Cow;

use crate::data::{Detrend, Log, Offset, Record, Rows, checked};
use crate::respond::{Forecast, Start, check_steps, forecast_if_possible, prediction_deviations, simulate};
use crate::validate::{Fit, Horizon};
use crate::{Error, Model};

/// What a model says of a log, in the log's own units.
#[derive(Debug, Clone, PartialEq)]
pub struct Applied {
    /// The measured output, one value for each row of the log; NaN where it is missing. None if the log has no output.
    pub measured: Option<Vec<f64>>,
    /// The response, one value for each row of the log and then for each of the `beyond` rows behind it; NaN outside the
    /// rows asked for, in gaps, and before a start. Gaps of the output alone are none for free runs, and for models without A,
    /// C and D.
    pub predicted: Vec<f64>,
    /// The standard deviations of the errors of `predicted`, those of the parameters among them, for the steps that each value
    /// looks ahead, as [`prediction_deviations`](crate::prediction_deviations) and [`forecast`](crate::forecast) have them;
    /// NaN where there is none. None for a free run.
    pub standard_deviations: Option<Vec<f64>>,
    /// How many rows behind the end of the log are forecast.
    pub beyond: usize,
    /// The rows asked for, in rising order.
    pub rows: Vec<Rows>,
    /// How close they are. None if the log has no output.
    pub fit: Option<Fit>,
}

/// Predicts or simulates a log with a model.
///
/// `rows` are those to respond to; none: all. The model's own offsets are used unless `detrend` says how to find
/// others on these rows. A free run also works on a log without the model's output, from [`Start::Zero`].
///
/// A prediction k steps ahead is also a forecast of the k samples behind the last usable row, each as many steps
/// ahead as it lies behind that row: of rows asked for that have the inputs but not the output, and, for a model that
/// no input drives and if the log's last row was asked for, of rows behind the log's end, in its own time step. There
/// is no forecast where the last stretch without a gap is too short to start from. A model without A, C and D needs no past
/// output: it has a value in every row that its inputs reach.
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, or a sample time that differs from the model's by more than
/// 1 %; and as for [`predict`](crate::predict), [`simulate`](crate::simulate) and [`forecast`](crate::forecast).
pub fn apply(
    model: &Model,
    mut log: Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    horizon: Horizon,
    initial: Start,
) -> Result<Applied, Error> {
    let Prepared { rows, measured, level } = prepared(model, &mut log, rows, detrend, (horizon, initial))?;
    let model = &of_offsets(model, detrend);
    let has_output = measured.is_some();
    let absent = vec![0.0; if has_output { 0 } else { log.rows() }];
    let record = if has_output {
        record_for(model, &log, &rows, horizon, initial)?
    } else {
        record(model, &log, &rows, Some(&absent))?
    };
    let (fit, response) = if has_output {
        let (fit, response) = Fit::of(model, &record, &rows, None, horizon, initial)?;
        (Some(fit), response)
    } else {
        (None, simulate(model, &record, initial)?)
    };
    let (mut predicted, mut standard_deviations) = match horizon {
        Horizon::FreeRun => (response.values, None),
        Horizon::Steps { steps } => {
            (response.values, Some(prediction_deviations(model, &record, steps, initial)?))
        }
    };
    if let (Horizon::Steps { steps }, Some(deviations)) = (horizon, &mut standard_deviations)
        && let Some((first, ahead)) = ahead(model, &log, &record, &rows, steps, initial)?
    {
        let end = first + ahead.values.len();
        for (all, new) in [(&mut predicted, &ahead.values), (&mut *deviations, &ahead.standard_deviations)] {
            all.resize(end.max(log.rows()), f64::NAN);
            all[first..end].copy_from_slice(new);
        }
    }
    let last = log.rows() - 1;
    for (row, value) in predicted.iter_mut().enumerate() {
        let beyond = row.saturating_sub(last) as f64 * log.sample_time();
        *value += level.at(log.elapsed(row.min(last)) + beyond);
    }
    let beyond = predicted.len() - log.rows();
    Ok(Applied { measured, predicted, standard_deviations, beyond, rows, fit })
}

/// The model as it is beside offsets that are its own, or that were found elsewhere: of those it says nothing.
pub(super) fn of_offsets(model: &Model, detrend: Option<Detrend>) -> Cow<'_, Model> {
    match detrend {
        None => Cow::Borrowed(model),
        Some(_) => Cow::Owned(Model { offset_covariance: None, ..model.clone() }),
    }
}

/// A log of which the offsets were taken.
pub(super) struct Prepared {
    /// The rows to respond to.
    pub(super) rows: Vec<Rows>,
    /// The output as it was, if there is one.
    pub(super) measured: Option<Vec<f64>>,
    /// What was taken from it.
    pub(super) level: Offset,
}

/// Takes the offsets from the channels of a model, in place.
pub(super) fn prepared(
    model: &Model,
    log: &mut Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    (horizon, initial): (Horizon, Start),
) -> Result<Prepared, Error> {
    check_sample_time(model, log)?;
    let all = vec![Rows::new(1, log.rows())?];
    let rows = checked("--rows", if rows.is_empty() { &all } else { rows }, log.rows())?;
    let output = &model.output.name;
    // A copy, as what is taken off and put back on again is no longer the same to the bit.
    let measured = log.channel(output).ok().map(|channel| channel.values.clone());
    if measured.is_none() && (horizon != Horizon::FreeRun || initial != Start::Zero) {
        return Err(Error::data(format!(
            "the log has no output '{output}': only a free run from zero can do without it"
        )));
    }
    let names = model.inputs.iter().map(|input| &input.name);
    let used: Vec<&str> = names.chain(measured.is_some().then_some(output)).map(String::as_str).collect();
    let segments = log.segments(&used, &rows)?;
    let mut level = model.output.offset;
    for signal in
        model.inputs.iter().chain([&model.output]).filter(|signal| used.contains(&signal.name.as_str()))
    {
        let offset = match detrend {
            None => signal.offset,
            Some(_) if segments.is_empty() => Offset::default(),
            Some(detrend) => Offset::estimate(detrend, log, &signal.name, &segments)?,
        };
        log.remove(&signal.name, &offset);
        if signal.name == *output {
            level = offset;
        }
    }
    Ok(Prepared { rows, measured, level })
}

/// The signals of a model over some rows; `absent` stands for an output that the log does not have.
pub(super) fn record<'a>(
    model: &Model,
    log: &'a Log,
    rows: &[Rows],
    absent: Option<&'a [f64]>,
) -> Result<Record<'a>, Error> {
    let names: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
    let Some(output) = absent else { return log.record(&names, &model.output.name, rows) };
    let used: Vec<&str> = names.iter().map(String::as_str).collect();
    let segments = log.segments(&used, rows)?;
    let inputs = names.iter().map(|name| Ok(log.channel(name)?.values.as_slice()));
    let past = vec![0; segments.len()];
    Ok(Record { output, inputs: inputs.collect::<Result<_, Error>>()?, segments, past })
}

/// The record that a response of a model looks at. It goes on through missing outputs where no past one is needed.
pub(super) fn record_for<'l>(
    model: &Model,
    log: &'l Log,
    rows: &[Rows],
    horizon: Horizon,
    start: Start,
) -> Result<Record<'l>, Error> {
    let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
    let needed = match horizon {
        Horizon::Steps { .. } => model.orders.needs_past_outputs(),
        Horizon::FreeRun => start == Start::Drop,
    };
    let output = &model.output.name;
    if needed { log.record(&inputs, output, rows) } else { log.driven_record(&inputs, output, rows) }
}

/// The log must have the model's sample time.
pub(super) fn check_sample_time(model: &Model, log: &Log) -> Result<(), Error> {
    if (log.sample_time() / model.sample_time - 1.0).abs() > 0.01 {
        return Err(Error::data(format!(
            "the log's sample time is {} s, the model's {} s; resample the log, or fit a model to it",
            log.sample_time(),
            model.sample_time
        )));
    }
    Ok(())
}

/// The forecast behind the last usable row, and the row (0-based) that it begins with.
fn ahead(
    model: &Model,
    log: &Log,
    record: &Record<'_>,
    rows: &[Rows],
    steps: usize,
    initial: Start,
) -> Result<Option<(usize, Forecast)>, Error> {
    let Some(first) = record.segments.last().map(|segment| segment.end) else { return Ok(None) };
    let driving = model.inputs.iter().zip(&model.orders.nb).filter(|(_, nb)| **nb > 0);
    let driving: Vec<&str> = driving.map(|(input, _)| input.name.as_str()).collect();
    // As far as the inputs go on without a gap.
    let stretches = log.segments(&driving, rows)?;
    let stretch = stretches.into_iter().find(|stretch| stretch.contains(&(first - 1)));
    let end = stretch.map_or(first, |stretch| stretch.end);
    let known = if driving.is_empty() && end == log.rows() { steps } else { steps.min(end - first) };
    if known == 0 {
        return Ok(None);
    }
    check_steps("horizon", known)?;
    let future: Vec<&[f64]> = record.inputs.iter().map(|u| &u[first..end]).collect();
    // Values of an input that drives nothing may be missing, and are not needed.
    let future: Vec<&[f64]> =
        future.iter().zip(&model.orders.nb).map(|(u, nb)| if *nb > 0 { *u } else { &[] }).collect();
    let forecast = forecast_if_possible(model, record, &future, known, initial)?;
    Ok(forecast.map(|forecast| (first, forecast)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, Orders, prediction_deviation};

    /// A(q) y = B(q) u + e around levels and slopes, with an input if there is a B.
    fn model(a: f64, b: &[f64]) -> Model {
        let nk = [1];
        let orders = Orders::arx(1, &[b.len()][..b.len().min(1)], &nk[..b.len().min(1)]).unwrap();
        let parameters = [&[a], b].concat();
        let mut model = Model::from_parameters(&orders, &parameters, None, 0.25, 2.0).unwrap();
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

    fn predicted(model: &Model, log: &Log, rows: &[Rows], steps: usize) -> Applied {
        apply(model, log.clone(), rows, None, Horizon::Steps { steps }, Start::Drop).unwrap()
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
        let far = apply(&model, log, &[], None, Horizon::Steps { steps: usize::MAX }, Start::Drop);
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
        // Farther than the horizon there is nothing, nor behind a gap in the input.
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
        let model = model(-0.5, &[2.0]);
        let y = [5.0, 6.0, 7.0, 5.0, 4.0];
        let log = Log::new(vec![channel("u", &[1.0; 5]), channel("y", &y)], 2.0).unwrap();
        let run = apply(&model, log.clone(), &[], None, Horizon::FreeRun, Start::Estimate).unwrap();
        assert_eq!((run.beyond, run.standard_deviations, run.predicted.len()), (0, None, 5));
        let inputs = Log::new(vec![channel("u", &[1.0; 5])], 2.0).unwrap();
        let run = apply(&model, inputs, &[], None, Horizon::FreeRun, Start::Zero).unwrap();
        assert_eq!((run.measured, run.standard_deviations, run.predicted.len()), (None, None, 5));
        let zero = apply(&model, log, &[], None, Horizon::Steps { steps: 2 }, Start::Zero).unwrap();
        let steps = [1, 2, 2, 2, 2].map(|steps| prediction_deviation(&model, steps).unwrap());
        assert_eq!(zero.standard_deviations.unwrap(), steps);
    }
}
