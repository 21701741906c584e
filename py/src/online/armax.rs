//! A recursive ARMAX estimator.

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat_core::{ArmaxMethod, ArmaxOrders};

use super::argument::{Whole, failed};
use super::forgetting::{Memory, STANDARD};
use super::recursive;
use super::recursive_model::{
    Armax, RecursiveModel, RecursivePolynomials, StartingPoint, Stepper, orders, scales,
};

/// An ARMAX model, estimated while the plant runs.
///
/// Where the disturbance is not white, it finds the plant without bias, and predicts the disturbance too.
///
/// Parameters
/// ----------
/// na : int
///     The number of past outputs.
/// nb : int or sequence of int
///     The number of coefficients of B. An int is one input, and 0 no input; a sequence has one for each input.
/// nc : int
///     The number of past residuals.
/// nk : int or sequence of int, default 1
///     The delay of each input; an int is the delay of all of them.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten. A float is exponential forgetting with that factor, None is no forgetting.
/// method : {"extended-least-squares", "prediction-error"}
///     The gradient along which it corrects. The first one takes the residuals for measured: it is quick, and
///     converges to the truth if 1 / C(q) - 1/2 is positive real. The second one filters by 1 / C(q): it converges
///     to a minimum of the prediction error, and may be slow at the start.
/// constant : bool, default False
///     Whether a constant is estimated too, for signals that are not about 0: the level of the output where the inputs
///     are 0 is constant / A(1).
/// output_scale : float, default 1.0
///     The typical magnitude of the output, in its own unit.
/// input_scales : float or array_like, optional
///     The typical magnitude of each input, in its own unit: 1 if not given.
/// noise_scale : float, default 1.0
///     The typical magnitude of the noise e, in the unit of the output.
/// parameters : array_like, shape (n,), optional
///     What to start from: a_1 ... a_na, then b_0 ... of each input, then the constant, then c_1 ... c_nc.
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
///     A pair (lower, upper) or None for each parameter of A, B and the constant, such as the sign of a gain that a
///     controller divides by. What an update leads out is taken back to the nearest point within, in the metric of P,
///     so that the other parameters make up for it; the action is "projected" then.
///
/// Notes
/// -----
/// The model is::
///
///     A(q) y(k) = sum over the inputs of B_i(q) u_i(k) [+ constant] + C(q) e(k)
///     C(q) = 1 + c_1 q^-1 + ... + c_nc q^-nc
///
/// with A and B as in `RecursiveArx`. C stays stable: a step that would lead out is shortened, and the action is
/// "projected". The start is the standard one.
///
/// References
/// ----------
/// Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, sections 3.7.2, 5.5 and 6.6.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import RecursiveArmax
/// >>> e = 0.5 * np.random.default_rng(1).standard_normal(4000)
/// >>> y = e + 0.6 * np.r_[0.0, e[:-1]]
/// >>> series = RecursiveArmax(0, 0, 1, forgetting=None, noise_scale=0.5)
/// >>> trajectory = series.run(y)
/// >>> bool(abs(series.c[1] - 0.6) < 0.03)
/// True
#[pyclass(module = "thetahat", extends = RecursivePolynomials)]
pub(crate) struct RecursiveArmax;

impl RecursiveArmax {
    /// The object around what all have in common.
    pub(super) fn over(model: RecursiveModel) -> PyClassInitializer<Self> {
        PyClassInitializer::from(model).add_subclass(RecursivePolynomials).add_subclass(Self)
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursiveArmax {
    #[new]
    #[pyo3(signature = (na, nb, nc, nk = None, forgetting = STANDARD, *, method = "extended-least-squares",
        constant = false, output_scale = 1.0, input_scales = None, noise_scale = 1.0, parameters = None, covariance = None,
        dead_zone = 0.0, huber = f64::INFINITY, gate = f64::INFINITY, release = Whole(0), limits = None))]
    #[pyo3(
        text_signature = "(na, nb, nc, nk=1, forgetting=0.99, *, method='extended-least-squares', constant=False, output_scale=1.0, input_scales=None, noise_scale=1.0, parameters=None, covariance=None, dead_zone=0.0, huber=1e999, gate=1e999, release=0, limits=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        na: Whole,
        nb: &Bound<'_, PyAny>,
        nc: Whole,
        nk: Option<&Bound<'_, PyAny>>,
        forgetting: Memory,
        method: &str,
        constant: bool,
        output_scale: f64,
        input_scales: Option<&Bound<'_, PyAny>>,
        noise_scale: f64,
        parameters: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
        dead_zone: f64,
        huber: f64,
        gate: f64,
        release: Whole,
        limits: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let one = 1_u8.into_pyobject(py)?.into_any();
        let (others, inputs) = orders(&[("na", na), ("nc", nc)], nb, nk.unwrap_or(&one))?;
        let each = |place: usize| others.get(place).copied().unwrap_or_default();
        let orders = ArmaxOrders { na: each(0), inputs: &inputs, nc: each(1), constant };
        let scales = scales(input_scales, inputs.len())?;
        let method = match method {
            "extended-least-squares" => ArmaxMethod::ExtendedLeastSquares,
            "prediction-error" => ArmaxMethod::PredictionError,
            _ => {
                return Err(PyValueError::new_err(format!(
                    "method: expected 'extended-least-squares' or 'prediction-error', found '{method}'"
                )));
            }
        };
        let outliers = recursive::outliers(huber, gate, release)?;
        let stepper = Armax::new(&orders, method, output_scale, &scales, noise_scale, forgetting.0)
            .and_then(|stepper| stepper.with_dead_zone(dead_zone)?.with_outliers(outliers))
            .map_err(|error| failed(py, error))?;
        let limited = orders.parameters() - orders.nc;
        let given = StartingPoint { parameters, covariance, limits, limited };
        RecursiveModel::new(py, Stepper::Armax(stepper), inputs.len(), &given).map(Self::over)
    }

    /// C(q): 1, c_1 ... c_nc.
    #[getter]
    fn c<'py>(model: PyRef<'py, Self>, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        match &model.as_super().as_super().engine.stepper {
            Stepper::Armax(stepper) => recursive::coefficients(py, stepper.c()),
            Stepper::Arx(_) | Stepper::OutputError(_) | Stepper::Narx(_) => {
                recursive::coefficients(py, std::iter::empty())
            }
        }
    }
}
