//! Reports of models in equations in every verb.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Folder, number};

/// A model in equations and its log, and what was found in the first rows.
fn fitted(name: &str, rows: &str, more: &str) -> (Folder, Value) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let read = |file: String| fs::read(data.join(file)).expect("the models are in the repository");
    let folder = Folder::with_log(read(format!("{name}.csv")));
    folder.write("model.toml", read(format!("{name}.toml")));
    let line =
        format!("fit --grey model.toml log.csv --time t --estimate {rows} --report report.json {more}");
    folder.done(&line);
    let report = serde_json::from_str(&folder.read("report.json")).expect("it is JSON");
    (folder, report)
}

fn figure(document: &Value, output: &str, part: &Value, kind: &str) -> f64 {
    let all = document["fit"].as_array().into_iter().flatten();
    let same =
        |fit: &&Value| fit["output"] == output && fit["part"] == *part && fit["horizon"]["kind"] == kind;
    number(all.into_iter().find(same).expect("the figure is there"), "/rmse")
}

#[test]
fn figures_of_a_fit_are_those_of_a_validation() {
    let (folder, report) = fitted("dc_motor", "1..600", "--validate 701..900 --html page.html");
    assert_eq!(
        (&report["model"]["kind"], &report["schema"]),
        (&"equations".into(), &"thetahat.report/1".into())
    );
    for (rows, part, seen) in [("1..600", "estimation", "yes"), ("701..900", "validation", "no")] {
        let run = folder.done(&format!("validate report.json log.csv --time t --rows {rows} --format json"));
        let validation: Value = serde_json::from_str(&run.stdout).expect("it is JSON");
        assert_eq!(validation["in_sample"], seen);
        for output in ["i", "speed"] {
            for kind in ["steps", "free-run"] {
                let (one, other) = (
                    figure(&report, output, &part.into(), kind),
                    figure(&validation, output, &Value::Null, kind),
                );
                assert_eq!(one, other, "{part} {output} {kind}");
            }
        }
        assert_eq!(validation["residuals"].as_array().map(Vec::len), Some(2));
        for steps in [1, 5] {
            let all = validation["coverage"].as_array().into_iter().flatten();
            let own = all.filter(|one| one["steps"] == steps && one["level"] == 0.95);
            for one in own {
                // Binomial: standard deviation below 2 %.
                assert!((number(one, "/actual") - 0.95).abs() < 0.06, "{one}");
            }
        }
    }
    let page = folder.read("page.html");
    assert!(page.contains("torque_constant") && page.contains("Output speed over time"));
    // Another log with the same numbers but one is another one.
    folder.write("other.csv", folder.read("log.csv").replacen("0.01,", "0.0100001,", 1));
    let run = folder.done("validate report.json other.csv --time t --rows 1..600 --format json");
    let validation: Value = serde_json::from_str(&run.stdout).expect("it is JSON");
    assert_eq!(validation["in_sample"], "yes", "the clock is no channel");
}

#[test]
fn every_verb_takes_the_report() {
    let (folder, _) = fitted("dc_motor", "1..600", "");
    let run = folder.done("predict report.json log.csv --time t --horizon 3 --rows 601..1000");
    let mut lines = run.stdout.lines();
    assert_eq!(
        lines.next(),
        Some(
            "time,measured_i,predicted_i,standard_deviation_i,measured_speed,predicted_speed,standard_deviation_speed"
        )
    );
    assert_eq!(lines.count(), 400);
    assert!(run.stderr.contains("i: fit ") && run.stderr.contains("speed: fit "), "{}", run.stderr);
    assert_eq!(folder.done("simulate report.json log.csv --time t").stdout.lines().count(), 1001);
    folder.done("filter report.json log.csv --time t -o states.jsonl");
    folder.done("validate report.json log.csv --time t --rows 601..1000 --require 'white,fit>=80,fit@5>=80,coverage>=80'");
    folder.done("fit log.csv --time t -u u -y speed --estimate 1..600 --na 2 --nb 2 --report arx.json");
    let run =
        folder.done("compare report.json arx.json log.csv --time t --rows 601..1000 --html compare.html");
    for words in ["equations, 2 states", "ARX(2, 2, 1)", "speed: fit [%], free run", "i: Ljung-Box p-value"] {
        assert!(run.stdout.contains(words), "{words}:\n{}", run.stdout);
    }
    // Of inputs alone the free run begins as the model says.
    let inputs: String = folder
        .read("log.csv")
        .lines()
        .map(|line| line.split(',').take(2).collect::<Vec<_>>().join(",") + "\n")
        .collect();
    folder.write("inputs.csv", inputs);
    let run = folder.done("simulate report.json inputs.csv --time t");
    assert!(run.stdout.lines().nth(1).is_some_and(|line| line.starts_with("0.0,,")), "{}", run.stdout);
    folder.assert_refused("predict report.json inputs.csv --time t", 3, "no output 'i'");
    let refusals = [
        ("simulate report.json log.csv --time t --draws 5", 3, "is of polynomial models"),
        ("track log.csv --time t --warm report.json", 3, "a tracker is of polynomial models"),
        ("predict report.json log.csv --time t --detrend mean", 2, "takes nothing from them"),
        ("predict report.json log.csv --time t --initial drop", 2, "leave out no rows"),
        ("filter report.json log.csv --time t --initial zero", 2, "says itself where it starts"),
        ("validate report.json log.csv --time t --require stable", 2, "stable"),
    ];
    for (line, code, words) in refusals {
        folder.assert_refused(line, code, words);
    }
}

#[test]
fn linear_equations_have_responses() {
    let (folder, report) = fitted("dc_motor", "1..1000", "");
    let constant = number(&report, "/model/parameters/0/value");
    let friction = number(&report, "/model/parameters/1/value");
    // 2 s are fifty times as long as the slowest mode lasts.
    let run = folder.done("step report.json --samples 201");
    let last = |output: &str| -> Vec<f64> {
        let own =
            run.stdout.lines().rfind(|line| line.starts_with(&format!("{output},u,"))).expect("it is there");
        own.split(',').skip(2).map(|field| field.parse().expect("a number")).collect()
    };
    assert!(run.stdout.starts_with("output,input,time,value,standard_error\n"), "{}", run.stdout);
    let gain = constant / (1.5 * friction + constant * constant);
    assert!((last("speed")[1] / gain - 1.0).abs() < 1e-3, "{:?} {gain}", last("speed"));
    assert!((last("i")[1] / (gain * friction / constant) - 1.0).abs() < 1e-3, "{:?}", last("i"));
    assert!(last("speed")[2] > 0.0);
    let run = folder.done("bode report.json --frequencies 0.01..1 --points 2");
    let magnitude = run.stdout.lines().find(|line| line.starts_with("speed,u,0.01,")).expect("it is there");
    let magnitude: f64 = magnitude.split(',').nth(3).and_then(|field| field.parse().ok()).expect("a number");
    assert!((magnitude / gain - 1.0).abs() < 1e-3 && !run.stdout.contains("noise"), "{}", run.stdout);
    folder.done("fit --grey model.toml log.csv --time t --html page.html");
    assert!(folder.read("page.html").contains("Frequency response"));

    let (folder, _) = fitted("battery", "1..600", "--html page.html");
    for verb in ["bode", "step", "impulse"] {
        folder.assert_refused(&format!("{verb} report.json"), 3, "are not linear");
    }
    assert!(!folder.read("page.html").contains("Frequency response"));
}

#[test]
fn several_logs_begin_anew_and_clocks_may_be_irregular() {
    let (folder, _) = fitted("battery", "1..1200", "");
    let log = folder.read("log.csv");
    let rows: Vec<&str> = log.lines().collect();
    // Every seventh row is missing, and every third stamp is late; the second log is the first 600 rows.
    let late = |(index, row): (usize, &&str)| match row.split_once(',') {
        Some((time, rest)) if index % 3 == 1 => {
            let time: f64 = time.parse().expect("a time");
            format!("{},{rest}\n", time + 0.3)
        }
        _ => format!("{row}\n"),
    };
    let thinned = rows.iter().enumerate().filter(|(index, _)| *index == 0 || index % 7 != 3);
    folder.write("thin.csv", thinned.map(late).collect::<String>());
    folder.write("short.csv", rows[..601].join("\n"));
    folder.done("fit --grey model.toml short.csv short.csv --time t --report two.json");
    let two: Value = serde_json::from_str(&folder.read("two.json")).expect("it is JSON");
    assert_eq!(
        (&two["data"]["rows"], two["data"]["digests"].as_array().map(Vec::len)),
        (&1200.into(), Some(2))
    );
    assert_eq!(two["data"]["digests"][0], two["data"]["digests"][1]);
    // Either of them is known.
    let run = folder.done("validate two.json short.csv --time t --format json");
    let validation: Value = serde_json::from_str(&run.stdout).expect("it is JSON");
    assert_eq!(validation["in_sample"], "yes");
    folder.done("fit --grey model.toml thin.csv --time t --report thin.json");
    folder.done("validate thin.json thin.csv --time t --require 'white,fit@1>=95'");
    folder.done(
        "fit --grey model.toml thin.csv --time t --resample 1:linear --split 70/0/30 --report even.json",
    );
    let run = folder.run("compare thin.json even.json thin.csv --time t");
    assert_eq!(run.code, 0, "{}", run.stderr);
    // A model of polynomials needs an even clock.
    folder.assert_refused("fit thin.csv --time t -u i -y v --na 1 --nb 1", 3, "not uniform");
    folder.done("fit log.csv --time t -u i -y v --na 1 --nb 1 --report arx.json");
    folder.assert_refused("compare thin.json arx.json thin.csv --time t", 3, "arx.json");
}

#[test]
fn all_searches_find_the_largest_likelihood() {
    for name in ["dc_motor", "mass_spring_damper", "battery"] {
        let (_, usual) = fitted(name, "1..600", "");
        let search = &usual["estimation"]["search"];
        assert_eq!(search["algorithm"], "lm");
        for (algorithm, more) in
            [("gauss-newton", ""), ("newton", ""), ("gradient", " --step 1 --max-iterations 1000")]
        {
            let (_, found) = fitted(name, "1..600", &format!("--search {algorithm}{more}"));
            let own = &found["estimation"]["search"];
            assert_eq!(own["algorithm"], algorithm);
            assert_eq!(own["step"].is_object(), algorithm == "gradient");
            let reached = |report: &Value| number(report, "/estimation/log_likelihood");
            let difference = (reached(&found) - reached(&usual)).abs();
            assert!(difference < 1e-4, "{name} {algorithm}: {difference}");
        }
    }
}

#[test]
fn further_starts_find_a_lower_optimum() {
    let (folder, _) = fitted("mass_spring_damper", "1..400", "--starts 3 --seed 2");
    let one: Value = serde_json::from_str(&folder.read("report.json")).expect("it is JSON");
    let search = &one["estimation"]["search"];
    assert_eq!((search["reached"].as_array().map(Vec::len), &search["seed"]), (Some(4), &2.into()));
    let text = folder.read("report.json");
    folder.done(
        "fit --grey model.toml log.csv --time t --estimate 1..400 --starts 3 --seed 2 --report report.json",
    );
    assert_eq!(folder.read("report.json"), text);
    for (option, words) in [
        ("--step 1", "--search gradient"),
        ("--starts 20000", "starts"),
        ("--tolerance 0", "tolerance"),
        ("--select mdl", "does not work with --grey"),
    ] {
        let run = folder.run(&format!("fit --grey model.toml log.csv --time t {option}"));
        assert!(run.code == 2 && run.stderr.contains(words), "{}", run.stderr);
    }
}
