//! The extended Kalman filter.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use thetahat_core::nalgebra::Dyn;
use thetahat_core::{Covariance, ExtendedKalmanFilter as Stepper, Smoother};

use super::Reduced;
use super::argument::{self, Whole, failed};
use super::around::{self, Stepped, around_models, explained, smooth};
use super::held::{Arguments, Held, predicted, renamed};
use super::innovation::{Innovation, list};
use super::kalman::started;
use super::trajectory::{
    self, FilterTrajectory, Samples, SmoothedTrajectory, columns, recorded, returned, smoothed,
};
use super::used::{Used, UsedObservation, UsedTransition};
use crate::array;

/// The extended Kalman filter: the Kalman filter of the linearised model.
///
/// The models are arguments of each step, linear or not. With linear ones it is the Kalman filter, to the bit.
///
/// Parameters
/// ----------
/// state : array_like, shape (n,)
///     The estimate of the state to start from. For `run` it is that before the first measurement.
/// covariance : float, or array_like of shape (n, n)
///     The covariance of its error; a number is the variance of each state.
/// gate : float, default inf
///     A measurement whose normalised innovation squared is above it is not used.
/// release : int, default 0
///     After so many measurements in a row above the gate, those that follow are used, until one is within it again. 0
///     is a gate that never lets go: it may lock the filter out for ever.
/// iterations : int, default 1
///     How often a correction linearises the observation, each time about its last result.
/// transition : LinearTransition or NonlinearTransition, optional
///     The model of the state, of steps that are not given one.
/// observation : LinearObservation or NonlinearObservation, optional
///     The model of the measurement, of steps that are not given one.
///
/// Notes
/// -----
/// ::
///
///     predict:  F = df/dx at x, u:       x <- f(x, u),       P <- F P F' + Q
///     correct:  H = dh/dx at x, u:       e = y - h(x, u),    S = H P H' + R,    K = P H' S^-1
///                                        x <- x + K e,       P <- P - K S K'
///
/// It is an approximation: P does not know of the error of the linearisation, so it may promise too much, and a bad
/// start may never be forgotten. Watch ``nis``. A function of a model must not use the filter itself: that raises
/// RuntimeError.
///
/// References
/// ----------
/// Jazwinski, Stochastic Processes and Filtering Theory, 1970, sections 8.3 and 8.6.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import ExtendedKalmanFilter, NonlinearObservation, NonlinearTransition
/// >>> def swing(x, u):
/// ...     return np.array([x[0] + 0.02 * x[1], x[1] - 0.2 * np.sin(x[0])])
/// >>> pendulum = NonlinearTransition(swing, np.zeros((2, 2)))
/// >>> sideways = NonlinearObservation(lambda x, u: np.sin(x[:1]), [[1e-4]])
/// >>> truth = np.array([0.8, 0.0])
/// >>> estimate = ExtendedKalmanFilter([0.5, 0.3], 0.1, transition=pendulum, observation=sideways)
/// >>> for _ in range(200):
/// ...     truth = swing(truth, None)
/// ...     estimate.predict()
/// ...     innovation = estimate.update(float(np.sin(truth[0])))
/// >>> bool(np.all(np.abs(estimate.state - truth) < 2e-3))
/// True
#[pyclass(module = "thetahat")]
pub(crate) struct ExtendedKalmanFilter {
    pub(crate) filter: Stepper<f64, Dyn>,
    pub(super) held: Held,
}

around_models!(ExtendedKalmanFilter, new, {
    #[new]
    #[pyo3(signature = (state, covariance, *, transition = None, observation = None, gate = f64::INFINITY, release = Whole(0), iterations = Whole(1)))]
    #[pyo3(
        text_signature = "(state, covariance, *, transition=None, observation=None, gate=1e999, release=0, iterations=1)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
        gate: f64,
        release: Whole,
        iterations: Whole,
    ) -> PyResult<Self> {
        let iterations = argument::count("iterations", iterations, 1, 1000)?;
        let filter = Stepper::from(started(py, state, covariance, gate, release)?);
        let filter = filter.with_iterations(iterations).map_err(|error| failed(py, error))?;
        let held = Held::new(transition, observation, filter.state().len())?;
        Ok(ExtendedKalmanFilter { filter, held })
    }

    /// How often a correction linearises the observation.
    #[getter]
    fn iterations(&self) -> usize {
        self.filter.iterations()
    }
});
