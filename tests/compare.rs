//! `thetahat compare`: several stored models side by side on a log.

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::{Experiment, Random, csv, response};

fn folder() -> Folder {
    let folder = Folder::with_log(Experiment::new(600).csv());
    for (name, model) in [
        ("arx", "--na 2 --nb 2"),
        ("wrong", "--na 1 --nb 1 --nk 2"),
        ("oe", "--model oe --nb 2 --nf 2"),
        ("ar", "--na 2 --nb 0"),
    ] {
        folder.done(&format!("fit log.csv --estimate 1..300 {model} --report {name}.json"));
    }
    folder
}

#[test]
fn each_model_is_as_validate_has_it() {
    let folder = folder();
    let words = "log.csv --rows 301..600 --format json";
    let run = folder.done(&format!("compare arx.json wrong.json oe.json ar.json {words}"));
    let comparison: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(comparison["schema"], "thetahat.comparison/1");
    for (position, model) in ["arx", "wrong", "oe", "ar"].iter().enumerate() {
        let own = folder.done(&format!("validate {model}.json {words}"));
        assert_eq!(
            comparison["models"][position],
            serde_json::from_str::<Value>(&own.stdout).unwrap(),
            "{model}"
        );
        for warning in own.stderr.lines() {
            let expected = warning.replace("warning: ", &format!("warning: {model}.json: "));
            assert!(run.stderr.contains(&expected), "{expected}: {}", run.stderr);
        }
    }
}

#[test]
fn the_table_has_a_column_for_each_model() {
    let folder = folder();
    let run = folder.done("compare arx.json wrong.json oe.json ar.json log.csv --rows 301..600 --horizon 3");
    let line = |start: &str| {
        let line = run.stdout.lines().find(|line| line.trim_start().starts_with(start));
        line.unwrap_or_else(|| panic!("{start}:\n{}", run.stdout)).trim().to_owned()
    };
    assert!(run.stdout.starts_with("log.csv rows 301..600\n\n"), "{}", run.stdout);
    let words =
        |start: &str| line(start)[start.len()..].split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(words(""), ["log.csv", "rows", "301..600"]);
    assert_eq!(words("arx.json"), ["wrong.json", "oe.json", "ar.json"]);
    assert_eq!(line("model")[5..].trim().split("  ").filter(|word| !word.is_empty()).count(), 4);
    assert_eq!(words("parameters"), ["4", "2", "4", "2"]);
    assert_eq!(words("stable"), ["yes", "yes", "yes", "yes"]);
    assert_eq!(words("fitted to these rows"), ["no", "no", "no", "no"]);
    assert_eq!(words("fit [%], free run").last().unwrap(), "-");
    assert_eq!(words("independence p-value, u").last().unwrap(), "-");
    for start in [
        "orders",
        "fit [%], 1 step ahead",
        "fit [%], 3 steps ahead",
        "mean square error",
        "of that expected",
        "Ljung-Box p-value",
        "Anderson: stops at alpha",
        "95 % intervals hold [%]",
    ] {
        line(start);
    }
    assert!(run.stdout.ends_with("need not be white (output error, instrumental variables): oe.json\n"));
    let stops = words("Anderson: stops at alpha");
    // The wrong one stops first.
    assert_eq!(stops[1], "0.001");
}

#[test]
fn models_of_other_inputs_and_rates_are_compared_or_refused() {
    let mut random = Random::new(21);
    let (u, v) = (random.signal(400), random.signal(400));
    let e: Vec<f64> = random.signal(400).iter().map(|e| 0.1 * e).collect();
    let y = response(&[1.0, -0.7], &[(&[0.0, 1.0], &u), (&[0.0, 0.5], &v)], &e);
    let folder = Folder::with_log(csv(&[("u", &u), ("v", &v), ("y", &y)]));
    folder.done("fit log.csv -u u,v --na 1 --nb 1 --report both.json");
    folder.done("fit log.csv -u u --na 1 --nb 1 --report one.json");
    folder.done("fit log.csv -u u --na 1 --nb 1 --sample-time 2 --report slow.json");
    let run = folder.done("compare one.json both.json log.csv --format json");
    let comparison: Value = serde_json::from_str(&run.stdout).unwrap();
    let fit = |model: usize| number(&comparison, &format!("/models/{model}/fit/2/percent"));
    assert!(fit(1) > fit(0));
    let table = folder.done("compare one.json both.json log.csv").stdout;
    let line = table.lines().find(|line| line.starts_with("independence p-value, v")).unwrap();
    assert!(line.contains("  -  "), "{line}");
    let line = folder.refused("compare both.json slow.json log.csv", 3);
    assert!(line.contains("slow.json") && line.contains("sample time"), "{line}");
}

#[test]
fn command_lines_that_make_no_sense() {
    let folder = folder();
    for (words, code, part) in [
        ("arx.json", 2, "LOG"),
        ("", 2, "REPORT"),
        ("- - log.csv", 2, "only one"),
        ("arx.json - -", 2, "only one"),
        ("arx.json oe.json log.csv -o oe.json", 2, "replaced"),
        ("arx.json log.csv log.csv", 3, "not a thetahat report"),
        ("arx.json nowhere.json log.csv", 5, "nowhere.json"),
    ] {
        let run = folder.run(&format!("compare {words}"));
        assert_eq!((run.code, run.stdout.as_str()), (code, ""), "{words}: {}", run.stderr);
        assert!(run.stderr.contains(part), "{words}: {}", run.stderr);
    }
    assert_eq!(folder.run_on("compare - arx.json log.csv", folder.read("oe.json")).code, 0);
    folder.done("compare arx.json arx.json log.csv -o out.json");
    assert!(folder.read("out.json").starts_with("{\n  \"schema\": \"thetahat.comparison/1\""));
}
