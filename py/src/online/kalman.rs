//! The Kalman filter.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use thetahat_core::nalgebra::{Const, DMatrix, Dyn, OMatrix, OVector};
use thetahat_core::{
    Action, Covariance, Dimension, Error, GainSchedule, Innovation as Told, KalmanFilter as Stepper,
    LinearObservation as Observed, LinearTransition as Moved, Smoother,
};

use super::argument::{self, Whole, failed};
use super::around::smooth;
use super::held::{Arguments, Held, predicted, renamed};
use super::innovation::{Innovation, list};
use super::model::{LinearObservation, LinearTransition};
use super::trajectory::{
    FilterTrajectory, Record, Sample, Samples, Slices, SmoothedTrajectory, SteadyState, Steps, measurement,
    recorded, returned, smoothed,
};
use super::used::check_states;
use super::{Reduced, Stop};
use crate::array;
use crate::work::Pulse;

/// The Kalman filter.
///
/// The models are held by the filter, or given to a step: so they may vary in time, and several sensors may correct one
/// filter. A filter reads `update(y, u)` and then `predict(u)`, sample after sample.
///
/// Parameters
/// ----------
/// state : array_like, shape (n,)
///     The mean of the state to start from. For `run` it is that before the first measurement.
/// covariance : float, or array_like of shape (n, n)
///     Its covariance; a number is the variance of each state.
/// gate : float, default inf
///     A measurement whose normalised innovation squared is above it is not used.
/// release : int, default 0
///     After so many measurements in a row above the gate, those that follow are used, until one is within it again. 0
///     is a gate that never lets go: it may lock the filter out for ever.
/// transition : LinearTransition, optional
///     The model of the state, of steps that are not given one.
/// observation : LinearObservation, optional
///     The model of the measurement, of steps that are not given one.
///
/// Raises
/// ------
/// ValueError
///     If a shape is wrong, an entry not finite, or the covariance none.
///
/// Notes
/// -----
/// ::
///
///     predict:  x <- F x + G u,          P <- F P F' + Q
///     correct:  e = y - H x - D u,       S = H P H' + R,     K = P H' S^-1
///               x <- x + K e,            P <- P - K S K'
///
/// P is kept as factors U D U', which never become indefinite. An object is for one thread at a time: a call from
/// another one raises RuntimeError.
///
/// References
/// ----------
/// Kalman, A new approach to linear filtering and prediction problems, 1960. Bierman, Factorization Methods for
/// Discrete Sequential Estimation, 1977, chapters V and VI.
///
/// Examples
/// --------
/// >>> from thetahat import KalmanFilter, LinearObservation, LinearTransition
/// >>> walk = LinearTransition([[1.0]], 1469.1)
/// >>> level = LinearObservation([[1.0]], 15099.0)
/// >>> river = KalmanFilter([0.0], 1e7, transition=walk, observation=level)
/// >>> river.update(1120.0).error
/// 1120.0
/// >>> river.state.round(6)
/// array([1118.311462])
/// >>> river.predict()
#[pyclass(module = "thetahat")]
pub(crate) struct KalmanFilter {
    pub(crate) filter: Stepper<f64, Dyn>,
    pub(super) held: Held,
}

/// The state, its covariance and the gate, as the arguments of a filter.
pub(crate) fn started(
    py: Python<'_>,
    state: &Bound<'_, PyAny>,
    covariance: &Bound<'_, PyAny>,
    gate: f64,
    release: Whole,
) -> PyResult<Stepper<f64, Dyn>> {
    let state = array::finite_vector("state", state, None)?;
    argument::check_size("state", state.len())?;
    let release = argument::count("release", release, 0, usize::from(u16::MAX))?;
    let release = u16::try_from(release).unwrap_or(u16::MAX);
    let covariance = argument::covariance("covariance", covariance, Some(state.len()))?;
    Stepper::new(state, covariance)
        .and_then(|filter| Ok(filter.with_gate(gate)?.with_release(release)))
        .map_err(|error| failed(py, error))
}

/// A filter with linear models.
struct Linear<N: Dimension + Dimension<M> + Dimension<Dyn>, M: Dimension + Dimension<N> + Dimension<Dyn>> {
    filter: Stepper<f64, N>,
    models: Models<N, M>,
    correlated: Option<Correlated<N, M>>,
    gated: bool,
}

impl<N: Dimension + Dimension<M> + Dimension<Dyn>, M: Dimension + Dimension<N> + Dimension<Dyn>> Steps<N, M>
    for Linear<N, M>
{
    fn state(&self) -> &OVector<f64, N> {
        self.filter.state()
    }

    fn covariance(&self) -> &Covariance<f64, N> {
        self.filter.covariance()
    }

    fn correct(&mut self, sample: &Sample<M>) -> Result<Told<f64, OVector<f64, M>>, Error> {
        let innovation = self.filter.correct(&self.models.1, &sample.inputs[1], &sample.measurement)?;
        self.gated = innovation.action == Action::Gated;
        Ok(innovation)
    }

    fn predict(&mut self, sample: &Sample<M>) -> Result<(), Error> {
        let Sample { measurement, inputs: [input, other] } = sample;
        match &self.correlated {
            Some((cross, (transition, observation))) if !self.gated => {
                let input = if input.is_empty() { other } else { input };
                self.filter.predict_correlated(transition, observation, cross, input, measurement)
            }
            _ => self.filter.predict(&self.models.0, input),
        }
    }
}

/// A linear model of both parts.
type Models<N = Dyn, M = Dyn> = (Moved<f64, N, Dyn>, Observed<f64, N, M, Dyn>);

/// A cross-covariance, and the models with the same inputs.
type Correlated<N, M> = (OMatrix<f64, N, M>, Models<N, M>);

impl Linear<Dyn, Dyn> {
    /// Takes the samples, with usual sizes as types: that gives the same bits several times as fast.
    fn run(&self, record: &mut Record<'_>, samples: &Slices<'_>) -> Result<Stepper<f64, Dyn>, Stop> {
        match self.filter.state().len() {
            1 => self.run_states::<1>(record, samples),
            2 => self.run_states::<2>(record, samples),
            3 => self.run_states::<3>(record, samples),
            4 => self.run_states::<4>(record, samples),
            5 => self.run_states::<5>(record, samples),
            6 => self.run_states::<6>(record, samples),
            n => self.run_sized(Dyn(n), Dyn(samples.outputs), record, samples),
        }
    }

    fn run_states<const N: usize>(
        &self,
        record: &mut Record<'_>,
        samples: &Slices<'_>,
    ) -> Result<Stepper<f64, Dyn>, Stop> {
        match samples.outputs {
            1 => self.run_sized(Const::<N>, Const::<1>, record, samples),
            2 => self.run_sized(Const::<N>, Const::<2>, record, samples),
            3 => self.run_sized(Const::<N>, Const::<3>, record, samples),
            m => self.run_sized(Dyn(N), Dyn(m), record, samples),
        }
    }

    fn run_sized<N, M>(
        &self,
        states: N,
        outputs: M,
        record: &mut Record<'_>,
        samples: &Slices<'_>,
    ) -> Result<Stepper<f64, Dyn>, Stop>
    where
        N: Dimension + Dimension<M> + Dimension<Dyn>,
        M: Dimension + Dimension<N> + Dimension<Dyn>,
    {
        // The sizes are those of the filter and its models, so that only a row can fail.
        let mut sized = self.to_size(states, outputs).map_err(|error| (0, error))?;
        record.run(&mut sized, samples, outputs)?;
        Ok(sized.filter.to_size(Dyn(states.value())).map_err(|error| (0, error))?)
    }

    fn to_size<N, M>(&self, states: N, outputs: M) -> Result<Linear<N, M>, Error>
    where
        N: Dimension + Dimension<M> + Dimension<Dyn>,
        M: Dimension + Dimension<N> + Dimension<Dyn>,
    {
        let models = |(transition, observation): &Models| -> Result<Models<N, M>, Error> {
            Ok((transition.to_size(states)?, observation.to_size(states, outputs)?))
        };
        let correlated = match &self.correlated {
            Some((cross, correlated)) => {
                let cross = OMatrix::from_column_slice_generic(states, outputs, cross.as_slice());
                Some((cross, models(correlated)?))
            }
            None => None,
        };
        let (filter, models) = (self.filter.to_size(states)?, models(&self.models)?);
        Ok(Linear { filter, models, correlated, gated: self.gated })
    }
}

/// Both models with the inputs that one of them has: a model without gets zeros.
fn with_same_inputs(
    py: Python<'_>,
    transition: &Moved<f64, Dyn, Dyn>,
    observation: &Observed<f64, Dyn, Dyn, Dyn>,
) -> PyResult<Models> {
    let (n, moved) = transition.input_matrix().shape();
    let (m, observed) = observation.input_matrix().shape();
    let (mut transition, mut observation) = (transition.clone(), observation.clone());
    if moved == 0 && observed > 0 {
        transition = transition.with_input(DMatrix::zeros(n, observed)).map_err(|error| failed(py, error))?;
    }
    if observed == 0 && moved > 0 {
        observation = observation.with_input(DMatrix::zeros(m, moved)).map_err(|error| failed(py, error))?;
    }
    Ok((transition, observation))
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl KalmanFilter {
    #[new]
    #[pyo3(signature = (state, covariance, *, transition = None, observation = None, gate = f64::INFINITY, release = Whole(0)))]
    #[pyo3(
        text_signature = "(state, covariance, *, transition=None, observation=None, gate=1e999, release=0)"
    )]
    fn new(
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
        gate: f64,
        release: Whole,
    ) -> PyResult<Self> {
        let filter = started(py, state, covariance, gate, release)?;
        transition
            .filter(|model| !model.is_instance_of::<LinearTransition>())
            .map_or(Ok(()), |model| Err(not_linear("transition", model)))?;
        observation
            .filter(|model| !model.is_instance_of::<LinearObservation>())
            .map_or(Ok(()), |model| Err(not_linear("observation", model)))?;
        let held = Held::new(transition, observation, filter.state().len())?;
        Ok(KalmanFilter { filter, held })
    }

    /// Move the state on by one sample.
    ///
    /// Parameters
    /// ----------
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k), if the model has an input.
    /// input : float or array_like, optional
    ///     The same, where the model comes first: ``predict(transition, input)``.
    /// transition : LinearTransition, optional
    ///     The model; without it the one that the filter holds.
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
        let model = self.transition(&transition)?;
        let input = argument::input(input, model.input_matrix().ncols())?;
        self.filter.predict(model, &input).map_err(|error| failed(py, error))
    }

    /// Move the state on by one sample, where process noise and measurement noise are correlated.
    ///
    /// It comes after `update` with the same input and measurement. If all of the measurement is missing, or
    /// `update` answered "gated", `predict` is the step.
    ///
    /// Parameters
    /// ----------
    /// transition : LinearTransition
    ///     The model of the state.
    /// observation : LinearObservation
    ///     The model of the measurement.
    /// cross_covariance : array_like, shape (n, m)
    ///     S = cov(w(k), v(k)).
    /// measurement : float or array_like, shape (m,)
    ///     y(k). NaN is a missing element.
    /// input : float or array_like, shape (inputs,), optional
    ///     u(k), if a model has an input.
    ///
    /// Notes
    /// -----
    /// ::
    ///
    ///     x <- F x + G u + S R^-1 (y - H x - D u)
    ///     P <- (F - S R^-1 H) P (F - S R^-1 H)' + Q - S R^-1 S'
    ///
    /// References
    /// ----------
    /// Anderson and Moore, Optimal Filtering, 1979, section 5.5.
    #[pyo3(signature = (transition, observation, cross_covariance, measurement, *, input = None))]
    fn predict_correlated(
        &mut self,
        py: Python<'_>,
        transition: &Bound<'_, PyAny>,
        observation: &Bound<'_, PyAny>,
        cross_covariance: &Bound<'_, PyAny>,
        measurement: &Bound<'_, PyAny>,
        input: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (transition, observation) =
            with_same_inputs(py, self.transition(transition)?, self.observation(observation)?)?;
        let (n, m) = (self.filter.state().len(), observation.input_matrix().nrows());
        let cross = array::finite_matrix("cross_covariance", cross_covariance, [Some(n), Some(m)])?;
        let input = argument::input(input, transition.input_matrix().ncols())?;
        let (measurement, _) = self::measurement(measurement, m)?;
        self.filter
            .predict_correlated(&transition, &observation, &cross, &input, &measurement)
            .map_err(|error| failed(py, error))
    }

    /// Correct the state by a measurement.
    ///
    /// Parameters
    /// ----------
    /// y : float or array_like, shape (m,)
    ///     y(k). NaN is a missing element: it is skipped alone.
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k), if the model has an input.
    /// observation : LinearObservation, optional
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
    ///     If a shape is wrong, or a number infinite or too large. Nothing has changed then.
    /// EstimationError
    ///     If what is measured is known exactly, and measured without noise.
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
        let model = self.observation(&observation)?;
        let input = argument::input(input, model.input_matrix().ncols())?;
        let (measurement, single) = self::measurement(measurement, model.input_matrix().nrows())?;
        let innovation =
            self.filter.correct(model, &input, &measurement).map_err(|error| failed(py, error))?;
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
    /// The interpreter lock is released meanwhile. Afterwards the filter has predicted the sample after the last.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (N, m), or (N,) for m = 1
    ///     NaN is a missing element.
    /// u : array_like, shape (N, inputs), or (N,) for one input, optional
    ///     They go to each model that has an input.
    /// measurements, inputs : array_like, optional
    ///     The same, where the models come first: ``run(transition, observation, measurements, inputs=inputs)``.
    /// transition : LinearTransition, optional
    ///     The model of the state; without it the one that is held.
    /// observation : LinearObservation, optional
    ///     The model of the measurement; without it the one that is held.
    /// cross_covariance : array_like, shape (n, m), optional
    ///     With it `predict_correlated` takes the place of `predict`, but after a gated measurement.
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
    #[pyo3(signature = (y, u = None, measurements = None, *, inputs = None, transition = None, observation = None, cross_covariance = None))]
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
        cross_covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<FilterTrajectory> {
        let given = Arguments::new(y, u, measurements, inputs, [transition, observation]);
        let (measurements, inputs) = (given.measured("measurements")?, given.u);
        let transition = self.held.transition(py, given.transition)?;
        let observation = self.held.observation(py, given.observation)?;
        let (transition, observation) = (self.transition(&transition)?, self.observation(&observation)?);
        let (n, m) = (self.filter.state().len(), observation.input_matrix().nrows());
        let wanted = [transition.input_matrix().ncols(), observation.input_matrix().ncols()];
        let samples = Samples::new(measurements, m, inputs, wanted.map(Some))?;
        let slices = samples.slices()?;
        let correlated = match cross_covariance {
            Some(cross) => {
                let cross = array::finite_matrix("cross_covariance", cross, [Some(n), Some(m)])?;
                Some((cross, with_same_inputs(py, transition, observation)?))
            }
            None => None,
        };
        let models = (transition.clone(), observation.clone());
        let linear = Linear { filter: self.filter.clone(), models, correlated, gated: false };
        let (filter, trajectory) = recorded(py, [samples.rows, n, m], |record| {
            py.detach(|| linear.run(record, &slices)).map_err(|stop| stop.into_error(py))
        })?;
        self.filter = filter;
        Ok(trajectory)
    }

    /// The states at all samples, given all measurements, earlier and later ones.
    ///
    /// It starts from where the filter stands, which is before the first measurement, and leaves the filter as it is.
    /// The interpreter lock is released meanwhile.
    ///
    /// Parameters
    /// ----------
    /// y : array_like, shape (N, m), or (N,) for m = 1
    ///     NaN is a missing element.
    /// u : array_like, shape (N, inputs), or (N,) for one input, optional
    ///     They go to each model that has an input.
    /// measurements, inputs : array_like, optional
    ///     The same, where the models come first: ``smooth(transition, observation, measurements, inputs=inputs)``.
    /// transition : LinearTransition, optional
    ///     The model of the state; without it the one that is held.
    /// observation : LinearObservation, optional
    ///     The model of the measurement; without it the one that is held.
    ///
    /// Returns
    /// -------
    /// SmoothedTrajectory
    ///     States and covariances, row by row.
    ///
    /// References
    /// ----------
    /// Bryson and Frazier, Smoothing for linear and nonlinear dynamic systems, 1963. Bierman, Fixed interval smoothing
    /// with discrete measurements, 1973.
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
        let (transition, observation) = (self.transition(&transition)?, self.observation(&observation)?);
        let (n, m) = (self.filter.state().len(), observation.input_matrix().nrows());
        let wanted = [transition.input_matrix().ncols(), observation.input_matrix().ncols()];
        let samples = Samples::new(measurements, m, inputs, wanted.map(Some))?;
        let slices = samples.slices()?;
        let filter = self.filter.clone();
        let result = py
            .detach(|| smooth(Smoother::new(filter), transition, observation, &slices, |_| (), || false))
            .map_err(|stop| stop.into_error(py))?;
        smoothed(py, result, samples.rows, n)
    }

    /// What the filter comes to if the models stay as they are: the solution of the Riccati equation.
    ///
    /// It goes on from the covariance of the filter, sample after sample, until nothing changes but by rounding, and
    /// leaves the filter as it is.
    ///
    /// Parameters
    /// ----------
    /// transition : LinearTransition, optional
    ///     The model of the state; without it the one that is held.
    /// observation : LinearObservation, optional
    ///     The model of the measurement; without it the one that is held.
    /// maximum_steps : int, default 100000
    ///     After how many samples it gives up, at most 10 million.
    ///
    /// Returns
    /// -------
    /// SteadyState
    ///     Covariances and gains.
    ///
    /// Raises
    /// ------
    /// EstimationError
    ///     If it has not settled after so many samples.
    ///
    /// Notes
    /// -----
    /// ::
    ///
    ///     P = F (P - P H' (H P H' + R)^-1 H P) F' + Q
    ///
    /// References
    /// ----------
    /// Anderson and Moore, Optimal Filtering, 1979, sections 3.1 and 4.4.
    #[pyo3(signature = (transition = None, observation = None, maximum_steps = Whole(100_000)))]
    #[pyo3(text_signature = "($self, transition=None, observation=None, maximum_steps=100000)")]
    fn steady_state(
        &self,
        py: Python<'_>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
        maximum_steps: Whole,
    ) -> PyResult<SteadyState> {
        let steps = argument::count("maximum_steps", maximum_steps, 1, 10_000_000)?;
        let transition = self.held.transition(py, transition)?;
        let observation = self.held.observation(py, observation)?;
        let (transition, observation) =
            with_same_inputs(py, self.transition(&transition)?, self.observation(&observation)?)?;
        let schedule = GainSchedule::new(self.filter.covariance().clone());
        let mut pulse = Pulse::new(transition.state_matrix().nrows().pow(3));
        let mut raised = None;
        let settled = py.detach(|| {
            schedule.steady_state_unless(&transition, &observation, steps, || {
                raised = pulse.check().err();
                raised.is_some()
            })
        });
        if let Some(raised) = raised {
            return Err(raised);
        }
        let steady = settled.map_err(|error| failed(py, error))?;
        Ok(SteadyState {
            predicted: array::from_matrix(py, &steady.predicted.matrix())?.unbind(),
            filtered: array::from_matrix(py, &steady.filtered.matrix())?.unbind(),
            gain: array::from_matrix(py, &steady.gain)?.unbind(),
            predictor_gain: array::from_matrix(py, &steady.predictor_gain)?.unbind(),
            steps: steady.steps,
        })
    }

    /// The mean of the state, shape (n,).
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        argument::from_vector(py, self.filter.state())
    }

    /// The covariance of the state, shape (n, n).
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

    fn __repr__(&self) -> String {
        let state = self.filter.state();
        format!("KalmanFilter(n={}, state={})", state.len(), list(state.as_slice()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.held.snapshot(py, "KalmanFilter", &self.filter)
    }
}

impl KalmanFilter {
    fn transition<'a>(&self, transition: &'a Bound<'_, PyAny>) -> PyResult<&'a Moved<f64, Dyn, Dyn>> {
        let linear =
            transition.cast::<LinearTransition>().map_err(|_| not_linear("transition", transition))?;
        let model = &linear.get().model;
        check_states("transition", self.filter.state().len(), model.state_matrix().nrows())?;
        Ok(model)
    }

    fn observation<'a>(
        &self,
        observation: &'a Bound<'_, PyAny>,
    ) -> PyResult<&'a Observed<f64, Dyn, Dyn, Dyn>> {
        let linear = observation.cast::<LinearObservation>();
        let model = &linear.map_err(|_| not_linear("observation", observation))?.get().model;
        check_states("observation", self.filter.state().len(), model.output_matrix().ncols())?;
        Ok(model)
    }
}

/// What is said of a model that this filter does not take.
fn not_linear(argument: &str, model: &Bound<'_, PyAny>) -> PyErr {
    let class = if argument == "transition" { "LinearTransition" } else { "LinearObservation" };
    PyTypeError::new_err(format!("{argument}: expected a {class}, found {}", argument::kind(model)))
}
