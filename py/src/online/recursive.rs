//! What the recursive estimators have in common: their properties, and what a run returns.

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Action, Dimension, Error, Innovation, Outliers, RecursiveLeastSquares, RlsStart};

use super::argument::{Whole, count, reserve, shaped};
use super::results::{Column, Results};
use super::{Reduced, Stop, attributes, innovation};
use crate::array;
use crate::work::Pulse;

/// What a recursive estimator did in a run, row by row.
///
/// Attributes
/// ----------
/// parameters : ndarray, shape (N, n) or (N, n, outputs)
///     The parameters after each row.
/// standard_errors : ndarray, the shape of ``parameters``
///     Their standard errors; NaN until the noise variance is known.
/// errors, variances : ndarray, shape (N,) or (N, outputs)
///     The innovations and their variances, from what was known before each row.
/// nis : ndarray, shape (N,)
///     The normalised innovations squared.
/// actions : ndarray of str, shape (N,)
///     What was done with each row, see `Innovation`. Each access makes a new array.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct RecursiveTrajectory {
    #[pyo3(get)]
    parameters: Py<PyAny>,
    #[pyo3(get)]
    standard_errors: Py<PyAny>,
    #[pyo3(get)]
    errors: Py<PyAny>,
    #[pyo3(get)]
    variances: Py<PyAny>,
    #[pyo3(get)]
    nis: Py<PyArray1<f64>>,
    codes: Py<PyArray1<u8>>,
}

impl RecursiveTrajectory {
    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (parameters, standard_errors, errors, variances, nis, codes) = kept.extract()?;
        Ok(RecursiveTrajectory { parameters, standard_errors, errors, variances, nis, codes })
    }
}

#[pymethods]
impl RecursiveTrajectory {
    #[getter]
    fn actions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        innovation::names(py, self.codes.bind(py))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.nis.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.parameters.bind(py).getattr("shape")?;
        Ok(format!("RecursiveTrajectory({} rows, parameters of shape {shape})", self.__len__(py)))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let kept =
            (&self.parameters, &self.standard_errors, &self.errors, &self.variances, &self.nis, &self.codes);
        attributes("RecursiveTrajectory", kept.into_pyobject(py)?)
    }
}

/// The results of the rows so far.
pub(crate) struct Record<'a> {
    parameters: Column<'a>,
    standard_errors: Column<'a>,
    errors: Column<'a>,
    variances: Column<'a>,
    nis: Column<'a>,
    codes: Vec<u8>,
}

impl Record<'_> {
    pub(crate) fn take(&mut self, innovation: &Innovation<f64>) {
        self.errors.push(&[innovation.error]);
        self.variances.push(&[innovation.variance]);
        self.done(innovation.nis, innovation.action);
    }

    pub(crate) fn take_all(&mut self, innovation: &Innovation<f64, DVector<f64>>) {
        self.errors.push(innovation.error.as_slice());
        self.variances.push(innovation.variance.as_slice());
        self.done(innovation.nis, innovation.action);
    }

    /// What is known of one output after a row.
    pub(crate) fn found(&mut self, parameters: &[f64], standard_errors: &[f64]) {
        self.parameters.push(parameters);
        self.standard_errors.push(standard_errors);
    }

    fn done(&mut self, nis: f64, action: Action) {
        self.nis.push(&[nis]);
        self.codes.push(innovation::code(action));
    }
}

/// The estimator that each class is built around, of N parameters and M outputs.
pub(crate) trait Around<N: Dimension + Dimension<M>, M: Dimension> {
    fn estimator(&self) -> &RecursiveLeastSquares<f64, N, M>;
}

impl<'a> Record<'a> {
    /// Takes samples, row after row, in this engine; returns it.
    pub(crate) fn run<E: Around<N, M>, N: Dimension + Dimension<M>, M: Dimension>(
        &mut self,
        mut engine: E,
        rows: usize,
        mut step: impl FnMut(&mut E, usize, &mut Record<'a>) -> Result<(), Error>,
    ) -> Result<E, Stop> {
        let mut pulse = Pulse::new(engine.estimator().parameters().len().pow(2));
        for row in 0..rows {
            pulse.check()?;
            step(&mut engine, row, self).map_err(|error| (row, error))?;
            let estimator = engine.estimator();
            let (n, outputs) = estimator.parameters().shape();
            let parameters = estimator.parameters().as_slice();
            if let (1, Some(errors)) = (outputs, estimator.standard_errors_of(0)) {
                self.found(parameters, errors.as_slice());
                continue;
            }
            let errors: Vec<_> = (0..outputs).map(|output| estimator.standard_errors_of(output)).collect();
            for i in 0..n {
                for (parameter, errors) in parameters.iter().skip(i).step_by(n).zip(&errors) {
                    let error = errors.as_ref().and_then(|errors| errors.as_slice().get(i));
                    self.parameters.push(&[*parameter]);
                    self.standard_errors.push(&[error.copied().unwrap_or(f64::NAN)]);
                }
            }
        }
        Ok(engine)
    }
}

/// Does the work of a run without the interpreter lock, and gives back what that returns beside the results.
pub(crate) fn run<E: Send>(
    py: Python<'_>,
    [rows, n, outputs]: [usize; 3],
    work: impl FnOnce(&mut Record<'_>) -> Result<E, Stop> + Send,
) -> PyResult<(E, RecursiveTrajectory)> {
    let (by_parameter, by_output) = match outputs {
        1 => (vec![rows, n], vec![rows]),
        _ => (vec![rows, n, outputs], vec![rows, outputs]),
    };
    let shapes = [by_parameter.clone(), by_parameter, by_output.clone(), by_output, vec![rows]];
    let (results, codes) = (Results::new(py, shapes)?, reserve(&[rows])?);
    let taken = results.write(|[parameters, standard_errors, errors, variances, nis]| {
        let mut record = Record { parameters, standard_errors, errors, variances, nis, codes };
        py.detach(|| work(&mut record)).map(|engine| (engine, record.codes))
    })?;
    let (engine, codes) = taken.map_err(|stop| stop.into_error(py))?;
    let [parameters, standard_errors, errors, variances, nis] = results.arrays()?.map(Bound::unbind);
    let nis = nis.into_bound(py).cast_into()?.unbind();
    let codes = PyArray1::from_vec(py, codes).unbind();
    Ok((engine, RecursiveTrajectory { parameters, standard_errors, errors, variances, nis, codes }))
}

fn shape<M: Dimension>(estimator: &RecursiveLeastSquares<f64, Dyn, M>) -> (usize, usize)
where
    Dyn: Dimension<M>,
{
    estimator.parameters().shape()
}

/// θ̂: a vector with one output, else a matrix.
pub(crate) fn parameters<'py, M: Dimension>(
    py: Python<'py>,
    estimator: &RecursiveLeastSquares<f64, Dyn, M>,
) -> PyResult<Bound<'py, PyAny>>
where
    Dyn: Dimension<M>,
{
    let (n, outputs) = shape(estimator);
    let parameters = estimator.parameters().as_slice();
    if outputs == 1 {
        return Ok(PyArray1::from_slice(py, parameters).into_any());
    }
    Ok(array::from_matrix(py, &DMatrix::from_column_slice(n, outputs, parameters))?.into_any())
}

/// P.
pub(crate) fn covariance<'py, M: Dimension>(
    py: Python<'py>,
    estimator: &RecursiveLeastSquares<f64, Dyn, M>,
) -> PyResult<Bound<'py, PyArray2<f64>>>
where
    Dyn: Dimension<M>,
{
    array::from_matrix(py, &estimator.covariance().matrix())
}

/// The covariance of the parameters, one matrix for each output.
pub(crate) fn parameter_covariance<'py, M: Dimension>(
    py: Python<'py>,
    estimator: &RecursiveLeastSquares<f64, Dyn, M>,
) -> PyResult<Option<Bound<'py, PyAny>>>
where
    Dyn: Dimension<M>,
{
    let (n, outputs) = shape(estimator);
    let mut entries = reserve(&[outputs, n, n])?;
    for output in 0..outputs {
        let Some(covariance) = estimator.parameter_covariance_of(output) else { return Ok(None) };
        entries.extend_from_slice(covariance.matrix().as_slice());
    }
    let array = if outputs == 1 { shaped(py, entries, [n, n]) } else { shaped(py, entries, [outputs, n, n]) };
    array.map(Some)
}

/// The square roots of its diagonal.
pub(crate) fn standard_errors<'py, M: Dimension>(
    py: Python<'py>,
    estimator: &RecursiveLeastSquares<f64, Dyn, M>,
) -> PyResult<Option<Bound<'py, PyAny>>>
where
    Dyn: Dimension<M>,
{
    let (n, outputs) = shape(estimator);
    let mut entries = vec![0.0; n * outputs];
    for output in 0..outputs {
        let Some(errors) = estimator.standard_errors_of(output) else { return Ok(None) };
        for (entry, &error) in entries.iter_mut().skip(output).step_by(outputs).zip(errors.iter()) {
            *entry = error;
        }
    }
    let array = if outputs == 1 { shaped(py, entries, [n]) } else { shaped(py, entries, [n, outputs]) };
    array.map(Some)
}

/// The start of this name.
pub(crate) fn start(name: &str, blend: Option<Whole>, warm: bool) -> PyResult<RlsStart> {
    let blend = blend.map(|blend| count("blend", blend, 0, usize::from(u16::MAX))).transpose()?;
    let blend = blend.map(|blend| u16::try_from(blend).unwrap_or(u16::MAX));
    let start = match (name, blend) {
        ("standard", None) => RlsStart::Standard,
        ("exact", None) => RlsStart::Exact,
        ("mixed", Some(blend)) => RlsStart::Mixed { blend },
        ("mixed", None) => {
            return Err(PyValueError::new_err("blend: expected an int with start 'mixed', found None"));
        }
        ("standard" | "exact", Some(_)) => {
            return Err(PyValueError::new_err("blend: expected None, as the start is not 'mixed'"));
        }
        _ => {
            return Err(PyValueError::new_err(format!(
                "start: expected 'standard', 'exact' or 'mixed', found '{name}'"
            )));
        }
    };
    if warm && start != RlsStart::Standard {
        let message = "start: expected 'standard', as parameters or a covariance are given";
        return Err(PyValueError::new_err(message));
    }
    Ok(start)
}

/// The rule for outliers: Huber's, a gate, or none.
pub(crate) fn outliers(huber: f64, gate: f64, release: Whole) -> PyResult<Outliers<f64>> {
    let wrong = |message: &str| Err(PyValueError::new_err(message.to_owned()));
    for (name, value) in [("huber", huber), ("gate", gate)] {
        if value.is_nan() || value < 1.0 {
            return wrong(&format!("{name}: expected a number of 1 or more, or inf, found {value}"));
        }
    }
    let release = count("release", release, 0, usize::from(u16::MAX))?;
    let release = u16::try_from(release).unwrap_or(u16::MAX);
    match (huber.is_finite(), gate.is_finite()) {
        (true, true) => wrong("huber: expected inf, as a gate is given"),
        (_, false) if release > 0 => wrong("release: expected 0, as there is no gate"),
        (true, false) => Ok(Outliers::Huber { threshold: huber }),
        (false, true) => Ok(Outliers::Gate { nis: gate, release }),
        (false, false) => Ok(Outliers::Used),
    }
}

/// The numbers of an iterator as an array.
pub(crate) fn coefficients(py: Python<'_>, values: impl Iterator<Item = f64>) -> Bound<'_, PyArray1<f64>> {
    PyArray1::from_iter(py, values)
}
