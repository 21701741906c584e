//! The extended Kalman filter of a model whose functions are written in C.

use thetahat_core::ExtendedKalmanFilter;
use thetahat_core::nalgebra::Const;

use crate::error::code;
use crate::functions::{self, Filter, Function, Model, Noisy, filter_of_functions};
use crate::innovation::Innovation;
use crate::memory::{self, Init, Kind, Made, Place, View, Word};
use crate::shapes::{covariance, vector};
use crate::{Error, Number};

/// The extended Kalman filter of x(k+1) = f(x) + w, y = h(x) + v, with w ~ (0, Q) and v ~ (0, R).
pub struct Ekf {
    _opaque: [u8; 0],
}

/// The numbers of states and outputs of a `thetahat_ekf`: `thetahat_ekf_4_2` for 4 states and 2 outputs.
pub struct EkfSize {
    states: usize,
    init: Init<Ekf>,
    view: View<dyn Iterated>,
}

impl EkfSize {
    pub(crate) const fn new<const N: usize, const M: usize>() -> Self {
        EkfSize { states: N, init: init::<N, M>, view: |body| body.cast::<Extended<N, M>>() }
    }
}

impl Kind for Ekf {
    const TAG: u32 = 0x464b_4554;
    type Size = EkfSize;
    type Body = dyn Iterated;

    fn view(size: &EkfSize) -> View<dyn Iterated> {
        size.view
    }
}

/// The filter with its noises.
type Extended<const N: usize, const M: usize> = Noisy<ExtendedKalmanFilter<Number, Const<N>>, N, M>;

filter_of_functions!(ExtendedKalmanFilter);

/// What a filter of any size does.
pub(crate) trait Iterated: Filter {
    fn set_iterations(&mut self, count: usize) -> Result<(), Error>;
}

impl<const N: usize, const M: usize> Iterated for Extended<N, M> {
    fn set_iterations(&mut self, count: usize) -> Result<(), Error> {
        Ok(self.filter.set_iterations(count)?)
    }
}

fn init<const N: usize, const M: usize>(
    place: Place<Ekf>,
    state: &[Number],
    variance: Option<&[Number]>,
) -> Made<Ekf> {
    let filter = ExtendedKalmanFilter::new(vector(state), covariance(variance)?)?;
    place.write(Extended::<N, M>::new(filter))
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
    code(|| functions::set_noise(ekf, process_noise, measurement_noise))
}

/// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
///
/// Errors: NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_state(ekf: *mut Ekf, state: *const Number) -> Error {
    code(|| functions::set_state(ekf, state))
}

/// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
/// multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_set_covariance(ekf: *mut Ekf, covariance: *const Number) -> Error {
    code(|| functions::set_covariance(ekf, covariance))
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
    code(|| functions::set_gate(ekf, gate, release))
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
        let transition = Model::with_jacobian(transition)?;
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
    code(|| functions::correct(ekf, Model::with_jacobian(observation)?, measurement, innovation))
}

/// Reads the state, n numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_state(ekf: *const Ekf, state: *mut Number) -> Error {
    code(|| functions::state(ekf, state))
}

/// Reads P, the covariance of the error of the state as far as the linearised model knows it, n x n. n^3/6
/// multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ekf_covariance(ekf: *const Ekf, covariance: *mut Number) -> Error {
    code(|| functions::covariance(ekf, covariance))
}
