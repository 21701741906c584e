//! Plans: the options of a fit in its report and in a file, and fits that repeat them.

use serde_json::{Value, json};

use crate::harness::Folder;
use crate::signals::plain_log;

/// A fit with its report, and the same once more by the plan in it.
fn repeated(folder: &Folder, options: &str) -> (Value, Value) {
    let first = folder.planned(options);
    folder.write("first.json", first.to_string());
    folder.write("plan.json", first["plan"].to_string());
    folder.done("fit log.csv --plan first.json --report again.json");
    folder.done("fit log.csv --plan plan.json --report plain.json");
    assert_eq!(folder.read("again.json"), folder.read("plain.json"), "{options}");
    (first, serde_json::from_str(&folder.read("again.json")).expect("a report"))
}

#[test]
fn a_report_repeats_its_fit() {
    let folder = Folder::with_log(plain_log());
    for options in [
        "",
        "--na 2 --nb 2",
        "--model oe --nb 2 --nf 2 --starts 2 --seed 7 --norm huber:2 --split 70/0/30",
        "--model arx --na 1..3 --nb 1..2 --nk 0..2 --select aic --path alternate --detrend linear",
        "--model arx --na 2 --nb 2 --bound a1=-1.9..0 --dc-gain 0..9 --ridge 2 --offset y=0.5",
        "--model fir --taps 20 --kernel tc",
        "--model ss --order 2 --refine prediction --feedthrough no",
        "--structure p1d --initial zero --estimate 1..120,140..200",
        "--np 2 --nz 1 --delay",
        "--narx poly --ny 1 --nu 2 --degree 2 --terms 4 --raw-terms",
        "--narx tanh --units 2 --max-iterations 20 --starts 1",
        "--prefilter 0.01..0.4 --model oe --nb 1 --nf 1",
    ] {
        let line = format!("log.csv {options}");
        let (first, again) = repeated(&folder, &line);
        assert_eq!(first, again, "{options}");
    }
}

#[test]
fn options_beside_a_plan_come_in_the_place_of_its_own() {
    let folder = Folder::with_log(plain_log());
    folder.write("plan.json", r#"{"model": "arx", "na": 2, "nb": 2, "nk": 1, "estimate": "1..150"}"#);
    let report = folder.planned("log.csv --plan plan.json --na 1");
    assert_eq!(report, folder.planned("log.csv --model arx --na 1 --nb 2 --nk 1 --estimate 1..150"));
    assert_eq!(report["plan"]["na"], json!(1));
}

#[test]
fn a_plan_may_be_written_by_hand() {
    let folder = Folder::with_log(plain_log());
    let plan = json!({
        "model": "arx", "na": 2, "nb": [2], "offset": {"y": 1.5}, "bound": {"a1": [-2, 0], "b1": [null, 9]},
        "estimate": ["1..100", "120..200"], "norm": 2, "ridge": 1e-3,
    });
    folder.write("plan.json", plan.to_string());
    let report = folder.planned("log.csv --plan plan.json");
    let line = "log.csv --model arx --na 2 --nb 2 --offset y=1.5 --bound a1=-2..0 --bound b1=..9 --estimate 1..100,120..200 --norm 2 \
                --ridge 0.001";
    assert_eq!(report, folder.planned(line));
}

#[test]
fn plans_that_are_none_are_refused() {
    let folder = Folder::with_log(plain_log());
    for (plan, code, part) in [
        ("", 3, "no plan in JSON"),
        ("[1, 2]", 3, "an object of options"),
        (r#"{"na": 2"#, 3, "no plan in JSON"),
        (r#"{"detrned": "mean"}"#, 2, "did you mean 'detrend'?"),
        (r#"{"na": "many"}"#, 2, "--na: 'many' is not an order"),
        (r#"{"na": {"u": 2}}"#, 2, "--na: "),
        (r#"{"na": -1, "nb": 2}"#, 2, "--na: "),
        (r#"{"trend": "perhaps"}"#, 2, "--trend: "),
        (r#"{"ridge": "1e999"}"#, 2, "--ridge: "),
        (r#"{"nb": []}"#, 2, "--nb: there is none"),
        (r#"{"narx": "poly", "na": 2}"#, 2, "--na: does not work with --narx"),
        (r#"{"schema": "thetahat.validation/1"}"#, 3, "thetahat.validation/1"),
    ] {
        folder.write("plan.json", plan);
        let line = folder.refused("fit log.csv --plan plan.json --report model.json", code);
        assert!(line.contains(part), "{plan}: {line}");
        assert_eq!(folder.names(), ["log.csv", "plan.json"]);
    }
    let line = folder.refused("fit log.csv --plan plan.json --report plan.json", 2);
    assert!(line.contains("would be replaced"), "{line}");
    let line = folder.refused("fit log.csv --plan nowhere.json", 5);
    assert!(line.contains("nowhere.json"), "{line}");
}
