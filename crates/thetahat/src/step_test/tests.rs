//! Identities, the spread of each way, and refusals.

mod refusals;
mod spread;

use thetahat_numerics::random::Random;

use super::{StepFigure, StepMethod, StepTest, StepTestPlan, step_test};
use crate::data::Log;
use crate::tests::channel;

/// A log with a column of times.
fn timed(time: &[f64], u: Vec<f64>, y: Vec<f64>) -> Log {
    Log::recorded(vec![channel("u", u), channel("y", y)], time.to_vec()).unwrap()
}

/// The response of a plant with a gain of 2 and an offset of 5 to steps at these times, from 1 to 3 and back; `at` is
/// its unit step response.
fn stepped(time: &[f64], steps: &[f64], at: impl Fn(f64) -> f64, mut noise: impl FnMut() -> f64) -> Log {
    let passed = |t: f64| steps.iter().filter(move |step| **step <= t);
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let u = time.iter().map(|t| if passed(*t).count().is_multiple_of(2) { 1.0 } else { 3.0 }).collect();
    let clean = |t: f64| -> f64 { passed(t).enumerate().map(|(k, step)| 4.0 * sign(k) * at(t - step)).sum() };
    let y = time.iter().map(|t| 5.0 + clean(*t) + 4.0 * noise()).collect();
    timed(time, u, y)
}

fn clock(rows: usize, step: f64) -> Vec<f64> {
    (0..rows).map(|row| step * row as f64).collect()
}

/// 1 - exp(-(t - theta)/tau).
fn first_order(tau: f64, theta: f64) -> impl Fn(f64) -> f64 {
    move |t| 1.0 - (-(t - theta).max(0.0) / tau).exp()
}

/// The step response of 1/(1 + 2 zeta s/omega + s^2/omega^2).
fn second_order(zeta: f64, omega: f64) -> impl Fn(f64) -> f64 {
    let rest = (1.0 - zeta * zeta).sqrt();
    move |t| {
        let angle = omega * rest * t;
        1.0 - (-zeta * omega * t).exp() * (angle.cos() + zeta / rest * angle.sin())
    }
}

fn found(log: &Log) -> StepTest {
    step_test(log, &[], &StepTestPlan::new("u", "y")).unwrap()
}

fn value(found: &StepTest, figure: StepFigure, method: StepMethod) -> f64 {
    found.summary(figure, method).map_or(f64::NAN, |of| of.value.value)
}

/// The process beside the figures has the shape of the responses, and is exact where they are.
#[test]
fn the_process_of_least_squares_has_the_shape_of_the_responses() {
    let at = |t: f64, theta: f64| 1.0 - (-(t - theta).max(0.0) / 8.0).exp();
    let pair = |t: f64| {
        let t = t.max(0.0);
        1.0 - (-0.3 * t).exp()
            * ((0.91_f64.sqrt() * t).cos() + 0.3 / 0.91_f64.sqrt() * (0.91_f64.sqrt() * t).sin())
    };
    let u = |t: f64| if (40.0..160.0).contains(&t) { 2.0 } else { 0.0 };
    let found = |y: &dyn Fn(f64) -> f64| {
        let time = || (0..560).map(|k| 0.5 * f64::from(k));
        let channels = vec![
            channel("u", time().map(u).collect::<Vec<_>>()),
            channel("y", time().map(y).collect::<Vec<_>>()),
        ];
        let log = Log::new(channels, 0.5).unwrap();
        step_test(&log, &[], &StepTestPlan::new("u", "y")).unwrap()
    };
    let near = |found: &StepTest, name: &str, expected: f64| {
        let parameters = &found.process.as_ref().unwrap().parameters;
        let own = parameters.iter().find(|own| own.name == name).unwrap();
        assert!((own.value - expected).abs() < 1e-4, "{name}: {}", own.value);
    };
    let first = found(&|t| 5.0 + 3.0 * (at(t - 40.0, 1.3) - at(t - 160.0, 1.3)));
    assert_eq!(first.process.as_ref().unwrap().structure.to_string(), "p1d");
    for (name, expected) in [("K", 1.5), ("tau", 8.0), ("theta", 1.3)] {
        near(&first, name, expected);
    }
    let beside = first.summary(StepFigure::TimeConstant, StepMethod::LeastSquares).unwrap();
    assert!((beside.value.value - 8.0).abs() < 1e-4);
    let second = found(&|t| 5.0 + 3.0 * (pair(t - 40.0) - pair(t - 160.0)));
    assert_eq!(second.process.as_ref().unwrap().structure.to_string(), "p2du");
    near(&second, "zeta", 0.3);
    near(&second, "omega", 1.0);
}

#[test]
fn rounding_is_noise() {
    let time = clock(400, 0.5);
    let exact = stepped(&time, &[50.0], first_order(25.0, 5.0), || 0.0);
    let rounded = |values: &[f64]| values.iter().map(|value| (4.0 * value).round() / 4.0).collect();
    let log = timed(
        &time,
        exact.channel("u").unwrap().values.clone(),
        rounded(&exact.channel("y").unwrap().values),
    );
    let found = step_test(&log, &[], &StepTestPlan::new("u", "y")).unwrap();
    let response = found.steps[0].response.as_ref().unwrap();
    // A quarter over the root of 12.
    assert!((response.noise - 0.25 / 12.0_f64.sqrt()).abs() < 1e-12, "{}", response.noise);
    let gain = &response.trusted(StepFigure::Gain).unwrap().value;
    assert!(
        (gain.value - 2.0).abs() < 3.0 * gain.standard_error.unwrap() && gain.standard_error.unwrap() > 0.01
    );
}
