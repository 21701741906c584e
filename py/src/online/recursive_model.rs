//! What the recursive estimators of delay lines have in common: all but how they are made.

use std::ops::RangeInclusive;

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat::model::Functions;
use thetahat_core::nalgebra::{Const, DVector, Dyn};
use thetahat_core::{
    Covariance, Error, Innovation as StepInnovation, InputOrders, RecursiveArmax, RecursiveArx,
    RecursiveLeastSquares as LeastSquares, RecursiveNarx, RecursiveOutputError,
};

use super::argument::{self, LARGEST_SIZE, LONGEST_DELAY, Rows, Whole, count, failed, reserve};
use super::forgetting::Forgetting;
use super::held::renamed;
use super::innovation::{Innovation, list};
use super::limits::Limits;
use super::recursive::{self, Around, RecursiveTrajectory};
use super::{Reduced, snapshot};
use crate::array;

pub(super) type Arx = RecursiveArx<f64, Dyn, Dyn>;
pub(super) type Armax = RecursiveArmax<f64, Dyn, Dyn>;
pub(super) type OutputError = RecursiveOutputError<f64, Dyn, Dyn>;
pub(super) type Narx = RecursiveNarx<f64, Functions, Dyn, Dyn, Dyn>;

/// A stepper of one of the classes.
#[derive(Clone, Serialize, Deserialize)]
pub(super) enum Stepper {
    Arx(Arx),
    Armax(Armax),
    OutputError(OutputError),
    Narx(Narx),
}

/// The same for each kind of stepper.
macro_rules! each {
    ($engine:expr, $stepper:ident => $what:expr) => {
        match $engine {
            Stepper::Arx($stepper) => $what,
            Stepper::Armax($stepper) => $what,
            Stepper::OutputError($stepper) => $what,
            Stepper::Narx($stepper) => $what,
        }
    };
}

impl Stepper {
    fn class_name(&self) -> &'static str {
        match self {
            Stepper::Arx(_) => "RecursiveArx",
            Stepper::Armax(_) => "RecursiveArmax",
            Stepper::OutputError(_) => "RecursiveOutputError",
            Stepper::Narx(_) => "RecursiveNarx",
        }
    }

    fn keep_within(&mut self, limits: &[RangeInclusive<f64>]) -> Result<bool, Error> {
        each!(self, stepper => stepper.keep_within(limits))
    }

    /// What is given to start from.
    fn with(
        self,
        parameters: Option<DVector<f64>>,
        covariance: Option<Covariance<f64, Dyn>>,
    ) -> Result<Self, Error> {
        let with_parameters = match (self, parameters) {
            (same, None) => same,
            (Stepper::Arx(stepper), Some(given)) => Stepper::Arx(stepper.with_parameters(given)?),
            (Stepper::Armax(stepper), Some(given)) => Stepper::Armax(stepper.with_parameters(given)?),
            (Stepper::OutputError(stepper), Some(given)) => {
                Stepper::OutputError(stepper.with_parameters(given)?)
            }
            (Stepper::Narx(stepper), Some(given)) => Stepper::Narx(stepper.with_parameters(given)?),
        };
        Ok(match (with_parameters, covariance) {
            (same, None) => same,
            (Stepper::Arx(stepper), Some(given)) => Stepper::Arx(stepper.with_covariance(given)?),
            (Stepper::Armax(stepper), Some(given)) => Stepper::Armax(stepper.with_covariance(given)?),
            (Stepper::OutputError(stepper), Some(given)) => {
                Stepper::OutputError(stepper.with_covariance(given)?)
            }
            (Stepper::Narx(stepper), Some(given)) => Stepper::Narx(stepper.with_covariance(given)?),
        })
    }
}

/// The stepper, and how many inputs it has.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Engine {
    pub(super) stepper: Stepper,
    pub(super) inputs: usize,
    /// One for each parameter (but those of C), or none at all.
    limits: Limits,
}

impl Engine {
    fn measured(&mut self, output: f64) -> Result<StepInnovation<f64>, Error> {
        let innovation = each!(&mut self.stepper, stepper => stepper.measured(output))?;
        self.limits.after(innovation, |limits| self.stepper.keep_within(limits))
    }

    fn log_row(&mut self, output: f64, inputs: &[f64]) -> Result<StepInnovation<f64>, Error> {
        let innovation = each!(&mut self.stepper, stepper => stepper.log_row(output, inputs))?;
        self.limits.after(innovation, |limits| self.stepper.keep_within(limits))
    }
}

impl Around<Dyn, Const<1>> for Engine {
    fn estimator(&self) -> &LeastSquares<f64, Dyn> {
        each!(&self.stepper, stepper => stepper.estimator())
    }
}

/// A model of delay lines, estimated while the plant runs.
#[pyclass(module = "thetahat", name = "_RecursiveModel", subclass)]
pub(crate) struct RecursiveModel {
    pub(super) engine: Engine,
    inputs: Vec<f64>,
}

/// What all constructors take to start from.
pub(super) struct StartingPoint<'a, 'py> {
    pub(super) parameters: Option<&'a Bound<'py, PyAny>>,
    pub(super) covariance: Option<&'a Bound<'py, PyAny>>,
    pub(super) limits: Option<&'a Bound<'py, PyAny>>,
    /// How many of the parameters limits are of.
    pub(super) limited: usize,
}

impl RecursiveModel {
    fn of(engine: Engine) -> Self {
        RecursiveModel { inputs: vec![0.0; engine.inputs], engine }
    }

    /// A stepper with what is given to start from.
    pub(super) fn new(
        py: Python<'_>,
        stepper: Stepper,
        inputs: usize,
        given: &StartingPoint<'_, '_>,
    ) -> PyResult<Self> {
        let n = each!(&stepper, stepper => stepper.estimator()).parameters().len();
        let vector = |value| array::finite_vector("parameters", value, Some(n));
        let parameters = given.parameters.map(vector).transpose()?;
        let matrix = |value| argument::covariance("covariance", value, Some(n));
        let covariance = given.covariance.map(matrix).transpose()?;
        let mut stepper = stepper.with(parameters, covariance).map_err(|error| failed(py, error))?;
        let limits = Limits::new(given.limits, given.limited)?;
        if !limits.ranges().is_empty() {
            stepper.keep_within(limits.ranges()).map_err(|error| failed(py, error))?;
        }
        Ok(Self::of(Engine { stepper, inputs, limits }))
    }

    /// What was read back of an object of this class, checked.
    pub(super) fn restore(engine: Engine, class_name: &str) -> PyResult<Self> {
        let has = |input: usize| match &engine.stepper {
            Stepper::Arx(stepper) => stepper.b(input).is_some(),
            Stepper::Armax(stepper) => stepper.b(input).is_some(),
            Stepper::OutputError(stepper) => stepper.b(input).is_some(),
            Stepper::Narx(stepper) => stepper.model().lags_of(input).is_some(),
        };
        let fits = engine.inputs <= LONGEST_DELAY
            && !has(engine.inputs)
            && engine.inputs.checked_sub(1).is_none_or(has)
            && engine.stepper.class_name() == class_name;
        let wrong = || {
            PyValueError::new_err("not a snapshot: it has another number of inputs, or is of another class")
        };
        if fits { Ok(Self::of(engine)) } else { Err(wrong()) }
    }

    fn estimator(&self) -> &LeastSquares<f64, Dyn> {
        self.engine.estimator()
    }
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
    u: Option<&Bound<'py, PyAny>>,
    steps: Option<Whole>,
) -> PyResult<(Rows<'py>, usize)> {
    let steps = steps.map(|steps| count("steps", steps, 1, 10_000_000)).transpose()?;
    let rows = Rows::new("u", u, steps, inputs)?;
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
#[pyo3(crate = "crate::in_use")]
impl RecursiveModel {
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
    ///     If a number is infinite or too large, or an input acts on the output of its own sample (nk = 0): `update`
    ///     takes that. Nothing has changed then, time included.
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
        each!(&mut self.engine.stepper, stepper => stepper.applied(&self.inputs))
            .map_err(|error| failed(py, error))
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
    #[pyo3(signature = (y, u = None))]
    fn update(
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
    ///     As for `update`; the message names the row, from 1. Nothing has changed then.
    #[pyo3(signature = (y, u = None))]
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
    /// u : array_like, shape (steps,) for one input, or (steps, inputs); None without input
    ///     The inputs to come, as many as outputs. After `measured` of y(k) the first is u(k), which is still to be
    ///     chosen; after `applied` or `update` of u(k) it is u(k+1). (With nk = 1 the last one acts on nothing then,
    ///     but is there.)
    /// steps : int, optional
    ///     How many; it is needed without input only.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (steps,)
    ///     The predictions; NaN where one depends on a missing sample.
    #[pyo3(signature = (u = None, steps = None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        u: Option<&Bound<'py, PyAny>>,
        steps: Option<Whole>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (inputs, steps) = future(self.engine.inputs, u, steps)?;
        let mut outputs = reserve(&[steps])?;
        outputs.resize(steps, 0.0);
        let inputs = inputs.as_slice()?;
        each!(&self.engine.stepper, stepper => stepper.predict(inputs, &mut outputs))
            .map_err(|error| failed(py, error))?;
        Ok(PyArray1::from_vec(py, outputs))
    }

    /// Tell that an unknown number of samples is missing here.
    fn gap(&mut self) {
        each!(&mut self.engine.stepper, stepper => stepper.gap());
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
        match &self.engine.stepper {
            Stepper::Narx(stepper) => stepper.noise_variance(),
            _ => self.estimator().noise_variance(),
        }
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
        each!(&mut self.engine.stepper, stepper => stepper.set_adaptation(adapting));
    }

    fn __repr__(&self) -> String {
        let (n, inputs) = (self.estimator().parameters().len(), self.engine.inputs);
        let parameters = list(self.estimator().parameters().as_slice());
        format!("{}(n={n}, inputs={inputs}, parameters={parameters})", self.engine.stepper.class_name())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, self.engine.stepper.class_name(), &self.engine)
    }
}

/// A model with polynomials.
#[pyclass(module = "thetahat", name = "_RecursivePolynomials", extends = RecursiveModel, subclass)]
pub(crate) struct RecursivePolynomials;

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursivePolynomials {
    /// A(q): 1, a_1 ... a_na; of an output-error model 1.
    #[getter]
    fn a<'py>(model: PyRef<'py, Self>, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        match &model.as_super().engine.stepper {
            Stepper::Arx(stepper) => recursive::coefficients(py, stepper.a()),
            Stepper::Armax(stepper) => recursive::coefficients(py, stepper.a()),
            Stepper::OutputError(_) => recursive::coefficients(py, std::iter::once(1.0)),
            Stepper::Narx(_) => recursive::coefficients(py, std::iter::empty()),
        }
    }

    /// B(q) of each input, so that the i-th number multiplies q^-i: nk zeros, then b_0 ... b_(nb-1).
    #[getter]
    fn b<'py>(model: PyRef<'py, Self>, py: Python<'py>) -> Vec<Bound<'py, PyArray1<f64>>> {
        let engine = &model.as_super().engine;
        let each = |input| match &engine.stepper {
            Stepper::Arx(stepper) => Some(recursive::coefficients(py, stepper.b(input)?)),
            Stepper::Armax(stepper) => Some(recursive::coefficients(py, stepper.b(input)?)),
            Stepper::OutputError(stepper) => Some(recursive::coefficients(py, stepper.b(input)?)),
            Stepper::Narx(_) => None,
        };
        (0..engine.inputs).filter_map(each).collect()
    }

    /// The constant; None if the model has none.
    #[getter]
    fn constant(model: PyRef<'_, Self>) -> Option<f64> {
        match &model.as_super().engine.stepper {
            Stepper::Arx(stepper) => stepper.constant(),
            Stepper::Armax(stepper) => stepper.constant(),
            Stepper::OutputError(stepper) => stepper.constant(),
            Stepper::Narx(_) => None,
        }
    }
}
