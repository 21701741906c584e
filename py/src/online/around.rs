//! What the filters have in common that take models of functions: the extended and the unscented Kalman filter.

use pyo3::prelude::*;
use thetahat_core::nalgebra::{DVector, Dyn};
use thetahat_core::{
    Covariance, Error, ExtendedKalmanFilter, Innovation, Observation, Smoothed, Smoother, Transition,
    UnscentedKalmanFilter,
};

use super::Stop;
use super::argument;
use super::trajectory::{Sample, Slices, Smoothed as SmoothedRows, Steps};
use super::used::Used;
use crate::array;
use crate::work::Pulse;

/// A filter whose models are arguments of each step, or a smoother around one.
pub(crate) trait Around {
    fn state(&self) -> &DVector<f64>;
    fn covariance(&self) -> &Covariance<f64, Dyn>;
    fn predict(
        &mut self,
        transition: &impl Transition<f64, Dyn, Dyn>,
        input: &DVector<f64>,
    ) -> Result<(), Error>;
    fn correct(
        &mut self,
        observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
        input: &DVector<f64>,
        measurement: &DVector<f64>,
    ) -> Result<Innovation<f64, DVector<f64>>, Error>;
}

/// A smoother around such a filter.
pub(crate) trait Smooths: Around {
    fn smooth(&self) -> Result<Vec<Smoothed<f64, Dyn>>, Error>;
}

/// Each method is that of the type itself; `filter` is where its estimate stands.
macro_rules! around {
    ($kind:ty, $($filter:ident)?) => {
        impl Around for $kind {
            fn state(&self) -> &DVector<f64> {
                self$(.$filter())?.state()
            }

            fn covariance(&self) -> &Covariance<f64, Dyn> {
                self$(.$filter())?.covariance()
            }

            fn predict(
                &mut self,
                transition: &impl Transition<f64, Dyn, Dyn>,
                input: &DVector<f64>,
            ) -> Result<(), Error> {
                self.predict(transition, input)
            }

            fn correct(
                &mut self,
                observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
                input: &DVector<f64>,
                measurement: &DVector<f64>,
            ) -> Result<Innovation<f64, DVector<f64>>, Error> {
                self.correct(observation, input, measurement)
            }
        }
    };
}

type Extended = ExtendedKalmanFilter<f64, Dyn>;
type Unscented = UnscentedKalmanFilter<f64, Dyn>;

around!(Extended,);
around!(Unscented,);
around!(Smoother<f64, Dyn, Extended>, filter);
around!(Smoother<f64, Dyn, Unscented>, filter);

impl Smooths for Smoother<f64, Dyn, Extended> {
    fn smooth(&self) -> Result<Vec<Smoothed<f64, Dyn>>, Error> {
        self.smooth()
    }
}

impl Smooths for Smoother<f64, Dyn, Unscented> {
    fn smooth(&self) -> Result<Vec<Smoothed<f64, Dyn>>, Error> {
        self.smooth()
    }
}

/// A filter with its models. `before` is called before a model is used; `troubled` says whether a function went wrong.
pub(crate) struct Stepped<'a, F, T, O> {
    pub(crate) filter: F,
    pub(crate) transition: &'a T,
    pub(crate) observation: &'a O,
    pub(crate) before: fn(&T, &O, &Covariance<f64, Dyn>),
    pub(crate) troubled: fn(&T, &O) -> bool,
}

impl<F, T, O> Stepped<'_, F, T, O> {
    /// What was answered, unless a function went wrong: a noise that it did not give does not show in the answer. The
    /// error gives way to what the function said.
    fn checked<A>(&self, answer: Result<A, Error>) -> Result<A, Error> {
        if (self.troubled)(self.transition, self.observation) { Err(Error::Overflow) } else { answer }
    }
}

impl<F: Around, T: Transition<f64, Dyn, Dyn>, O: Observation<f64, Dyn, Dyn, Dyn>> Steps<Dyn, Dyn>
    for Stepped<'_, F, T, O>
{
    fn state(&self) -> &DVector<f64> {
        self.filter.state()
    }

    fn covariance(&self) -> &Covariance<f64, Dyn> {
        self.filter.covariance()
    }

    fn correct(&mut self, sample: &Sample<Dyn>) -> Result<Innovation<f64, DVector<f64>>, Error> {
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

/// Smooths from where this smoother stands. `before` is told of each estimate before a model is used.
pub(crate) fn smooth<T: Transition<f64, Dyn, Dyn>, O: Observation<f64, Dyn, Dyn, Dyn>>(
    mut smoother: impl Smooths,
    transition: &T,
    observation: &O,
    samples: &Slices<'_>,
    before: impl Fn(&Covariance<f64, Dyn>),
    troubled: impl Fn() -> bool,
) -> Result<SmoothedRows, Stop> {
    let mut sample = samples.sample(Dyn(samples.outputs));
    // The error gives way to what the function said.
    let well = |row| if troubled() { Err((row, Error::Overflow)) } else { Ok(()) };
    let mut pulse = Pulse::new(smoother.state().len().pow(3));
    for row in 0..samples.rows {
        pulse.check()?;
        if row > 0 {
            before(smoother.covariance());
            smoother.predict(transition, &sample.inputs[0]).map_err(|error| (row - 1, error))?;
            well(row - 1)?;
        }
        samples.read(row, &mut sample);
        before(smoother.covariance());
        let corrected = smoother.correct(observation, &sample.inputs[1], &sample.measurement);
        corrected.map_err(|error| (row, error))?;
        well(row)?;
    }
    let (mut states, mut covariances) = (Vec::new(), Vec::new());
    for smoothed in smoother.smooth().map_err(|error| (0, error))? {
        states.extend_from_slice(smoothed.state.as_slice());
        covariances.extend_from_slice(smoothed.covariance.as_slice());
    }
    Ok((states, covariances))
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

/// The methods of a class with a stepper in `filter` and the models that it holds in `held`: its own ones, and those
/// that all such classes have. `smoother`: what makes a smoother of the stepper.
macro_rules! around_models {
    ($class:ident, $smoother:ident, { $($own:tt)* }) => {
        #[pymethods]
        #[pyo3(crate = "crate::in_use")]
        impl $class {
            $($own)*

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
                let input = around::input(input, model.inputs())?;
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
            ///     If a shape is wrong, a number too large, or a function returns NaN or infinity. Nothing has changed
            ///     then.
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
                let input = around::input(input, model.inputs())?;
                let (measurement, single) = trajectory::measurement(measurement, model.outputs())?;
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
            /// With linear models the interpreter lock is released meanwhile. Afterwards the filter has predicted the
            /// sample after the last.
            ///
            /// Parameters
            /// ----------
            /// y : array_like, shape (N, m), or (N,) for m = 1
            ///     NaN is a missing element.
            /// u : array_like, shape (N, inputs), or (N,) for one input, optional
            ///     They go to each function, and to each linear model that has an input.
            /// measurements, inputs : array_like, optional
            ///     The same, where the models come first:
            ///     ``run(transition, observation, measurements, inputs=inputs)``.
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
                        let mut stepped = Stepped {
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
                    let mut stepped = Stepped {
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
            /// It starts from where the filter stands, which is before the first measurement, and leaves the filter as
            /// it is. It smooths with the linearisations that the filter makes on its way.
            ///
            /// Parameters
            /// ----------
            /// y : array_like, shape (N, m), or (N,) for m = 1
            ///     NaN is a missing element.
            /// u : array_like, shape (N, inputs), or (N,) for one input, optional
            ///     They go to each function, and to each linear model that has an input.
            /// measurements, inputs : array_like, optional
            ///     The same, where the models come first:
            ///     ``smooth(transition, observation, measurements, inputs=inputs)``.
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
                let result = smooth(Smoother::$smoother(self.filter.clone()), &transition, &observation, &slices, before, troubled)
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

            fn __repr__(&self) -> String {
                let state = self.filter.state();
                format!("{}(n={}, state={})", stringify!($class), state.len(), list(state.as_slice()))
            }

            fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
                self.held.snapshot(py, stringify!($class), &self.filter)
            }
        }
    };
}

pub(crate) use around_models;
