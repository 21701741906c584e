//! Change detection: charts that watch the innovations of an estimator.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;
use serde::{Deserialize, Serialize};
use thetahat::track::change_detector;
use thetahat_core::nalgebra::DVector;
use thetahat_core::{Action, Alarm as Given, ChangeDetector as Charts, Chart, Innovation as Kept};

use super::argument::{self, Whole, count, failed};
use super::innovation::{Innovation, text};
use super::results::Results;
use super::{Reduced, attributes, snapshot};
use crate::work::Pulse;
use crate::{array, error};

/// The most outputs that thresholds are known for.
const MOST_OUTPUTS: usize = 1000;

/// What a chart says once it has passed its threshold.
///
/// Attributes
/// ----------
/// chart : {"mean_up", "mean_down", "variance"}
///     The chart that passed its threshold; if several did at once, the one that is furthest beyond its own.
/// statistic : float
///     Its statistic, before it was set back to 0.
/// samples : int
///     Since how many samples it had been above 0, this one included: the maximum likelihood estimate of how long ago
///     the change was. Only samples with an innovation of known variance are counted.
/// row : int or None
///     The row of a run that gave it, counted from 0; None of `ChangeDetector.update`.
/// forgetting : str or None
///     The way to forget of the tracker that gave it, where a `Tracker` has several.
/// output : str or None
///     The output that it is about, where a `Tracker` has several.
#[pyclass(module = "thetahat", frozen, eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct Alarm {
    given: Given<f64>,
    #[pyo3(get)]
    row: Option<usize>,
    #[pyo3(get)]
    forgetting: Option<String>,
    #[pyo3(get)]
    output: Option<String>,
}

impl Alarm {
    fn new(given: Given<f64>, row: Option<usize>) -> Self {
        Alarm { given, row, forgetting: None, output: None }
    }

    /// That of one of several trackers, or of the only one.
    pub(crate) fn of(
        given: Given<f64>,
        row: usize,
        forgetting: Option<String>,
        output: Option<String>,
    ) -> Self {
        Alarm { given, row: Some(row), forgetting, output }
    }

    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        type Kept = (String, f64, u32, Option<usize>, Option<String>, Option<String>);
        let (word, statistic, samples, row, forgetting, output): Kept = kept.extract()?;
        let chart = Chart::ALL.into_iter().find(|chart| chart.word() == word);
        let chart = chart.ok_or_else(|| PyValueError::new_err(format!("chart: there is no chart {word}")))?;
        Ok(Alarm { given: Given { chart, statistic, samples }, row, forgetting, output })
    }
}

#[pymethods]
impl Alarm {
    #[getter]
    fn chart(&self) -> &'static str {
        self.given.chart.word()
    }

    #[getter]
    fn statistic(&self) -> f64 {
        self.given.statistic
    }

    #[getter]
    fn samples(&self) -> u32 {
        self.given.samples
    }

    fn __repr__(&self) -> String {
        let Given { chart, statistic, samples } = self.given;
        let row = self.row.map_or_else(String::new, |row| format!(", row={row}"));
        let forgetting =
            self.forgetting.as_ref().map_or_else(String::new, |policy| format!(", forgetting='{policy}'"));
        let output = self.output.as_ref().map_or_else(String::new, |output| format!(", output='{output}'"));
        let (chart, statistic) = (chart.word(), text(statistic));
        format!("Alarm(chart='{chart}', statistic={statistic}, samples={samples}{row}{forgetting}{output})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let Given { chart, statistic, samples } = self.given;
        attributes(
            "Alarm",
            (chart.word(), statistic, samples, self.row, &self.forgetting, &self.output).into_pyobject(py)?,
        )
    }
}

/// What a change detector did in a run, row by row.
///
/// Attributes
/// ----------
/// statistics : ndarray, shape (N, 3)
///     Where the charts stand after each row: mean up, mean down, variance. A chart that gave an alarm is back at 0.
/// thresholds : ndarray, shape (3,)
///     Their thresholds; inf of a chart that is turned off.
/// alarms : list of Alarm
///     What passed a threshold.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct ChangeTrajectory {
    #[pyo3(get)]
    statistics: Py<PyArray2<f64>>,
    #[pyo3(get)]
    thresholds: Py<PyArray1<f64>>,
    #[pyo3(get)]
    alarms: Py<PyList>,
}

impl ChangeTrajectory {
    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (statistics, thresholds, alarms) = kept.extract()?;
        Ok(ChangeTrajectory { statistics, thresholds, alarms })
    }
}

#[pymethods]
impl ChangeTrajectory {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.statistics.bind(py).as_any().len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (rows, alarms) = (self.__len__(py)?, self.alarms.bind(py).len());
        Ok(format!("ChangeTrajectory({rows} rows, {alarms} alarm{})", if alarms == 1 { "" } else { "s" }))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        attributes("ChangeTrajectory", (&self.statistics, &self.thresholds, &self.alarms).into_pyobject(py)?)
    }
}

/// The charts, and how many outputs they are for.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Engine {
    charts: Charts<f64>,
    outputs: usize,
}

/// Watches innovations for a change: two CUSUM charts of the mean and one of the variance.
///
/// Parameters
/// ----------
/// interval : float
///     How many samples shall be between two false alarms on average, 10 to 1e9.
/// outputs : int, default 1
///     How many elements an innovation has.
///
/// Raises
/// ------
/// ValueError
///     If a number is out of its range.
///
/// Notes ----- As long as a model is right, its normalised innovation z = e/sqrt(S) is white, with mean 0 and
/// variance 1. Each chart is the cumulative sum of a log-likelihood ratio, for the change that it is to find, held
/// above 0::
///
///     mean up       g <- max(0, g + z - 1/2)               a mean of 1 (in standard deviations) against 0
///     mean down     g <- max(0, g - z - 1/2)               a mean of -1 against 0
///     variance      g <- max(0, g + (z^2/2 - ln 2)/2)      a variance of 2 against 1
///
/// and an alarm is given where g exceeds its threshold; then that chart starts again from 0. With m > 1 outputs only
/// the variance is watched, by the normalised square of the innovation: g <- max(0, g + (nis/2 - m ln 2)/2).
///
/// The thresholds follow from the interval for Gaussian innovations: with one output half of the false alarms are from
/// the charts of the mean, half from that of the variance. Outliers and heavy tails give more.
///
/// References ---------- Page, Continuous inspection schemes, Biometrika 41, 1954. Basseville and Nikiforov, Detection
/// of Abrupt Changes, 1993, sections 2.2 and 2.6.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import ChangeDetector, RecursiveLeastSquares
/// >>> noise = np.random.default_rng(2).standard_normal(600)
/// >>> y = np.where(np.arange(600) < 500, noise, noise + 2.0)
/// >>> level = RecursiveLeastSquares(1, None).run(np.ones((600, 1)), y)
/// >>> changes = ChangeDetector(10_000).run(level.errors, level.variances)
/// >>> alarm = changes.alarms[0]
/// >>> alarm.chart, 500 <= alarm.row < 520, abs(alarm.row + 1 - alarm.samples - 500) <= 3
/// ('mean_up', True, True)
#[pyclass(module = "thetahat")]
pub(crate) struct ChangeDetector {
    engine: Engine,
}

impl ChangeDetector {
    pub(crate) fn restore(engine: Engine) -> PyResult<Self> {
        let fits = (1..=MOST_OUTPUTS).contains(&engine.outputs);
        fits.then_some(ChangeDetector { engine })
            .ok_or_else(|| PyValueError::new_err("not a snapshot: it has another number of outputs"))
    }

    fn charts(&self, of: impl Fn(&Charts<f64>, Chart) -> f64) -> [f64; 3] {
        Chart::ALL.map(|chart| of(&self.engine.charts, chart))
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl ChangeDetector {
    #[new]
    #[pyo3(signature = (interval, outputs = Whole(1)), text_signature = "(interval, outputs=1)")]
    fn new(py: Python<'_>, interval: &Bound<'_, PyAny>, outputs: Whole) -> PyResult<Self> {
        let interval = argument::number("interval", interval)?;
        let outputs = count("outputs", outputs, 1, MOST_OUTPUTS)?;
        let charts = py.detach(|| change_detector(interval, outputs)).map_err(|failure| match failure {
            // The command line calls it so.
            thetahat::Error::Argument { argument, message } if argument == "alarm" => {
                PyValueError::new_err(format!("interval: {message}"))
            }
            other => error::batch(py, other),
        })?;
        Ok(ChangeDetector { engine: Engine { charts, outputs } })
    }

    /// A detector with these thresholds.
    ///
    /// Parameters
    /// ----------
    /// mean_threshold : float
    ///     Of the two charts of the mean; inf turns them off. They are not used with several outputs.
    /// variance_threshold : float
    ///     Of the chart of the variance; inf turns it off.
    /// outputs : int, default 1
    ///     How many elements an innovation has.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a threshold is not above 0.
    ///
    /// Examples
    /// --------
    /// >>> from thetahat import ChangeDetector
    /// >>> ChangeDetector.with_thresholds(4.0, 6.0).thresholds
    /// array([4., 4., 6.])
    #[staticmethod]
    #[pyo3(signature = (mean_threshold, variance_threshold, outputs = Whole(1)))]
    #[pyo3(text_signature = "(mean_threshold, variance_threshold, outputs=1)")]
    fn with_thresholds(
        py: Python<'_>,
        mean_threshold: &Bound<'_, PyAny>,
        variance_threshold: &Bound<'_, PyAny>,
        outputs: Whole,
    ) -> PyResult<Self> {
        let mean = argument::number("mean_threshold", mean_threshold)?;
        let variance = argument::number("variance_threshold", variance_threshold)?;
        let outputs = count("outputs", outputs, 1, MOST_OUTPUTS)?;
        let charts = Charts::new(mean, variance).map_err(|error| failed(py, error))?;
        Ok(ChangeDetector { engine: Engine { charts, outputs } })
    }

    /// Take the innovation of a sample. One that is missing, or whose variance is not known, changes nothing.
    ///
    /// Parameters
    /// ----------
    /// innovation : Innovation
    ///     Of a recursive estimator or a filter.
    ///
    /// Returns
    /// -------
    /// Alarm or None
    ///     What passed its threshold.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If it has another number of elements. Nothing has changed then.
    fn update(&mut self, innovation: &Innovation) -> PyResult<Option<Alarm>> {
        let Engine { charts, outputs } = &mut self.engine;
        let innovation = innovation.elements();
        if innovation.error.len() != *outputs {
            let found = innovation.error.len();
            return Err(PyValueError::new_err(format!(
                "innovation: expected {outputs} {}, found {found}",
                array::plural(*outputs)
            )));
        }
        Ok(charts.update_all(&innovation).map(|given| Alarm::new(given, None)))
    }

    /// Take many innovations: the same as `update` in a loop, to the bit.
    ///
    /// The interpreter lock is released meanwhile.
    ///
    /// Parameters
    /// ----------
    /// errors : array_like, shape (N,), or (N, outputs)
    ///     The innovations. NaN is a missing one.
    /// variances : array_like, the shape of ``errors``
    ///     Their variances. NaN is one that is not known.
    /// nis : array_like, shape (N,), optional
    ///     The normalised innovations squared. They are needed with several outputs only.
    ///
    /// Returns
    /// -------
    /// ChangeTrajectory
    ///     The charts, row by row, and the alarms.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, or an innovation infinite; the message names the row, from 1. Nothing has changed then.
    #[pyo3(signature = (errors, variances, *, nis = None))]
    fn run(
        &mut self,
        py: Python<'_>,
        errors: &Bound<'_, PyAny>,
        variances: &Bound<'_, PyAny>,
        nis: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<ChangeTrajectory> {
        let outputs = self.engine.outputs;
        let errors = array::matrix("errors", errors, [None, Some(outputs)])?;
        let errors = errors.as_slice()?;
        let rows = errors.len() / outputs;
        let variances = array::matrix("variances", variances, [Some(rows), Some(outputs)])?;
        let variances = variances.as_slice()?;
        let nis = nis.map(|nis| array::vector("nis", nis, Some(rows))).transpose()?;
        let nis = match &nis {
            Some(nis) => nis.as_slice()?,
            None if outputs == 1 => &[],
            None => {
                return Err(PyValueError::new_err(format!(
                    "nis: expected {rows} {}, found None",
                    array::plural(rows)
                )));
            }
        };
        for (argument, values, columns) in [("errors", errors, outputs), ("nis", nis, 1)] {
            if let Some(place) = values.iter().position(|value| value.is_infinite()) {
                let row = place / columns + 1;
                return Err(PyValueError::new_err(format!("row {row}: {argument} is infinite")));
            }
        }
        let mut charts = self.engine.charts.clone();
        let results = Results::new(py, [vec![rows, 3]])?;
        let mut found = Vec::new();
        results.write(|[mut statistics]| {
            py.detach(|| {
                let mut pulse = Pulse::new(8 + outputs);
                let mut innovation =
                    Kept::new(DVector::zeros(outputs), DVector::zeros(outputs), 0.0, Action::Updated);
                for row in 0..rows {
                    pulse.check()?;
                    innovation.error.as_mut_slice().copy_from_slice(argument::row(errors, row, outputs));
                    innovation
                        .variance
                        .as_mut_slice()
                        .copy_from_slice(argument::row(variances, row, outputs));
                    innovation.nis = nis.get(row).copied().unwrap_or(0.0);
                    if let Some(given) = charts.update_all(&innovation) {
                        found.push(Alarm::new(given, Some(row)));
                    }
                    statistics.push(&Chart::ALL.map(|chart| charts.statistic(chart)));
                }
                PyResult::Ok(())
            })
        })??;
        let [statistics] = results.arrays()?;
        let trajectory = ChangeTrajectory {
            statistics: statistics.cast_into()?.unbind(),
            thresholds: self.thresholds(py).unbind(),
            alarms: PyList::new(py, found)?.unbind(),
        };
        self.engine.charts = charts;
        Ok(trajectory)
    }

    /// Set all charts back to 0, as after a change that is known.
    fn reset(&mut self) {
        self.engine.charts.reset();
    }

    /// Where the charts stand, shape (3,): mean up, mean down, variance.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.charts(Charts::statistic))
    }

    /// The thresholds, shape (3,); inf of a chart that is turned off.
    #[getter]
    fn thresholds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.charts(Charts::threshold))
    }

    /// How many elements an innovation has.
    #[getter]
    fn outputs(&self) -> usize {
        self.engine.outputs
    }

    fn __repr__(&self) -> String {
        let outputs = self.engine.outputs;
        let [mean, _, variance] = self.charts(Charts::threshold).map(text);
        format!("ChangeDetector(outputs={outputs}, mean_threshold={mean}, variance_threshold={variance})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "ChangeDetector", &self.engine)
    }
}
