//! The steppers: recursive estimators, filters and observers, with sizes known at run time.
//!
//! A class holds a stepper of `thetahat_core` and does what that does, to the bit. `run` works on a copy of it, which
//! takes its place when all rows went well.

pub(crate) mod argument;
mod armax;
mod around;
mod arx;
mod callable;
mod controller;
pub(crate) mod detector;
mod extended;
pub(crate) mod forgetting;
mod held;
pub(crate) mod innovation;
mod kalman;
mod least_squares;
mod limits;
mod luenberger;
mod model;
mod narx;
mod out_of_sequence;
mod output_error;
mod recursive;
mod recursive_model;
pub(crate) mod results;
mod self_tuner;
mod trajectory;
mod unscented;
mod used;
mod vector_arx;
mod windowed;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use serde::Serialize;
use serde::de::DeserializeOwned;
use thetahat_core::Error;

use recursive_model::RecursiveModel;

/// Adds all classes of this part.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    forgetting::register(module)?;
    module.add_class::<innovation::Innovation>()?;
    module.add_class::<least_squares::RecursiveLeastSquares>()?;
    module.add_class::<arx::RecursiveArx>()?;
    module.add_class::<vector_arx::RecursiveVectorArx>()?;
    module.add_class::<armax::RecursiveArmax>()?;
    module.add_class::<output_error::RecursiveOutputError>()?;
    module.add_class::<windowed::WindowedLeastSquares>()?;
    module.add_class::<narx::RecursiveNarx>()?;
    module.add_class::<controller::RstController>()?;
    module.add_class::<self_tuner::SelfTuner>()?;
    module.add_class::<recursive::RecursiveTrajectory>()?;
    module.add_class::<model::LinearTransition>()?;
    module.add_class::<model::LinearObservation>()?;
    module.add_class::<callable::NonlinearTransition>()?;
    module.add_class::<callable::NonlinearObservation>()?;
    module.add_class::<kalman::KalmanFilter>()?;
    module.add_class::<extended::ExtendedKalmanFilter>()?;
    module.add_class::<unscented::UnscentedKalmanFilter>()?;
    module.add_class::<out_of_sequence::OutOfSequenceFilter>()?;
    module.add_class::<luenberger::LuenbergerObserver>()?;
    module.add_class::<detector::ChangeDetector>()?;
    module.add_class::<detector::ChangeTrajectory>()?;
    module.add_class::<detector::Alarm>()?;
    module.add_class::<trajectory::FilterTrajectory>()?;
    module.add_class::<trajectory::ObserverTrajectory>()?;
    module.add_class::<trajectory::SmoothedTrajectory>()?;
    module.add_class::<trajectory::SteadyState>()?;
    module.add_function(wrap_pyfunction!(_restore, module)?)
}

/// Makes an object of this class again from what pickle kept of it.
#[pyfunction]
fn _restore<'py>(py: Python<'py>, class_name: &str, kept: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let any = |object: Bound<'py, PyAny>| Ok(object);
    match class_name {
        "Forgetting" => any(Bound::new(py, forgetting::Forgetting::restore(read(kept)?)?)?.into_any()),
        "Innovation" => any(Bound::new(py, innovation::Innovation::restore(kept)?)?.into_any()),
        "RecursiveLeastSquares" => {
            any(Bound::new(py, least_squares::RecursiveLeastSquares::of(read(kept)?))?.into_any())
        }
        "RecursiveArx" => {
            let model = RecursiveModel::restore(read(kept)?, class_name)?;
            any(Bound::new(py, arx::RecursiveArx::over(model))?.into_any())
        }
        "RecursiveVectorArx" => {
            any(Bound::new(py, vector_arx::RecursiveVectorArx::of(read(kept)?)?)?.into_any())
        }
        "RecursiveArmax" => {
            let model = RecursiveModel::restore(read(kept)?, class_name)?;
            any(Bound::new(py, armax::RecursiveArmax::over(model))?.into_any())
        }
        "RecursiveOutputError" => {
            let model = RecursiveModel::restore(read(kept)?, class_name)?;
            any(Bound::new(py, output_error::RecursiveOutputError::over(model))?.into_any())
        }
        "WindowedLeastSquares" => {
            any(Bound::new(py, windowed::WindowedLeastSquares::of(read(kept)?))?.into_any())
        }
        "OutOfSequenceFilter" => {
            let (filter, held) = held::Held::read(kept)?;
            any(Bound::new(py, out_of_sequence::OutOfSequenceFilter { filter, held })?.into_any())
        }
        "SelfTuner" => any(Bound::new(py, self_tuner::SelfTuner { tuner: read(kept)? })?.into_any()),
        "RstController" => any(Bound::new(py, controller::RstController::of(read(kept)?))?.into_any()),
        "RecursiveNarx" => {
            let model = RecursiveModel::restore(read(kept)?, class_name)?;
            any(Bound::new(py, narx::RecursiveNarx::over(model))?.into_any())
        }
        "LinearTransition" => any(Bound::new(py, model::LinearTransition { model: read(kept)? })?.into_any()),
        "LinearObservation" => {
            any(Bound::new(py, model::LinearObservation { model: read(kept)? })?.into_any())
        }
        "KalmanFilter" => {
            let (filter, held) = held::Held::read(kept)?;
            any(Bound::new(py, kalman::KalmanFilter { filter, held })?.into_any())
        }
        "ExtendedKalmanFilter" => {
            let (filter, held) = held::Held::read(kept)?;
            any(Bound::new(py, extended::ExtendedKalmanFilter { filter, held })?.into_any())
        }
        "UnscentedKalmanFilter" => {
            let (filter, held) = held::Held::read(kept)?;
            any(Bound::new(py, unscented::UnscentedKalmanFilter { filter, held })?.into_any())
        }
        "LuenbergerObserver" => {
            let (observer, held) = held::Held::read(kept)?;
            any(Bound::new(py, luenberger::LuenbergerObserver { observer, held })?.into_any())
        }
        "Alarm" => any(Bound::new(py, detector::Alarm::restore(kept)?)?.into_any()),
        "ChangeDetector" => any(Bound::new(py, detector::ChangeDetector::restore(read(kept)?)?)?.into_any()),
        "ChangeTrajectory" => any(Bound::new(py, detector::ChangeTrajectory::restore(kept)?)?.into_any()),
        "RecursiveTrajectory" => {
            any(Bound::new(py, recursive::RecursiveTrajectory::restore(kept)?)?.into_any())
        }
        "FilterTrajectory" => any(Bound::new(py, trajectory::FilterTrajectory::restore(kept)?)?.into_any()),
        "ObserverTrajectory" => {
            any(Bound::new(py, trajectory::ObserverTrajectory::restore(kept)?)?.into_any())
        }
        "SmoothedTrajectory" => {
            any(Bound::new(py, trajectory::SmoothedTrajectory::restore(kept)?)?.into_any())
        }
        "SteadyState" => any(Bound::new(py, trajectory::SteadyState::restore(kept)?)?.into_any()),
        _ => Err(PyValueError::new_err(format!("class_name: there is no class {class_name}"))),
    }
}

/// Why a run ended before its last row.
pub(crate) enum Stop {
    /// A row, from 0, was refused.
    Refused(usize, Error),
    /// A handler of a signal raised this.
    Interrupted(PyErr),
}

impl Stop {
    /// As an exception.
    pub(crate) fn into_error(self, py: Python<'_>) -> PyErr {
        match self {
            Stop::Refused(row, error) => argument::failed_at(py, row, error),
            Stop::Interrupted(raised) => raised,
        }
    }
}

impl From<(usize, Error)> for Stop {
    fn from((row, error): (usize, Error)) -> Self {
        Stop::Refused(row, error)
    }
}

impl From<PyErr> for Stop {
    fn from(raised: PyErr) -> Self {
        Stop::Interrupted(raised)
    }
}

/// What `__reduce__` returns.
pub(crate) type Reduced<'py> = (Bound<'py, PyAny>, (&'static str, Bound<'py, PyAny>));

/// A snapshot of a stepper, to the bit.
fn snapshot<'py>(
    py: Python<'py>,
    class_name: &'static str,
    stepper: &impl Serialize,
) -> PyResult<Reduced<'py>> {
    let bytes = serde_json::to_vec(stepper).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok((restore_function(py)?, (class_name, PyBytes::new(py, &bytes).into_any())))
}

/// The attributes of a result.
fn attributes<'py>(class_name: &'static str, kept: Bound<'py, PyTuple>) -> PyResult<Reduced<'py>> {
    Ok((restore_function(kept.py())?, (class_name, kept.into_any())))
}

fn restore_function(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import("thetahat._thetahat")?.getattr("_restore")
}

fn read<T: DeserializeOwned>(kept: &Bound<'_, PyAny>) -> PyResult<T> {
    let bytes = kept.cast::<PyBytes>()?;
    serde_json::from_slice(bytes.as_bytes())
        .map_err(|error| PyValueError::new_err(crate::error::in_python(&format!("not a snapshot: {error}"))))
}
