//! Models that are estimated along a log: the state and the document of `thetahat track`.

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyList, PyString, PyTuple};
use thetahat::Document;
use thetahat::present::tables;
use thetahat::track::{PerChannel, TrackOptions};
use thetahat_cli::{Failure, TrackedRow, Tracking};

use crate::array::{matrix, vector};
use crate::error;
use crate::model::Model;
use crate::online::argument::{self, reserve, row};
use crate::online::detector::Alarm;
use crate::online::forgetting::Memory;
use crate::online::innovation::{code, names};
use crate::online::results::Results;
use crate::plan::options;
use crate::work::Pulse;

/// A way to forget as the command line writes it.
#[pyfunction]
pub(crate) fn policy(forgetting: Memory) -> String {
    thetahat::track::Policy(forgetting.0).to_string()
}

/// ARX or ARMAX models of one log, one for each way to forget.
#[pyclass(module = "thetahat._thetahat")]
pub(crate) struct Tracker {
    tracking: Tracking,
}

/// Times, what they are called, and the first one as it was written where they are dates.
type Clock<'py> = (Bound<'py, PyAny>, String, Option<String>);

/// Arrays of a run: (rows, trackers), those of parameters with one more axis.
const COLUMNS: [&str; 8] =
    ["predicted", "errors", "variances", "nis", "excitation", "forecasts", "parameters", "standard_errors"];

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl Tracker {
    /// A tracker with the options of a plan for these channels, from nothing or from a fitted model.
    #[new]
    #[pyo3(signature = (plan, sample_time, inputs, outputs, report))]
    fn new(
        py: Python<'_>,
        plan: &str,
        sample_time: Option<f64>,
        inputs: Vec<String>,
        outputs: Vec<String>,
        report: Option<&Bound<'_, Model>>,
    ) -> PyResult<Self> {
        let asked: TrackOptions = options(py, plan)?;
        let report = report.map(|model| model.get().report(py)).transpose()?;
        let tracking = py
            .detach(|| Tracking::new(&asked, sample_time, inputs, outputs, report.as_deref()))
            .map_err(|error| match error {
            thetahat::Error::Report { .. } => PyValueError::new_err(format!("warm: {error}")),
            other => error::batch(py, other),
        })?;
        Ok(Self { tracking })
    }

    /// Goes on from a state.
    #[staticmethod]
    fn from_state(py: Python<'_>, text: &str, inputs: Option<Vec<String>>) -> PyResult<Self> {
        let tracking = Tracking::from_state(text, inputs).map_err(|failure| error::program(py, &failure))?;
        Ok(Self { tracking })
    }

    /// The state.
    fn state(&mut self, py: Python<'_>) -> PyResult<String> {
        self.tracking.state().map_err(|failure| error::program(py, &failure))
    }

    /// Takes rows: inputs, outputs, their clock if they have one, and the rows before which an unknown number is
    /// missing.
    #[pyo3(signature = (inputs, outputs, clock, gaps, stop_on_alarm))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        inputs: &Bound<'py, PyAny>,
        outputs: &Bound<'py, PyAny>,
        clock: Option<Clock<'py>>,
        gaps: Vec<usize>,
        stop_on_alarm: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (k, l) = (self.tracking.inputs().len(), self.tracking.outputs().len());
        let outputs = matrix("y", outputs, [None, Some(l)])?;
        let rows = outputs.shape()[0];
        let outputs = outputs.as_slice()?;
        let inputs = if k == 0 { None } else { Some(matrix("u", inputs, [Some(rows), Some(k)])?) };
        let inputs = inputs.as_ref().map_or(Ok(&[][..]), |inputs| inputs.as_slice())?;
        let (seconds, name, start) = match clock {
            Some((seconds, name, start)) => (Some(vector("time", &seconds, Some(rows))?), name, start),
            None => (None, String::new(), None),
        };
        let seconds = seconds.as_ref().map(|seconds| seconds.as_slice()).transpose()?;
        let mut values = reserve(&[rows, k + l])?;
        for at in 0..rows {
            let (inputs, outputs) = (row(inputs, at, k), row(outputs, at, l));
            let names = self.tracking.inputs().iter().chain(self.tracking.outputs());
            for (value, name) in inputs.iter().chain(outputs).zip(names) {
                if value.is_infinite() {
                    let message = format!("row {}: '{name}' is infinite; NaN is a missing sample", at + 1);
                    return Err(PyValueError::new_err(message));
                }
            }
            values.extend_from_slice(inputs);
            values.extend_from_slice(outputs);
        }

        let of_alarms = self.of_alarms();
        let (count, n) = (of_alarms.len(), self.names().len());
        let (flat, deep) = (vec![rows, count], vec![rows, count, n]);
        let mut shapes = [const { Vec::new() }; 8];
        shapes[..6].fill(flat);
        shapes[6..].fill(deep);
        let results = Results::new(py, shapes)?;
        let mut alarms = Vec::new();
        let (mut codes, mut too_large) = (reserve(&[rows, count])?, reserve(&[rows, count])?);
        let unknown = vec![f64::NAN; n];
        let taken = results.write(|mut columns| {
            py.detach(|| {
                let mut pulse = Pulse::new(count * 4 * n * n + 100);
                let mut at = 0;
                let next = || -> Result<_, Stop> {
                    if at == rows {
                        return Ok(None);
                    }
                    pulse.check()?;
                    let time = seconds.and_then(|seconds| seconds.get(at)).copied();
                    let found = (row(&values, at, k + l), time, gaps.contains(&at));
                    at += 1;
                    Ok(Some(found))
                };
                let mut seen = |row: &TrackedRow<'_>| {
                    let tracked = &row.tracked;
                    for (column, number) in columns.iter_mut().zip(columns_of(row)) {
                        column.push(&[number]);
                    }
                    columns[6].push(row.tracker.parameters().unwrap_or(&unknown));
                    columns[7].push(row.standard_errors);
                    let index = codes.len() / count;
                    codes.push(code(tracked.action));
                    too_large.push(tracked.too_large);
                    if let Some(given) = tracked.alarm {
                        let (policy, output) = of_alarms.get(row.index).cloned().unwrap_or_default();
                        alarms.push(Alarm::of(given, index, policy, output));
                    }
                };
                self.tracking.rows(Some((&name, start)), next, &mut seen, stop_on_alarm)
            })
        })?;
        taken.map_err(|stop: Stop| match stop {
            Stop::Refused(failure) => error::program(py, &failure),
            Stop::Interrupted(raised) => raised,
        })?;
        let found = PyDict::new(py);
        found.set_item("taken", codes.len() / count)?;
        for (name, array) in COLUMNS.into_iter().zip(results.arrays()?) {
            found.set_item(name, array)?;
        }
        found.set_item("actions", names(py, &PyArray1::from_vec(py, codes))?)?;
        found.set_item("too_large", PyArray1::from_vec(py, too_large))?;
        found.set_item("alarms", PyList::new(py, alarms)?)?;
        Ok(found)
    }

    /// Takes one row; what each tracker made of it, in the order of `Tracked`: numbers and words of one tracker, arrays
    /// and lists of several.
    fn row<'py>(
        &mut self,
        py: Python<'py>,
        y: &Bound<'py, PyAny>,
        u: Option<&Bound<'py, PyAny>>,
        time: Option<f64>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let (k, l) = (self.tracking.inputs().len(), self.tracking.outputs().len());
        let mut values = vec![f64::NAN; k + l];
        let (inputs, outputs) = values.split_at_mut(k);
        argument::sample("y", y, l, outputs)?;
        argument::sample("u", u.unwrap_or(&py.None().into_bound(py)), k, inputs)?;
        let row = self.tracking.count();
        if row > 0 && self.tracking.clock().is_some() != time.is_some() {
            let (before, now) =
                if time.is_none() { ("had times", "has none") } else { ("had no times", "has one") };
            let message = format!(
                "time: the rows before {before}, and this one {now}; give all of them times, or none"
            );
            return Err(PyValueError::new_err(message));
        }
        if let (Some(time), Some(last)) = (time, self.tracking.last_time())
            && (row > 0 && time <= last)
        {
            let message = format!(
                "time: the row is {} s before the latest one that was taken; give later rows",
                last - time
            );
            return Err(PyValueError::new_err(message));
        }
        let of_alarms = self.of_alarms();
        let count = of_alarms.len();
        let mut numbers = [const { Vec::new() }; 6];
        let (mut actions, mut alarms) = (Vec::with_capacity(count), Vec::new());
        let mut seen = |row_of: &TrackedRow<'_>| {
            let tracked = &row_of.tracked;
            numbers.iter_mut().zip(columns_of(row_of)).for_each(|(column, number)| column.push(number));
            actions.push(if tracked.too_large { "too large" } else { tracked.action.word() });
            if let Some(given) = tracked.alarm {
                let (policy, output) = of_alarms.get(row_of.index).cloned().unwrap_or_default();
                alarms.push(Alarm::of(given, usize::try_from(row).unwrap_or(usize::MAX), policy, output));
            }
        };
        let clock = if time.is_some() { "time" } else { "" };
        let taken = self.tracking.row(clock, &values, time, &mut seen);
        taken.map_err(|failure| error::program(py, &failure))?;
        let one = |column: &[f64]| match column {
            [number] => PyFloat::new(py, *number).into_any(),
            several => PyArray1::from_slice(py, several).into_any(),
        };
        let [predicted, errors, variances, nis, excitation, forecasts] =
            numbers.each_ref().map(|column| one(column));
        let action = match &actions[..] {
            [word] => PyString::new(py, word).into_any(),
            several => PyList::new(py, several)?.into_any(),
        };
        let alarms = PyList::new(py, alarms)?.into_any();
        PyTuple::new(py, [predicted, errors, variances, nis, action, excitation, forecasts, alarms])
    }

    /// The predictions of the next rows, shape (steps, trackers), from their inputs, or from the latest ones.
    #[pyo3(signature = (future, steps))]
    fn predict<'py>(
        &mut self,
        py: Python<'py>,
        future: Option<&Bound<'py, PyAny>>,
        steps: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let k = self.tracking.inputs().len();
        let future = future.map(|future| matrix("u", future, [Some(steps), Some(k)])).transpose()?;
        let future = future.as_ref().map(|future| future.as_slice()).transpose()?;
        let found = self.tracking.predict(future, steps).map_err(|failure| error::program(py, &failure))?;
        two_dimensions(py, found)
    }

    /// Tells that an unknown number of rows is missing here.
    fn gap(&mut self, py: Python<'_>) -> PyResult<()> {
        self.tracking.gap().map_err(|failure| error::program(py, &failure))
    }

    /// The prediction this many steps ahead of each tracker.
    fn forecast<'py>(&mut self, py: Python<'py>, steps: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let found = self.tracking.forecast(steps).map_err(|failure| error::program(py, &failure))?;
        Ok(PyArray1::from_vec(py, found))
    }

    /// The document.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.tracking.summary().to_json().map_err(|error| error::batch(py, error))
    }

    /// The table that `thetahat track` prints.
    fn table(&self) -> String {
        let watched = self.tracking.trackers().iter().any(|tracker| tracker.detector().is_some());
        tables::tracking(&self.tracking.summary(), "", watched, error::layout())
    }

    /// The parameters of each tracker; NaN before there is an estimate.
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let each = self.tracking.trackers().iter().map(|tracker| {
            tracker.parameters().map_or_else(|| vec![f64::NAN; tracker.names().len()], <[f64]>::to_vec)
        });
        two_dimensions(py, each.collect())
    }

    /// Their standard errors; NaN where they are not known.
    fn standard_errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let each = self.tracking.trackers().iter().map(|tracker| {
            let mut errors = vec![f64::NAN; tracker.names().len()];
            tracker.write_standard_errors(&mut errors).map(|()| errors)
        });
        two_dimensions(py, each.collect::<Result<_, _>>().map_err(|error| error::batch(py, error))?)
    }

    /// The variance of e of each tracker; NaN where it is not known.
    fn noise_variances<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let each = self.tracking.trackers().iter();
        PyArray1::from_iter(py, each.map(|tracker| tracker.noise_variance().unwrap_or(f64::NAN)))
    }

    /// The names of the parameters.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.tracking.trackers().first().map_or_else(Vec::new, |tracker| tracker.names().to_vec())
    }

    /// The ways to forget.
    #[getter]
    fn policies(&self) -> Vec<String> {
        let each = self.tracking.trackers().iter().step_by(self.tracking.outputs().len().max(1));
        each.map(|tracker| tracker.plan().forgetting.to_string()).collect()
    }

    /// Structure and orders, such as ARX(2, 2, 1).
    #[getter]
    fn orders(&self) -> String {
        self.tracking.trackers().first().map_or_else(String::new, thetahat::track::Tracker::model)
    }

    /// What is taken from each channel, the outputs last.
    #[getter]
    fn offsets(&self) -> Vec<f64> {
        let each: Vec<_> = self.model().map(|tracker| (tracker, tracker.offsets())).collect();
        channels(&each)
    }

    /// The typical magnitudes of the channels, the outputs last; none while they are not known.
    #[getter]
    fn scales(&self) -> Option<Vec<f64>> {
        let each = self.model().map(|tracker| Some((tracker, tracker.scales()?)));
        each.collect::<Option<Vec<_>>>().map(|each| channels(&each))
    }

    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.tracking.inputs().to_vec()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.tracking.outputs().to_vec()
    }

    #[getter]
    fn horizon(&self) -> Option<usize> {
        self.tracking.horizon()
    }

    /// Whether changes are watched for.
    #[getter]
    fn watched(&self) -> bool {
        self.tracking.trackers().iter().any(|tracker| tracker.detector().is_some())
    }

    #[getter]
    fn rows(&self) -> u64 {
        self.tracking.count()
    }

    /// What the times are called, the first one as it was written, and the latest one.
    #[getter]
    fn clock(&self) -> (Option<String>, Option<String>, Option<f64>) {
        let owned = |text: Option<&str>| text.map(str::to_owned);
        (owned(self.tracking.clock()), owned(self.tracking.start()), self.tracking.last_time())
    }
}

fn two_dimensions(py: Python<'_>, rows: Vec<Vec<f64>>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    PyArray2::from_vec2(py, &rows).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// What a tracker made of a row, in the order of `COLUMNS`.
fn columns_of(row: &TrackedRow<'_>) -> [f64; 6] {
    let tracked = &row.tracked;
    let nis = if tracked.variance.is_finite() { tracked.nis } else { f64::NAN };
    let forecast = row.forecast.unwrap_or(f64::NAN);
    [tracked.predicted, tracked.error, tracked.variance, nis, tracked.excitation, forecast]
}

impl Tracker {
    /// What an alarm of each tracker is of, where there are several ways to forget, and several outputs.
    fn of_alarms(&self) -> Vec<(Option<String>, Option<String>)> {
        let (policies, outputs) = (self.policies(), self.tracking.outputs());
        let several = policies.len() > 1;
        let of = |policy: &String| {
            let policy = several.then(|| policy.clone());
            outputs.iter().map(move |output| (policy.clone(), (outputs.len() > 1).then(|| output.clone())))
        };
        policies.iter().flat_map(of).collect()
    }

    /// The trackers of the first way to forget: one for each output.
    fn model(&self) -> impl Iterator<Item = &thetahat::track::Tracker> {
        self.tracking.trackers().iter().take(self.tracking.outputs().len())
    }
}

/// One number for each channel, the outputs last, of the trackers of a model.
fn channels(each: &[(&thetahat::track::Tracker, &PerChannel)]) -> Vec<f64> {
    let inputs = each.first().map(|(tracker, numbers)| (tracker.coupled_outputs(), &numbers.inputs));
    let inputs = inputs.into_iter().flat_map(|(coupled, inputs)| inputs.iter().skip(coupled));
    inputs.copied().chain(each.iter().map(|(_, numbers)| numbers.output)).collect()
}

/// Why a run ended before its last row.
enum Stop {
    /// The program refused a row.
    Refused(Failure),
    /// A handler of a signal raised this.
    Interrupted(PyErr),
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Stop::Refused(failure)
    }
}

impl From<PyErr> for Stop {
    fn from(raised: PyErr) -> Self {
        Stop::Interrupted(raised)
    }
}
