//! The Kalman filter of a linear model.

use thetahat_core::KalmanFilter;
use thetahat_core::nalgebra::Const;

use crate::error::code;
use crate::innovation::Innovation;
use crate::linear::{self, Input, Matrices, Models};
use crate::memory::{self, Init, Kind, Made, Place, View, Word};
use crate::shapes::{covariance, vector, write};
use crate::{Error, Number};

/// The Kalman filter of x(k+1) = F x + G u + w, y = H x + D u + v, with w ~ (0, Q) and v ~ (0, R).
pub struct Kalman {
    _opaque: [u8; 0],
}

/// The numbers of states and outputs of a `thetahat_kalman`: `thetahat_kalman_4_2` for 4 states and 2 outputs.
pub struct KalmanSize {
    states: usize,
    init: Init<Kalman>,
    view: View<dyn Filter>,
}

impl KalmanSize {
    pub(crate) const fn new<const N: usize, const M: usize>() -> Self {
        KalmanSize { states: N, init: init::<N, M>, view: |body| body.cast::<Modelled<N, M>>() }
    }
}

impl Kind for Kalman {
    const TAG: u32 = 0x4d4c_4b54;
    type Size = KalmanSize;
    type Body = dyn Filter;

    fn view(size: &KalmanSize) -> View<dyn Filter> {
        size.view
    }
}

/// A filter and its models.
struct Modelled<const N: usize, const M: usize> {
    filter: KalmanFilter<Number, Const<N>>,
    models: Models<N, M>,
}

/// What a filter of any size does.
pub(crate) trait Filter {
    /// The numbers of states, outputs and inputs.
    fn sizes(&self) -> [usize; 3];
    fn set_transition(&mut self, given: &Matrices<'_>) -> Result<(), Error>;
    fn set_observation(&mut self, given: &Matrices<'_>) -> Result<(), Error>;
    fn set_state(&mut self, state: &[Number]) -> Result<(), Error>;
    fn set_covariance(&mut self, variance: Option<&[Number]>) -> Result<(), Error>;
    fn widen(&mut self, factor: Number) -> Result<(), Error>;
    fn set_gate(&mut self, gate: Number, release: u16) -> Result<(), Error>;
    fn predict(&mut self, input: &Input) -> Result<(), Error>;
    fn correct(&mut self, input: &Input, measurement: &[Number]) -> Result<Innovation, Error>;
    fn state(&self) -> &[Number];
    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error>;
}

impl<const N: usize, const M: usize> Filter for Modelled<N, M> {
    fn sizes(&self) -> [usize; 3] {
        [N, M, self.models.inputs()]
    }

    fn set_transition(&mut self, given: &Matrices<'_>) -> Result<(), Error> {
        self.models.set_transition(given)
    }

    fn set_observation(&mut self, given: &Matrices<'_>) -> Result<(), Error> {
        self.models.set_observation(given)
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

    fn predict(&mut self, input: &Input) -> Result<(), Error> {
        Ok(self.filter.predict(self.models.transition()?, input)?)
    }

    fn correct(&mut self, input: &Input, measurement: &[Number]) -> Result<Innovation, Error> {
        Ok(self.filter.correct(self.models.observation()?, input, &vector(measurement))?.into())
    }

    fn state(&self) -> &[Number] {
        self.filter.state().as_slice()
    }

    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error> {
        Ok(self.filter.covariance().write_into(target)?)
    }
}

fn init<const N: usize, const M: usize>(
    place: Place<Kalman>,
    state: &[Number],
    variance: Option<&[Number]>,
) -> Made<Kalman> {
    let filter = KalmanFilter::new(vector(state), covariance(variance)?)?;
    place.write(Modelled::<N, M> { filter, models: Models::NONE })
}

/// Makes a filter that starts from this state and the covariance of its error. Set the transition and the observation
/// next.
///
/// - kalman: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_KALMAN_WORDS(n, m)` words, and their size in bytes.
/// - size: `&thetahat_kalman_n_m` for n states and m outputs.
/// - state: x, n numbers.
/// - covariance: P, n x n, symmetric; NULL for 0, a state that is known.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_init(
    kalman: *mut *mut Kalman,
    memory: *mut Word,
    bytes: usize,
    size: *const KalmanSize,
    state: *const Number,
    covariance: *const Number,
) -> Error {
    code(|| {
        let handle = memory::follow(kalman)?.cast_mut();
        let place = Place::<Kalman>::new(memory, bytes, size)?;
        let size = place.size();
        let state = memory::array(state, size.states)?;
        let covariance = memory::optional(covariance, size.states * size.states)?;
        *handle = (size.init)(place, state, covariance)?;
        Ok(())
    })
}

/// Sets how the state moves on: x(k+1) = F x + G u + w, w ~ (0, Q). It may be set again at any time.
///
/// - state_matrix: F, n x n, row by row, as all matrices.
/// - input_matrix, inputs: G, n x inputs, with 0 ... THETAHAT_MOST_INPUTS inputs; NULL for none.
/// - noise: Q, n x n; NULL for 0.
///
/// Errors: LENGTH for too many inputs; INPUTS if their number changes and the observation has a D that is not 0;
/// NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_set_transition(
    kalman: *mut Kalman,
    state_matrix: *const Number,
    input_matrix: *const Number,
    inputs: usize,
    noise: *const Number,
) -> Error {
    code(|| {
        let filter = memory::open(kalman)?;
        let [states, ..] = filter.sizes();
        let given = linear::matrices([states, states, inputs], state_matrix, input_matrix, noise)?;
        filter.set_transition(&given)
    })
}

/// Sets what is measured: y = H x + D u + v, v ~ (0, R). It may be set again at any time.
///
/// - output_matrix: H, m x n.
/// - input_matrix: D, m x inputs, with the inputs of the transition, which is set before; NULL for 0, or where there
///   are none.
/// - noise: R, m x m; NULL for 0.
///
/// Errors: INPUTS if D is given and the transition is not set, or has no inputs; NOT_FINITE; NOT_SYMMETRIC;
/// NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_set_observation(
    kalman: *mut Kalman,
    output_matrix: *const Number,
    input_matrix: *const Number,
    noise: *const Number,
) -> Error {
    code(|| {
        let filter = memory::open(kalman)?;
        let [states, outputs, inputs] = filter.sizes();
        let given = linear::matrices([outputs, states, inputs], output_matrix, input_matrix, noise)?;
        filter.set_observation(&given)
    })
}

/// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
///
/// Errors: NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_set_state(kalman: *mut Kalman, state: *const Number) -> Error {
    code(|| {
        let filter = memory::open(kalman)?;
        let [states, ..] = filter.sizes();
        filter.set_state(memory::array(state, states)?)
    })
}

/// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
/// multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_set_covariance(
    kalman: *mut Kalman,
    covariance: *const Number,
) -> Error {
    code(|| {
        let filter = memory::open(kalman)?;
        let [states, ..] = filter.sizes();
        filter.set_covariance(memory::optional(covariance, states * states)?)
    })
}

/// Takes P for larger by a factor, at least 1: the next measurements move the state more. For a state that is less sure
/// than P says, as after a fault.
///
/// Errors: OUT_OF_RANGE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_widen(kalman: *mut Kalman, factor: Number) -> Error {
    code(|| memory::open(kalman)?.widen(factor))
}

/// Sets a gate: a measurement whose normalised innovation squared is above it is not used. INFINITY for none, as at
/// first. After `release` such measurements in a row, 1 ... 65535, those that follow are used all the same; 0 for
/// never.
///
/// Errors: OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_set_gate(kalman: *mut Kalman, gate: Number, release: u32) -> Error {
    code(|| {
        let release = u16::try_from(release).map_err(|_| Error::OutOfRange)?;
        memory::open(kalman)?.set_gate(gate, release)
    })
}

/// The time update: one sample ahead, with the inputs u(k) of the transition; NULL where there are none. About 1.2 n^3
/// multiply-adds, where the quick way would lose digits n^3 more.
///
/// Errors: NO_MODEL; NOT_FINITE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_predict(kalman: *mut Kalman, input: *const Number) -> Error {
    code(|| {
        let filter = memory::open(kalman)?;
        let [.., inputs] = filter.sizes();
        filter.predict(&linear::input(input, inputs)?)
    })
}

/// The measurement update. A NaN in the measurement is a missing element: it is skipped alone, and the others are used.
/// About m (1.5 n^2 + 6 n) multiply-adds.
///
/// - input: u(k), the inputs of the transition; NULL where there are none.
/// - measurement: y(k), m numbers.
/// - innovation: what was new; may be NULL.
///
/// Errors: NO_MODEL; INFINITE; NOT_FINITE if an input is NaN or infinite; NO_VARIANCE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_correct(
    kalman: *mut Kalman,
    input: *const Number,
    measurement: *const Number,
    innovation: *mut Innovation,
) -> Error {
    code(|| {
        let filter = memory::open(kalman)?;
        let [_, outputs, inputs] = filter.sizes();
        let measurement = memory::array(measurement, outputs)?;
        let told = filter.correct(&linear::input(input, inputs)?, measurement)?;
        memory::answer(innovation, told);
        Ok(())
    })
}

/// Reads the state, n numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_state(kalman: *const Kalman, state: *mut Number) -> Error {
    code(|| {
        let found = memory::read(kalman)?.state();
        write(found, memory::array_mut(state, found.len())?);
        Ok(())
    })
}

/// Reads P, the covariance of the error of the state, n x n. n^3/6 multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_kalman_covariance(kalman: *const Kalman, covariance: *mut Number) -> Error {
    code(|| {
        let filter = memory::read(kalman)?;
        let [states, ..] = filter.sizes();
        filter.write_covariance(memory::array_mut(covariance, states * states)?)
    })
}
