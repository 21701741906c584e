//! The unscented Kalman filter.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use thetahat_core::nalgebra::Dyn;
use thetahat_core::{Covariance, Smoother, UnscentedKalmanFilter as Stepper};

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

/// The unscented Kalman filter: models are seen at points around the estimate, and need no Jacobians.
///
/// The models are arguments of each step, linear or not. With linear ones it is the Kalman filter, to rounding.
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
/// spread : float, default sqrt(3)
///     How many standard deviations the points are from the estimate, 1 to 10. Smaller for functions that are not
///     defined far away, or bend otherwise there. With 1 the covariance knows nothing of bends.
/// transition : LinearTransition or NonlinearTransition, optional
///     The model of the state, of steps that are not given one. A Jacobian is not used.
/// observation : LinearObservation or NonlinearObservation, optional
///     The model of the measurement, of steps that are not given one. A Jacobian is not used.
///
/// Notes
/// -----
/// With c the spread, P = U D U', u_j column j of U, and g either of the functions f and h::
///
///     points       x,   x + c sqrt(D_j) u_j,   x - c sqrt(D_j) u_j        g_0,  g_j+,  g_j-
///     slopes       s_j = (g_j+ - g_j-) / 2c
///     bends        b_j = (g_j+ + g_j-) / 2 - g_0
///     mean         g_0 + sum b_j / c^2
///     covariance   sum s_j s_j' + (c^2 - 1)/c^4 sum b_j b_j'
///
/// Slopes are those of a linear model, and bends its noise: no weight is negative, for any number of states. P knows
/// how the model bends, so that it is honest where `ExtendedKalmanFilter` promises too much. Each step calls a function
/// 2 n + 1 times. Q and R are taken at the estimate. A function of a model must not use the filter itself: that raises
/// RuntimeError.
///
/// References
/// ----------
/// Julier and Uhlmann, Unscented filtering and nonlinear estimation, 2004. Norgaard, Poulsen and Ravn, New developments
/// in state estimation for nonlinear systems, 2000, section 4. Van der Merwe, Sigma-point Kalman filters, 2004.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import LinearTransition, NonlinearObservation, UnscentedKalmanFilter
/// >>> still = LinearTransition(np.eye(2), np.zeros((2, 2)))
/// >>> # The distance of a point in the plane, of which nothing is known across.
/// >>> radar = NonlinearObservation(lambda x, u: np.hypot(x[:1], x[1:]), [[1e-4]])
/// >>> estimate = UnscentedKalmanFilter([10.0, 0.0], np.diag([1.0, 4.0]), transition=still, observation=radar)
/// >>> innovation = estimate.update(10.0)
/// >>> # What is far across is nearer along: the mean is nearer than the distance.
/// >>> (estimate.state.round(2) + 0.0).tolist()
/// [9.82, 0.0]
/// >>> np.sqrt(np.diag(estimate.covariance)).round(2).tolist()
/// [0.27, 2.0]
#[pyclass(module = "thetahat")]
pub(crate) struct UnscentedKalmanFilter {
    pub(crate) filter: Stepper<f64, Dyn>,
    pub(super) held: Held,
}

around_models!(UnscentedKalmanFilter, from, {
    #[new]
    #[pyo3(signature = (state, covariance, *, transition = None, observation = None, gate = f64::INFINITY, release = Whole(0), spread = None))]
    #[pyo3(
        text_signature = "(state, covariance, *, transition=None, observation=None, gate=1e999, release=0, spread=None)"
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
        spread: Option<f64>,
    ) -> PyResult<Self> {
        let mut filter = Stepper::from(started(py, state, covariance, gate, release)?);
        if let Some(spread) = spread {
            filter.set_spread(spread).map_err(|error| failed(py, error))?;
        }
        let held = Held::new(transition, observation, filter.state().len())?;
        Ok(UnscentedKalmanFilter { filter, held })
    }

    /// How many standard deviations the points are from the estimate.
    #[getter]
    fn spread(&self) -> f64 {
        self.filter.spread()
    }
});
