//! The state of a model, row by row: the document that `thetahat filter` writes.

use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use thetahat::Document;
use thetahat::filter::{Estimator, InitialState, ObserverGain, StateEstimate, StateValues};
use thetahat::present::tables;
use thetahat::thetahat_core::nalgebra::Complex;

use crate::array::{finite_matrix, matrix, vector};
use crate::error;
use crate::grey_box::GreyBox;
use crate::model::Model;
use crate::online::argument::{reserve, row, sample, shaped};
use crate::online::innovation::{code, names};
use crate::online::results::{Column, Results};
use crate::work::Pulse;

/// A model with a state: the text of one with matrices or equations, or that of a report.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct StateModel {
    pub(crate) model: thetahat::filter::StateModel,
}

#[pymethods]
impl StateModel {
    /// Reads a text.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: &str) -> PyResult<Self> {
        let model = thetahat::filter::StateModel::from_toml(text).map_err(|error| error::batch(py, error))?;
        Ok(Self { model })
    }

    /// That of a fitted model, which starts at rest, anywhere, or as its equations say.
    #[staticmethod]
    fn from_model(py: Python<'_>, model: &Bound<'_, Model>, initial: Option<&str>) -> PyResult<Self> {
        let start = match initial {
            None => None,
            Some("zero") => Some(InitialState::Zero),
            Some("unknown") => Some(InitialState::Unknown),
            Some(other) => {
                let message = format!("initial: '{other}' is neither 'zero' nor 'unknown'");
                return Err(PyValueError::new_err(message));
            }
        };
        let report = model.get().report(py)?;
        let model = thetahat::filter::StateModel::from_report(&report, start);
        Ok(Self { model: model.map_err(|error| PyValueError::new_err(format!("model: {error}")))? })
    }

    /// The same with outputs that are measured with noise.
    fn with_measurement_noise(&self, deviations: Vec<f64>) -> PyResult<Self> {
        let model = self.model.clone().with_measurement_noise(&deviations);
        let model = model.map_err(|error| match error {
            thetahat::Error::Argument { message, .. } => {
                PyValueError::new_err(format!("measurement_noise: {message}"))
            }
            other => PyValueError::new_err(other.to_string()),
        })?;
        Ok(Self { model })
    }

    /// That of equations, of which parameters may be unknown.
    #[staticmethod]
    fn from_grey_box(model: &Bound<'_, GreyBox>) -> Self {
        Self { model: model.get().0.clone().into() }
    }

    #[getter]
    fn states(&self) -> Vec<String> {
        self.model.states().to_vec()
    }

    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.model.inputs().to_vec()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.model.outputs().to_vec()
    }

    /// The names of the unknown parameters.
    #[getter]
    fn unknown(&self) -> Vec<String> {
        self.model.unknown().map(str::to_owned).collect()
    }

    #[getter]
    fn sample_time(&self) -> f64 {
        self.model.sample_time()
    }

    #[getter]
    fn is_linear(&self) -> bool {
        self.model.is_linear()
    }
}

/// An estimator of the state of a model, fed row by row.
#[pyclass(module = "thetahat._thetahat")]
pub(crate) struct StateFilter {
    filter: thetahat::filter::StateFilter,
}

/// The numbers of the rows so far.
struct Record<'a> {
    columns: [Column<'a>; 16],
    codes: Vec<u8>,
    held: Vec<bool>,
}

/// Arrays of a run with one row for each row of the log: what [`Record`] writes.
const COLUMNS: [&str; 16] = [
    "predicted",
    "predicted_deviations",
    "filtered",
    "filtered_deviations",
    "parameters",
    "parameter_deviations",
    "outputs",
    "output_deviations",
    "innovations",
    "nis",
    "nis_bounds",
    "log_likelihoods",
    "predicted_bounds",
    "filtered_bounds",
    "output_bounds",
    "contradictions",
];

/// The numbers of a row in the order of [`COLUMNS`]; what an observer does not know is NaN.
fn numbers<'a>(
    estimate: &'a StateEstimate<'_>,
    unknown: &'a [f64],
    scalars: &'a mut [f64; 5],
) -> [&'a [f64]; 16] {
    fn bounds<'a>(values: &StateValues<'a>, unknown: &'a [f64]) -> &'a [f64] {
        values.bounds.unwrap_or(&unknown[..values.values.len()])
    }
    fn deviations<'a>(values: &StateValues<'a>, unknown: &'a [f64]) -> &'a [f64] {
        values.standard_deviations.unwrap_or(&unknown[..values.values.len()])
    }
    let (low, high) = estimate.nis_bounds.unwrap_or((f64::NAN, f64::NAN));
    let contradiction = estimate.contradiction.map_or(-1.0, |output| output as f64);
    let [nis, log_likelihood] = [estimate.nis, estimate.log_likelihood].map(|one| one.unwrap_or(f64::NAN));
    *scalars = [nis, low, high, log_likelihood, contradiction];
    let StateEstimate { predicted, parameters, outputs, .. } = estimate;
    let none = &unknown[..predicted.values.len()];
    let (filtered, filtered_deviations, filtered_bounds) = match &estimate.filtered {
        Some(filtered) => (filtered.values, deviations(filtered, unknown), bounds(filtered, unknown)),
        None => (none, none, none),
    };
    [
        predicted.values,
        deviations(predicted, unknown),
        filtered,
        filtered_deviations,
        parameters.values,
        deviations(parameters, unknown),
        outputs.values,
        deviations(outputs, unknown),
        estimate.innovations,
        &scalars[..1],
        &scalars[1..3],
        &scalars[3..4],
        bounds(predicted, unknown),
        filtered_bounds,
        bounds(outputs, unknown),
        &scalars[4..],
    ]
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl StateFilter {
    /// A filter before its first row: the word of the estimator or none; of an observer its poles, real and imaginary
    /// parts, or its gain.
    #[new]
    #[pyo3(signature = (model, estimator, deviations, poles, gain))]
    fn new(
        py: Python<'_>,
        model: &StateModel,
        estimator: Option<&str>,
        deviations: Option<f64>,
        poles: Option<(Vec<f64>, Vec<f64>)>,
        gain: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let model = model.model.clone();
        let gain = match (poles, gain) {
            (Some(_), Some(_)) => {
                return Err(PyValueError::new_err("gain: there are poles already; give one of the two"));
            }
            (Some((re, im)), None) => {
                let poles: Vec<Complex<f64>> =
                    re.into_iter().zip(im).map(|(re, im)| Complex::new(re, im)).collect();
                if !poles.iter().all(|pole| pole.re.is_finite() && pole.im.is_finite()) {
                    return Err(PyValueError::new_err("poles: expected finite numbers"));
                }
                Some(ObserverGain::Poles(poles))
            }
            (None, Some(gain)) => {
                let gain =
                    finite_matrix("gain", gain, [Some(model.states().len()), Some(model.outputs().len())])?;
                Some(ObserverGain::Matrix(gain.row_iter().map(|row| row.iter().copied().collect()).collect()))
            }
            (None, None) => None,
        };
        if deviations.is_some() && estimator != Some("bounded") {
            return Err(PyValueError::new_err("deviations are for estimator 'bounded'"));
        }
        let estimator = match (estimator, gain) {
            (Some("luenberger"), Some(gain)) => Estimator::Luenberger(gain),
            (Some("luenberger"), None) => {
                return Err(PyValueError::new_err("estimator: 'luenberger' needs poles or gain"));
            }
            (Some("kalman" | "ekf" | "iekf" | "ukf" | "bounded") | None, Some(_)) => {
                return Err(PyValueError::new_err("poles and gain are for estimator 'luenberger'"));
            }
            (Some("kalman"), None) => Estimator::Kalman,
            (Some("ekf"), None) => Estimator::Extended,
            (Some("iekf"), None) => Estimator::Iterated,
            (Some("ukf"), None) => Estimator::Unscented,
            (Some("bounded"), None) => Estimator::Bounded { deviations },
            (None, None) if model.is_linear() => Estimator::Kalman,
            (None, None) => Estimator::Extended,
            (Some(other), _) => {
                return Err(PyValueError::new_err(format!(
                    "estimator: '{other}' is none of 'kalman', 'ekf', 'iekf', 'ukf', 'bounded', 'luenberger'"
                )));
            }
        };
        let filter =
            thetahat::filter::StateFilter::new(model, estimator).map_err(|failure| match failure {
                thetahat::Error::Argument { argument, message } if argument == "start" => {
                    PyValueError::new_err(format!("model: it cannot start: {message}"))
                }
                other => error::batch(py, other),
            })?;
        Ok(Self { filter })
    }

    /// Takes a row; seconds since the row before, or one sample time.
    #[pyo3(signature = (seconds, inputs, outputs))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        seconds: Option<f64>,
        inputs: &Bound<'py, PyAny>,
        outputs: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let model = self.filter.model();
        let (mut u, mut y) = (vec![0.0; model.inputs().len()], vec![0.0; model.outputs().len()]);
        sample("u", inputs, u.len(), &mut u)?;
        sample("y", outputs, y.len(), &mut y)?;
        self.filter.step(seconds, &u, &y).map_err(|error| error::batch(py, error))?;
        self.latest(py)?.ok_or_else(|| PyValueError::new_err("there is no row yet"))
    }

    /// The outputs of the next rows from their inputs, shape (steps, m); an input that is NaN is held.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        inputs: &Bound<'py, PyAny>,
        steps: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let model = self.filter.model();
        let (k, m) = (model.inputs().len(), model.outputs().len());
        let inputs = if k == 0 { None } else { Some(matrix("u", inputs, [Some(steps), Some(k)])?) };
        let inputs = inputs.as_ref().map_or(Ok(&[][..]), |inputs| inputs.as_slice())?;
        let (mut filter, missing) = (self.filter.clone(), vec![f64::NAN; m]);
        let mut outputs = reserve(&[steps, m])?;
        for at in 0..steps {
            let estimate = filter.step(None, row(inputs, at, k), &missing);
            let estimate = estimate.map_err(|error| error::batch(py, error))?;
            outputs.extend_from_slice(estimate.outputs.values);
        }
        shaped(py, outputs, [steps, m])
    }

    /// What is known after the latest row.
    fn latest<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(estimate) = self.filter.latest() else { return Ok(None) };
        let unknown = self.unknown();
        let mut scalars = [0.0; 5];
        let found = PyDict::new(py);
        for (name, values) in COLUMNS.into_iter().zip(numbers(&estimate, &unknown, &mut scalars)) {
            match (name, values) {
                ("nis", [nis]) => found.set_item(name, nis)?,
                ("contradictions", [output]) => found.set_item("contradiction", *output as i64)?,
                ("log_likelihoods", [log_likelihood]) => found.set_item("log_likelihood", log_likelihood)?,
                _ => found.set_item(name, PyArray1::from_slice(py, values))?,
            }
        }
        found.set_item("row", estimate.row - 1)?;
        found.set_item("time", estimate.time)?;
        found.set_item("action", estimate.action.word())?;
        found.set_item("held", PyArray1::from_slice(py, estimate.held))?;
        Ok(Some(found))
    }

    /// Takes many rows: the seconds before each, NaN for one sample time; none for that of all. The first row of all is
    /// at `start` seconds. Smoothed, also each state given all rows.
    #[pyo3(signature = (seconds, inputs, outputs, start, smooth))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        seconds: Option<&Bound<'py, PyAny>>,
        inputs: &Bound<'py, PyAny>,
        outputs: &Bound<'py, PyAny>,
        start: f64,
        smooth: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let model = self.filter.model();
        let (n, k, m, p) =
            (model.states().len(), model.inputs().len(), model.outputs().len(), model.unknown().len());
        let outputs = matrix("y", outputs, [None, Some(m)])?;
        let rows = outputs.shape()[0];
        let outputs = outputs.as_slice()?;
        let inputs = if k == 0 { None } else { Some(matrix("u", inputs, [Some(rows), Some(k)])?) };
        let inputs = inputs.as_ref().map_or(Ok(&[][..]), |inputs| inputs.as_slice())?;
        let seconds = seconds.map(|seconds| vector("time", seconds, Some(rows))).transpose()?;
        let seconds = seconds.as_ref().map(|seconds| seconds.as_slice()).transpose()?;
        let mut filter = self.filter.clone();
        if filter.latest().is_none() {
            filter = filter.starting_at(start);
        } else if smooth {
            return Err(PyValueError::new_err(
                "smooth: the filter has seen rows already, which are not kept; make another",
            ));
        }
        let mut recording = smooth.then(|| filter.clone().recording());
        let unknown = self.unknown();

        let each = |width: usize| vec![rows, width];
        let given = |width: usize| if smooth { vec![rows, width] } else { vec![0, width] };
        let shapes = [
            each(n),
            each(n),
            each(n),
            each(n),
            each(p),
            each(p),
            each(m),
            each(m),
            each(m),
            vec![rows],
            each(2),
            vec![rows],
            each(n),
            each(n),
            each(m),
            vec![rows],
            given(n),
            given(n),
            given(p),
            given(p),
        ];
        let results = Results::new(py, shapes)?;
        let taken = results.write(|columns| {
            let [
                a,
                b,
                c,
                d,
                e,
                f,
                g,
                h,
                i,
                j,
                l,
                o,
                q,
                r,
                s,
                t,
                mut states,
                mut state_deviations,
                mut parameters,
                mut parameter_deviations,
            ] = columns;
            let mut record = Record {
                columns: [a, b, c, d, e, f, g, h, i, j, l, o, q, r, s, t],
                codes: Vec::new(),
                held: Vec::new(),
            };
            py.detach(|| {
                let mut pulse = Pulse::new((n + p).pow(3));
                let mut scalars = [0.0; 5];
                for at in 0..rows {
                    pulse.check()?;
                    let step =
                        seconds.and_then(|seconds| seconds.get(at)).copied().filter(|step| !step.is_nan());
                    let (u, y) = (row(inputs, at, k), row(outputs, at, m));
                    let estimate = filter.step(step, u, y).map_err(Stop::Refused)?;
                    for (column, values) in
                        record.columns.iter_mut().zip(numbers(&estimate, &unknown, &mut scalars))
                    {
                        column.push(values);
                    }
                    record.codes.push(code(estimate.action));
                    record.held.extend_from_slice(estimate.held);
                    if let Some(recording) = &mut recording {
                        recording.step(step, u, y).map_err(Stop::Refused)?;
                    }
                }
                if let Some(recording) = &recording {
                    let smoothed = recording.smooth().map_err(Stop::Refused)?;
                    for at in 1..=smoothed.rows() {
                        let Some((state, unknown)) = smoothed.row(at) else { continue };
                        states.push(state.values);
                        state_deviations.push(state.standard_deviations.unwrap_or_default());
                        parameters.push(unknown.values);
                        parameter_deviations.push(unknown.standard_deviations.unwrap_or_default());
                    }
                }
                Ok((filter, record.codes, record.held))
            })
        })?;
        let (filter, codes, held) = taken.map_err(|stop: Stop| match stop {
            Stop::Refused(failure) => error::batch(py, failure),
            Stop::Interrupted(raised) => raised,
        })?;
        let found = PyDict::new(py);
        let smoothed =
            ["smoothed", "smoothed_deviations", "smoothed_parameters", "smoothed_parameter_deviations"];
        for (name, array) in COLUMNS.into_iter().chain(smoothed).zip(results.arrays()?) {
            if smooth || !smoothed.contains(&name) {
                found.set_item(name, array)?;
            }
        }
        found.set_item("actions", names(py, &PyArray1::from_vec(py, codes))?)?;
        found.set_item("held", PyArray1::from_vec(py, held).reshape([rows, k])?)?;
        self.filter = filter;
        Ok(found)
    }

    /// How many rows it has taken.
    #[getter]
    fn rows(&self) -> usize {
        self.filter.latest().map_or(0, |estimate| estimate.row)
    }

    /// The document.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.filter.summary().to_json().map_err(|error| error::batch(py, error))
    }

    /// The table that `thetahat filter` prints.
    fn table(&self) -> String {
        tables::filtered(&self.filter.summary(), "", error::layout())
    }

    /// What to think of normalised innovations that are far from what the model says.
    fn warning(&self) -> Option<String> {
        thetahat_cli::consistency(&self.filter.summary()).map(|text| error::in_python(&text))
    }

    /// Where it stands, without its model.
    fn snapshot(&self) -> PyResult<String> {
        serde_json::to_string(&self.filter.snapshot())
            .map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Goes to the place of a snapshot.
    fn resume(&mut self, py: Python<'_>, text: &str) -> PyResult<()> {
        let snapshot = serde_json::from_str(text)
            .map_err(|error| PyValueError::new_err(error::in_python(&format!("not a snapshot: {error}"))))?;
        self.filter = self.filter.clone().resumed(snapshot).map_err(|error| error::batch(py, error))?;
        Ok(())
    }
}

impl StateFilter {
    /// As many NaN as an estimate has numbers of a kind.
    fn unknown(&self) -> Vec<f64> {
        let model = self.filter.model();
        vec![f64::NAN; model.states().len().max(model.outputs().len()).max(model.unknown().len())]
    }
}

/// Why a run ended before its last row.
enum Stop {
    /// The library refused a row.
    Refused(thetahat::Error),
    /// A handler of a signal raised this.
    Interrupted(PyErr),
}

impl From<PyErr> for Stop {
    fn from(raised: PyErr) -> Self {
        Stop::Interrupted(raised)
    }
}
