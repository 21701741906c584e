//! A Kalman filter whose measurements may come late.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use thetahat_core::nalgebra::Dyn;
use thetahat_core::{ExtendedKalmanFilter, OutOfSequenceFilter as Stepper};

use super::Reduced;
use super::argument::{self, LARGEST_SIZE, Whole, failed};
use super::held::{Held, predicted, renamed};
use super::innovation::{Innovation, list};
use super::kalman::started;
use super::trajectory::{measurement, returned};
use super::used::{UsedObservation, UsedTransition};
use crate::array;

/// A Kalman filter, extended or not, that takes a measurement of some samples ago.
///
/// An analysis in a laboratory, a camera, a sensor behind a slow bus: what they tell is of an earlier sample. The
/// filter keeps the last samples, puts a late element in its place and runs again from there: the result is the same to
/// the bit as if it had come in time.
///
/// Parameters
/// ----------
/// state : array_like, shape (n,)
///     The estimate of the state before the first measurement.
/// covariance : float, or array_like of shape (n, n)
///     The covariance of its error; a number is the variance of each state.
/// samples : int
///     How late a measurement may be, in samples, 1 to 100000.
/// outputs : int, default 1
///     The number of elements of a measurement, those of all sensors together. What is not there, or not yet, is NaN.
/// inputs : int, default 0
///     The number of inputs.
/// gate : float, default inf
///     A measurement whose normalised innovation squared is above it is not used.
/// release : int, default 0
///     After so many measurements in a row above the gate, those that follow are used. 0 is a gate that never lets go.
/// iterations : int, default 1
///     How often a correction linearises the observation.
/// transition : LinearTransition or NonlinearTransition, optional
///     The model of the state, of steps that are not given one.
/// observation : LinearObservation or NonlinearObservation, optional
///     The model of the measurement, of steps that are not given one.
///
/// Notes ----- The models are arguments, linear or not, as for `ExtendedKalmanFilter`; for a late measurement they must
/// be those of all the samples since. (A function without its Jacobian is differenced by steps of the deviations that
/// the states have now: then the result is the same but for the error of the differences.)
///
/// References ---------- Larsen, Andersen, Ravn and Poulsen, Incorporation of time delayed measurements in a
/// discrete-time Kalman filter, 1998. Bar-Shalom, Update with out-of-sequence measurements in tracking: exact solution,
/// 2002.
///
/// Examples
/// --------
/// >>> from math import nan
/// >>> from thetahat import LinearObservation, LinearTransition, OutOfSequenceFilter
/// >>> drift = LinearTransition([[1.0]], [[0.01]])
/// >>> both = LinearObservation([[1.0], [1.0]], [[1.0, 0.0], [0.0, 0.01]])  # a coarse probe, and an analysis
/// >>> tank = OutOfSequenceFilter([0.0], 100.0, transition=drift, observation=both, samples=4, outputs=2)
/// >>> for k in range(20):
/// ...     innovation = tank.update([6.0 if k % 2 == 0 else 4.0, nan])
/// ...     if k == 15:  # of the sample that was taken at k = 12
/// ...         late = tank.correct_late(drift, both, 3, [nan, 5.0])
/// ...     tank.predict()
/// >>> bool(abs(tank.state[0] - 5.0) < 0.1)
/// True
#[pyclass(module = "thetahat")]
pub(crate) struct OutOfSequenceFilter {
    pub(super) filter: Stepper<f64, Dyn, Dyn, Dyn, Dyn>,
    pub(super) held: Held,
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl OutOfSequenceFilter {
    #[new]
    #[pyo3(signature = (state, covariance, *, transition = None, observation = None, samples, outputs = Whole(1), inputs = Whole(0), gate = f64::INFINITY,
        release = Whole(0), iterations = Whole(1)))]
    #[pyo3(
        text_signature = "(state, covariance, *, transition=None, observation=None, samples, outputs=1, inputs=0, gate=1e999, release=0, iterations=1)"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
        samples: Whole,
        outputs: Whole,
        inputs: Whole,
        gate: f64,
        release: Whole,
        iterations: Whole,
    ) -> PyResult<Self> {
        let samples = argument::count("samples", samples, 1, 100_000)?;
        let outputs = argument::size("outputs", outputs)?;
        let inputs = argument::count("inputs", inputs, 0, LARGEST_SIZE)?;
        let iterations = argument::count("iterations", iterations, 1, 1000)?;
        let filter = ExtendedKalmanFilter::from(started(py, state, covariance, gate, release)?);
        let held = Held::new(transition, observation, filter.state().len())?;
        filter
            .with_iterations(iterations)
            .and_then(|filter| Stepper::new(filter, Dyn(outputs), Dyn(inputs), samples))
            .map(|filter| OutOfSequenceFilter { filter, held })
            .map_err(|error| failed(py, error))
    }

    /// Move the state on by one sample.
    ///
    /// Parameters
    /// ----------
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k), the one that `update` had.
    /// input : float or array_like, optional
    ///     The same, where the model comes first: ``predict(transition, input)``.
    /// transition : LinearTransition or NonlinearTransition, optional
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
        let model = UsedTransition::new(&transition, self.filter.history().states)?;
        let input = argument::input(input, self.filter.history().inputs)?;
        model.linearise_within(self.filter.filter().covariance());
        let mut filter = self.filter.clone();
        let predicted = filter.predict(&model, &input);
        if let Some(trouble) = model.trouble() {
            return Err(trouble.into_error(None));
        }
        predicted.map_err(|error| failed(py, error))?;
        self.filter = filter;
        Ok(())
    }

    /// Correct the state by a measurement of now.
    ///
    /// Parameters
    /// ----------
    /// y : float or array_like, shape (outputs,)
    ///     y(k). NaN is an element that is missing, or that will come late.
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k).
    /// observation : LinearObservation or NonlinearObservation, optional
    ///     The model of all sensors; without it the one that the filter holds.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     With floats where the measurement is a float, else with arrays.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number too large, an element has come before, or a function returns NaN or infinity.
    ///     Nothing has changed then.
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
        let history = self.filter.history();
        let model = UsedObservation::new(&observation, history.states, Some(history.outputs))?;
        let input = argument::input(input, history.inputs)?;
        let (measurement, single) = self::measurement(measurement, history.outputs)?;
        model.linearise_within(self.filter.filter().covariance());
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

    /// Take a measurement of some samples ago, and run again from there.
    ///
    /// Parameters
    /// ----------
    /// transition : LinearTransition or NonlinearTransition
    ///     The model of the state.
    /// observation : LinearObservation or NonlinearObservation
    ///     The model of all sensors.
    /// age : int
    ///     How many samples ago it was, 1 to `kept`.
    /// measurement : float or array_like, shape (outputs,)
    ///     The elements of y(k - age) that had not come yet; the others are NaN.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     That of all elements of that sample.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If `age` is too large or not above 0, an element has come before, or as for `update`. Nothing has changed
    ///     then.
    fn correct_late(
        &mut self,
        py: Python<'_>,
        transition: &Bound<'_, PyAny>,
        observation: &Bound<'_, PyAny>,
        age: Whole,
        measurement: &Bound<'_, PyAny>,
    ) -> PyResult<Innovation> {
        let history = self.filter.history();
        let age = argument::count("age", age, 1, history.samples)?;
        let moved = UsedTransition::new(transition, history.states)?;
        let observed = UsedObservation::new(observation, history.states, Some(history.outputs))?;
        let (measurement, single) = self::measurement(measurement, history.outputs)?;
        moved.linearise_within(self.filter.filter().covariance());
        observed.linearise_within(self.filter.filter().covariance());
        let mut filter = self.filter.clone();
        let corrected = filter.correct_late(&moved, &observed, age, &measurement);
        if let Some(trouble) = moved.trouble().or_else(|| observed.trouble()) {
            return Err(trouble.into_error(None));
        }
        let innovation = corrected.map_err(|error| failed(py, error))?;
        self.filter = filter;
        Ok(returned(innovation, single))
    }

    /// The estimate of the state, shape (n,).
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        argument::from_vector(py, self.filter.filter().state())
    }

    /// The covariance of its error, shape (n, n).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, &self.filter.filter().covariance().matrix())
    }

    /// How late a measurement may be, in samples.
    #[getter]
    fn samples(&self) -> usize {
        self.filter.history().samples
    }

    /// How late a measurement may be now: less than `samples` while there were not as many.
    #[getter]
    fn kept(&self) -> usize {
        self.filter.kept()
    }

    /// How many of the latest measurements were above the gate, since the last one within it.
    #[getter]
    fn gated_in_a_row(&self) -> u16 {
        self.filter.filter().gated_in_a_row()
    }

    fn __repr__(&self) -> String {
        let (state, samples) = (self.filter.filter().state(), self.filter.history().samples);
        format!("OutOfSequenceFilter(n={}, samples={samples}, state={})", state.len(), list(state.as_slice()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.held.snapshot(py, "OutOfSequenceFilter", &self.filter)
    }
}
