//! Several logs: several experiments, one model.

use std::ops::Range;

use serde_json::{Value, json};

use crate::harness::{Folder, distance, number, parameters};
use crate::signals::{Experiment, Random, csv, plain_log, response};

const MODELS: [&str; 5] = [
    "--na 2 --nb 2",
    "--model armax --na 2 --nb 2 --nc 1",
    "--model oe --nb 2 --nf 2",
    "--model oe --nb 2 --nf 2 --initial estimate",
    "--model bj --nb 2 --nf 2 --nc 1 --nd 1 --initial zero",
];

/// A folder with an experiment in three logs, and in one with a gap where one of these ends.
fn folder() -> Folder {
    let experiment = Experiment::new(400);
    let piece = |rows: Range<usize>| csv(&[("u", &experiment.u[rows.clone()]), ("y", &experiment.y[rows])]);
    let folder = Folder::new();
    folder.write("a.csv", piece(0..150));
    folder.write("b.csv", piece(150..290));
    folder.write("c.csv", piece(290..400));
    let nan = [f64::NAN];
    let cut = |signal: &[f64]| [&signal[..150], &nan, &signal[150..290], &nan, &signal[290..]].concat();
    folder.write("gaps.csv", csv(&[("u", &cut(&experiment.u)), ("y", &cut(&experiment.y))]));
    folder
}

#[test]
fn several_logs_give_the_fit_of_one_with_gaps() {
    let folder = folder();
    for model in MODELS {
        let several = folder.fit(&format!("a.csv b.csv c.csv {model}"));
        let one = folder.fit(&format!("gaps.csv {model}"));
        assert!(distance(&parameters(&several), &parameters(&one)) < 1e-12, "{model}");
        assert_eq!(several["data"]["segments"], json!([[1, 150], [151, 290], [291, 400]]));
        for figure in ["/estimation/mse", "/estimation/samples", "/fit/0/percent", "/fit/1/percent"] {
            let (several, one) = (number(&several, figure), number(&one, figure));
            assert!((several / one - 1.0).abs() < 1e-10, "{model} {figure}: {several} {one}");
        }
        assert_eq!(several["warnings"], json!([]), "{model}");
    }
}

#[test]
fn rows_are_counted_through_all_logs() {
    let folder = folder();
    let report = folder.fit("a.csv b.csv c.csv --estimate 1..100,160..400 --validate 101..159 --na 2 --nb 2");
    assert_eq!(report["data"]["rows"], 400);
    let logs = report["data"]["logs"].as_array().unwrap();
    let shown: Vec<(&Value, &Value)> = logs.iter().map(|log| (&log["file"], &log["rows"])).collect();
    let expected = [("a.csv", json!([1, 150])), ("b.csv", json!([151, 290])), ("c.csv", json!([291, 400]))];
    let expected: Vec<(Value, Value)> = expected.map(|(file, rows)| (json!(file), rows)).to_vec();
    assert!(
        shown.iter().zip(&expected).all(|(found, expected)| *found == (&expected.0, &expected.1)),
        "{shown:?}"
    );
    assert_eq!(report["data"]["segments"], json!([[1, 100], [160, 290], [291, 400]]));
    assert_eq!(number(&report, "/data/time_gaps"), 0.0);
}

#[test]
fn one_log_may_come_from_standard_input() {
    let folder = folder();
    let expected = folder.fit("a.csv b.csv --na 2 --nb 2");
    let run = folder.run_on("fit a.csv - --na 2 --nb 2 --format json", folder.read("b.csv"));
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(report["model"], expected["model"]);
    folder.assert_refused("fit - a.csv - --na 2 --nb 2", 2, "standard input");
}

#[test]
fn logs_with_clocks_of_their_own() {
    let experiment = Experiment::new(200);
    let folder = Folder::new();
    for (name, from) in [("a.csv", 0.0), ("b.csv", 5000.0)] {
        let times: Vec<f64> = (0..200).map(|row| from + 0.25 * f64::from(row)).collect();
        folder.write(name, experiment.timed(&times));
    }
    let report = folder.fit("a.csv b.csv --time time --na 2 --nb 2");
    assert_eq!(number(&report, "/data/sample_time"), 0.25);
    assert_eq!(number(&report, "/data/time_gaps"), 0.0);
    assert_eq!(report["data"]["logs"][1]["time"], "time");
    assert_eq!(report["warnings"], json!([]));
}

#[test]
fn a_mistake_is_in_the_file_that_has_it() {
    let folder = folder();
    folder.write("word.csv", folder.read("b.csv").replacen("\n", "\n1,oops\n", 1));
    folder.write("other.csv", folder.read("b.csv").replace("u,y", "v,y"));
    folder.write("more.csv", "u,u1,y\n1,2,3\n4,5,6\n");
    for (line, code, parts) in [
        ("fit a.csv word.csv --na 2 --nb 2", 3, &["word.csv:2:3: ", "\"oops\""][..]),
        ("fit a.csv other.csv --na 2 --nb 2", 3, &["other.csv: ", "--input"]),
        ("fit a.csv other.csv -u u --na 2 --nb 2", 3, &["other.csv: ", "'u'", "there are: v, y"]),
        ("fit a.csv more.csv --na 2 --nb 2", 3, &["more.csv: ", "u, u1", "--input"]),
        ("fit a.csv nowhere.csv --na 2 --nb 2", 5, &["nowhere.csv: "]),
        ("fit a.csv b.csv --estimate 1..291 --na 2 --nb 2", 3, &["a.csv, b.csv: ", "290 rows"]),
        ("fit a.csv b.csv --detrend linear --na 2 --nb 2", 2, &["--detrend", "several logs"]),
    ] {
        let refusal = folder.refused(line, code);
        for part in parts {
            assert!(refusal.contains(part), "{line}: {part}: {refusal}");
        }
    }
}

#[test]
fn logs_with_different_sample_times_are_refused() {
    let folder = Folder::new();
    for (name, step) in [("a.csv", 0.25), ("b.csv", 0.25), ("c.csv", 0.3)] {
        let times: Vec<f64> = (0..50).map(|row| step * f64::from(row)).collect();
        folder.write(name, Experiment::new(50).timed(&times));
    }
    let line = folder.refused("fit a.csv b.csv c.csv --time time --na 1 --nb 1", 3);
    assert!(line.contains("a.csv, b.csv, c.csv: log 3 ") && line.contains("0.3 s"), "{line}");
}

#[test]
fn a_message_about_all_logs_names_them_in_full() {
    let folder = Folder::new();
    let name = "a-name-that-is-much-longer-than-any-column.csv";
    folder.write(name, plain_log());
    let line = folder.refused(&format!("fit {name} --na 2 --nb 2 --estimate 1..201"), 3);
    assert!(line.starts_with(&format!("error: {name}: ")), "{line}");
    let many = [name; 9].join(" ");
    folder.assert_refused(&format!("fit {many} --na 2 --nb 2 --estimate 1..1801"), 3, "… (9 logs): ");
}

#[test]
fn a_report_never_replaces_one_of_the_logs() {
    let folder = folder();
    let before = folder.read("b.csv");
    folder.refused("fit a.csv b.csv --na 2 --nb 2 --report b.csv", 2);
    assert_eq!(folder.read("b.csv"), before);
}

#[test]
fn experiments_that_start_in_different_places_share_one_plant() {
    // From rest, and from far away: the start of each is estimated for itself.
    let mut random = Random::new(41);
    let folder = Folder::new();
    for (name, start) in [("a.csv", 0.0), ("b.csv", 8.0), ("c.csv", -3.0)] {
        let u = random.signal(200);
        let x = response(&[1.0, -0.95], &[(&[0.0, 0.2], &u)], &[0.0; 200]);
        let y: Vec<f64> = x
            .iter()
            .zip(random.signal(200))
            .enumerate()
            .map(|(t, (x, e))| x + start * 0.95_f64.powi(t as i32) + 0.02 * e)
            .collect();
        folder.write(name, csv(&[("u", &u), ("y", &y)]));
    }
    let report = folder.fit("a.csv b.csv c.csv --model oe --nb 1 --nf 1 --detrend none");
    assert_eq!(report["estimation"]["initial"], "estimate");
    assert_eq!(number(&report, "/estimation/initial_conditions"), 3.0);
    assert!(distance(&parameters(&report), &[0.2, -0.95]) < 5e-3, "{:?}", parameters(&report));
}

#[test]
fn the_order_of_the_logs_does_not_matter_to_the_fit() {
    let folder = folder();
    for model in MODELS {
        let forth = folder.fit(&format!("a.csv b.csv c.csv {model} --offset u=5 --offset y=20"));
        let back = folder.fit(&format!("c.csv b.csv a.csv {model} --offset u=5 --offset y=20"));
        assert!(distance(&parameters(&forth), &parameters(&back)) < 1e-6, "{model}");
    }
}

#[test]
fn one_log_is_read_as_before() {
    let folder = Folder::with_log(plain_log());
    let report = folder.fit("log.csv --na 2 --nb 2");
    assert_eq!(report["data"]["logs"].as_array().unwrap().len(), 1);
}
