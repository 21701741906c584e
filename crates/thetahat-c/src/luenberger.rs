//! The Luenberger observer of a linear model.

use thetahat_core::LuenbergerObserver;
use thetahat_core::nalgebra::{Complex, Const, SVector};

use crate::error::code;
use crate::innovation::Innovation;
use crate::linear::{self, Input, Matrices, Models};
use crate::memory::{self, Init, Kind, Made, Place, View, Word};
use crate::shapes::{matrix, vector, write, write_rows};
use crate::{Error, Number};

/// The Luenberger observer of x(k+1) = F x + G u, y = H x + D u: x(k+1) = F x + G u + L (y - H x - D u).
pub struct Luenberger {
    _opaque: [u8; 0],
}

/// The numbers of states and outputs of a `thetahat_luenberger`: `thetahat_luenberger_4_2` for 4 states and 2 outputs.
pub struct LuenbergerSize {
    states: usize,
    outputs: usize,
    init: Init<Luenberger>,
    view: View<dyn Observer>,
}

impl LuenbergerSize {
    pub(crate) const fn new<const N: usize, const M: usize>() -> Self {
        let view = |body: *mut u8| -> *mut dyn Observer { body.cast::<Modelled<N, M>>() };
        LuenbergerSize { states: N, outputs: M, init: init::<N, M>, view }
    }
}

impl Kind for Luenberger {
    const TAG: u32 = 0x4e45_4c54;
    type Size = LuenbergerSize;
    type Body = dyn Observer;

    fn view(size: &LuenbergerSize) -> View<dyn Observer> {
        size.view
    }
}

/// An observer and its models.
struct Modelled<const N: usize, const M: usize> {
    observer: LuenbergerObserver<Number, Const<N>, Const<M>>,
    models: Models<N, M>,
}

/// What an observer of any size does.
pub(crate) trait Observer {
    /// The numbers of states, outputs and inputs.
    fn sizes(&self) -> [usize; 3];
    fn set_transition(&mut self, given: &Matrices<'_>) -> Result<(), Error>;
    fn set_observation(&mut self, given: &Matrices<'_>) -> Result<(), Error>;
    fn place(&mut self, poles: [&[Number]; 2], weights: Option<&[Number]>) -> Result<(), Error>;
    fn update(&mut self, input: &Input, measurement: &[Number]) -> Result<Innovation, Error>;
    fn set_state(&mut self, state: &[Number]) -> Result<(), Error>;
    fn state(&self) -> &[Number];
    fn write_gain(&self, target: &mut [Number]);
}

impl<const N: usize, const M: usize> Observer for Modelled<N, M> {
    fn sizes(&self) -> [usize; 3] {
        [N, M, self.models.inputs()]
    }

    fn set_transition(&mut self, given: &Matrices<'_>) -> Result<(), Error> {
        self.models.set_transition(given)
    }

    fn set_observation(&mut self, given: &Matrices<'_>) -> Result<(), Error> {
        self.models.set_observation(given)
    }

    fn place(&mut self, [real, imaginary]: [&[Number]; 2], weights: Option<&[Number]>) -> Result<(), Error> {
        let (transition, observation) = (self.models.transition()?, self.models.observation()?);
        let mut poles = SVector::<Complex<Number>, N>::repeat(Complex::new(0.0, 0.0));
        for ((pole, real), imaginary) in poles.as_mut_slice().iter_mut().zip(real).zip(imaginary) {
            *pole = Complex::new(*real, *imaginary);
        }
        let weights = vector(weights.unwrap_or(&[1.0; M]));
        Ok(self.observer.place(transition, observation, &vector(&[]), &weights, &poles)?)
    }

    fn update(&mut self, input: &Input, measurement: &[Number]) -> Result<Innovation, Error> {
        let (transition, observation) = (self.models.transition()?, self.models.observation()?);
        Ok(self.observer.update(transition, observation, input, &vector(measurement))?.into())
    }

    fn set_state(&mut self, state: &[Number]) -> Result<(), Error> {
        Ok(self.observer.set_state(vector(state))?)
    }

    fn state(&self) -> &[Number] {
        self.observer.state().as_slice()
    }

    fn write_gain(&self, target: &mut [Number]) {
        write_rows(self.observer.gain(), target);
    }
}

fn init<const N: usize, const M: usize>(
    place: Place<Luenberger>,
    state: &[Number],
    gain: Option<&[Number]>,
) -> Made<Luenberger> {
    let observer = LuenbergerObserver::new(vector(state), matrix(gain.unwrap_or_default(), M))?;
    place.write(Modelled::<N, M> { observer, models: Models::NONE })
}

/// Makes an observer that starts from this state. Set the transition and the observation next.
///
/// - luenberger: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_LUENBERGER_WORDS(n, m)` words, and their size in bytes.
/// - size: `&thetahat_luenberger_n_m` for n states and m outputs.
/// - state: x, n numbers.
/// - gain: L, n x m, row by row; NULL for 0, until poles are placed.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_init(
    luenberger: *mut *mut Luenberger,
    memory: *mut Word,
    bytes: usize,
    size: *const LuenbergerSize,
    state: *const Number,
    gain: *const Number,
) -> Error {
    code(|| {
        let handle = memory::follow(luenberger)?.cast_mut();
        let place = Place::<Luenberger>::new(memory, bytes, size)?;
        let size = place.size();
        let state = memory::array(state, size.states)?;
        let gain = memory::optional(gain, size.states * size.outputs)?;
        *handle = (size.init)(place, state, gain)?;
        Ok(())
    })
}

/// Sets how the state moves on: x(k+1) = F x + G u. It may be set again at any time.
///
/// - state_matrix: F, n x n, row by row, as all matrices.
/// - input_matrix, inputs: G, n x inputs, with 0 ... THETAHAT_MOST_INPUTS inputs; NULL for none.
///
/// Errors: LENGTH for too many inputs; INPUTS if their number changes and the observation has a D that is not 0;
/// NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_set_transition(
    luenberger: *mut Luenberger,
    state_matrix: *const Number,
    input_matrix: *const Number,
    inputs: usize,
) -> Error {
    code(|| {
        let observer = memory::open(luenberger)?;
        let [states, ..] = observer.sizes();
        let sizes = [states, states, inputs];
        observer.set_transition(&linear::matrices(sizes, state_matrix, input_matrix, core::ptr::null())?)
    })
}

/// Sets what is measured: y = H x + D u. It may be set again at any time.
///
/// - output_matrix: H, m x n.
/// - input_matrix: D, m x inputs, with the inputs of the transition, which is set before; NULL for 0, or where there
///   are none.
///
/// Errors: INPUTS if D is given and the transition is not set, or has no inputs; NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_set_observation(
    luenberger: *mut Luenberger,
    output_matrix: *const Number,
    input_matrix: *const Number,
) -> Error {
    code(|| {
        let observer = memory::open(luenberger)?;
        let [states, outputs, inputs] = observer.sizes();
        let sizes = [outputs, states, inputs];
        observer.set_observation(&linear::matrices(sizes, output_matrix, input_matrix, core::ptr::null())?)
    })
}

/// Sets the gain so that F - L H has these poles. Complex poles come in conjugate pairs, side by side. 4 n^3
/// multiply-adds.
///
/// - real, imaginary: the parts of the poles, n numbers each; all inside the unit circle.
/// - weights: m numbers by which the outputs are combined into one; NULL for 1 each.
///
/// Errors: NO_MODEL; NOT_OBSERVABLE; OUT_OF_RANGE; NOT_FINITE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_place(
    luenberger: *mut Luenberger,
    real: *const Number,
    imaginary: *const Number,
    weights: *const Number,
) -> Error {
    code(|| {
        let observer = memory::open(luenberger)?;
        let [states, outputs, _] = observer.sizes();
        let poles = [memory::array(real, states)?, memory::array(imaginary, states)?];
        observer.place(poles, memory::optional(weights, outputs)?)
    })
}

/// One sample ahead, with u(k) and y(k). A NaN in the measurement is a missing element: its error counts as 0. n m
/// multiply-adds, and the model's.
///
/// - input: u(k), the inputs of the transition; NULL where there are none.
/// - measurement: y(k), m numbers.
/// - innovation: the errors y - H x - D u; an observer knows no variances. May be NULL.
///
/// Errors: NO_MODEL; INFINITE; NOT_FINITE if an input is NaN or infinite; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_update(
    luenberger: *mut Luenberger,
    input: *const Number,
    measurement: *const Number,
    innovation: *mut Innovation,
) -> Error {
    code(|| {
        let observer = memory::open(luenberger)?;
        let [_, outputs, inputs] = observer.sizes();
        let measurement = memory::array(measurement, outputs)?;
        let told = observer.update(&linear::input(input, inputs)?, measurement)?;
        memory::answer(innovation, told);
        Ok(())
    })
}

/// Puts the estimate where the state is known to be, n numbers.
///
/// Errors: NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_set_state(
    luenberger: *mut Luenberger,
    state: *const Number,
) -> Error {
    code(|| {
        let observer = memory::open(luenberger)?;
        let [states, ..] = observer.sizes();
        observer.set_state(memory::array(state, states)?)
    })
}

/// Reads the state at the next sample, n numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_state(
    luenberger: *const Luenberger,
    state: *mut Number,
) -> Error {
    code(|| {
        let found = memory::read(luenberger)?.state();
        write(found, memory::array_mut(state, found.len())?);
        Ok(())
    })
}

/// Reads the gain L, n x m, row by row.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_luenberger_gain(luenberger: *const Luenberger, gain: *mut Number) -> Error {
    code(|| {
        let observer = memory::read(luenberger)?;
        let [states, outputs, _] = observer.sizes();
        observer.write_gain(memory::array_mut(gain, states * outputs)?);
        Ok(())
    })
}
