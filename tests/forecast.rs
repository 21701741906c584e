//! How sure a prediction is, and what comes after the last measured row.

use serde_json::Value;

use crate::fit_reference::folder_with;
use crate::harness::{Answer, Folder, distance, number, numbers};
use crate::signals::{Experiment, Random, csv, response};

const MODELS: [&str; 6] = [
    "--na 2 --nb 2",
    "--model armax --na 2 --nb 2 --nc 1",
    "--model oe --nb 2 --nf 2",
    "--model bj --nb 2 --nf 2 --nc 1 --nd 1",
    "--model general --na 1 --nb 2 --nf 1 --nc 1",
    "--model arma --na 2 --nc 1",
];

fn answer(folder: &Folder, line: &str) -> Answer {
    Answer::read(&folder.done(line).stdout)
}

/// The first coefficients of H = C/(A D).
fn noise_response(report: &Value, count: usize) -> Vec<f64> {
    let model = &report["model"];
    let mut impulse = vec![0.0; count];
    impulse[0] = 1.0;
    let of = |name: &str| numbers(&model[name]);
    let divided = response(&of("d"), &[(&of("c"), &impulse)], &vec![0.0; count]);
    response(&of("a"), &[], &divided)
}

#[test]
fn the_deviation_is_that_of_the_noise_of_so_many_steps_and_of_the_parameters() {
    let folder = Folder::with_log(Experiment::new(300).csv());
    for model in MODELS {
        let report = folder.fit(&format!("log.csv {model} --report model.json"));
        let response = noise_response(&report, 12);
        let variance = number(&report, "/model/noise_covariance/0/0");
        for horizon in [1, 2, 5, 12] {
            let answer = answer(&folder, &format!("predict model.json log.csv --horizon {horizon}"));
            let steps: f64 = response[..horizon].iter().map(|h| h * h).sum();
            let expected = (variance * steps).sqrt();
            let last = answer.deviation[299].unwrap();
            // The parameters of 300 rows add a few per cent.
            assert!((1.0..1.08).contains(&(last / expected)), "{model} {horizon}: {last} {expected}");
            for (predicted, deviation) in answer.predicted.iter().zip(&answer.deviation) {
                assert_eq!(predicted.is_some(), deviation.is_some(), "{model} {horizon}");
            }
        }
    }
}

#[test]
fn nineteen_of_twenty_lie_within_two_deviations() {
    // Nearly normal noise: sums of uniform numbers.
    let mut random = Random::new(52);
    let u = random.signal(2000);
    let e: Vec<f64> = (0..2000).map(|_| (0..6).map(|_| 0.1 * random.uniform()).sum()).collect();
    let y = response(&Experiment::A, &[(&Experiment::B, &u)], &e);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done("fit log.csv --na 2 --nb 2 --estimate 1..1000 --report model.json");
    for horizon in [1, 4] {
        let line = format!("predict model.json log.csv --rows 1001..2000 --horizon {horizon}");
        let answer = answer(&folder, &line);
        let inside = (0..1000).filter(|&row| {
            let (y, x) = (answer.measured[row].unwrap(), answer.predicted[row].unwrap());
            (y - x).abs() < 1.96 * answer.deviation[row].unwrap()
        });
        let share = inside.count() as f64 / 1000.0;
        assert!((0.92..=0.98).contains(&share), "{horizon}: {share}");
    }
}

#[test]
fn a_simulation_has_no_deviation() {
    let folder = Folder::with_log(Experiment::new(100).csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let predicted = folder.done("predict model.json log.csv");
    assert_eq!(predicted.stdout.lines().next(), Some("row,measured,predicted,standard_deviation"));
    let simulated = folder.done("simulate model.json log.csv");
    assert_eq!(simulated.stdout.lines().next(), Some("row,measured,predicted"));
    assert_eq!(folder.done("predict model.json log.csv --horizon inf").stdout, simulated.stdout);
}

#[test]
fn an_output_error_model_predicts_what_it_simulates() {
    let folder = Folder::with_log(Experiment::new(200).csv());
    folder.done("fit log.csv --model oe --nb 2 --nf 2 --report model.json");
    for horizon in [1, 7] {
        let ahead =
            answer(&folder, &format!("predict model.json log.csv --initial zero --horizon {horizon}"));
        let free = answer(&folder, "simulate model.json log.csv --initial zero");
        assert_eq!(ahead.predicted.len(), 200);
        let values = |answer: &Answer| answer.predicted.iter().flatten().copied().collect::<Vec<f64>>();
        assert!(distance(&values(&ahead), &values(&free)) < 1e-10);
    }
}

#[test]
fn a_series_is_forecast_beyond_the_end_of_its_log() {
    let Experiment { y, .. } = Experiment::new(200);
    let folder = Folder::with_log(csv(&[("y", &y)]));
    let report = folder.fit("log.csv --na 2 --nb 0 --report model.json");
    let answer = answer(&folder, "predict model.json log.csv --horizon 6");
    assert_eq!(answer.time, (1..=206).map(f64::from).collect::<Vec<f64>>());
    assert_eq!(answer.measured[200..], [None; 6]);
    // The difference equation goes on without noise.
    let (a, mean) = (numbers(&report["model"]["a"]), number(&report, "/model/outputs/0/offset/level"));
    let mut past: Vec<f64> = y.iter().map(|y| y - mean).collect();
    let variance = number(&report, "/model/noise_covariance/0/0");
    let response = noise_response(&report, 6);
    let open = &report["model"]["offset_covariance"]["covariance"];
    for step in 0..6 {
        let next = -a[1] * past[199 + step] - a[2] * past[198 + step];
        past.push(next);
        assert!((answer.predicted[200 + step].unwrap() - (next + mean)).abs() < 1e-9, "{step}");
        // The level is open too: a constant that goes through 1/A.
        let level = open[2][2].as_f64().unwrap() * response[..=step].iter().sum::<f64>().powi(2);
        let noise = variance * response[..=step].iter().map(|h| h * h).sum::<f64>();
        let deviation = (noise + level).sqrt();
        assert!((1.0..1.08).contains(&(answer.deviation[200 + step].unwrap() / deviation)), "{step}");
    }
    // One step ahead: sigma^2 + phi' P phi, with Student's degrees of freedom.
    let phi = [-past[199], -past[198], 1.0];
    let entry = |i: usize, j: usize| phi[i] * phi[j] * open[i][j].as_f64().unwrap();
    let parameters: f64 = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).sum();
    let degrees = number(&report, "/model/degrees_of_freedom");
    let expected = ((variance + parameters) * degrees / (degrees - 2.0)).sqrt();
    assert!((answer.deviation[200].unwrap() / expected - 1.0).abs() < 1e-9);
    // Rows that end before the log's end ask for no more than that.
    let inside = self::answer(&folder, "predict model.json log.csv --horizon 6 --rows 50..100");
    assert_eq!(inside.time.len(), 51);
}

#[test]
fn a_forecast_goes_on_in_the_logs_own_time() {
    let Experiment { y, .. } = Experiment::new(100);
    let times: Vec<f64> = (0..100).map(|row| 50.0 + 0.25 * f64::from(row)).collect();
    let folder = Folder::with_log(csv(&[("t", &times), ("y", &y)]));
    folder.done("fit log.csv --time t --model arma --na 1 --nc 1 --report model.json");
    let answer = answer(&folder, "predict model.json log.csv --time t --horizon 3");
    assert_eq!(answer.time[98..], [74.5, 74.75, 75.0, 75.25, 75.5]);
    assert!(answer.predicted[100..].iter().all(Option::is_some));
}

#[test]
fn rows_with_inputs_and_no_output_are_forecast() {
    let mut experiment = Experiment::new(200);
    let folder = Folder::with_log(experiment.csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    experiment.y[190..].fill(f64::NAN);
    folder.write("future.csv", experiment.csv());
    let answer = answer(&folder, "predict model.json future.csv --horizon 8");
    assert_eq!(answer.time.len(), 200);
    // Each as many steps ahead as it lies after the last measured row.
    for (step, row) in (1..=8).zip(190..) {
        let ahead = self::answer(&folder, &format!("predict model.json log.csv --horizon {step}"));
        let (found, expected) = (answer.predicted[row].unwrap(), ahead.predicted[row].unwrap());
        assert!((found - expected).abs() < 1e-9, "{step}: {found} {expected}");
        assert!((answer.deviation[row].unwrap() / ahead.deviation[row].unwrap() - 1.0).abs() < 1e-9);
    }
    assert_eq!(answer.predicted[198..], [None; 2]);
}

#[test]
fn sunspots_are_forecast() {
    let folder = folder_with("sunspots.csv");
    folder.done("fit log.csv --time year -y y --model ar --na 9 --report model.json");
    let run = folder.done("predict model.json log.csv --time year --horizon 11");
    let answer = Answer::read(&run.stdout);
    let rows = answer.time.len();
    assert_eq!(answer.time[rows - 11] - answer.time[rows - 12], 1.0);
    let deviations: Vec<f64> = answer.deviation[rows - 11..].iter().map(|d| d.unwrap()).collect();
    // What the noise does grows with the steps; what the parameters add depends on the phase of the cycle.
    assert!(deviations.windows(2).all(|pair| pair[0] <= 1.01 * pair[1]), "{deviations:?}");
    assert!(deviations[10] > 1.5 * deviations[0], "{deviations:?}");
}

#[test]
fn every_model_is_predicted_as_its_report_says() {
    let mut random = Random::new(51);
    let u = random.signal(400);
    let e: Vec<f64> = random.signal(400).iter().map(|e| 0.3 * e).collect();
    let y = response(&[1.0, -1.2, 0.5], &[(&[0.0, 1.0, 0.4], &u), (&[1.0, 0.5], &e)], &[0.0; 400]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    for model in MODELS {
        let line = format!("log.csv {model} --estimate 1..250 --validate 251..400 --report model.json");
        let report = folder.fit(&line);
        for entry in report["fit"].as_array().unwrap() {
            let (initial, rows) = (entry["initial"].as_str().unwrap(), &entry["rows"][0]);
            let verb = if entry["horizon"]["kind"] == "steps" { "predict" } else { "simulate" };
            let line =
                format!("{verb} model.json log.csv --initial {initial} --rows {}..{}", rows[0], rows[1]);
            let answer = answer(&folder, &line);
            assert!((answer.rmse() - number(entry, "/rmse")).abs() < 1e-9, "{model}: {line}: {entry}");
            assert_eq!(answer.samples() as f64, number(entry, "/samples"), "{model}: {line}: {entry}");
        }
    }
}
