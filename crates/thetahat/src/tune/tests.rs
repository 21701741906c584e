use super::*;
use crate::data::Offset;
use crate::model::{Parameter, ProcessModel, ProcessStructure, Signal};
use crate::tests::assert_refused;

fn model(word: &str, values: &[f64]) -> ProcessModel {
    let structure: ProcessStructure = word.parse().unwrap();
    let signal = |name: &str| Signal { name: name.to_owned(), offset: Offset::default() };
    let parameters = structure.names().into_iter().zip(values);
    let parameters =
        parameters.map(|(name, &value)| Parameter { name, value, standard_error: Some(0.01 * value.abs()) });
    let row =
        |i: usize| (0..values.len()).map(|j| if i == j { (0.01 * values[i]).powi(2) } else { 0.0 }).collect();
    ProcessModel {
        structures: vec![structure],
        sample_time: 0.5,
        inputs: vec![signal("u")],
        output: signal("y"),
        parameters: parameters.collect(),
        covariance: Some((0..values.len()).map(row).collect()),
        offset_covariance: None,
        noise_variance: 0.04,
        degrees_of_freedom: Some(90),
        free_start: false,
    }
}

fn setting(found: &Tuning, rule: Rule, controller: Controller) -> &ControllerSettings {
    found.settings.iter().find(|own| (own.rule, own.controller) == (rule, controller)).unwrap()
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} {expected}");
}

/// Skogestad 2003: with tau_c = theta and Ti = tau the loop is always the same, L = e^(-theta s)/(2 theta s): Ms 1.59,
/// a gain margin of 3.14 and a phase margin of 61.4 degrees.
#[test]
fn simc_settings_and_margins_are_the_published_ones() {
    let found = tune(&model("p1d", &[1.0, 10.0, 1.0]), &TuningPlan::default()).unwrap();
    let simc = setting(&found, Rule::Simc, Controller::Pi);
    near(simc.gain, 5.0, 1e-12);
    near(simc.integral_time, 8.0, 1e-12);
    let found = tune(&model("p1d", &[2.0, 6.0, 1.0]), &TuningPlan::default()).unwrap();
    let simc = setting(&found, Rule::Simc, Controller::Pi);
    near(simc.gain, 1.5, 1e-12);
    near(simc.integral_time, 6.0, 1e-12);
    near(simc.closed_loop.peak_sensitivity, 1.59, 0.005);
    near(simc.closed_loop.gain_margin.unwrap(), std::f64::consts::PI, 1e-3);
    near(simc.closed_loop.phase_margin.unwrap(), 61.4, 0.1);
    // The loop of this L overshoots by 4 %, whatever the process.
    near(simc.closed_loop.overshoot.unwrap(), 0.04, 0.01);
    assert!(simc.closed_loop.stable && simc.closed_loop.worst_peak_sensitivity.unwrap() > 1.59);
    // tau_I is 8 theta, and the load of 1 leaves |error| of Ti/Kc where it does not change sign (Åström and Hägglund).
    near(simc.closed_loop.load_absolute_error.unwrap(), 6.0 / 1.5, 0.1);
}

#[test]
fn two_lags_take_a_derivative_and_the_half_rule() {
    let process = model("p3d", &[2.0, 10.0, 4.0, 1.0, 0.5]);
    let found = tune(&process, &TuningPlan { closed_loop_time: Some(3.0), ..TuningPlan::default() }).unwrap();
    let pi = setting(&found, Rule::Simc, Controller::Pi);
    // tau1 = 10 + 4/2, theta = 0.5 + 4/2 + 1.
    near(pi.process.time_constant.unwrap(), 12.0, 1e-12);
    near(pi.process.dead_time, 3.5, 1e-12);
    near(pi.gain, 12.0 / (2.0 * 6.5), 1e-12);
    let pid = setting(&found, Rule::Simc, Controller::Pid);
    // tau2 = 4 + 1/2, theta = 0.5 + 1/2; Ti = min(10, 16), in series.
    near(pid.process.second_time_constant, 4.5, 1e-12);
    let (series, factor) = (10.0 / (2.0 * 4.0), 1.0 + 4.5 / 10.0);
    near(pid.gain, series * factor, 1e-12);
    near(pid.integral_time, 10.0 * factor, 1e-12);
    near(pid.derivative_time, 4.5 / factor, 1e-12);
    for own in &found.settings {
        let response = &own.closed_loop;
        assert!(response.stable && response.settling_time.is_some(), "{own:?}");
        near(*response.setpoint_response.last().unwrap(), 1.0, 0.02);
        near(*response.load_response.last().unwrap(), 0.0, 0.02);
        near(*response.controller_output.last().unwrap(), 0.5, 0.02);
    }
    // A slower loop is further from instability.
    let slow = tune(&process, &TuningPlan { closed_loop_time: Some(30.0), ..TuningPlan::default() }).unwrap();
    assert!(slow.settings[0].closed_loop.peak_sensitivity < found.settings[0].closed_loop.peak_sensitivity);
}

#[test]
fn integrating_and_inverse_processes_are_held() {
    let found = tune(&model("p0di", &[-0.5, 2.0]), &TuningPlan::default()).unwrap();
    let simc = setting(&found, Rule::Simc, Controller::Pi);
    near(simc.gain, -0.5, 1e-12);
    near(simc.integral_time, 16.0, 1e-12);
    near(simc.closed_loop.peak_sensitivity, 1.70, 0.01);
    for own in &found.settings {
        assert!(own.closed_loop.stable, "{own:?}");
        near(*own.closed_loop.setpoint_response.last().unwrap(), 1.0, 0.05);
    }
    let lambda = setting(&found, Rule::Lambda, Controller::Pi);
    near(lambda.integral_time, 2.0 * lambda.closed_loop_time + 2.0, 1e-12);
    let lag = tune(&model("p1di", &[0.5, 3.0, 1.0]), &TuningPlan::default()).unwrap();
    near(setting(&lag, Rule::Simc, Controller::Pid).process.second_time_constant, 3.0, 1e-12);
    // Without a dead time the loop is as fast as is said.
    let quick = tune(&model("p1", &[1.0, 9.0]), &TuningPlan::default()).unwrap();
    near(quick.settings[0].closed_loop_time, 3.0, 1e-12);
    assert!(quick.warnings.iter().any(|word| word.contains("no dead time")), "{:?}", quick.warnings);
}

/// A dead time that is hardly known may be twice as long.
#[test]
fn a_loop_that_may_be_unstable_is_told() {
    let mut uncertain = model("p1d", &[1.0, 10.0, 1.0]);
    uncertain.covariance.iter_mut().for_each(|rows| rows[2][2] = 4.0);
    let found = tune(&uncertain, &TuningPlan::default()).unwrap();
    let simc = setting(&found, Rule::Simc, Controller::Pi);
    assert!(simc.closed_loop.stable && simc.closed_loop.worst_peak_sensitivity.is_none());
    assert!(
        found.warnings.iter().any(|word| word.contains("at an end of the 95 % intervals")),
        "{:?}",
        found.warnings
    );
    uncertain.covariance = None;
    let found = tune(&uncertain, &TuningPlan::default()).unwrap();
    assert!(!found.warnings.iter().any(|word| word.contains("at an end")), "{:?}", found.warnings);
}

#[test]
fn what_cannot_be_tuned_is_told() {
    let refused = |model: &ProcessModel, plan: &TuningPlan, words: &str| {
        assert_refused(tune(model, plan), words);
    };
    let plan = TuningPlan::default();
    refused(&model("p1dz", &[1.0, 2.0, 0.5, 1.0]), &plan, "with a zero");
    refused(&model("p2du", &[1.0, 2.0, 0.5, 1.0]), &plan, "underdamped");
    refused(&model("rc1", &[1.0, 2.0, 0.5]), &plan, "side by side");
    refused(&model("p1d", &[0.0, 2.0, 0.5]), &plan, "gain is zero");
    for time in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let plan = TuningPlan { closed_loop_time: Some(time), ..TuningPlan::default() };
        refused(&model("p1d", &[1.0, 2.0, 0.5]), &plan, "not a positive");
    }
    let plan = TuningPlan { input: Some("v".to_owned()), ..TuningPlan::default() };
    refused(&model("p1d", &[1.0, 2.0, 0.5]), &plan, "none called 'v', but: u");
    let pid = TuningPlan { controller: Some(Controller::Pid), ..TuningPlan::default() };
    let none = tune(&model("p1d", &[1.0, 2.0, 0.5]), &pid).unwrap();
    assert!(none.settings.is_empty() && none.warnings.len() == 1);
}
