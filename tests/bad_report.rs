//! Reports and logs that do not go together, or are no reports at all.

use serde_json::{Value, json};

use crate::harness::Folder;
use crate::signals::{Experiment, csv, plain_log};

/// A folder with log.csv and the report of its fit, model.json.
fn folder() -> Folder {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder
}

/// Predicts and simulates with a report, which must be refused in one line that has all of `parts`; no CSV is written,
/// and one that is there is left alone.
fn refused(report: impl AsRef<[u8]>, code: i32, parts: &[&str]) {
    let folder = folder();
    folder.write("model.json", report);
    refused_in(&folder, "model.json log.csv", code, parts);
}

fn refused_in(folder: &Folder, words: &str, code: i32, parts: &[&str]) {
    folder.write("old.csv", "old");
    let before = folder.names();
    for verb in ["predict", "simulate"] {
        for out in ["", "-o old.csv", "-o new.csv"] {
            let line = folder.refused(&format!("{verb} {words} {out}"), code);
            for part in parts {
                assert!(line.contains(part), "{part}: {line}");
            }
        }
    }
    assert_eq!(folder.read("old.csv"), "old");
    assert_eq!(folder.names(), before);
}

#[test]
fn a_report_that_is_not_json() {
    refused("u,y\n1,2\n", 3, &["model.json: ", "not a thetahat report", "line 1 column 1"]);
    refused("", 3, &["model.json: ", "not a thetahat report"]);
    refused(b"\xff\xfe\x00", 3, &["model.json: ", "not a thetahat report"]);
    refused("{\"a\": 1}", 3, &["model.json: ", "not a thetahat report", "schema"]);
    refused("[]", 3, &["model.json: ", "not a thetahat report"]);
}

#[test]
fn a_truncated_report() {
    let whole = folder().read("model.json");
    refused(&whole[..whole.len() / 2], 3, &["model.json: ", "not a thetahat report", "line", "column"]);
    refused(&whole[..whole.len() - 3], 3, &["model.json: ", "not a thetahat report", "line", "column"]);
}

#[test]
fn a_parameter_twice_or_one_too_few_is_refused_by_every_verb() {
    let folder = folder();
    let whole: Value = serde_json::from_str(&folder.read("model.json")).expect("a report");
    let parameters = whole["model"]["parameters"].as_array().expect("parameters").clone();
    for changed in [parameters[1..].to_vec(), [&parameters[..1], &parameters].concat()] {
        let mut report = whole.clone();
        report["model"]["parameters"] = changed.into();
        folder.write("changed.json", report.to_string());
        for words in [
            "predict changed.json log.csv",
            "validate changed.json log.csv",
            "compare changed.json log.csv",
            "bode changed.json",
            "step changed.json",
            "control changed.json --poles 0.5,0.5",
            "export changed.json --to c --what predictor",
        ] {
            folder.assert_refused(words, 3, "model.parameters are not those of the orders");
        }
    }
}

#[test]
fn numbers_near_the_end_of_the_range_end_a_response() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --model ss --order 2 --report model.json");
    for matrix in ["k", "g"] {
        let mut report: Value = serde_json::from_str(&folder.read("model.json")).expect("a report");
        report["model"][matrix][0][0] = 1e308.into();
        folder.write("large.json", report.to_string());
        let run = folder.run("bode large.json");
        let is_told = run.code == 2 && run.stderr.contains("its numbers are too large");
        assert!(run.code == 0 || is_told, "{matrix}: {}", run.stderr);
    }
}

#[test]
fn another_major_schema() {
    for schema in ["thetahat.report/2", "thetahat.report/10", "thetahat.report/0", "another.report/1", ""] {
        let report = folder().read("model.json").replace("thetahat.report/1", schema);
        refused(report, 3, &["model.json: ", &format!("'{schema}'"), "thetahat.report/1"]);
    }
}

#[test]
fn a_later_minor_schema_is_read() {
    let folder = folder();
    let before = folder.done("predict model.json log.csv");
    folder.write("model.json", folder.read("model.json").replace("thetahat.report/1", "thetahat.report/1.5"));
    assert_eq!(folder.done("predict model.json log.csv").stdout, before.stdout);
}

#[test]
fn a_model_that_was_edited() {
    let folder = folder();
    let whole: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
    let accepted: Vec<String> = [
        ("/model/orders/na", json!(3)),
        ("/model/orders/nb", json!([2, 2])),
        ("/model/orders/nk", json!([u64::MAX])),
        ("/model/orders/nk", json!([2])),
        ("/model/orders/nc", json!(1)),
        ("/model/orders/nf", json!([1])),
        ("/model/a", json!([])),
        ("/model/a", json!([2.0, -1.2, 0.5])),
        ("/model/a/1", json!(null)),
        ("/model/b", json!([])),
        ("/model/b/0", json!([0.0, 1.0, 0.5, 0.2])),
        ("/model/b/0/0", json!(1.0)),
        ("/model/c", json!([1.0, 0.5])),
        ("/model/f", json!([[1.0, 0.5]])),
        ("/model/sample_time", json!(-1.0)),
        ("/model/sample_time", json!("1")),
        ("/model/inputs", json!([])),
        ("/model/inputs/0/name", json!("y")),
        ("/model/structure", json!("neural")),
    ]
    .into_iter()
    .filter_map(|(place, value)| {
        let mut report = whole.clone();
        *report.pointer_mut(place).unwrap() = value.clone();
        folder.write("edited.json", report.to_string());
        let run = folder.run("predict edited.json log.csv");
        let refused = run.code == 3 && run.refusal().contains("edited.json: ");
        (!refused).then(|| format!("{place} = {value}: {} {}", run.code, run.stderr))
    })
    .collect();
    assert!(accepted.is_empty(), "\n{}", accepted.join("\n"));
}

#[test]
fn a_field_that_is_missing() {
    let whole: Value = serde_json::from_str(&folder().read("model.json")).unwrap();
    for field in ["a", "b", "orders", "inputs", "outputs", "sample_time"] {
        let mut report = whole.clone();
        report["model"].as_object_mut().unwrap().remove(field);
        refused(report.to_string(), 3, &["model.json: ", &format!("'{field}'")]);
    }
}

#[test]
fn a_report_that_is_not_there_or_is_a_folder() {
    refused_in(&folder(), "nowhere.json log.csv", 5, &["nowhere.json: "]);
    refused_in(&folder(), ". log.csv", 5, &[".: ", "directory"]);
}

#[test]
fn report_and_log_the_wrong_way_round() {
    refused_in(&folder(), "log.csv model.json", 3, &["log.csv: ", "not a thetahat report"]);
}

#[test]
fn report_and_log_both_from_standard_input() {
    refused_in(&folder(), "- -", 2, &["standard input"]);
}

#[test]
fn a_log_without_the_models_input() {
    let folder = folder();
    folder.write("other.csv", plain_log().replace("u,y", "v,y"));
    refused_in(&folder, "model.json other.csv", 3, &["other.csv", "'u'", "there are: v, y"]);
}

#[test]
fn a_log_with_the_models_input_twice() {
    let folder = folder();
    folder.write("other.csv", plain_log().replace("u,y", "u,u"));
    refused_in(&folder, "model.json other.csv", 3, &["other.csv", "'u'", "two columns"]);
}

#[test]
fn a_log_without_the_output_cannot_be_predicted_or_started_from() {
    let folder = folder();
    folder.write("inputs.csv", csv(&[("u", &Experiment::new(50).u)]));
    for line in [
        "predict model.json inputs.csv",
        "predict model.json inputs.csv --initial zero",
        "simulate model.json inputs.csv --initial drop",
        "simulate model.json inputs.csv --initial estimate",
    ] {
        let refusal = folder.refused(line, 3);
        assert!(refusal.contains("inputs.csv: ") && refusal.contains("'y'"), "{line}: {refusal}");
    }
}

#[test]
fn a_log_with_another_sample_time() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --sample-time 0.5 --na 2 --nb 2 --report model.json");
    let parts = ["log.csv: ", "0.6 s", "0.5 s", "resample"];
    refused_in(&folder, "model.json log.csv --sample-time 0.6", 3, &parts);
    // A clock is never exact.
    folder.done("predict model.json log.csv --sample-time 0.501");
    // Without a clock, the log has the model's.
    folder.done("predict model.json log.csv");
}

#[test]
fn rows_that_are_not_there_or_no_ranges() {
    let folder = folder();
    refused_in(
        &folder,
        "model.json log.csv --rows 150..201",
        3,
        &["log.csv: ", "--rows", "150..201", "200 rows"],
    );
    refused_in(&folder, "model.json log.csv --rows 20..1", 2, &["--rows", "1..20"]);
    refused_in(&folder, "model.json log.csv --rows 1..20,20..30", 2, &["--rows", "overlap"]);
    refused_in(&folder, "model.json log.csv --rows many", 2, &["--rows", "'many'"]);
}

#[test]
fn a_bad_log_is_named_with_its_place() {
    let folder = folder();
    folder.write("bad.csv", plain_log() + "1,oops\n");
    refused_in(&folder, "model.json bad.csv", 3, &["bad.csv:202:3: ", "'y'", "\"oops\""]);
}

#[test]
fn horizons_that_are_none() {
    for horizon in ["0", "x", "1.5", "", "infinite"] {
        let line = folder().refused(&format!("predict model.json log.csv --horizon '{horizon}'"), 2);
        assert!(line.contains("--horizon"), "{line}");
    }
}

#[test]
fn a_horizon_beyond_the_log_predicts_nothing_and_says_so() {
    for horizon in ["199", "1000000000", "18446744073709551615"] {
        let run = folder().done(&format!("predict model.json log.csv --horizon {horizon}"));
        assert_eq!(run.stdout.lines().count(), 201, "{horizon}");
        assert!(run.stdout.lines().skip(1).all(|line| line.ends_with(',')), "{horizon}");
        assert!(run.stderr.starts_with("warning: no row could be predicted"), "{horizon}: {}", run.stderr);
    }
}

#[test]
fn a_one_step_prediction_has_no_start_to_estimate() {
    let line = folder().refused("predict model.json log.csv --initial estimate", 2);
    assert!(line.contains("--initial") && line.contains("use drop, zero or auto"), "{line}");
}
