//! The models in tests/data of the repository, on their logs.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use thetahat_numerics::optimize::Stopped;

use super::models::{Found, experiment, joined};
use crate::data::{Channel, Recording, Source, Times};
use crate::estimate::equations::{Likelihood, LikelihoodObjective};
use crate::filter::{Estimator, StateFilter, StateModel};
use crate::model::{GreyBox, Model};
use crate::report::{EquationsPlan, Report, ValidationPlan, fit_equations, validate};
use crate::respond::{Horizon, NisSummary};
use crate::tests::assert_refused;
use crate::{Document, Error};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data").join(name)
}

fn model(name: &str) -> GreyBox {
    let text = std::fs::read_to_string(data(name).with_extension("toml")).unwrap();
    GreyBox::from_toml(&text).unwrap()
}

/// A log whose first column is the time.
fn log(path: &Path) -> Recording {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',');
    let mut channels: Vec<Channel> =
        names.map(|name| Channel { name: name.into(), values: Vec::new() }).collect();
    for line in lines {
        for (channel, field) in channels.iter_mut().zip(line.split(',')) {
            channel.values.push(field.parse().unwrap());
        }
    }
    let time = channels.remove(0);
    Recording { channels, times: Times::Measured(time.values) }
}

fn fitted(model: &GreyBox, logs: &[Recording]) -> Found {
    super::models::fitted(model, logs).unwrap()
}

/// The p-values of the tests of whiteness on the log of the fit.
fn whiteness(found: &Found, logs: &[Recording]) -> Vec<f64> {
    let log = joined(logs).unwrap();
    let found = validate(&found.report, None, &log, &[], &ValidationPlan::default()).unwrap().validation;
    found.residuals.iter().map(|residuals| residuals.ljung_box.p_value.unwrap()).collect()
}

#[test]
fn logs_lead_back_to_the_truth() {
    let examples: [(_, &[(_, f64)], _); 3] = [
        ("mass_spring_damper", &[("mass", 1.6)], 90.0),
        ("battery", &[("r0", 0.002), ("r1", 0.0015), ("c1", 20_000.0)], 95.0),
        ("dc_motor", &[("torque_constant", 0.05), ("friction", 1e-4)], 90.0),
    ];
    for (name, truth, free_run) in examples {
        let logs = [log(&data(name).with_extension("csv"))];
        let report = fitted(&model(name), &logs);
        assert_eq!(report.outcome.search.stopped, Stopped::Converged);
        assert_eq!(report.model.parameters.len(), truth.len());
        for (index, (name, truth)) in truth.iter().enumerate() {
            assert_eq!(report.model.parameters[index].name, *name);
            let (value, error) = report.parameter(index);
            let away = (value - truth) / error;
            assert!(away.abs() < 3.0, "{name} {value} is {away} standard errors off");
            // A good log says something: 10 % at most.
            assert!(error < 0.1 * truth, "{name} {error}");
        }
        // chi-square of 800 measurements and more: standard deviation below 0.05.
        let nis = report.outcome.nis.unwrap();
        assert!((nis.mean / nis.expected - 1.0).abs() < 0.15, "{name} {nis:?}");
        // Binomial: standard deviation below 0.008.
        assert!((nis.below + nis.above - 0.05).abs() < 0.025, "{name} {nis:?}");
        assert!(whiteness(&report, &logs).iter().all(|p_value| *p_value > 0.001), "{name}");
        for output in &report.model.outputs {
            let fit = report.fit(&output.name, Horizon::FreeRun);
            assert!(fit.percent.unwrap() > free_run, "{name} {fit:?}");
        }
        assert_eq!(report.report.warnings, [""; 0], "{name}");
    }
}

#[test]
fn gradient_of_models_in_equations_is_exact() {
    for name in ["mass_spring_damper", "battery", "dc_motor"] {
        let (model, log) = (model(name), log(&data(name).with_extension("csv")));
        let experiments = [experiment(&model, &log.part("1..200".parse().unwrap()).unwrap())];
        let mut criterion = LikelihoodObjective::new(&model, &experiments);
        let z: Vec<f64> = model.parameters().iter().map(|unknown| unknown.start_variable().0 - 0.2).collect();
        criterion.linearize(&z).unwrap();
        let (gradient, value) = (criterion.slopes().gradient.clone(), criterion.evaluate(&z).unwrap());
        for (index, slope) in gradient.iter().enumerate() {
            let width = 1e-5;
            let mut at = |steps: f64| {
                let mut z = z.clone();
                z[index] += steps * width;
                criterion.evaluate(&z).unwrap()
            };
            // Richardson's extrapolation of two central differences.
            let (near, far) = ((at(1.0) - at(-1.0)) / (2.0 * width), (at(2.0) - at(-2.0)) / (4.0 * width));
            let difference = (4.0 * near - far) / 3.0;
            // 1e-13 V/width of rounding.
            let rounding = 1e-8 * value.abs();
            assert!(
                (slope - difference).abs() < 1e-6 * slope.abs() + rounding,
                "{name} {slope} {difference}"
            );
        }
    }
}

#[test]
fn a_missing_row_is_a_longer_step() {
    let (model, log) = (model("battery"), log(&data("battery.csv")));
    let current = &log.channels[0].values;
    // Every third row in which the current has not changed: leaving it out changes no input.
    let out: Vec<bool> =
        (0..current.len()).map(|row| row > 0 && row % 3 == 0 && current[row] == current[row - 1]).collect();
    assert!(out.iter().filter(|out| **out).count() > 300);
    let mut missing = log.clone();
    let voltage = &mut missing.channels[1].values;
    voltage.iter_mut().zip(&out).filter(|(_, out)| **out).for_each(|(value, _)| *value = f64::NAN);
    let kept = |values: &[f64]| -> Vec<f64> {
        values.iter().zip(&out).filter(|(_, out)| !**out).map(|(value, _)| *value).collect()
    };
    let channel = |channel: &Channel| Channel { name: channel.name.clone(), values: kept(&channel.values) };
    let Times::Measured(time) = &log.times else { panic!("the log has a clock") };
    let shorter = Recording {
        channels: log.channels.iter().map(channel).collect(),
        times: Times::Measured(kept(time)),
    };
    let z: Vec<f64> = model.parameters().iter().map(|unknown| unknown.start_variable().0).collect();
    let likelihood =
        |recording| LikelihoodObjective::new(&model, &[experiment(&model, recording)]).evaluate(&z).unwrap();
    let (whole, short) = (likelihood(&missing), likelihood(&shorter));
    // The same operations.
    assert!((whole - short).abs() < 1e-12 * whole.abs(), "{whole} {short}");
    // And the fit of the irregular log finds the truth.
    let report = fitted(&model, &[shorter]);
    for (index, truth) in [0.002, 0.0015, 20_000.0].into_iter().enumerate() {
        let (value, error) = report.parameter(index);
        assert!((value - truth).abs() < 3.0 * error, "{index} {value} {error}");
    }
}

#[test]
fn two_logs_say_more_than_one() {
    let (model, log) = (model("mass_spring_damper"), log(&data("mass_spring_damper.csv")));
    let halves = ["1..400", "401..800"].map(|rows| log.part(rows.parse().unwrap()).unwrap());
    let error = |logs: &[Recording]| {
        let report = fitted(&model, logs);
        let outcome = &report.outcome;
        assert_eq!(outcome.starts[0].len(), logs.len());
        (outcome.unknown[0].nominal_standard_error, outcome.log_likelihood, report.report.data.rows)
    };
    let first = error(&halves[..1]);
    let second = error(&halves[1..]);
    let both = error(&halves);
    // Information adds up; the estimates differ, and with them the sensitivities.
    let expected = (first.0.powi(-2) + second.0.powi(-2)).sqrt().recip();
    assert!((both.0 / expected - 1.0).abs() < 0.05, "{both:?} {expected}");
    assert!(both.1 <= first.1 + second.1 && both.2 == 800);
}

#[test]
fn reports_go_there_and_back() {
    let model = model("dc_motor");
    let source = Source {
        file: "dc_motor.csv".into(),
        rows: "1..1000".parse().unwrap(),
        time: Some("t".into()),
        start: None,
        resampled: None,
    };
    let recording = log(&data("dc_motor.csv"));
    let log = joined(std::slice::from_ref(&recording)).unwrap();
    let fit = |model: &GreyBox| {
        let plan = EquationsPlan::default();
        fit_equations(model, &log, std::slice::from_ref(&source), &plan, &|_| ControlFlow::Continue(()))
            .unwrap()
    };
    let report = fit(&model);
    let text = report.to_json().unwrap();
    assert_eq!(Report::from_json(&text).unwrap(), report);
    let Model::Equations(stored) = &report.model else { panic!("other kind") };
    assert_eq!(stored.equations, model.text());
    assert!(text.contains("\"torque_constant = 0.001 + 0.999 / (1 + exp(-z))\""));

    // The fitted model has nothing unknown, and the likelihood of the fit.
    let fitted = stored.with_values().unwrap();
    assert_eq!(fitted.unknown().count(), 0);
    let value = LikelihoodObjective::new(&fitted, &[experiment(&fitted, &recording)]).evaluate(&[]).unwrap();
    assert!(text.contains(&format!("\"samples\": {}", report.estimation.samples)));
    let crate::estimate::Procedure::InnovationsLikelihood(outcome) = &report.estimation.procedure else {
        panic!()
    };
    assert!((value + outcome.log_likelihood).abs() < 1e-9 * value.abs());

    // What was known before stays known.
    let half = model.with_parameters(&[("friction", 1e-4)]).unwrap();
    let half = Report::from_json(&fit(&half).to_json().unwrap()).unwrap();
    let Model::Equations(half) = &half.model else { panic!("other kind") };
    assert_eq!(half.parameters.len(), 1);
    assert_eq!(half.with_values().unwrap().unknown().count(), 0);

    for (changed, words) in [
        (text.replace("thetahat.report/1", "thetahat.report/2"), "its schema is 'thetahat.report/2'"),
        (text.replace("\"equations\":", "\"equation\":"), "missing field 'equations'"),
        (text.replace("\"friction\"", "\"torque_constant\""), "model.equations: "),
        ("t,u\n".to_owned(), "not a thetahat report"),
    ] {
        let Err(Error::Report { message }) = Report::from_json(&changed) else { panic!("{words}") };
        assert!(message.contains(words), "{message}");
    }
    let mut lacking = stored.clone();
    lacking.parameters.clear();
    assert_refused(lacking.with_values(), "torque_constant");
}

/// What the filter makes of a log: it estimates unknown parameters with the state.
fn filtered(model: &GreyBox, log: &Recording) -> StateFilter {
    let Times::Measured(time) = &log.times else { panic!("the log has a clock") };
    let mut filter = StateFilter::new(StateModel::from(model.clone()), Estimator::Extended).unwrap();
    let values = |names: &[String], row: usize| -> Vec<f64> {
        let channel = |name| log.channels.iter().find(|channel| channel.name == name).unwrap();
        names.iter().map(|name| channel(name.as_str()).values[row]).collect()
    };
    for row in 0..time.len() {
        let step = (row > 0).then(|| time[row] - time[row - 1]);
        filter.step(step, &values(model.inputs(), row), &values(model.outputs(), row)).unwrap();
    }
    filter
}

#[test]
fn filter_of_the_fitted_model_has_its_likelihood() {
    for name in ["mass_spring_damper", "battery", "dc_motor"] {
        let log = log(&data(name).with_extension("csv"));
        let report = fitted(&model(name), std::slice::from_ref(&log));
        let filter = filtered(&report.model.with_values().unwrap(), &log);
        let summary = filter.summary();
        let difference = summary.log_likelihood.unwrap() - report.outcome.log_likelihood;
        assert!(difference.abs() < 1e-9 * report.outcome.log_likelihood.abs(), "{name} {difference}");
        let (found, expected) = (summary.nis.unwrap(), report.outcome.nis.unwrap());
        assert!((found.mean / expected.mean - 1.0).abs() < 1e-9, "{name}");
        assert_eq!(NisSummary { mean: 0.0, ..found }, NisSummary { mean: 0.0, ..expected }, "{name}");
    }
}

/// The rows around the first pulse: rest, 30 s of 30 A, 40 s of rest.
#[test]
fn resistance_of_a_measured_cell() {
    let (model, log) = (
        model("leaf_cell"),
        log(&data("public/leaf_cell_hppc_25c.csv")).part("375..476".parse().unwrap()).unwrap(),
    );
    let report = fitted(&model, std::slice::from_ref(&log));
    let mut filter = filtered(&model, &log);
    let values = filter.step(Some(1.0), &[0.0], &[f64::NAN]).unwrap().parameters.values.to_vec();
    assert_eq!(report.model.parameters[0].name, "r0");
    for resistance in [report.parameter(0).0, values[0]] {
        // Voltages have three decimals, and the drop is 0.053 V.
        assert!((resistance / 1.77e-3 - 1.0).abs() < 0.05, "{resistance}");
    }
    let output = &report.model.outputs[0].name;
    let percent = |horizon| report.fit(output, horizon).percent.unwrap();
    assert!(percent(Horizon::Steps { steps: 1 }) > 95.0 && percent(Horizon::FreeRun) > 90.0);
    assert!(whiteness(&report, std::slice::from_ref(&log))[0] > 0.01);
    assert_eq!(report.report.warnings, [""; 0]);
}
