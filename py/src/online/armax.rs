//! A recursive ARMAX estimator.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Const, Dyn};
use thetahat_core::{
    ArmaxMethod, ArmaxOrders, Error, Innovation as StepInnovation, RecursiveArmax as Stepper,
    RecursiveLeastSquares as LeastSquares,
};

use super::argument::{self, Rows, Whole, failed, room};
use super::arx::{check_inputs, future, orders, scales};
use super::forgetting::{Forgetting, Memory, STANDARD};
use super::innovation::{Innovation, list};
use super::limits::Limits;
use super::recursive::{self, Around, RecursiveTrajectory};
use super::{Reduced, snapshot};
use crate::array;

/// The stepper, and how many inputs it has.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Engine {
    stepper: Stepper<f64, Dyn, Dyn>,
    inputs: usize,
    /// One for each parameter but those of C, or none at all.
    limits: Limits,
}

impl Engine {
    fn measured(&mut self, output: f64) -> Result<StepInnovation<f64>, Error> {
        let innovation = self.stepper.measured(output)?;
        self.limits.after(innovation, |limits| self.stepper.keep_within(limits))
    }

    fn log_row(&mut self, output: f64, inputs: &[f64]) -> Result<StepInnovation<f64>, Error> {
        let innovation = self.stepper.log_row(output, inputs)?;
        self.limits.after(innovation, |limits| self.stepper.keep_within(limits))
    }
}

impl Around<Dyn, Const<1>> for Engine {
    fn estimator(&self) -> &LeastSquares<f64, Dyn> {
        self.stepper.estimator()
    }
}

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
/// limits : sequence, optional
///     A pair (lower, upper) or None for each parameter of A, B and the constant, such as the sign of a gain that a controller divides by. What an
///     update leads out is taken back to the nearest point within, in the metric of P, so that the other parameters make up
///     for it; the action is "projected" then.
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
#[pyclass(module = "thetahat")]
pub(crate) struct RecursiveArmax {
    engine: Engine,
    inputs: Vec<f64>,
}

impl RecursiveArmax {
    pub(crate) fn of(engine: Engine) -> Self {
        RecursiveArmax { inputs: vec![0.0; engine.inputs], engine }
    }

    /// What was read back, checked.
    pub(crate) fn restore(engine: Engine) -> PyResult<Self> {
        check_inputs(engine.inputs, |input| engine.stepper.b(input).is_some())?;
        Ok(Self::of(engine))
    }

    fn estimator(&self) -> &LeastSquares<f64, Dyn> {
        self.engine.stepper.estimator()
    }
}

#[pymethods]
impl RecursiveArmax {
    #[new]
    #[pyo3(signature = (na, nb, nc, nk = None, forgetting = STANDARD, *, method = "extended-least-squares",
        constant = false, output_scale = 1.0, input_scales = None, noise_scale = 1.0, parameters = None, covariance = None,
        dead_zone = 0.0, limits = None))]
    #[pyo3(
        text_signature = "(na, nb, nc, nk=1, forgetting=0.99, *, method='extended-least-squares', constant=False, output_scale=1.0, input_scales=None, noise_scale=1.0, parameters=None, covariance=None, dead_zone=0.0, limits=None)"
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
        limits: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
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
        let say = |error| failed(py, error);
        let n = orders.parameters();
        let mut stepper = Stepper::new(&orders, method, output_scale, &scales, noise_scale, forgetting.0)
            .and_then(|stepper| stepper.with_dead_zone(dead_zone))
            .map_err(say)?;
        if let Some(parameters) = parameters {
            let parameters = array::finite_vector("parameters", parameters, Some(n))?;
            stepper = stepper.with_parameters(parameters).map_err(say)?;
        }
        if let Some(covariance) = covariance {
            let covariance = argument::covariance("covariance", covariance, Some(n))?;
            stepper = stepper.with_covariance(covariance).map_err(say)?;
        }
        let limits = Limits::new(limits, n - each(1))?;
        if !limits.ranges().is_empty() {
            stepper.keep_within(limits.ranges()).map_err(say)?;
        }
        Ok(RecursiveArmax::of(Engine { stepper, inputs: inputs.len(), limits }))
    }

    /// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were `applied` before.
    ///
    /// A controller writes `measured(y)`, computes its input, and writes `applied(u)`, in the order in which things
    /// happen. A call that is left out is a missing sample: time goes on all the same.
    ///
    /// Parameters
    /// ----------
    /// y : float
    ///     The output. NaN is a missing sample.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     What was not predicted, and what was done.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a number is infinite or too large, or an input acts on the output of its own sample (nk = 0): `log_row` takes
    ///     that. Nothing has changed then, time included.
    fn measured(&mut self, py: Python<'_>, y: &Bound<'_, PyAny>) -> PyResult<Innovation> {
        let output = argument::number("y", y)?;
        let innovation = self.engine.measured(output).map_err(|error| failed(py, error))?;
        Ok(innovation.into())
    }

    /// u(k): what acts on the plant from now on, until the next measurement.
    ///
    /// Parameters
    /// ----------
    /// u : float, or array_like with one number for each input
    ///     The inputs, as the plant got them, so after all limits. NaN is a missing sample.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number infinite or too large. Nothing has changed then.
    fn applied(&mut self, py: Python<'_>, u: &Bound<'_, PyAny>) -> PyResult<()> {
        argument::sample("u", u, self.engine.inputs, &mut self.inputs)?;
        self.engine.stepper.applied(&self.inputs).map_err(|error| failed(py, error))
    }

    /// Take one row of a log: y(k) and u(k), recorded at the same instant.
    ///
    /// It is `measured(y)` and then `applied(u)`, to the bit, where every nk is at least 1; with nk = 0 it is the call
    /// that there is. It is not the one for a controller that knows u(k-1) when y(k) arrives.
    ///
    /// Parameters
    /// ----------
    /// y : float
    ///     The output. NaN is a missing sample.
    /// u : float, or array_like with one number for each input; None without input
    ///     The inputs. NaN is a missing sample.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     What was not predicted, and what was done.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number infinite or too large. Nothing has changed then, time included.
    #[pyo3(signature = (y, *, u = None))]
    fn log_row(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Innovation> {
        let none = py.None().into_bound(py);
        argument::sample("u", u.unwrap_or(&none), self.engine.inputs, &mut self.inputs)?;
        let output = argument::number("y", y)?;
        let innovation = self.engine.log_row(output, &self.inputs).map_err(|error| failed(py, error))?;
        Ok(innovation.into())
    }

    /// Take many rows of a log: the same as `log_row` in a loop, to the bit.
    ///
    /// The interpreter lock is released meanwhile.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (N,)
    ///     The outputs.
    /// u : array_like, shape (N,) for one input, or (N, inputs); None without input
    ///     The inputs, recorded at the same instants.
    ///
    /// Returns
    /// -------
    /// RecursiveTrajectory
    ///     Parameters and innovations, row by row.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As for `log_row`; the message names the row, from 0. Nothing has changed then.
    #[pyo3(signature = (y, *, u = None))]
    fn run(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<RecursiveTrajectory> {
        let outputs = array::vector("y", y, None)?;
        let outputs = outputs.as_slice()?;
        let (rows, columns) = (outputs.len(), self.engine.inputs);
        let inputs = Rows::new("u", u, Some(rows), columns)?;
        let inputs = inputs.as_slice()?;
        let (engine, shape) = (self.engine.clone(), [rows, self.estimator().parameters().len(), 1]);
        let (engine, trajectory) = recursive::run(py, shape, |record| {
            record.run(engine, rows, |engine, row, record| {
                let output = outputs.get(row).copied().unwrap_or(f64::NAN);
                record.take(&engine.log_row(output, argument::row(inputs, row, columns))?);
                Ok(())
            })
        })?;
        self.engine = engine;
        Ok(trajectory)
    }

    /// Predict the outputs to come, y(k+1), y(k+2), ..., y(k) being the latest one.
    ///
    /// Parameters
    /// ----------
    /// future_inputs : array_like, shape (steps,) for one input, or (steps, inputs); None without input
    ///     The inputs to come, as many as outputs. After `measured` of y(k) the first is u(k), which is still to be chosen;
    ///     after `applied` or `log_row` of u(k) it is u(k+1). (With nk = 1 the last one acts on nothing then, but is there.)
    /// steps : int, optional
    ///     How many; it is needed without input only.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (steps,)
    ///     The predictions; NaN where one depends on a missing sample.
    #[pyo3(signature = (future_inputs = None, steps = None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        future_inputs: Option<&Bound<'py, PyAny>>,
        steps: Option<Whole>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (inputs, steps) = future(self.engine.inputs, future_inputs, steps)?;
        let mut outputs = room(&[steps])?;
        outputs.resize(steps, 0.0);
        self.engine.stepper.predict(inputs.as_slice()?, &mut outputs).map_err(|error| failed(py, error))?;
        Ok(PyArray1::from_vec(py, outputs))
    }

    /// Tell that an unknown number of samples is missing here.
    fn gap(&mut self) {
        self.engine.stepper.gap();
    }

    /// A(q): 1, a_1 ... a_na.
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        recursive::coefficients(py, self.engine.stepper.a())
    }

    /// B(q) of each input, so that the i-th number multiplies q^-i: nk zeros, then b_0 ... b_(nb-1).
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray1<f64>>> {
        let each = (0..self.engine.inputs).filter_map(|input| self.engine.stepper.b(input));
        each.map(|coefficients| recursive::coefficients(py, coefficients)).collect()
    }

    /// C(q): 1, c_1 ... c_nc.
    #[getter]
    fn c<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        recursive::coefficients(py, self.engine.stepper.c())
    }

    /// The constant; None if the model has none.
    #[getter]
    fn constant(&self) -> Option<f64> {
        self.engine.stepper.constant()
    }

    /// The parameters, shape (n,), in the order of the regressor.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        recursive::parameters(py, self.estimator())
    }

    /// P, shape (n, n): the covariance of the parameters in units of the noise variance.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        recursive::covariance(py, self.estimator())
    }

    /// The covariance of the parameters, shape (n, n); None until the noise variance is known.
    #[getter]
    fn parameter_covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        recursive::parameter_covariance(py, self.estimator())
    }

    /// The standard errors, shape (n,); None until the noise variance is known.
    #[getter]
    fn standard_errors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        recursive::standard_errors(py, self.estimator())
    }

    /// The variance of the noise; None until enough samples are in.
    #[getter]
    fn noise_variance(&self) -> Option<f64> {
        self.estimator().noise_variance()
    }

    /// How much the samples in the memory tell of the parameter they tell least of, 0 to 1.
    #[getter]
    fn excitation(&self) -> f64 {
        self.estimator().excitation()
    }

    /// The forgetting policy.
    #[getter]
    fn forgetting(&self) -> Forgetting {
        Forgetting { policy: self.estimator().forgetting() }
    }

    /// The limits of the parameters, a pair (lower, upper) each; None if there are none.
    #[getter]
    fn limits(&self) -> Option<Vec<(f64, f64)>> {
        self.engine.limits.pairs()
    }

    /// Whether samples correct the estimate. Set it to turn that off and on; samples are taken in all the same.
    #[getter]
    fn adapting(&self) -> bool {
        self.estimator().is_adapting()
    }

    #[setter]
    fn set_adapting(&mut self, adapting: bool) {
        self.engine.stepper.set_adaptation(adapting);
    }

    fn __repr__(&self) -> String {
        let (n, inputs) = (self.estimator().parameters().len(), self.engine.inputs);
        let parameters = list(self.estimator().parameters().as_slice());
        format!("RecursiveArmax(n={n}, inputs={inputs}, parameters={parameters})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "RecursiveArmax", &self.engine)
    }
}
