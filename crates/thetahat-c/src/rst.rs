//! The linear controller with two degrees of freedom.

use thetahat_core::nalgebra::{Const, SVector};
use thetahat_core::{RstController, WantedPoles};

use crate::error::code;
use crate::memory::{self, Kind, Made, Place, View, Word};
use crate::shapes::{vector, write};
use crate::{Error, Number};

/// The most coefficients of a polynomial of a controller.
pub const THETAHAT_MOST_COEFFICIENTS: usize = 12;

/// The gain and the polynomials of a controller. Shorter polynomials are filled up with zeros.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RstLaw {
    /// t0: T = t0 Ao.
    pub gain: Number,
    /// R after its leading 1.
    pub r: [Number; THETAHAT_MOST_COEFFICIENTS],
    /// S.
    pub s: [Number; THETAHAT_MOST_COEFFICIENTS],
    /// Ao after its leading 1.
    pub observer: [Number; THETAHAT_MOST_COEFFICIENTS],
}

/// A linear controller R(q) u(k) = T(q) uc(k) - S(q) y(k) with limits and without windup, T = t0 Ao.
pub struct Rst {
    _opaque: [u8; 0],
}

/// The number of coefficients of a `thetahat_rst`: `thetahat_rst_2` for 2.
pub struct RstSize {
    init: fn(Place<Rst>, &RstLaw) -> Made<Rst>,
    view: View<dyn Controller>,
}

impl RstSize {
    pub(crate) const fn new<const N: usize>() -> Self {
        RstSize { init: init::<N>, view: |body| body.cast::<Linear<N>>() }
    }
}

impl Kind for Rst {
    const TAG: u32 = 0x5453_5254;
    type Size = RstSize;
    type Body = dyn Controller;

    fn view(size: &RstSize) -> View<dyn Controller> {
        size.view
    }
}

type Linear<const N: usize> = RstController<Number, Const<N>>;

/// What a controller of any size does.
pub(crate) trait Controller {
    fn set_limits(&mut self, lowest: Number, highest: Number) -> Result<(), Error>;
    fn start(&mut self, input: Number, measurement: Number, set_point: Number);
    fn control(&mut self, set_point: Number, measurement: Number) -> Number;
    fn applied(&mut self, input: Number);
}

impl<const N: usize> Controller for Linear<N> {
    fn set_limits(&mut self, lowest: Number, highest: Number) -> Result<(), Error> {
        *self = self.clone().with_limits(lowest..=highest)?;
        Ok(())
    }

    fn start(&mut self, input: Number, measurement: Number, set_point: Number) {
        self.start(input, measurement, set_point);
    }

    fn control(&mut self, set_point: Number, measurement: Number) -> Number {
        self.control(set_point, measurement)
    }

    fn applied(&mut self, input: Number) {
        self.applied(input);
    }
}

fn init<const N: usize>(place: Place<Rst>, law: &RstLaw) -> Made<Rst> {
    let [r, s, observer]: [SVector<Number, N>; 3] =
        [&law.r, &law.s, &law.observer].map(|given| vector(given));
    place.write(RstController::new(law.gain, r, s, observer)?)
}

/// Makes a controller at rest, without limits.
///
/// - rst: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_RST_WORDS(n)` words, and their size in bytes.
/// - size: `&thetahat_rst_n` for n coefficients each.
/// - law: the gain and the first n coefficients of its polynomials.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rst_init(
    rst: *mut *mut Rst,
    memory: *mut Word,
    bytes: usize,
    size: *const RstSize,
    law: *const RstLaw,
) -> Error {
    code(|| {
        let handle = memory::follow(rst)?.cast_mut();
        let place = Place::<Rst>::new(memory, bytes, size)?;
        let (init, law) = (place.size().init, &*memory::follow(law)?);
        *handle = init(place, law)?;
        Ok(())
    })
}

/// Sets the limits of the input, in its unit. Infinite ones are none.
///
/// Errors: OUT_OF_RANGE if they are NaN, or the lower one is above the upper one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rst_set_limits(rst: *mut Rst, lowest: Number, highest: Number) -> Error {
    code(|| memory::open(rst)?.set_limits(lowest, highest))
}

/// Takes over from a hand: if the measurement and the set point stay as they are, the input stays at this one first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rst_start(
    rst: *mut Rst,
    input: Number,
    measurement: Number,
    set_point: Number,
) -> Error {
    code(|| {
        memory::open(rst)?.start(input, measurement, set_point);
        Ok(())
    })
}

/// One sample: the input from now on, within the limits. With a measurement that is NaN or infinite it stays as it was.
/// 4 n multiply-adds.
///
/// Errors: NULL_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rst_control(
    rst: *mut Rst,
    set_point: Number,
    measurement: Number,
    input: *mut Number,
) -> Error {
    code(|| {
        let controller = memory::open(rst)?;
        let place = memory::follow(input)?.cast_mut();
        *place = controller.control(set_point, measurement);
        Ok(())
    })
}

/// Tells that the actuator did something else than the latest control asked for.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rst_applied(rst: *mut Rst, input: Number) -> Error {
    code(|| {
        memory::open(rst)?.applied(input);
        Ok(())
    })
}

/// Where the poles of the closed loop shall be. Polynomials begin with their 1.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RstPoles {
    /// Am: how the output answers the set point.
    pub response: *const Number,
    /// The number of its coefficients, the 1 included.
    pub response_count: usize,
    /// Ao: how an error of the model or the start is forgotten. { 1 } is at once.
    pub observer: *const Number,
    /// The number of its coefficients, the 1 included.
    pub observer_count: usize,
    /// 1 if the controller integrates, so that a constant load leaves no error, else 0.
    pub integrator: u32,
    /// 1 if the zeros of B are cancelled, else 0.
    pub cancel_zeros: u32,
}

type PlacePoles = fn(&[Number], &[Number], &WantedPoles<'_, Number>) -> Result<RstLaw, Error>;

/// Pole placement for a number of coefficients: `thetahat_rst_place_2` for 2. It stands apart so that a controller with
/// fixed coefficients does not link it.
pub struct RstPlaceSize {
    place: PlacePoles,
}

impl RstPlaceSize {
    pub(crate) const fn new<const N: usize>() -> Self {
        RstPlaceSize { place: place::<N> }
    }
}

fn place<const N: usize>(
    a: &[Number],
    b: &[Number],
    wanted: &WantedPoles<'_, Number>,
) -> Result<RstLaw, Error> {
    let controller: Linear<N> = RstController::pole_placement(a, b, wanted)?;
    let [r, s, observer] = [controller.r(), controller.s(), controller.observer()].map(|found| {
        let mut polynomial = [0.0; THETAHAT_MOST_COEFFICIENTS];
        write(found.as_slice(), &mut polynomial);
        polynomial
    });
    Ok(RstLaw { gain: controller.gain(), r, s, observer })
}

/// Computes the controller of lowest order that places the poles of the closed loop with a model A(q) y = B(q) u, for
/// `thetahat_rst_init`. About 10 n^3 flops.
///
/// - size: `&thetahat_rst_place_n`, with n = na + nb - 1, one more with an integrator, where na and nb are the highest
///   powers of 1/q in A and B.
/// - a, a_count: A, na + 1 coefficients that begin with 1.
/// - b, b_count: B, nb + 1 coefficients that begin with 0, and with more zeros for a longer delay.
/// - poles: where the poles shall be.
/// - law: where the controller goes.
///
/// Errors, after which nothing is written: NOT_FINITE; OUT_OF_RANGE if a polynomial does not begin as it must, B(1) is
/// 0, a zero that shall be cancelled is not inside the unit circle, or A and B have a common factor, nearly; ORDERS if
/// n is another; LENGTH if Am Ao has more than n coefficients after its 1; TOO_LARGE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rst_place(
    size: *const RstPlaceSize,
    a: *const Number,
    a_count: usize,
    b: *const Number,
    b_count: usize,
    poles: *const RstPoles,
    law: *mut RstLaw,
) -> Error {
    code(|| {
        let (size, poles) = (&*memory::follow(size)?, *memory::follow(poles)?);
        let (a, b) = (memory::array(a, a_count)?, memory::array(b, b_count)?);
        let response = memory::array(poles.response, poles.response_count)?;
        let observer = memory::array(poles.observer, poles.observer_count)?;
        let wanted = WantedPoles::new(response, observer)
            .with_integrator(poles.integrator != 0)
            .with_cancelled_zeros(poles.cancel_zeros != 0);
        let place = memory::follow(law)?.cast_mut();
        *place = (size.place)(a, b, &wanted)?;
        Ok(())
    })
}
