//! Models in equations: whether the intervals of a fit cover the truth.

use std::ops::ControlFlow;

use thetahat::data::{Channel, Log};
use thetahat::estimate::Procedure;
use thetahat::model::GreyBox;
use thetahat::optimize::Stopped;
use thetahat::report::{EquationsPlan, fit_equations};

use crate::runs;
use crate::simulated::Random;

const TRUTH: [f64; 5] = [-0.5, 2.0, 1.5, 0.1, 0.3];

/// A driven pendulum, of which angle and rate are measured, with five unknown parameters.
const PENDULUM: &str = "\
sample_time = 0.05

[states]
angle = { start = 0.2, sd = 0.3 }
rate = { start = -0.1, sd = 0.2 }

[inputs]
torque = 'u'

[parameters]
damping = { start = -0.2, sd = 1, unknown = true }
stiffness = { start = 1.3, sd = 1, unknown = true }
gain = { start = 1.0, sd = 1, unknown = true }
square = { start = 0.16, sd = 1, unknown = true }
drive = { start = 0.28, sd = 1, unknown = true }

[next]
angle = 'angle + dt * rate'
rate = 'rate + dt * (gain * torque + drive - exp(damping) * rate - stiffness * sin(angle))'

[outputs]
y1 = 'sin(angle) + square * angle^2'
y2 = 'rate'

[noise]
process = { rate = 0.002 }
measurement = { y1 = 0.02, y2 = 0.03 }
";

/// A log of it, with the noises that it tells of times `noise`.
fn log(seed: u64, noise: f64) -> Log {
    let [damping, stiffness, gain, square, drive] = TRUTH;
    let mut random = Random::new(seed);
    let mut normal = |deviation: f64| deviation * noise * random.normal();
    let (mut angle, mut rate) = (0.2 + normal(0.3), -0.1 + normal(0.2));
    let mut channels = ["u", "y1", "y2"].map(|name| Channel { name: name.into(), values: Vec::new() });
    for row in 0..400 {
        let torque = if (row / 20) % 3 == 0 { 1.0 } else { -0.7 };
        let values = [torque, angle.sin() + square * angle * angle + normal(0.02), rate + normal(0.03)];
        channels.iter_mut().zip(values).for_each(|(channel, value)| channel.values.push(value));
        let turning = gain * torque + drive - damping.exp() * rate - stiffness * angle.sin();
        (angle, rate) = (angle + 0.05 * rate, rate + 0.05 * turning + normal(0.002));
    }
    Log::new(channels.into(), 0.05).expect("the case is sound")
}

#[test]
fn intervals_of_models_in_equations_cover_the_truth() {
    let model = GreyBox::from_toml(PENDULUM).expect("the case is sound");
    let runs = runs(40);
    // With all noises larger by one factor, that factor is found.
    for noise in [1.0, 1.7] {
        let (mut squares, mut covered) = (0.0, 0_usize);
        for seed in 0..runs as u64 {
            let (log, plan) = (log(100 + seed, noise), EquationsPlan::default());
            let found = fit_equations(&model, &log, &[], &plan, &|_| ControlFlow::Continue(()))
                .expect("the case is sound");
            let Procedure::InnovationsLikelihood(outcome) = &found.estimation.procedure else {
                panic!("another procedure")
            };
            assert_eq!(outcome.search.stopped, Stopped::Converged, "seed {seed}");
            assert!(outcome.search.iterations < 20, "seed {seed}");
            for (parameter, truth) in found.model.parameters().iter().zip(TRUTH) {
                let error = parameter.standard_error.expect("it has one");
                let away = (parameter.value - truth) / error;
                assert!(away.abs() < 5.0, "seed {seed}, {}: {away}", parameter.name);
                squares += away * away;
                covered += usize::from(away.abs() < 1.959964);
            }
        }
        // Five numbers a run, not independent. With 60 runs the standard deviation of the share is about 1.5 %, of the
        // mean square 10 %.
        let (count, spread) = ((5 * runs) as f64, (60.0 / runs as f64).sqrt());
        let (share, square) = (covered as f64 / count, squares / count);
        eprintln!("noise {noise}: {:.1} %, mean square {square:.3}", 100.0 * share);
        assert!((share - 0.95).abs() < 0.05 * spread, "{noise}: {share}");
        assert!((square - 1.0).abs() < 0.35 * spread, "{noise}: {square}");
    }
}

/// A room of one state, in hours, K and kW: what is outside goes in lines, the heating is held, and both noises are
/// unknown.
const ROOM: &str = "\
sample_time = 0.5

[states]
room = { start = 20, sd = 0.2 }

[inputs]
outside = { channel = 'to', hold = 'linear' }
heating = 'q'

[parameters]
r = { start = 4, sd = 4, unknown = true, min = 0 }
c = { start = 2, sd = 2, unknown = true, min = 0 }

[derivative]
room = '((outside - room) / r + heating) / c'

[outputs]
y = 'room'

[noise]
process = { room = { start = 0.05, unknown = true } }
measurement = { y = { start = 0.2, unknown = true } }
";

const OF_ROOM: [f64; 4] = [8.0, 0.6, 0.1, 0.06];

/// The exact solution from row to row, and the exact variance of its noise.
fn room(seed: u64) -> Log {
    let [r, c, process, measurement] = OF_ROOM;
    let mut random = Random::new(seed);
    let (h, a) = (0.5, 1.0 / (r * c));
    let kept = (-a * h).exp();
    // (1 - e^(-a h))/a, and the integral of it.
    let (once, twice) = ((1.0 - kept) / a, (h - (1.0 - kept) / a) / a);
    let spread = (process * process / h * (1.0 - kept * kept) / (2.0 * a)).sqrt();
    let weather = |row: usize| 5.0 + 4.0 * (row as f64 * h / 24.0 * std::f64::consts::TAU).sin();
    let mut state = 20.0 + 0.2 * random.normal();
    let mut channels = ["to", "q", "y"].map(|name| Channel { name: name.into(), values: Vec::new() });
    for row in 0..500 {
        let heating = if row * 7 % 23 < 11 { 3.0 } else { 0.5 };
        let values = [weather(row), heating, state + measurement * random.normal()];
        channels.iter_mut().zip(values).for_each(|(channel, value)| channel.values.push(value));
        let driven = a * weather(row) + heating / c;
        let rise = a * (weather(row + 1) - weather(row)) / h;
        state = kept * state + once * driven + twice * rise + spread * random.normal();
    }
    Log::new(channels.into(), h).expect("the case is sound")
}

#[test]
fn intervals_of_plants_and_noises_cover_the_truth() {
    let model = GreyBox::from_toml(ROOM).expect("the case is sound");
    let runs = runs(40);
    let mut covered = [0_usize; 4];
    for seed in 0..runs as u64 {
        let (log, plan) = (room(500 + seed), EquationsPlan::default());
        let found = fit_equations(&model, &log, &[], &plan, &|_| ControlFlow::Continue(()))
            .expect("the case is sound");
        for ((parameter, truth), covered) in found.model.parameters().iter().zip(OF_ROOM).zip(&mut covered) {
            let error = parameter.standard_error.expect("it has one");
            *covered += usize::from((parameter.value - truth).abs() < 1.959964 * error);
        }
    }
    let shares = covered.map(|covered| covered as f64 / runs as f64);
    eprintln!("r, c, process, measurement: {:.1?} %", shares.map(|share| 100.0 * share));
    // With 200 runs the standard deviation of a share is 1.5 %.
    let spread = (200.0 / runs as f64).sqrt();
    for share in shares {
        assert!((share - 0.95).abs() < 0.05 * spread, "{shares:?}");
    }
}
