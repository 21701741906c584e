//! Arguments that several classes have, and what the library says of them in Python's names.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::Borrowed;
use pyo3::exceptions::{PyMemoryError, PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyInt};
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, Error};

use crate::{array, error};

/// The most parameters or states: a matrix of that many rows and columns takes 134 MB.
pub(crate) const LARGEST_SIZE: usize = 4096;
/// The most samples that are on their way.
pub(crate) const LONGEST_DELAY: usize = 1_000_000;

/// An int of any size: what does not fit is as large as can be.
#[derive(Clone, Copy)]
pub(crate) struct Whole(pub(crate) i64);

impl<'a, 'py> FromPyObject<'a, 'py> for Whole {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        match value.extract::<i64>() {
            Ok(whole) => Ok(Whole(whole)),
            Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {
                Ok(Whole(if value.lt(0)? { i64::MIN } else { i64::MAX }))
            }
            Err(error) => Err(error),
        }
    }
}

/// A whole number in a range.
pub(crate) fn count(argument: &str, value: Whole, least: usize, most: usize) -> PyResult<usize> {
    match usize::try_from(value.0) {
        Ok(count) if (least..=most).contains(&count) => Ok(count),
        _ => {
            let found = match value.0 {
                i64::MAX => "a larger one".to_owned(),
                i64::MIN => "a smaller one".to_owned(),
                whole => whole.to_string(),
            };
            Err(PyValueError::new_err(format!(
                "{argument}: expected an int from {least} to {most}, found {found}"
            )))
        }
    }
}

/// A number of parameters or states.
pub(crate) fn size(argument: &str, value: Whole) -> PyResult<usize> {
    count(argument, value, 1, LARGEST_SIZE)
}

/// That so many parameters or states can be held.
pub(crate) fn check_size(argument: &str, size: usize) -> PyResult<()> {
    if (1..=LARGEST_SIZE).contains(&size) {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{argument}: expected 1 to {LARGEST_SIZE} entries, found {size}")))
}

/// One number, NaN and what pandas writes for a missing one included.
pub(crate) fn number(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    // Floats of Python, of which those of NumPy in double precision are a kind.
    if let Ok(number) = value.cast::<PyFloat>() {
        return Ok(number.value());
    }
    if value.is_none() {
        return Err(PyTypeError::new_err(format!(
            "{argument}: expected a number, found None; NaN stands for a missing one"
        )));
    }
    if has_no_dimension(value) {
        // Texts of NumPy and what is masked convert to a float, but are no numbers.
        return array::numbers(argument, value)?.extract();
    }
    if is_missing(value) {
        return Ok(f64::NAN);
    }
    if is_number(value) {
        return value.extract();
    }
    Err(PyTypeError::new_err(format!("{argument}: expected a number, found {}", kind(value))))
}

/// Whether it is `pandas.NA`, of which there is one, and of which its class has no other.
fn is_missing(value: &Bound<'_, PyAny>) -> bool {
    let class = value.get_type();
    class.name().is_ok_and(|name| name == "NAType")
        && class.module().is_ok_and(|module| module.to_string().starts_with("pandas."))
}

/// One number for each of `length` signals: a number alone where there is one.
pub(crate) fn sample(
    argument: &str,
    value: &Bound<'_, PyAny>,
    length: usize,
    into: &mut [f64],
) -> PyResult<()> {
    if is_number(value) {
        if length != 1 {
            return Err(PyValueError::new_err(format!(
                "{argument}: expected {length} entries, found a number"
            )));
        }
        into.fill(number(argument, value)?);
        return Ok(());
    }
    if length == 0 {
        if value.is_none() || array::numbers(argument, value)?.is_empty() {
            return Ok(());
        }
        return Err(PyValueError::new_err(format!("{argument}: expected None, as there is no input")));
    }
    if value.is_none() {
        return Err(PyValueError::new_err(format!("{argument}: expected {}, found None", numbers(length))));
    }
    let array = array::vector(argument, value, Some(length))?;
    into.copy_from_slice(array.as_slice()?);
    Ok(())
}

fn numbers(count: usize) -> String {
    if count == 1 { "a number".to_owned() } else { format!("{count} numbers") }
}

/// Whether it is a number: of Python, of NumPy, or of another package, such as a decimal.
pub(crate) fn is_number(value: &Bound<'_, PyAny>) -> bool {
    let has = |name: &str| value.hasattr(name).unwrap_or(false);
    value.is_instance_of::<PyFloat>()
        || value.is_instance_of::<PyInt>()
        || has_no_dimension(value)
        || is_missing(value)
        // What has a length is an array, even one that converts to a number where it has one entry.
        || (has("__float__") && !has("__len__"))
}

/// Whether it is an array of no dimension, or a number of NumPy.
fn has_no_dimension(value: &Bound<'_, PyAny>) -> bool {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => array.ndim() == 0,
        Err(_) => value.getattr("ndim").is_ok_and(|ndim| ndim.eq(0).unwrap_or(false)),
    }
}

/// Samples of signals, one row each.
pub(crate) enum Rows<'py> {
    /// No signal.
    None,
    /// A column for each signal.
    Matrix(PyReadonlyArray2<'py, f64>),
}

impl<'py> Rows<'py> {
    /// `rows` samples of `columns` signals, or at least one; of one signal they may have one dimension.
    pub(crate) fn new(
        argument: &str,
        value: Option<&Bound<'py, PyAny>>,
        rows: Option<usize>,
        columns: usize,
    ) -> PyResult<Self> {
        match value {
            None if columns == 0 => Ok(Rows::None),
            None => Err(PyValueError::new_err(format!(
                "{argument}: expected an array with {columns} columns, found None"
            ))),
            Some(_) if columns == 0 => {
                Err(PyValueError::new_err(format!("{argument}: expected None, as there is no input")))
            }
            Some(value) => Ok(Rows::Matrix(array::matrix(argument, value, [rows, Some(columns)])?)),
        }
    }

    /// All of them, row by row.
    pub(crate) fn as_slice(&self) -> PyResult<&[f64]> {
        match self {
            Rows::None => Ok(&[]),
            Rows::Matrix(array) => Ok(array.as_slice()?),
        }
    }
}

/// Row `row` of an array with this many columns.
pub(crate) fn row(entries: &[f64], row: usize, columns: usize) -> &[f64] {
    entries.get(row * columns..(row + 1) * columns).unwrap_or_default()
}

/// A covariance matrix, n x n; a number is that variance of each of the n, independent of one another.
pub(crate) fn covariance(
    argument: &str,
    value: &Bound<'_, PyAny>,
    size: Option<usize>,
) -> PyResult<Covariance<f64, Dyn>> {
    let matrix = match size {
        Some(size) if is_number(value) => {
            let variance = number(argument, value)?;
            if !variance.is_finite() {
                return Err(PyValueError::new_err(format!("{argument}: {variance} is not finite")));
            }
            DMatrix::from_diagonal_element(size, size, variance)
        }
        _ => array::finite_matrix(argument, value, [size, size])?,
    };
    covariance_of(argument, &matrix).map_err(PyValueError::new_err)
}

/// The same of a matrix that is at hand.
pub(crate) fn covariance_of(argument: &str, matrix: &DMatrix<f64>) -> Result<Covariance<f64, Dyn>, String> {
    if matrix.nrows() != matrix.ncols() {
        return Err(format!(
            "{argument}: expected as many rows as columns, found shape ({}, {})",
            matrix.nrows(),
            matrix.ncols()
        ));
    }
    Covariance::new(matrix).map_err(|error| match error {
        Error::NotPositive { .. } => error.to_string().replacen("covariance", argument, 1),
        _ => format!("{argument}: {error}"),
    })
}

/// An input for a model with this many of them.
pub(crate) fn input(value: Option<&Bound<'_, PyAny>>, length: usize) -> PyResult<DVector<f64>> {
    let mut input = DVector::zeros(length);
    match value {
        Some(value) => sample("input", value, length, input.as_mut_slice())?,
        None if length == 0 => (),
        None => {
            return Err(PyValueError::new_err(format!("input: expected {}, found None", numbers(length))));
        }
    }
    Ok(input)
}

/// An empty vector with memory for this many numbers, or a MemoryError.
pub(crate) fn reserve<T>(counts: &[usize]) -> PyResult<Vec<T>> {
    let total = counts.iter().try_fold(1_usize, |total, &count| total.checked_mul(count));
    let mut reserved = Vec::new();
    match total.map(|total| reserved.try_reserve_exact(total)) {
        Some(Ok(())) => Ok(reserved),
        _ => Err(out_of_memory()),
    }
}

pub(crate) fn out_of_memory() -> PyErr {
    PyMemoryError::new_err("the results do not fit the memory: run fewer rows at a time")
}

/// What the library says of an argument, by its name in Python.
pub(crate) fn failed(py: Python<'_>, error: Error) -> PyErr {
    error::online(py, renamed(error))
}

/// The same of a row of a run.
pub(crate) fn failed_at(py: Python<'_>, row: usize, error: Error) -> PyErr {
    error::online_at(py, row, renamed(error))
}

fn renamed(error: Error) -> Error {
    match error {
        Error::NotFinite { argument } => Error::NotFinite { argument: name(argument) },
        Error::Infinite { argument } => Error::Infinite { argument: name(argument) },
        Error::TooLarge { argument } => Error::TooLarge { argument: name(argument) },
        Error::Negative { argument } => Error::Negative { argument: name(argument) },
        Error::Length { argument, expected, found } => {
            Error::Length { argument: name(argument), expected, found }
        }
        Error::OutOfRange { argument, range } => Error::OutOfRange { argument: name(argument), range },
        _ => error,
    }
}

fn name(argument: &'static str) -> &'static str {
    match argument {
        "regressor" => "phi",
        "inputs" | "future_inputs" => "u",
        "output" | "outputs" => "y",
        "width" => "dead_zone",
        _ => argument,
    }
}

/// The name of the type of an object.
pub(crate) fn kind(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "another object".to_owned(), |name| name.to_string())
}

/// A vector as a NumPy array.
pub(crate) fn from_vector<'py>(py: Python<'py>, vector: &DVector<f64>) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, vector.as_slice())
}

/// Numbers, row by row, as an array of this shape.
pub(crate) fn shaped<const D: usize>(
    py: Python<'_>,
    entries: Vec<f64>,
    shape: [usize; D],
) -> PyResult<Bound<'_, PyAny>>
where
    [usize; D]: numpy::ndarray::IntoDimension,
{
    Ok(PyArray1::from_vec(py, entries).reshape(shape)?.into_any())
}
