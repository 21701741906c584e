//! NumPy arrays in and out. Contiguous arrays of float64 are read where they are, others are converted once; shapes are
//! checked and never guessed.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use thetahat_core::nalgebra::{DMatrix, DVector};

/// An array of one dimension with `length` entries, or at least one where no length is asked for.
pub(crate) fn vector<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    length: Option<usize>,
) -> PyResult<PyReadonlyArray1<'py, f64>> {
    let array = match value.cast::<PyArray1<f64>>() {
        Ok(array) if array.is_c_contiguous() && is_plain(value) => array.clone(),
        _ => converted(argument, value, "one dimension", 1)?.cast_into()?,
    };
    match length {
        Some(length) if array.len() != length => {
            Err(wrong_shape(argument, &format!("{length} {}", plural(length)), array.shape()))
        }
        None if array.len() == 0 => Err(empty(argument)),
        _ => Ok(array.try_readonly()?),
    }
}

/// An array of two dimensions, row by row: `None` stands for any number of rows or columns but none.
pub(crate) fn matrix<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    shape: [Option<usize>; 2],
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let array = match value.cast::<PyArray2<f64>>() {
        Ok(array) if array.is_c_contiguous() && is_plain(value) => array.clone(),
        _ => converted(argument, value, "two dimensions", 2)?.cast_into()?,
    };
    let found = array.shape();
    let wrong = |axis: usize| shape[axis].is_some_and(|length| length != found[axis]);
    if wrong(0) || wrong(1) {
        let side =
            |length: Option<usize>| length.map_or_else(|| "any".to_owned(), |length| length.to_string());
        return Err(wrong_shape(argument, &format!("shape ({}, {})", side(shape[0]), side(shape[1])), found));
    }
    if (shape[0].is_none() && found[0] == 0) || (shape[1].is_none() && found[1] == 0) {
        return Err(empty(argument));
    }
    Ok(array.try_readonly()?)
}

/// A vector of numbers none of which is NaN or infinite, copied.
pub(crate) fn finite_vector(
    argument: &str,
    value: &Bound<'_, PyAny>,
    length: Option<usize>,
) -> PyResult<DVector<f64>> {
    let array = vector(argument, value, length)?;
    let entries = array.as_slice()?;
    check_finite(argument, entries)?;
    Ok(DVector::from_column_slice(entries))
}

/// A matrix of numbers none of which is NaN or infinite, copied.
pub(crate) fn finite_matrix(
    argument: &str,
    value: &Bound<'_, PyAny>,
    shape: [Option<usize>; 2],
) -> PyResult<DMatrix<f64>> {
    let array = matrix(argument, value, shape)?;
    let entries = array.as_slice()?;
    check_finite(argument, entries)?;
    let [rows, columns] = [array.shape()[0], array.shape()[1]];
    Ok(DMatrix::from_row_slice(rows, columns, entries))
}

/// NaN can mean a missing sample, but no parameter is missing.
fn check_finite(argument: &str, entries: &[f64]) -> PyResult<()> {
    match entries.iter().position(|entry| !entry.is_finite()) {
        Some(position) => Err(PyValueError::new_err(format!(
            "{argument}: entry {position} is {}; give a finite number",
            entries[position]
        ))),
        None => Ok(()),
    }
}

/// A matrix as a NumPy array.
pub(crate) fn from_matrix<'py>(
    py: Python<'py>,
    matrix: &DMatrix<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    // NumPy's order is row by row.
    let rows = PyArray1::from_slice(py, matrix.transpose().as_slice());
    rows.reshape([matrix.nrows(), matrix.ncols()])
}

/// Whether it is an array of NumPy itself, and of no kind that is derived from it, such as a masked one.
fn is_plain(value: &Bound<'_, PyAny>) -> bool {
    value.get_type().is(value.py().get_type::<PyUntypedArray>())
}

/// Anything that holds real numbers as a contiguous array of float64.
fn converted<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    expected: &str,
    dimensions: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let not_numbers =
        |what: &str| PyTypeError::new_err(format!("{argument}: expected an array of numbers, found {what}"));
    // Rows of different lengths, and whatever else NumPy cannot make an array of.
    let refused = |error: PyErr| PyValueError::new_err(format!("{argument}: {}", error.value(py)));
    let masked = !is_plain(value) && value.hasattr("mask")?;
    // What is masked is missing.
    let filled = if masked {
        let floats = value.call_method1("astype", ("float64",)).map_err(refused)?;
        floats.call_method1("filled", (f64::NAN,)).map_err(refused)?
    } else {
        value.clone()
    };
    let array = numpy.call_method1("asarray", (filled,)).map_err(refused)?;
    let kind = array.getattr("dtype")?.getattr("kind")?;
    let kind: String = kind.extract()?;
    if !["b", "i", "u", "f"].contains(&kind.as_str()) {
        return Err(not_numbers(&format!("dtype {}", array.getattr("dtype")?.str()?)));
    }
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape.len() != dimensions {
        return Err(wrong_shape(argument, expected, &shape));
    }
    let options = PyDict::new(py);
    options.set_item("dtype", "float64")?;
    numpy.call_method("ascontiguousarray", (array,), Some(&options))
}

fn wrong_shape(argument: &str, expected: &str, found: &[usize]) -> PyErr {
    let sides: Vec<String> = found.iter().map(usize::to_string).collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    PyValueError::new_err(format!(
        "{argument}: expected {expected}, found shape ({}{comma})",
        sides.join(", ")
    ))
}

fn empty(argument: &str) -> PyErr {
    PyValueError::new_err(format!("{argument}: expected at least one entry, found none"))
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "entry" } else { "entries" }
}
