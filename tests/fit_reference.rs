//! Values that other programs found in public logs. Some of these logs are in tests/data/public, the others in the
//! folder that THETAHAT_LOGS names; tests of those that are absent skip, and say which.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;
use thetahat::data::Record;
use thetahat::estimate::{Initial, Method, Procedure, estimate};
use thetahat::model::Orders;
use thetahat::optimize::Search;

use crate::harness::{Answer, Folder, number, numbers, parameters};
use crate::signals::csv;

/// Where a public log is: among those that come with the tests, or in the folder that THETAHAT_LOGS names; where it is
/// absent, says so.
pub(crate) fn public_log(name: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/public");
    let more = std::env::var_os("THETAHAT_LOGS").map(PathBuf::from);
    let path =
        [Some(own), more].into_iter().flatten().map(|folder| folder.join(name)).find(|path| path.exists());
    if path.is_none() {
        let thread = std::thread::current();
        let test = thread.name().unwrap_or_default();
        let line = format!("skipped: {name} is in no folder of logs; THETAHAT_LOGS names one ({test})\n");
        // Straight to standard error: the test runner keeps to itself what a test prints that passes.
        let _ = std::io::stderr().write_all(line.as_bytes());
    }
    path
}

/// A folder with a public log in it, called log.csv; `None` if it is absent.
pub(crate) fn folder_with_any(log: &str) -> Option<Folder> {
    Some(Folder::with_log(fs::read(public_log(log)?).expect("the log is readable")))
}

/// A folder with a log of tests/data/public in it, called log.csv.
pub(crate) fn folder_with(log: &str) -> Folder {
    folder_with_any(log).expect("the log comes with the tests")
}

/// The last digit of a number written with this many significant digits.
fn last_digit(value: f64, digits: i32) -> f64 {
    10_f64.powi(value.abs().log10().floor() as i32 + 1 - digits)
}

pub(crate) fn assert_parameters(report: &Value, expected: &[f64]) {
    let found = parameters(report);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
    }
}

pub(crate) fn assert_mse(report: &Value, expected: f64) {
    let found = number(report, "/estimation/mse");
    assert!((found / expected - 1.0).abs() < 1e-7, "{found} {expected}");
}

/// The figures that a report gives for a part and kind of horizon.
pub(crate) fn figures<'a>(report: &'a Value, part: &str, kind: &str) -> &'a Value {
    let fits = report["fit"].as_array().into_iter().flatten();
    fits.into_iter().find(|fit| fit["part"] == part && fit["horizon"]["kind"] == kind).unwrap_or(&Value::Null)
}

/// The options for the orders [na, nb, nc, nd, nf, nk] of a model, with the initial conditions of the reference values.
fn options(model: &str, orders: &[String]) -> String {
    let (has, initial): (&[usize], _) = match model {
        "arx" => (&[0, 1, 5], "drop"),
        "armax" => (&[0, 1, 2, 5], "drop --tolerance 1e-14"),
        "oe" => (&[1, 4, 5], "zero --tolerance 1e-14"),
        _ => (&[1, 2, 3, 4, 5], "zero --tolerance 1e-14"),
    };
    let names = ["--na", "--nb", "--nc", "--nd", "--nf", "--nk"];
    let orders: Vec<String> =
        has.iter().map(|&position| format!("{} {}", names[position], orders[position])).collect();
    format!("--model {model} {} --initial {initial}", orders.join(" "))
}

#[test]
fn every_case_of_the_reference_file_is_reproduced() {
    let cases: Value = serde_json::from_str(include_str!("data/public/reference_cases.json")).unwrap();
    let cases = cases.as_array().unwrap();
    let (mut reproduced, mut bettered, mut absent) = (0, 0, 0);
    for case in cases {
        let Some(file) = public_log(&format!("{}.csv", case["file"].as_str().unwrap())) else {
            absent += 1;
            continue;
        };
        let words = |key: &str| -> Vec<String> {
            let values = case[key].as_array().unwrap().iter();
            values.map(|value| value.as_str().map_or(value.to_string(), str::to_owned)).collect()
        };
        let rows = words("rows");
        let model = case["model"].as_str().unwrap();
        let report = Folder::new().fit(&format!(
            "{} -u {} -y {} --estimate {}..{} {}",
            file.display(),
            words("inputs").join(","),
            case["output"].as_str().unwrap(),
            rows[0],
            rows[1],
            options(model, &words("orders")),
        ));
        let mse = case["mse"].as_f64().unwrap();
        if number(&report, "/estimation/mse") < 0.99 * mse {
            // The reference stopped at a minimum that is not the lowest.
            assert_minimum(case, &fs::read_to_string(&file).unwrap(), &numbers(&case["theta"]), mse);
            bettered += 1;
            continue;
        }
        assert_parameters(&report, &numbers(&case["theta"]));
        // Those of an output-error model count on white residuals in the reference, and here they need not be.
        for (position, expected) in numbers(&case["se"]).into_iter().enumerate().filter(|_| model != "oe") {
            let found = number(&report, &format!("/model/parameters/{position}/standard_error"));
            // The reference has four digits.
            assert!((found - expected).abs() <= 0.5001 * last_digit(expected, 4), "{found} {expected}");
        }
        assert_mse(&report, mse);
        reproduced += 1;
    }
    assert!(reproduced >= 6 && bettered <= 1, "{reproduced} {bettered}");
    assert_eq!(reproduced + bettered + absent, cases.len());
}

/// Parameters of an output-error model have this cost, and no search from them lowers it.
fn assert_minimum(case: &Value, log: &str, theta: &[f64], mse: f64) {
    let mut reader = csv::Reader::from_reader(log.as_bytes());
    let header: Vec<String> =
        reader.headers().expect("the log has a header").iter().map(str::to_owned).collect();
    let rows: Vec<Vec<f64>> = reader.deserialize().map(|row| row.expect("the log holds numbers")).collect();
    let (first, last) = (number(case, "/rows/0") as usize, number(case, "/rows/1") as usize);
    let signal = |name: &Value| -> Vec<f64> {
        let column = header.iter().position(|other| name == other).expect("the log has this column");
        let values: Vec<f64> = rows[first - 1..last].iter().map(|row| row[column]).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| value - mean).collect()
    };
    let y = signal(&case["output"]);
    let inputs: Vec<Vec<f64>> = case["inputs"].as_array().into_iter().flatten().map(signal).collect();
    let order = |position: usize| vec![numbers(&case["orders"])[position] as usize; inputs.len()];
    let orders = Orders::oe(&order(1), &order(4), &order(5)).expect("these are orders");
    // From all starts, to see what comes of this one.
    let search =
        Search { initial_parameters: Some(theta.to_vec()), starts: 6, tolerance: 1e-14, ..Search::default() };
    let record = Record::new(&y, inputs.iter().map(Vec::as_slice).collect()).expect("nothing is missing");
    let method = Method::PredictionError(search);
    let found = estimate(&record, &orders, &method, Initial::Zero).expect("there is a fit");
    let Procedure::PredictionError(outcome) = found.procedure() else { unreachable!("it was a search") };
    let guess = outcome
        .starts
        .iter()
        .find(|start| start.name == "initial-parameters")
        .expect("it is one of the starts");
    for cost in [guess.cost, guess.reached] {
        assert!(cost.is_some_and(|cost| (cost / mse - 1.0).abs() < 1e-7), "{cost:?} {mse}");
    }
}

#[test]
fn hair_dryer_rows_1_to_300() {
    let folder = folder_with("hair_dryer.csv");
    let report = folder.fit("log.csv --sample-time 0.08 --estimate 1..300 --na 2 --nb 2 --nk 3");
    assert_parameters(&report, &[-1.2737387, 0.3935461, 0.0666179, 0.0444819]);
    for (position, expected) in [0.020906, 0.019096, 0.002138, 0.003317].into_iter().enumerate() {
        let found = number(&report, &format!("/model/parameters/{position}/standard_error"));
        assert!((found - expected).abs() < 5.1e-7, "{found} {expected}");
    }
    assert_mse(&report, 0.0016853093);
    let one_step = figures(&report, "estimation", "steps");
    assert_eq!(one_step["horizon"]["steps"], 1);
    assert!((number(one_step, "/percent") - 95.119).abs() < 5.1e-4, "{one_step}");
    assert_eq!(number(&report, "/model/sample_time"), 0.08);
}

#[test]
fn hair_dryer_rows_1_to_500() {
    let folder = folder_with("hair_dryer.csv");
    let report =
        folder.fit("log.csv --sample-time 0.08 --estimate 1..500 --validate 501..1000 --na 2 --nb 2 --nk 3");
    assert_parameters(&report, &[-1.2765388, 0.3967106, 0.0651903, 0.0451792]);
    assert_mse(&report, 0.0016865692);
    assert_eq!(number(&report, "/estimation/samples"), 496.0);
    assert!((number(&report, "/estimation/fpe") - 0.00171399).abs() < 5.1e-9);
    let free_run = figures(&report, "validation", "free-run");
    assert_eq!(free_run["initial"], "estimate");
    assert!((number(free_run, "/percent") - 85.585).abs() < 5.1e-4, "{free_run}");
}

#[test]
fn free_runs_of_the_hair_dryer_from_every_start_and_with_either_means() {
    let folder = folder_with("hair_dryer.csv");
    folder.done("fit log.csv --sample-time 0.08 --estimate 1..500 --na 2 --nb 2 --nk 3 --report model.json");
    for (options, expected) in [
        ("--initial zero", 84.733),
        ("--initial estimate", 85.585),
        ("--initial drop", 85.581),
        ("--initial zero --detrend mean", 89.546),
        ("--initial estimate --detrend mean", 91.221),
        // The measured samples before the rows are the start.
        ("--initial drop --detrend mean", 91.162),
    ] {
        let run = folder.done(&format!("simulate model.json log.csv --rows 501..1000 {options}"));
        let answer = Answer::read(&run.stdout);
        assert_eq!(answer.samples(), 500, "{options}");
        assert!((answer.percent() - expected).abs() < 5.1e-4, "{options}: {}", answer.percent());
        assert!(run.stderr.contains(&format!("fit {expected:.3} %")), "{options}: {}", run.stderr);
    }
}

#[test]
fn the_hair_dryer_has_a_delay_of_three_samples() {
    let folder = folder_with("hair_dryer.csv");
    let means = "--offset u=4.994 --offset y=4.84337228";
    for (first, expected) in [
        (12, [0.008790, 0.002801, 0.001670, 0.007196, 0.009917]),
        (7, [0.008760, 0.002818, 0.001691, 0.007157, 0.009901]),
    ] {
        for (nk, expected) in (1..=5).zip(expected) {
            // All on the same samples: a full regressor reaches back nk + 1 rows, which the log has.
            let report =
                folder.fit(&format!("log.csv --estimate {first}..500 --na 2 --nb 2 --nk {nk} {means}"));
            assert_eq!(number(&report, "/estimation/samples"), f64::from(501 - first));
            let found = number(&report, "/estimation/mse");
            assert!((found - expected).abs() < 5.1e-7, "nk {nk} from {first}: {found} {expected}");
        }
    }
}

#[test]
fn heating_system_exchanger_and_ball_on_a_beam() {
    for (log, theta, mse) in [
        ("heating_system.csv", [-1.5993449, 0.6135762, 0.0321431, 0.2334923], 0.086460568),
        ("exchanger.csv", [-1.1297315, 0.1978665, -0.1320934, -0.3534605], 0.18273098),
        ("ball_beam.csv", [-1.7156714, 0.7161686, -0.6405759, 0.6680734], 4.4838769e-06),
    ] {
        let Some(folder) = folder_with_any(log) else { continue };
        let report = folder.fit("log.csv --na 2 --nb 2 --nk 1");
        assert_parameters(&report, &theta);
        assert_mse(&report, mse);
    }
}

#[test]
fn cascaded_tanks_free_run_and_one_step() {
    let Some(folder) = folder_with_any("cascaded_tanks_est.csv") else { return };
    let Some(validation) = public_log("cascaded_tanks_val.csv") else { return };
    folder.done("fit log.csv --sample-time 4 --estimate 1..700 --na 8 --nb 9 --nk 0 --report model.json");
    let rmse = |line: &str| {
        let run = folder.done(&format!("{line} --rows 9..1024 --initial drop"));
        let answer = Answer::read(&run.stdout);
        assert_eq!(answer.samples(), 1016, "{line}");
        answer.rmse()
    };
    let free_run = rmse(&format!("simulate model.json {}", validation.display()));
    assert!((free_run - 0.685015115).abs() < 1e-8, "{free_run}");
    let one_step = rmse(&format!("predict model.json {} --horizon 1", validation.display()));
    assert!((one_step - 0.053048125).abs() < 1e-8, "{one_step}");
}

#[test]
fn coupled_drives_free_run() {
    let Some(folder) = folder_with_any("ced_uniform.csv") else { return };
    for (input, output, expected) in [("u11", "z11", 0.29147921870), ("u12", "z12", 0.33050455205)] {
        folder.done(&format!(
            "fit log.csv --sample-time 0.02 -u {input} -y {output} --estimate 1..200 --na 10 --nb 10 --nk 0 \
             --report model.json"
        ));
        let run = folder.done("simulate model.json log.csv --rows 411..500 --initial drop");
        let answer = Answer::read(&run.stdout);
        assert_eq!(answer.samples(), 90);
        assert!((answer.rmse() - expected).abs() < 1e-9, "{}", answer.rmse());
    }
}

#[test]
fn z_scored_tanks_give_the_same_predictions() {
    let Some(folder) = folder_with_any("cascaded_tanks_est.csv") else { return };
    let mut columns = [Vec::new(), Vec::new()];
    for row in csv::Reader::from_reader(folder.read("log.csv").as_bytes()).deserialize() {
        let row: [f64; 2] = row.unwrap();
        columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
    }
    let scores = columns.map(|column| {
        let training = &column[..700];
        let mean = training.iter().sum::<f64>() / 700.0;
        let deviation = (training.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 700.0).sqrt();
        let scored: Vec<f64> = column.iter().map(|v| (v - mean) / deviation).collect();
        (scored, mean, deviation)
    });
    folder.write("scored.csv", csv(&[("u", &scores[0].0), ("y", &scores[1].0)]));
    let answer = |log: &str| {
        folder.done(&format!("fit {log} --estimate 1..700 --na 8 --nb 9 --nk 0 --report model.json"));
        let run = folder.done(&format!("simulate model.json {log} --rows 701..1024 --initial drop"));
        Answer::read(&run.stdout).predicted
    };
    for (plain, scored) in answer("log.csv").into_iter().zip(answer("scored.csv")) {
        let (plain, scored) = (plain.unwrap(), scores[1].1 + scores[1].2 * scored.unwrap());
        // The condition number is 9e8: rounding the scores alone moves the predictions by 1e-9.
        assert!((plain - scored).abs() < 1e-7, "{plain} {scored}");
    }
}
