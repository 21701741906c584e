extern crate std;

use core::cell::Cell;
use std::vec;

use nalgebra::Const;

use super::{Simulated, settings, tuner};
use crate::noise::Noise;
use crate::{DirectOrders, DirectSelfTuner, Distrust, Error, Forgetting};

fn between(noise: &mut Noise, low: f64, high: f64) -> f64 {
    low + (high - low) * 0.5 * (noise.next() + 1.0)
}

/// Real, complex and integrating poles; a zero anywhere but near 1; a static gain of 0.3 to 3 (a speed of a tenth of
/// that); the dead time comes with it.
pub(super) fn random(noise: &mut Noise) -> (Simulated, usize) {
    let kind = between(noise, 0.0, 1.0);
    let (a, unit) = if kind < 0.4 {
        let (p, q) = (between(noise, 0.3, 0.97), between(noise, 0.3, 0.97));
        ([1.0, -p - q, p * q], 1.0 - p - q + p * q)
    } else if kind < 0.7 {
        let (radius, angle) = (between(noise, 0.5, 0.95), between(noise, 0.1, 1.2));
        let a = [1.0, -2.0 * radius * angle.cos(), radius * radius];
        (a, a.iter().sum())
    } else {
        let q = between(noise, 0.3, 0.9);
        ([1.0, -1.0 - q, q], 0.1 * (1.0 - q))
    };
    let choice = (between(noise, 0.0, 1.0), between(noise, 0.0, 1.0));
    let zero = match choice {
        (inside, _) if inside < 0.6 => between(noise, -0.9, 0.9),
        (_, positive) if positive < 0.5 => between(noise, 1.1, 2.0),
        _ => between(noise, -2.0, -1.2),
    };
    let first = between(noise, 0.3, 3.0) * unit / (1.0 + zero);
    let dead_time = (between(noise, 0.0, 4.0) as usize).min(3);
    let mut b = vec![0.0; dead_time];
    b.extend([first, first * zero]);
    (Simulated::new(a, &b), dead_time)
}

/// Whether the output is at the set point at the ends of the last four halves of a square wave: within 5 %, or four
/// standard deviations of the output with a set point that stays.
fn settles<C: Clone>(
    plant: &mut Simulated,
    noise: &mut Noise,
    tuner: &mut C,
    control: impl Fn(&mut C, f32, f32) -> f32,
) -> bool {
    let (mut farthest, samples) = (0.0_f64, 2400);
    for k in 0..samples {
        let y = plant.output(DEVIATION * noise.normal());
        let set_point = if k / 300 % 2 == 0 { 1.0 } else { -1.0 };
        let input = f64::from(control(tuner, set_point as f32, y as f32));
        assert!(input.abs() <= 10.0);
        plant.input(input);
        if k >= samples - 1200 && k % 300 > 260 {
            farthest = farthest.max((y - set_point).abs());
        }
    }
    let mut resting = tuner.clone();
    let deviation = deviation(plant, noise, |y| control(&mut resting, 1.0, y));
    // More than a fifth is no loop that stands still.
    farthest < (4.0 * deviation.min(0.2)).max(0.05)
}

/// Of the noise in the equation.
const DEVIATION: f64 = 0.005;

/// The deviation of the output with a set point that stays.
fn deviation(plant: &Simulated, noise: &mut Noise, mut control: impl FnMut(f32) -> f32) -> f64 {
    let mut plant = plant.clone();
    let (mut sum, mut squares) = (0.0, 0.0);
    for k in 0..2500 {
        let y = plant.output(DEVIATION * noise.normal());
        plant.input(f64::from(control(y as f32)));
        if k >= 500 {
            sum += y / 2000.0;
            squares += y * y / 2000.0;
        }
    }
    (squares - sum * sum).max(0.0).sqrt()
}

#[test]
fn of_a_hundred_random_plants_nearly_all_are_stabilised() -> Result<(), Error> {
    for seed in [1000, 2000, 3000] {
        let (mut noise, mut settled, distrusted) = (Noise(seed), 0, Cell::new(0));
        for _ in 0..100 {
            let (mut plant, _) = random(&mut noise);
            let mut tuner = tuner(&settings(), 0.99)?;
            let control = |tuner: &mut super::Tuner, set_point, y| {
                let input = tuner.control(set_point, y);
                distrusted.set(distrusted.get() + u32::from(tuner.distrust().is_some()));
                input
            };
            settled += usize::from(settles(&mut plant, &mut noise, &mut tuner, control));
        }
        // Of 490 000 samples.
        let distrusted = distrusted.get();
        assert!(settled >= 98 && distrusted < 1000, "{seed}: {settled} {distrusted}");
    }
    Ok(())
}

const DIRECT: DirectOrders = DirectOrders { na: 2, nb: 2, delay: 3, constant: true };
type Direct = DirectSelfTuner<
    f32,
    Const<{ DIRECT.parameters() }>,
    Const<{ DIRECT.size() }>,
    Const<{ DIRECT.delays() }>,
>;

/// Of plants with stable inverses, and of all others, how many of a hundred follow with the coefficients of the
/// controller estimated; a delay of three samples, or one more than the controller knows.
#[test]
fn direct_adaptation_needs_a_stable_inverse_and_the_right_delay() -> Result<(), Error> {
    for (minimum_phase, later, expected) in [(true, 0, 95..=100), (true, 1, 0..=10), (false, 0, 0..=30)] {
        let (mut noise, mut settled, mut plants) = (Noise(5), 0, 0);
        while plants < 100 {
            let (mut plant, dead_time) = random(&mut noise);
            let (first, second) = (plant.b[dead_time], plant.b[dead_time + 1]);
            if (second.abs() < 0.95 * first.abs()) != minimum_phase {
                continue;
            }
            plants += 1;
            plant = Simulated::new(plant.a, &[&vec![0.0; 2 + later][..], &[first, second]].concat());
            let forgetting = Forgetting::Exponential { factor: 0.99 };
            let mut tuner = Direct::new(&DIRECT, &settings(), 1.0, 1.0, forgetting)?;
            settled += usize::from(settles(&mut plant, &mut noise, &mut tuner, Direct::control));
        }
        assert!(expected.contains(&settled), "{minimum_phase} {later}: {settled}");
    }
    Ok(())
}

/// Rohrs' plant, 2/(s + 1) 229/(s² + 30 s + 229), every 0.04 s, under a sine of 16.1 rad/s at its output. A model of
/// first order bursts, as is documented, if it is trusted: its gain gets another sign than was given. One of third
/// order does not, with a design that grows old.
#[test]
fn what_the_model_leaves_out_lets_it_burst() -> Result<(), Error> {
    let largest = |orders: &crate::TunerOrders, response, is_supervised| -> Result<_, Error> {
        let usual = crate::TunerSettings::new(response, -20.0..=20.0, 1.0);
        let supervision =
            if is_supervised { usual.supervision } else { usual.supervision.without_distrust() };
        let settings = crate::TunerSettings { gain_sign: 1.0, supervision, ..usual };
        let forgetting = Forgetting::Exponential { factor: 0.99 };
        let largest = match orders.na {
            1 => {
                let mut tuner: crate::IndirectSelfTuner<f64, Const<3>, Const<2>> =
                    crate::IndirectSelfTuner::new(orders, &settings, 1.0, 1.0, forgetting)?;
                (rohrs(|set_point, y| tuner.control(set_point, y)), tuner.distrust())
            }
            _ => {
                let mut tuner: crate::IndirectSelfTuner<f64, Const<7>, Const<6>> =
                    crate::IndirectSelfTuner::new(orders, &settings, 1.0, 1.0, forgetting)?;
                (rohrs(|set_point, y| tuner.control(set_point, y)), tuner.distrust())
            }
        };
        Ok(largest)
    };
    let response = crate::ResponseWanted { frequency: 0.12, damping: 1.0, observer: 0.5 };
    let small = crate::TunerOrders { na: 1, nb: 1, nc: 0, constant: true, integrator: true };
    let whole = crate::TunerOrders { na: 3, nb: 3, nc: 0, constant: true, integrator: true };
    let (bursts, holds) = (largest(&small, response, false)?, largest(&whole, response, true)?);
    assert!(holds.0 < 3.0 && (3.5..20.0).contains(&bursts.0), "{bursts:?} {holds:?}");
    let told = largest(&small, response, true)?;
    assert!(
        told.0 < 1.0 && told.1 == Some(Distrust::Sign) && holds.1 == Some(Distrust::Margin),
        "{told:?} {holds:?}"
    );
    Ok(())
}

/// The largest output after the first 2000 samples.
fn rohrs(mut control: impl FnMut(f64, f64) -> f64) -> f64 {
    let (mut state, mut largest, substeps) = ([0.0_f64; 3], 0.0_f64, 40);
    let step = 0.04 / f64::from(substeps);
    for k in 0..10_000 {
        let time = f64::from(k) * 0.04;
        let y = state[0] + 0.5 * (16.1 * time).sin();
        let u = control(2.0, y);
        for _ in 0..substeps {
            let [first, second, third] = state;
            state = [
                first + step * (-first + 2.0 * second),
                second + step * third,
                third + step * (229.0 * u - 229.0 * second - 30.0 * third),
            ];
        }
        if k >= 2000 {
            largest = largest.max(y.abs());
        }
    }
    largest
}
