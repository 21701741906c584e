//! The Luenberger observer.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat_core::nalgebra::{Complex, DVector, Dyn};
use thetahat_core::{LuenbergerObserver as Stepper, Observation, Transition};

use super::argument::{self, check_size, failed, reserve, shaped};
use super::around::{explained, input};
use super::held::{Arguments, Held};
use super::innovation::{self, Innovation, list};
use super::trajectory::{ObserverTrajectory, Samples, Slices, measurement, returned};
use super::used::{Used, UsedObservation, UsedTransition};
use super::{Reduced, Stop};
use crate::array;
use crate::work::Pulse;

/// The Luenberger observer: a model that is corrected by its own error, with a fixed gain.
///
/// Parameters
/// ----------
/// state : array_like, shape (n,)
///     The estimate of the state to start from.
/// gain : array_like, shape (n, m)
///     L. `place` sets it by the poles; it may be the predictor gain of a `SteadyState`.
/// transition : LinearTransition or NonlinearTransition, optional
///     The model of the state, of steps that are not given one.
/// observation : LinearObservation or NonlinearObservation, optional
///     The model of the measurement, of steps that are not given one.
///
/// Raises
/// ------
/// ValueError
///     If a shape is wrong, or an entry not finite.
///
/// Notes
/// -----
/// ::
///
///     x(k+1) = f(x(k), u(k)) + L (y(k) - h(x(k), u(k)))
///
/// In this predictor form the state is that of the next sample. The noises of the models are not used.
///
/// References
/// ----------
/// Luenberger, An introduction to observers, 1971.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from thetahat import LinearObservation, LinearTransition, LuenbergerObserver
/// >>> cart = LinearTransition([[1.0, 0.1], [0.0, 1.0]], np.zeros((2, 2)))
/// >>> position = LinearObservation([[1.0, 0.0]], [[0.0]])
/// >>> observer = LuenbergerObserver([0.0, 0.0], [[0.0], [0.0]])
/// >>> observer.place(cart, position, [0.4 + 0.3j, 0.4 - 0.3j])
/// >>> observer.gain.round(9)
/// array([[1.2],
///        [4.5]])
#[pyclass(module = "thetahat")]
pub(crate) struct LuenbergerObserver {
    pub(crate) observer: Stepper<f64, Dyn, Dyn>,
    pub(super) held: Held,
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl LuenbergerObserver {
    #[new]
    #[pyo3(signature = (state, gain, *, transition = None, observation = None))]
    fn new(
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        gain: &Bound<'_, PyAny>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let state = array::finite_vector("state", state, None)?;
        check_size("state", state.len())?;
        let gain = array::finite_matrix("gain", gain, [Some(state.len()), None])?;
        let held = Held::new(transition, observation, state.len())?;
        Ok(LuenbergerObserver {
            observer: Stepper::new(state, gain).map_err(|error| failed(py, error))?,
            held,
        })
    }

    /// Set the gain so that F - L H has these poles, where F and H are the Jacobians at the estimate.
    ///
    /// Parameters
    /// ----------
    /// transition : LinearTransition or NonlinearTransition
    ///     The model of the state.
    /// observation : LinearObservation or NonlinearObservation
    ///     The model of the measurement.
    /// poles : array_like, shape (n,)
    ///     Inside the unit circle; complex ones in conjugate pairs, side by side.
    /// weights : array_like, shape (m,), optional
    ///     How several outputs are combined into one, from which the gain is made. One output has the weight 1.
    /// input : float or array_like, shape (inputs,), optional
    ///     u(k). A function gets it as an array, which is empty without it.
    ///
    /// Raises
    /// ------
    /// EstimationError
    ///     If the output does not tell all states apart. Nothing has changed then.
    ///
    /// References
    /// ----------
    /// Datta, An algorithm to assign eigenvalues in a Hessenberg matrix: single input case, 1987.
    #[pyo3(signature = (transition, observation, poles, *, weights = None, input = None))]
    fn place(
        &mut self,
        py: Python<'_>,
        transition: &Bound<'_, PyAny>,
        observation: &Bound<'_, PyAny>,
        poles: &Bound<'_, PyAny>,
        weights: Option<&Bound<'_, PyAny>>,
        input: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (n, m) = self.observer.gain().shape();
        let transition = UsedTransition::new(transition, n)?;
        let observation = self.observed(observation)?;
        let widest = transition.inputs().unwrap_or(0).max(observation.inputs().unwrap_or(0));
        let input = if widest > 0 { argument::input(input, widest)? } else { self::input(input, None)? };
        let weights = match weights {
            Some(weights) => array::finite_vector("weights", weights, Some(m))?,
            None if m == 1 => DVector::from_element(1, 1.0),
            None => {
                return Err(PyValueError::new_err(format!("weights: expected {m} numbers, found None")));
            }
        };
        let numpy = py.import("numpy")?;
        let part = |name: &str| -> PyResult<DVector<f64>> {
            let part = numpy.call_method1(name, (poles,))?;
            array::finite_vector("poles", &part, Some(n))
        };
        let poles = if numpy.call_method1("iscomplexobj", (poles,))?.is_truthy()? {
            part("real")?.zip_map(&part("imag")?, Complex::new)
        } else {
            array::finite_vector("poles", poles, Some(n))?.map(Complex::from)
        };
        self.observer.place(&transition, &observation, &input, &weights, &poles).map_err(|error| {
            match transition.trouble().or_else(|| observation.trouble()) {
                Some(trouble) => trouble.into_error(None),
                None => failed(py, error),
            }
        })
    }

    /// Move the state on by one sample, corrected by the measurement.
    ///
    /// Parameters
    /// ----------
    /// y : float or array_like, shape (m,)
    ///     y(k). NaN is a missing element: its error counts as 0.
    /// u : float or array_like, shape (inputs,), optional
    ///     u(k), for each model that has an input.
    /// measurement, input : array_like, optional
    ///     The same, where the models come first: ``update(transition, observation, measurement, input=input)``.
    /// transition : LinearTransition or NonlinearTransition, optional
    ///     The model of the state; without it the one that is held.
    /// observation : LinearObservation or NonlinearObservation, optional
    ///     The model of the measurement; without it the one that is held.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     The error. An observer knows no variances.
    #[pyo3(signature = (y, u = None, measurement = None, *, input = None, transition = None, observation = None))]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn update(
        &mut self,
        py: Python<'_>,
        y: &Bound<'_, PyAny>,
        u: Option<&Bound<'_, PyAny>>,
        measurement: Option<&Bound<'_, PyAny>>,
        input: Option<&Bound<'_, PyAny>>,
        transition: Option<&Bound<'_, PyAny>>,
        observation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Innovation> {
        let given = Arguments::new(y, u, measurement, input, [transition, observation]);
        let (measurement, input) = (given.measured("measurement")?, given.u);
        let transition = self.held.transition(py, given.transition)?;
        let observation = self.held.observation(py, given.observation)?;
        let (n, m) = self.observer.gain().shape();
        let transition = UsedTransition::new(&transition, n)?;
        let observation = self.observed(&observation)?;
        let known = transition.inputs().unwrap_or(0).max(observation.inputs().unwrap_or(0));
        let any = transition.inputs().is_none() || observation.inputs().is_none();
        let wanted = if known > 0 || !any { Some(known) } else { None };
        let input = self::input(input, wanted)?;
        check_inputs(&transition, &observation, input.len())?;
        let (measurement, single) = self::measurement(measurement, m)?;
        let innovation =
            self.observer.update(&transition, &observation, &input, &measurement).map_err(|error| {
                match transition.trouble().or_else(|| observation.trouble()) {
                    Some(trouble) => trouble.into_error(None),
                    None => failed(py, error),
                }
            })?;
        Ok(returned(innovation, single))
    }

    /// Take many samples: the same as `update` in a loop, to the bit.
    ///
    /// With linear models the interpreter lock is released meanwhile.
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
    /// ObserverTrajectory
    ///     States and errors, row by row.
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
    ) -> PyResult<ObserverTrajectory> {
        let given = Arguments::new(y, u, measurements, inputs, [transition, observation]);
        let (measurements, inputs) = (given.measured("measurements")?, given.u);
        let transition = self.held.transition(py, given.transition)?;
        let observation = self.held.observation(py, given.observation)?;
        let (n, m) = self.observer.gain().shape();
        let transition = UsedTransition::new(&transition, n)?;
        let observation = self.observed(&observation)?;
        let samples = Samples::new(measurements, m, inputs, [transition.inputs(), observation.inputs()])?;
        let slices = samples.slices()?;
        let mut record = Record {
            states: reserve(&[samples.rows, n])?,
            errors: reserve(&[samples.rows, m])?,
            codes: reserve(&[samples.rows])?,
        };
        let mut stepped = self.observer.clone();
        if let (Used::Linear(transition), Used::Linear(observation)) = (&transition, &observation) {
            let (transition, observation) = (*transition, *observation);
            py.detach(|| record.run(&mut stepped, transition, observation, &slices))
                .map_err(|stop| stop.into_error(py))?;
        } else {
            record
                .run(&mut stepped, &transition, &observation, &slices)
                .map_err(|stop| explained(py, &transition, &observation, stop))?;
        }
        let Record { states, errors, codes } = record;
        let trajectory = ObserverTrajectory {
            predicted_states: shaped(py, states, [samples.rows, n])?.unbind(),
            errors: shaped(py, errors, [samples.rows, m])?.unbind(),
            codes: PyArray1::from_vec(py, codes).unbind(),
        };
        self.observer = stepped;
        Ok(trajectory)
    }

    /// The estimate of the state at the next sample, shape (n,).
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        argument::from_vector(py, self.observer.state())
    }

    /// The gain L, shape (n, m).
    #[getter]
    fn gain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_matrix(py, self.observer.gain())
    }

    fn __repr__(&self) -> String {
        let (n, m) = self.observer.gain().shape();
        format!("LuenbergerObserver(n={n}, outputs={m}, state={})", list(self.observer.state().as_slice()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.held.snapshot(py, "LuenbergerObserver", &self.observer)
    }
}

/// The results of the rows so far.
struct Record {
    states: Vec<f64>,
    errors: Vec<f64>,
    codes: Vec<u8>,
}

impl Record {
    fn run(
        &mut self,
        observer: &mut Stepper<f64, Dyn, Dyn>,
        transition: &impl Transition<f64, Dyn, Dyn>,
        observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
        samples: &Slices<'_>,
    ) -> Result<(), Stop> {
        let mut sample = samples.sample(Dyn(samples.outputs));
        let mut pulse = Pulse::new(observer.state().len().pow(2));
        for row in 0..samples.rows {
            pulse.check()?;
            samples.read(row, &mut sample);
            self.states.extend_from_slice(observer.state().as_slice());
            let [first, second] = &sample.inputs;
            let input = if first.is_empty() { second } else { first };
            let told = observer
                .update(transition, observation, input, &sample.measurement)
                .map_err(|error| (row, error))?;
            self.errors.extend_from_slice(told.error.as_slice());
            self.codes.push(innovation::code(told.action));
        }
        Ok(())
    }
}

impl LuenbergerObserver {
    /// The argument `observation`, with as many outputs as the gain has columns.
    fn observed<'a, 'py>(&self, observation: &'a Bound<'py, PyAny>) -> PyResult<UsedObservation<'a, 'py>> {
        let (n, m) = self.observer.gain().shape();
        let observation = UsedObservation::new(observation, n, Some(m))?;
        if observation.outputs() == m {
            return Ok(observation);
        }
        let found = observation.outputs();
        Err(PyValueError::new_err(format!("observation: expected a model with {m} outputs, found {found}")))
    }
}

fn check_inputs(
    transition: &UsedTransition<'_, '_>,
    observation: &UsedObservation<'_, '_>,
    length: usize,
) -> PyResult<()> {
    let fits = |wanted: Option<usize>| wanted.is_none_or(|count| count == 0 || count == length);
    if fits(transition.inputs()) && fits(observation.inputs()) {
        return Ok(());
    }
    Err(PyValueError::new_err(
        "input: expected as many in the transition as in the observation, where both have some",
    ))
}
