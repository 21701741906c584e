//! Runs of filters and observers over many samples, and what they return.

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat_core::nalgebra::{Const, DVector, OVector};
use thetahat_core::{Covariance, Dimension, Error, Innovation};

use super::argument::{self, Rows, reserve, shaped};
use super::results::{Column, Results};
use super::{Reduced, Stop, attributes, innovation};
use crate::array;
use crate::work::Pulse;

/// What a Kalman filter did in a run, row by row.
///
/// Attributes
/// ----------
/// predicted_states : ndarray, shape (N, n)
///     The states before each measurement.
/// predicted_covariances : ndarray, shape (N, n, n)
///     Their covariances.
/// filtered_states : ndarray, shape (N, n)
///     The states after each measurement.
/// filtered_covariances : ndarray, shape (N, n, n)
///     Their covariances.
/// errors : ndarray, shape (N, m)
///     The innovations; NaN where an element is missing.
/// variances : ndarray, shape (N, m)
///     The variance of each element, given those after it in the same measurement.
/// nis : ndarray, shape (N,)
///     The normalised innovations squared.
/// actions : ndarray of str, shape (N,)
///     What was done with each row, see `Innovation`. Each access makes a new array.
/// log_likelihood : float
///     The log-likelihood of all measurements.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct FilterTrajectory {
    #[pyo3(get)]
    predicted_states: Py<PyAny>,
    #[pyo3(get)]
    predicted_covariances: Py<PyAny>,
    #[pyo3(get)]
    filtered_states: Py<PyAny>,
    #[pyo3(get)]
    filtered_covariances: Py<PyAny>,
    #[pyo3(get)]
    errors: Py<PyAny>,
    #[pyo3(get)]
    variances: Py<PyAny>,
    #[pyo3(get)]
    nis: Py<PyArray1<f64>>,
    codes: Py<PyArray1<u8>>,
    #[pyo3(get)]
    log_likelihood: f64,
}

impl FilterTrajectory {
    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let ((predicted_states, predicted_covariances, filtered_states, filtered_covariances), others) =
            kept.extract()?;
        let others: Bound<'_, PyAny> = others;
        let (errors, variances, nis, codes, log_likelihood) = others.extract()?;
        Ok(FilterTrajectory {
            predicted_states,
            predicted_covariances,
            filtered_states,
            filtered_covariances,
            errors,
            variances,
            nis,
            codes,
            log_likelihood,
        })
    }
}

#[pymethods]
impl FilterTrajectory {
    #[getter]
    fn actions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        innovation::names(py, self.codes.bind(py))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.nis.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.filtered_states.bind(py).getattr("shape")?;
        let log_likelihood = innovation::text(self.log_likelihood);
        Ok(format!("FilterTrajectory(states of shape {shape}, log_likelihood={log_likelihood})"))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let estimates = (
            &self.predicted_states,
            &self.predicted_covariances,
            &self.filtered_states,
            &self.filtered_covariances,
        );
        let others = (&self.errors, &self.variances, &self.nis, &self.codes, self.log_likelihood);
        attributes("FilterTrajectory", (estimates, others).into_pyobject(py)?)
    }
}

/// What an observer did in a run, row by row.
///
/// Attributes
/// ----------
/// predicted_states : ndarray, shape (N, n)
///     The states before each measurement.
/// errors : ndarray, shape (N, m)
///     The innovations; NaN where an element is missing.
/// actions : ndarray of str, shape (N,)
///     What was done with each row. Each access makes a new array.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct ObserverTrajectory {
    #[pyo3(get)]
    pub(crate) predicted_states: Py<PyAny>,
    #[pyo3(get)]
    pub(crate) errors: Py<PyAny>,
    pub(crate) codes: Py<PyArray1<u8>>,
}

impl ObserverTrajectory {
    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (predicted_states, errors, codes) = kept.extract()?;
        Ok(ObserverTrajectory { predicted_states, errors, codes })
    }
}

#[pymethods]
impl ObserverTrajectory {
    #[getter]
    fn actions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        innovation::names(py, self.codes.bind(py))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.codes.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.predicted_states.bind(py).getattr("shape")?;
        Ok(format!("ObserverTrajectory(states of shape {shape})"))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let kept = (&self.predicted_states, &self.errors, &self.codes);
        attributes("ObserverTrajectory", kept.into_pyobject(py)?)
    }
}

/// The states given all measurements, earlier and later ones.
///
/// Attributes
/// ----------
/// states : ndarray, shape (N, n)
///     The mean of the state at each row.
/// covariances : ndarray, shape (N, n, n)
///     Its covariance.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct SmoothedTrajectory {
    #[pyo3(get)]
    states: Py<PyAny>,
    #[pyo3(get)]
    covariances: Py<PyAny>,
}

impl SmoothedTrajectory {
    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (states, covariances) = kept.extract()?;
        Ok(SmoothedTrajectory { states, covariances })
    }
}

#[pymethods]
impl SmoothedTrajectory {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.states.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.states.bind(py).getattr("shape")?;
        Ok(format!("SmoothedTrajectory(states of shape {shape})"))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        attributes("SmoothedTrajectory", (&self.states, &self.covariances).into_pyobject(py)?)
    }
}

/// What a Kalman filter comes to when its models do not change in time.
///
/// Attributes
/// ----------
/// predicted : ndarray, shape (n, n)
///     P before a measurement.
/// filtered : ndarray, shape (n, n)
///     P after it.
/// gain : ndarray, shape (n, m)
///     K, for x <- x + K (y - H x - D u).
/// predictor_gain : ndarray, shape (n, m)
///     F K, the gain of a `LuenbergerObserver`.
/// steps : int
///     How many samples it took.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct SteadyState {
    #[pyo3(get)]
    pub(crate) predicted: Py<PyArray2<f64>>,
    #[pyo3(get)]
    pub(crate) filtered: Py<PyArray2<f64>>,
    #[pyo3(get)]
    pub(crate) gain: Py<PyArray2<f64>>,
    #[pyo3(get)]
    pub(crate) predictor_gain: Py<PyArray2<f64>>,
    #[pyo3(get)]
    pub(crate) steps: usize,
}

impl SteadyState {
    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (predicted, filtered, gain, predictor_gain, steps) = kept.extract()?;
        Ok(SteadyState { predicted, filtered, gain, predictor_gain, steps })
    }
}

#[pymethods]
impl SteadyState {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.gain.bind(py).getattr("shape")?;
        Ok(format!("SteadyState(gain of shape {shape}, steps={})", self.steps))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let kept = (&self.predicted, &self.filtered, &self.gain, &self.predictor_gain, self.steps);
        attributes("SteadyState", kept.into_pyobject(py)?)
    }
}

/// The measurements and inputs of a run.
pub(crate) struct Samples<'py> {
    measurements: Rows<'py>,
    inputs: Rows<'py>,
    pub(crate) rows: usize,
    outputs: usize,
    widths: [usize; 2],
    columns: usize,
}

impl<'py> Samples<'py> {
    /// Checks them against models with so many inputs, or any number.
    pub(crate) fn new(
        measurements: &Bound<'py, PyAny>,
        outputs: usize,
        inputs: Option<&Bound<'py, PyAny>>,
        wanted: [Option<usize>; 2],
    ) -> PyResult<Self> {
        if outputs == 0 {
            return Err(PyValueError::new_err("measurements: expected one or two dimensions"));
        }
        let measurements = Rows::new("measurements", Some(measurements), None, outputs)?;
        let rows = measurements.as_slice()?.len() / outputs;
        let known = wanted.iter().flatten().copied().max().unwrap_or_default();
        let differ = wanted.iter().flatten().any(|&count| count > 0 && count != known);
        if differ {
            return Err(PyValueError::new_err(
                "inputs: expected as many in the transition as in the observation, where both have some",
            ));
        }
        let columns = match inputs {
            None => known,
            Some(_) if known > 0 => known,
            Some(given) if wanted.contains(&None) => columns("inputs", given)?,
            Some(_) => 0,
        };
        let inputs = Rows::new("inputs", inputs, Some(rows), columns)?;
        let widths = wanted.map(|count| count.unwrap_or(columns));
        Ok(Samples { measurements, inputs, rows, outputs, widths, columns })
    }

    /// What can be read without the interpreter lock.
    pub(crate) fn slices(&self) -> PyResult<Slices<'_>> {
        let (measurements, inputs) = (self.measurements.as_slice()?, self.inputs.as_slice()?);
        let (rows, outputs, columns) = (self.rows, self.outputs, self.columns);
        Ok(Slices { measurements, inputs, rows, outputs, columns, widths: self.widths })
    }
}

/// How many signals these rows have.
pub(crate) fn columns(argument: &str, rows: &Bound<'_, PyAny>) -> PyResult<usize> {
    match *array::numbers(argument, rows)?.shape() {
        [_] => Ok(1),
        [_, columns] => Ok(columns),
        _ => Err(PyValueError::new_err(format!("{argument}: expected one or two dimensions"))),
    }
}

/// The same as slices.
pub(crate) struct Slices<'a> {
    measurements: &'a [f64],
    inputs: &'a [f64],
    pub(crate) rows: usize,
    pub(crate) outputs: usize,
    columns: usize,
    widths: [usize; 2],
}

/// One sample: what a model without input gets is empty.
pub(crate) struct Sample<M: Dimension> {
    pub(crate) measurement: OVector<f64, M>,
    /// For the transition, and for the observation.
    pub(crate) inputs: [DVector<f64>; 2],
}

impl Slices<'_> {
    /// Room for a sample with so many outputs, which are those of these slices.
    pub(crate) fn sample<M: Dimension>(&self, outputs: M) -> Sample<M> {
        let measurement = OVector::zeros_generic(outputs, Const::<1>);
        Sample { measurement, inputs: self.widths.map(DVector::zeros) }
    }

    pub(crate) fn read<M: Dimension>(&self, row: usize, into: &mut Sample<M>) {
        let measurement = argument::row(self.measurements, row, self.outputs);
        into.measurement.as_mut_slice().copy_from_slice(measurement);
        for input in into.inputs.iter_mut().filter(|input| !input.is_empty()) {
            input.as_mut_slice().copy_from_slice(argument::row(self.inputs, row, self.columns));
        }
    }
}

/// A filter with its models: N states and M outputs.
pub(crate) trait Steps<N: Dimension, M: Dimension> {
    fn state(&self) -> &OVector<f64, N>;
    fn covariance(&self) -> &Covariance<f64, N>;
    fn correct(&mut self, sample: &Sample<M>) -> Result<Innovation<f64, OVector<f64, M>>, Error>;
    fn predict(&mut self, sample: &Sample<M>) -> Result<(), Error>;
}

/// The results of the rows so far.
pub(crate) struct Record<'a> {
    predicted_states: Column<'a>,
    predicted_covariances: Column<'a>,
    filtered_states: Column<'a>,
    filtered_covariances: Column<'a>,
    errors: Column<'a>,
    variances: Column<'a>,
    nis: Column<'a>,
    codes: Vec<u8>,
    log_likelihood: f64,
}

impl Record<'_> {
    /// Corrects and predicts, row after row.
    pub(crate) fn run<N: Dimension, M: Dimension>(
        &mut self,
        filter: &mut impl Steps<N, M>,
        samples: &Slices<'_>,
        outputs: M,
    ) -> Result<(), Stop> {
        let mut sample = samples.sample(outputs);
        let entries = filter.state().len() * filter.state().len();
        let mut pulse = Pulse::new(entries * filter.state().len());
        for row in 0..samples.rows {
            pulse.check()?;
            samples.read(row, &mut sample);
            self.predicted_states.push(filter.state().as_slice());
            filter
                .covariance()
                .write_into(self.predicted_covariances.next(entries))
                .map_err(|error| (row, error))?;
            let innovation = filter.correct(&sample).map_err(|error| (row, error))?;
            self.filtered_states.push(filter.state().as_slice());
            filter
                .covariance()
                .write_into(self.filtered_covariances.next(entries))
                .map_err(|error| (row, error))?;
            self.errors.push(innovation.error.as_slice());
            self.variances.push(innovation.variance.as_slice());
            self.nis.push(&[innovation.nis]);
            self.codes.push(innovation::code(innovation.action));
            self.log_likelihood += innovation.log_likelihood();
            filter.predict(&sample).map_err(|error| (row, error))?;
        }
        Ok(())
    }
}

/// Does the work of a run, and gives back what that returns beside the results.
pub(crate) fn recorded<F>(
    py: Python<'_>,
    [rows, n, m]: [usize; 3],
    work: impl FnOnce(&mut Record<'_>) -> PyResult<F>,
) -> PyResult<(F, FilterTrajectory)> {
    let shapes: [&[usize]; 7] =
        [&[rows, n], &[rows, n, n], &[rows, n], &[rows, n, n], &[rows, m], &[rows, m], &[rows]];
    let shapes = shapes.map(<[usize]>::to_vec);
    let (results, codes) = (Results::new(py, shapes)?, reserve(&[rows])?);
    let (filter, codes, log_likelihood) = results.write(|columns| {
        let [
            predicted_states,
            predicted_covariances,
            filtered_states,
            filtered_covariances,
            errors,
            variances,
            nis,
        ] = columns;
        let mut record = Record {
            predicted_states,
            predicted_covariances,
            filtered_states,
            filtered_covariances,
            errors,
            variances,
            nis,
            codes,
            log_likelihood: 0.0,
        };
        work(&mut record).map(|filter| (filter, record.codes, record.log_likelihood))
    })??;
    let [
        predicted_states,
        predicted_covariances,
        filtered_states,
        filtered_covariances,
        errors,
        variances,
        nis,
    ] = results.arrays()?.map(Bound::unbind);
    let trajectory = FilterTrajectory {
        predicted_states,
        predicted_covariances,
        filtered_states,
        filtered_covariances,
        errors,
        variances,
        nis: nis.into_bound(py).cast_into()?.unbind(),
        codes: PyArray1::from_vec(py, codes).unbind(),
        log_likelihood,
    };
    Ok((filter, trajectory))
}

/// Smoothed states, and their covariances, row by row.
pub(crate) type Smoothed = (Vec<f64>, Vec<f64>);

pub(crate) fn smoothed(
    py: Python<'_>,
    (states, covariances): Smoothed,
    rows: usize,
    n: usize,
) -> PyResult<SmoothedTrajectory> {
    Ok(SmoothedTrajectory {
        states: shaped(py, states, [rows, n])?.unbind(),
        covariances: shaped(py, covariances, [rows, n, n])?.unbind(),
    })
}

/// A measurement, and whether it was a number alone.
pub(crate) fn measurement(value: &Bound<'_, PyAny>, outputs: usize) -> PyResult<(DVector<f64>, bool)> {
    let mut measurement = DVector::zeros(outputs);
    argument::sample("measurement", value, outputs, measurement.as_mut_slice())?;
    Ok((measurement, argument::is_number(value)))
}

/// The innovation as it is returned: a number alone gets numbers.
pub(crate) fn returned(
    innovation: Innovation<f64, DVector<f64>>,
    single: bool,
) -> super::innovation::Innovation {
    use super::innovation::Innovation as Returned;
    if single { Returned::single(&innovation) } else { Returned::vector(innovation) }
}
