//! The extended Kalman filter of a model whose functions are written in C.

use core::ffi::c_void;

use thetahat_core::nalgebra::{Const, SMatrix, SVector};
use thetahat_core::{Covariance, ExtendedKalmanFilter, Observation, Transition};

use crate::error::code;
use crate::innovation::Innovation;
use crate::memory::{self, Init, Kind, Made, Place, View, Word};
use crate::shapes::{covariance, matrix, vector, write};
use crate::{Error, Number};

/// The extended Kalman filter of x(k+1) = f(x) + w, y = h(x) + v, with w ~ (0, Q) and v ~ (0, R).
pub struct Ekf {
    _opaque: [u8; 0],
}

/// The numbers of states and outputs of a `thetahat_ekf`: `thetahat_ekf_4_2` for 4 states and 2 outputs.
pub struct EkfSize {
    states: usize,
    init: Init<Ekf>,
    view: View<dyn Filter>,
}

impl EkfSize {
    pub(crate) const fn new<const N: usize, const M: usize>() -> Self {
        EkfSize { states: N, init: init::<N, M>, view: |body| body.cast::<Noisy<N, M>>() }
    }
}

impl Kind for Ekf {
    const TAG: u32 = 0x464b_4554;
    type Size = EkfSize;
    type Body = dyn Filter;

    fn view(size: &EkfSize) -> View<dyn Filter> {
        size.view
    }
}

/// A function of the state: `value` from `state`; `context` is that of the function. Arrays do not overlap. Values are
/// 0 before the call, so that only the others need be written.
pub type FunctionOfState =
    Option<unsafe extern "C" fn(state: *const Number, value: *mut Number, context: *mut c_void)>;

/// A function of the state and its Jacobian: f or h of a model. Inputs and time are in the context. A function that
/// writes NaN or infinity makes the filter return an error and stay as it was.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Function {
    /// f(x), n numbers, or h(x), m numbers.
    pub value: FunctionOfState,
    /// df/dx, n x n, or dh/dx, m x n, row by row.
    pub jacobian: FunctionOfState,
    /// What the functions are called with.
    pub context: *mut c_void,
}

/// A function of C with all its parts.
#[derive(Clone, Copy)]
pub(crate) struct Model {
    value: unsafe extern "C" fn(*const Number, *mut Number, *mut c_void),
    jacobian: unsafe extern "C" fn(*const Number, *mut Number, *mut c_void),
    context: *mut c_void,
}

impl Model {
    /// The model that C gives.
    ///
    /// # Safety
    ///
    /// The pointer is null or valid. While the model is used, its functions keep what their documentation says.
    unsafe fn new(function: *const Function) -> Result<Self, Error> {
        match *memory::follow(function)? {
            Function { value: Some(value), jacobian: Some(jacobian), context } => {
                Ok(Model { value, jacobian, context })
            }
            _ => Err(Error::NullPointer),
        }
    }

    fn value<const N: usize, const R: usize>(&self, state: &SVector<Number, N>) -> SVector<Number, R> {
        let mut value: SVector<Number, R> = vector(&[]);
        // SAFETY: `new` was promised that the function writes as many numbers.
        unsafe { (self.value)(state.as_slice().as_ptr(), value.as_mut_slice().as_mut_ptr(), self.context) };
        value
    }

    fn jacobian<const N: usize, const R: usize>(&self, state: &SVector<Number, N>) -> SMatrix<Number, R, N> {
        let mut rows: SMatrix<Number, N, R> = matrix(&[], R);
        // SAFETY: `new` was promised that the function writes as many numbers.
        unsafe { (self.jacobian)(state.as_slice().as_ptr(), rows.as_mut_slice().as_mut_ptr(), self.context) };
        matrix(rows.as_slice(), N)
    }
}

/// A model with the covariance of its noise.
struct With<'a, C> {
    model: Model,
    noise: &'a C,
}

impl<const N: usize> Transition<Number, Const<N>> for With<'_, Covariance<Number, Const<N>>> {
    fn next(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SVector<Number, N> {
        self.model.value(state)
    }

    fn next_jacobian(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SMatrix<Number, N, N> {
        self.model.jacobian(state)
    }

    fn process_noise(&self, _: &SVector<Number, N>, _: &SVector<Number, 0>) -> Covariance<Number, Const<N>> {
        self.noise.clone()
    }
}

impl<const N: usize, const M: usize> Observation<Number, Const<N>, Const<M>>
    for With<'_, Covariance<Number, Const<M>>>
{
    fn output(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SVector<Number, M> {
        self.model.value(state)
    }

    fn output_jacobian(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SMatrix<Number, M, N> {
        self.model.jacobian(state)
    }

    fn measurement_noise(
        &self,
        _: &SVector<Number, N>,
        _: &SVector<Number, 0>,
    ) -> Covariance<Number, Const<M>> {
        self.noise.clone()
    }
}

/// A filter and the covariances of the noises.
struct Noisy<const N: usize, const M: usize> {
    filter: ExtendedKalmanFilter<Number, Const<N>>,
    process: Covariance<Number, Const<N>>,
    measurement: Covariance<Number, Const<M>>,
}

/// What a filter of any size does.
pub(crate) trait Filter {
    /// The numbers of states and outputs.
    fn sizes(&self) -> [usize; 2];
    fn set_noise(&mut self, process: Option<&[Number]>, measurement: Option<&[Number]>) -> Result<(), Error>;
    fn set_state(&mut self, state: &[Number]) -> Result<(), Error>;
    fn set_covariance(&mut self, variance: Option<&[Number]>) -> Result<(), Error>;
    fn widen(&mut self, factor: Number) -> Result<(), Error>;
    fn set_gate(&mut self, gate: Number, release: u16) -> Result<(), Error>;
    fn set_iterations(&mut self, count: usize) -> Result<(), Error>;
    fn predict(&mut self, transition: Model) -> Result<(), Error>;
    fn correct(&mut self, observation: Model, measurement: &[Number]) -> Result<Innovation, Error>;
    fn state(&self) -> &[Number];
    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error>;
}

impl<const N: usize, const M: usize> Filter for Noisy<N, M> {
    fn sizes(&self) -> [usize; 2] {
        [N, M]
    }

    fn set_noise(&mut self, process: Option<&[Number]>, measurement: Option<&[Number]>) -> Result<(), Error> {
        (self.process, self.measurement) = (covariance(process)?, covariance(measurement)?);
        Ok(())
    }

    fn set_state(&mut self, state: &[Number]) -> Result<(), Error> {
        Ok(self.filter.set_state(vector(state))?)
    }

    fn set_covariance(&mut self, variance: Option<&[Number]>) -> Result<(), Error> {
        Ok(self.filter.set_covariance(covariance(variance)?)?)
    }

    fn widen(&mut self, factor: Number) -> Result<(), Error> {
        Ok(self.filter.widen(factor)?)
    }

    fn set_gate(&mut self, gate: Number, release: u16) -> Result<(), Error> {
        self.filter.set_gate(gate)?;
        self.filter.set_release(release);
        Ok(())
    }

    fn set_iterations(&mut self, count: usize) -> Result<(), Error> {
        Ok(self.filter.set_iterations(count)?)
    }

    fn predict(&mut self, model: Model) -> Result<(), Error> {
        Ok(self.filter.predict(&With { model, noise: &self.process }, &vector(&[]))?)
    }

    fn correct(&mut self, model: Model, measurement: &[Number]) -> Result<Innovation, Error> {
        let observation = With { model, noise: &self.measurement };
        Ok(self.filter.correct(&observation, &vector(&[]), &vector(measurement))?.into())
    }

    fn state(&self) -> &[Number] {
        self.filter.state().as_slice()
    }

    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error> {
        Ok(self.filter.covariance().write_into(target)?)
    }
}

fn init<const N: usize, const M: usize>(
    place: Place<Ekf>,
    state: &[Number],
    variance: Option<&[Number]>,
) -> Made<Ekf> {
    let filter = ExtendedKalmanFilter::new(vector(state), covariance(variance)?)?;
    let (process, measurement) = (Covariance::zero(Const), Covariance::zero(Const));
    place.write(Noisy::<N, M> { filter, process, measurement })
}

/// Makes a filter that starts from this state and the covariance of its error. Set the noise next.
///
/// - ekf: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_EKF_WORDS(n, m)` words, and their size in bytes.
/// - size: `&thetahat_ekf_n_m` for n states and m outputs.
/// - state: x, n numbers.
/// - covariance: P, n x n, symmetric; NULL for 0, a state that is known.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_init(
    ekf: *mut *mut Ekf,
    memory: *mut Word,
    bytes: usize,
    size: *const EkfSize,
    state: *const Number,
    covariance: *const Number,
) -> Error {
    code(|| {
        let handle = memory::follow(ekf)?.cast_mut();
        let place = Place::<Ekf>::new(memory, bytes, size)?;
        let size = place.size();
        let state = memory::array(state, size.states)?;
        let covariance = memory::optional(covariance, size.states * size.states)?;
        *handle = (size.init)(place, state, covariance)?;
        Ok(())
    })
}

/// Sets Q, n x n, and R, m x m; NULL for 0. Set them again where they depend on the state or vary in time. About n^3 +
/// m^3 multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_noise(
    ekf: *mut Ekf,
    process_noise: *const Number,
    measurement_noise: *const Number,
) -> Error {
    code(|| {
        let filter = memory::open(ekf)?;
        let [n, m] = filter.sizes();
        filter.set_noise(memory::optional(process_noise, n * n)?, memory::optional(measurement_noise, m * m)?)
    })
}

/// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
///
/// Errors: NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_state(ekf: *mut Ekf, state: *const Number) -> Error {
    code(|| {
        let filter = memory::open(ekf)?;
        let [states, _] = filter.sizes();
        filter.set_state(memory::array(state, states)?)
    })
}

/// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
/// multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_covariance(ekf: *mut Ekf, covariance: *const Number) -> Error {
    code(|| {
        let filter = memory::open(ekf)?;
        let [states, _] = filter.sizes();
        filter.set_covariance(memory::optional(covariance, states * states)?)
    })
}

/// Takes P for larger by a factor, at least 1: the next measurements move the state more. For a state that is less sure
/// than P says, as after a fault.
///
/// Errors: OUT_OF_RANGE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_widen(ekf: *mut Ekf, factor: Number) -> Error {
    code(|| memory::open(ekf)?.widen(factor))
}

/// Sets a gate, and after how many measurements above it in a row it lets go: as `thetahat_kalman_set_gate`.
///
/// Errors: OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_gate(ekf: *mut Ekf, gate: Number, release: u32) -> Error {
    code(|| {
        let release = u16::try_from(release).map_err(|_| Error::OutOfRange)?;
        memory::open(ekf)?.set_gate(gate, release)
    })
}

/// Sets how often a measurement update linearises h, each time about its last result: 1 at first, 1 or more.
///
/// Errors: OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_iterations(ekf: *mut Ekf, count: u32) -> Error {
    code(|| memory::open(ekf)?.set_iterations(count as usize))
}

/// The time update: one sample ahead. The functions of the transition must not call with this filter: that answers
/// BUSY. About 1.5 n^3 multiply-adds, where the quick way would lose digits n^3 more.
///
/// Errors: NOT_FINITE if the next state or the Jacobian is NaN or infinite; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_predict(ekf: *mut Ekf, transition: *const Function) -> Error {
    code(|| {
        let transition = Model::new(transition)?;
        memory::busy(ekf, |filter| filter.predict(transition))
    })
}

/// The measurement update. A NaN in the measurement is a missing element: it is skipped alone, and the others are used.
/// The functions of the observation must not call with this filter: that answers BUSY. For each linearisation about m
/// (1.5 n^2 + 6 n) multiply-adds.
///
/// - observation: h, and its Jacobian.
/// - measurement: y(k), m numbers.
/// - innovation: what was new; may be NULL.
///
/// Errors: INFINITE; NOT_FINITE if h or its Jacobian is NaN or infinite; NO_VARIANCE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_correct(
    ekf: *mut Ekf,
    observation: *const Function,
    measurement: *const Number,
    innovation: *mut Innovation,
) -> Error {
    code(|| {
        let observation = Model::new(observation)?;
        let [_, outputs] = memory::read(ekf)?.sizes();
        let measurement = memory::array(measurement, outputs)?;
        memory::busy(ekf, |filter| {
            let told = filter.correct(observation, measurement)?;
            memory::answer(innovation, told);
            Ok(())
        })
    })
}

/// Reads the state, n numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_state(ekf: *const Ekf, state: *mut Number) -> Error {
    code(|| {
        let found = memory::read(ekf)?.state();
        write(found, memory::array_mut(state, found.len())?);
        Ok(())
    })
}

/// Reads P, the covariance of the error of the state as far as the linearised model knows it, n x n. n^3/6
/// multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_covariance(ekf: *const Ekf, covariance: *mut Number) -> Error {
    code(|| {
        let filter = memory::read(ekf)?;
        let [states, _] = filter.sizes();
        filter.write_covariance(memory::array_mut(covariance, states * states)?)
    })
}
