//! Controllers for models: designs, their loops, and what cannot be designed.

use serde_json::Value;

use crate::harness::{Folder, number};

const DEMO: &str = include_str!("../cli/demo/dc_motor.csv");
const FIT: &str = "fit log.csv --time t -u u -y y";

fn document(folder: &Folder, name: &str) -> Value {
    serde_json::from_str(&folder.read(name)).expect("a document")
}

#[test]
fn a_motor_gets_a_controller_by_each_design() {
    let folder = Folder::with_log(DEMO);
    folder.done(&format!("{FIT} --na 2 --nb 2 --report motor.json"));
    for (design, words) in [
        ("--poles 0.8,0.7", "poles at 0.8, 0.7"),
        ("--poles 0.7+0.2i,0.7-0.2i --observer 0.3", "poles at 0.7+0.2i, 0.7-0.2i"),
        ("--lqr 0.1", "linear-quadratic"),
        ("--minimum-variance --integrator no", "minimum variance"),
        ("--minimum-variance=0.01", "minimum variance, input weight 0.01"),
    ] {
        let run = folder.done(&format!(
            "control motor.json {design} --format json --responses r.csv --document c.json -o out.json"
        ));
        assert!(run.stdout.is_empty(), "{}", run.stdout);
        assert_eq!(folder.read("c.json"), folder.read("out.json"));
        let found = document(&folder, "c.json");
        assert!(found["design"].as_str().is_some_and(|text| text.contains(words)), "{found:#}");
        assert_eq!(found["closed_loop"]["stable"], true, "{found:#}");
        // Minimum variance without a weight bears little.
        let least = if design.contains("variance") { 0.8 } else { 1.0 };
        assert!(number(&found, "/robustness/stable_share") >= least, "{design}");
        assert!(number(&found, "/closed_loop/peak_sensitivity") > 1.0);
        assert!(number(&found, "/closed_loop/output_deviation") > 0.0);
        assert!(
            folder.read("r.csv").starts_with("time,setpoint_response,controller_output,load_response\n0")
        );
        let table = folder.done(&format!("control motor.json {design}")).stdout;
        assert!(
            table.contains("pole of the loop") && table.contains("models within the covariance"),
            "{table}"
        );
        // The same bytes again.
        folder.done(&format!("control motor.json {design} --document again.json"));
        assert_eq!(folder.read("c.json"), folder.read("again.json"));
    }
}

#[test]
fn states_processes_and_box_jenkins_models_have_controllers_too() {
    let folder = Folder::with_log(DEMO);
    folder.done(&format!("{FIT} --model ss --order 2 --report ss.json"));
    folder.done(&format!("{FIT} --model bj --nb 2 --nf 2 --nc 1 --nd 1 --report bj.json"));
    folder.done(&format!("{FIT} --structure p1d --report process.json"));
    for report in ["ss.json", "bj.json", "process.json"] {
        folder.done(&format!("control {report} --poles 0.8 --document c.json"));
        let found = document(&folder, "c.json");
        assert_eq!(found["closed_loop"]["stable"], true, "{report}");
        assert!((number(&found, "/closed_loop/static_gain") - 1.0).abs() < 1e-6, "{report}");
    }
}

#[test]
fn limits_are_in_the_unit_of_the_input_and_the_document_in_deviations() {
    let folder = Folder::with_log(DEMO);
    folder.done(&format!("{FIT} --na 2 --nb 2 --offset u=1 --report motor.json"));
    folder.done("control motor.json --poles 0.8 --limits -1..3 --document c.json");
    let found = document(&folder, "c.json");
    let level = found.pointer("/input/offset/value").or(found.pointer("/input/offset/level"));
    let level = level.and_then(Value::as_f64).unwrap_or(0.0);
    assert!((number(&found, "/controller/lowest") + level + 1.0).abs() < 1e-12, "{found:#}");
    assert!((number(&found, "/controller/highest") + level - 3.0).abs() < 1e-12);
}

#[test]
fn what_cannot_be_designed_is_told_and_nothing_is_written() {
    let folder = Folder::with_log(DEMO);
    folder.done(&format!("{FIT} --na 2 --nb 2 --report motor.json"));
    folder.done(&format!("{FIT} --narx poly --ny 1 --nu 1 --report narx.json"));
    folder.done("convert motor.json --to continuous -o continuous.json");
    let before = folder.names();
    for (line, code, words) in [
        ("control motor.json --poles x", 2, "write a pole as"),
        ("control motor.json --poles 1.5", 2, "not inside the unit circle"),
        ("control motor.json --poles 0.5+0.1i", 2, "conjugate"),
        ("control motor.json --poles 0.5,0.4,0.3,0.2,0.1", 2, "more than"),
        ("control motor.json --poles 0.5 --observer nan", 2, "write a pole as"),
        ("control motor.json --lqr 0", 2, "not a positive number"),
        ("control motor.json --lqr -1", 2, "not a positive number"),
        ("control motor.json --lqr inf", 2, "not a positive number"),
        ("control motor.json --minimum-variance=-1", 2, "not 0 or more"),
        ("control motor.json --lqr 1 --limits 3", 2, "LOW..HIGH"),
        ("control motor.json --lqr 1 --limits 3..1", 2, "no range"),
        ("control motor.json --lqr 1 --limits nan..1", 2, "no range"),
        ("control motor.json --lqr 1 --draws 0", 2, "outside"),
        ("control motor.json --lqr 1 -u v", 2, "none called 'v'"),
        ("control motor.json --lqr 1 --cancel-zeros", 2, "minimum variance cancels"),
        ("control narx.json --lqr 1", 2, "linear"),
        ("control continuous.json --lqr 1", 2, "continuous time"),
        ("control log.csv --lqr 1", 3, "not a thetahat report"),
        ("control nowhere.json --lqr 1", 5, "cannot be read"),
    ] {
        folder.assert_refused(&format!("{line} --responses r.csv --document c.json"), code, words);
        assert_eq!(folder.names(), before);
    }
}
