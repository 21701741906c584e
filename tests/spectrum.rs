//! `thetahat spectrum` from end to end: reference values, what it writes, and what it refuses; models over what it
//! measured.

use std::f64::consts::{PI, TAU};

use serde_json::{Value, json};

use crate::fit_reference::folder_with_any;
use crate::harness::{Folder, number, numbers};
use crate::signals::{Experiment, Random, csv, plain_log};

fn measured(folder: &Folder, line: &str) -> Value {
    let run = folder.done(&format!("spectrum {line} --format json"));
    assert_eq!(run.stderr, "");
    serde_json::from_str(&run.stdout).expect("the document is JSON")
}

/// The rows of a CSV by the names of their columns.
fn table(text: &str) -> Vec<Vec<Option<f64>>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows = reader.records().map(|row| row.expect("a row"));
    rows.map(|row| row.iter().map(|cell| cell.parse().ok()).collect()).collect()
}

#[test]
fn the_hair_dryer_is_as_another_program_has_it() {
    let Some(folder) = folder_with_any("hair_dryer.csv") else { return };
    let found = measured(&folder, "log.csv --method spa --lags 30 --frequencies 0.392699");
    assert_eq!((&found["schema"], &found["method"]["lags"]), (&json!("thetahat.response/1"), &json!(30)));
    let of = |pointer: &str| number(&found, pointer);
    // Six digits are given.
    assert!((of("/responses/0/points/0/magnitude/value") - 0.465439).abs() < 1e-6);
    assert!((of("/responses/0/points/0/phase/value").to_degrees() + 136.0385).abs() < 1e-4);
    assert!((of("/noise/0/coherence") - 0.867230).abs() < 1e-6);
    assert_eq!(found["bands"]["honest"], false);
    let found = measured(&folder, "log.csv");
    assert_eq!((&found["method"]["half_width"], &found["bands"]["honest"]), (&json!(12), &json!(true)));
}

#[test]
fn csv_table_and_document_say_the_same() {
    let folder = Folder::with_log(Experiment::new(2000).csv());
    let line = "log.csv --sample-time 0.5 --frequencies 0.1..6 --points 30";
    let found = measured(&folder, line);
    let run = folder.done(&format!("spectrum {line} --format csv"));
    let head =
        "input,frequency,magnitude,magnitude_standard_error,phase,phase_standard_error,coherence,noise\n";
    assert!(run.stdout.starts_with(head));
    let rows = table(&run.stdout);
    assert_eq!(rows.len(), 30);
    let value = |polynomial: &[f64], angle: f64| {
        polynomial.iter().enumerate().fold((0.0, 0.0), |(re, im), (power, value)| {
            let turn = -angle * power as f64;
            (re + value * turn.cos(), im + value * turn.sin())
        })
    };
    for (k, row) in rows.iter().enumerate() {
        let row: Vec<f64> = row[1..].iter().map(|cell| cell.expect("a number")).collect();
        let of = |pointer: &str| number(&found, &pointer.replace('k', &k.to_string()));
        assert_eq!(row[0], of("/responses/0/points/k/frequency"));
        assert_eq!(row[1], of("/responses/0/points/k/magnitude/value"));
        assert_eq!(row[6], of("/noise/k/density"));
        let (b, a) = (value(&Experiment::B, 0.5 * row[0]), value(&Experiment::A, 0.5 * row[0]));
        let truth = b.0.hypot(b.1) / a.0.hypot(a.1);
        // None of 30 points is farther than this by chance.
        assert!((row[1] - truth).abs() < 4.5 * row[2], "{row:?} {truth}");
    }
    let shown = folder.done(&format!("spectrum {line}")).stdout;
    assert!(
        shown.starts_with("log.csv: 2000 rows (1..2000), sample time 0.5 s\nLocal polynomial method"),
        "{shown}"
    );
    assert!(shown.contains("95 % bands: honest"), "{shown}");
    folder.done(&format!("spectrum {line} -o table.txt"));
    assert!(folder.read("table.txt").contains("Local polynomial method"));
}

#[test]
fn several_logs_are_several_segments() {
    let folder = Folder::with_log(Experiment::new(500).csv());
    let found = measured(&folder, "log.csv log.csv --method welch --window 64");
    assert_eq!(found["rows"], json!([[1, 500], [501, 1000]]));
    let single = measured(&folder, "log.csv --method welch --window 64");
    let of = |found: &Value| number(found, "/responses/0/points/3/re");
    // The same twice has the same means.
    assert!((of(&found) - of(&single)).abs() < 1e-12);
    let rows = measured(&folder, "log.csv --rows 1..200,301..500");
    assert_eq!(rows["rows"], json!([[1, 200], [301, 500]]));
}

#[test]
fn sines_in_steps_are_an_experiment() {
    let folder = Folder::new();
    let mut u = Vec::new();
    for period in [40.0, 16.0] {
        u.extend((0..400).map(|t| (TAU * f64::from(t) / period).sin()));
    }
    let mut y = vec![0.0; u.len()];
    for t in 1..u.len() {
        y[t] = 0.7 * y[t - 1] + 0.3 * u[t - 1];
    }
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    let found = measured(&folder, "log.csv --method sines");
    for (k, period) in [(0, 40.0), (1, 16.0)] {
        let angle = TAU / period;
        // 0.3/(q - 0.7)
        let truth = 0.3 / (angle.cos() - 0.7).hypot(angle.sin());
        assert!((number(&found, &format!("/responses/0/points/{k}/frequency")) - angle).abs() < 1e-12);
        let size = number(&found, &format!("/responses/0/points/{k}/magnitude/value"));
        assert!((size - truth).abs() < 1e-5, "{size} {truth}");
    }
}

#[test]
fn a_model_lies_over_what_was_measured() {
    let folder = Folder::with_log(Experiment::new(2000).csv());
    folder.done("fit log.csv --na 2 --nb 2 --report right.json");
    folder.done("fit log.csv --na 1 --nb 1 --report wrong.json");
    folder.done("spectrum log.csv --format json -o response.json");
    let run = folder.done("bode right.json wrong.json --over response.json --html page.html");
    let rows = table(&run.stdout);
    assert_eq!(rows.len(), 400);
    let share = |rows: &[Vec<Option<f64>>]| {
        rows.iter().filter(|row| row[11] == Some(1.0)).count() as f64 / rows.len() as f64
    };
    // Both see the same noise: fewer than 5 % of the right one.
    assert!(share(&rows[..200]) < 0.15, "{}", share(&rows[..200]));
    assert!(share(&rows[200..]) > 0.5, "{}", share(&rows[200..]));
    let page = folder.read("page.html");
    assert!(page.contains("Response from u") && page.contains("right.json") && page.contains("wrong.json"));
    folder.done("spectrum log.csv --html own.html -o table.txt");
    assert!(folder.read("own.html").contains("Spectrum of the noise"));
}

#[test]
fn what_does_not_go_together_is_refused() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder.done("fit log.csv --sample-time 2 --na 2 --nb 2 --report slow.json");
    folder.done("spectrum log.csv --format json -o response.json");
    let before = folder.names();
    for (line, code, says) in [
        (
            "spectrum log.csv --frequencies 1..4 -o new.csv",
            2,
            "--frequencies: 4 rad/s is above 3.14159 rad/s",
        ),
        ("spectrum log.csv --frequencies a..b", 2, "--frequencies: 'a..b': write a band"),
        ("spectrum log.csv --points 5", 2, "--points: it is for a band"),
        ("spectrum log.csv --lags 5", 2, "--lags: it is for --method spa"),
        (
            "spectrum log.csv --method welch --window 500 --html new.html",
            2,
            "--window: 500 rows are more than",
        ),
        ("spectrum log.csv --method sines -o new.json", 3, "log.csv: the input does not repeat itself"),
        ("spectrum log.csv --rows 1..20", 3, "log.csv: lpm needs 23 rows"),
        ("spectrum log.csv --rows 1..2000", 3, ""),
        ("spectrum log.csv -u y", 2, "twice"),
        ("spectrum log.csv -u nothing", 3, "there is no column 'nothing'"),
        ("spectrum log.csv -o log.csv", 2, ""),
        ("bode model.json model.json", 2, "several reports need --over"),
        ("bode model.json --over model.json", 3, "model.json: its schema is 'thetahat.report/1'"),
        ("bode slow.json --over response.json -o new.csv", 3, "slow.json: model: its sample time is 2 s"),
    ] {
        folder.assert_refused(line, code, says);
        assert_eq!(folder.names(), before, "{line}");
    }
    folder.write("constant.csv", "u,y\n1,2\n1,3\n1,4\n1,6\n");
    folder.assert_refused("spectrum constant.csv", 4, "the input 'u' is constant (1): it excites nothing");
    let mut random = Random::new(3);
    let rows = random.signal(300);
    let sine: Vec<f64> = (0..300).map(|t| (PI * f64::from(t) / 15.0).sin()).collect();
    folder.write("sine.csv", csv(&[("u", &sine), ("y", &rows)]));
    folder.assert_refused("spectrum sine.csv --frequencies 1..3 -o new.csv", 4, "the input 'u' has");
}

#[test]
fn noise_has_its_place() {
    let folder = Folder::with_log(Experiment::new(4000).csv());
    let found = measured(&folder, "log.csv --method welch --window 128");
    let density: Vec<f64> =
        found["noise"].as_array().into_iter().flatten().map(|of| number(of, "/density")).collect();
    assert_eq!(density.len(), 63);
    let coherence = numbers(&Value::Array(
        found["noise"].as_array().into_iter().flatten().map(|of| of["coherence"].clone()).collect(),
    ));
    assert!(coherence.iter().all(|of| (0.0..=1.0).contains(of)));
}
