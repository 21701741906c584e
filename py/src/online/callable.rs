//! Models written as Python functions.

use std::cell::RefCell;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::{PyTraverseError, PyVisit};
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, Observation, Transition};

use super::argument::{self, covariance_of, kind};
use crate::array;
use crate::work::calling;

/// What both classes hold.
pub(crate) struct Functions {
    function: Py<PyAny>,
    noise: Py<PyAny>,
    /// The noise as it is where it is no function, and its size.
    fixed: Option<Covariance<f64, Dyn>>,
    jacobian: Option<Py<PyAny>>,
}

impl Functions {
    fn new(
        function: Bound<'_, PyAny>,
        noise: Bound<'_, PyAny>,
        jacobian: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let expected = |argument: &str, found: &Bound<'_, PyAny>| {
            PyTypeError::new_err(format!("{argument}: expected a function of x and u, found {}", kind(found)))
        };
        if !function.is_callable() {
            return Err(expected("function", &function));
        }
        if let Some(jacobian) = &jacobian
            && !jacobian.is_callable()
        {
            return Err(expected("jacobian", jacobian));
        }
        let (noise, fixed) = if noise.is_callable() {
            (noise, None)
        } else {
            let matrix = array::finite_matrix("noise", &noise, [None, None])?;
            let fixed = covariance_of("noise", &matrix).map_err(PyValueError::new_err)?;
            (array::from_matrix(noise.py(), &matrix)?.into_any(), Some(fixed))
        };
        Ok(Functions {
            function: function.unbind(),
            noise: noise.unbind(),
            fixed,
            jacobian: jacobian.map(Bound::unbind),
        })
    }

    /// Whether the noise is a matrix.
    pub(crate) fn has_fixed_noise(&self) -> bool {
        self.fixed.is_some()
    }

    fn repr(&self, py: Python<'_>, class_name: &str) -> String {
        let function = self.function.bind(py);
        let name = function.getattr("__name__").and_then(|name| name.extract::<String>());
        let name = name.unwrap_or_else(|_| kind(function));
        let jacobian = if self.jacobian.is_some() { "given" } else { "numerical" };
        format!("{class_name}({name}, jacobian={jacobian})")
    }

    /// What the cyclic garbage collector asks. There is nothing to clear: nothing of it can change, so that every cycle
    /// goes through another object, made or changed after this one, that can be cleared.
    fn traverse(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.function)?;
        visit.call(&self.noise)?;
        visit.call(&self.jacobian)
    }

    fn reduce<'py>(&self, py: Python<'py>, class: Bound<'py, PyAny>) -> PyResult<Made<'py>> {
        Ok((
            class,
            (
                self.function.clone_ref(py),
                self.noise.clone_ref(py),
                self.jacobian.as_ref().map(|jacobian| jacobian.clone_ref(py)),
            ),
        ))
    }
}

type Made<'py> = (Bound<'py, PyAny>, (Py<PyAny>, Py<PyAny>, Option<Py<PyAny>>));

/// A model of how a state moves on, written as a function.
///
/// Parameters
/// ----------
/// function : callable
///     f(x, u), which returns the next state, shape (n,). It always has both arguments, as arrays; without input u
///     is empty.
/// noise : array_like, shape (n, n), or callable
///     Q, or a function of x and u that returns it.
/// jacobian : callable, optional
///     A function of x and u that returns df/dx, shape (n, n). Without it the Jacobian is numerical.
///
/// Notes
/// -----
/// ::
///
///     x(k+1) = f(x(k), u(k)) + w(k),     w ~ (0, Q), white
///
/// A numerical Jacobian takes central differences, (f(x + h) - f(x - h)) / (2 h), with a step for each state of
/// h_j = eps^(1/3) max(\|x_j\|, sigma_j), where sigma_j is the standard deviation of the state in the filter, and 1 in
/// place of 0. An exception that a function raises comes out unchanged; a wrong shape, and NaN or infinity, is a
/// ValueError. The filter is then as it was.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import NonlinearTransition
/// >>> def pendulum(x, u):
/// ...     return np.array([x[0] + 0.02 * x[1], x[1] - 0.2 * np.sin(x[0])])
/// >>> NonlinearTransition(pendulum, 1e-6 * np.eye(2))
/// NonlinearTransition(pendulum, jacobian=numerical)
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct NonlinearTransition {
    pub(crate) functions: Functions,
}

/// A model of what is measured of a state, written as a function.
///
/// Parameters
/// ----------
/// function : callable
///     h(x, u), which returns the measurement without noise, shape (m,). It always has both arguments, as arrays;
///     without input u is empty.
/// noise : array_like, shape (m, m), or callable
///     R, or a function of x and u that returns it.
/// jacobian : callable, optional
///     A function of x and u that returns dh/dx, shape (m, n). Without it the Jacobian is numerical, as described
///     at `NonlinearTransition`.
///
/// Notes
/// -----
/// ::
///
///     y(k) = h(x(k), u(k)) + v(k),     v ~ (0, R), white
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import NonlinearObservation
/// >>> NonlinearObservation(lambda x, u: np.sin(x[:1]), [[1e-4]]).has_numerical_jacobian
/// True
#[pyclass(module = "thetahat", frozen)]
pub(crate) struct NonlinearObservation {
    pub(crate) functions: Functions,
}

#[pymethods]
impl NonlinearTransition {
    #[new]
    #[pyo3(signature = (function, noise, jacobian = None))]
    fn new(
        function: Bound<'_, PyAny>,
        noise: Bound<'_, PyAny>,
        jacobian: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        Ok(NonlinearTransition { functions: Functions::new(function, noise, jacobian)? })
    }

    /// Whether the Jacobian comes from differences.
    #[getter]
    fn has_numerical_jacobian(&self) -> bool {
        self.functions.jacobian.is_none()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        self.functions.repr(py, "NonlinearTransition")
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.functions.traverse(&visit)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Made<'py>> {
        self.functions.reduce(py, py.get_type::<NonlinearTransition>().into_any())
    }
}

#[pymethods]
impl NonlinearObservation {
    #[new]
    #[pyo3(signature = (function, noise, jacobian = None))]
    fn new(
        function: Bound<'_, PyAny>,
        noise: Bound<'_, PyAny>,
        jacobian: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        Ok(NonlinearObservation { functions: Functions::new(function, noise, jacobian)? })
    }

    /// Whether the Jacobian comes from differences.
    #[getter]
    fn has_numerical_jacobian(&self) -> bool {
        self.functions.jacobian.is_none()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        self.functions.repr(py, "NonlinearObservation")
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.functions.traverse(&visit)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Made<'py>> {
        self.functions.reduce(py, py.get_type::<NonlinearObservation>().into_any())
    }
}

/// What went wrong in a function.
pub(crate) enum Trouble {
    /// It raised this.
    Raised(PyErr),
    /// It returned what it must not.
    Said(String),
}

impl Trouble {
    /// As an exception, of a row that is given from 0; what a function raises stays as it is.
    pub(crate) fn into_error(self, row: Option<usize>) -> PyErr {
        match (self, row) {
            (Trouble::Raised(error), _) => error,
            (Trouble::Said(message), Some(row)) => {
                PyValueError::new_err(format!("row {}: {message}", row + 1))
            }
            (Trouble::Said(message), None) => PyValueError::new_err(message),
        }
    }
}

/// A model with functions, while it is used.
pub(crate) struct Called<'a, 'py> {
    py: Python<'py>,
    functions: &'a Functions,
    names: [&'static str; 3],
    /// The number of states or outputs, where the user of the model knows it.
    size: usize,
    /// The standard deviations of the states: what the step of a difference is made of.
    deviations: RefCell<DVector<f64>>,
    trouble: RefCell<Option<Trouble>>,
}

impl<'a, 'py> Called<'a, 'py> {
    pub(crate) fn new(
        py: Python<'py>,
        functions: &'a Functions,
        names: [&'static str; 3],
        size: Option<usize>,
        states: usize,
    ) -> PyResult<Self> {
        let found = functions.fixed.as_ref().map(|noise| noise.factor().nrows());
        let size = match (size, found) {
            (Some(size), Some(found)) if size != found => {
                return Err(PyValueError::new_err(format!(
                    "{}: expected shape ({size}, {size}), found ({found}, {found})",
                    names[2]
                )));
            }
            (Some(size), _) | (None, Some(size)) => size,
            (None, None) => 0,
        };
        let (deviations, trouble) = (RefCell::new(DVector::zeros(states)), RefCell::new(None));
        Ok(Called { py, functions, names, size, deviations, trouble })
    }

    fn call(
        &self,
        function: &Py<PyAny>,
        x: &DVector<f64>,
        u: &DVector<f64>,
    ) -> Result<Bound<'py, PyAny>, Trouble> {
        let arguments = (argument::from_vector(self.py, x), argument::from_vector(self.py, u));
        calling(self.py, || function.bind(self.py).call1(arguments)).map_err(Trouble::Raised)
    }

    /// The library's NaN for no answer, and the reason for later.
    fn or_nan<A>(&self, answer: Result<A, Trouble>, nan: impl FnOnce() -> A) -> A {
        answer.unwrap_or_else(|found| {
            self.trouble.borrow_mut().get_or_insert(found);
            nan()
        })
    }

    /// The number of states or outputs.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Whether it takes differences.
    pub(crate) fn wants_deviations(&self) -> bool {
        self.functions.jacobian.is_none()
    }

    pub(crate) fn take_deviations(&self, covariance: &Covariance<f64, Dyn>) {
        self.deviations.replace(covariance.variances().map(f64::sqrt));
    }

    pub(crate) fn take_trouble(&self) -> Option<Trouble> {
        self.trouble.take()
    }

    pub(crate) fn is_well(&self) -> bool {
        self.trouble.borrow().is_none()
    }

    fn value(&self, x: &DVector<f64>, u: &DVector<f64>) -> Result<DVector<f64>, Trouble> {
        let value = self.call(&self.functions.function, x, u)?;
        let read = array::finite_vector(self.names[0], &value, Some(self.size));
        read.map_err(|error| said(self.py, &error))
    }

    fn guarded_value(&self, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
        let nan = || DVector::from_element(self.size, f64::NAN);
        if self.is_well() { self.or_nan(self.value(x, u), nan) } else { nan() }
    }

    pub(crate) fn derivative(&self, x: &DVector<f64>, u: &DVector<f64>) -> DMatrix<f64> {
        let nan = || DMatrix::from_element(self.size, x.len(), f64::NAN);
        if !self.is_well() {
            return nan();
        }
        let Some(jacobian) = &self.functions.jacobian else {
            return self.or_nan(self.differences(x, u), nan);
        };
        let read = self.call(jacobian, x, u).and_then(|value| {
            let shape = [Some(self.size), Some(x.len())];
            array::finite_matrix(self.names[1], &value, shape).map_err(|error| said(self.py, &error))
        });
        self.or_nan(read, nan)
    }

    /// Central differences, with the steps ε^(1/3) max(|x_j|, σ_j), and 1 in place of 0.
    fn differences(&self, x: &DVector<f64>, u: &DVector<f64>) -> Result<DMatrix<f64>, Trouble> {
        let mut jacobian = DMatrix::zeros(self.size, x.len());
        let deviations = self.deviations.borrow().clone();
        for ((index, &middle), &deviation) in x.iter().enumerate().zip(deviations.iter()) {
            let scale = middle.abs().max(deviation);
            let step = f64::EPSILON.cbrt() * if scale > 0.0 { scale } else { 1.0 };
            let (mut above, mut below) = (x.clone(), x.clone());
            above.as_mut_slice()[index] = middle + step;
            below.as_mut_slice()[index] = middle - step;
            // As the sums round, this is the step that was taken.
            let width = above.as_slice()[index] - below.as_slice()[index];
            let (above, below) = (self.value(&above, u)?, self.value(&below, u)?);
            for (row, (above, below)) in above.iter().zip(below.iter()).enumerate() {
                if let Some(entry) = jacobian.get_mut((row, index)) {
                    *entry = (above - below) / width;
                }
            }
        }
        Ok(jacobian)
    }

    pub(crate) fn covariance(&self, x: &DVector<f64>, u: &DVector<f64>) -> Covariance<f64, Dyn> {
        let zero = || Covariance::zero(Dyn(self.size));
        if let Some(fixed) = &self.functions.fixed {
            return fixed.clone();
        }
        if !self.is_well() {
            return zero();
        }
        let read = self.call(&self.functions.noise, x, u).and_then(|value| {
            let shape = [Some(self.size), Some(self.size)];
            let matrix = array::finite_matrix(self.names[2], &value, shape);
            let matrix = matrix.map_err(|error| said(self.py, &error))?;
            covariance_of(self.names[2], &matrix).map_err(Trouble::Said)
        });
        self.or_nan(read, zero)
    }
}

fn said(py: Python<'_>, error: &PyErr) -> Trouble {
    Trouble::Said(error.value(py).to_string())
}

impl Transition<f64, Dyn, Dyn> for Called<'_, '_> {
    fn next(&self, state: &DVector<f64>, input: &DVector<f64>) -> DVector<f64> {
        self.guarded_value(state, input)
    }

    fn next_jacobian(&self, state: &DVector<f64>, input: &DVector<f64>) -> DMatrix<f64> {
        self.derivative(state, input)
    }

    fn process_noise(&self, state: &DVector<f64>, input: &DVector<f64>) -> Covariance<f64, Dyn> {
        self.covariance(state, input)
    }
}

impl Observation<f64, Dyn, Dyn, Dyn> for Called<'_, '_> {
    fn output(&self, state: &DVector<f64>, input: &DVector<f64>) -> DVector<f64> {
        self.guarded_value(state, input)
    }

    fn output_jacobian(&self, state: &DVector<f64>, input: &DVector<f64>) -> DMatrix<f64> {
        self.derivative(state, input)
    }

    fn measurement_noise(&self, state: &DVector<f64>, input: &DVector<f64>) -> Covariance<f64, Dyn> {
        self.covariance(state, input)
    }
}
