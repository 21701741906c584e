//! A recursive output-error estimator.

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat_core::{ArxOrders, OutputErrorMethod};

use super::argument::{Whole, failed};
use super::forgetting::{Memory, STANDARD};
use super::recursive;
use super::recursive_model::{
    OutputError, RecursiveModel, RecursivePolynomials, StartingPoint, Stepper, orders, scales,
};

/// A model with noise of the sensor, estimated while the plant runs.
///
/// Noise of the sensor, white or coloured, biases an ARX model; here it does not, as long as the input is independent
/// of it: not in a closed loop.
///
/// Parameters
/// ----------
/// nf : int
///     The number of coefficients of F, one F for all inputs.
/// nb : int or sequence of int
///     The number of coefficients of B. An int is one input, and 0 no input; a sequence has one for each input.
/// nk : int or sequence of int, default 1
///     The delay of each input; an int is the delay of all of them.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten. A float is exponential forgetting with that factor, None is no forgetting.
/// method : {"prediction-error", "instruments"}
///     The first one goes along the gradient of the model's output: it converges to a minimum of the variance of the
///     output error, the best estimate where the noise is white, with honest standard errors then. The second one is
///     instrumental variables from the model's own output: linear in the parameters, so that there is one minimum; the
///     variance of the noise and standard errors are not known.
/// constant : bool, default False
///     Whether a constant is estimated too, for signals that are not about 0: the level of the output where the inputs
///     are 0 is constant / F(1).
/// output_scale : float, default 1.0
///     The typical magnitude of the output, in its own unit.
/// input_scales : float or array_like, optional
///     The typical magnitude of each input, in its own unit: 1 if not given.
/// parameters : array_like, shape (n,), optional
///     What to start from: f_1 ... f_nf, then b_0 ... of each input, then the constant. F is stable.
/// covariance : array_like, shape (n, n), optional
///     P to start from, in units of the noise variance.
/// dead_zone : float, default 0.0
///     An error of at most this size corrects nothing.
/// huber : float, default inf
///     From 1 on: an innovation of more than so many standard deviations corrects as much as one of so many, and the
///     action is "bounded". 3 loses next to nothing where there are no outliers.
/// gate : float, default inf
///     From 1 on: a sample whose normalised innovation squared is above it corrects nothing, and the action is "gated".
///     25 is five standard deviations. Huber's bound or a gate, not both; with the method "instruments" neither, as the
///     noise variance is not known.
/// release : int, default 0
///     After so many samples in a row above the gate, those that follow are used ("released"), until one is within it
///     again. 0 is never, but for what the noise variance learns of them.
/// limits : sequence, optional
///     A pair (lower, upper) or None for each parameter, as for `RecursiveArx`.
///
/// Notes
/// -----
/// The model is::
///
///     x(k) = sum over the inputs of B_i(q) / F(q) u_i(k) [+ constant / F(1)]
///     y(k) = x(k) + e(k)
///     F(q) = 1 + f_1 q^-1 + ... + f_nf q^-nf
///
/// F stays stable: a step that would lead out is shortened, and the action is "projected". A missing output corrects
/// nothing, and the model's own output goes on.
///
/// References
/// ----------
/// Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, sections 3.7.2 and 6.6. Young,
/// Recursive Estimation and Time-Series Analysis, 2nd ed., 2011, chapters 6 and 7.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import RecursiveArx, RecursiveOutputError
/// >>> draws = np.random.default_rng(1)
/// >>> u = draws.choice([-1.0, 1.0], 4000)
/// >>> x = np.zeros(4000)
/// >>> for k in range(1, 4000):
/// ...     x[k] = 0.9 * x[k - 1] + 0.2 * u[k - 1]
/// >>> y = x + 0.3 * draws.standard_normal(4000)
/// >>> model, biased = RecursiveOutputError(1, 1, forgetting=None), RecursiveArx(1, 1, forgetting=None)
/// >>> _, _ = model.run(y, u=u), biased.run(y, u=u)
/// >>> bool(abs(model.f[1] + 0.9) < 0.01), bool(biased.a[1] > -0.8)
/// (True, True)
#[pyclass(module = "thetahat", extends = RecursivePolynomials)]
pub(crate) struct RecursiveOutputError;

impl RecursiveOutputError {
    /// The object around what all have in common.
    pub(super) fn over(model: RecursiveModel) -> PyClassInitializer<Self> {
        PyClassInitializer::from(model).add_subclass(RecursivePolynomials).add_subclass(Self)
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursiveOutputError {
    #[new]
    #[pyo3(signature = (nf, nb, nk = None, forgetting = STANDARD, *, method = "prediction-error", constant = false,
        output_scale = 1.0, input_scales = None, parameters = None, covariance = None, dead_zone = 0.0, huber = f64::INFINITY, gate = f64::INFINITY, release = Whole(0), limits = None))]
    #[pyo3(
        text_signature = "(nf, nb, nk=1, forgetting=0.99, *, method='prediction-error', constant=False, output_scale=1.0, input_scales=None, parameters=None, covariance=None, dead_zone=0.0, huber=1e999, gate=1e999, release=0, limits=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        nf: Whole,
        nb: &Bound<'_, PyAny>,
        nk: Option<&Bound<'_, PyAny>>,
        forgetting: Memory,
        method: &str,
        constant: bool,
        output_scale: f64,
        input_scales: Option<&Bound<'_, PyAny>>,
        parameters: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
        dead_zone: f64,
        huber: f64,
        gate: f64,
        release: Whole,
        limits: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let one = 1_u8.into_pyobject(py)?.into_any();
        let (others, inputs) = orders(&[("nf", nf)], nb, nk.unwrap_or(&one))?;
        let nf = others.first().copied().unwrap_or_default();
        let orders = ArxOrders { na: nf, inputs: &inputs, constant };
        let scales = scales(input_scales, inputs.len())?;
        let method = match method {
            "prediction-error" => OutputErrorMethod::PredictionError,
            "instruments" => OutputErrorMethod::Instruments,
            _ => {
                return Err(PyValueError::new_err(format!(
                    "method: expected 'prediction-error' or 'instruments', found '{method}'"
                )));
            }
        };
        let outliers = recursive::outliers(huber, gate, release)?;
        let stepper = OutputError::new(&orders, method, output_scale, &scales, forgetting.0)
            .and_then(|stepper| stepper.with_dead_zone(dead_zone)?.with_outliers(outliers))
            .map_err(|error| failed(py, error))?;
        let given = StartingPoint { parameters, covariance, limits, limited: orders.parameters() };
        RecursiveModel::new(py, Stepper::OutputError(stepper), inputs.len(), &given).map(Self::over)
    }

    /// F(q): 1, f_1 ... f_nf.
    #[getter]
    fn f<'py>(model: PyRef<'py, Self>, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        match &model.as_super().as_super().engine.stepper {
            Stepper::OutputError(stepper) => recursive::coefficients(py, stepper.f()),
            Stepper::Arx(_) | Stepper::Armax(_) | Stepper::Narx(_) => {
                recursive::coefficients(py, std::iter::empty())
            }
        }
    }
}
