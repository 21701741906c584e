use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::*;
use crate::Document;
use crate::data::Channel;
use crate::respond::Horizon;

fn plan(structure: BlockStructure, input: &str, output: &str) -> BlocksPlan {
    BlocksPlan {
        inputs: vec![input.to_owned()],
        output: output.to_owned(),
        structure,
        orders: None,
        delays: None,
        curve: None,
        fit: EquationsPlan::default(),
    }
}

/// A log of this repository.
fn read(csv: &str, sample_time: f64) -> Log {
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut channels: Vec<Channel> =
        names.iter().map(|name| Channel { name: (*name).to_owned(), values: Vec::new() }).collect();
    for line in lines {
        for (channel, value) in channels.iter_mut().zip(line.split(',')) {
            channel.values.push(value.parse().unwrap());
        }
    }
    Log::new(channels, sample_time).unwrap()
}

fn fitted(plan: &BlocksPlan, log: &Log) -> Report {
    fit_blocks(log, &[], plan, &|_| ControlFlow::Continue(())).unwrap()
}

/// Values and standard errors by name, with units.
fn found(report: &Report) -> BTreeMap<String, (f64, f64, Option<String>)> {
    let document = serde_json::to_value(report).unwrap();
    let units = document["estimation"]["unknown"].as_array().unwrap();
    let each = report.model.parameters().iter().zip(units);
    each.map(|(own, known)| {
        let unit = known["unit"].as_str().map(str::to_owned);
        (own.name.clone(), (own.value, own.standard_error.unwrap_or(f64::NAN), unit))
    })
    .collect()
}

/// The values of a curve at its knots are those of a function, within errors of estimates and of straight lines.
#[track_caller]
fn curve_is(report: &Report, sagitta: f64, function: impl Fn(f64) -> f64) {
    let mut counted = 0;
    for (name, (value, error, unit)) in found(report) {
        let Some(at) = unit.as_deref().and_then(|unit| unit.strip_prefix("at ")) else { continue };
        let expected = function(at.parse().unwrap());
        assert!(
            (value - expected).abs() < 4.0 * error + sagitta,
            "{name} at {at}: {value} +- {error}, not {expected}"
        );
        counted += 1;
    }
    assert!(counted > 6);
}

#[track_caller]
fn is(report: &Report, name: &str, expected: f64, rounding: f64) {
    let (value, error, _) = found(report)[name];
    assert!((value - expected).abs() < 4.0 * error + rounding, "{name}: {value} +- {error}, not {expected}");
}

/// Poles of lags of so many samples each: -(a + b) and a b.
fn lags(one: f64, other: f64) -> [f64; 2] {
    let (a, b) = ((-1.0 / one).exp(), (-1.0 / other).exp());
    [-(a + b), a * b]
}

#[test]
fn a_valve_comes_back() {
    let log = read(include_str!("../../../../../tests/data/blocks/valve.csv"), 1.0);
    let report = fitted(&plan(BlockStructure::Hammerstein, "valve", "flow"), &log);
    let [f1, f2] = lags(20.0, 5.0);
    is(&report, "f1", f1, 2e-3);
    is(&report, "f2", f2, 2e-3);
    // A line under a root, the steepest of which begins between two knots.
    curve_is(&report, 1.0, |stroke| 30.0 * ((stroke - 20.0).max(0.0) / 80.0).sqrt());
    let document = report.to_json().unwrap();
    assert!(document.contains("u(t - 2)"), "{document}");
}

#[test]
fn a_sensor_comes_back() {
    let log = read(include_str!("../../../../../tests/data/blocks/sensor.csv"), 0.1);
    let report = fitted(&plan(BlockStructure::Wiener, "drive", "reading"), &log);
    let [f1, f2] = lags(15.0, 4.0);
    is(&report, "f1", f1, 0.0);
    is(&report, "f2", f2, 0.0);
    curve_is(&report, 0.015, |x| 2.0 * (x / 1.5).tanh());
}

#[test]
fn an_amplifier_between_filters_comes_back() {
    let log = read(include_str!("../../../../../tests/data/blocks/amplifier.csv"), 1e-3);
    let report = fitted(&plan(BlockStructure::WienerHammerstein, "input", "output"), &log);
    is(&report, "f1", -0.7, 0.0);
    is(&report, "p1", -1.3, 0.0);
    is(&report, "p2", 0.55, 0.0);
    curve_is(&report, 5e-3, |z| if z < 0.5 { z } else { 0.5 + 0.1 * (z - 0.5) });
    // The noise is all that is left.
    is(&report, "measurement.output", 0.005, 1e-5);
}

#[test]
fn a_spring_that_stiffens_follows_its_log() {
    let log = read(include_str!("../../../../../tests/data/blocks/spring.csv"), 0.02);
    let report = fitted(&plan(BlockStructure::Feedback, "force", "position"), &log);
    let free = report.fit.iter().find(|fit| fit.horizon == Horizon::FreeRun).unwrap();
    // 99.8 % is what the noise leaves; the curve acts on samples, the spring all the time.
    assert!(free.percent.unwrap() > 99.7, "{free:?}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let log = read(include_str!("../../../../../tests/data/blocks/sensor.csv"), 0.1);
    let own = plan(BlockStructure::Wiener, "drive", "reading");
    for (plan, said) in [
        (BlocksPlan { inputs: Vec::new(), ..own.clone() }, "has an input at least"),
        (BlocksPlan { inputs: vec!["reading".into()], ..own.clone() }, "it is an input too"),
        (BlocksPlan { orders: Some((0, 2)), ..own.clone() }, "from 1 to 10"),
        (BlocksPlan { orders: Some((3, 2)), ..own.clone() }, "from 1 to 10"),
        (
            BlocksPlan { structure: BlockStructure::WienerHammerstein, orders: Some((1, 1)), ..own.clone() },
            "one for each linear system",
        ),
        (BlocksPlan { delays: Some(vec![1, 2]), ..own.clone() }, "2 numbers for 1 inputs"),
        (BlocksPlan { delays: Some(vec![5000]), ..own.clone() }, "1000 samples at most"),
        (BlocksPlan { curve: Some(CurveForm::Lines(Some(2))), ..own.clone() }, "give 3 to 100"),
        (BlocksPlan { curve: Some(CurveForm::Polynomial(1)), ..own.clone() }, "2 to 15"),
        (
            BlocksPlan {
                structure: BlockStructure::Feedback,
                curve: Some(CurveForm::Lines(None)),
                ..own.clone()
            },
            "a feedback takes poly",
        ),
        (BlocksPlan { inputs: vec!["driven".into()], ..own.clone() }, "driven"),
    ] {
        let refused = fit_blocks(&log, &[], &plan, &|_| ControlFlow::Continue(())).unwrap_err().to_string();
        assert!(refused.contains(said), "{said}: {refused}");
    }
}

#[test]
fn a_log_may_miss_rows_and_be_several() {
    let log = read(include_str!("../../../../../tests/data/blocks/sensor.csv"), 0.1);
    let part = |from: usize, to: usize| {
        let cut = |channel: &Channel| Channel {
            name: channel.name.clone(),
            values: channel.values[from..to].to_vec(),
        };
        let mut channels: Vec<Channel> = log.channels().iter().map(cut).collect();
        channels.last_mut().unwrap().values[100..110].fill(f64::NAN);
        Log::new(channels, 0.1).unwrap()
    };
    let joined = Log::join(vec![part(0, 1400), part(1500, 3000)]).unwrap();
    let report = fitted(&plan(BlockStructure::Wiener, "drive", "reading"), &joined);
    let [f1, f2] = lags(15.0, 4.0);
    is(&report, "f1", f1, 0.0);
    is(&report, "f2", f2, 0.0);
}
