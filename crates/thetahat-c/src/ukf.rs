//! The unscented Kalman filter of a model whose functions are written in C.

use thetahat_core::UnscentedKalmanFilter;
use thetahat_core::nalgebra::Const;

use crate::error::code;
use crate::functions::{self, Filter, Function, Model, Noisy, filter_of_functions};
use crate::innovation::Innovation;
use crate::memory::{self, Init, Kind, Made, Place, View, Word};
use crate::shapes::{covariance, vector};
use crate::{Error, Number};

/// The unscented Kalman filter of x(k+1) = f(x) + w, y = h(x) + v, with w ~ (0, Q) and v ~ (0, R). It evaluates f and h
/// at 2 n + 1 points around the estimate, and never asks for a Jacobian.
pub struct Ukf {
    _opaque: [u8; 0],
}

/// The numbers of states and outputs of a `thetahat_ukf`: `thetahat_ukf_4_2` for 4 states and 2 outputs.
pub struct UkfSize {
    states: usize,
    init: Init<Ukf>,
    view: View<dyn Spread>,
}

impl UkfSize {
    pub(crate) const fn new<const N: usize, const M: usize>() -> Self {
        UkfSize { states: N, init: init::<N, M>, view: |body| body.cast::<Unscented<N, M>>() }
    }
}

impl Kind for Ukf {
    const TAG: u32 = 0x464b_5554;
    type Size = UkfSize;
    type Body = dyn Spread;

    fn view(size: &UkfSize) -> View<dyn Spread> {
        size.view
    }
}

/// The filter with its noises.
type Unscented<const N: usize, const M: usize> = Noisy<UnscentedKalmanFilter<Number, Const<N>>, N, M>;

filter_of_functions!(UnscentedKalmanFilter);

/// What a filter of any size does.
pub(crate) trait Spread: Filter {
    fn set_spread(&mut self, spread: Number) -> Result<(), Error>;
}

impl<const N: usize, const M: usize> Spread for Unscented<N, M> {
    fn set_spread(&mut self, spread: Number) -> Result<(), Error> {
        Ok(self.filter.set_spread(spread)?)
    }
}

fn init<const N: usize, const M: usize>(
    place: Place<Ukf>,
    state: &[Number],
    variance: Option<&[Number]>,
) -> Made<Ukf> {
    let filter = UnscentedKalmanFilter::new(vector(state), covariance(variance)?)?;
    place.write(Unscented::<N, M>::new(filter))
}

/// Makes a filter that starts from this state and the covariance of its error. Set the noise next.
///
/// - ukf: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_UKF_WORDS(n, m)` words, and their size in bytes.
/// - size: `&thetahat_ukf_n_m` for n states and m outputs.
/// - state: x, n numbers.
/// - covariance: P, n x n, symmetric; NULL for 0, a state that is known.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_init(
    ukf: *mut *mut Ukf,
    memory: *mut Word,
    bytes: usize,
    size: *const UkfSize,
    state: *const Number,
    covariance: *const Number,
) -> Error {
    code(|| {
        let handle = memory::follow(ukf)?.cast_mut();
        let place = Place::<Ukf>::new(memory, bytes, size)?;
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
pub unsafe extern "C" fn thetahat_ukf_set_noise(
    ukf: *mut Ukf,
    process_noise: *const Number,
    measurement_noise: *const Number,
) -> Error {
    code(|| functions::set_noise(ukf, process_noise, measurement_noise))
}

/// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
///
/// Errors: NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_set_state(ukf: *mut Ukf, state: *const Number) -> Error {
    code(|| functions::set_state(ukf, state))
}

/// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
/// multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_set_covariance(ukf: *mut Ukf, covariance: *const Number) -> Error {
    code(|| functions::set_covariance(ukf, covariance))
}

/// Takes P for larger by a factor, at least 1: the next measurements move the state more. For a state that is less sure
/// than P says, as after a fault.
///
/// Errors: OUT_OF_RANGE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_widen(ukf: *mut Ukf, factor: Number) -> Error {
    code(|| memory::open(ukf)?.widen(factor))
}

/// Sets a gate, and after how many measurements above it in a row it lets go: as `thetahat_kalman_set_gate`.
///
/// Errors: OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_set_gate(ukf: *mut Ukf, gate: Number, release: u32) -> Error {
    code(|| functions::set_gate(ukf, gate, release))
}

/// Sets how many standard deviations the points are from the estimate: sqrt(3) at first, 1 ... 10. Smaller: for
/// functions that are not defined far away, or bend otherwise there. With 1 the covariance knows nothing of bends.
///
/// Errors: OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_set_spread(ukf: *mut Ukf, spread: Number) -> Error {
    code(|| memory::open(ukf)?.set_spread(spread))
}

/// The time update: one sample ahead. The functions of the transition must not call with this filter: that answers
/// BUSY. 2 n + 1 times f, and about 4 n^3 multiply-adds.
///
/// Errors: NOT_FINITE if the next state of one of the points is NaN or infinite; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_predict(ukf: *mut Ukf, transition: *const Function) -> Error {
    code(|| {
        let transition = Model::new(transition)?;
        memory::busy(ukf, |filter| filter.predict(transition))
    })
}

/// The measurement update. A NaN in the measurement is a missing element: it is skipped alone, and the others are used.
/// The functions of the observation must not call with this filter: that answers BUSY. 2 n + 1 times h, and about m
/// (2 n^2 + 2 n m + 6 n) multiply-adds.
///
/// - observation: h. Its Jacobian is not called, and may be NULL.
/// - measurement: y(k), m numbers.
/// - innovation: what was new; may be NULL.
///
/// Errors: INFINITE; NOT_FINITE if h at one of the points is NaN or infinite; NO_VARIANCE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_correct(
    ukf: *mut Ukf,
    observation: *const Function,
    measurement: *const Number,
    innovation: *mut Innovation,
) -> Error {
    code(|| functions::correct(ukf, Model::new(observation)?, measurement, innovation))
}

/// Reads the state, n numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_state(ukf: *const Ukf, state: *mut Number) -> Error {
    code(|| functions::state(ukf, state))
}

/// Reads P, the covariance of the error of the state as far as the points know it, n x n. n^3/6
/// multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_ukf_covariance(ukf: *const Ukf, covariance: *mut Number) -> Error {
    code(|| functions::covariance(ukf, covariance))
}
