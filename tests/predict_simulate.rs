//! What a stored model says of a log.

use crate::harness::{Answer, Folder, distance};
use crate::signals::{Experiment, Random, csv, plain_log, response};

/// A folder with log.csv and the report of its fit, model.json.
fn folder() -> Folder {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder
}

fn answer(folder: &Folder, line: &str) -> Answer {
    Answer::read(&folder.done(line).stdout)
}

/// All values, of which none is missing.
fn all(values: &[Option<f64>]) -> Vec<f64> {
    values.iter().map(|value| value.unwrap_or(f64::NAN)).collect()
}

#[test]
fn there_is_a_line_for_each_row() {
    let run = folder().done("predict model.json log.csv");
    assert_eq!(run.stdout.lines().next(), Some("row,measured,predicted,standard_deviation"));
    assert_eq!(Answer::read(&run.stdout).time, (1..=200).map(f64::from).collect::<Vec<f64>>());
}

#[test]
fn several_ranges_of_rows_come_in_rising_order() {
    let answer = answer(&folder(), "predict model.json log.csv --rows 50..60,10..12");
    let rows: Vec<f64> = (10..=12).chain(50..=60).map(f64::from).collect();
    assert_eq!(answer.time, rows);
    assert_eq!(answer.samples(), 14);
}

#[test]
fn what_was_measured_is_the_logs_own_number() {
    let folder = folder();
    for line in ["predict model.json log.csv", "simulate model.json log.csv --detrend linear"] {
        // Bit for bit.
        assert_eq!(all(&answer(&folder, line).measured), Experiment::new(200).y, "{line}");
    }
}

#[test]
fn the_measured_samples_before_the_rows_are_the_start() {
    let folder = folder();
    for horizon in [1, 4] {
        let whole = answer(&folder, &format!("predict model.json log.csv --horizon {horizon}"));
        let part =
            answer(&folder, &format!("predict model.json log.csv --horizon {horizon} --rows 100..150"));
        assert_eq!(part.samples(), 51);
        assert!(distance(&all(&part.predicted), &all(&whole.predicted[99..150])) < 1e-12);
    }
    // The first sample of a free run from measured samples is one step ahead of them, the second two.
    let free = answer(&folder, "simulate model.json log.csv --rows 100..150 --initial drop");
    assert_eq!(free.samples(), 51);
    for horizon in [1, 2] {
        let ahead = answer(&folder, &format!("predict model.json log.csv --horizon {horizon}"));
        let (free, ahead) = (free.predicted[horizon - 1].unwrap(), ahead.predicted[98 + horizon].unwrap());
        assert!((free - ahead).abs() < 1e-12, "{free} {ahead}");
    }
}

#[test]
fn where_the_log_has_no_samples_before_the_rows_the_first_ones_are_the_start() {
    let folder = folder();
    for (line, start) in [
        ("predict model.json log.csv", 2),
        ("predict model.json log.csv --rows 1..50", 2),
        ("predict model.json log.csv --rows 2..50", 1),
        ("predict model.json log.csv --rows 3..50", 0),
        ("predict model.json log.csv --horizon 3", 4),
        ("simulate model.json log.csv --initial drop", 2),
        ("simulate model.json log.csv --initial drop --rows 2..50", 1),
    ] {
        let answer = answer(&folder, line);
        let missing = answer.predicted.iter().take_while(|value| value.is_none()).count();
        assert_eq!(missing, start, "{line}");
        assert_eq!(answer.samples(), answer.time.len() - start, "{line}");
    }
}

#[test]
fn samples_before_the_rows_are_no_start_if_one_of_them_is_missing() {
    let mut experiment = Experiment::new(200);
    experiment.y[98] = f64::NAN;
    let folder = Folder::with_log(experiment.csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    // Row 99 is missing: of row 100 on, two samples are the start.
    let answer = answer(&folder, "predict model.json log.csv --rows 100..150");
    assert_eq!(answer.predicted.iter().take_while(|value| value.is_none()).count(), 2);
}

#[test]
fn from_zero_and_from_an_estimated_start_every_sample_counts() {
    let folder = folder();
    for line in [
        "predict model.json log.csv --initial zero",
        "simulate model.json log.csv --initial zero",
        "simulate model.json log.csv --initial estimate",
        "simulate model.json log.csv --initial estimate --rows 20..80",
    ] {
        let answer = answer(&folder, line);
        assert_eq!(answer.samples(), answer.time.len(), "{line}");
    }
}

#[test]
fn an_estimated_start_is_the_default_and_the_best() {
    let folder = folder();
    let rmse = |initial: &str| {
        answer(&folder, &format!("simulate model.json log.csv --rows 100..130 {initial}")).rmse()
    };
    let best = rmse("");
    assert_eq!(best, rmse("--initial estimate"));
    assert!(best <= rmse("--initial zero") && best <= rmse("--initial drop"));
}

#[test]
fn an_estimated_start_finds_the_state_that_noise_free_data_come_from() {
    let (a, b) = ([1.0, -1.5, 0.7], [0.0, 0.0, 1.0, 0.5]);
    let u = Random::new(11).signal(200);
    let y = response(&a, &[(&b, &u)], &[0.0; 200]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done("fit log.csv --detrend none --na 2 --nb 2 --nk 2 --report model.json");
    // A log that begins in the middle of the experiment.
    folder.write("later.csv", csv(&[("u", &u[100..]), ("y", &y[100..])]));
    let later = answer(&folder, "simulate model.json later.csv");
    assert!(later.rmse() < 1e-9, "{}", later.rmse());
    assert!(answer(&folder, "simulate model.json later.csv --initial zero").rmse() > 0.01);
    assert!(answer(&folder, "simulate model.json log.csv --initial zero").rmse() < 1e-9);
}

#[test]
fn noise_free_data_with_two_inputs_are_predicted_exactly() {
    let mut random = Random::new(15);
    let (u1, u2) = (random.signal(200), random.signal(200));
    let (b1, b2) = ([0.5, 1.0], [0.0, 0.0, -2.0]);
    let y = response(&[1.0, -0.9, 0.3], &[(&b1, &u1), (&b2, &u2)], &[0.0; 200]);
    let folder = Folder::with_log(csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    folder.done("fit log.csv --detrend none --na 2 --nb 2,1 --nk 0,2 --report model.json");
    for line in [
        "predict model.json log.csv --initial zero",
        "predict model.json log.csv --horizon 5",
        "simulate model.json log.csv --initial zero",
        "simulate model.json log.csv --initial drop --rows 90..200",
    ] {
        assert!(answer(&folder, line).rmse() < 1e-10, "{line}");
    }
}

#[test]
fn a_log_without_the_output_is_simulated_from_zero() {
    let folder = folder();
    folder.write("inputs.csv", csv(&[("u", &Experiment::new(200).u)]));
    let run = folder.done("simulate model.json inputs.csv");
    let without = Answer::read(&run.stdout);
    assert_eq!(run.stderr, "");
    assert!(without.measured.iter().all(Option::is_none));
    let with = answer(&folder, "simulate model.json log.csv --initial zero");
    assert_eq!(all(&without.predicted), all(&with.predicted));
    let part = answer(&folder, "simulate model.json inputs.csv --rows 1..50");
    assert_eq!(all(&part.predicted), all(&with.predicted[..50]));
}

#[test]
fn missing_values_are_empty_fields_and_cut_the_answer() {
    let mut experiment = Experiment::new(100);
    experiment.y[50] = f64::NAN;
    let folder = Folder::with_log(experiment.csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let run = folder.done("predict model.json log.csv");
    assert!(run.stdout.contains("\n51,,,\n"), "{}", run.stdout);
    let answer = Answer::read(&run.stdout);
    let without: Vec<usize> = (0..100).filter(|row| answer.predicted[*row].is_none()).collect();
    assert_eq!(without, [0, 1, 50, 51, 52]);
}

#[test]
fn own_means_of_the_estimation_rows_are_the_models_offsets() {
    let folder = folder();
    for verb in ["predict", "simulate"] {
        let own = answer(&folder, &format!("{verb} model.json log.csv --detrend mean"));
        let models = answer(&folder, &format!("{verb} model.json log.csv"));
        assert_eq!(own.predicted, models.predicted, "{verb}");
    }
}

#[test]
fn columns_are_found_by_name() {
    let folder = folder();
    let Experiment { u, y } = Experiment::new(200);
    let other: Vec<f64> = u.iter().map(|u| -u).collect();
    folder.write("turned.csv", csv(&[("y", &y), ("v", &other), ("u", &u)]));
    let expected = folder.done("predict model.json log.csv").stdout;
    assert_eq!(folder.done("predict model.json turned.csv").stdout, expected);
    folder.write("semicolons.csv", plain_log().replace(',', ";").replace('.', ","));
    assert_eq!(folder.done("predict model.json semicolons.csv --decimal-comma").stdout, expected);
}

#[test]
fn report_or_log_may_come_from_standard_input() {
    let folder = folder();
    let expected = folder.done("predict model.json log.csv").stdout;
    assert_eq!(folder.run_on("predict - log.csv", folder.read("model.json")).stdout, expected);
    assert_eq!(folder.run_on("predict model.json -", folder.read("log.csv")).stdout, expected);
}

#[test]
fn a_series_without_inputs_is_predicted() {
    let folder = Folder::with_log(csv(&[("count", &Experiment::new(100).y)]));
    folder.done("fit log.csv -y count --na 2 --nb 0 --report model.json");
    let steps = answer(&folder, "predict model.json log.csv --horizon 2");
    assert_eq!(steps.samples(), 97);
    let free = answer(&folder, "simulate model.json log.csv --initial drop");
    // Left alone, a stable series goes to its mean.
    let mean = Experiment::new(100).y.iter().sum::<f64>() / 100.0;
    assert!((free.predicted[99].unwrap() - mean).abs() < 1e-6);
}

#[test]
fn an_unstable_model_overflows_without_a_figure() {
    let y: Vec<f64> = (0..100).map(|t| 1e10 * 2.0_f64.powi(t)).collect();
    let folder = Folder::with_log(csv(&[("y", &y)]));
    folder.done("fit log.csv --detrend none --na 1 --nb 0 --report model.json");
    folder.write("long.csv", csv(&[("y", &[1e10; 2000])]));
    let run = folder.done("simulate model.json long.csv --initial drop");
    assert!(run.stderr.starts_with("fit none, RMSE none"), "{}", run.stderr);
    assert!(run.stdout.ends_with("2000,10000000000.0,\n"), "{}", &run.stdout[run.stdout.len() - 60..]);
}

#[test]
fn the_csv_goes_to_a_file_if_one_is_named() {
    let folder = folder();
    let expected = folder.done("predict model.json log.csv");
    let run = folder.done("predict model.json log.csv -o predicted.csv");
    assert_eq!(run.stdout, "");
    assert_eq!(run.stderr, expected.stderr);
    assert_eq!(folder.read("predicted.csv"), expected.stdout);
    assert_eq!(folder.done("predict model.json log.csv -o -").stdout, expected.stdout);
}
