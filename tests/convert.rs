//! Models at other sample times and in continuous time.

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::Random;

const MOTOR: &str = "log.csv --time t -u u -y i,speed";

/// A motor's log at 0.01 s, and every second row of it.
fn motor() -> Folder {
    let text = include_str!("data/dc_motor.csv");
    let folder = Folder::with_log(text);
    let (head, rows) = text.split_once('\n').expect("a header");
    let kept: Vec<&str> = std::iter::once(head).chain(rows.lines().step_by(2)).collect();
    folder.write("slow.csv", kept.join("\n"));
    folder
}

fn document(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

/// The largest difference of the numbers of two documents that are alike.
fn farthest(one: &Value, other: &Value) -> f64 {
    match (one, other) {
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            one.iter().zip(other).map(|(one, other)| farthest(one, other)).fold(0.0, f64::max)
        }
        _ => one.as_f64().zip(other.as_f64()).map_or(f64::INFINITY, |(one, other)| (one - other).abs()),
    }
}

/// The fits of the outputs in a free run, in percent.
fn fits(folder: &Folder, line: &str) -> Vec<f64> {
    let found = document(&folder.done(&format!("{line} --format json")).stdout);
    let free = |fit: &&Value| fit["horizon"]["kind"] == "free-run";
    let fits = found["fit"].as_array().expect("a list").iter().filter(free);
    fits.map(|fit| fit["percent"].as_f64().expect("a number")).collect()
}

#[test]
fn continuous_time_is_there_and_back() {
    let folder = motor();
    folder.done(&format!("fit {MOTOR} --order 2 --report r.json"));
    let there = folder.done("convert r.json --to continuous --out c.json");
    assert!(there.stderr.contains("converted from a sample time of 0.01 s to continuous time with zoh"));
    for words in [
        "continuous state space of order 2",
        "natural frequency",
        "damping",
        "G(s) from u to speed",
        "stable",
    ] {
        assert!(there.stdout.contains(words), "{words}: {}", there.stdout);
    }
    // A denominator begins with 1, which is not written.
    assert!(there.stdout.contains(")/(s^2 + "), "{}", there.stdout);
    let continuous = document(&folder.read("c.json"));
    assert_eq!(
        (&continuous["model"]["kind"], &continuous["model"]["hold"], &continuous["fit"]),
        (&"continuous-state-space".into(), &"zoh".into(), &serde_json::json!([]))
    );
    assert!(number(&continuous, "/model/poles/0/re") < 0.0);
    // To standard output the report alone.
    let printed = folder.done("convert r.json --to continuous --out -");
    assert_eq!(printed.stdout, folder.read("c.json"));
    assert_eq!(folder.done("convert r.json --to continuous --format json").stdout, printed.stdout);
    folder.done("convert c.json --to 0.01 -o b.json");
    let (own, back) = (document(&folder.read("r.json")), document(&folder.read("b.json")));
    for name in ["f", "g", "h", "d", "k", "noise_covariance", "dc_gain"] {
        let (one, other) = (&own["model"][name], &back["model"][name]);
        if name == "dc_gain" {
            let value = |model: &Value| number(model, "/model/dc_gain/1/0/value");
            assert!((value(&own) / value(&back) - 1.0).abs() < 1e-9);
        } else {
            assert!(farthest(one, other) < 1e-9, "{name}");
        }
    }
    // A report from a pipe.
    assert!(folder.done("convert c.json --to 0.02 --hold tustin").stdout.contains("sample time 0.02 s"));
}

#[test]
fn a_model_in_continuous_time_goes_with_any_log() {
    let folder = motor();
    folder.done(&format!("fit {MOTOR} --order 2 --report r.json"));
    folder.done("convert r.json --to continuous -o c.json");
    folder.done("convert r.json --to 0.02 -o s.json");
    let at = |report: &str, log: &str| fits(&folder, &format!("validate {report} {log} --time t"));
    let apart = |one: Vec<f64>, other: Vec<f64>| -> f64 {
        assert_eq!((one.len(), other.len()), (2, 2));
        one.iter().zip(&other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
    };
    assert!(apart(at("c.json", "log.csv"), at("r.json", "log.csv")) < 1e-6);
    assert!(apart(at("c.json", "slow.csv"), at("s.json", "slow.csv")) < 1e-6);
    folder.assert_refused(
        "validate r.json slow.csv --time t",
        3,
        "resample the log, convert the model, or fit one to it",
    );
    // Other verbs.
    for line in [
        "predict c.json slow.csv --time t --horizon 5 --out p.csv",
        "simulate c.json slow.csv --time t --out p.csv",
        "compare c.json s.json slow.csv --time t",
        "bode c.json --out b.csv",
        "step c.json --out s.csv",
        "impulse c.json --out i.csv --html i.html",
        "filter c.json log.csv --time t --out x.jsonl",
        "validate c.json slow.csv --time t --html v.html",
    ] {
        folder.done(line);
    }
    let one = folder.read("s.csv");
    folder.done("step r.json --out own.csv");
    let numbers = |text: &str| -> Vec<f64> {
        let cells = text.lines().skip(1).flat_map(|line| line.split(','));
        cells.filter_map(|cell| cell.parse().ok()).collect()
    };
    let (one, other) = (numbers(&one), numbers(&folder.read("own.csv")));
    let farthest = one.iter().zip(&other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    assert!(one.len() == other.len() && farthest < 1e-9, "{farthest}");
    folder.assert_refused("reduce c.json", 3, "convert it to a sample time first");
}

#[test]
fn polynomials_and_processes_are_converted_too() {
    let folder = motor();
    folder.done("fit log.csv --time t -u u -y speed --nb 2 --nk 3 --model oe --nf 2 --report p.json");
    let table = folder.done("convert p.json --to continuous -o c.json").stdout;
    assert!(table.contains("delay 0.02 s") && table.contains("e^(-0.02 s)"), "{table}");
    // A third of a delay of two samples is a part of one.
    assert!(folder.done("convert p.json --to 0.03 -o s.json").stdout.contains("order 3"));
    folder.assert_refused(
        "convert p.json --to 0.03 --hold foh -o x.json",
        2,
        "--to: the delay of 'u', 0.02 s, is 0.666667 samples",
    );
    let mut steps = "t,u,y\n".to_owned();
    for row in 0..400 {
        let time = 0.5 * f64::from(row);
        let u = f64::from((row / 80) % 2);
        let risen = if u > 0.0 { 1.0 - (-(time - 40.0 - 1.3).max(0.0) / 8.0).exp() } else { 0.0 };
        let noise = f64::from((row * 7919) % 101 - 50) * 1e-4;
        steps.push_str(&format!("{time},{u},{}\n", if time < 80.0 { 2.0 * risen + noise } else { noise }));
    }
    folder.write("steps.csv", steps);
    folder.done("fit steps.csv --time t -u u -y y --structure p1d --estimate 1..150 --report q.json");
    let table = folder.done("convert q.json --to continuous -o c.json").stdout;
    assert!(table.contains("continuous state space of order 1, delays 1."), "{table}");
    folder.done("convert q.json --to 0.4 -o s.json");
}

#[test]
fn what_has_no_counterpart_is_refused() {
    let folder = motor();
    folder.done(&format!("fit {MOTOR} --order 2 --report r.json"));
    for (line, words) in [
        ("convert r.json --to slow", "--to: 'slow' is neither"),
        ("convert r.json --to 0", "--to: '0' is neither"),
        ("convert r.json --to NaN", "--to: 'NaN' is neither"),
        ("convert r.json --to -1", "--to: '-1' is neither"),
        ("convert r.json --to 1 --hold ramp", "--hold: 'ramp' is none of zoh, foh and tustin"),
        ("convert r.json --to 0.02 -o r.json", "r.json"),
    ] {
        folder.assert_refused(line, 2, words);
    }
    folder.done("convert r.json --to continuous -o c.json");
    folder.assert_refused("convert c.json --to continuous", 2, "in continuous time already");
    folder.assert_refused("convert log.csv --to continuous", 3, "not a thetahat report");
    folder.done("fit log.csv --time t -u u -y speed --narx poly --report n.json");
    folder.assert_refused("convert n.json --to 1 -o x.json", 3, "are converted to other sample times");
    // y(t) = -0.5 y(t-1) + u(t-1).
    let (mut text, mut y, mut random) = ("u,y\n".to_owned(), 0.0, Random::new(1));
    for _ in 0..300 {
        let u = random.uniform();
        text.push_str(&format!("{u},{y}\n"));
        y = -0.5 * y + u;
    }
    folder.write("odd.csv", text);
    folder.done("fit odd.csv --sample-time 1 --na 1 --nb 1 --nk 1 --report o.json");
    folder.assert_refused(
        "convert o.json --to continuous -o x.json",
        4,
        "the pole -0.5 on the negative real axis has no real logarithm",
    );
    folder.assert_refused("convert o.json --to 1.5 -o x.json", 4, "o.json");
    // Two steps are one, and its pole is 0.25.
    folder.done("convert o.json --to 2 -o t.json");
    assert!((number(&document(&folder.read("t.json")), "/model/f/0/0") - 0.25).abs() < 1e-6);
    assert!(!folder.names().contains(&"x.json".to_owned()));
}
