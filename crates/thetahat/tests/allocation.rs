//! Iterations of a search take no memory: more of them allocate no more. Samples of a tracker take none at all.

use std::borrow::Cow;
use std::ops::ControlFlow;

use allocation_counter::measure;
use thetahat::data::{Channel, Log, Record, Recording, Rows, Source, Times};
use thetahat::estimate::{Initial, Method, Procedure, estimate};
use thetahat::fit::FitDraft;
use thetahat::inspect::{InspectionPlan, inspect};
use thetahat::model::Orders;
use thetahat::optimize::{Algorithm, Search};
use thetahat::plan::{FitOptions, Fitted};
use thetahat::respond::{Horizon, InitialCondition};
use thetahat::track::{TrackMethod, TrackPlan, Tracker};
use thetahat_numerics::noise::Noise;

#[test]
fn iterations_take_no_memory() {
    let (u, e) = (Noise(1).take(2000), Noise(2).take(2000));
    let mut y = vec![0.0; 2000];
    for t in 2..2000 {
        y[t] = 1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1] + e[t] + 0.6 * e[t - 1];
    }
    let record = Record::new(&y, vec![&u]).unwrap();
    for orders in [
        Orders::armax(2, &[1], 1, &[1]).unwrap(),
        Orders::oe(&[2], &[2], &[1]).unwrap(),
        Orders::bj(&[2], 1, 2, &[2], &[1]).unwrap(),
        Orders::new(1, &[2], 1, 1, &[1], &[1]).unwrap(),
    ] {
        for algorithm in
            [Algorithm::LevenbergMarquardt, Algorithm::GaussNewton, Algorithm::Newton, Algorithm::Gradient]
        {
            // Far from the minimum, and a tolerance that is never met.
            let fit = |max_iterations| {
                let initial = vec![0.1; orders.parameters()];
                let search = Search {
                    algorithm,
                    max_iterations,
                    tolerance: 1e-300,
                    initial_parameters: Some(initial),
                    ..Search::default()
                };
                let mut iterations = 0;
                let counted = measure(|| {
                    let method = Method::PredictionError(search);
                    let found = estimate(&record, &orders, &method, Initial::Zero).unwrap();
                    let Procedure::PredictionError(outcome) = found.procedure() else { panic!("a search") };
                    iterations = outcome.iterations;
                });
                (iterations, counted.count_total)
            };
            let ((few, before), (many, after)) = (fit(1), fit(4));
            assert!(many > few, "{algorithm:?} {:?}", orders.structure());
            assert_eq!(after, before, "{algorithm:?} {:?}", orders.structure());
        }
    }
}

#[test]
fn samples_of_a_tracker_take_no_memory() {
    let (u, e) = (Noise(3).take(2000), Noise(4).take(2000));
    for (nc, method, forgetting) in [
        (0, TrackMethod::Rls, "0.99"),
        (0, TrackMethod::Rls, "selective:0.99"),
        (0, TrackMethod::Rls, "random-walk:1e-4"),
        (2, TrackMethod::Els, "none"),
        (2, TrackMethod::Rpem, "0.99"),
    ] {
        let plan = TrackPlan {
            method,
            forgetting: forgetting.parse().unwrap(),
            constant: true,
            alarm_interval: Some(1000.0),
            ..TrackPlan::default()
        };
        let mut tracker = Tracker::new(&Orders::armax(2, &[2], nc, &[3]).unwrap(), &plan).unwrap();
        let mut errors = vec![0.0; tracker.names().len()];
        let (mut y, mut work) = (0.0, 0.0);
        let mut run = |from: usize, to: usize| {
            for t in from..to {
                y = 0.8 * y + u[t] + e[t];
                let measured = if t % 97 == 0 { f64::NAN } else { y };
                work += tracker.log_row(measured, &[u[t]]).unwrap().excitation;
                work += tracker.forecast(5).unwrap();
                tracker.write_standard_errors(&mut errors).unwrap();
            }
        };
        run(0, 100);
        assert_eq!(measure(|| run(100, 2000)).count_total, 0, "{forgetting} {method}");
    }
}

#[test]
fn an_inspection_takes_no_more_than_it_says_for_each_value() {
    // Values of which no two are the same take most: each is a level of its own.
    let rows = 200_000;
    let channel = |name: &str, seed, rows| {
        let mut values = Noise(seed).take(rows);
        values.iter_mut().enumerate().for_each(|(row, value)| *value += 1e-9 * row as f64);
        Channel { name: name.into(), values }
    };
    let recording = |rows| Recording {
        channels: vec![channel("u", 1, rows), channel("y", 2, rows)],
        times: Times::Uniform(0.1),
    };
    let (short, recording) = (recording(1000), recording(rows));
    let source = Source {
        file: "log".into(),
        rows: Rows::new(1, rows).unwrap(),
        time: None,
        start: None,
        resampled: None,
    };
    let plan = InspectionPlan { inputs: vec!["u".into()], output: Some("y".into()), resample: None };
    // On one thread, as its memory alone is counted; a second one would look at the other channel.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
    // What matrix products keep for good, however few the values are.
    pool.install(|| inspect(short, &source, &plan)).unwrap();
    let counted = measure(|| {
        pool.install(|| inspect(recording, &source, &plan)).unwrap();
    });
    // Besides the values themselves, which were there before.
    let each = counted.bytes_max as f64 / (2 * rows) as f64;
    assert!(each < 40.0, "{each} bytes for each value");
}

/// What a fit by least squares and its predictions take beside a log of an output and an input: 16 bytes a row.
#[test]
fn a_fit_and_its_predictions_copy_a_long_log_once() {
    const ROWS: usize = 200_000;
    let (u, e) = (Noise(5).take(ROWS), Noise(6).take(ROWS));
    let mut y = vec![0.0; ROWS];
    for t in 1..ROWS {
        y[t] = 3.0 + 0.8 * (y[t - 1] - 3.0) + u[t - 1] + 0.1 * e[t];
    }
    let channel = |name: &str, values: &[f64]| Channel { name: name.to_owned(), values: values.to_vec() };
    let log = Log::new(vec![channel("u", &u), channel("y", &y)], 1.0).unwrap();
    let options: FitOptions = serde_json::from_str(r#"{ "model": "arx", "na": "1", "nb": "1" }"#).unwrap();
    let draft = FitDraft::new(&options, Fitted::Log { several_outputs: false }).unwrap();
    let plan = draft.plan(vec!["u".to_owned()], vec!["y".to_owned()]).unwrap();
    let mut pending = None;
    let fitted = measure(|| {
        pending = Some(plan.begin(Cow::Owned(log.clone()), &[], &|_| ControlFlow::Continue(())).unwrap());
    });
    let data = 16.0 * ROWS as f64;
    let of_data = |bytes: i64| bytes as f64 / data;
    assert!(of_data(fitted.bytes_max as i64) < 1.2, "{} of the data", of_data(fitted.bytes_max as i64));
    let report = pending.unwrap().report().clone();
    let steps = Horizon::Steps { steps: 1 };
    let predicted = measure(|| {
        report.predictions(&log, steps, InitialCondition::Drop).unwrap();
    });
    assert!(
        predicted.bytes_max as usize <= 32 * ROWS + 65_536,
        "{} bytes a row",
        predicted.bytes_max as usize / ROWS
    );
}
