//! Models in blocks: from a log to the table, the verbs that take the report, and what is said where that fails.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Folder, number};

/// A folder with a simulated log.
fn with(name: &str) -> Folder {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/blocks");
    Folder::with_log(fs::read(data.join(format!("{name}.csv"))).expect("its log"))
}

const VALVE: &str = "fit --blocks hammerstein log.csv -u valve -y flow --order 2 --nk 4 --knots 9";

#[test]
fn the_report_of_a_valve_is_one_of_equations() {
    let folder = with("valve");
    folder
        .done(&format!("{VALVE} --estimate 1..2000 --validate 2001..3000 --report r.json --html page.html"));
    let report: Value = serde_json::from_str(&folder.read("r.json")).expect("it is JSON");
    assert_eq!(report["model"]["kind"], "equations");
    assert_eq!(report["plan"]["blocks"], "hammerstein");
    assert!(number(&report, "/fit/1/percent") > 90.0);
    assert!(folder.read("page.html").contains("w_9"));
    // The plan says the same again.
    folder.write("plan.json", report["plan"].to_string());
    folder.done("fit --plan plan.json log.csv --report again.json");
    let again: Value = serde_json::from_str(&folder.read("again.json")).expect("it is JSON");
    assert_eq!(again["model"], report["model"]);
    for verb in [
        "predict r.json log.csv",
        "simulate r.json log.csv",
        "validate r.json log.csv",
        "filter r.json log.csv",
    ] {
        folder.done(verb);
    }
    folder.done("export r.json log.csv --to rust --what observer --name valve -o rust");
    folder.done("compare r.json again.json log.csv");
}

#[test]
fn options_of_blocks_go_together_or_are_refused() {
    let folder = with("valve");
    folder.write("still.csv", "t,valve,flow\n0,1,2\n1,1,3\n2,1,1\n3,1,4\n4,1,4\n5,1,4\n");
    folder.write("one.csv", "t,valve,flow\n0,1,2\n");
    for (words, code, said) in [
        ("fit --blocks wiener log.csv -u valve -y flow --na 2", 2, "--na"),
        ("fit --blocks wiener log.csv -u valve -y flow --narx poly", 2, "--narx"),
        ("fit --blocks wiener log.csv -u valve -y flow --order 1,0,1", 2, "write it as N or A..B"),
        ("fit --blocks wiener log.csv -u valve -y flow --order 0", 2, "from 1 to 10"),
        (
            "fit --blocks wiener log.csv -u valve -y flow --nk 1..3",
            2,
            "one delay for each input, or finds it",
        ),
        ("fit --blocks wiener log.csv -u valve -y flow --knots 5 --degree 3", 2, "they are of --curve lines"),
        ("fit --blocks wiener log.csv -u valve -y flow,t --sample-time 1", 2, "one output"),
        ("fit --blocks feedback log.csv -u valve -y flow --curve lines", 2, "a feedback takes poly"),
        ("fit --curve lines log.csv -u valve -y flow", 2, "--curve"),
        ("fit --blocks wiener still.csv -u valve -y flow", 4, "'valve' does not move in these rows"),
        ("fit --blocks wiener one.csv -u valve -y flow --sample-time 1", 4, "does not move"),
        ("fit --blocks wiener log.csv -u valve -y flown", 3, "flown"),
    ] {
        let clock = if words.contains("--sample-time") { "" } else { " --time t" };
        let refused = folder.refused(&format!("{words}{clock}"), code);
        assert!(refused.contains(said), "{words}: {refused}");
    }
}
