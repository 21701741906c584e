//! A recursive ARX estimator.

use pyo3::prelude::*;
use thetahat_core::ArxOrders;

use super::argument::{Whole, failed};
use super::forgetting::{Memory, STANDARD};
use super::recursive;
use super::recursive_model::{
    Arx, RecursiveModel, RecursivePolynomials, StartingPoint, Stepper, orders, scales,
};

/// An ARX model, estimated while the plant runs.
///
/// Parameters
/// ----------
/// na : int
///     The number of past outputs.
/// nb : int or sequence of int
///     The number of coefficients of B. An int is one input, and 0 no input; a sequence has one for each input.
/// nk : int or sequence of int, default 1
///     The delay of each input; an int is the delay of all of them.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten. A float is exponential forgetting with that factor, None is no forgetting.
/// constant : bool, default False
///     Whether a constant is estimated too, for signals that are not about 0: the level of the output where the inputs
///     are 0 is constant / A(1).
/// output_scale : float, default 1.0
///     The typical magnitude of the output, in its own unit.
/// input_scales : float or array_like, optional
///     The typical magnitude of each input, in its own unit: 1 if not given.
/// start : {"standard", "exact", "mixed"}
///     As for `RecursiveLeastSquares`.
/// blend : int, optional
///     With "mixed", and only there: in how many samples the prior is taken out.
/// parameters : array_like, shape (n,), optional
///     What to start from: a_1 ... a_na, then b_0 ... of the first input, and of the next, then the constant.
/// covariance : array_like, shape (n, n), optional
///     P to start from, in units of the noise variance.
/// dead_zone : float, default 0.0
///     An innovation of at most this size corrects nothing.
/// huber : float, default inf
///     From 1 on: an innovation of more than so many standard deviations corrects as much as one of so many, and the
///     action is "bounded". 3 loses next to nothing where there are no outliers.
/// gate : float, default inf
///     From 1 on: a sample whose normalised innovation squared is above it corrects nothing, and the action is "gated".
///     25 is five standard deviations. Huber's bound or a gate, not both.
/// release : int, default 0
///     After so many samples in a row above the gate, those that follow are used ("released"), until one is within it
///     again. 0 is never, but for what the noise variance learns of them.
/// limits : sequence, optional
///     A pair (lower, upper) or None for each parameter, such as the sign of a gain that a controller divides by. What
///     an update leads out is taken back to the nearest point within, in the metric of P, so that the other parameters
///     make up for it; the action is "projected" then.
///
/// Notes
/// -----
/// The model is::
///
///     A(q) y(k) = sum over the inputs of B_i(q) u_i(k) [+ constant] + e(k)
///     A(q) = 1 + a_1 q^-1 + ... + a_na q^-na
///     B(q) = q^-nk (b_0 + b_1 q^-1 + ... + b_(nb-1) q^-(nb-1))
///
/// A missing sample is NaN: time goes on, and while it sits in the regressor nothing is corrected.
///
/// References
/// ----------
/// Ljung, System Identification, 2nd ed., 1999, sections 4.2 and 11.2.
///
/// Examples
/// --------
/// >>> from thetahat import RecursiveArx
/// >>> plant = RecursiveArx(1, 1, nk=2, forgetting=0.98)
/// >>> y, before = 0.0, [0.0, 0.0]
/// >>> for k in range(200):
/// ...     y = 0.8 * y + 0.5 * before[1]
/// ...     innovation = plant.measured(y)
/// ...     u = 1.0 if k % 7 < 3 else -1.0
/// ...     plant.applied(u)
/// ...     before = [u, before[0]]
/// >>> plant.a.round(4)
/// array([ 1. , -0.8])
/// >>> plant.b[0].round(4)
/// array([0. , 0. , 0.5])
#[pyclass(module = "thetahat", extends = RecursivePolynomials)]
pub(crate) struct RecursiveArx;

impl RecursiveArx {
    /// The object around what all have in common.
    pub(super) fn over(model: RecursiveModel) -> PyClassInitializer<Self> {
        PyClassInitializer::from(model).add_subclass(RecursivePolynomials).add_subclass(Self)
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursiveArx {
    #[new]
    #[pyo3(signature = (na, nb, nk = None, forgetting = STANDARD, *, constant = false, output_scale = 1.0,
        input_scales = None, start = "standard", blend = None, parameters = None, covariance = None, dead_zone = 0.0, huber = f64::INFINITY, gate = f64::INFINITY, release = Whole(0), limits = None))]
    #[pyo3(
        text_signature = "(na, nb, nk=1, forgetting=0.99, *, constant=False, output_scale=1.0, input_scales=None, start='standard', blend=None, parameters=None, covariance=None, dead_zone=0.0, huber=1e999, gate=1e999, release=0, limits=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        na: Whole,
        nb: &Bound<'_, PyAny>,
        nk: Option<&Bound<'_, PyAny>>,
        forgetting: Memory,
        constant: bool,
        output_scale: f64,
        input_scales: Option<&Bound<'_, PyAny>>,
        start: &str,
        blend: Option<Whole>,
        parameters: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
        dead_zone: f64,
        huber: f64,
        gate: f64,
        release: Whole,
        limits: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let one = 1_u8.into_pyobject(py)?.into_any();
        let (others, inputs) = orders(&[("na", na)], nb, nk.unwrap_or(&one))?;
        let orders = ArxOrders { na: others.iter().sum(), inputs: &inputs, constant };
        let scales = scales(input_scales, inputs.len())?;
        let start = recursive::start(start, blend, parameters.is_some() || covariance.is_some())?;
        let outliers = recursive::outliers(huber, gate, release)?;
        let stepper = Arx::new(&orders, output_scale, &scales, forgetting.0)
            .and_then(|stepper| stepper.with_start(start)?.with_dead_zone(dead_zone)?.with_outliers(outliers))
            .map_err(|error| failed(py, error))?;
        let given = StartingPoint { parameters, covariance, limits, limited: orders.parameters() };
        RecursiveModel::new(py, Stepper::Arx(stepper), inputs.len(), &given).map(Self::over)
    }
}
