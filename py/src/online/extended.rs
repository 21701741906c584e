//! The extended Kalman filter.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use thetahat_core::nalgebra::{DVector, Dyn};
use thetahat_core::{
    Covariance, Error, ExtendedKalmanFilter as Stepper, Innovation as Told, Observation, Transition,
};

use super::argument::{self, Whole, failed};
use super::held::{Arguments, Held, predicted, renamed};
use super::innovation::{Innovation, list};
use super::kalman::started;
use super::trajectory::{
    FilterTrajectory, Sample, Samples, SmoothedTrajectory, Steps, columns, measurement, recorded, returned,
    smooth, smoothed,
};
use super::used::{Used, UsedObservation, UsedTransition};
use super::{Reduced, Stop};
use crate::array;

/// The extended Kalman filter: the Kalman filter of the linearised model.
///
/// The models are arguments of each step, linear or not. With linear ones it is the Kalman filter, to the bit.
///
/// Parameters
/// ----------
/// state : array_like, shape (n,)
///     The estimate of the state to start from. For `run` it is that before the first measurement.
/// covariance : float, or array_like of shape (n, n)
///     The covariance of its error; a number is the variance of each state.
/// gate : float, default inf
///     A measurement whose normalised innovation squared is above it is not used.
/// release : int, default 0
///     After so many measurements in a row above the gate, those that follow are used, until one is within it again. 0
///     is a gate that never lets go: it may lock the filter out for ever.
/// iterations : int, default 1
///     How often a correction linearises the observation, each time about its last result.
/// transition : LinearTransition or NonlinearTransition, optional
///     The model of the state, of steps that are not given one.
/// observation : LinearObservation or NonlinearObservation, optional
///     The model of the measurement, of steps that are not given one.
///
/// Notes
/// -----
/// ::
///
///     predict:  F = df/dx at x, u:       x <- f(x, u),       P <- F P F' + Q
///     correct:  H = dh/dx at x, u:       e = y - h(x, u),    S = H P H' + R,    K = P H' S^-1
///                                        x <- x + K e,       P <- P - K S K'
///
/// It is an approximation: P does not know of the error of the linearisation, so it may promise too much, and a bad
/// start may never be forgotten. Watch ``nis``. A function of a model must not use the filter itself: that raises
/// RuntimeError.
///
/// References
/// ----------
/// Jazwinski, Stochastic Processes and Filtering Theory, 1970, sections 8.3 and 8.6.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import ExtendedKalmanFilter, NonlinearObservation, NonlinearTransition
/// >>> def swing(x, u):
/// ...     return np.array([x[0] + 0.02 * x[1], x[1] - 0.2 * np.sin(x[0])])
/// >>> pendulum = NonlinearTransition(swing, np.zeros((2, 2)))
/// >>> sideways = NonlinearObservation(lambda x, u: np.sin(x[:1]), [[1e-4]])
/// >>> truth = np.array([0.8, 0.0])
/// >>> estimate = ExtendedKalmanFilter([0.5, 0.3], 0.1, transition=pendulum, observation=sideways)
/// >>> for _ in range(200):
/// ...     truth = swing(truth, None)
/// ...     estimate.predict()
/// ...     innovation = estimate.update(float(np.sin(truth[0])))
/// >>> bool(np.all(np.abs(estimate.state - truth) < 2e-3))
/// True
#[pyclass(module = "thetahat")]
pub(crate) struct ExtendedKalmanFilter {
    pub(crate) filter: Stepper<f64, Dyn>,
    pub(super) held: Held,
}

/// A filter with its models. `before` is called before a model is used; `troubled` says whether a function went wrong.
struct Extended<'a, T, O> {
    filter: Stepper<f64, Dyn>,
    transition: &'a T,
    observation: &'a O,
    before: fn(&T, &O, &Covariance<f64, Dyn>),
    troubled: fn(&T, &O) -> bool,
}

impl<T, O> Extended<'_, T, O> {
    /// What was answered, unless a function went wrong: a noise that it did not give does not show in the answer. The
    /// error gives way to what the function said.
    fn checked<A>(&self, answer: Result<A, Error>) -> Result<A, Error> {
        if (self.troubled)(self.transition, self.observation) { Err(Error::Overflow) } else { answer }
    }
}

impl<T: Transition<f64, Dyn, Dyn>, O: Observation<f64, Dyn, Dyn, Dyn>> Steps<Dyn, Dyn>
    for Extended<'_, T, O>
{
    fn state(&self) -> &DVector<f64> {
        self.filter.state()
    }

    fn covariance(&self) -> &Covariance<f64, Dyn> {
        self.filter.covariance()
    }

    fn correct(&mut self, sample: &Sample<Dyn>) -> Result<Told<f64, DVector<f64>>, Error> {
        (self.before)(self.transition, self.observation, self.filter.covariance());
        let corrected = self.filter.correct(self.observation, &sample.inputs[1], &sample.measurement);
        self.checked(corrected)
    }

    fn predict(&mut self, sample: &Sample<Dyn>) -> Result<(), Error> {
        (self.before)(self.transition, self.observation, self.filter.covariance());
        let predicted = self.filter.predict(self.transition, &sample.inputs[0]);
        self.checked(predicted)
    }
}

/// What a model's function said, or else the library.
pub(crate) fn explained<T, O>(
    py: Python<'_>,
    transition: &Used<'_, '_, T>,
    observation: &Used<'_, '_, O>,
    stop: Stop,
) -> PyErr {
    match (transition.trouble().or_else(|| observation.trouble()), stop) {
        (Some(trouble), Stop::Refused(row, _)) => trouble.into_error(Some(row)),
        (_, stop) => stop.into_error(py),
    }
}

/// The input of one step, for a model that wants so many, or any number.
pub(crate) fn input(value: Option<&Bound<'_, PyAny>>, wanted: Option<usize>) -> PyResult<DVector<f64>> {
    match (wanted, value) {
        (Some(length), value) => argument::input(value, length),
        (None, None) => Ok(DVector::zeros(0)),
        (None, Some(value)) if argument::is_number(value) => argument::input(Some(value), 1),
        (None, Some(value)) => {
            let array = array::vector("input", value, None)?;
            argument::input(Some(value), array.as_slice()?.len())
        }
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl ExtendedKalmanFilter {
    #[new]
    #[pyo3(signature = (state, covariance, *, transition = None, observation = None, gate = f64::INFINITY, release = Whole(0), iterations = Whole(1)))]
    #[pyo3(
        text_signature = "(state, covariance, *, transition=None, observation=None, gate=1e999, release=0, iterations=1)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
        gate: f64,
        release: Whole,
        iterations: Whole,
    ) -> PyResult<Self> {
        let iterations = argument::count("iterations", iterations, 1, 1000)?;
        let filter = Stepper::from(started(py, state, covariance, gate, release)?);
        let filter = filter.with_iterations(iterations).map_err(|error| failed(py, error))?;
        let held = Held::new(transition, observation, filter.state().len())?;
        Ok(ExtendedKalmanFilter { filter, held })
    }

    /// Move the state on by one sample.
    ///
    /// Parameters
    /// ----------
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k). A function gets it as an array, which is empty without it.
    /// input : float or array_like, optional
    ///     The same, where the model comes first: ``predict(transition, input)``.
    /// transition : LinearTransition or NonlinearTransition, optional
    ///     The model; without it the one that the filter holds.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, or a function returns NaN or infinity. Nothing has changed then.
    /// Exception
    ///     Whatever a function raises.
    #[pyo3(signature = (u = None, input = None, *, transition = None))]
    fn predict(
        &mut self,
        py: Python<'_>,
        u: Option<&Bound<'_, PyAny>>,
        input: Option<&Bound<'_, PyAny>>,
        transition: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (model, input) = predicted(u, input, transition);
        let transition = self.held.transition(py, model)?;
        let model = UsedTransition::new(&transition, self.filter.state().len())?;
        let input = self::input(input, model.inputs())?;
        model.linearise_within(self.filter.covariance());
        let mut filter = self.filter.clone();
        let predicted = filter.predict(&model, &input);
        if let Some(trouble) = model.trouble() {
            return Err(trouble.into_error(None));
        }
        predicted.map_err(|error| failed(py, error))?;
        self.filter = filter;
        Ok(())
    }

    /// Correct the state by a measurement.
    ///
    /// Parameters
    /// ----------
    /// y : float or array_like, shape (m,)
    ///     y(k). NaN is a missing element: it is skipped alone.
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k). A function gets it as an array, which is empty without it.
    /// observation : LinearObservation or NonlinearObservation, optional
    ///     The model; without it the one that the filter holds.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     With floats where the measurement is a float, else with arrays.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number too large, or a function returns NaN or infinity. Nothing has changed then.
    /// Exception
    ///     Whatever a function raises.
    #[pyo3(signature = (y, u = None, *, observation = None))]
    fn update(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Innovation> {
        let (measurement, input) = (y, u);
        let observation = self.held.observation(py, observation)?;
        let outputs = match argument::is_number(measurement) {
            true => 1,
            false => array::vector("measurement", measurement, None)?.as_slice()?.len(),
        };
        let model = UsedObservation::new(&observation, self.filter.state().len(), Some(outputs))?;
        let input = self::input(input, model.inputs())?;
        let (measurement, single) = self::measurement(measurement, model.outputs())?;
        model.linearise_within(self.filter.covariance());
        let mut filter = self.filter.clone();
        let corrected = filter.correct(&model, &input, &measurement);
        if let Some(trouble) = model.trouble() {
            return Err(trouble.into_error(None));
        }
        let innovation = corrected.map_err(|error| failed(py, error))?;
        self.filter = filter;
        Ok(returned(innovation, single))
    }

    /// The name that `update` had, with the model first. Deprecated.
    #[pyo3(signature = (observation, measurement, *, input = None))]
    fn correct(
        &mut self,
        py: Python<'_>,
        observation: &Bound<'_, PyAny>,
        measurement: &Bound<'_, PyAny>,
        input: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Innovation> {
        renamed(py, "correct(observation, y, input=u)", "update(y, u, observation=observation)")?;
        self.update(py, measurement, input, Some(observation))
    }

    /// Take many samples: at each one `update`, then `predict`, to the bit.
    ///
    /// With linear models the interpreter lock is released meanwhile. Afterwards the filter has predicted the sample
    /// after the last.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (N, m), or (N,) for m = 1
    ///     NaN is a missing element.
    /// u : array_like, shape (N, inputs), or (N,) for one input, optional
    ///     They go to each function, and to each linear model that has an input.
    /// measurements, inputs : array_like, optional
    ///     The same, where the models come first: ``run(transition, observation, measurements, inputs=inputs)``.
    /// transition : LinearTransition or NonlinearTransition, optional
    ///     The model of the state; without it the one that is held.
    /// observation : LinearObservation or NonlinearObservation, optional
    ///     The model of the measurement; without it the one that is held.
    ///
    /// Returns
    /// -------
    /// FilterTrajectory
    ///     States, covariances and innovations, row by row.
    ///
    /// Raises
    /// ------
    /// ValueError, EstimationError
    ///     As for one step; the message names the row, from 1. Nothing has changed then.
    /// Exception
    ///     Whatever a function raises.
    #[pyo3(signature = (y, u = None, measurements = None, *, inputs = None, transition = None, observation = None))]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn run(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
        measurements: Option<&Bound<'_, PyAny>>,
        inputs: Option<&Bound<'_, PyAny>>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<FilterTrajectory> {
        let given = Arguments::new(y, u, measurements, inputs, [transition, observation]);
        let (measurements, inputs) = (given.measured("measurements")?, given.u);
        let transition = self.held.transition(py, given.transition)?;
        let observation = self.held.observation(py, given.observation)?;
        let n = self.filter.state().len();
        let transition = UsedTransition::new(&transition, n)?;
        let measurements = array::numbers("measurements", measurements)?.into_any();
        let outputs = columns("measurements", &measurements)?;
        let observation = UsedObservation::new(&observation, n, Some(outputs))?;
        let m = observation.outputs();
        let samples = Samples::new(&measurements, m, inputs, [transition.inputs(), observation.inputs()])?;
        let slices = samples.slices()?;
        let filter = self.filter.clone();
        let (filter, trajectory) = recorded(py, [samples.rows, n, m], |record| {
            if let (Used::Linear(transition), Used::Linear(observation)) = (&transition, &observation) {
                let mut stepped = Extended {
                    filter,
                    transition: *transition,
                    observation: *observation,
                    before: |_, _, _| (),
                    troubled: |_, _| false,
                };
                py.detach(|| record.run(&mut stepped, &slices, Dyn(m)))
                    .map_err(|stop| stop.into_error(py))?;
                return Ok(stepped.filter);
            }
            let mut stepped = Extended {
                filter,
                transition: &transition,
                observation: &observation,
                before: |transition, observation, covariance| {
                    transition.linearise_within(covariance);
                    observation.linearise_within(covariance);
                },
                troubled: |transition, observation| transition.is_troubled() || observation.is_troubled(),
            };
            let taken = record.run(&mut stepped, &slices, Dyn(m));
            taken.map_err(|stop| explained(py, &transition, &observation, stop))?;
            Ok(stepped.filter)
        })?;
        self.filter = filter;
        Ok(trajectory)
    }

    /// The states at all samples, given all measurements, earlier and later ones.
    ///
    /// It starts from where the filter stands, which is before the first measurement, and leaves the filter as it is.
    /// It smooths with the linearisations that the filter makes on its way.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (N, m), or (N,) for m = 1
    ///     NaN is a missing element.
    /// u : array_like, shape (N, inputs), or (N,) for one input, optional
    ///     They go to each function, and to each linear model that has an input.
    /// measurements, inputs : array_like, optional
    ///     The same, where the models come first: ``smooth(transition, observation, measurements, inputs=inputs)``.
    /// transition : LinearTransition or NonlinearTransition, optional
    ///     The model of the state; without it the one that is held.
    /// observation : LinearObservation or NonlinearObservation, optional
    ///     The model of the measurement; without it the one that is held.
    ///
    /// Returns
    /// -------
    /// SmoothedTrajectory
    ///     States and covariances, row by row.
    ///
    /// References
    /// ----------
    /// Bryson and Frazier, Smoothing for linear and nonlinear dynamic systems, 1963.
    #[pyo3(signature = (y, u = None, measurements = None, *, inputs = None, transition = None, observation = None))]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn smooth(
        &self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
        measurements: Option<&Bound<'_, PyAny>>,
        inputs: Option<&Bound<'_, PyAny>>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<SmoothedTrajectory> {
        let given = Arguments::new(y, u, measurements, inputs, [transition, observation]);
        let (measurements, inputs) = (given.measured("measurements")?, given.u);
        let transition = self.held.transition(py, given.transition)?;
        let observation = self.held.observation(py, given.observation)?;
        let n = self.filter.state().len();
        let transition = UsedTransition::new(&transition, n)?;
        let measurements = array::numbers("measurements", measurements)?.into_any();
        let outputs = columns("measurements", &measurements)?;
        let observation = UsedObservation::new(&observation, n, Some(outputs))?;
        let wanted = [transition.inputs(), observation.inputs()];
        let samples = Samples::new(&measurements, observation.outputs(), inputs, wanted)?;
        let slices = samples.slices()?;
        let before = |covariance: &Covariance<f64, Dyn>| {
            transition.linearise_within(covariance);
            observation.linearise_within(covariance);
        };
        let troubled = || transition.is_troubled() || observation.is_troubled();
        let result = smooth(self.filter.clone(), &transition, &observation, &slices, before, troubled)
            .map_err(|stop| explained(py, &transition, &observation, stop))?;
        smoothed(py, result, samples.rows, n)
    }

    /// The estimate of the state, shape (n,).
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        argument::from_vector(py, self.filter.state())
    }

    /// The covariance of its error, shape (n, n), as far as the linearised model knows it.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, &self.filter.covariance().matrix())
    }

    /// After how many measurements in a row the gate lets go; 0 if never.
    #[getter]
    fn release(&self) -> u16 {
        self.filter.release()
    }

    /// How many of the latest measurements were above the gate, since the last one within it.
    #[getter]
    fn gated_in_a_row(&self) -> u16 {
        self.filter.gated_in_a_row()
    }

    /// The gate on the normalised innovation squared: inf if there is none.
    #[getter]
    fn gate(&self) -> f64 {
        self.filter.gate()
    }

    /// How often a correction linearises the observation.
    #[getter]
    fn iterations(&self) -> usize {
        self.filter.iterations()
    }

    fn __repr__(&self) -> String {
        let state = self.filter.state();
        format!("ExtendedKalmanFilter(n={}, state={})", state.len(), list(state.as_slice()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.held.snapshot(py, "ExtendedKalmanFilter", &self.filter)
    }
}
