//! A recursive nonlinear ARX estimator.

use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use thetahat::model::{Functions, Map, Signal};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_core::{ArxOrders, Covariance, InputOrders, Scaling};

use super::argument::{self, Whole, count, failed};
use super::forgetting::{Memory, STANDARD};
use super::recursive;
use super::recursive_model::{Narx, RecursiveModel, StartingPoint, Stepper, orders, scales};
use crate::array;
use crate::error;
use crate::model::Model;

/// A nonlinear ARX model, estimated while the plant runs: a weighted sum of products of past outputs and inputs.
///
/// Parameters
/// ----------
/// ny : int
///     The number of past outputs, y(k-1) ... y(k-ny).
/// nu : int or sequence of int
///     The number of values of each input, u(k-nk) ... u(k-nk-nu+1). An int is one input, and 0 no input.
/// nk : int or sequence of int, default 1
///     The delay of each input; an int is the delay of all of them.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten. A float is exponential forgetting with that factor, None is no forgetting.
/// degree : int, default 2
///     All products of at most so many regressors are terms, if ``terms`` does not say them.
/// terms : sequence of sequences of int, optional
///     The regressors that each term is the product of, counted from 0 in the order y(k-1) ..., u(k-nk) ... of the
///     first input, and of the next; an empty one is the constant.
/// output_offset, output_scale : float, default 0.0 and 1.0
///     The level of the output and its typical deviation from it, in its own unit.
/// input_offsets, input_scales : float or array_like, optional
///     The same of each input: 0 and 1 if not given.
/// start : {"standard", "exact", "mixed"}
///     As for `RecursiveLeastSquares`.
/// blend : int, optional
///     With "mixed", and only there: in how many samples the prior is taken out.
/// parameters : array_like, shape (n,), optional
///     What to start from, in the order of the terms.
/// covariance : array_like, shape (n, n), optional
///     P to start from, in units of the noise variance of the scaled output.
/// dead_zone : float, default 0.0
///     An innovation of at most this size, in the unit of the output, corrects nothing.
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
///     A pair (lower, upper) or None for each parameter.
///
/// Notes
/// -----
/// The model is::
///
///     y(k) = offset + scale (theta_1 f_1(z) + theta_2 f_2(z) + ... + e(k))
///     z = the lags, each as (x - offset) / scale
///
/// with f_j the terms, so that parameters have no unit. Those that `narx` fits start it in the same units: `from_model`
/// does so.
///
/// References
/// ----------
/// Ljung, System Identification, 2nd ed., 1999, sections 5.4 and 11.2.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import RecursiveNarx
/// >>> plant = RecursiveNarx(1, 1, terms=[[0], [1], [0, 0]], forgetting=None)
/// >>> y = 0.0
/// >>> for u in np.random.default_rng(1).uniform(-0.5, 0.5, 300):
/// ...     innovation = plant.measured(y)
/// ...     plant.applied(u)
/// ...     y = 0.5 * y + u - 0.2 * y * y
/// >>> plant.parameters.round(3)
/// array([ 0.5,  1. , -0.2])
#[pyclass(module = "thetahat", extends = RecursiveModel)]
pub(crate) struct RecursiveNarx;

impl RecursiveNarx {
    /// The object around what all have in common.
    pub(super) fn over(model: RecursiveModel) -> PyClassInitializer<Self> {
        PyClassInitializer::from(model).add_subclass(Self)
    }
}

/// Of this object.
fn stepper<'a>(model: &'a PyRef<'_, RecursiveNarx>) -> PyResult<&'a Narx> {
    match &model.as_super().engine.stepper {
        Stepper::Narx(stepper) => Ok(stepper),
        Stepper::Arx(_) | Stepper::Armax(_) | Stepper::OutputError(_) => {
            Err(PyValueError::new_err("this is no nonlinear model"))
        }
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl RecursiveNarx {
    #[new]
    #[pyo3(signature = (ny, nu, nk = None, forgetting = STANDARD, *, degree = None, terms = None, output_offset = 0.0,
        output_scale = 1.0, input_offsets = None, input_scales = None, start = "standard", blend = None, parameters = None,
        covariance = None, dead_zone = 0.0, huber = f64::INFINITY, gate = f64::INFINITY, release = Whole(0), limits = None))]
    #[pyo3(
        text_signature = "(ny, nu, nk=1, forgetting=0.99, *, degree=2, terms=None, output_offset=0.0, output_scale=1.0, input_offsets=None, input_scales=None, start='standard', blend=None, parameters=None, covariance=None, dead_zone=0.0, huber=1e999, gate=1e999, release=0, limits=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        ny: Whole,
        nu: &Bound<'_, PyAny>,
        nk: Option<&Bound<'_, PyAny>>,
        forgetting: Memory,
        degree: Option<Whole>,
        terms: Option<Vec<Vec<Whole>>>,
        output_offset: f64,
        output_scale: f64,
        input_offsets: Option<&Bound<'_, PyAny>>,
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
        let (others, inputs) = orders(&[("ny", ny)], nu, nk.unwrap_or(&one))?;
        let orders = ArxOrders { na: others.iter().sum(), inputs: &inputs, constant: false };
        let regressors = orders.parameters();
        let map = match (terms, degree) {
            (Some(_), Some(_)) => {
                return Err(PyValueError::new_err(
                    "degree: the terms say it; leave it out, or leave out terms",
                ));
            }
            (Some(terms), None) => {
                let factor = |value| count("terms", value, 0, regressors.saturating_sub(1));
                let term = |term: Vec<Whole>| term.into_iter().map(factor).collect::<PyResult<Vec<_>>>();
                Map::Polynomial { terms: terms.into_iter().map(term).collect::<PyResult<_>>()? }
            }
            (None, degree) => {
                let degree = degree.map_or(Ok(2), |degree| count("degree", degree, 1, 12))?;
                Map::polynomial(regressors, degree).map_err(|error| error::batch(py, error))?
            }
        };
        argument::check_size("terms", map.parameters(regressors))?;
        let scales = scales(input_scales, inputs.len())?;
        let mut offsets = vec![0.0; inputs.len()];
        if let Some(value) = input_offsets {
            argument::sample("input_offsets", value, inputs.len(), &mut offsets)?;
        }
        let scalings: Vec<Scaling<f64>> =
            offsets.into_iter().zip(scales).map(|(offset, scale)| Scaling { offset, scale }).collect();
        let output = Scaling { offset: output_offset, scale: output_scale };
        let start = recursive::start(start, blend, parameters.is_some() || covariance.is_some())?;
        let outliers = recursive::outliers(huber, gate, release)?;
        let functions = Functions::new(map, regressors).map_err(|error| error::batch(py, error))?;
        let stepper = Narx::new(functions, &orders, output, &scalings, forgetting.0)
            .and_then(|stepper| stepper.with_start(start)?.with_dead_zone(dead_zone)?.with_outliers(outliers))
            .map_err(|error| failed(py, error))?;
        let limited = stepper.estimator().parameters().len();
        let given = StartingPoint { parameters, covariance, limits, limited };
        RecursiveModel::new(py, Stepper::Narx(stepper), inputs.len(), &given).map(Self::over)
    }

    /// Start from a fitted nonlinear ARX model: its functions, whatever they are, scales, offsets, parameters and
    /// covariance.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///     What `narx` returned, or a report of it.
    /// forgetting : float, Forgetting or None, default 0.99
    ///     How old samples are forgotten.
    ///
    /// Returns
    /// -------
    /// RecursiveNarx
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the model is of another kind, has no covariance, or offsets that are lines in time.
    #[staticmethod]
    #[pyo3(signature = (model, forgetting = STANDARD), text_signature = "(model, forgetting=0.99)")]
    fn from_model<'py>(
        py: Python<'py>,
        model: &Bound<'py, PyAny>,
        forgetting: Memory,
    ) -> PyResult<Bound<'py, Self>> {
        let fitted = model.getattr("_model").ok();
        let fitted = fitted.as_ref().and_then(|own| own.cast::<Model>().ok());
        let Some(fitted) = fitted else {
            return Err(PyTypeError::new_err(format!("model: expected a Model, found {}", model.get_type())));
        };
        let report = fitted.get().report(py)?;
        let refuse = |what: &str| PyValueError::new_err(format!("model: {what}"));
        let Some(own) = report.model.as_nonlinear_arx() else {
            return Err(refuse("expected a nonlinear ARX model"));
        };
        let lags = own.lag_orders().map_err(|error| error::batch(py, error))?;
        let (signal, map) = own.single("a recursion").map_err(|error| error::batch(py, error))?;
        if let Map::Neighbours { .. } = map.functions {
            return Err(refuse(
                "it keeps samples (nearest neighbours), and has no parameters to track; fit another map",
            ));
        }
        let inputs: Vec<InputOrders> =
            lags.nb.iter().zip(&lags.nk).map(|(&nb, &nk)| InputOrders { nb, nk }).collect();
        let scaling = |signal: &Signal, scale: f64| {
            let level = (signal.offset.slope == 0.0).then_some(signal.offset.level);
            let offset = level.ok_or_else(|| refuse("its offsets are lines in the time of its log"))?;
            Ok::<_, PyErr>(Scaling { offset, scale })
        };
        let scale = |name: &str| {
            let regressor = own.regressors.iter().find(|regressor| regressor.channel == name);
            regressor.map_or(1.0, |regressor| regressor.scale)
        };
        let scalings: Vec<Scaling<f64>> =
            own.inputs.iter().map(|input| scaling(input, scale(&input.name))).collect::<PyResult<_>>()?;
        let orders = ArxOrders { na: lags.na, inputs: &inputs, constant: false };
        let functions = Functions::new(map.functions.clone(), orders.parameters())
            .map_err(|error| error::batch(py, error))?;
        let noise_variance = own.noise_covariance[0][0];
        let Some(rows) = own.covariance.as_ref().filter(|_| noise_variance > 0.0) else {
            return Err(refuse("it does not say how sure it is: it has no covariance, or no noise"));
        };
        // P is in units of the noise variance of the scaled output.
        let unit = noise_variance / (map.scale * map.scale);
        let entry = |i: usize, j: usize| (rows[i][j] / 2.0 + rows[j][i] / 2.0) / unit;
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), entry);
        let parameters = DVector::from_iterator(
            own.parameters.len(),
            own.parameters.iter().map(|parameter| parameter.value),
        );
        let output = scaling(signal, map.scale)?;
        let stepper = Narx::new(functions, &orders, output, &scalings, forgetting.0)
            .and_then(|stepper| {
                stepper
                    .with_parameters(parameters)?
                    .with_covariance(Covariance::new(&covariance)?)?
                    .with_noise_variance(noise_variance, report.estimation.samples)
            })
            .map_err(|error| failed(py, error))?;
        let limited = stepper.estimator().parameters().len();
        let given = StartingPoint { parameters: None, covariance: None, limits: None, limited };
        let model = RecursiveModel::new(py, Stepper::Narx(stepper), inputs.len(), &given)?;
        Bound::new(py, Self::over(model))
    }

    /// The regressors that each term is the product of; empty where functions are no products.
    #[getter]
    fn terms(model: PyRef<'_, Self>) -> PyResult<Vec<Vec<usize>>> {
        match stepper(&model)?.model().basis().map() {
            Map::Polynomial { terms } => Ok(terms.clone()),
            _ => Ok(Vec::new()),
        }
    }

    /// The output where the regressors are these: g by the parameters of now.
    ///
    /// Parameters
    /// ----------
    /// regressors : array_like, shape (ny + nu,)
    ///     y(k-1) ..., u(k-nk) ..., in the units of the signals.
    ///
    /// Returns
    /// -------
    /// float
    fn output_at(model: PyRef<'_, Self>, py: Python<'_>, regressors: &Bound<'_, PyAny>) -> PyResult<f64> {
        let stepper = stepper(&model)?;
        let x = array::finite_vector("regressors", regressors, Some(stepper.model().regressors()))?;
        let found = stepper.model().output_at(stepper.estimator().parameters().as_slice(), x.as_slice());
        found.map_err(|error| failed(py, error))
    }

    /// The slopes of the output along each regressor there: the Jacobian of g, a row of the state matrix of an extended
    /// Kalman filter whose states are the lags.
    ///
    /// Parameters
    /// ----------
    /// regressors : array_like, shape (ny + nu,)
    ///     As for `output_at`.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (ny + nu,)
    fn slopes_at<'py>(
        model: PyRef<'py, Self>,
        py: Python<'py>,
        regressors: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let stepper = stepper(&model)?;
        let x = array::finite_vector("regressors", regressors, Some(stepper.model().regressors()))?;
        let mut slopes = vec![0.0; x.len()];
        stepper
            .model()
            .slopes_at(stepper.estimator().parameters().as_slice(), x.as_slice(), &mut slopes)
            .map_err(|error| failed(py, error))?;
        Ok(PyArray1::from_vec(py, slopes))
    }
}
