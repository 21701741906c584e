//! NumPy arrays in and out. Contiguous arrays of float64 are read where they are. Whatever else holds numbers is
//! converted once, by the package's one conversion; shapes are checked and never guessed.

use numpy::{
    PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use thetahat_core::nalgebra::{DMatrix, DVector};

use crate::work::calling;

/// The numbers of an argument as a contiguous array of float64, whatever its shape.
pub(crate) fn numbers<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    static CONVERSION: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    match value.cast::<PyArrayDyn<f64>>() {
        // What comes out of a pickle, or lies in a file, may begin anywhere.
        Ok(array) if array.is_c_contiguous() && array.data().is_aligned() && is_plain(value) => {
            Ok(array.clone())
        }
        _ => {
            let conversion = CONVERSION.import(value.py(), "thetahat.base.numbers", "array")?;
            Ok(calling(value.py(), || conversion.call1((argument, value)))?.cast_into()?)
        }
    }
}

/// The entries of one channel: an array of one dimension, or of one column, with `length` entries, or at least one
/// where no length is asked for.
pub(crate) fn vector<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    length: Option<usize>,
) -> PyResult<PyReadonlyArray1<'py, f64>> {
    let array = numbers(argument, value)?;
    let found = match *array.shape() {
        [entries] | [entries, 1] => entries,
        ref shape => return Err(wrong_shape(argument, "one dimension", shape)),
    };
    match length {
        Some(length) if found != length => {
            Err(wrong_shape(argument, &format!("{length} {}", plural(length)), array.shape()))
        }
        None if found == 0 => Err(empty(argument)),
        _ => Ok(array.reshape([found])?.try_readonly()?),
    }
}

/// An array of two dimensions, row by row: `None` stands for any number of rows or columns but none. One column may be
/// an array of one dimension.
pub(crate) fn matrix<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    shape: [Option<usize>; 2],
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let array = numbers(argument, value)?;
    let found = match *array.shape() {
        [rows, columns] => [rows, columns],
        [rows] if shape[1] == Some(1) => [rows, 1],
        ref shape => return Err(wrong_shape(argument, "two dimensions", shape)),
    };
    let wrong = |axis: usize| shape[axis].is_some_and(|length| length != found[axis]);
    if wrong(0) || wrong(1) {
        let side =
            |length: Option<usize>| length.map_or_else(|| "any".to_owned(), |length| length.to_string());
        let expected = match (array.shape(), shape[0]) {
            ([_], Some(length)) => format!("{length} {}", plural(length)),
            _ => format!("shape ({}, {})", side(shape[0]), side(shape[1])),
        };
        return Err(wrong_shape(argument, &expected, array.shape()));
    }
    if (shape[0].is_none() && found[0] == 0) || (shape[1].is_none() && found[1] == 0) {
        return Err(empty(argument));
    }
    Ok(array.reshape(found)?.try_readonly()?)
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

/// The word after a number of entries.
pub(crate) fn plural(count: usize) -> &'static str {
    if count == 1 { "entry" } else { "entries" }
}
