//! What must hold whatever the data: on logs that the tests make themselves.

use serde_json::Value;

use crate::harness::{Answer, Folder, Run, distance, names, number, numbers, parameters};
use crate::signals::{Experiment, Random, csv, response};

/// The least-squares solution of rows [phi, y], by the normal equations, and the inverse of their matrix.
fn least_squares(rows: &[Vec<f64>]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let p = rows[0].len() - 1;
    let product = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
    // [Phi'Phi | Phi'y | I], reduced to [I | theta | inverse].
    let mut matrix: Vec<Vec<f64>> = (0..p)
        .map(|i| {
            let products = (0..=p).map(|j| product(i, j));
            products.chain((0..p).map(|j| f64::from(u8::from(i == j)))).collect()
        })
        .collect();
    for pivot in 0..p {
        let scale = matrix[pivot][pivot];
        matrix[pivot].iter_mut().for_each(|value| *value /= scale);
        let reduced = matrix[pivot].clone();
        for row in (0..p).filter(|row| *row != pivot) {
            let factor = matrix[row][pivot];
            matrix[row].iter_mut().zip(&reduced).for_each(|(value, reduced)| *value -= factor * reduced);
        }
    }
    (matrix.iter().map(|row| row[p]).collect(), matrix.iter().map(|row| row[p + 1..].to_vec()).collect())
}

/// The rows [phi, y] of y(t) = -a1 y(t-1) - a2 y(t-2) + b1 u(t-1) + b2 u(t-2), from sample `first` on.
fn second_order(u: &[f64], y: &[f64], first: usize) -> Vec<Vec<f64>> {
    let at = |signal: &[f64], t: usize, lag: usize| if lag > t { 0.0 } else { signal[t - lag] };
    (first..y.len()).map(|t| vec![-at(y, t, 1), -at(y, t, 2), at(u, t, 1), at(u, t, 2), y[t]]).collect()
}

fn without_mean(signal: &[f64]) -> Vec<f64> {
    let mean = signal.iter().sum::<f64>() / signal.len() as f64;
    signal.iter().map(|value| value - mean).collect()
}

#[test]
fn noise_free_data_give_the_polynomials_back() {
    let mut random = Random::new(1);
    let (u, silence) = (random.signal(400), [0.0; 400]);
    let (a, b) = ([1.0, -1.5, 0.7], [0.0, 0.0, 0.0, 1.0, 0.5]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &response(&a, &[(&b, &u)], &silence))]));
    let report = folder.fit("log.csv --detrend none --na 2 --nb 2 --nk 3");
    assert!(distance(&numbers(&report["model"]["a"]), &a) < 1e-10);
    assert!(distance(&numbers(&report["model"]["b"][0]), &b) < 1e-10);
    assert!(number(&report, "/estimation/mse") < 1e-24);
}

#[test]
fn noise_free_data_with_two_inputs_give_the_polynomials_back() {
    let mut random = Random::new(2);
    let (u1, u2, silence) = (random.signal(300), random.signal(300), [0.0; 300]);
    // The first input acts at once, the second after four samples.
    let (a, b1, b2) = ([1.0, -0.9], [2.0, -1.0, 0.5], [0.0, 0.0, 0.0, 0.0, 3.0]);
    let y = response(&a, &[(&b1, &u1), (&b2, &u2)], &silence);
    let folder = Folder::with_log(csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    let report = folder.fit("log.csv --detrend none --na 1 --nb 3,1 --nk 0,4");
    assert_eq!(names(&report), ["a1", "b1_0", "b1_1", "b1_2", "b2_4"]);
    assert!(distance(&numbers(&report["model"]["a"]), &a) < 1e-10);
    assert!(distance(&numbers(&report["model"]["b"][0]), &b1) < 1e-10);
    assert!(distance(&numbers(&report["model"]["b"][1]), &b2) < 1e-10);
}

#[test]
fn noise_free_data_around_an_operating_point_give_the_polynomials_back() {
    let mut random = Random::new(3);
    let (u, silence) = (random.signal(300), [0.0; 300]);
    let (a, b) = ([1.0, -0.8], [0.0, 2.0]);
    let y: Vec<f64> = response(&a, &[(&b, &u)], &silence).iter().map(|y| y + 300.0).collect();
    let u: Vec<f64> = u.iter().map(|u| u - 40.0).collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    // The first sample of y has no past yet: it is the operating point itself.
    for offsets in ["--offset u=-40 --offset y=300", "--offset u=-40 --detrend start:1"] {
        let report = folder.fit(&format!("log.csv {offsets} --na 1 --nb 1"));
        assert!(distance(&parameters(&report), &[-0.8, 2.0]) < 1e-10, "{offsets}");
    }
}

#[test]
fn a_growing_signal_without_noise_gives_its_polynomial_back() {
    // y(t) = 1.1 y(t-1): an AR model of an unstable system.
    let y: Vec<f64> = (0..300).map(|t| 1.1_f64.powi(t)).collect();
    let report = Folder::with_log(csv(&[("y", &y)])).fit("log.csv --detrend none --na 1 --nb 0");
    assert!(distance(&parameters(&report), &[-1.1]) < 1e-10);
    assert_eq!(report["model"]["stable"], false);
}

#[test]
fn the_estimate_is_the_least_squares_solution() {
    let experiment = Experiment::new(500);
    let report = Folder::with_log(experiment.csv()).fit("log.csv --na 2 --nb 2");
    let (u, y) = (without_mean(&experiment.u), without_mean(&experiment.y));
    let rows = second_order(&u, &y, 2);
    let (theta, inverse) = least_squares(&rows);
    assert!(distance(&parameters(&report), &theta) < 1e-10);
    assert!(distance(&theta, &[-1.2, 0.5, 1.0, 0.4]) < 0.05);

    let error = |row: &Vec<f64>| row[4] - row.iter().zip(&theta).map(|(phi, t)| phi * t).sum::<f64>();
    let squares: f64 = rows.iter().map(|row| error(row).powi(2)).sum();
    let variance = squares / (498.0 - 4.0);
    assert_eq!(number(&report, "/estimation/samples"), 498.0);
    assert!((number(&report, "/estimation/mse") / (squares / 498.0) - 1.0).abs() < 1e-10);
    assert!((number(&report, "/model/noise_covariance/0/0") / variance - 1.0).abs() < 1e-10);
    for (i, row) in inverse.iter().enumerate() {
        let covariance: Vec<f64> = row.iter().map(|value| variance * value).collect();
        assert!(distance(&numbers(&report["model"]["covariance"][i]), &covariance) < 1e-10 * variance);
        let standard_error = number(&report, &format!("/model/parameters/{i}/standard_error"));
        assert!((standard_error / covariance[i].sqrt() - 1.0).abs() < 1e-10);
    }
}

#[test]
fn with_initial_zero_every_sample_counts_and_zeros_stand_before_the_first() {
    let experiment = Experiment::new(60);
    let report = Folder::with_log(experiment.csv()).fit("log.csv --initial zero --na 2 --nb 2");
    let (u, y) = (without_mean(&experiment.u), without_mean(&experiment.y));
    let (theta, _) = least_squares(&second_order(&u, &y, 0));
    assert!(distance(&parameters(&report), &theta) < 1e-10);
    assert_eq!(number(&report, "/estimation/samples"), 60.0);
}

#[test]
fn a_log_in_two_pieces_gives_the_fit_of_both() {
    let experiment = Experiment::new(400);
    let piece = |rows: std::ops::Range<usize>| (&experiment.u[rows.clone()], &experiment.y[rows]);
    // The pieces share two rows, so that each regressor of the whole log is in one of them.
    let (first, second) = (piece(0..251), piece(249..400));
    let joined = |first: &[f64], second: &[f64]| [first, &[f64::NAN], second].concat();
    let folder = Folder::with_log(experiment.csv());
    folder.write("pieces.csv", csv(&[("u", &joined(first.0, second.0)), ("y", &joined(first.1, second.1))]));
    let offsets = "--offset u=5 --offset y=20 --na 2 --nb 2";
    let whole = folder.fit(&format!("log.csv {offsets}"));
    let pieces = folder.fit(&format!("pieces.csv {offsets}"));
    assert_eq!(pieces["data"]["segments"], serde_json::json!([[1, 251], [253, 403]]));
    assert_eq!(whole["estimation"]["samples"], pieces["estimation"]["samples"]);
    assert!(distance(&parameters(&whole), &parameters(&pieces)) < 1e-12);
    let mse = |report: &Value| number(report, "/estimation/mse");
    assert!((mse(&whole) / mse(&pieces) - 1.0).abs() < 1e-12);
}

#[test]
fn no_regressor_reaches_across_a_gap() {
    let experiment = Experiment::new(120);
    let mut y = experiment.y.clone();
    (y[50], y[51]) = (f64::NAN, f64::NAN);
    let folder = Folder::with_log(csv(&[("u", &experiment.u), ("y", &y)]));
    let report = folder.fit("log.csv --detrend none --na 2 --nb 2");
    let mut rows = second_order(&experiment.u[..50], &experiment.y[..50], 2);
    rows.extend(second_order(&experiment.u[52..], &experiment.y[52..], 2));
    assert!(distance(&parameters(&report), &least_squares(&rows).0) < 1e-9);
    assert_eq!(number(&report, "/estimation/samples"), 114.0);
    assert_eq!(number(&report, "/data/missing/1/rows"), 2.0);
}

#[test]
fn predict_and_simulate_give_the_figures_of_the_report() {
    let folder = Folder::with_log(Experiment::new(500).csv());
    for options in [
        "--estimate 1..300 --validate 301..500",
        "--estimate 101..300 --validate 1..90,320..500 --nk 2",
        "--estimate 201..500 --validate 1..200 --initial zero",
        "--estimate 1..250 --validate 251..500 --detrend linear --sample-time 0.5",
        "--estimate 1..50,61..400 --validate 401..500 --detrend start:20 --nk 0",
    ] {
        let report = folder.fit(&format!("log.csv {options} --na 2 --nb 2 --report model.json"));
        let entries = report["fit"].as_array().unwrap();
        assert_eq!(entries.len(), 4);
        for entry in entries {
            let initial = entry["initial"].as_str().unwrap();
            let mut lines = if entry["horizon"]["kind"] == "steps" {
                vec![format!("predict model.json log.csv --horizon 1 --initial {initial}")]
            } else {
                ["simulate model.json log.csv", "predict model.json log.csv --horizon inf"]
                    .map(str::to_owned)
                    .to_vec()
            };
            if initial == "drop" {
                lines.push("predict model.json log.csv".to_owned());
            }
            let ranges = entry["rows"].as_array().unwrap().iter();
            let ranges: Vec<String> = ranges.map(|range| format!("{}..{}", range[0], range[1])).collect();
            for line in lines {
                let run = folder.done(&format!("{line} --rows {}", ranges.join(",")));
                let answer = Answer::read(&run.stdout);
                let (percent, rmse) = (number(entry, "/percent"), number(entry, "/rmse"));
                // The percentage is of what is left without the trend, which the CSV still has.
                let comparable = !options.contains("linear");
                assert!(!comparable || (answer.percent() - percent).abs() < 1e-9, "{line}: {entry}");
                assert!((answer.rmse() - rmse).abs() < 1e-9, "{options}: {line}: {entry}");
                assert_eq!(answer.samples() as f64, number(entry, "/samples"), "{options}: {line}");
                assert!(run.stderr.starts_with(&format!("fit {percent:.3} %, RMSE ")), "{}", run.stderr);
                assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
            }
        }
    }
}

/// The k-step prediction by its definition: the difference equation, run from the outputs up to t - k.
fn by_definition(report: &Value, experiment: &Experiment, horizon: usize) -> Vec<Option<f64>> {
    let a = numbers(&report["model"]["a"]);
    let b = numbers(&report["model"]["b"][0]);
    let (of_u, of_y) =
        (number(report, "/model/inputs/0/offset/level"), number(report, "/model/outputs/0/offset/level"));
    let u: Vec<f64> = experiment.u.iter().map(|u| u - of_u).collect();
    let y: Vec<f64> = experiment.y.iter().map(|y| y - of_y).collect();
    let reach = (a.len() - 1).max(b.len() - 1);
    (0..y.len())
        .map(|t| {
            let known = (t + 1).checked_sub(horizon).filter(|known| *known >= reach)?;
            let mut past = y[..known].to_vec();
            for s in known..=t {
                let outputs: f64 = a.iter().enumerate().skip(1).map(|(lag, a)| -a * past[s - lag]).sum();
                let inputs: f64 = b.iter().enumerate().map(|(lag, b)| b * u[s - lag]).sum();
                past.push(outputs + inputs);
            }
            past.last().map(|value| value + of_y)
        })
        .collect()
}

#[test]
fn a_prediction_some_steps_ahead_equals_its_definition() {
    let experiment = Experiment::new(150);
    let folder = Folder::with_log(experiment.csv());
    for orders in ["--na 2 --nb 2", "--na 1 --nb 3 --nk 0", "--na 3 --nb 1 --nk 4"] {
        let report = folder.fit(&format!("log.csv {orders} --report model.json"));
        for horizon in [1, 2, 3, 10] {
            let run = folder.done(&format!("predict model.json log.csv --horizon {horizon}"));
            let expected = by_definition(&report, &experiment, horizon);
            for (row, (found, expected)) in
                Answer::read(&run.stdout).predicted.iter().zip(expected).enumerate()
            {
                let close = match (found, expected) {
                    (Some(found), Some(expected)) => (found - expected).abs() < 1e-10,
                    (found, expected) => found.is_none() && expected.is_none(),
                };
                assert!(close, "{orders}, horizon {horizon}, row {}: {found:?} {expected:?}", row + 1);
            }
        }
    }
}

#[test]
fn a_long_horizon_from_measured_samples_is_the_free_run_from_them() {
    let folder = Folder::with_log(Experiment::new(40).csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let last = |line: &str| *Answer::read(&folder.done(line).stdout).predicted.last().unwrap();
    // With two measured samples, row 40 is 38 steps ahead.
    let (free, ahead) =
        (last("simulate model.json log.csv --initial drop"), last("predict model.json log.csv --horizon 38"));
    assert!((free.unwrap() - ahead.unwrap()).abs() < 1e-10, "{free:?} {ahead:?}");
}

#[test]
fn the_same_input_gives_the_same_bytes_on_any_number_of_threads() {
    // More than a mebibyte: several pieces to parse, several blocks to sum.
    let log = Experiment::new(8000).csv();
    let (header, rows) = log.split_once('\n').unwrap();
    let folder = Folder::with_log(format!("{header}\n{}", rows.repeat(10)));
    let results = ["1", "2", "4", "4"].map(|threads| {
        let run = |line: &str| {
            let mut command = folder.command(line);
            command.env("RAYON_NUM_THREADS", threads);
            let run = Run::of(command);
            assert_eq!(run.code, 0, "{}", run.stderr);
            run.stdout
        };
        let table = run("fit log.csv --na 2 --nb 2 --validate 1..9000 --report model.json");
        (table, folder.read("model.json"), run("predict model.json log.csv --horizon 3"))
    });
    for other in &results[1..] {
        // Not assert_eq: a difference would print megabytes.
        assert!(*other == results[0]);
    }
}

/// More threads than the address space has stacks for.
#[test]
#[cfg(target_os = "linux")]
fn without_threads_the_results_are_the_same_bytes() {
    let folder = Folder::with_log(Experiment::new(8000).csv());
    let lines = [
        "fit log.csv --na 2 --nb 2 --report model.json",
        "predict model.json log.csv",
        "fit --each log.csv --na 1 --nb 1 --table t.csv",
    ];
    for line in lines {
        let many = folder.done(line);
        let inner = folder.command(line);
        let mut command = std::process::Command::new("sh");
        command.arg("-c").arg("ulimit -v 4000000; exec \"$0\" \"$@\"").arg(inner.get_program());
        command.args(inner.get_args()).current_dir(folder.path("")).env("RAYON_NUM_THREADS", "4000");
        let one = Run::of(command);
        assert_eq!((one.code, one.stdout), (0, many.stdout), "{line}: {}", one.stderr);
    }
}

#[test]
fn predictions_speak_the_logs_own_units() {
    let experiment = Experiment::new(200);
    let shifted = |signal: &[f64], by: f64| -> Vec<f64> { signal.iter().map(|value| value + by).collect() };
    let folder = Folder::with_log(experiment.csv());
    folder.write(
        "shifted.csv",
        csv(&[("u", &shifted(&experiment.u, 1000.0)), ("y", &shifted(&experiment.y, -500.0))]),
    );
    let [plain, moved] = ["log.csv", "shifted.csv"].map(|log| {
        let report = folder.fit(&format!("{log} --na 2 --nb 2 --report model.json"));
        let answers = ["predict", "simulate"].map(|verb| {
            let run = folder.done(&format!("{verb} model.json {log}"));
            Answer::read(&run.stdout).predicted
        });
        (parameters(&report), answers)
    });
    assert!(distance(&plain.0, &moved.0) < 1e-9);
    for (plain, moved) in plain.1.iter().flatten().zip(moved.1.iter().flatten()) {
        match (plain, moved) {
            (Some(plain), Some(moved)) => assert!((plain - 500.0 - moved).abs() < 1e-9, "{plain} {moved}"),
            _ => assert!(plain.is_none() && moved.is_none(), "{plain:?} {moved:?}"),
        }
    }
}

#[test]
fn a_straight_line_under_the_signals_is_taken_away_and_put_back() {
    let experiment = Experiment::new(300);
    let drift: Vec<f64> = experiment.y.iter().enumerate().map(|(t, y)| y + 0.5 * t as f64).collect();
    let folder = Folder::with_log(experiment.csv());
    folder.write("drift.csv", csv(&[("u", &experiment.u), ("y", &drift)]));
    let [plain, drifting] = ["log.csv", "drift.csv"].map(|log| {
        let report = folder.fit(&format!("{log} --detrend linear --sample-time 0.5 --na 2 --nb 2"));
        let slope = number(&report, "/model/outputs/0/offset/slope");
        (parameters(&report), slope)
    });
    assert!(distance(&plain.0, &drifting.0) < 1e-8);
    // Half a unit a row is one a second.
    assert!((drifting.1 - plain.1 - 1.0).abs() < 1e-9);

    folder.done("fit drift.csv --detrend linear --sample-time 0.5 --na 2 --nb 2 --report model.json");
    let answer = Answer::read(&folder.done("predict model.json drift.csv").stdout);
    assert!(answer.percent() > 99.0, "{}", answer.percent());
}
