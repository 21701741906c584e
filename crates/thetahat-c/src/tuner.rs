//! Self-tuning controllers: indirect and direct ones are one kind, as they are used alike.

use thetahat_core::nalgebra::Const;
use thetahat_core::{
    DirectOrders, DirectSelfTuner, Distrust as CoreDistrust, Fallback as CoreFallback, IndirectSelfTuner,
    Innovation as CoreInnovation, Probing, ResponseWanted, Sensor, Supervision, TunerOrders, TunerSettings,
    TunerState as CoreState,
};

use crate::error::code;
use crate::learning::Learning;
use crate::memory::{self, Kind, Made, Place, View, Word};
use crate::shapes::write;
use crate::{Error, Innovation, Number};

/// What a self-tuner did in a sample.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TunerState {
    /// There is no controller yet: the plant is excited.
    Probing = 0,
    /// The controller acts.
    Controlling = 1,
    /// The sensor says nothing, and the controller acts on what the model predicts.
    Bridging = 2,
    /// The sensor says nothing for long: the input stays as it was.
    Holding = 3,
    /// It is not trusted: the fallback acts. `thetahat_tuner_trusted` says why.
    Distrusted = 4,
    /// Another state of the core.
    Other = 5,
}

/// Why a self-tuner is not trusted.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distrust {
    /// It is trusted.
    None = 0,
    /// The gain of the model has another sign than was given, or than was known.
    Sign = 1,
    /// The input goes from one limit to the other while the set point stays.
    Saturated = 2,
    /// No controller was designed for long.
    Age = 3,
    /// No controller was designed for long: none of those that are tried has margins that are bearable.
    Margin = 4,
    /// The model predicts worse than the latest measurement does.
    Innovations = 5,
    /// Another reason of the core.
    Other = 6,
}

impl From<Option<CoreDistrust>> for Distrust {
    fn from(distrust: Option<CoreDistrust>) -> Self {
        match distrust {
            None => Distrust::None,
            Some(CoreDistrust::Sign) => Distrust::Sign,
            Some(CoreDistrust::Saturated) => Distrust::Saturated,
            Some(CoreDistrust::Age) => Distrust::Age,
            Some(CoreDistrust::Margin) => Distrust::Margin,
            Some(CoreDistrust::Innovations) => Distrust::Innovations,
            Some(_) => Distrust::Other,
        }
    }
}

/// What acts while a self-tuner is not trusted.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// An input that stays: the mean of the inputs in the latest 64 sound samples.
    Hold = 0,
    /// The controller of the latest 64 sound samples.
    LastGood = 1,
    /// An input that is given.
    Input = 2,
}

/// A `thetahat_fallback`, and the input of the last of them.
fn fallback(fallback: i32, input: Number) -> Result<CoreFallback<Number>, Error> {
    match fallback {
        kind if kind == Fallback::Hold as i32 => Ok(CoreFallback::Hold),
        kind if kind == Fallback::LastGood as i32 => Ok(CoreFallback::LastGood),
        kind if kind == Fallback::Input as i32 => Ok(CoreFallback::Input(input)),
        _ => Err(Error::OutOfRange),
    }
}

impl From<CoreState> for TunerState {
    fn from(state: CoreState) -> Self {
        match state {
            CoreState::Probing => TunerState::Probing,
            CoreState::Controlling => TunerState::Controlling,
            CoreState::Bridging => TunerState::Bridging,
            CoreState::Holding => TunerState::Holding,
            CoreState::Distrusted(_) => TunerState::Distrusted,
            _ => TunerState::Other,
        }
    }
}

/// What a self-tuner is asked for. `thetahat_tuner_usual` fills it in.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct TunerWish {
    /// The natural frequency of the response to the set point, in rad a sample: about 4/(damping n) to settle within n
    /// samples.
    pub frequency: Number,
    /// Its damping, above 0 and at most 1.
    pub damping: Number,
    /// The pole by which loads and errors of the model are forgotten, 0 ... below 1.
    pub observer: Number,
    /// The range of the actuator, in the unit of the input.
    pub lowest_input: Number,
    /// The other end of it.
    pub highest_input: Number,
    /// The input that it starts with, within the range.
    pub first_input: Number,
    /// The sign of the gain of the plant; 0 where it is not known.
    pub gain_sign: Number,
    /// The usual size of the output, in its unit, above 0.
    pub output_scale: Number,
    /// The usual size of the input, in its unit, above 0.
    pub input_scale: Number,
    /// The first amplitude of probing, in the unit of the input. It doubles every 15 samples.
    pub amplitude: Number,
    /// The largest.
    pub largest_amplitude: Number,
    /// What the sensor can measure, in the unit of the output. What lies beyond is taken as the end that it passed.
    pub lowest_measurement: Number,
    /// The other end of it.
    pub highest_measurement: Number,
    /// So many equal measurements in a row are those of a sensor that is stuck, up to 65535; 0 for never.
    pub stuck_after: u32,
    /// For so many missing samples in a row the controller goes on with what its model predicts, up to 65535.
    pub longest_gap: u32,
    /// What acts while the tuner is not trusted, a `thetahat_fallback`.
    pub fallback: i32,
    /// The input of THETAHAT_FALLBACK_INPUT.
    pub fallback_input: Number,
    /// The amplitude that excites the plant then, in the unit of the input. With 0 trust may not come back by itself.
    pub excitation: Number,
    /// The largest mean share of samples in which the input is at a limit, at both of them while the set point stays, 0
    /// ... 1; 1 for any.
    pub saturated: Number,
    /// For so many samples in a row a design may be refused, a quarter of it where the sign is surely wrong, up to
    /// 65535; 0 for any.
    pub refused: u32,
    /// The largest ratio of the mean squared innovation to the mean squared change of the measurement, 1 or more.
    pub innovations: Number,
    /// Whether the fallback acts too where the design is only old, 0 or 1: with 0 the controller goes on.
    pub replace_old: u32,
}

impl TunerWish {
    fn settings(&self) -> Result<TunerSettings<Number>, Error> {
        // Not so with a NaN either.
        let in_order = self.lowest_input <= self.highest_input;
        if !(in_order && self.lowest_measurement <= self.highest_measurement) {
            return Err(Error::OutOfRange);
        }
        let few = |count| u16::try_from(count).map_err(|_| Error::OutOfRange);
        let response =
            ResponseWanted { frequency: self.frequency, damping: self.damping, observer: self.observer };
        Ok(TunerSettings {
            response,
            limits: self.lowest_input..=self.highest_input,
            input: self.first_input,
            gain_sign: self.gain_sign,
            probing: Probing {
                amplitude: self.amplitude,
                largest: self.largest_amplitude,
                ..Probing::of_scale(self.input_scale)
            },
            sensor: Sensor {
                range: self.lowest_measurement..=self.highest_measurement,
                stuck_after: few(self.stuck_after)?,
                longest_gap: few(self.longest_gap)?,
                ..Sensor::default()
            },
            supervision: Supervision {
                fallback: fallback(self.fallback, self.fallback_input)?,
                excitation: self.excitation,
                saturated: self.saturated,
                refused: few(self.refused)?,
                innovations: self.innovations,
                replace_old: self.replace_old != 0,
            },
        })
    }
}

/// A controller that learns its plant while it runs: a model that it is designed for anew (indirect), or its own
/// coefficients (direct).
pub struct Tuner {
    _opaque: [u8; 0],
}

/// The way and the orders of a `thetahat_tuner`. `thetahat_indirect_2_3`: a plant with na = 2 and nb = 3 coefficients
/// of B(q), one more than its order for each sample of dead time; the controller integrates. `thetahat_direct_2_2_1`:
/// na = 2, nb = 2, and an input that acts after 1 sample; for plants whose inverse is stable and whose delay is known.
/// Both have a constant for loads.
pub struct TunerSize {
    init: fn(Place<Tuner>, &TunerWish, &Learning) -> Made<Tuner>,
    view: View<dyn Tuning>,
}

impl TunerSize {
    /// P and C are the numbers of parameters and coefficients.
    pub(crate) const fn indirect<const NA: usize, const NB: usize, const P: usize, const C: usize>() -> Self {
        const { assert!(indirect_orders(NA, NB).parameters() == P && indirect_orders(NA, NB).size() == C) };
        TunerSize { init: init_indirect::<NA, NB, P, C>, view: |body| body.cast::<Indirect<P, C>>() }
    }

    /// P, C and S are the numbers of parameters, coefficients and samples on their way.
    pub(crate) const fn direct<
        const NA: usize,
        const NB: usize,
        const DELAY: usize,
        const P: usize,
        const C: usize,
        const S: usize,
    >() -> Self {
        const {
            let orders = direct_orders(NA, NB, DELAY);
            assert!(orders.parameters() == P && orders.size() == C && orders.delays() == S);
        };
        TunerSize { init: init_direct::<NA, NB, DELAY, P, C, S>, view: |body| body.cast::<Direct<P, C, S>>() }
    }
}

const fn indirect_orders(na: usize, nb: usize) -> TunerOrders {
    TunerOrders { na, nb, nc: 0, constant: true, integrator: true }
}

const fn direct_orders(na: usize, nb: usize, delay: usize) -> DirectOrders {
    DirectOrders { na, nb, delay, constant: true }
}

impl Kind for Tuner {
    const TAG: u32 = 0x4e55_5454;
    type Size = TunerSize;
    type Body = dyn Tuning;

    fn view(size: &TunerSize) -> View<dyn Tuning> {
        size.view
    }
}

type Indirect<const P: usize, const C: usize> = IndirectSelfTuner<Number, Const<P>, Const<C>>;
type Direct<const P: usize, const C: usize, const S: usize> =
    DirectSelfTuner<Number, Const<P>, Const<C>, Const<S>>;

/// What a tuner of any size and way does.
pub(crate) trait Tuning {
    fn control(&mut self, set_point: Number, measurement: Number) -> Number;
    fn applied(&mut self, input: Number);
    fn probe(&mut self, share: Number, samples: u32) -> Result<(), Error>;
    fn set_adaptation(&mut self, on: bool);
    fn state(&self) -> CoreState;
    fn trusted(&self) -> (Option<CoreDistrust>, CoreInnovation<Number>, u32);
    fn trust(&mut self);
    fn set_gain_sign(&mut self, sign: Number) -> Result<(), Error>;
    fn set_fallback(&mut self, fallback: CoreFallback<Number>) -> Result<(), Error>;
    fn parameters(&self) -> &[Number];
}

impl<const P: usize, const C: usize> Tuning for Indirect<P, C> {
    fn control(&mut self, set_point: Number, measurement: Number) -> Number {
        self.control(set_point, measurement)
    }

    fn applied(&mut self, input: Number) {
        self.applied(input);
    }

    fn probe(&mut self, share: Number, samples: u32) -> Result<(), Error> {
        Ok(self.probe(share, samples)?)
    }

    fn set_adaptation(&mut self, on: bool) {
        self.set_adaptation(on);
    }

    fn state(&self) -> CoreState {
        self.state()
    }

    fn trusted(&self) -> (Option<CoreDistrust>, CoreInnovation<Number>, u32) {
        (self.distrust(), self.innovation(), self.design_age())
    }

    fn trust(&mut self) {
        self.trust();
    }

    fn set_gain_sign(&mut self, sign: Number) -> Result<(), Error> {
        Ok(self.set_gain_sign(sign)?)
    }

    fn set_fallback(&mut self, fallback: CoreFallback<Number>) -> Result<(), Error> {
        Ok(self.set_fallback(fallback)?)
    }

    fn parameters(&self) -> &[Number] {
        self.plant().estimator().parameters().as_slice()
    }
}

impl<const P: usize, const C: usize, const S: usize> Tuning for Direct<P, C, S> {
    fn control(&mut self, set_point: Number, measurement: Number) -> Number {
        self.control(set_point, measurement)
    }

    fn applied(&mut self, input: Number) {
        self.applied(input);
    }

    fn probe(&mut self, share: Number, samples: u32) -> Result<(), Error> {
        Ok(self.probe(share, samples)?)
    }

    fn set_adaptation(&mut self, on: bool) {
        self.set_adaptation(on);
    }

    fn state(&self) -> CoreState {
        self.state()
    }

    fn trusted(&self) -> (Option<CoreDistrust>, CoreInnovation<Number>, u32) {
        (self.distrust(), self.innovation(), self.design_age())
    }

    fn trust(&mut self) {
        self.trust();
    }

    fn set_gain_sign(&mut self, sign: Number) -> Result<(), Error> {
        Ok(self.set_gain_sign(sign)?)
    }

    fn set_fallback(&mut self, fallback: CoreFallback<Number>) -> Result<(), Error> {
        Ok(self.set_fallback(fallback)?)
    }

    fn parameters(&self) -> &[Number] {
        self.parameters()
    }
}

fn init_indirect<const NA: usize, const NB: usize, const P: usize, const C: usize>(
    place: Place<Tuner>,
    wish: &TunerWish,
    learning: &Learning,
) -> Made<Tuner> {
    let (orders, settings) = (indirect_orders(NA, NB), wish.settings()?);
    let (output, input) = (wish.output_scale, wish.input_scale);
    let mut tuner: Indirect<P, C> =
        IndirectSelfTuner::new(&orders, &settings, output, input, learning.policy()?)?;
    if let Some(start) = learning.start()? {
        tuner = tuner.with_start(start)?;
    }
    place.write(tuner)
}

fn init_direct<
    const NA: usize,
    const NB: usize,
    const DELAY: usize,
    const P: usize,
    const C: usize,
    const S: usize,
>(
    place: Place<Tuner>,
    wish: &TunerWish,
    learning: &Learning,
) -> Made<Tuner> {
    let (orders, settings) = (direct_orders(NA, NB, DELAY), wish.settings()?);
    let (output, input) = (wish.output_scale, wish.input_scale);
    let mut tuner: Direct<P, C, S> =
        DirectSelfTuner::new(&orders, &settings, output, input, learning.policy()?)?;
    if let Some(start) = learning.start()? {
        tuner = tuner.with_start(start)?;
    }
    place.write(tuner)
}

/// Fills in what is usual, for these scales, and ends of the actuator's range: a response of 0.1 rad a sample with
/// damping 0.9, an observer of 0.5, the input 0 or the nearest end of the range at first, nothing known of the gain,
/// probing with a tenth of the scale to twice, any range of the sensor, never stuck, 100 missing samples from the
/// model. Where it is not trusted the input is held, and excited by a tenth of the scale; for that half of the samples
/// are at the limits, 200 designs refused, or innovations twice the changes.
///
/// Errors: NULL_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_usual(
    wish: *mut TunerWish,
    output_scale: Number,
    input_scale: Number,
    lowest_input: Number,
    highest_input: Number,
) -> Error {
    code(|| {
        let place = memory::follow(wish)?.cast_mut();
        let response = ResponseWanted { frequency: 0.1, damping: 0.9, observer: 0.5 };
        let TunerSettings { limits, input, gain_sign, probing, sensor, supervision, .. } =
            TunerSettings::new(response, lowest_input..=highest_input, input_scale);
        *place = TunerWish {
            frequency: response.frequency,
            damping: response.damping,
            observer: response.observer,
            lowest_input: *limits.start(),
            highest_input: *limits.end(),
            first_input: input,
            gain_sign,
            output_scale,
            input_scale,
            amplitude: probing.amplitude,
            largest_amplitude: probing.largest,
            lowest_measurement: *sensor.range.start(),
            highest_measurement: *sensor.range.end(),
            stuck_after: sensor.stuck_after.into(),
            longest_gap: sensor.longest_gap.into(),
            fallback: Fallback::Hold as i32,
            fallback_input: input,
            excitation: supervision.excitation,
            saturated: supervision.saturated,
            refused: supervision.refused.into(),
            innovations: supervision.innovations,
            replace_old: supervision.replace_old.into(),
        };
        Ok(())
    })
}

/// Makes a tuner that knows nothing yet.
///
/// - tuner: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_INDIRECT_WORDS(na, nb)` or `THETAHAT_DIRECT_WORDS(na, nb, delay)` words, and
///   their size in bytes.
/// - size: `&thetahat_indirect_na_nb` or `&thetahat_direct_na_nb_delay`.
/// - wish: what is asked for.
/// - learning: how old samples are forgotten and how it starts, without its dead zone; NULL for the default. The random
///   walk with a variance of 1e-4 tracks best, where the scales are right; else exponential forgetting with 0.98.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE; OUT_OF_RANGE if a number of the wish or of the policy is out of its range.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_init(
    tuner: *mut *mut Tuner,
    memory: *mut Word,
    bytes: usize,
    size: *const TunerSize,
    wish: *const TunerWish,
    learning: *const Learning,
) -> Error {
    code(|| {
        let handle = memory::follow(tuner)?.cast_mut();
        let place = Place::<Tuner>::new(memory, bytes, size)?;
        let (init, wish) = (place.size().init, *memory::follow(wish)?);
        let learning = Learning::given(learning)?;
        *handle = init(place, &wish, &learning)?;
        Ok(())
    })
}

/// One sample: the tuner learns from the measurement, and gives the input from now on, within the limits. A measurement
/// that is NaN is missing. A step costs what that of a recursive ARX estimator does, and in an indirect tuner a design
/// of about 10 n^3 + 560 n flops, n = na + nb.
///
/// Errors: NULL_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_control(
    tuner: *mut Tuner,
    set_point: Number,
    measurement: Number,
    input: *mut Number,
) -> Error {
    code(|| {
        let tuner = memory::open(tuner)?;
        let place = memory::follow(input)?.cast_mut();
        *place = tuner.control(set_point, measurement);
        Ok(())
    })
}

/// Tells that the actuator did something else than the latest control asked for.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_applied(tuner: *mut Tuner, input: Number) -> Error {
    code(|| {
        memory::open(tuner)?.applied(input);
        Ok(())
    })
}

/// Excites the plant for so many samples: the input is that of the controller with the share 0 ... 1 of the largest
/// amplitude of probing, with either sign.
///
/// Errors: OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_probe(tuner: *mut Tuner, share: Number, samples: u32) -> Error {
    code(|| memory::open(tuner)?.probe(share, samples))
}

/// Turns adaptation off (0), or on again (1): the controller stays as it is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_set_adaptation(tuner: *mut Tuner, on: u32) -> Error {
    code(|| {
        memory::open(tuner)?.set_adaptation(on != 0);
        Ok(())
    })
}

/// Reads what it did in the latest sample, and what it has learnt. Each of the places may be NULL.
///
/// - state: a `thetahat_tuner_state`.
/// - parameters: of an indirect tuner a_1 ..., b_1 ..., the constant: na + nb + 1 numbers. Of a direct one the
///   coefficients of R, nb + delay - 1, those of S, na, and the constant.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_read(
    tuner: *const Tuner,
    state: *mut i32,
    parameters: *mut Number,
) -> Error {
    code(|| {
        let tuner = memory::read(tuner)?;
        let found = tuner.parameters();
        let parameters =
            if parameters.is_null() { &mut [] } else { memory::array_mut(parameters, found.len())? };
        write(found, parameters);
        memory::answer(state, TunerState::from(tuner.state()) as i32);
        Ok(())
    })
}

/// Reads whether it is trusted. Each of the places may be NULL.
///
/// - distrust: why it is not, a `thetahat_distrust`.
/// - innovation: what the latest measurement told the model.
/// - design_age: the samples since the latest design that was accepted.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_trusted(
    tuner: *const Tuner,
    distrust: *mut i32,
    innovation: *mut Innovation,
    design_age: *mut u32,
) -> Error {
    code(|| {
        let (reason, told, age) = memory::read(tuner)?.trusted();
        memory::answer(distrust, Distrust::from(reason) as i32);
        memory::answer(innovation, told.into());
        memory::answer(design_age, age);
        Ok(())
    })
}

/// Trusts it from now on: the controller acts, or the plant is excited until there is one. It comes back by itself
/// where the model is good again; this is for a user who knows better.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_trust(tuner: *mut Tuner) -> Error {
    code(|| {
        memory::open(tuner)?.trust();
        Ok(())
    })
}

/// Says that the gain of the plant has this sign from now on, or 0 that it is not known.
///
/// Errors: OUT_OF_RANGE if it is not finite.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_set_gain_sign(tuner: *mut Tuner, sign: Number) -> Error {
    code(|| memory::open(tuner)?.set_gain_sign(sign))
}

/// What acts from now on while it is not trusted: a `thetahat_fallback`, and the input of THETAHAT_FALLBACK_INPUT.
///
/// Errors: OUT_OF_RANGE if it is none, or that input is not finite.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_tuner_set_fallback(tuner: *mut Tuner, kind: i32, input: Number) -> Error {
    code(|| memory::open(tuner)?.set_fallback(fallback(kind, input)?))
}
