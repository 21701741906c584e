use std::ops::ControlFlow;

use thetahat_numerics::noise::Noise;

use super::*;
use crate::Document;
use crate::respond::process::run;
use crate::respond::{Horizon, InitialCondition};
use crate::tests::{assert_refused, channel};

fn fit(log: &Log, plan: &ProcessPlan) -> Result<Report, Error> {
    fit_process(log, &[], plan, &|_| ControlFlow::Continue(()))
}

fn plan(word: &str) -> ProcessPlan {
    ProcessPlan::new(&["u"], "y", word.parse().unwrap())
}

fn values(report: &Report) -> Vec<f64> {
    report.model.parameters().iter().map(|parameter| parameter.value).collect()
}

/// What a process makes of an input from rest.
fn response(word: &str, parameters: &[f64], times: &[f64], input: &[f64]) -> Vec<f64> {
    let structure: ProcessStructure = word.parse().unwrap();
    let parts = structure.taken_apart(parameters);
    let mut found = Vec::new();
    run(&structure, &parts.shape, parts.dead_time, (times, input), |_, columns| {
        found.push(parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum());
    });
    found
}

/// Steps of several lengths on an irregular clock.
fn experiment(rows: u32) -> (Vec<f64>, Vec<f64>) {
    let clock = (0..rows).map(|k| f64::from(k) * 0.5 + 0.2 * (f64::from(k) * 1.7).sin());
    let level = |k: u32| if k < 6 { 0.0 } else { f64::from(k / 23 * 5 % 3) - 0.7 };
    (clock.collect(), (0..rows).map(level).collect())
}

/// Takes 18 s: thirteen fits on a clock where no two steps are alike, so that none is shared.
#[test]
fn every_structure_is_found_from_its_own_response_on_an_irregular_clock() {
    let cases: [(&str, &[f64]); 13] = [
        ("p1", &[2.0, 3.0]),
        ("p1d", &[2.0, 3.0, 0.83]),
        ("p2d", &[-1.0, 4.0, 0.9, 0.41]),
        ("p3d", &[1.0, 6.0, 2.0, 0.7, 1.33]),
        ("p2u", &[1.0, 2.0, 0.2]),
        ("p2du", &[1.0, 2.0, 0.2, 0.73]),
        ("p3du", &[1.0, 1.5, 0.3, 4.0, 0.73]),
        ("p2dz", &[1.0, 5.0, 1.0, 2.5, 0.71]),
        ("p1di", &[0.5, 2.0, 0.33]),
        ("p0di", &[0.5, 1.13]),
        ("p0i", &[0.5]),
        ("rc1", &[0.1, 1.0, 2.5]),
        ("rc2", &[0.1, 1.0, 0.8, 2.0, 12.0]),
    ];
    let (times, u) = experiment(400);
    for (word, truth) in cases {
        let y: Vec<f64> = response(word, truth, &times, &u).iter().map(|y| 7.0 + y).collect();
        let log = Log::recorded(vec![channel("u", &u), channel("y", &y)], times.clone()).unwrap();
        let report = fit(&log, &plan(word)).unwrap_or_else(|error| panic!("{word}: {error}"));
        for (value, truth) in values(&report).iter().zip(truth) {
            assert!((value / truth - 1.0).abs() < 1e-5, "{word}: {:?}", values(&report));
        }
        assert!((report.estimation.level.unwrap().value - 7.0).abs() < 1e-5, "{word}");
    }
}

/// Between two samples that a jump would pass, the dead time and the zero of one lag stand for each other.
#[test]
fn a_jumping_output_holds_its_dead_time_between_two_samples() {
    let times: Vec<f64> = (0..300).map(|k| 0.5 * f64::from(k)).collect();
    let u: Vec<f64> = (0..300).map(|k| if k < 6 { 0.0 } else { f64::from(k / 23 * 5 % 3) - 0.7 }).collect();
    let y = response("p1dz", &[1.0, 3.0, -0.8, 1.71], &times, &u);
    let log = Log::new(vec![channel("u", &u), channel("y", &y)], 0.5).unwrap();
    let report = fit(&log, &plan("p1dz")).unwrap();
    let found = values(&report);
    assert!((found[0] - 1.0).abs() < 1e-6 && (found[1] - 3.0).abs() < 1e-6, "{found:?}");
    assert!((found[3] - 1.75).abs() < 1e-9, "{found:?}");
    let errors: Vec<f64> = report.model.parameters().iter().map(|own| own.standard_error.unwrap()).collect();
    assert!((errors[3] - 0.5 / 12.0_f64.sqrt()).abs() < 1e-6, "{errors:?}");
    // The zero makes up for it, so far as its error says.
    assert!((found[2] + 0.8).abs() < 2.0 * errors[2] && errors[2] < 0.3, "{found:?} {errors:?}");
    assert!(report.fit[1].percent.unwrap() > 99.999);
}

#[test]
fn an_irregular_clock_says_what_a_fine_one_does() {
    let truth = [2.0, 3.0, 0.83];
    let fine: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
    let u: Vec<f64> = fine
        .iter()
        .map(|t| {
            if *t < 1.0 {
                0.0
            } else if *t < 9.0 {
                1.0
            } else {
                -0.5
            }
        })
        .collect();
    let y = response("p1d", &truth, &fine, &u);
    // Rows by chance, and all at which the input moves.
    let kept: Vec<usize> = (0..2000).filter(|&k| k == 0 || u[k] != u[k - 1] || (k * k) % 97 < 9).collect();
    let of = |values: &[f64]| kept.iter().map(|&k| values[k]).collect::<Vec<_>>();
    let log = Log::recorded(vec![channel("u", of(&u)), channel("y", of(&y))], of(&fine)).unwrap();
    let found = values(&fit(&log, &plan("p1d")).unwrap());
    for (value, truth) in found.iter().zip(truth) {
        assert!((value - truth).abs() < 1e-7, "{found:?}");
    }
}

#[test]
fn inputs_logs_slopes_and_starts_are_told_apart() {
    let (times, u) = experiment(300);
    let second: Vec<f64> = (0..300).map(|k| f64::from(k / 41 * 3 % 4)).collect();
    let (first, other) = ([2.0, 3.0, 0.83], [-0.5, 8.0]);
    let made = |u: &[f64], second: &[f64], level: f64| -> Vec<f64> {
        let (a, b) = (response("p1d", &first, &times, u), response("p1", &other, &times, second));
        times.iter().zip(a.iter().zip(&b)).map(|(t, (a, b))| level + 0.01 * t + a + b).collect()
    };
    let log = |u: &[f64], second: &[f64], y: &[f64]| {
        let channels = vec![channel("u", u), channel("v", second), channel("y", y)];
        Log::recorded(channels, times.clone()).unwrap()
    };
    let plan = ProcessPlan {
        structures: vec!["p1d".parse().unwrap(), "p1".parse().unwrap()],
        trend: true,
        ..ProcessPlan::new(&["u", "v"], "y", "p1".parse().unwrap())
    };
    let one = log(&u, &second, &made(&u, &second, 5.0));
    let report = fit(&one, &plan).unwrap();
    let truth = [2.0, 3.0, 0.83, -0.5, 8.0];
    for (value, truth) in values(&report).iter().zip(truth) {
        assert!((value / truth - 1.0).abs() < 1e-5, "{:?}", values(&report));
    }
    assert_eq!(report.model.parameters()[3].name, "K[v]");
    let offset = report.model.outputs()[0].offset;
    assert!((offset.slope - 0.01).abs() < 1e-7 && (offset.level - 5.0).abs() < 1e-5, "{offset:?}");
    // Free runs give the log back, in its own units.
    let run = report.apply(&one, &[], None, Horizon::FreeRun, InitialCondition::Zero).unwrap();
    let worst = run.outputs[0].predicted.iter().zip(&one.channel("y").unwrap().values);
    assert!(worst.map(|(said, y)| (said - y).abs()).fold(0.0, f64::max) < 1e-5);

    // Two logs, each from a state of its own.
    let mut y = response("p1", &[2.0, 3.0], &times, &u);
    y.iter_mut().zip(&times).for_each(|(y, t)| *y += 1.0 + 4.0 * (-t / 3.0_f64).exp());
    let mut again = response("p1", &[2.0, 3.0], &times, &second);
    again.iter_mut().zip(&times).for_each(|(y, t)| *y += 1.0 - 2.0 * (-t / 3.0_f64).exp());
    let part =
        |u: &[f64], y: &[f64]| Log::recorded(vec![channel("u", u), channel("y", y)], times.clone()).unwrap();
    let joined = Log::join(vec![part(&u, &y), part(&second, &again)]).unwrap();
    let free = ProcessPlan { free_start: Some(true), ..super::tests::plan("p1") };
    let report = fit(&joined, &free).unwrap();
    let found = values(&report);
    assert!((found[0] - 2.0).abs() < 1e-6 && (found[1] - 3.0).abs() < 1e-6, "{found:?}");
    assert!(report.fit.iter().all(|fit| fit.percent.unwrap() > 99.999), "{:?}", report.fit);
}

#[test]
fn missing_values_are_held_or_left_out() {
    let (times, mut u) = experiment(300);
    let mut y = response("p1d", &[2.0, 3.0, 0.83], &times, &u);
    // An input that goes on as it was.
    u[10] = f64::NAN;
    (100..140).for_each(|row| y[row] = f64::NAN);
    let log = Log::recorded(vec![channel("u", &u), channel("y", &y)], times).unwrap();
    let report = fit(&log, &plan("p1d")).unwrap();
    assert!((values(&report)[2] - 0.83).abs() < 1e-6);
    assert_eq!(report.estimation.samples, 260);
    assert!(report.warnings.iter().any(|word| word.starts_with("1 missing values")), "{:?}", report.warnings);
}

#[test]
fn what_cannot_be_found_is_told() {
    let (times, u) = experiment(300);
    let y = response("p1d", &[2.0, 3.0, 0.83], &times, &u);
    let log = |u: &[f64], y: &[f64]| {
        Log::recorded(vec![channel("u", u), channel("y", y)], times[..u.len()].to_vec()).unwrap()
    };
    let refused = |log: &Log, plan: &ProcessPlan, words: &str| {
        assert_refused(fit(log, plan), words);
    };
    refused(&log(&vec![1.0; 300], &y), &plan("p1d"), "never changes");
    refused(&log(&u[..3], &y[..3]), &plan("p1d"), "never changes");
    refused(&log(&u[..8], &y[..8]), &plan("rc3"), "need more than 8 measured values");
    refused(&log(&u, &vec![f64::NAN; 300]), &plan("p1d"), "no value");
    refused(&log(&vec![f64::NAN; 300], &y), &plan("p1d"), "has no value");
    let huge: Vec<f64> = y.iter().map(|y| 1e300 * y).collect();
    refused(&log(&u, &huge), &plan("p1d"), "leave the range of numbers");
    let twice = ProcessPlan { inputs: vec!["y".to_owned()], ..plan("p1") };
    refused(&log(&u, &y), &twice, "comes twice");
    let nowhere = ProcessPlan { offsets: vec![("v".to_owned(), 1.0)], ..plan("p1") };
    refused(&log(&u, &y), &nowhere, "no channel 'v'");
    let many = ProcessPlan { structures: vec!["p1".parse().unwrap(); 3], ..plan("p1") };
    refused(&log(&u, &y), &many, "3 for 1 inputs");
    let line = ProcessPlan { trend: true, offsets: vec![("y".to_owned(), 1.0)], ..plan("p1") };
    refused(&log(&u, &y), &line, "leave one of them out");
    refused(&log(&u, &y), &ProcessPlan::new(&["w"], "y", "p1".parse().unwrap()), "no channel 'w'");
    // Constant, tiny and exact outputs are no errors.
    assert!(fit(&log(&u, &vec![3.0; 300]), &plan("p1")).is_err());
    let tiny: Vec<f64> = y.iter().map(|y| 1e-150 * y).collect();
    assert!((values(&fit(&log(&u, &tiny), &plan("p1d")).unwrap())[1] - 3.0).abs() < 1e-4);
}

#[test]
fn documents_come_back_and_warnings_say_what_a_single_step_hides() {
    let times: Vec<f64> = (0..200).map(f64::from).collect();
    let u: Vec<f64> = (0..200).map(|k| f64::from(u8::from(k >= 20))).collect();
    let mut noise = Noise(5);
    let y: Vec<f64> =
        response("p1d", &[2.0, 20.0, 3.3], &times, &u).iter().map(|y| y + 0.05 * noise.uniform()).collect();
    let log = Log::new(vec![channel("u", &u), channel("y", &y)], 1.0).unwrap();
    let report = fit(&log, &plan("p1d")).unwrap();
    assert!(report.warnings.iter().any(|word| word.contains("one step")), "{:?}", report.warnings);
    let again = Report::from_json(&report.to_json().unwrap()).unwrap();
    assert_eq!(again, report);
    let validation =
        crate::report::validate(&report, None, &log, &[], &Default::default()).unwrap().validation;
    assert_eq!(
        validation.fit.iter().find(|fit| fit.horizon == Horizon::FreeRun).unwrap().rmse,
        report.fit[1].rmse
    );
    assert!(!validation.white_expected);
}
