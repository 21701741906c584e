//! Linear models of a state and of what is measured of it.

use numpy::PyArray2;
use pyo3::prelude::*;
use thetahat_core::nalgebra::{Const, DMatrix, Dyn};
use thetahat_core::{LinearObservation as Observed, LinearTransition as Moved};

use super::argument::{self, failed};
use super::{Reduced, snapshot};
use crate::array;

/// A linear model of how a state moves on.
///
/// Parameters
/// ----------
/// state_matrix : array_like, shape (n, n)
///     F.
/// noise : float, or array_like of shape (n, n)
///     Q, the covariance of what the noise adds to the next state; a number is the variance of each.
/// input_matrix : array_like, shape (n, inputs), optional
///     G. Without it there is no input.
///
/// Raises
/// ------
/// ValueError
///     If a shape is wrong, an entry not finite, or the noise no covariance.
///
/// Notes
/// -----
/// ::
///
///     x(k+1) = F x(k) + G u(k) + w(k),     w ~ (0, Q), white
///
/// Examples
/// --------
/// >>> from thetahat import LinearTransition
/// >>> LinearTransition([[1.0, 0.1], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.1]], [[0.005], [0.1]])
/// LinearTransition(states=2, inputs=1)
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct LinearTransition {
    pub(crate) model: Moved<f64, Dyn, Dyn>,
}

#[pymethods]
impl LinearTransition {
    #[new]
    #[pyo3(signature = (state_matrix, noise, input_matrix = None))]
    fn new(
        py: Python<'_>,
        state_matrix: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        input_matrix: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let matrix = array::finite_matrix("state_matrix", state_matrix, [None, None])?;
        let n = matrix.nrows();
        argument::check_size("state_matrix: rows", n)?;
        let noise = argument::covariance("noise", noise, Some(n))?;
        let input_matrix = inputs(input_matrix, n)?;
        let model = Moved::<f64, Dyn, Const<0>>::new(matrix, noise)
            .and_then(|model| model.with_input(input_matrix))
            .map_err(|error| failed(py, error))?;
        Ok(LinearTransition { model })
    }

    /// F, shape (n, n).
    #[getter]
    fn state_matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, self.model.state_matrix())
    }

    /// G, shape (n, inputs); None without input.
    #[getter]
    fn input_matrix<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        some(py, self.model.input_matrix())
    }

    /// Q, shape (n, n).
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, &self.model.noise().matrix())
    }

    fn __repr__(&self) -> String {
        let (n, inputs) = self.model.input_matrix().shape();
        format!("LinearTransition(states={n}, inputs={inputs})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "LinearTransition", &self.model)
    }
}

/// A linear model of what is measured of a state.
///
/// Parameters
/// ----------
/// output_matrix : array_like, shape (m, n)
///     H.
/// noise : float, or array_like of shape (m, m)
///     R, the covariance of what the noise adds to the measurement; a number is the variance of each element.
/// input_matrix : array_like, shape (m, inputs), optional
///     D. Without it there is no input.
///
/// Raises
/// ------
/// ValueError
///     If a shape is wrong, an entry not finite, or the noise no covariance.
///
/// Notes
/// -----
/// ::
///
///     y(k) = H x(k) + D u(k) + v(k),     v ~ (0, R), white
///
/// Examples
/// --------
/// >>> from thetahat import LinearObservation
/// >>> LinearObservation([[1.0, 0.0]], [[0.01]])
/// LinearObservation(outputs=1, states=2, inputs=0)
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct LinearObservation {
    pub(crate) model: Observed<f64, Dyn, Dyn, Dyn>,
}

#[pymethods]
impl LinearObservation {
    #[new]
    #[pyo3(signature = (output_matrix, noise, input_matrix = None))]
    fn new(
        py: Python<'_>,
        output_matrix: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        input_matrix: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let matrix = array::finite_matrix("output_matrix", output_matrix, [None, None])?;
        let m = matrix.nrows();
        argument::check_size("output_matrix: rows", m)?;
        let noise = argument::covariance("noise", noise, Some(m))?;
        let input_matrix = inputs(input_matrix, m)?;
        let model = Observed::<f64, Dyn, Dyn, Const<0>>::new(matrix, noise)
            .and_then(|model| model.with_input(input_matrix))
            .map_err(|error| failed(py, error))?;
        Ok(LinearObservation { model })
    }

    /// H, shape (m, n).
    #[getter]
    fn output_matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, &self.model.output_matrix())
    }

    /// D, shape (m, inputs); None without input.
    #[getter]
    fn input_matrix<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        some(py, self.model.input_matrix())
    }

    /// R, shape (m, m).
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, &self.model.noise().matrix())
    }

    fn __repr__(&self) -> String {
        let (m, n) = self.model.output_matrix().shape();
        format!("LinearObservation(outputs={m}, states={n}, inputs={})", self.model.input_matrix().ncols())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "LinearObservation", &self.model)
    }
}

fn inputs(value: Option<&Bound<'_, PyAny>>, rows: usize) -> PyResult<DMatrix<f64>> {
    match value {
        Some(value) => array::finite_matrix("input_matrix", value, [Some(rows), None]),
        None => Ok(DMatrix::zeros(rows, 0)),
    }
}

fn some<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    if matrix.ncols() == 0 { Ok(None) } else { array::from_matrix(py, matrix).map(Some) }
}
