//! The innovation of a sample.

use numpy::PyArray1;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use thetahat_core::nalgebra::DVector;
use thetahat_core::{Action, Innovation as Kept};

use super::{Reduced, attributes};
use crate::array;

/// What was not predicted of a sample, and what was done with it.
///
/// Attributes
/// ----------
/// error : float or ndarray
///     e = y - prediction; NaN where the measurement is missing. A float for a single number, an array for a vector.
/// variance : float or ndarray
///     The variance of each element, given those after it in the same measurement. NaN where it is not known.
/// nis : float
///     The normalised innovation squared, e' S^-1 e. 0 if nothing was measured, or the variance is not known.
/// action : str
///     "updated"; "capped": updated, and a variance at its bound, where nothing is forgotten; "projected": updated by a
///     shorter step; "missing"; "not ready": the delay lines are not filled; "collecting": there is no estimate yet;
///     "frozen": adaptation is off; "skipped": in the dead zone; "gated": above the gate; "released": above it too, but
///     used, as so many before it were; "bounded": an outlier, which corrects by less than it asks for.
/// log_likelihood : float
///     -1/2 (m ln 2 pi + ln det S + e' S^-1 e) for the m elements measured; 0 if nothing was measured.
///
/// References
/// ----------
/// Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.4.
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct Innovation {
    value: Value,
}

enum Value {
    Number(Kept<f64>),
    Vector(Kept<f64, DVector<f64>>),
}

impl From<Kept<f64>> for Innovation {
    fn from(innovation: Kept<f64>) -> Self {
        Innovation { value: Value::Number(innovation) }
    }
}

impl Innovation {
    pub(crate) fn vector(innovation: Kept<f64, DVector<f64>>) -> Self {
        Innovation { value: Value::Vector(innovation) }
    }

    /// Of a measurement with one element, as a number.
    pub(crate) fn single(innovation: &Kept<f64, DVector<f64>>) -> Self {
        let first = |values: &DVector<f64>| values.as_slice().first().copied().unwrap_or(f64::NAN);
        let (error, variance) = (first(&innovation.error), first(&innovation.variance));
        Kept::new(error, variance, innovation.nis, innovation.action).into()
    }

    /// One element for each output.
    pub(crate) fn elements(&self) -> Kept<f64, DVector<f64>> {
        match &self.value {
            Value::Number(Kept { error, variance, nis, action, .. }) => {
                let [error, variance] = [*error, *variance].map(|value| DVector::from_element(1, value));
                Kept::new(error, variance, *nis, *action)
            }
            Value::Vector(innovation) => innovation.clone(),
        }
    }

    pub(crate) fn restore(kept: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (error, variance, nis, name): (Bound<'_, PyAny>, Bound<'_, PyAny>, f64, String) =
            kept.extract()?;
        let action = action(&name)?;
        if let (Ok(error), Ok(variance)) = (error.extract(), variance.extract()) {
            return Ok(Kept::new(error, variance, nis, action).into());
        }
        let values = |argument, value| -> PyResult<DVector<f64>> {
            let array = array::vector(argument, value, None)?;
            Ok(DVector::from_column_slice(array.as_slice()?))
        };
        let (error, variance) = (values("error", &error)?, values("variance", &variance)?);
        Ok(Innovation::vector(Kept::new(error, variance, nis, action)))
    }
}

#[pymethods]
impl Innovation {
    #[getter]
    fn error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.value {
            Value::Number(innovation) => innovation.error.into_bound_py_any(py),
            Value::Vector(innovation) => Ok(PyArray1::from_slice(py, innovation.error.as_slice()).into_any()),
        }
    }

    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.value {
            Value::Number(innovation) => innovation.variance.into_bound_py_any(py),
            Value::Vector(innovation) => {
                Ok(PyArray1::from_slice(py, innovation.variance.as_slice()).into_any())
            }
        }
    }

    #[getter]
    fn nis(&self) -> f64 {
        match &self.value {
            Value::Number(innovation) => innovation.nis,
            Value::Vector(innovation) => innovation.nis,
        }
    }

    #[getter]
    fn action(&self) -> &'static str {
        match &self.value {
            Value::Number(innovation) => innovation.action.word(),
            Value::Vector(innovation) => innovation.action.word(),
        }
    }

    #[getter]
    fn log_likelihood(&self) -> f64 {
        match &self.value {
            Value::Number(innovation) => innovation.log_likelihood(),
            Value::Vector(innovation) => innovation.log_likelihood(),
        }
    }

    fn __repr__(&self) -> String {
        let (error, variance) = match &self.value {
            Value::Number(innovation) => (text(innovation.error), text(innovation.variance)),
            Value::Vector(innovation) => {
                (list(innovation.error.as_slice()), list(innovation.variance.as_slice()))
            }
        };
        let (nis, action) = (text(self.nis()), self.action());
        format!("Innovation(error={error}, variance={variance}, nis={nis}, action='{action}')")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let (error, variance) = (self.error(py)?, self.variance(py)?);
        let kept = (error, variance, self.nis(), self.action()).into_pyobject(py)?;
        attributes("Innovation", kept)
    }
}

/// All actions, in the order of their codes.
const ACTIONS: [Action; 11] = [
    Action::Updated,
    Action::Capped,
    Action::Projected,
    Action::Missing,
    Action::NotReady,
    Action::Collecting,
    Action::Frozen,
    Action::Skipped,
    Action::Gated,
    Action::Released,
    Action::Bounded,
];

/// The place of an action among them.
pub(crate) fn code(action: Action) -> u8 {
    match action {
        Action::Updated => 0,
        Action::Capped => 1,
        Action::Projected => 2,
        Action::Missing => 3,
        Action::NotReady => 4,
        Action::Collecting => 5,
        Action::Frozen => 6,
        Action::Skipped => 7,
        Action::Gated => 8,
        Action::Released => 9,
        Action::Bounded => 10,
        _ => u8::MAX,
    }
}

fn action(word: &str) -> PyResult<Action> {
    let found = ACTIONS.into_iter().find(|action| action.word() == word);
    found.ok_or_else(|| PyValueError::new_err(format!("action: there is no action {word}")))
}

/// The actions behind these codes, as an array of strings.
pub(crate) fn names<'py>(py: Python<'py>, codes: &Bound<'py, PyArray1<u8>>) -> PyResult<Bound<'py, PyAny>> {
    let all = PyTuple::new(py, ACTIONS.map(Action::word))?;
    py.import("numpy")?.call_method1("array", (all,))?.get_item(codes)
}

/// A number as Python writes it, to six digits.
pub(crate) fn text(value: f64) -> String {
    if value.is_nan() {
        return "nan".to_owned();
    }
    let exponent = value.abs().log10();
    if value != 0.0 && !(-4.0..6.0).contains(&exponent) {
        return format!("{value:.5e}");
    }
    let digits = if value == 0.0 { 1 } else { (5.0 - exponent.floor()).clamp(1.0, 9.0) as usize };
    let written = format!("{value:.digits$}");
    let short = written.trim_end_matches('0');
    if short.ends_with('.') { format!("{short}0") } else { short.to_owned() }
}

/// A few numbers.
pub(crate) fn list(values: &[f64]) -> String {
    let written: Vec<String> = values.iter().take(6).map(|&value| text(value)).collect();
    let rest = if values.len() > 6 { ", ..." } else { "" };
    format!("[{}{rest}]", written.join(", "))
}
