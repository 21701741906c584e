//! Exact responses, whatever the clock; what is refused, and why.

use super::*;
use crate::Error;
use crate::spectrum::{Method, SpectrumPlan, spectrum};
use crate::step_test::{Shape, sine_test};
use crate::tests::assert_refused;

/// 450 rows for each step, at times that are not even.
fn uneven() -> Vec<f64> {
    (0..1000).map(|row| 0.02 * f64::from(row) + 0.004 * f64::from(row * row % 3)).collect()
}

#[test]
fn without_noise_every_way_is_right() {
    use StepFigure::{DeadTime, Gain, RiseTime, SettlingTime, TimeConstant};
    use StepMethod::{Crossings, Level, PlainAverage, Regime, Tangent, TwoPoints, WeightedAverage};
    let exact = found(&stepped(&uneven(), &[2.0, 11.0], first_order(1.0, 0.3), || 0.0));
    assert_eq!(exact.steps.len(), 2);
    assert_eq!((exact.steps[0].row, exact.steps[0].from, exact.steps[1].to), (101, 1.0, 1.0));
    for step in &exact.steps {
        assert_eq!(step.response.as_ref().map(|of| of.shape), Some(Shape::FirstOrder), "{step:?}");
    }
    // A step counts from the row that sees it, and the final steady state lacks exp(-7) of the change.
    for (figure, method, right, bound) in [
        (Gain, Regime, 2.0, 0.003),
        (DeadTime, TwoPoints, 0.3, 0.02),
        (TimeConstant, TwoPoints, 1.0, 0.01),
        (TimeConstant, Level, 1.0, 0.01),
        (TimeConstant, Tangent, 1.0, 0.06),
        (TimeConstant, PlainAverage, 1.0, 0.02),
        (TimeConstant, WeightedAverage, 1.0, 0.01),
        (RiseTime, Crossings, 9_f64.ln(), 0.01),
        (SettlingTime, Crossings, 0.3 + 50_f64.ln(), 0.05),
    ] {
        let summary = exact.summary(figure, method).unwrap();
        assert!((summary.value.value - right).abs() < bound, "{summary:?}");
        assert_eq!(summary.steps, 2);
    }
}

#[test]
fn shapes_are_told_apart() {
    let shape = |at: &dyn Fn(f64) -> f64| {
        let test = found(&stepped(&clock(600, 0.02), &[2.0], at, || 0.0));
        test.steps[0].response.clone().unwrap().shape
    };
    assert_eq!(shape(&first_order(1.0, 0.5)), Shape::FirstOrder);
    assert_eq!(shape(&|t: f64| 1.0 - (1.0 + t) * (-t).exp()), Shape::Overdamped);
    assert_eq!(shape(&second_order(0.5, 3.0)), Shape::Underdamped);
}

#[test]
fn a_second_order_without_noise() {
    let exact = found(&stepped(&clock(800, 0.02), &[2.0], second_order(0.2, 3.0), || 0.0));
    let of = |figure, method| value(&exact, figure, method);
    let rest = (1.0_f64 - 0.04).sqrt();
    for (figure, method, right) in [
        (StepFigure::Damping, StepMethod::Peak, 0.2),
        (StepFigure::Damping, StepMethod::TwoPeaks, 0.2),
        (StepFigure::NaturalFrequency, StepMethod::Peak, 3.0),
        (StepFigure::NaturalFrequency, StepMethod::TwoPeaks, 3.0),
        (StepFigure::PeakTime, StepMethod::Peak, std::f64::consts::PI / 3.0 / rest),
        (StepFigure::Period, StepMethod::TwoPeaks, std::f64::consts::TAU / 3.0 / rest),
    ] {
        assert!(
            (of(figure, method) / right - 1.0).abs() < 0.02,
            "{figure:?} {method:?} {}",
            of(figure, method)
        );
    }
}

#[test]
fn a_noisy_input_and_missing_values_are_no_matter() {
    let time = clock(1000, 0.02);
    let clean = stepped(&time, &[2.0, 11.0], first_order(1.0, 0.0), || 0.0);
    let values = |name: &str| clean.channel(name).unwrap().values.clone();
    let (mut random, mut u, mut y) = (Random::of(3, 0), values("u"), values("y"));
    u.iter_mut().for_each(|u| *u += 0.05 * random.normal());
    (150..160).for_each(|row| y[row] = f64::NAN);
    u[700] = f64::NAN;
    let test = found(&timed(&time, u, y));
    assert_eq!(test.steps.len(), 2);
    let gain = test.summary(StepFigure::Gain, StepMethod::Regime).unwrap().value;
    // The noise of the input is in the standard error.
    assert!(
        (gain.value - 2.0).abs() < 3.0 * gain.standard_error.unwrap() && gain.standard_error.unwrap() > 1e-3
    );
    assert!((value(&test, StepFigure::TimeConstant, StepMethod::WeightedAverage) - 1.0).abs() < 0.01);
}

#[test]
fn what_cannot_be_read_off_is_refused() {
    let time = clock(500, 0.02);
    let plan = StepTestPlan::new("u", "y");
    let zeros = vec![0.0; 500];
    let step: Vec<f64> = (0..500).map(|t| f64::from(t >= 100)).collect();
    let noise = |level: f64| {
        let mut random = Random::of(5, 0);
        move || level * random.normal()
    };
    for (log, says, undetermined) in [
        (timed(&time, zeros.clone(), step.clone()), "the input 'u' is constant (0)", false),
        (
            timed(&time, (0..500).map(|t| (0.1 * f64::from(t)).sin()).collect(), step.clone()),
            "does not jump from one level that it holds to another",
            false,
        ),
        (
            timed(&time, step.clone(), zeros.clone()),
            "which is lost in its noise (standard deviation 0)",
            true,
        ),
        (
            stepped(&time, &[2.0], first_order(1.0, 0.0), noise(2.0)),
            "which is lost in its noise (standard deviation ",
            true,
        ),
        (timed(&time, step.clone(), step.clone()), "within one step of the clock", true),
        (stepped(&time, &[2.0], first_order(5.0, 0.0), || 0.0), "does not reach a final steady state", true),
        // Noise hides that it still moves, but not that it has had no time.
        (
            stepped(&time, &[2.0], first_order(3.0, 0.0), noise(0.2)),
            "does not reach a final steady state",
            true,
        ),
        (
            stepped(&time, &[9.9], first_order(1.0, 0.0), || 0.0),
            "there are 495 rows before it and 5 after it",
            true,
        ),
        (
            timed(&time, step.clone(), time.iter().map(|t| t * t).collect()),
            "the output is not at rest before it",
            true,
        ),
    ] {
        let error = step_test(&log, &[], &plan).unwrap_err();
        assert!(error.to_string().contains(says), "{says}: {error}");
        assert_eq!(matches!(error, Error::Undetermined { .. }), undetermined, "{error:?}");
    }
    // A zero that makes the output jump first.
    let leads = stepped(
        &time,
        &[2.0],
        |t: f64| if t < 0.0 { 0.0 } else { 1.0 + 3.0 * (-4.0 * t).exp() * (1.0 - (-40.0 * t).exp()) },
        || 0.0,
    );
    assert_refused(step_test(&leads, &[], &plan), "overshoots by more than its whole change");
    let lags = stepped(&time, &[2.0], first_order(1.0, 0.0), || 0.0);
    let large = lags.channel("y").unwrap().values.iter().map(|y| 1e290 * y).collect();
    let extreme = timed(&time, step.iter().map(|u| 1e-290 * u).collect(), large);
    assert_refused(step_test(&extreme, &[], &plan), "the gain leaves the range of numbers");
    let log = timed(&time, step.clone(), step.iter().map(|u| 1e308 * (2.0 * u - 1.0)).collect());
    assert_refused(step_test(&log, &[], &plan), "give them in other units");
    assert_refused(step_test(&log, &[], &StepTestPlan::new("u", "u")), "each channel has one role");
    assert_refused(step_test(&log, &[], &StepTestPlan::new("u", "z")), "no channel 'z'");
    let rows = StepTestPlan { rows: vec!["1..900".parse().unwrap()], ..plan.clone() };
    assert_refused(step_test(&log, &[], &rows), "the log has 500 rows");
    let nothing = timed(&time, step, vec![f64::NAN; 500]);
    assert_refused(step_test(&nothing, &[], &plan), "no row has a value of both channels");
}

#[test]
fn tiny_and_large_units_are_no_matter() {
    let time = clock(600, 0.02);
    let plain = stepped(&time, &[2.0], first_order(1.0, 0.0), || 0.0);
    for unit in [1e-290, 1e290] {
        let scaled =
            |name: &str| plain.channel(name).unwrap().values.iter().map(|value| unit * value).collect();
        let test = found(&timed(&time, scaled("u"), scaled("y")));
        assert!((value(&test, StepFigure::Gain, StepMethod::Regime) - 2.0).abs() < 0.01, "{unit}");
        assert!((value(&test, StepFigure::TimeConstant, StepMethod::WeightedAverage) - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_step_that_cannot_be_evaluated_keeps_its_place() {
    let test = found(&stepped(&clock(650, 0.02), &[2.0, 10.0, 11.0], first_order(1.0, 0.0), || 0.0));
    let refused: Vec<bool> = test.steps.iter().map(|step| step.refused.is_some()).collect();
    assert_eq!(refused, [false, true, true], "{test:?}");
    assert_eq!(test.warnings.iter().filter(|of| of.contains("is left out")).count(), 2);
    let text = crate::Document::to_json(&test).unwrap();
    assert_eq!(<StepTest as crate::Document>::from_json(&text).unwrap(), test);
    let broken = text.replacen("\"refused\": null", "\"refused\": \"no\"", 1);
    assert_refused(<StepTest as crate::Document>::from_json(&broken), "step 1 has neither");
}

#[test]
fn sines_tell_the_time_constant() {
    let (mut u, mut y, mut state) = (Vec::new(), Vec::new(), 0.0);
    // y' = (u - y)/20, stepped exactly for held inputs.
    let stays = (-1.0_f64 / 20.0).exp();
    for period in [400, 200, 140, 120, 80] {
        for t in 0..6 * period {
            u.push((std::f64::consts::TAU * f64::from(t) / f64::from(period)).sin());
            y.push(state);
            state = stays * state - 3.0 * (1.0 - stays) * u.last().unwrap();
        }
    }
    let log = timed(&clock(u.len(), 1.0), u, y);
    let method = Method::Sines { period: None, discard: None };
    let response = spectrum(&log, &[], &SpectrumPlan { method, ..SpectrumPlan::new(&["u"], "y") }).unwrap();
    let test = sine_test(&response, "u").unwrap();
    // The held input is half a row late: 20 omega = tan(pi/4 - omega/2).
    assert!((value(&test, StepFigure::TimeConstant, StepMethod::Phase) - 20.98).abs() < 0.1, "{test:?}");
    let size = 3.0 * (2.0 / (1.0 + 0.9534_f64.powi(2))).sqrt();
    assert!((value(&test, StepFigure::Gain, StepMethod::Phase) + size).abs() < 0.01, "{test:?}");
    assert_refused(sine_test(&response, "w"), "it is from: u");
    let mut far = response.clone();
    far.responses[0].points.truncate(3);
    assert_refused(sine_test(&far, "u"), "measure sines on both sides of it");
}
