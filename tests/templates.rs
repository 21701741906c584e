//! Plants that are ready: from a log to the table, the text of the model, and what is said where that fails.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Folder, number};

/// A folder with the log of a template.
fn with(name: &str) -> Folder {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/templates");
    Folder::with_log(fs::read(data.join(format!("{name}.csv"))).expect("its log"))
}

#[test]
fn a_template_and_the_text_that_it_writes_are_the_same_model() {
    let folder = with("tank");
    let direct = folder.done("fit --grey template:tank log.csv --estimate 1..400 --report direct.json");
    assert!(direct.stdout.contains("outlet_area") && direct.stdout.contains("m^2.5/s"), "{}", direct.stdout);
    folder.write("tank.toml", folder.done("templates tank log.csv --estimate 1..400").stdout);
    let again = folder.done("fit --grey tank.toml log.csv --estimate 1..400 --report again.json");
    assert_eq!(again.stdout, direct.stdout);
    assert_eq!(folder.read("again.json"), folder.read("direct.json"));
    let report: Value = serde_json::from_str(&folder.read("direct.json")).expect("it is JSON");
    assert_eq!(report["model"]["figures"][0]["name"], "time_constant");
    assert!(number(&report, "/model/figures/0/standard_error") > 0.0);
    folder.done("fit --grey template:tank log.csv --html page.html");
    assert!(folder.read("page.html").contains("outlet_area"));
}

#[test]
fn columns_are_named_or_recognised_and_what_was_taken_is_said() {
    let folder = with("pendulum");
    let told = folder.done("fit --grey template:pendulum log.csv --columns angle=angle,torque=torque");
    assert!(!told.stderr.contains("angle is column"), "{}", told.stderr);
    let log = folder.read("log.csv").replacen("t,angle,torque", "t,Theta [rad],u", 1);
    folder.write("log.csv", log);
    let told = folder.done("fit --grey template:pendulum log.csv");
    assert!(told.stderr.contains("angle is column 'Theta [rad]', torque is column 'u'"), "{}", told.stderr);
    let known = folder.done("fit --grey template:pendulum log.csv --known length=0.5,gravity=9.81");
    assert!(!known.stdout.contains("\nlength"), "{}", known.stdout);
}

#[test]
fn what_is_wrong_is_said() {
    let folder = with("mechanism");
    folder.write("none.csv", "t,a,b\n0,1,2\n1,2,3\n2,3,1\n");
    for (words, code, said) in [
        ("fit --grey template:batery log.csv", 2, "there is no template 'batery'; did you mean 'battery'?"),
        ("fit --grey template:battery", 2, "name the logs to fit battery to"),
        ("fit --grey template:battery none.csv", 3, "wants current [A], voltage [V]; the log has t, a, b"),
        (
            "fit --grey template:battery none.csv --columns current=a,voltage=c",
            3,
            "the log has no column 'c'",
        ),
        ("fit --grey template:mechanism log.csv --columns voltage", 2, "write it as ROLE=COLUMN"),
        ("fit --grey template:mechanism log.csv --known kS=x", 2, "'x' is no finite number"),
        ("fit --grey template:mechanism log.csv --known kQ=1", 2, "--known: mechanism has no 'kQ'"),
        (
            "fit --grey template:mechanism log.csv --columns velocity=voltage,voltage=velocity",
            4,
            "which no mechanism has",
        ),
        ("fit log.csv --known a=1", 2, "--known goes with --grey"),
        ("fit --grey model.toml log.csv --columns a=b", 2, "--columns is for templates"),
        ("fit --grey model.toml", 2, "name the logs"),
        ("templates nothing", 2, "there is no template 'nothing'"),
        ("templates tank log.csv --estimate 0", 2, "--estimate"),
        ("templates mechanism log.csv --estimate 1..100000", 3, "--estimate"),
    ] {
        let run = folder.run(words);
        assert_eq!(run.code, code, "{words}: {}", run.stderr);
        assert!(run.stderr.contains(said) && run.stdout.is_empty(), "{words}: {}", run.stderr);
    }
}

#[test]
fn each_template_says_what_it_wants() {
    let folder = Folder::new();
    let list = folder.done("templates").stdout;
    let names: Vec<&str> =
        list.lines().take_while(|line| !line.is_empty()).filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(names.len(), 13);
    for name in names {
        let summary = folder.done(&format!("templates {name}")).stdout;
        assert!(
            summary.starts_with(&format!("{name}: ")) && summary.contains("parameters that are found"),
            "{summary}"
        );
    }
}
