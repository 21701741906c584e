extern crate std;
use std::vec;
use std::vec::Vec;

use nalgebra::{Const, OVector};

use super::*;
use crate::noise::Noise;
use crate::{Dimension, Error};

/// 1/(s (s + 1)) sampled every h = 0.5 s with the input held.
pub(super) fn motor() -> ([f64; 3], [f64; 3]) {
    let (h, e) = (0.5_f64, (-0.5_f64).exp());
    ([1.0, -1.0 - e, e], [0.0, h - 1.0 + e, 1.0 - e - h * e])
}

/// The poles of frequency 1 and damping 0.7, sampled as fast.
fn response() -> [f64; 3] {
    let (decay, turn) = (0.7 * 0.5_f64, 0.5 * (1.0 - 0.7_f64 * 0.7).sqrt());
    [1.0, -2.0 * (-decay).exp() * turn.cos(), (-2.0 * decay).exp()]
}

/// The motor's controller with an integrator.
fn integrating() -> Result<RstController<f64, Const<4>>, Error> {
    let ((a, b), response) = (motor(), response());
    let observer = &[1.0, -0.5];
    let wanted = WantedPoles { response: &response, observer, integrator: true, cancel_zeros: false };
    RstController::pole_placement(&a, &b, &wanted)
}

pub(super) fn times(first: &[f64], second: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; first.len() + second.len() - 1];
    for (i, a) in first.iter().enumerate() {
        for (j, b) in second.iter().enumerate() {
            product[i + j] += a * b;
        }
    }
    product
}

pub(super) fn plus(first: &[f64], second: &[f64]) -> Vec<f64> {
    let at = |values: &[f64], place: usize| values.get(place).copied().unwrap_or(0.0);
    (0..first.len().max(second.len())).map(|place| at(first, place) + at(second, place)).collect()
}

pub(super) fn monic<N: Dimension>(rest: &OVector<f64, N>) -> Vec<f64> {
    std::iter::once(1.0).chain(rest.iter().copied()).collect()
}

pub(super) fn near(found: &[f64], wanted: &[f64], tolerance: f64) -> bool {
    plus(found, &wanted.iter().map(|value| -value).collect::<Vec<_>>())
        .iter()
        .all(|gap| gap.abs() < tolerance)
}

/// Åström and Wittenmark, Adaptive Control, 2nd ed., examples 3.1 and 3.2 (figures of an independent program).
#[test]
fn the_motor_has_the_published_controllers() -> Result<(), Error> {
    let ((a, b), response) = (motor(), response());
    let mut wanted =
        WantedPoles { response: &response, observer: &[1.0], integrator: false, cancel_zeros: true };
    let found: RstController<f64, Const<3>> = RstController::pole_placement(&a, &b, &wanted)?;
    assert!(near(found.r().as_slice(), &[0.846742, 0.0, 0.0], 1e-6), "{found:?}");
    assert!(near(found.s().as_slice(), &[2.685158, -1.032054, 0.0], 1e-6), "{found:?}");
    assert!((found.gain() - 1.653104).abs() < 1e-6);
    wanted.cancel_zeros = false;
    let found: RstController<f64, Const<3>> = RstController::pole_placement(&a, &b, &wanted)?;
    assert!(near(found.r().as_slice(), &[0.111105, 0.0, 0.0], 1e-6), "{found:?}");
    assert!(near(found.s().as_slice(), &[1.642216, -0.747070, 0.0], 1e-6), "{found:?}");
    assert!((found.gain() - 0.895146).abs() < 1e-6);
    // Poles of the loop that are well inside the unit circle leave margins.
    let (sensitivity, complementary) = found.peaks(&a, &b, 200);
    assert!((1.0..2.0).contains(&sensitivity) && (0.9..2.0).contains(&complementary));
    let single: RstController<f32, Const<3>> = RstController::pole_placement(
        &a.map(|value| value as f32),
        &b.map(|value| value as f32),
        &WantedPoles {
            response: &response.map(|value| value as f32),
            observer: &[1.0],
            integrator: false,
            cancel_zeros: false,
        },
    )?;
    assert!((single.s()[0] - 1.642216).abs() < 1e-4);
    Ok(())
}

/// The equation, for plants of any kind, with everything that may be asked for.
#[test]
fn poles_are_where_they_were_wanted() -> Result<(), Error> {
    let mut noise = Noise(3);
    for case in 0..200 {
        let integrator = case % 2 == 1;
        let cancel_zeros = case % 4 >= 2;
        let mut next = || 1.5 * noise.next();
        let a = [1.0, next(), next(), next()];
        // A zero inside the unit circle, after a delay of two.
        let b = [0.0, 0.0, 1.0 + next().abs(), 0.4 * next()];
        let response = [1.0, 0.4 * next(), 0.1 * next()];
        let observer = [1.0, 0.5 * next()];
        let wanted = WantedPoles { response: &response, observer: &observer, integrator, cancel_zeros };
        let (r, s, rest, gain) = if integrator {
            parts(&RstController::<f64, Const<6>>::pole_placement(&a, &b, &wanted)?)
        } else {
            parts(&RstController::<f64, Const<5>>::pole_placement(&a, &b, &wanted)?)
        };
        let mut poles = times(&response, &observer);
        let mut static_gain: f64 = b.iter().sum();
        if cancel_zeros {
            poles = times(&poles, &[1.0, b[3] / b[2]]);
            static_gain = b[2];
        }
        let closed = plus(&times(&a, &r), &times(&b, &s));
        let size = s.iter().chain(&r).fold(1.0_f64, |size, value| size.max(value.abs()));
        assert!(near(&closed, &poles, 1e-11 * size), "{case} {closed:?} {poles:?}");
        assert!(near(&rest, &observer, 1e-15));
        assert!((gain * static_gain - response.iter().sum::<f64>()).abs() < 1e-12);
        if integrator {
            assert!(r.iter().sum::<f64>().abs() < 1e-11 * size);
        }
    }
    Ok(())
}

fn parts<N: Dimension>(found: &RstController<f64, N>) -> (Vec<f64>, Vec<f64>, Vec<f64>, f64) {
    (monic(found.r()), found.s().iter().copied().collect(), monic(found.observer()), found.gain())
}

/// The plant of the loop, in its own words.
pub(super) struct Plant<'a> {
    pub(super) a: &'a [f64],
    pub(super) b: &'a [f64],
    pub(super) outputs: Vec<f64>,
    pub(super) inputs: Vec<f64>,
}

impl Plant<'_> {
    pub(super) fn output(&mut self, load: f64) -> f64 {
        let k = self.outputs.len();
        let at = |values: &[f64], lag: usize| {
            k.checked_sub(lag).and_then(|place| values.get(place)).copied().unwrap_or(0.0)
        };
        let past = self.a.iter().enumerate().skip(1).map(|(lag, a)| -a * at(&self.outputs, lag));
        let driven = self.b.iter().enumerate().skip(1).map(|(lag, b)| b * (at(&self.inputs, lag) + load));
        let y = past.chain(driven).sum();
        self.outputs.push(y);
        y
    }
}

#[test]
fn the_loop_answers_as_was_wanted_and_a_load_is_forgotten() -> Result<(), Error> {
    let ((a, b), response) = (motor(), response());
    let mut controller = integrating()?;
    let mut plant = Plant { a: &a, b: &b, outputs: vec![], inputs: vec![] };
    // B A_m(1)/(B(1) A_m), driven by the set point.
    let scale = response.iter().sum::<f64>() / b.iter().sum::<f64>();
    let model_b: Vec<f64> = b.iter().map(|b| b * scale).collect();
    let mut model = Plant { a: &response, b: &model_b, outputs: vec![], inputs: vec![] };
    for k in 0..400 {
        let load = if k < 200 { 0.0 } else { 0.7 };
        let (y, expected) = (plant.output(load), model.output(0.0));
        if k < 200 {
            assert!((y - expected).abs() < 1e-10, "{k}: {y} {expected}");
        }
        let u = controller.control(1.0, y);
        plant.inputs.push(u);
        model.inputs.push(1.0);
    }
    let last = plant.outputs[399];
    assert!((last - 1.0).abs() < 1e-9 && plant.outputs[205] > 1.01);
    Ok(())
}

/// An actuator at its limit does not wind the integrator up, whether the controller knows the limit or is told what
/// acted.
#[test]
fn limits_do_not_wind_it_up() -> Result<(), Error> {
    let (a, b) = motor();
    let free = integrating()?;
    let mut limited = free.clone().with_limits(-0.2..=0.2)?;
    let mut told = free.clone();
    let mut wound = free.clone();
    let run = |controller: &mut RstController<f64, Const<4>>, tells: bool| {
        let mut plant = Plant { a: &a, b: &b, outputs: vec![], inputs: vec![] };
        for _ in 0..400 {
            let y = plant.output(0.0);
            let u = controller.control(5.0, y).clamp(-0.2, 0.2);
            if tells {
                controller.applied(u);
            }
            plant.inputs.push(u);
        }
        (plant.outputs.iter().copied().fold(0.0, f64::max), plant.outputs[399])
    };
    let (peak, end) = run(&mut limited, false);
    assert!(peak < 5.6 && (end - 5.0).abs() < 1e-3, "{peak} {end}");
    let (again, _) = run(&mut told, true);
    assert!((again - peak).abs() < 1e-9, "{again} {peak}");
    let (far, _) = run(&mut wound, false);
    assert!(far > peak + 1.0, "{far}");
    Ok(())
}

#[test]
fn it_takes_over_without_a_bump_and_holds_while_nothing_is_measured() -> Result<(), Error> {
    let mut controller = integrating()?;
    controller.start(0.3, 2.0, 2.0);
    for _ in 0..20 {
        assert!((controller.control(2.0, 2.0) - 0.3).abs() < 1e-12);
    }
    let moved = controller.control(2.0, 1.9);
    assert!(moved > 0.35);
    let before = std::format!("{controller:?}");
    assert_eq!(controller.control(2.0, f64::NAN), moved);
    assert_eq!(controller.control(f64::INFINITY, 1.9), moved);
    controller.applied(f64::NAN);
    assert_eq!(std::format!("{controller:?}"), before);
    Ok(())
}

/// L = k q⁻¹/(1 - q⁻¹): 1/(1 + L) is largest at half the sampling, 2/(2 - k).
#[test]
fn peaks_are_those_of_the_loop() -> Result<(), Error> {
    for gain in [0.5, 1.0, 1.8] {
        let controller: RstController<f64, Const<1>> =
            RstController::new(gain, [0.0].into(), [gain].into(), [0.0].into())?;
        let (sensitivity, complementary) = controller.peaks(&[1.0, -1.0], &[0.0, 1.0], 1000);
        // The frequencies begin and end half a step inside.
        assert!((sensitivity * (2.0 - gain) / 2.0 - 1.0).abs() < 1e-4, "{sensitivity}");
        let wanted = (gain / (2.0 - gain)).max(1.0);
        assert!((complementary / wanted - 1.0).abs() < 1e-4, "{complementary}");
    }
    Ok(())
}

#[test]
fn what_cannot_be_placed_is_refused() {
    let ((a, b), response) = (motor(), response());
    let wanted =
        WantedPoles { response: &response, observer: &[1.0], integrator: false, cancel_zeros: false };
    let placed = |a: &[f64], b: &[f64], wanted: &WantedPoles<'_, f64>| {
        RstController::<f64, Const<3>>::pole_placement(a, b, wanted).map(|_| ())
    };
    // A pole and a zero at 0.6 in both.
    let common = (times(&[1.0, -0.6], &[1.0, -0.9]), times(&[0.0, 1.0], &[1.0, -0.6]));
    let range = "a polynomial without a factor in common with a";
    assert_eq!(placed(&common.0, &common.1, &wanted), Err(Error::OutOfRange { argument: "b", range }));
    assert!(matches!(placed(&a, &[1.0, 0.5, 0.2], &wanted), Err(Error::OutOfRange { argument: "b", .. })));
    assert!(matches!(placed(&a, &[0.0, 0.0, 0.0], &wanted), Err(Error::OutOfRange { argument: "b", .. })));
    let still = [1.0, -0.5, 0.1];
    assert!(matches!(
        placed(&still, &[0.0, 1.0, -1.0], &wanted),
        Err(Error::OutOfRange { argument: "b", .. })
    ));
    assert!(matches!(placed(&[0.9, 0.1, 0.1], &b, &wanted), Err(Error::OutOfRange { argument: "a", .. })));
    assert!(matches!(placed(&a, &[0.0, f64::NAN, 1.0], &wanted), Err(Error::NotFinite { argument: "b" })));
    assert!(matches!(placed(&[], &b, &wanted), Err(Error::OutOfRange { argument: "a", .. })));
    assert_eq!(placed(&a, &b[..2], &wanted), Err(Error::Orders { needed: 2, available: 3 }));
    let long = WantedPoles { observer: &[1.0, 0.1, 0.1], ..wanted };
    assert_eq!(placed(&a, &b, &long), Err(Error::Length { argument: "observer", expected: 2, found: 3 }));
    let cancelled = WantedPoles { cancel_zeros: true, ..wanted };
    assert!(matches!(placed(&a, &[0.0, 1.0, 1.5], &cancelled), Err(Error::OutOfRange { argument: "b", .. })));
    let limits = RstController::<f64, Const<1>>::new(1.0, [0.0].into(), [1.0].into(), [0.0].into())
        .and_then(|controller| controller.with_limits(1.0..=-1.0));
    assert!(matches!(limits.map(|_| ()), Err(Error::OutOfRange { argument: "limits", .. })));
}
