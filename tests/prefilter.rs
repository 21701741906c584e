//! Fits in a band of frequencies.

use serde_json::{Value, json};

use crate::harness::{Answer, Folder, number, parameters};
use crate::signals::{Random, csv, plain_log, response};

/// x(t) = 0.9 x(t - 1) + 0.1 u(t - 1) every 0.1 s, measured with a slow drift of the size of x.
fn drifting() -> String {
    const ROWS: usize = 4000;
    let mut random = Random::new(5);
    let mut level = 0.0;
    let u: Vec<f64> = (0..ROWS)
        .map(|t| {
            if t % 15 == 0 {
                level = random.uniform();
            }
            level
        })
        .collect();
    let x = response(&[1.0, -0.9], &[(&[0.0, 0.1], &u)], &vec![0.0; ROWS]);
    let walk: Vec<f64> = random.signal(ROWS).iter().map(|step| 0.03 * step).collect();
    let drift = response(&[1.0, -0.999], &[], &walk);
    let y: Vec<f64> = (0..ROWS).map(|t| 3.0 + x[t] + drift[t] + 0.02 * random.uniform()).collect();
    csv(&[("u", &u), ("y", &y)])
}

const FIT: &str =
    "log.csv --sample-time 0.1 --model oe --nb 1 --nf 1 --estimate 1..3000 --validate 3001..4000";

fn fitted(folder: &Folder, options: &str) -> Value {
    folder.fit(&format!("{FIT} {options}"))
}

#[test]
fn drift_does_no_harm_to_a_fit_above_its_frequencies() {
    let folder = Folder::with_log(drifting());
    let far = |report: &Value| {
        let found = parameters(report);
        assert_eq!(found.len(), 2);
        ((found[0] - 0.1).abs(), (found[1] + 0.9).abs())
    };
    let whole = fitted(&folder, "");
    let report = fitted(&folder, "--prefilter 0.05.. --report model.json");
    let ((b, f), (b_whole, f_whole)) = (far(&report), far(&whole));
    println!("b1 off by {b_whole} and {b}, f1 by {f_whole} and {f}");
    assert!(b < 0.004 && f < 0.004, "{b} {f}");
    assert!(f < 0.2 * f_whole, "{f} {f_whole}");
    let errors = |report: &Value, pointer: &str| number(report, pointer);
    let error = "/model/parameters/1/standard_error";
    assert!(f < 4.0 * errors(&report, error) && errors(&report, error) < 0.5 * errors(&whole, error));

    assert_eq!(report["data"]["prefilter"], json!({"low": 0.05, "high": null}));
    assert!(whole["data"].get("prefilter").is_none());
    // Errors that were made small are filtered ones; figures and noise variance are of the log as it is.
    assert!(number(&report, "/estimation/mse") < 0.1 * number(&report, "/model/noise_covariance/0/0"));
    let run = folder.done("predict model.json log.csv --rows 3001..4000");
    let rmse = Answer::read(&run.stdout).rmse();
    let fits = report["fit"].as_array().unwrap();
    assert!((number(&fits[2], "/rmse") - rmse).abs() < 1e-9);
    let mse = number(&fits[0], "/rmse").powi(2);
    assert!((number(&report, "/model/noise_covariance/0/0") / (mse * 3000.0 / 2998.0) - 1.0).abs() < 1e-6);
    // The log of the fit is known again.
    let validation = folder.done("validate model.json log.csv --rows 1..3000 --format json").stdout;
    let validation: Value = serde_json::from_str(&validation).unwrap();
    assert_eq!(validation["in_sample"], "yes");
    assert!((number(&validation, "/noise/0/ratio") - 1.0).abs() < 0.01);
}

#[test]
fn every_way_to_fit_takes_a_band() {
    let folder = Folder::with_log(plain_log());
    for options in [
        "--na 2 --nb 2",
        "--na 2 --nb 2 --method iv",
        "--model oe --nb 2 --nf 2 --method sriv",
        "--model armax --na 2 --nb 2 --nc 1",
        "--model bj --nb 2 --nf 2 --nc 1 --nd 1 --starts 2",
        "--na 2 --nb 2 --norm 1",
        "--na 1..3 --nb 1..3 --split 50/25/25 --select validation",
        "",
    ] {
        let report = folder.fit(&format!("log.csv --sample-time 0.5 --prefilter ..0.5 {options}"));
        assert_eq!(report["data"]["prefilter"], json!({"low": null, "high": 0.5}), "{options}");
        assert!(number(&report, "/fit/0/rmse") > 0.0, "{options}");
    }
    // What is left out while the filter settles.
    let samples = |options: &str| {
        let report = folder.fit(&format!("log.csv --na 2 --nb 2 {options}"));
        report["estimation"]["samples"].as_u64().unwrap()
    };
    assert_eq!(samples(""), 198);
    // About two periods of the lower end.
    assert!((150..170).contains(&samples("--prefilter 0.05..")), "{}", samples("--prefilter 0.05.."));
}

#[test]
fn bands_that_make_no_sense_are_refused() {
    let folder = Folder::with_log(plain_log());
    for (band, words) in [
        ("1", "LOW..HIGH in Hz"),
        ("..", "LOW..HIGH in Hz"),
        ("0.4..0.1", "LOW..HIGH in Hz"),
        ("-1..0.1", "LOW..HIGH in Hz"),
        ("0.1..0.6", "0.6 Hz is not below 0.5 Hz, half the sampling frequency"),
    ] {
        let refusal = folder.refused(&format!("fit log.csv --na 2 --nb 2 --prefilter {band}"), 2);
        assert!(refusal.contains("--prefilter") && refusal.contains(words), "{band}: {refusal}");
    }
    // One that settles more slowly than the log lasts is told.
    let run = folder.done("fit log.csv --na 2 --nb 2 --prefilter 0.002..");
    assert!(run.stderr.contains("the prefilter settles in "), "{}", run.stderr);
}
