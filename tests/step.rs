//! `thetahat step` on a log, on the document of `spectrum`, and its pages.

use std::f64::consts::TAU;

use serde_json::{Value, json};

use crate::browser::Browser;
use crate::fit_reference::{folder_with, folder_with_any};
use crate::harness::{Folder, number};
use crate::signals::{Random, csv, plain_log};

/// A gain of 2, a time constant of 10 s and a dead time of 3 s; steps from 1 to 3 and back, a row every half second.
fn steps(noise: f64) -> String {
    let mut random = Random::new(5);
    let time: Vec<f64> = (0..600).map(|row| 0.5 * f64::from(row)).collect();
    let u: Vec<f64> = time.iter().map(|t| if (50.0..170.0).contains(t) { 3.0 } else { 1.0 }).collect();
    let risen = |t: f64| 1.0 - (-(t - 3.0).max(0.0) / 10.0).exp();
    let clean = |t: f64| 5.0 + 4.0 * (risen(t - 50.0) - risen(t - 170.0));
    let y: Vec<f64> = time.iter().map(|t| clean(*t) + noise * random.uniform()).collect();
    csv(&[("t", &time), ("u", &u), ("y", &y)])
}

/// The summary of a figure by a method.
fn summary(document: &Value, figure: &str, method: &str) -> Value {
    let mut all = document["summary"].as_array().into_iter().flatten();
    all.find(|of| of["figure"] == figure && of["method"] == method).cloned().unwrap_or(Value::Null)
}

#[test]
fn table_document_and_page_are_written() {
    let folder = Folder::with_log(steps(0.05));
    let run = folder.done("step log.csv --time t --report test.json --html page.html");
    assert!(run.stdout.starts_with("log.csv: 2 steps of u, responses of y\n"), "{}", run.stdout);
    assert!(run.stdout.contains("weighted t-bar *"), "{}", run.stdout);
    assert!(run.stdout.contains("first order: trust the weighted t-bar"), "{}", run.stdout);
    assert!(run.stdout.lines().all(|line| line.chars().count() <= 80), "{}", run.stdout);
    let document: Value = serde_json::from_str(&folder.read("test.json")).unwrap();
    assert_eq!(document["schema"], "thetahat.step/1");
    for (figure, method, right) in [
        ("gain", "regime", 2.0),
        ("dead-time", "two-points", 3.0),
        ("time-constant", "weighted-average", 10.0),
    ] {
        let found = summary(&document, figure, method);
        let error = (number(&found, "/value/value") - right).abs();
        assert!(error < 5.0 * number(&found, "/value/standard_error") && error < 0.05 * right, "{found}");
        assert_eq!(found["trusted"], json!(2));
    }
    let page = folder.read("page.html");
    assert!(page.contains("Step test of y: log.csv") && page.contains("Step 2, at 170 s"));
    // The document on standard output, in a file, and again are the same.
    let json = folder.done("step log.csv --time t --format json").stdout;
    assert_eq!(json, folder.read("test.json"));
    folder.done("step log.csv --time t --format json -o again.json");
    assert_eq!(json, folder.read("again.json"));
    let one = folder.done("step log.csv --time t --rows 1..300 --format json").stdout;
    assert_eq!(serde_json::from_str::<Value>(&one).unwrap()["steps"].as_array().map(Vec::len), Some(1));
    let piped = folder.run_on("step - --time t --format json", folder.read("log.csv"));
    assert_eq!(piped.code, 0, "{}", piped.stderr);
    let without = |text: &str| text.replace("\"file\": \"-\"", "\"file\": \"log.csv\"");
    assert_eq!(without(&piped.stdout), json);
}

#[test]
fn a_browser_shows_the_page() {
    let Some(mut browser) = Browser::start("a_browser_shows_the_page") else { return };
    let folder = Folder::with_log(steps(0.05));
    folder.done("step log.csv --time t --html page.html -o table.txt");
    folder.done("fit log.csv --time t --model oe --nb 1 --nf 1 --nk 7 --report model.json");
    folder.done("step model.json --html model.html -o step.csv");
    // The log and two responses; one response.
    for (page, charts) in [("page.html", 3), ("model.html", 1)] {
        browser.open(&folder.path(page), 390);
        assert_eq!(
            browser.value("document.querySelectorAll('.chart svg.main-svg .scatterlayer').length > 0"),
            json!(true)
        );
        assert_eq!(browser.value("document.querySelectorAll('.chart').length"), json!(charts), "{page}");
        assert_eq!(
            browser.value("document.documentElement.scrollWidth <= innerWidth"),
            json!(true),
            "{page}"
        );
        assert_eq!(browser.complaints(), Vec::<String>::new());
    }
}

#[test]
fn a_model_gives_its_response() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let impulse = folder.done("step model.json --impulse --samples 30").stdout;
    assert_eq!(impulse, folder.done("impulse model.json --samples 30 --html impulse.html").stdout);
    assert_ne!(impulse, folder.done("step model.json --samples 30").stdout);
    assert!(folder.read("impulse.html").contains("Impulse response from u"));
    folder.done("step model.json --html step.html -o step.csv");
    let page = folder.read("step.html");
    assert!(page.contains("Step response from u") && page.contains("95 % band"));
    let piped = folder.run_on("step - --impulse --samples 30", folder.read("model.json"));
    assert_eq!((piped.code, piped.stdout), (0, impulse));
}

#[test]
fn sines_tell_the_time_constant() {
    let folder = Folder::new();
    let (mut u, mut y, mut state) = (Vec::new(), Vec::new(), 0.0);
    for period in [400, 200, 140, 120, 80] {
        for t in 0..8 * period {
            u.push((TAU * f64::from(t) / f64::from(period)).sin());
            y.push(state);
            state += (1.0 - (-1.0_f64 / 20.0).exp()) * (u[u.len() - 1] - state);
        }
    }
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    folder.done("spectrum log.csv --method sines --format json -o response.json");
    let document = folder.done("step response.json --format json --html page.html").stdout;
    let document: Value = serde_json::from_str(&document).unwrap();
    // The input is held, which is a dead time of half a row: 20 omega = tan(pi/4 - omega/2).
    let found = summary(&document, "time-constant", "phase");
    assert!((number(&found, "/value/value") - 20.98).abs() < 0.1, "{found}");
    assert!(folder.done("step response.json").stdout.contains("phase of -45 degrees *"));
    assert!(folder.read("page.html").contains("phase of -45 degrees"));
    folder.assert_refused("step response.json -u w", 2, "it is from: u");
    folder.assert_refused("step response.json --samples 5", 2, "--samples is for the report of a model");
    // Half a period is no sine.
    let half: Vec<f64> = (0..100).map(|t| (TAU * f64::from(t) / 200.0).sin()).collect();
    folder.write("half.csv", csv(&[("u", &half), ("y", &half)]));
    folder.refused("spectrum half.csv --method sines --format json -o new.json", 3);
}

#[test]
fn what_makes_no_sense_is_refused_and_nothing_is_written() {
    let folder = Folder::with_log(steps(0.05));
    folder.done("fit log.csv --time t --na 1 --nb 1 --report model.json");
    folder.write("noise.csv", steps(60.0));
    folder.write("constant.csv", "u,y\n1,2\n1,3\n1,4\n");
    folder.write("row.csv", "u,y\n1,2\n");
    folder.write("empty.csv", "");
    folder.write("brace.json", "{");
    folder.write("infinite.csv", "u,y\n1,2\n1,inf\n");
    folder.write("two.csv", "u1,u2,y\n1,2,3\n2,3,4\n");
    let before = folder.names();
    for (line, code, says) in [
        ("step constant.csv -o new.txt", 3, "constant.csv: there is no step: the input 'u' is constant (1)"),
        ("step row.csv -o new.txt", 3, "there is no step"),
        ("step empty.csv -o new.txt", 3, "empty.csv"),
        ("step infinite.csv -o new.txt", 3, "infinite"),
        ("step noise.csv --time t --html new.html", 4, "which is lost in its noise"),
        ("step log.csv --time t --rows 1..120 --report new.json", 4, "does not reach a final steady state"),
        ("step log.csv --time t --rows 1..2000", 3, "the log has 600 rows"),
        ("step log.csv --time t --rows 9..2", 2, "the last row comes before the first"),
        ("step log.csv --time t -u y", 2, "named twice"),
        ("step log.csv --time t -u w", 3, "there is no column 'w'"),
        ("step two.csv", 2, "a step test has one input, and there are 2: name one with --input"),
        ("step log.csv --samples 5", 2, "--samples is for the report of a model, and log.csv is a log"),
        ("step log.csv --impulse", 2, "--impulse is for the report of a model"),
        ("step log.csv --time t -o log.csv", 2, "log.csv"),
        ("step model.json --rows 1..9", 2, "--rows is for a log, and model.json is a report"),
        ("step model.json --time t", 2, "--time is for a log"),
        ("step model.json --format json", 2, "--format is for a log"),
        ("step model.json --report new.json", 2, "--report is for a log"),
        ("step brace.json -o new.csv", 3, "brace.json: this is not a thetahat report"),
        ("step nowhere.csv", 5, "nowhere.csv"),
    ] {
        folder.assert_refused(line, code, says);
        assert_eq!(folder.names(), before, "{line}");
    }
}

#[test]
fn public_logs_without_a_final_steady_state_are_refused() {
    let folder = folder_with("tclab_siso_step.csv");
    // Its clock is irregular, and each step ends after less than two time constants.
    folder.assert_refused(
        "step log.csv --time t -u q1 -y t1",
        4,
        "step 1 (row 12): the output does not reach a final steady state",
    );
    let folder = folder_with("hair_dryer.csv");
    folder.assert_refused("step log.csv", 4, "no step can be evaluated");
    let Some(folder) = folder_with_any("heating_system.csv") else { return };
    folder.assert_refused("step log.csv --time t", 4, "step 1 (row 201)");
}

#[test]
fn a_step_that_took_too_long_is_named() {
    // A knob that is turned by hand, four rows beside a level of 40; and back at once.
    let mut random = Random::new(6);
    let u: Vec<f64> = (0..600_u32)
        .map(|row| match row {
            0..40 => 1.0,
            40..44 => 1.0 + 0.5 * f64::from(row - 39),
            44..300 => 3.0,
            _ => 1.0,
        })
        .collect();
    let mut state = 1.0;
    let y: Vec<f64> = u
        .iter()
        .map(|u| {
            let own = state + 0.01 * random.uniform();
            state += (u - state) / 20.0;
            own
        })
        .collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let run = folder.done("step log.csv --report test.json");
    assert!(run.stdout.starts_with("log.csv: 1 step of u, response of y\n"), "{}", run.stdout);
    let document: Value = serde_json::from_str(&folder.read("test.json")).unwrap();
    let warnings = document["warnings"].to_string();
    let words = "from row 41 on 'u' goes from 1 to 3 in 3 rows, which is slow beside a level of 40 rows: it is left out";
    assert!(warnings.contains(words), "{warnings}");
}
