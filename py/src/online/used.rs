//! Models that are linear or written as functions, while a filter uses them.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, LinearObservation as LinearObserved, LinearTransition as LinearMoved};
use thetahat_core::{Observation, Transition};

use super::argument::kind;
use super::callable::{Called, NonlinearObservation, NonlinearTransition, Trouble};
use super::model::{LinearObservation, LinearTransition};

/// A transition or an observation, while it is used: linear, or written as functions.
pub(crate) enum Used<'a, 'py, Linear> {
    Linear(&'a Linear),
    Called(Called<'a, 'py>),
}

impl<Linear> Used<'_, '_, Linear> {
    /// Tells of the standard deviations that the states have now.
    pub(crate) fn linearise_within(&self, covariance: &Covariance<f64, Dyn>) {
        if let Used::Called(called) = self
            && called.wants_deviations()
        {
            called.take_deviations(covariance);
        }
    }

    /// Whether something went wrong in a function since the last time.
    pub(crate) fn is_troubled(&self) -> bool {
        matches!(self, Used::Called(called) if !called.is_well())
    }

    /// What went wrong in a function since the last time.
    pub(crate) fn trouble(&self) -> Option<Trouble> {
        match self {
            Used::Linear(_) => None,
            Used::Called(called) => called.take_trouble(),
        }
    }
}

pub(crate) type UsedTransition<'a, 'py> = Used<'a, 'py, LinearMoved<f64, Dyn, Dyn>>;
pub(crate) type UsedObservation<'a, 'py> = Used<'a, 'py, LinearObserved<f64, Dyn, Dyn, Dyn>>;

impl<'a, 'py> UsedTransition<'a, 'py> {
    /// The argument `transition`, for so many states.
    pub(crate) fn new(value: &'a Bound<'py, PyAny>, states: usize) -> PyResult<Self> {
        if let Ok(linear) = value.cast::<LinearTransition>() {
            let model = &linear.get().model;
            check_states("transition", states, model.state_matrix().ncols())?;
            return Ok(Used::Linear(model));
        }
        let Ok(nonlinear) = value.cast::<NonlinearTransition>() else {
            return Err(PyTypeError::new_err(format!(
                "transition: expected a LinearTransition or a NonlinearTransition, found {}",
                kind(value)
            )));
        };
        let names = ["transition function", "transition jacobian", "transition noise"];
        let functions = &nonlinear.get().functions;
        Ok(Used::Called(Called::new(value.py(), functions, names, Some(states), states)?))
    }

    /// The number of inputs: any for a function.
    pub(crate) fn inputs(&self) -> Option<usize> {
        match self {
            Used::Linear(model) => Some(model.input_matrix().ncols()),
            Used::Called(_) => None,
        }
    }
}

impl<'a, 'py> UsedObservation<'a, 'py> {
    /// The argument `observation`, of so many states and, where that is known, outputs.
    pub(crate) fn new(value: &'a Bound<'py, PyAny>, states: usize, outputs: Option<usize>) -> PyResult<Self> {
        if let Ok(linear) = value.cast::<LinearObservation>() {
            let model = &linear.get().model;
            check_states("observation", states, model.output_matrix().ncols())?;
            return Ok(Used::Linear(model));
        }
        let Ok(nonlinear) = value.cast::<NonlinearObservation>() else {
            return Err(PyTypeError::new_err(format!(
                "observation: expected a LinearObservation or a NonlinearObservation, found {}",
                kind(value)
            )));
        };
        let names = ["observation function", "observation jacobian", "observation noise"];
        let functions = &nonlinear.get().functions;
        // Where the noise is a function the measurement tells the size.
        let outputs = if functions.has_fixed_noise() { None } else { outputs };
        Ok(Used::Called(Called::new(value.py(), functions, names, outputs, states)?))
    }

    /// The number of inputs: any for a function.
    pub(crate) fn inputs(&self) -> Option<usize> {
        match self {
            Used::Linear(model) => Some(model.input_matrix().ncols()),
            Used::Called(_) => None,
        }
    }

    /// The number of outputs.
    pub(crate) fn outputs(&self) -> usize {
        match self {
            Used::Linear(model) => model.input_matrix().nrows(),
            Used::Called(called) => called.size(),
        }
    }
}

pub(crate) fn check_states(argument: &str, expected: usize, found: usize) -> PyResult<()> {
    if expected == found {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{argument}: expected a model with {expected} states, found {found}")))
}

impl Transition<f64, Dyn, Dyn> for UsedTransition<'_, '_> {
    fn next(&self, state: &DVector<f64>, input: &DVector<f64>) -> DVector<f64> {
        match self {
            Used::Linear(model) => model.next(state, input),
            Used::Called(model) => model.next(state, input),
        }
    }

    fn next_jacobian(&self, state: &DVector<f64>, input: &DVector<f64>) -> DMatrix<f64> {
        match self {
            Used::Linear(model) => model.next_jacobian(state, input),
            Used::Called(model) => model.derivative(state, input),
        }
    }

    fn process_noise(&self, state: &DVector<f64>, input: &DVector<f64>) -> Covariance<f64, Dyn> {
        match self {
            Used::Linear(model) => model.noise().clone(),
            Used::Called(model) => model.covariance(state, input),
        }
    }
}

impl Observation<f64, Dyn, Dyn, Dyn> for UsedObservation<'_, '_> {
    fn output(&self, state: &DVector<f64>, input: &DVector<f64>) -> DVector<f64> {
        match self {
            Used::Linear(model) => model.output(state, input),
            Used::Called(model) => model.output(state, input),
        }
    }

    fn output_jacobian(&self, state: &DVector<f64>, input: &DVector<f64>) -> DMatrix<f64> {
        match self {
            Used::Linear(model) => model.output_matrix(),
            Used::Called(model) => model.derivative(state, input),
        }
    }

    fn measurement_noise(&self, state: &DVector<f64>, input: &DVector<f64>) -> Covariance<f64, Dyn> {
        match self {
            Used::Linear(model) => model.noise().clone(),
            Used::Called(model) => model.covariance(state, input),
        }
    }
}
