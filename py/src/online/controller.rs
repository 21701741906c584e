//! A linear controller.

use numpy::PyArray1;
use pyo3::prelude::*;
use thetahat_core::nalgebra::{DVector, Dyn};
use thetahat_core::{PlacementOrders, RstController as Controller, WantedPoles};

use super::argument::{self, Whole, count, failed};
use super::innovation::list;
use super::{Reduced, snapshot};
use crate::array;

type Stepper = Controller<f64, Dyn>;
type Range = Option<(Option<f64>, Option<f64>)>;

/// A linear controller of a measurement and a set point, with limits and without windup.
///
/// ::
///
///     R(q) u(k) = T(q) u_c(k) - S(q) y(k),   T = t_0 A_o
///
/// Parameters
/// ----------
/// r, s : array_like
///     The coefficients of R, from its 1 on, and of S.
/// gain : float
///     t_0.
/// observer : array_like, default [1]
///     The coefficients of A_o, from its 1 on: how fast it forgets what an actuator at its limits did not do.
/// limits : (lower, upper), optional
///     Limits of the input; None for none to either side.
///
/// Raises
/// ------
/// ValueError
///     If a polynomial does not begin with 1, a number is not finite, or limits are out of order.
///
/// Notes ----- Signals are deviations from a working point at which they belong together: any, if R has the factor 1 -
/// q^-1. What the actuator did not do is told to the controller by itself: A_o v = T u_c - S y + (A_o - R) u.
///
/// References ---------- Åström and Wittenmark, Adaptive Control, 2nd ed., 1995, section 3.2; Computer-Controlled
/// Systems, 3rd ed., 1997, section 9.4.
///
/// Examples -------- >>> from thetahat import RstController >>> heater = RstController.pole_placement([1, -0.9], [0,
/// 0.2], [1, -0.6], [1, -0.3], integrator=True, limits=(0.0, 10.0)) >>> level = power = 0.0 >>> for _ in range(100):
/// ... level = 0.9 * level + 0.2 * power ... power = heater.control(5.0, level) >>> round(level, 6), round(power, 6)
/// (5.0, 2.5)
#[pyclass(module = "thetahat")]
pub(crate) struct RstController {
    controller: Stepper,
}

impl RstController {
    pub(crate) fn of(controller: Stepper) -> Self {
        Self { controller }
    }

    fn limited(py: Python<'_>, controller: Stepper, limits: Range) -> PyResult<Self> {
        let (lowest, highest) = limits.unwrap_or((None, None));
        let range = lowest.unwrap_or(f64::NEG_INFINITY)..=highest.unwrap_or(f64::INFINITY);
        controller.with_limits(range).map(Self::of).map_err(|error| failed(py, error))
    }
}

/// A polynomial that begins with 1, without it, filled up with zeros.
fn monic(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let read = array::finite_vector(argument, given, None)?;
    match read.as_slice() {
        [1.0, rest @ ..] => Ok(rest.to_vec()),
        _ => Err(pyo3::exceptions::PyValueError::new_err(format!(
            "{argument}: expected a polynomial that begins with 1"
        ))),
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RstController {
    #[new]
    #[pyo3(signature = (r, s, gain, observer = None, *, limits = None))]
    #[pyo3(text_signature = "(r, s, gain, observer=[1], *, limits=None)")]
    fn new(
        py: Python<'_>,
        r: &Bound<'_, PyAny>,
        s: &Bound<'_, PyAny>,
        gain: f64,
        observer: Option<&Bound<'_, PyAny>>,
        limits: Range,
    ) -> PyResult<Self> {
        let (r, s) = (monic("r", r)?, array::finite_vector("s", s, None)?.as_slice().to_vec());
        let observer = observer.map_or(Ok(Vec::new()), |given| monic("observer", given))?;
        let size = r.len().max(s.len()).max(observer.len());
        argument::check_size("r, s and observer: the coefficients", size)?;
        let filled =
            |values: Vec<f64>| DVector::from_fn(size, |place, _| values.get(place).copied().unwrap_or(0.0));
        let made = Stepper::new(gain, filled(r), filled(s), filled(observer));
        Self::limited(py, made.map_err(|error| failed(py, error))?, limits)
    }

    /// The controller of lowest order that places the poles of the closed loop with a model A(q) y = B(q) u.
    ///
    /// Parameters
    /// ----------
    /// a : array_like
    ///     A, from its 1 on, as `RecursiveArx.a` has it.
    /// b : array_like
    ///     B, from the power 0 on with its leading zeros, as `RecursiveArx.b` has it.
    /// response : array_like
    ///     A_m, from its 1 on: how the output answers the set point.
    /// observer : array_like, default [1]
    ///     A_o, from its 1 on: how an error of the model or the start is forgotten.
    /// integrator : bool, default False
    ///     Whether the controller integrates, so that a constant load leaves no error.
    /// cancel_zeros : bool, default False
    ///     Whether the zeros of B are cancelled.
    /// limits : (lower, upper), optional
    ///     Limits of the input.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If A and B have a common factor, a zero that shall be cancelled is not inside the unit circle, the input
    ///     acts at once, there are more poles than the controller has coefficients, or a number is not finite.
    #[staticmethod]
    #[pyo3(signature = (a, b, response, observer = None, *, integrator = false, cancel_zeros = false, limits = None))]
    #[pyo3(
        text_signature = "(a, b, response, observer=[1], *, integrator=False, cancel_zeros=False, limits=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "half of them are options, given by name")]
    fn pole_placement(
        py: Python<'_>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        response: &Bound<'_, PyAny>,
        observer: Option<&Bound<'_, PyAny>>,
        integrator: bool,
        cancel_zeros: bool,
        limits: Range,
    ) -> PyResult<Self> {
        let vector = |argument, given| array::finite_vector(argument, given, None);
        let (a, b, response) = (vector("a", a)?, vector("b", b)?, vector("response", response)?);
        let observer = match observer {
            Some(given) => vector("observer", given)?,
            None => DVector::from_element(1, 1.0),
        };
        let orders =
            PlacementOrders { na: a.len().saturating_sub(1), nb: b.len().saturating_sub(1), integrator };
        argument::check_size("a and b: the coefficients of the controller", orders.size())?;
        let wanted = WantedPoles::new(response.as_slice(), observer.as_slice())
            .with_integrator(integrator)
            .with_cancelled_zeros(cancel_zeros);
        let placed = Stepper::pole_placement(a.as_slice(), b.as_slice(), &wanted);
        Self::limited(py, placed.map_err(|error| failed(py, error))?, limits)
    }

    /// The input from now on, within the limits.
    ///
    /// Parameters
    /// ----------
    /// set_point, y : float
    ///     What the output shall be, and what was measured. NaN is a missing measurement: the input stays as it was.
    ///
    /// Returns
    /// -------
    /// float
    fn control(&mut self, set_point: f64, y: f64) -> f64 {
        self.controller.control(set_point, y)
    }

    /// Tell that the actuator did something else than the latest `control` asked for.
    ///
    /// Parameters
    /// ----------
    /// u : float
    ///     What it did. A number that is not finite is not taken.
    fn applied(&mut self, u: f64) {
        self.controller.applied(u);
    }

    /// Take over from a hand without a bump.
    ///
    /// Parameters
    /// ----------
    /// u, y, set_point : float
    ///     The input, the measurement and the set point of now.
    fn start(&mut self, u: f64, y: f64, set_point: f64) -> PyResult<()> {
        if ![u, y, set_point].iter().all(|value| value.is_finite()) {
            return Err(pyo3::exceptions::PyValueError::new_err(
                "u, y and set_point: expected finite numbers",
            ));
        }
        self.controller.start(u, y, set_point);
        Ok(())
    }

    /// How far the loop with a model is from instability: the largest abs(1/(1 + L)) and abs(L/(1 + L)) with L = B S/(A
    /// R).
    ///
    /// Parameters
    /// ----------
    /// a, b : array_like
    ///     The model, as for `pole_placement`.
    /// frequencies : int, default 500
    ///     At how many, from 0 to that of half the sampling.
    ///
    /// Returns
    /// -------
    /// (float, float)
    #[pyo3(signature = (a, b, frequencies = Whole(500)))]
    #[pyo3(text_signature = "($self, a, b, frequencies=500)")]
    fn peaks(&self, a: &Bound<'_, PyAny>, b: &Bound<'_, PyAny>, frequencies: Whole) -> PyResult<(f64, f64)> {
        let frequencies = count("frequencies", frequencies, 1, 1_000_000)?;
        let vector = |argument, given| array::finite_vector(argument, given, None);
        Ok(self.controller.peaks(vector("a", a)?.as_slice(), vector("b", b)?.as_slice(), frequencies))
    }

    /// R, from its 1 on.
    #[getter]
    fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, std::iter::once(1.0).chain(self.controller.r().iter().copied()))
    }

    /// S.
    #[getter]
    fn s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        argument::from_vector(py, self.controller.s())
    }

    /// T = t_0 A_o.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let gain = self.controller.gain();
        let rest = self.controller.observer().iter().map(|value| gain * value);
        PyArray1::from_iter(py, std::iter::once(gain).chain(rest))
    }

    /// The limits of the input; None where there is none.
    #[getter]
    fn limits(&self) -> (Option<f64>, Option<f64>) {
        let (lowest, highest) = self.controller.limits();
        let limit = |value: f64| value.is_finite().then_some(value);
        (limit(lowest), limit(highest))
    }

    fn __repr__(&self) -> String {
        let r: Vec<f64> = std::iter::once(1.0).chain(self.controller.r().iter().copied()).collect();
        format!(
            "RstController(r={}, s={}, gain={:?})",
            list(&r),
            list(self.controller.s().as_slice()),
            self.controller.gain()
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "RstController", &self.controller)
    }
}
