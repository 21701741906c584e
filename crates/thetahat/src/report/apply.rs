use std::borrow::Cow;

use super::fitted_rows::rows_of_fit;
use super::schema::Report;
use super::suited::{check_offsets, check_sample_time};
use crate::Error;
use crate::data::{Detrend, Log, Offset, Rows, checked};
use crate::model::Model;
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
    /// The measured output, one value for each row of the log; NaN where it is missing. None if the log does not have
    /// it.
    pub measured: Option<Vec<f64>>,
    /// The response, one value for each row of the log and then for each of the `beyond` rows after it; NaN outside the
    /// rows asked for, in gaps, and before a start. Gaps of the output alone are none for free runs, for models without
    /// A, C and D, and for those in equations.
    pub predicted: Vec<f64>,
    /// The standard deviations of the errors of `predicted`, those of the parameters among them, for the steps that
    /// each value looks ahead, as [`prediction_deviations`](crate::respond::prediction_deviations) and
    /// [`forecast`](crate::respond::forecast) have them; NaN where there is none. Of a free run those that a nonlinear
    /// ARX model has measured on rows that were held out, else None.
    pub standard_deviations: Option<Vec<f64>>,
    /// How close they are. None if the log does not have the output.
    pub fit: Option<Fit>,
}

/// Predicts or simulates a log with a model.
///
/// `rows` are those to respond to; none: all. The model's own offsets are used unless `detrend` says how to find
/// others on these rows. A free run also works on a log without the model's outputs, from [`InitialCondition::Zero`].
///
/// A prediction k steps ahead is also a forecast of the k samples after the last usable row, each as many steps ahead
/// as it lies after that row: of rows asked for that have the inputs but not the output, and, for a model that no input
/// drives and if the log's last row was asked for, of rows after the log's end, in its own time step. There is no
/// forecast where the last segment without a gap is too short to start from. A model without A, C and D needs no past
/// output: it has a value in every row that its inputs reach. So has one in equations, of which every prediction starts
/// from what its filter knows k rows before.
///
/// A model in equations begins in the state that it says in the first row of a log; [`Report::apply`] knows where it
/// was fitted.
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, a sample time that differs from the model's by more than 1
/// %, or a clock that the model cannot follow; and as for [`predict`](crate::respond::predict),
/// [`simulate`](crate::respond::simulate) and [`forecast`](crate::respond::forecast).
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
    /// [`apply`] of its model to a log of which it may have been fitted to some rows: there a model in equations begins
    /// with the first of them.
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

    /// What [`apply`](Self::apply) predicts of each output in all rows of a log, without deviations, figures and rows
    /// beyond its end: in 32 bytes a row, of which 16 are a copy of a log with an input, for an ARX model.
    ///
    /// # Errors
    /// As for [`apply`].
    pub fn predictions(
        &self,
        log: &Log,
        horizon: Horizon,
        initial: InitialCondition,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let Prepared { rows, log: deviations, levels } =
            prepared(&self.model, log, &[], None, (horizon, initial))?;
        let on_log = self.model.on_log(&deviations, &rows, Some(initial), &rows_of_fit(self, log)?)?;
        let responses = on_log.respond_alone(horizon, initial)?;
        let forecast = match horizon {
            Horizon::FreeRun => None,
            Horizon::Steps { steps } => on_log.forecast(&deviations, &rows, steps, initial)?,
        };
        let each = responses.into_iter().zip(&levels).enumerate().map(|(index, (response, level))| {
            let mut predicted = response.values;
            if let Some((first, ahead)) = &forecast {
                let new = &ahead[index].values;
                for (value, new) in predicted.iter_mut().skip(*first).zip(new) {
                    *value = *new;
                }
            }
            for (row, value) in predicted.iter_mut().enumerate() {
                *value += level.at(log.elapsed(row));
            }
            predicted
        });
        Ok(each.collect())
    }

    /// A free run of a nonlinear ARX model of which each output that is fed back is kept within 1.1 times the range of
    /// the estimation rows, about its middle: finite, if not good, where the free run leaves the data. `clamped` counts
    /// the values that were.
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

/// The model as it is beside offsets that are its own, or that were found elsewhere.
pub(super) fn of_offsets(model: &Model, detrend: Option<Detrend>) -> Cow<'_, Model> {
    if detrend.is_some() { model.without_own_offsets() } else { Cow::Borrowed(model) }
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
mod tests;
