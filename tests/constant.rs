//! The level and the slope of the output that are estimated with the parameters.

use serde_json::Value;

use crate::fit_reference::folder_with;
use crate::harness::{Folder, number};
use crate::signals::{Random, csv};

/// Steps from rest, two seconds a row: y is 300 and half of what u has been, with a time constant of 19 s and noise; it
/// drifts by so much a row.
fn steps(drift: f64) -> Folder {
    let u: Vec<f64> = [0.0, 40.0, 10.0, 60.0].into_iter().flat_map(|u| vec![u; 40]).collect();
    let noise = Random::new(91).signal(u.len());
    let mut x = 0.0;
    let y: Vec<f64> = (0..u.len())
        .map(|row| {
            let value = 300.0 + x + drift * row as f64 + 0.3 * noise[row];
            x = 0.9 * x + 0.05 * u[row];
            value
        })
        .collect();
    Folder::with_log(csv(&[("u", &u), ("y", &y)]))
}

/// The text of a value and its standard error.
fn near(report: &Value, at: &str, truth: f64) {
    let value = number(report, &format!("{at}/value"));
    let error = number(report, &format!("{at}/standard_error"));
    assert!((value - truth).abs() < 4.0 * error, "{at}: {value} ± {error}, not {truth}");
}

const OE: &str = "log.csv --sample-time 2 --model oe --nb 1 --nf 1";

#[test]
fn a_step_test_is_right_without_a_word() {
    let folder = steps(0.0);
    for line in [OE, "log.csv --sample-time 2 --na 1 --nb 1", "log.csv --sample-time 2 --model oe"] {
        let report = folder.fit(line);
        near(&report, "/model/dc_gain/0", 0.5);
        near(&report, "/estimation/level", 313.75);
        assert_eq!(report["model"]["outputs"][0]["offset"]["level"], report["estimation"]["level"]["value"]);
        assert_eq!(report["estimation"].get("slope"), None);
    }
    let table = folder.done(&format!("fit {OE}")).stdout;
    assert!(table.contains("operating point of 'y': 313."), "{table}");
    let without = folder.fit(&format!("{OE} --constant no"));
    assert_eq!(without["estimation"].get("level"), None);
    let errors = |report: &Value| number(report, "/estimation/mse");
    assert!(errors(&without) > 2.0 * errors(&folder.fit(OE)));
}

#[test]
fn an_integrator_has_a_level_that_is_not_sure_of_itself() {
    let noise = Random::new(7).signal(500);
    let u: Vec<f64> = (0..500).map(|row| if row / 25 % 3 == 1 { 1.0 } else { -0.3 }).collect();
    let mut x = 0.0;
    let y: Vec<f64> = u
        .iter()
        .zip(&noise)
        .map(|(u, e)| {
            let value = x + 0.05 * e;
            x += 0.1 * u;
            value
        })
        .collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let line = "log.csv --model oe --nb 1 --nf 1";
    let variance = noise.iter().map(|e| (0.05 * e).powi(2)).sum::<f64>() / 500.0;
    let report = folder.fit(line);
    assert!(number(&report, "/estimation/mse") < 1.1 * variance, "{report}");
    assert!(number(&report, "/estimation/level/standard_error") > 0.0);
    near(&report, "/model/parameters/0", 0.1);
    assert!(number(&folder.fit(&format!("{line} --constant no")), "/estimation/mse") > 2.0 * variance);
}

#[test]
fn a_slope_is_found_and_told() {
    let folder = steps(0.1);
    let report = folder.fit(&format!("{OE} --trend"));
    near(&report, "/estimation/slope", 0.05);
    near(&report, "/model/dc_gain/0", 0.5);
    let table = folder.done(&format!("fit {OE} --trend")).stdout;
    assert!(table.replace("\n  ", " ").contains("in the middle of the rows, slope 0.0"), "{table}");
    // What is predicted has both.
    folder.done(&format!("fit {OE} --trend --report model.json"));
    let figure = folder.done("validate model.json log.csv --sample-time 2 --format json").stdout;
    let figure: Value = serde_json::from_str(&figure).expect("the validation is JSON");
    assert!(number(&figure, "/fit/0/percent") > 96.0, "{figure}");
}

#[test]
fn what_does_not_go_together_is_refused() {
    let folder = steps(0.0);
    folder.assert_refused(
        &format!("fit {OE} --trend --constant no"),
        2,
        "--trend: it is a line with a level",
    );
    let arx = "fit log.csv --sample-time 2 --na 1 --nb 1 --constant yes";
    folder.assert_refused(&format!("{arx} --initial zero"), 2, "--constant: zeros before the first sample");
    let line = folder.refused(&format!("{arx} --ridge 1"), 2);
    assert!(line.contains("--constant") && line.contains("ridge"), "{line}");
    folder.assert_refused(&format!("fit log.csv log.csv {} --trend", &OE[8..]), 2, "--trend: several logs");
}

#[test]
fn inspect_tells_how_to_fit_the_public_step_test() {
    let folder = folder_with("tclab_siso_step.csv");
    let inspection = folder.done("inspect log.csv --time t -u q1 -y t1 --format json").stdout;
    let inspection: Value = serde_json::from_str(&inspection).expect("the inspection is JSON");
    assert_eq!(inspection["rest"], 11);
    let command = inspection["command"].as_str().expect("there is a command");
    let line = command.strip_prefix("thetahat fit ").expect("it is a fit");
    let report = folder.fit(line);
    assert_eq!(report["model"]["kind"], "process");
    let gain = number(&report, "/model/parameters/0/value");
    assert!((0.361..0.364).contains(&gain), "{gain}");
    // An independent least-squares fit of first order and delay has a gain of 0.3636 and a time constant of 139.05 s.
    let first_order = format!("{line} --detrend start:11 --model oe --nb 1 --nf 1 --nk 1..26");
    let report = folder.fit(&first_order);
    let gain = number(&report, "/model/dc_gain/0/value");
    assert!((0.361..0.364).contains(&gain), "{gain}");
    let time = number(&report, "/model/time_constants/0/value");
    assert!((138.0..140.0).contains(&time), "{time}");
}
