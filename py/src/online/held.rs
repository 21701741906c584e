//! The models that a filter or an observer holds, for the steps that are not given another one.

use pyo3::exceptions::{PyDeprecationWarning, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::callable::{NonlinearObservation, NonlinearTransition};
use super::model::{LinearObservation, LinearTransition};
use super::used::{UsedObservation, UsedTransition};
use super::{Reduced, read, snapshot};

/// The models that were given with the state.
#[derive(Default)]
pub(crate) struct Held {
    transition: Option<Py<PyAny>>,
    observation: Option<Py<PyAny>>,
}

/// A model of some step, or what was given as one.
pub(crate) type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

impl Held {
    /// Those of a filter with so many states.
    pub(crate) fn new(
        transition: Given<'_, '_>,
        observation: Given<'_, '_>,
        states: usize,
    ) -> PyResult<Self> {
        transition.map(|model| UsedTransition::new(model, states)).transpose()?;
        observation.map(|model| UsedObservation::new(model, states, None)).transpose()?;
        let kept = |model: Given<'_, '_>| model.map(|model| model.clone().unbind());
        Ok(Self { transition: kept(transition), observation: kept(observation) })
    }

    /// The model of the state for a step.
    pub(crate) fn transition<'py>(
        &self,
        py: Python<'py>,
        given: Given<'_, 'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        chosen(py, "transition", self.transition.as_ref(), given)
    }

    /// The model of the measurement for a step.
    pub(crate) fn observation<'py>(
        &self,
        py: Python<'py>,
        given: Given<'_, 'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        chosen(py, "observation", self.observation.as_ref(), given)
    }

    /// A snapshot of a stepper that holds them.
    pub(crate) fn snapshot<'py>(
        &self,
        py: Python<'py>,
        class_name: &'static str,
        stepper: &impl Serialize,
    ) -> PyResult<Reduced<'py>> {
        let (restore, (class_name, bytes)) = snapshot(py, class_name, stepper)?;
        let kept = (bytes, &self.transition, &self.observation).into_pyobject(py)?;
        Ok((restore, (class_name, kept.into_any())))
    }

    /// Both of such a snapshot.
    pub(crate) fn read<T: DeserializeOwned>(kept: &Bound<'_, PyAny>) -> PyResult<(T, Self)> {
        let (bytes, transition, observation): (Bound<'_, PyBytes>, _, _) = kept.extract()?;
        Ok((read(bytes.as_any())?, Self { transition, observation }))
    }
}

fn chosen<'py>(
    py: Python<'py>,
    argument: &str,
    held: Option<&Py<PyAny>>,
    given: Given<'_, 'py>,
) -> PyResult<Bound<'py, PyAny>> {
    match (given, held) {
        (Some(given), _) => Ok(given.clone()),
        (None, Some(held)) => Ok(held.bind(py).clone()),
        (None, None) => Err(PyValueError::new_err(format!(
            "{argument}: the object holds none; give {argument}=… to this call, or when you make the object"
        ))),
    }
}

/// The arguments of a step or a run: what was measured, the inputs, and the models where they are given.
pub(crate) struct Arguments<'a, 'py> {
    pub(crate) y: Option<&'a Bound<'py, PyAny>>,
    pub(crate) u: Given<'a, 'py>,
    pub(crate) transition: Given<'a, 'py>,
    pub(crate) observation: Given<'a, 'py>,
}

impl<'a, 'py> Arguments<'a, 'py> {
    /// (y, u), or the models first: (transition, observation, y).
    pub(crate) fn new(
        first: &'a Bound<'py, PyAny>,
        second: Given<'a, 'py>,
        third: Given<'a, 'py>,
        inputs: Given<'a, 'py>,
        models: [Given<'a, 'py>; 2],
    ) -> Self {
        let [transition, observation] = models;
        if is_model(first) {
            return Self {
                y: third,
                u: inputs,
                transition: Some(first),
                observation: second.or(observation),
            };
        }
        Self { y: Some(first), u: second.or(inputs), transition, observation }
    }

    /// What was measured.
    pub(crate) fn measured(&self, argument: &str) -> PyResult<&'a Bound<'py, PyAny>> {
        self.y.ok_or_else(|| {
            PyTypeError::new_err(format!("{argument}: nothing was given; give what was measured"))
        })
    }
}

/// The model and the input of a prediction: (u), or the model first: (transition, u).
pub(crate) fn predicted<'a, 'py>(
    first: Given<'a, 'py>,
    second: Given<'a, 'py>,
    transition: Given<'a, 'py>,
) -> (Given<'a, 'py>, Given<'a, 'py>) {
    match first {
        Some(model) if is_model(model) => (Some(model), second),
        _ => (transition, first.or(second)),
    }
}

/// Whether it is a model, or something that was meant as one: functions are no numbers.
fn is_model(value: &Bound<'_, PyAny>) -> bool {
    value.is_callable()
        || value.is_instance_of::<LinearTransition>()
        || value.is_instance_of::<NonlinearTransition>()
        || value.is_instance_of::<LinearObservation>()
        || value.is_instance_of::<NonlinearObservation>()
}

/// Says that a method has another name now.
pub(crate) fn renamed(py: Python<'_>, old: &str, new: &str) -> PyResult<()> {
    let message = std::ffi::CString::new(format!("{old} is deprecated: its name is {new}"))?;
    PyErr::warn(py, &py.get_type::<PyDeprecationWarning>(), &message, 1)
}
