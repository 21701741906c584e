//! A recursive ARX estimator of several outputs.

use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DVector, Dyn};
use thetahat_core::{ArxOrders, RecursiveLeastSquares as LeastSquares, RecursiveVectorArx as Stepper};

use super::argument::{self, Rows, Whole, failed, reserve};
use super::forgetting::{Forgetting, Memory, STANDARD};
use super::held::renamed;
use super::innovation::{Innovation, list};
use super::recursive::{self, Around, RecursiveTrajectory};
use super::recursive_model::{future, orders, scales};
use super::{Reduced, snapshot};
use crate::array;

/// The stepper, and how many inputs it has.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Engine {
    stepper: Stepper<f64, Dyn, Dyn, Dyn>,
    inputs: usize,
}

impl Around<Dyn, Dyn> for Engine {
    fn estimator(&self) -> &LeastSquares<f64, Dyn, Dyn> {
        self.stepper.estimator()
    }
}

/// An ARX model with several outputs, estimated while the plant runs.
///
/// Each output depends on the past of all. The equations share their regressors, P and the work on it; so a sample of
/// which one output is missing corrects nothing. `Tracker` takes several outputs too, with a memory for each.
///
/// Parameters
/// ----------
/// outputs : int
///     The number of outputs.
/// na : int
///     The number of past samples of each output.
/// nb : int or sequence of int
///     The number of coefficients of B. An int is one input, and 0 no input; a sequence has one for each input.
/// nk : int or sequence of int, default 1
///     The delay of each input; an int is the delay of all of them.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten. A float is exponential forgetting with that factor, None is no forgetting.
/// constant : bool, default False
///     Whether a constant is estimated for each output too, for signals that are not about 0.
/// output_scales, input_scales : float or array_like, optional
///     The typical magnitude of each output and of each input, in its own unit: 1 if not given.
/// start : {"standard", "exact", "mixed"}
///     As for `RecursiveLeastSquares`.
/// blend : int, optional
///     With "mixed", and only there: in how many samples the prior is taken out.
/// parameters : array_like, shape (n, outputs), optional
///     What to start from: a column for each output, with the na coefficients of the first output, of the next, then
///     b_0 ... of the first input, and of the next, then the constant.
/// covariance : array_like, shape (n, n), optional
///     P to start from, in units of the noise variances.
/// huber : float, default inf
///     From 1 on: an innovation of more than so many standard deviations corrects as much as one of so many, and the
///     action is "bounded". 3 loses next to nothing where there are no outliers.
/// gate : float, default inf
///     From 1 on: a sample whose normalised innovation squared is above it corrects nothing, and the action is "gated".
///     25 is five standard deviations. Huber's bound or a gate, not both.
/// release : int, default 0
///     After so many samples in a row above the gate, those that follow are used ("released"), until one is within it
///     again. 0 is never, but for what the noise variance learns of them.
///
/// Notes
/// -----
/// The model is::
///
///     A(q) y(k) = sum over the inputs of B_i(q) u_i(k) [+ constant] + e(k)
///     A(q) = I + A_1 q^-1 + ... + A_na q^-na
///
/// with matrices A_1 ... of a row and a column for each output. A missing sample is NaN.
///
/// References
/// ----------
/// Ljung, System Identification, 2nd ed., 1999, sections 4.2 and 11.2.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import RecursiveVectorArx
/// >>> tanks = RecursiveVectorArx(2, 1, 1, forgetting=0.98)
/// >>> y = np.zeros(2)
/// >>> for k in range(300):
/// ...     innovation = tanks.measured(y)
/// ...     u = 1.0 if k % 7 < 3 else -1.0
/// ...     tanks.applied(u)
/// ...     y = np.array([0.8 * y[0] + 0.5 * u, 0.1 * y[0] + 0.9 * y[1]])
/// >>> tanks.a.round(3)[1] + 0.0
/// array([[-0.8,  0. ],
///        [-0.1, -0.9]])
/// >>> tanks.b[0].round(3)[1]
/// array([0.5, 0. ])
#[pyclass(module = "thetahat")]
pub(crate) struct RecursiveVectorArx {
    engine: Engine,
    inputs: Vec<f64>,
    outputs: DVector<f64>,
}

impl RecursiveVectorArx {
    pub(crate) fn of(engine: Engine) -> PyResult<Self> {
        let outputs = engine.estimator().parameters().ncols();
        let has = |input: usize| engine.stepper.b(0, input).is_some();
        if has(engine.inputs) || !engine.inputs.checked_sub(1).is_none_or(has) {
            return Err(pyo3::exceptions::PyValueError::new_err(
                "not a snapshot: it has another number of inputs",
            ));
        }
        Ok(Self { inputs: vec![0.0; engine.inputs], outputs: DVector::zeros(outputs), engine })
    }

    /// Reads y(k) into its place.
    fn measure(&mut self, y: &Bound<'_, PyAny>) -> PyResult<()> {
        let read = array::vector("y", y, Some(self.outputs.len()))?;
        self.outputs.as_mut_slice().copy_from_slice(read.as_slice()?);
        Ok(())
    }

    fn estimator(&self) -> &LeastSquares<f64, Dyn, Dyn> {
        self.engine.estimator()
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursiveVectorArx {
    #[new]
    #[pyo3(signature = (outputs, na, nb, nk = None, forgetting = STANDARD, *, constant = false, output_scales = None,
        input_scales = None, start = "standard", blend = None, parameters = None, covariance = None,
        huber = f64::INFINITY, gate = f64::INFINITY, release = Whole(0)))]
    #[pyo3(
        text_signature = "(outputs, na, nb, nk=1, forgetting=0.99, *, constant=False, output_scales=None, input_scales=None, start='standard', blend=None, parameters=None, covariance=None, huber=1e999, gate=1e999, release=0)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        outputs: Whole,
        na: Whole,
        nb: &Bound<'_, PyAny>,
        nk: Option<&Bound<'_, PyAny>>,
        forgetting: Memory,
        constant: bool,
        output_scales: Option<&Bound<'_, PyAny>>,
        input_scales: Option<&Bound<'_, PyAny>>,
        start: &str,
        blend: Option<Whole>,
        parameters: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
        huber: f64,
        gate: f64,
        release: Whole,
    ) -> PyResult<Self> {
        let outputs = argument::size("outputs", outputs)?;
        let one = 1_u8.into_pyobject(py)?.into_any();
        let (others, inputs) = orders(&[("na", na)], nb, nk.unwrap_or(&one))?;
        let orders = ArxOrders { na: others.iter().sum(), inputs: &inputs, constant };
        let n = orders.parameters_of(outputs);
        argument::check_size("outputs, na and nb: the parameters of each output", n)?;
        let mut of_outputs = DVector::from_element(outputs, 1.0);
        if let Some(scales) = output_scales {
            argument::sample("output_scales", scales, outputs, of_outputs.as_mut_slice())?;
        }
        let of_inputs = scales(input_scales, inputs.len())?;
        let start = recursive::start(start, blend, parameters.is_some() || covariance.is_some())?;
        let outliers = recursive::outliers(huber, gate, release)?;
        let parameters = match parameters {
            Some(given) => Some(array::finite_matrix("parameters", given, [Some(n), Some(outputs)])?),
            None => None,
        };
        let covariance =
            covariance.map(|given| argument::covariance("covariance", given, Some(n))).transpose()?;
        let stepper = Stepper::new(&orders, &of_outputs, &of_inputs, forgetting.0)
            .and_then(|stepper| stepper.with_start(start)?.with_outliers(outliers))
            .and_then(|stepper| match parameters {
                Some(parameters) => stepper.with_parameters(parameters),
                None => Ok(stepper),
            })
            .and_then(|stepper| match covariance {
                Some(covariance) => stepper.with_covariance(covariance),
                None => Ok(stepper),
            })
            .map_err(|error| failed(py, error))?;
        Self::of(Engine { stepper, inputs: inputs.len() })
    }

    /// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were `applied` before.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (outputs,)
    ///     The outputs. NaN is a missing sample.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     What was not predicted, and what was done.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number infinite or too large, or an input acts on the outputs of its own sample (nk =
    ///     0): `update` takes that. Nothing has changed then, time included.
    fn measured(&mut self, py: Python<'_>, y: &Bound<'_, PyAny>) -> PyResult<Innovation> {
        self.measure(y)?;
        let innovation = self.engine.stepper.measured(&self.outputs).map_err(|error| failed(py, error))?;
        Ok(Innovation::vector(innovation))
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

    /// Take one row of a log: y(k) and u(k), recorded at the same instant; see `RecursiveArx.update`.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (outputs,)
    ///     The outputs. NaN is a missing sample.
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
    #[pyo3(signature = (y, u = None))]
    fn update(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Innovation> {
        let none = py.None().into_bound(py);
        argument::sample("u", u.unwrap_or(&none), self.engine.inputs, &mut self.inputs)?;
        self.measure(y)?;
        let taken = self.engine.stepper.log_row(&self.outputs, &self.inputs);
        Ok(Innovation::vector(taken.map_err(|error| failed(py, error))?))
    }

    /// The name that `update` had. Deprecated.
    #[pyo3(signature = (y, *, u = None))]
    fn log_row(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Innovation> {
        renamed(py, "log_row(y, u=u)", "update(y, u)")?;
        self.update(py, y, u)
    }

    /// Take many rows of a log: the same as `update` in a loop, to the bit.
    ///
    /// The interpreter lock is released meanwhile.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (N, outputs)
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
    ///     As for `update`; the message names the row, from 1. Nothing has changed then.
    #[pyo3(signature = (y, u = None))]
    fn run(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<RecursiveTrajectory> {
        let (n, l) = self.estimator().parameters().shape();
        let outputs = array::matrix("y", y, [None, Some(l)])?;
        let (rows, columns) = (outputs.shape()[0], self.engine.inputs);
        let outputs = outputs.as_slice()?;
        let inputs = Rows::new("u", u, Some(rows), columns)?;
        let inputs = inputs.as_slice()?;
        let (engine, mut measured) = (self.engine.clone(), self.outputs.clone());
        let (engine, trajectory) = recursive::run(py, [rows, n, l], |record| {
            record.run(engine, rows, |engine, row, record| {
                measured.as_mut_slice().copy_from_slice(argument::row(outputs, row, l));
                record.take_all(&engine.stepper.log_row(&measured, argument::row(inputs, row, columns))?);
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
    /// u : array_like, shape (steps,) for one input, or (steps, inputs); None without input
    ///     The inputs to come, as many as samples; which is the first is said at `RecursiveArx.predict`.
    /// steps : int, optional
    ///     How many; it is needed without input only.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (steps, outputs)
    ///     The predictions; NaN where one depends on a missing sample.
    #[pyo3(signature = (u = None, steps = None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        u: Option<&Bound<'py, PyAny>>,
        steps: Option<Whole>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (inputs, steps) = future(self.engine.inputs, u, steps)?;
        let l = self.outputs.len();
        let mut outputs = reserve(&[steps, l])?;
        outputs.resize(steps * l, 0.0);
        let predicted = self.engine.stepper.predict(inputs.as_slice()?, &mut outputs);
        predicted.map_err(|error| failed(py, error))?;
        argument::shaped(py, outputs, [steps, l])
    }

    /// Tell that an unknown number of samples is missing here.
    fn gap(&mut self) {
        self.engine.stepper.gap();
    }

    /// A(q), shape (na + 1, outputs, outputs): I, A_1 ... A_na.
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let l = self.outputs.len();
        let entry = |row: usize, column: usize| self.engine.stepper.a(row, column).into_iter().flatten();
        let lags = entry(0, 0).count();
        let mut entries = reserve(&[lags, l, l])?;
        for lag in 0..lags {
            for row in 0..l {
                entries.extend((0..l).filter_map(|column| entry(row, column).nth(lag)));
            }
        }
        argument::shaped(py, entries, [lags, l, l])
    }

    /// B(q) of each input, shape (nk + nb, outputs), so that the i-th row multiplies q^-i: nk rows of zeros, then b_0
    /// ... b_(nb-1).
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let l = self.outputs.len();
        let each = |input: usize| {
            let entry = |row: usize| self.engine.stepper.b(row, input).into_iter().flatten();
            let lags = entry(0).count();
            let mut entries = reserve(&[lags, l])?;
            for lag in 0..lags {
                entries.extend((0..l).filter_map(|row| entry(row).nth(lag)));
            }
            argument::shaped(py, entries, [lags, l])
        };
        (0..self.engine.inputs).map(each).collect()
    }

    /// The constants, shape (outputs,); None if the model has none.
    #[getter]
    fn constant<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        let each = (0..self.outputs.len()).map(|row| self.engine.stepper.constant(row));
        let all = each.collect::<Option<Vec<f64>>>()?;
        Some(argument::from_vector(py, &DVector::from_vec(all)).into_any())
    }

    /// The parameters, shape (n, outputs), in the order of the regressor.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        recursive::parameters(py, self.estimator())
    }

    /// P, shape (n, n): the covariance of the parameters in units of the noise variances.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        recursive::covariance(py, self.estimator())
    }

    /// The covariance of the parameters of each output, shape (outputs, n, n); None until the noise variances are
    /// known.
    #[getter]
    fn parameter_covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        recursive::parameter_covariance(py, self.estimator())
    }

    /// The standard errors, shape (n, outputs); None until the noise variances are known.
    #[getter]
    fn standard_errors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        recursive::standard_errors(py, self.estimator())
    }

    /// The variances of the noise, shape (outputs,); None until enough samples are in.
    #[getter]
    fn noise_variance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        self.estimator().noise_variances().map(|all| argument::from_vector(py, &all).into_any())
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

    /// How many of the latest samples are outliers by the rule for them, since the last one that is not.
    #[getter]
    fn outliers_in_a_row(&self) -> u16 {
        self.estimator().outliers_in_a_row()
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
        let (n, outputs) = self.estimator().parameters().shape();
        let parameters = list(self.estimator().parameters().as_slice());
        let inputs = self.engine.inputs;
        format!("RecursiveVectorArx(n={n}, outputs={outputs}, inputs={inputs}, parameters={parameters})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "RecursiveVectorArx", &self.engine)
    }
}
