//! What a tuner does that cannot be trusted, and how trust comes back.

extern crate std;

use std::vec::Vec;

use nalgebra::Const;

use super::Simulated;
use crate::noise::Noise;
use crate::{
    Action, DirectOrders, DirectSelfTuner, Distrust, Error, Fallback, Forgetting, IndirectSelfTuner,
    ResponseWanted, Sensor, Supervision, TunerOrders, TunerSettings, TunerState,
};

const ORDERS: TunerOrders = TunerOrders { na: 2, nb: 2, nc: 0, constant: true, integrator: true };
type Indirect<T> = IndirectSelfTuner<T, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>>;
const DIRECT: DirectOrders = DirectOrders { na: 2, nb: 2, delay: 1, constant: true };
type Direct<T> =
    DirectSelfTuner<T, Const<{ DIRECT.parameters() }>, Const<{ DIRECT.size() }>, Const<{ DIRECT.delays() }>>;

/// A tuner of any kind, with numbers of any precision.
trait Tuner {
    fn control(&mut self, set_point: f64, y: f64) -> f64;
    fn distrust(&self) -> Option<Distrust>;
    fn state(&self) -> TunerState;
}

macro_rules! tuners {
    ($($tuner:ident<$number:ty>),+) => {$(
        impl Tuner for $tuner<$number> {
            fn control(&mut self, set_point: f64, y: f64) -> f64 {
                self.control(set_point as $number, y as $number).into()
            }

            fn distrust(&self) -> Option<Distrust> {
                self.distrust()
            }

            fn state(&self) -> TunerState {
                self.state()
            }
        }
    )+};
}

tuners!(Indirect<f32>, Indirect<f64>, Direct<f32>, Direct<f64>);

/// Outputs are about 5, inputs about 3 and at most 10.
fn settings<T: crate::Real>(gain_sign: i8) -> TunerSettings<T> {
    let number = |tenths: usize| T::from_count(tenths) / T::from_count(10);
    let response = ResponseWanted { frequency: number(3), damping: number(8), observer: number(5) };
    let limits = -number(100)..=number(100);
    let sign = match gain_sign {
        0 => T::zero(),
        1 => T::one(),
        _ => -T::one(),
    };
    TunerSettings { gain_sign: sign, ..TunerSettings::new(response, limits, number(30)) }
}

fn indirect(settings: &TunerSettings<f32>) -> Result<Indirect<f32>, Error> {
    Indirect::new(&ORDERS, settings, 5.0, 3.0, Forgetting::Exponential { factor: 0.99 })
}

fn direct(settings: &TunerSettings<f32>) -> Result<Direct<f32>, Error> {
    Direct::new(&DIRECT, settings, 5.0, 3.0, Forgetting::Exponential { factor: 0.99 })
}

/// A plant with this gain and dead time, an output noise of 0.02, and the set points 5 and -3.
struct Run {
    plant: Simulated,
    noise: Noise,
    samples: usize,
}

/// What happened in a part of a run.
#[derive(Debug, Default)]
struct Told {
    /// Of the samples with the input at a limit, how many in a row at most.
    latched: usize,
    /// When trust ended, why, and when it came back.
    lost: Vec<(usize, Distrust)>,
    back: Vec<usize>,
    /// The root mean square of the errors in the last 300 samples.
    error: f64,
    inputs: Vec<f64>,
}

fn plant(gain: f64, dead_time: usize) -> Simulated {
    let mut b = std::vec![0.0; dead_time];
    b.extend([0.06 * gain, 0.03 * gain]);
    Simulated::new([1.0, -1.5, 0.56], &b)
}

impl Run {
    fn new() -> Self {
        Run { plant: plant(1.0, 0), noise: Noise(1), samples: 0 }
    }

    fn on(
        &mut self,
        tuner: &mut impl Tuner,
        samples: usize,
        mut measured: impl FnMut(usize, f64) -> f64,
    ) -> Told {
        let (mut told, mut latched) = (Told::default(), 0);
        for k in 0..samples {
            let y = self.plant.output(0.035 * self.noise.next());
            let set_point = if (self.samples / 150).is_multiple_of(2) { 5.0 } else { -3.0 };
            self.samples += 1;
            let before = tuner.distrust();
            let input = tuner.control(set_point, measured(k, y));
            assert!(input.abs() <= 10.0);
            match (before, tuner.distrust()) {
                (None, Some(why)) => told.lost.push((k, why)),
                (Some(_), None) => told.back.push(k),
                _ => {}
            }
            if let Some(why) = tuner.distrust() {
                assert_eq!(tuner.state(), TunerState::Distrusted(why));
            }
            latched = if input.abs() >= 10.0 { latched + 1 } else { 0 };
            told.latched = told.latched.max(latched);
            if k + 300 >= samples {
                told.error += (y - set_point).powi(2) / 300.0;
            }
            told.inputs.push(input);
            self.plant.input(input);
        }
        told.error = told.error.sqrt();
        told
    }

    fn becomes(&mut self, gain: f64, dead_time: usize) -> &mut Self {
        self.plant.becomes(&plant(gain, dead_time));
        self
    }
}

fn as_measured(_: usize, y: f64) -> f64 {
    y
}

/// A good loop has an error of 1.3 with these steps of the set point.
const GOOD: f64 = 1.7;

/// The sign was given, and is another one: not at the limit for ever, and told. It is as it was given again: the tuner
/// comes back by itself.
fn a_reversed_plant_is_told(mut tuner: impl Tuner) {
    let mut run = Run::new();
    let before = run.on(&mut tuner, 2000, as_measured);
    assert!(before.lost.is_empty() && before.error < GOOD, "{before:?}");
    let reversed = run.becomes(-1.0, 0).on(&mut tuner, 2000, as_measured);
    assert_eq!(tuner.state(), TunerState::Distrusted(Distrust::Sign));
    // At first it may have gone from limit to limit.
    assert!(matches!(reversed.lost[..], [(0..200, _)]), "{:?}", reversed.lost);
    assert!(reversed.latched < 200 && reversed.back.is_empty(), "{} {:?}", reversed.latched, reversed.back);
    // What it holds is what it had in a good loop.
    assert!(reversed.inputs.iter().skip(200).all(|input| (-3.0..4.0).contains(input)));
    let mended = run.becomes(1.0, 0).on(&mut tuner, 2000, as_measured);
    assert!(matches!(mended.back[..], [0..1000]) && mended.lost.is_empty(), "{:?}", mended.back);
    assert!(mended.error < GOOD, "{}", mended.error);
}

#[test]
fn a_plant_whose_sign_changes_is_told_and_trust_comes_back() -> Result<(), Error> {
    let forgetting = Forgetting::Exponential { factor: 0.99 };
    a_reversed_plant_is_told(indirect(&settings(1))?);
    a_reversed_plant_is_told(direct(&settings(1))?);
    a_reversed_plant_is_told(Indirect::<f64>::new(&ORDERS, &settings(1), 5.0, 3.0, forgetting)?);
    a_reversed_plant_is_told(Direct::<f64>::new(&DIRECT, &settings(1), 5.0, 3.0, forgetting)?);
    Ok(())
}

/// The user says that it has another sign now; or that it is not known, and it is learnt.
#[test]
fn a_sign_may_be_given_anew() -> Result<(), Error> {
    for sign in [-1.0, 0.0] {
        let (mut tuner, mut run) = (indirect(&settings(1))?, Run::new());
        run.on(&mut tuner, 2000, as_measured);
        run.becomes(-1.0, 0).on(&mut tuner, 1000, as_measured);
        assert_eq!(tuner.distrust(), Some(Distrust::Sign));
        tuner.set_gain_sign(sign)?;
        let told = run.on(&mut tuner, 1000, as_measured);
        assert!(matches!(told.back[..], [0..300]) && told.error < GOOD, "{sign} {told:?}");
    }
    Ok(())
}

/// Where no sign was given a plant that is reversed is learnt, which a latched loop did not excite.
#[test]
fn a_sign_that_is_not_given_is_learnt_again() -> Result<(), Error> {
    let (mut tuner, mut run) = (indirect(&settings(0))?, Run::new());
    run.on(&mut tuner, 2000, as_measured);
    let told = run.becomes(-1.0, 0).on(&mut tuner, 2000, as_measured);
    assert!(matches!(told.lost[..], [(0..250, _)]), "{:?}", told.lost);
    assert!(matches!(told.back[..], [0..600]) && told.error < GOOD, "{:?} {}", told.back, told.error);
    Ok(())
}

/// A sign that was given wrong: not at the largest amplitude of probing for ever.
#[test]
fn a_sign_that_is_wrong_from_the_start_is_told() -> Result<(), Error> {
    fn check(mut tuner: impl Tuner) {
        let told = Run::new().on(&mut tuner, 2000, as_measured);
        assert!(matches!(told.lost[..], [(0..300, Distrust::Sign)]) && told.back.is_empty(), "{told:?}");
        // The excitation, about the input that it started with.
        assert!(told.inputs.iter().skip(300).all(|input| (input.abs() - 0.3).abs() < 1e-6));
    }
    check(indirect(&settings(-1))?);
    check(direct(&settings(-1))?);
    Ok(())
}

/// A dead time beyond the model: the loop goes from limit to limit, which is told; then it is in trouble now and then
/// only, and more seldom; and when the dead time is gone trust comes back.
#[test]
fn a_loop_between_the_limits_is_told() -> Result<(), Error> {
    let (mut tuner, mut run) = (indirect(&settings(1))?, Run::new());
    run.on(&mut tuner, 2000, as_measured);
    let told = run.becomes(1.0, 12).on(&mut tuner, 20_000, as_measured);
    assert!(matches!(told.lost[..], [(0..400, Distrust::Saturated), ..]), "{:?}", told.lost);
    let at_limits = told.inputs.iter().skip(400).filter(|input| input.abs() >= 10.0).count();
    assert!(at_limits < 1000, "{at_limits}");
    let told = run.becomes(1.0, 0).on(&mut tuner, 20_000, as_measured);
    assert!(told.error < GOOD && tuner.distrust().is_none(), "{:?}", told.back);
    Ok(())
}

/// Each fallback does what it says.
#[test]
fn the_user_chooses_what_acts_meanwhile() -> Result<(), Error> {
    for fallback in [Fallback::Hold, Fallback::Input(1.5), Fallback::LastGood] {
        let usual = settings(1);
        let supervision = Supervision { fallback, excitation: 0.0, ..usual.supervision };
        let mut tuner = indirect(&TunerSettings { supervision, ..usual })?;
        let mut run = Run::new();
        run.on(&mut tuner, 2000, as_measured);
        run.becomes(-1.0, 0).on(&mut tuner, 250, as_measured);
        assert!(tuner.distrust().is_some());
        // Whatever the sensor says, it is not trusted.
        let told = run.on(&mut tuner, 300, |k, y| if k < 5 { f64::NAN } else { y });
        let stays = told.inputs.iter().all(|input| *input == told.inputs[0]);
        match fallback {
            Fallback::Input(_) => assert!(stays && told.inputs[0] == 1.5),
            Fallback::Hold => assert!(stays && told.inputs[0].abs() < 4.0),
            // On a plant that is reversed it is no better than before; on one that is not it controls.
            Fallback::LastGood => {
                assert!(told.latched > 200);
                let told = run.becomes(1.0, 0).on(&mut tuner, 600, as_measured);
                assert!(told.error < 2.5, "{}", told.error);
            }
        }
        tuner.set_fallback(Fallback::Input(-0.5))?;
        tuner.trust();
        assert_eq!(tuner.distrust(), None);
        run.on(&mut tuner, 1, as_measured);
        assert_eq!(tuner.state(), TunerState::Controlling);
    }
    Ok(())
}

/// Adaptation is off and the plant another one: the model predicts worse than the latest measurement does.
#[test]
fn a_model_that_predicts_badly_is_told() -> Result<(), Error> {
    let (mut tuner, mut run) = (indirect(&settings(1))?, Run::new());
    run.on(&mut tuner, 2000, as_measured);
    tuner.set_adaptation(false);
    let told = run.on(&mut tuner, 2000, |_, y| y + 2.0);
    assert!(told.lost.is_empty(), "{:?}", told.lost);
    // A sensor with another unit.
    let told = run.on(&mut tuner, 2000, |_, y| 5.0 * y + 20.0);
    assert!(matches!(told.lost[..], [(_, Distrust::Innovations)]), "{:?}", told.lost);
    assert!(told.back.is_empty());
    // The model may learn again.
    tuner.set_adaptation(true);
    let told = run.on(&mut tuner, 2000, as_measured);
    assert!(matches!(told.back[..], [0..900]) && told.error < GOOD, "{told:?}");
    Ok(())
}

/// A design that is old is told, and goes on; or the fallback acts. A new design ends that.
#[test]
fn a_controller_that_is_old_goes_on() -> Result<(), Error> {
    for replace_old in [false, true] {
        let usual = settings(1);
        let supervision = Supervision { replace_old, fallback: Fallback::Input(0.0), ..usual.supervision };
        let mut tuner = indirect(&TunerSettings { supervision, ..usual })?;
        let mut run = Run::new();
        run.on(&mut tuner, 2000, as_measured);
        let mut strict = tuner.clone().with_peaks(1.0, 1.0)?;
        let told = run.on(&mut strict, 600, as_measured);
        assert!(matches!(told.lost[..], [(199.., Distrust::Margin)]), "{:?}", told.lost);
        assert_eq!(strict.state(), TunerState::Distrusted(Distrust::Margin));
        if replace_old {
            assert!(told.inputs.iter().skip(210).all(|input| input.abs() < 0.31));
        } else {
            assert!(told.error < GOOD, "{}", told.error);
        }
        let mut mended = strict.with_peaks(2.0, 3.0)?;
        let told = run.on(&mut mended, 600, as_measured);
        assert!(matches!(told.back[..], [0..300]) && told.lost.is_empty(), "{told:?}");
    }
    Ok(())
}

/// No design has margins that are bearable: told as such.
#[test]
fn margins_that_are_never_good_are_told() -> Result<(), Error> {
    let mut tuner = indirect(&settings(1))?.with_peaks(1.0, 1.0)?;
    let told = Run::new().on(&mut tuner, 1000, as_measured);
    assert!(matches!(told.lost[..], [(0..300, Distrust::Margin)]), "{:?}", told.lost);
    Ok(())
}

#[test]
fn it_tells_what_it_learns_from_and_how_old_its_design_is() -> Result<(), Error> {
    let usual = settings(1);
    let sensor = Sensor { range: -20.0..=20.0, ..Sensor::default() };
    let (mut first, mut second) = (indirect(&TunerSettings { sensor, ..usual.clone() })?, direct(&usual)?);
    let (mut of_first, mut of_second) = (Run::new(), Run::new());
    of_first.on(&mut first, 1000, as_measured);
    of_second.on(&mut second, 1000, as_measured);
    assert_eq!((first.design_age(), second.design_age()), (0, 0));
    for told in [first.innovation(), second.innovation()] {
        assert!(told.error.abs() < 0.25 && told.variance > 0.0 && told.nis < 20.0, "{told:?}");
    }
    first.set_adaptation(false);
    second.set_adaptation(false);
    of_first.on(&mut first, 10, as_measured);
    of_second.on(&mut second, 10, as_measured);
    assert_eq!((first.design_age(), second.design_age()), (10, 10));
    assert_eq!((first.innovation().action, second.innovation().action), (Action::Frozen, Action::Frozen));
    first.control(1.0, f32::NAN);
    second.control(1.0, f32::NAN);
    for told in [first.innovation(), second.innovation()] {
        assert!(told.error.is_nan() && told.action == Action::Missing, "{told:?}");
    }
    Ok(())
}
