//! The frequency response of a stored model.

use std::f64::consts::PI;

use serde_json::Value;

use crate::harness::{Folder, number, numbers};
use crate::signals::{Experiment, Random, csv, plain_log};

/// A row of the CSV.
#[derive(Debug, PartialEq)]
struct Point {
    input: String,
    frequency: f64,
    magnitude: f64,
    magnitude_error: Option<f64>,
    phase: f64,
    phase_error: Option<f64>,
}

fn points(folder: &Folder, line: &str) -> Vec<Point> {
    let run = folder.done(line);
    assert_eq!(run.stderr, "");
    let mut reader = csv::Reader::from_reader(run.stdout.as_bytes());
    let names =
        ["input", "frequency", "magnitude", "magnitude_standard_error", "phase", "phase_standard_error"];
    assert_eq!(reader.headers().expect("there is a header"), &names[..]);
    let rows = reader.deserialize::<(String, f64, f64, Option<f64>, f64, Option<f64>)>();
    let point = |row: Result<_, csv::Error>| {
        let (input, frequency, magnitude, magnitude_error, phase, phase_error) =
            row.expect("a name and numbers");
        Point { input, frequency, magnitude, magnitude_error, phase, phase_error }
    };
    rows.map(point).collect()
}

/// A polynomial in q^-1 at q = exp(i angle), as (re, im).
fn at(polynomial: &[f64], angle: f64) -> (f64, f64) {
    polynomial.iter().enumerate().fold((0.0, 0.0), |(re, im), (power, value)| {
        let turn = -angle * power as f64;
        (re + value * turn.cos(), im + value * turn.sin())
    })
}

/// The size of numerator over denominators there.
fn size(numerator: &[f64], denominators: &[&[f64]], angle: f64) -> f64 {
    let modulus = |p: &[f64]| {
        let (re, im) = at(p, angle);
        re.hypot(im)
    };
    denominators.iter().fold(modulus(numerator), |size, p| size / modulus(p))
}

#[test]
fn magnitudes_are_those_of_the_polynomials() {
    let folder = Folder::with_log(plain_log());
    let report: Value = folder
        .fit("log.csv --sample-time 0.5 --model bj --nb 2 --nf 2 --nc 1 --nd 1 --nk 2 --report model.json");
    let model = &report["model"];
    let of = |name: &str| numbers(&model[name]);
    let (b, f) = (numbers(&model["b"][0]), numbers(&model["f"][0]));
    let points = points(&folder, "bode model.json --frequencies 0.01..6 --points 20");
    assert_eq!(points.len(), 40);
    for (index, point) in points.iter().enumerate() {
        let angle = 0.5 * point.frequency;
        let (input, expected) = if index < 20 {
            ("u", size(&b, &[&of("a"), &f], angle))
        } else {
            ("noise", size(&of("c"), &[&of("a"), &of("d")], angle))
        };
        assert_eq!(point.input, input);
        assert!((point.magnitude / expected - 1.0).abs() < 1e-9, "{point:?} {expected}");
        assert!(point.magnitude_error.unwrap() > 0.0 && point.phase_error.unwrap() > 0.0, "{point:?}");
    }
    let ratio = 600_f64.powf(1.0 / 19.0);
    assert!(points[..20].windows(2).all(|p| (p[1].frequency / p[0].frequency / ratio - 1.0).abs() < 1e-9));
    assert_eq!((points[0].frequency, points[19].frequency), (0.01, 6.0));
}

#[test]
fn phases_are_in_degrees_and_go_on_without_a_jump() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --nk 5 --report model.json");
    let phases: Vec<f64> = points(&folder, "bode model.json --points 500")
        .iter()
        .filter(|point| point.input == "u")
        .map(|point| point.phase)
        .collect();
    // Five samples of delay alone turn by 5 pi at half the sampling frequency.
    assert!(phases[0].abs() < 5.0 && phases[499] < -700.0, "{} {}", phases[0], phases[499]);
    assert!(phases.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 60.0));
}

#[test]
fn it_goes_from_a_thousandth_of_half_the_sampling_frequency_up_to_that() {
    let folder = Folder::with_log(plain_log());
    let report = folder.fit("log.csv --sample-time 0.25 --na 2 --nb 2 --report model.json");
    let points = points(&folder, "bode model.json");
    assert_eq!(points.len(), 200);
    let nyquist = PI / 0.25;
    assert!((points[0].frequency / (nyquist / 1000.0) - 1.0).abs() < 1e-12);
    assert!((points[99].frequency / nyquist - 1.0).abs() < 1e-12);
    // Far below every pole it is the static gain.
    let gain = number(&report, "/model/dc_gain/0/value");
    assert!((points[0].magnitude / gain - 1.0).abs() < 1e-3, "{} {gain}", points[0].magnitude);
    let error = number(&report, "/model/dc_gain/0/standard_error");
    assert!((points[0].magnitude_error.unwrap() / error - 1.0).abs() < 1e-2);
}

#[test]
fn every_input_has_its_rows() {
    let Experiment { u, y } = Experiment::new(200);
    let second = Random::new(61).signal(200);
    let folder = Folder::with_log(csv(&[("u1", &u), ("u2", &second), ("y", &y)]));
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let names: Vec<String> =
        points(&folder, "bode model.json --points 2").into_iter().map(|p| p.input).collect();
    assert_eq!(names, ["u1", "u1", "u2", "u2", "noise", "noise"]);
}

#[test]
fn a_series_has_the_response_of_its_noise_alone() {
    let folder = Folder::with_log(csv(&[("y", &Experiment::new(200).y)]));
    folder.done("fit log.csv --model arma --na 2 --nc 1 --report model.json");
    assert!(points(&folder, "bode model.json").iter().all(|point| point.input == "noise"));
}

#[test]
fn it_goes_to_a_file_if_one_is_named_and_never_over_the_report() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let expected = folder.done("bode model.json").stdout;
    assert_eq!(folder.done("bode model.json -o bode.csv").stdout, "");
    assert_eq!(folder.read("bode.csv"), expected);
    assert_eq!(folder.run_on("bode -", folder.read("model.json")).stdout, expected);
    let report = folder.read("model.json");
    folder.refused("bode model.json -o model.json", 2);
    assert_eq!(folder.read("model.json"), report);
}

#[test]
fn frequencies_that_make_no_sense() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    for range in ["1", "..", "0..1", "-1..1", "2..1", "1..1", "a..b", "1..inf", "nan..1"] {
        let line = folder.refused(&format!("bode nowhere.json --frequencies {range}"), 2);
        assert!(line.contains("--frequencies") && line.contains("LOW..HIGH"), "{range}: {line}");
    }
    // Half the sampling frequency is pi.
    let line = folder.refused("bode model.json --frequencies 1..4", 2);
    assert!(
        line.contains("--frequencies: 4 rad/s") && line.contains("half the sampling frequency"),
        "{line}"
    );
    for points in ["1", "0", "many", "99999999"] {
        let run = folder.run(&format!("bode model.json --points {points}"));
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{points}");
        assert!(run.stderr.contains("--points"), "{}", run.stderr);
    }
}

#[test]
fn a_report_that_is_none() {
    let folder = Folder::with_log(plain_log());
    folder.assert_refused("bode nowhere.json", 5, "nowhere.json: ");
    folder.assert_refused("bode log.csv", 3, "log.csv: this is not a thetahat report");
}

/// The command line makes sense, the report does not.
#[test]
fn numbers_near_the_end_of_the_range_are_those_of_the_report() {
    let folder = Folder::new();
    for seed in [
        include_str!("../fuzz/seeds/document/gain_near_the_end.json"),
        include_str!("../fuzz/seeds/document/kalman_gain_near_the_end.json"),
    ] {
        folder.write("model.json", seed);
        folder.assert_refused("bode model.json", 3, "model.json: ");
    }
    // Whoever names a frequency has named it.
    folder.refused("bode model.json --frequencies 1..2", 2);
}
