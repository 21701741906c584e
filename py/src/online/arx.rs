//! A recursive ARX estimator.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Const, Dyn};
use thetahat_core::{
    ArxOrders, Error, Innovation as StepInnovation, InputOrders, RecursiveArx as Stepper,
    RecursiveLeastSquares as LeastSquares,
};

use super::argument::{self, LARGEST_SIZE, LONGEST_DELAY, Rows, Whole, count, failed, room};
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
    /// One for each parameter, or none at all.
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
/// limits : sequence, optional
///     A pair (lower, upper) or None for each parameter, such as the sign of a gain that a controller divides by. What an
///     update leads out is taken back to the nearest point within, in the metric of P, so that the other parameters make up
///     for it; the action is "projected" then.
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
#[pyclass(module = "thetahat")]
pub(crate) struct RecursiveArx {
    engine: Engine,
    inputs: Vec<f64>,
}

impl RecursiveArx {
    pub(crate) fn of(engine: Engine) -> Self {
        RecursiveArx { inputs: vec![0.0; engine.inputs], engine }
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

/// That a stepper that was read back has so many inputs.
pub(crate) fn check_inputs(inputs: usize, has: impl Fn(usize) -> bool) -> PyResult<()> {
    let fits = inputs <= LONGEST_DELAY && !has(inputs) && inputs.checked_sub(1).is_none_or(has);
    fits.then_some(()).ok_or_else(|| PyValueError::new_err("not a snapshot: it has another number of inputs"))
}

/// The orders of the inputs, and how many parameters there are with `others`.
pub(crate) fn orders(
    others: &[(&str, Whole)],
    nb: &Bound<'_, PyAny>,
    nk: &Bound<'_, PyAny>,
) -> PyResult<(Vec<usize>, Vec<InputOrders>)> {
    let most = LARGEST_SIZE;
    let others: Vec<usize> =
        others.iter().map(|&(name, value)| count(name, value, 0, most)).collect::<PyResult<_>>()?;
    let each = |name: &str, value: &Bound<'_, PyAny>, most| -> PyResult<Vec<usize>> {
        let values: Vec<Whole> = value.extract()?;
        values.into_iter().map(|value| count(name, value, 0, most)).collect()
    };
    let nb = if argument::is_number(nb) {
        match count("nb", nb.extract()?, 0, most)? {
            0 => Vec::new(),
            nb => vec![nb],
        }
    } else {
        each("nb", nb, most)?
    };
    let nk = if argument::is_number(nk) {
        vec![count("nk", nk.extract()?, 0, LONGEST_DELAY)?; nb.len()]
    } else {
        each("nk", nk, LONGEST_DELAY)?
    };
    if nk.len() != nb.len() {
        return Err(PyValueError::new_err(format!(
            "nk: expected an int, or one for each of {} inputs, found {}",
            nb.len(),
            nk.len()
        )));
    }
    argument::check_size(
        "na, nb (and nc): the parameters",
        others.iter().sum::<usize>() + nb.iter().sum::<usize>(),
    )?;
    if nk.iter().sum::<usize>() > LONGEST_DELAY {
        return Err(PyValueError::new_err(format!("nk: expected at most {LONGEST_DELAY} samples in all")));
    }
    Ok((others, nb.into_iter().zip(nk).map(|(nb, nk)| InputOrders { nb, nk }).collect()))
}

/// One scale for each input.
pub(crate) fn scales(value: Option<&Bound<'_, PyAny>>, inputs: usize) -> PyResult<Vec<f64>> {
    let mut scales = vec![1.0; inputs];
    if let Some(value) = value {
        argument::sample("input_scales", value, inputs, &mut scales)?;
    }
    Ok(scales)
}

/// The inputs to come, and how many samples they are.
pub(crate) fn future<'py>(
    inputs: usize,
    future_inputs: Option<&Bound<'py, PyAny>>,
    steps: Option<Whole>,
) -> PyResult<(Rows<'py>, usize)> {
    let steps = steps.map(|steps| count("steps", steps, 1, 10_000_000)).transpose()?;
    let rows = Rows::new("future_inputs", future_inputs, steps, inputs)?;
    match (inputs, steps) {
        (0, None) => Err(PyValueError::new_err("steps: expected an int, as there is no input")),
        (0, Some(steps)) => Ok((rows, steps)),
        _ => {
            let found = rows.as_slice()?.len() / inputs;
            Ok((rows, found))
        }
    }
}

#[pymethods]
impl RecursiveArx {
    #[new]
    #[pyo3(signature = (na, nb, nk = None, forgetting = STANDARD, *, constant = false, output_scale = 1.0,
        input_scales = None, start = "standard", blend = None, parameters = None, covariance = None, dead_zone = 0.0, limits = None))]
    #[pyo3(
        text_signature = "(na, nb, nk=1, forgetting=0.99, *, constant=False, output_scale=1.0, input_scales=None, start='standard', blend=None, parameters=None, covariance=None, dead_zone=0.0, limits=None)"
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
        limits: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let one = 1_u8.into_pyobject(py)?.into_any();
        let (others, inputs) = orders(&[("na", na)], nb, nk.unwrap_or(&one))?;
        let orders = ArxOrders { na: others.iter().sum(), inputs: &inputs, constant };
        let scales = scales(input_scales, inputs.len())?;
        let start = recursive::start(start, blend, parameters.is_some() || covariance.is_some())?;
        let say = |error| failed(py, error);
        let n = orders.parameters();
        let mut stepper = Stepper::new(&orders, output_scale, &scales, forgetting.0)
            .and_then(|stepper| stepper.with_start(start))
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
        let limits = Limits::new(limits, n)?;
        if !limits.ranges().is_empty() {
            stepper.keep_within(limits.ranges()).map_err(say)?;
        }
        Ok(RecursiveArx::of(Engine { stepper, inputs: inputs.len(), limits }))
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
        format!("RecursiveArx(n={n}, inputs={inputs}, parameters={parameters})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "RecursiveArx", &self.engine)
    }
}
