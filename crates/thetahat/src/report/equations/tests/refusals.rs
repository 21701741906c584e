//! What a fit refuses, what it warns of, and what ends it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::Stopped;

use super::models::{Found, joined};
use crate::Error;
use crate::data::{Recording, Times};
use crate::model::GreyBox;
use crate::report::{EquationsPlan, fit_equations};
use crate::tests::{assert_refused, channel};

/// dx/dt = (gain scale u - loss x + push)/1, y = x, with the lines of some parameters.
fn tank(parameters: &str) -> GreyBox {
    let text = format!(
        "sample_time = 1
         [states]
         level = {{ start = 0, sd = 0.1 }}
         hidden = {{ start = 0, sd = 0.1 }}
         [inputs]
         flow = \"u\"
         [parameters]
         {parameters}
         [next]
         level = \"level + dt * (gain * scale * flow - loss * level)\"
         hidden = \"0.5 * hidden + aside * flow\"
         [outputs]
         y = \"level\"
         [noise]
         process = {{ level = 0.01 }}
         measurement = {{ y = 0.05 }}"
    );
    GreyBox::from_toml(&text).unwrap()
}

/// With gain scale = 0.8 and a loss.
fn log(loss: f64) -> Recording {
    let mut noise = Noise(3);
    let (mut level, mut flow) = (0.05, 0.0);
    let (mut u, mut y) = (Vec::new(), Vec::new());
    for row in 0..300 {
        if row % 15 == 0 {
            flow = noise.uniform();
        }
        u.push(flow);
        y.push(level + 0.05 * 3.0_f64.sqrt() * noise.uniform());
        level += 0.8 * flow - loss * level + 0.01 * 3.0_f64.sqrt() * noise.uniform();
    }
    Recording { channels: vec![channel("u", u), channel("y", y)], times: Times::Uniform(1.0) }
}

fn fitted(model: &GreyBox, log: Recording) -> Result<Found, Error> {
    super::models::fitted(model, &[log])
}

const UNKNOWN: &str = "sd = 1, unknown = true";

#[test]
fn bounds_are_kept() {
    // The log was made with a negative loss, and with one beyond the upper bound.
    for (truth, bounds, bound) in [
        (-0.02, "min = 0", 0.0),
        (0.3, "max = 0.2", 0.2),
        (0.3, "min = 0, max = 0.2", 0.2),
        (-0.02, "min = 0, max = 0.2", 0.0),
    ] {
        let model = tank(&format!(
            "gain = {{ start = 0.5, {UNKNOWN} }}\nscale = 1\naside = 0\nloss = {{ start = 0.1, {UNKNOWN}, {bounds} }}"
        ));
        let report = fitted(&model, log(truth)).unwrap();
        let (loss, _) = report.parameter(1);
        let known = &report.outcome.unknown[1];
        assert_ne!(loss, bound);
        assert!(loss > known.min.unwrap_or(f64::MIN) && loss < known.max.unwrap_or(f64::MAX));
        assert!((loss - bound).abs() < 1e-3, "{bounds} {loss}");
        assert_eq!(report.outcome.search.stopped, Stopped::Converged, "{bounds}");
        assert!(report.outcome.search.iterations < 40, "{bounds} {}", report.outcome.search.iterations);
        let words = format!("'loss' is within its standard error of its bound {bound}");
        assert!(
            report.report.warnings.iter().any(|warning| warning.starts_with(&words)),
            "{:?}",
            report.report.warnings
        );
        assert!(report.model.with_values().is_ok());
    }
    // Inside, a bound changes nothing.
    let value = |bounds: &str| {
        let model =
            tank(&format!("gain = 0.8\nscale = 1\naside = 0\nloss = {{ start = 0.15, {UNKNOWN}{bounds} }}"));
        let report = fitted(&model, log(0.1)).unwrap();
        report.parameter(0)
    };
    let free = value("");
    for bounds in [", min = 0", ", max = 1", ", min = 0, max = 1"] {
        let (value, error) = value(bounds);
        // Both stop within a small part of a standard error of the minimum.
        assert!((value - free.0).abs() < 0.01 * free.1 && (error / free.1 - 1.0).abs() < 0.01, "{bounds}");
    }
}

#[test]
fn what_the_log_leaves_open_is_named() {
    let open = |parameters: &str| match fitted(&tank(parameters), log(0.1)) {
        Err(Error::Undetermined { parameters, message }) => (parameters, message),
        other => panic!("{parameters}: {other:?}"),
    };
    let (names, message) = open(&format!(
        "gain = {{ start = 0.5, {UNKNOWN} }}\nscale = {{ start = 2, {UNKNOWN} }}\naside = 0\nloss = {{ start = 0.2, {UNKNOWN} }}"
    ));
    assert_eq!(names, ["gain", "scale"]);
    assert!(message.starts_with("the data cannot tell 'gain' and 'scale' apart"), "{message}");

    let (names, message) = open(&format!(
        "gain = {{ start = 0.5, {UNKNOWN} }}\nscale = 1\naside = {{ start = 1, {UNKNOWN} }}\nloss = {{ start = 0.2, {UNKNOWN} }}"
    ));
    assert_eq!(names, ["aside"]);
    assert!(message.starts_with("nothing that was measured depends on 'aside'"), "{message}");

    // Nothing moves: the input is zero, and the level starts at nothing.
    let mut still = log(0.1);
    still.channels[0].values.fill(0.0);
    let model = tank(&format!("gain = {{ start = 0.5, {UNKNOWN} }}\nscale = 1\naside = 0\nloss = 0.1"));
    let Err(Error::Undetermined { parameters, .. }) = fitted(&model, still) else { panic!("gain") };
    assert_eq!(parameters, ["gain"]);
}

#[test]
fn refusals_say_what_to_do() {
    let known = "gain = 0.8\nscale = 1\naside = 0\nloss = 0.1";
    let open = format!("gain = {{ start = 0.5, {UNKNOWN} }}\nscale = 1\naside = 0\nloss = 0.1");
    let model = tank(&open);
    let says = |result: Result<Found, Error>, words: &str| {
        assert_refused(result, words);
    };
    says(fitted(&tank(known), log(0.1)), "none of its parameters is unknown");
    let mut renamed = log(0.1);
    renamed.channels[0].name = "U".into();
    says(fitted(&model, renamed), "the model needs channel 'u', the log has: U, y");
    let clock = |times| Recording { times: Times::Measured(times), ..log(0.1) };
    let mut times: Vec<f64> = (0..300).map(f64::from).collect();
    times[8] = times[7];
    says(fitted(&model, clock(times.clone())), "time repeats (from 7 s to 7 s)");
    times[8] = f64::NAN;
    says(fitted(&model, clock(times)), "the time is not a finite number");
    says(fitted(&model, clock(vec![0.0, 1.0])), "2 time stamps for 300 rows");
    says(
        fitted(&model, Recording { times: Times::Uniform(0.0), ..log(0.1) }),
        "not a positive number of seconds",
    );
    let mut empty = log(0.1);
    empty.channels[1].values.fill(f64::NAN);
    says(fitted(&model, empty), "need more than 0 measured values");
    let mut infinite = log(0.1);
    infinite.channels[1].values[4] = f64::INFINITY;
    says(fitted(&model, infinite), "infinite in row 5");
    // With this gain the level leaves the range of numbers in a few rows.
    let wild = tank(&format!("gain = 1\nscale = 1\naside = 0\nloss = {{ start = 1e80, {UNKNOWN} }}"));
    let own_start_only = EquationsPlan { own_start_only: true, ..EquationsPlan::default() };
    let alone = fit_equations(&wild, &joined(&[log(0.1)]).unwrap(), &[], &own_start_only, &|_| {
        ControlFlow::Continue(())
    });
    assert_refused(alone, "the filter leaves the range of numbers in row");
    // Around it there is no better one.
    says(fitted(&wild, log(0.1)), "the filter leaves the range of numbers in row");
    let far = tank(&format!("gain = 1\nscale = 1\naside = 0\nloss = {{ start = 2, {UNKNOWN} }}"));
    assert!((fitted(&far, log(0.1)).unwrap().parameter(0).0 - 0.1).abs() < 0.05);
}

#[test]
fn a_trial_that_overflows_is_a_step_refused() {
    // From here the first step leads to where the filter does not work.
    let text = "sample_time = 1
        [states]
        x = { start = 1, sd = 0.1 }
        [inputs]
        [parameters]
        a = { start = 3, sd = 1, unknown = true }
        [next]
        x = \"sqrt(a) * x + 0 * dt\"
        [outputs]
        y = \"x\"
        [noise]
        measurement = { y = 0.01 }";
    let model = GreyBox::from_toml(text).unwrap();
    let y: Vec<f64> = (0..30).map(|row| 0.5_f64.powi(row)).collect();
    let channels = vec![channel("y", y)];
    let report = fitted(&model, Recording { channels, times: Times::Uniform(1.0) }).unwrap();
    assert!((report.parameter(0).0 - 0.25).abs() < 1e-3, "{}", report.parameter(0).0);
}

#[test]
fn whoever_watches_may_end_it() {
    let open = format!(
        "gain = {{ start = 5, {UNKNOWN} }}\nscale = 1\naside = 0\nloss = {{ start = 0.9, {UNKNOWN}, min = 0, max = 1 }}"
    );
    let (model, seen) = (tank(&open), AtomicUsize::new(0));
    let one = joined(&[log(0.1)]).unwrap();
    let monitored = fit_equations(&model, &one, &[], &EquationsPlan::default(), &|progress| {
        assert_eq!(progress.iteration, seen.fetch_add(1, Ordering::Relaxed));
        assert!(progress.cost.is_finite());
        if progress.iteration < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    assert_eq!(monitored, Err(Error::Interrupted));
    assert_eq!(seen.into_inner(), 3);
    assert!(fitted(&model, log(0.1)).unwrap().outcome.search.iterations > 2);
}

#[test]
fn a_careful_reader_is_told() {
    let open = format!("gain = {{ start = 0.5, {UNKNOWN}, walk = 0.1 }}\nscale = 1\naside = 0\nloss = 0.1");
    let mut log = log(0.1);
    log.channels[0].values[30..34].fill(f64::NAN);
    log.channels[1].values.iter_mut().for_each(|value| *value *= 3.0);
    let report = fitted(&tank(&open), log).unwrap();
    for words in ["channel 'u' misses 4 of 300 values", "innovations are larger", "'gain': taken as constant"]
    {
        assert!(
            report.report.warnings.iter().any(|warning| warning.starts_with(words)),
            "{words} {:?}",
            report.report.warnings
        );
    }
    let (_, error) = report.parameter(0);
    let factor = error / report.outcome.unknown[0].nominal_standard_error;
    let nis = report.outcome.nis.unwrap();
    assert_eq!(report.outcome.covariance_factor, nis.mean / nis.expected);
    assert!((factor * factor / report.outcome.covariance_factor - 1.0).abs() < 1e-12);
    let covariance = report.model.covariance.as_ref().unwrap();
    assert!((covariance[0][0].sqrt() / error - 1.0).abs() < 1e-12);
}

#[test]
fn a_parameter_that_runs_away_is_undetermined() {
    // The plant answers the other way: the heavier the mass, the better.
    let mut noise = Noise(5);
    let (mut x, mut u, mut y) = (0.0, Vec::new(), Vec::new());
    for _ in 0..200 {
        u.push(noise.uniform());
        y.push(x + 0.1 * noise.uniform());
        x = 0.5 * x - u[u.len() - 1];
    }
    let log = Recording { channels: vec![channel("u", u), channel("y", y)], times: Times::Uniform(1.0) };
    let model = GreyBox::from_toml(
        "sample_time = 1
         [states]
         x = { start = 0, sd = 1 }
         [inputs]
         force = \"u\"
         [parameters]
         mass = { start = 1, sd = 10, unknown = true, min = 0 }
         [next]
         x = \"0.5 * x + force / mass\"
         [outputs]
         y = \"x\"
         [noise]
         measurement = { y = 0.1 }",
    )
    .unwrap();
    let Err(Error::Undetermined { parameters, message }) = fitted(&model, log) else { panic!() };
    assert_eq!(parameters, ["mass"]);
    assert!(message.contains("the search has drawn it to") && message.contains("bounds"), "{message}");
}
