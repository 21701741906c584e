//! Recursive least squares.

use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Const, DVector, Dyn};
use thetahat_core::{Covariance, Dimension, Error, RecursiveLeastSquares as Stepper};

use super::argument::{self, Whole, failed};
use super::forgetting::{Forgetting, Memory, STANDARD};
use super::innovation::{Innovation, list};
use super::recursive::{self, Around, Record, RecursiveTrajectory};
use super::{Reduced, Stop, snapshot};
use crate::array;

/// One output is a type of its own: it needs no memory in a step.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) enum Engine {
    One(Stepper<f64, Dyn>),
    Many(Stepper<f64, Dyn, Dyn>),
}

/// The same with an estimator of one output or of several.
macro_rules! either {
    ($engine:expr, $estimator:ident => $what:expr) => {
        match $engine {
            Engine::One($estimator) => $what,
            Engine::Many($estimator) => $what,
        }
    };
}

impl<N: Dimension + Dimension<M>, M: Dimension> Around<N, M> for Stepper<f64, N, M> {
    fn estimator(&self) -> &Stepper<f64, N, M> {
        self
    }
}

/// Recursive least squares: a regressor and an output in each sample, the parameters out at any time.
///
/// Parameters
/// ----------
/// n : int
///     The number of regressors, 1 to 4096.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten. A float is exponential forgetting with that factor, None is no forgetting.
/// scales : array_like, shape (n,), optional
///     The typical magnitude of each regressor, in its own unit. They set the prior and the bound of the variances,
///     P_jj <= 100 / scale_j ** 2. None takes all of them for 1: then give regressors of that size. A factor of 3
///     does not matter.
/// outputs : int, default 1
///     The number of outputs that share the regressor.
/// start : {"standard", "exact", "mixed"}
///     "standard": with the prior. "exact": regressors are collected until they have full rank, then the start is the
///     least squares solution. "mixed": with the prior, which is taken out once the regressors weigh enough.
/// blend : int, optional
///     With "mixed", and only there: in how many samples the prior is taken out, 0 to 65535.
/// parameters : array_like, shape (n,) or (n, outputs), optional
///     What to start from, 0 if not given.
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
///
/// Raises
/// ------
/// ValueError
///     If an argument is out of its range, or has the wrong shape.
///
/// Notes
/// -----
/// For exponential forgetting with the factor l::
///
///     y(k) = phi(k)' theta + e(k)
///     e = y - phi' theta,     s = l + phi' P phi
///     theta <- theta + P phi e / s,     P <- (P - P phi phi' P / s) / l
///
/// P is kept as factors U D U'. An object is for one thread at a time: a call from another one raises RuntimeError.
///
/// References
/// ----------
/// Ljung, System Identification, 2nd ed., 1999, section 11.2. Bierman, Factorization Methods for Discrete Sequential
/// Estimation, 1977, chapter V.
///
/// Examples
/// --------
/// >>> from thetahat import RecursiveLeastSquares
/// >>> line = RecursiveLeastSquares(2, None, start="exact")
/// >>> for x in range(5):
/// ...     innovation = line.update([x, 1.0], 3.0 * x + 2.0)
/// >>> line.parameters.round(9)
/// array([3., 2.])
#[pyclass(module = "thetahat")]
pub(crate) struct RecursiveLeastSquares {
    engine: Engine,
    regressor: DVector<f64>,
}

impl RecursiveLeastSquares {
    pub(crate) fn of(engine: Engine) -> Self {
        let n = either!(&engine, estimator => estimator.parameters().nrows());
        RecursiveLeastSquares { engine, regressor: DVector::zeros(n) }
    }
}

/// With these parameters, column by column, this P and this dead zone.
fn warm<M: Dimension>(
    estimator: Stepper<f64, Dyn, M>,
    outputs: M,
    parameters: Option<Vec<f64>>,
    covariance: Option<Covariance<f64, Dyn>>,
    dead_zone: f64,
) -> Result<Stepper<f64, Dyn, M>, Error>
where
    Dyn: Dimension<M>,
{
    let mut estimator = estimator.with_dead_zone(dead_zone)?;
    if let Some(parameters) = parameters {
        let mut matrix = Dyn(estimator.parameters().nrows()).rows_by(outputs, 0.0);
        matrix.as_mut_slice().copy_from_slice(&parameters);
        estimator = estimator.with_parameters(matrix)?;
    }
    match covariance {
        Some(covariance) => estimator.with_covariance(covariance),
        None => Ok(estimator),
    }
}

/// Takes many samples of one output, with a usual size as a type: that gives the same bits several times as fast.
fn run_one(
    estimator: &Stepper<f64, Dyn>,
    regressors: &[f64],
    outputs: &[f64],
    record: &mut Record<'_>,
) -> Result<Stepper<f64, Dyn>, Stop> {
    match estimator.parameters().len() {
        1 => run_sized(estimator, Const::<1>, regressors, outputs, record),
        2 => run_sized(estimator, Const::<2>, regressors, outputs, record),
        3 => run_sized(estimator, Const::<3>, regressors, outputs, record),
        4 => run_sized(estimator, Const::<4>, regressors, outputs, record),
        5 => run_sized(estimator, Const::<5>, regressors, outputs, record),
        6 => run_sized(estimator, Const::<6>, regressors, outputs, record),
        7 => run_sized(estimator, Const::<7>, regressors, outputs, record),
        8 => run_sized(estimator, Const::<8>, regressors, outputs, record),
        9 => run_sized(estimator, Const::<9>, regressors, outputs, record),
        10 => run_sized(estimator, Const::<10>, regressors, outputs, record),
        n => run_sized(estimator, Dyn(n), regressors, outputs, record),
    }
}

fn run_sized<N: Dimension + Dimension<Const<1>>>(
    estimator: &Stepper<f64, Dyn>,
    size: N,
    regressors: &[f64],
    outputs: &[f64],
    record: &mut Record<'_>,
) -> Result<Stepper<f64, Dyn>, Stop> {
    let n = size.value();
    // The size is that of the estimator, so that only a row can fail.
    let sized = estimator.to_size(size).map_err(|error| (0, error))?;
    let mut regressor = sized.parameters().clone();
    let sized = record.run(sized, outputs.len(), |estimator, row, record| {
        regressor.as_mut_slice().copy_from_slice(argument::row(regressors, row, n));
        let output = outputs.get(row).copied().unwrap_or(f64::NAN);
        record.take(&estimator.update(&regressor, output)?);
        Ok(())
    })?;
    Ok(sized.to_size(Dyn(n)).map_err(|error| (0, error))?)
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursiveLeastSquares {
    #[new]
    #[pyo3(signature = (n, forgetting = STANDARD, *, scales = None, outputs = Whole(1), start = "standard",
        blend = None, parameters = None, covariance = None, dead_zone = 0.0, huber = f64::INFINITY, gate = f64::INFINITY, release = Whole(0)))]
    #[pyo3(
        text_signature = "(n, forgetting=0.99, *, scales=None, outputs=1, start='standard', blend=None, parameters=None, covariance=None, dead_zone=0.0, huber=1e999, gate=1e999, release=0)"
    )]
    #[expect(clippy::too_many_arguments, reason = "all but two are options, given by name")]
    fn new(
        py: Python<'_>,
        n: Whole,
        forgetting: Memory,
        scales: Option<&Bound<'_, PyAny>>,
        outputs: Whole,
        start: &str,
        blend: Option<Whole>,
        parameters: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
        dead_zone: f64,
        huber: f64,
        gate: f64,
        release: Whole,
    ) -> PyResult<Self> {
        let (n, outputs) = (argument::size("n", n)?, argument::size("outputs", outputs)?);
        let scales = match scales {
            Some(scales) => array::finite_vector("scales", scales, Some(n))?,
            None => DVector::from_element(n, 1.0),
        };
        let start = recursive::start(start, blend, parameters.is_some() || covariance.is_some())?;
        let outliers = recursive::outliers(huber, gate, release)?;
        let parameters = match parameters {
            Some(parameters) if outputs == 1 => {
                Some(array::finite_vector("parameters", parameters, Some(n))?.as_slice().to_vec())
            }
            Some(parameters) => {
                let matrix = array::finite_matrix("parameters", parameters, [Some(n), Some(outputs)])?;
                Some(matrix.as_slice().to_vec())
            }
            None => None,
        };
        let covariance = match covariance {
            Some(covariance) => Some(argument::covariance("covariance", covariance, Some(n))?),
            None => None,
        };
        let engine = if outputs == 1 {
            Stepper::new(&scales, forgetting.0)
                .and_then(|estimator| estimator.with_start(start)?.with_outliers(outliers))
                .and_then(|estimator| warm(estimator, Const, parameters, covariance, dead_zone))
                .map(Engine::One)
        } else {
            Stepper::with_outputs(&scales, Dyn(outputs), forgetting.0)
                .and_then(|estimator| estimator.with_start(start)?.with_outliers(outliers))
                .and_then(|estimator| warm(estimator, Dyn(outputs), parameters, covariance, dead_zone))
                .map(Engine::Many)
        };
        Ok(RecursiveLeastSquares::of(engine.map_err(|error| failed(py, error))?))
    }

    /// Take one sample and correct the estimate by it.
    ///
    /// Parameters
    /// ----------
    /// phi : array_like, shape (n,)
    ///     The regressor. NaN is a missing sample.
    /// y : float, or array_like of shape (outputs,)
    ///     The output, or all of them. NaN is a missing sample.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     What was not predicted, and what was done.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number infinite or too large. Nothing has changed then.
    fn update(
        &mut self,
        py: Python<'_>,
        phi: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
    ) -> PyResult<Innovation> {
        let RecursiveLeastSquares { engine, regressor } = self;
        let phi = array::vector("phi", phi, Some(regressor.len()))?;
        regressor.as_mut_slice().copy_from_slice(phi.as_slice()?);
        match engine {
            Engine::One(estimator) => {
                let y = argument::number("y", y)?;
                Ok(estimator.update(regressor, y).map_err(|error| failed(py, error))?.into())
            }
            Engine::Many(estimator) => {
                let y = array::vector("y", y, Some(estimator.parameters().ncols()))?;
                let y = DVector::from_column_slice(y.as_slice()?);
                Ok(Innovation::vector(
                    estimator.update_all(regressor, &y).map_err(|error| failed(py, error))?,
                ))
            }
        }
    }

    /// Take many samples: the same as `update` in a loop, to the bit.
    ///
    /// The interpreter lock is released meanwhile.
    ///
    /// Parameters
    /// ----------
    /// phi : array_like, shape (N, n)
    ///     A regressor in each row.
    /// y : array_like, shape (N,), or (N, outputs) for several outputs
    ///     The outputs.
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
    fn run(
        &mut self,
        py: Python<'_>,
        phi: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
    ) -> PyResult<RecursiveTrajectory> {
        let n = self.regressor.len();
        let regressors = array::matrix("phi", phi, [None, Some(n)])?;
        let rows = regressors.shape()[0];
        let regressors = regressors.as_slice()?;
        match &mut self.engine {
            Engine::One(estimator) => {
                let outputs = array::vector("y", y, Some(rows))?;
                let outputs = outputs.as_slice()?;
                let work = |record: &mut Record<'_>| run_one(estimator, regressors, outputs, record);
                let (stepped, trajectory) = recursive::run(py, [rows, n, 1], work)?;
                *estimator = stepped;
                Ok(trajectory)
            }
            Engine::Many(estimator) => {
                let m = estimator.parameters().ncols();
                let outputs = array::matrix("y", y, [Some(rows), Some(m)])?;
                let outputs = outputs.as_slice()?;
                let (mut regressor, mut output) = (DVector::zeros(n), DVector::zeros(m));
                let copy = estimator.clone();
                let (stepped, trajectory) = recursive::run(py, [rows, n, m], |record| {
                    record.run(copy, rows, |estimator, row, record| {
                        regressor.as_mut_slice().copy_from_slice(argument::row(regressors, row, n));
                        output.as_mut_slice().copy_from_slice(argument::row(outputs, row, m));
                        record.take_all(&estimator.update_all(&regressor, &output)?);
                        Ok(())
                    })
                })?;
                *estimator = stepped;
                Ok(trajectory)
            }
        }
    }

    /// What a regressor predicts: phi' theta.
    ///
    /// Parameters
    /// ----------
    /// phi : array_like, shape (n,)
    ///     The regressor; all of it is finite.
    ///
    /// Returns
    /// -------
    /// float or ndarray of shape (outputs,)
    ///     A float for one output.
    fn predict<'py>(&self, py: Python<'py>, phi: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let regressor = array::finite_vector("phi", phi, Some(self.regressor.len()))?;
        match &self.engine {
            Engine::One(estimator) => {
                estimator.predict(&regressor).map_err(|error| failed(py, error))?.into_bound_py_any(py)
            }
            Engine::Many(estimator) => {
                let predicted = estimator.predict_all(&regressor).map_err(|error| failed(py, error))?;
                Ok(argument::from_vector(py, &predicted).into_any())
            }
        }
    }

    /// Take one sample without a measurement: only the random walk takes note of it.
    fn advance(&mut self) {
        either!(&mut self.engine, estimator => estimator.advance())
    }

    /// The parameters, shape (n,), or (n, outputs) for several outputs.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.engine, estimator => recursive::parameters(py, estimator))
    }

    /// P, shape (n, n): the covariance of the parameters in units of the noise variance.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        either!(&self.engine, estimator => recursive::covariance(py, estimator))
    }

    /// The covariance of the parameters, shape (n, n), or (outputs, n, n); None until the noise variance is known.
    #[getter]
    fn parameter_covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        either!(&self.engine, estimator => recursive::parameter_covariance(py, estimator))
    }

    /// The standard errors, of the shape of the parameters; None until the noise variance is known.
    #[getter]
    fn standard_errors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        either!(&self.engine, estimator => recursive::standard_errors(py, estimator))
    }

    /// The variance of the noise, a float, or an array of shape (outputs,); None until enough samples are in.
    #[getter]
    fn noise_variance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        match &self.engine {
            Engine::One(estimator) => {
                estimator.noise_variance().map(|variance| variance.into_bound_py_any(py)).transpose()
            }
            Engine::Many(estimator) => {
                Ok(estimator.noise_variances().map(|all| argument::from_vector(py, &all).into_any()))
            }
        }
    }

    /// How much the samples in the memory tell of the parameter they tell least of, 0 to 1.
    #[getter]
    fn excitation(&self) -> f64 {
        either!(&self.engine, estimator => estimator.excitation())
    }

    /// The forgetting policy.
    #[getter]
    fn forgetting(&self) -> Forgetting {
        let policy = either!(&self.engine, estimator => estimator.forgetting());
        Forgetting { policy }
    }

    /// How many of the latest samples are outliers by the rule for them, since the last one that is not.
    #[getter]
    fn outliers_in_a_row(&self) -> u16 {
        either!(&self.engine, estimator => estimator.outliers_in_a_row())
    }

    /// Whether samples correct the estimate. Set it to turn that off and on.
    #[getter]
    fn adapting(&self) -> bool {
        either!(&self.engine, estimator => estimator.is_adapting())
    }

    #[setter]
    fn set_adapting(&mut self, adapting: bool) {
        either!(&mut self.engine, estimator => estimator.set_adaptation(adapting))
    }

    fn __repr__(&self) -> String {
        let (n, (outputs, parameters)) = (
            self.regressor.len(),
            match &self.engine {
                Engine::One(estimator) => (1, estimator.parameters().as_slice()),
                Engine::Many(estimator) => {
                    (estimator.parameters().ncols(), estimator.parameters().as_slice())
                }
            },
        );
        format!("RecursiveLeastSquares(n={n}, outputs={outputs}, parameters={})", list(parameters))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "RecursiveLeastSquares", &self.engine)
    }
}
