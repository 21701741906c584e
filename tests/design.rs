//! Test signals, and what experiments with them are worth.

use serde_json::Value;

use crate::harness::{Folder, number, numbers};
use crate::signals::{Experiment, Random, csv, plain_log};

/// The columns of a CSV by their names.
fn columns(text: &str) -> Vec<(String, Vec<f64>)> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names: Vec<String> = reader.headers().expect("there is a header").iter().map(str::to_owned).collect();
    let rows: Vec<Vec<f64>> = reader.deserialize().map(|row| row.expect("numbers")).collect();
    let column = |(at, name)| (name, rows.iter().map(|row: &Vec<f64>| row[at]).collect());
    names.into_iter().enumerate().map(column).collect()
}

#[test]
fn a_prbs_has_its_levels_its_clock_and_its_period() {
    let folder = Folder::new();
    let run = folder.done("design --signal prbs:2 --length 62 --range 20..60 --sample-time 0.5");
    let columns = columns(&run.stdout);
    assert_eq!(columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["t", "u"]);
    let (t, u) = (&columns[0].1, &columns[1].1);
    assert_eq!((t[0], t[1], t[61], u.len()), (0.0, 0.5, 30.5, 62));
    // 16 of the low level and 15 of the high one, two samples each.
    assert_eq!(u.iter().filter(|u| **u == 20.0).count(), 32);
    assert_eq!(u.iter().filter(|u| **u == 60.0).count(), 30);
    assert!(u.chunks(2).all(|pair| pair[0] == pair[1]));
    assert!(run.stderr.starts_with("prbs:2: 62 samples, period 62\nu: mean "), "{}", run.stderr);
    assert!(run.stderr.contains("crest factor 1.03"), "{}", run.stderr);
    assert!(run.stderr.contains("order of persistent excitation 15 or more"), "{}", run.stderr);
}

#[test]
fn every_kind_is_written_and_the_seed_decides() {
    let folder = Folder::new();
    for kind in ["prbs", "rbs", "multisine", "chirp", "white", "sines", "steps"] {
        let line = format!("design --signal {kind} --length 600 --channels 2 --range -3..5");
        let run = folder.done(&line);
        assert_eq!(folder.done(&line).stdout, run.stdout, "{kind}");
        let mut one_thread = folder.command(&line);
        one_thread.env("RAYON_NUM_THREADS", "1");
        assert_eq!(String::from_utf8_lossy(&one_thread.output().expect("it runs").stdout), run.stdout);
        let columns = columns(&run.stdout);
        assert_eq!(columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["t", "u1", "u2"]);
        assert!(columns[1..].iter().all(|(_, u)| u.iter().all(|u| (-3.0..=5.0).contains(u))), "{kind}");
        let other = folder.done(&format!("{line} --seed 1")).stdout;
        assert_eq!(other == run.stdout, ["chirp", "sines", "steps"].contains(&kind), "{kind}");
    }
}

#[test]
fn a_fit_finds_the_signal_as_its_input() {
    // What is designed can be logged: a column more, and the plant is found.
    let folder = Folder::new();
    folder.done("design --length 500 -o input.csv");
    let u = columns(&folder.read("input.csv")).remove(1).1;
    let mut random = Random::new(3);
    let e = random.signal(u.len());
    let mut y = vec![0.0];
    (1..u.len()).for_each(|t| y.push(0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.01 * e[t]));
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv --na 1 --nb 1");
    let a1 = report["model"]["a"][1].as_f64().expect("a number");
    assert!((a1 + 0.8).abs() < 0.01, "{a1}");
}

#[test]
fn the_spectrum_goes_to_a_file() {
    let folder = Folder::new();
    folder.done("design --signal multisine --band 0.5..1 --length 1024 --spectrum spectrum.csv -o input.csv");
    let columns = columns(&folder.read("spectrum.csv"));
    assert_eq!(columns[0].0, "frequency");
    let power = |inside: bool| -> f64 {
        let points = columns[0].1.iter().zip(&columns[1].1);
        points.filter(|(w, _)| (0.45..1.05).contains(*w) == inside).map(|(_, density)| density).sum()
    };
    assert!(power(false) < 1e-3 * power(true));
}

/// A folder with the report of a slow plant in it, called model.json.
fn modelled() -> Folder {
    let (mut random, mut y) = (Random::new(5), vec![0.0]);
    let (u, e) = (random.signal(2000), random.signal(2000));
    for t in 1..2000 {
        y.push(0.95 * y[t - 1] + 0.5 * u[t - 1] + 0.5 * e[t]);
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done("fit log.csv --sample-time 0.5 --na 1 --nb 1 --report model.json");
    folder
}

#[test]
fn signals_side_by_side_tell_that_the_best_differs_by_purpose() {
    let folder = modelled();
    let line = "design --for model.json --signal prbs,prbs:4,steps --want dc-gain:2%,b1:0.02";
    let text = folder.done(&format!("{line} --format json")).stdout;
    let found: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((found["schema"].as_str(), found["length"].as_u64()), (Some("thetahat.design/1"), Some(1023)));
    let errors: Vec<Vec<f64>> = (0..3).map(|k| numbers(&found["signals"][k]["standard_errors"])).collect();
    assert!(errors[0][0] > errors[1][0] && errors[1][0] > errors[2][0], "{errors:?}");
    assert!(errors[0][1] < errors[1][1] && errors[1][1] < errors[2][1], "{errors:?}");

    let table = folder.done(line).stdout;
    let row = |name: &str| table.lines().find(|line| line.starts_with(name)).expect("a row").to_owned();
    // A star at the least error of a column: of b1 the fast PRBS, of the gain the step.
    assert_eq!((row("prbs ").matches('*').count(), row("steps ").matches('*').count()), (1, 1), "{table}");
    assert!(table.contains("(wanted)") && table.contains("samples needed"), "{table}");
    let needed = found["signals"][0]["needed"].as_u64().expect("a length");
    // That long, both errors are as small as was wanted.
    let line = format!(
        "design --for model.json --signal prbs --want dc-gain:2%,b1:0.02 --length {needed} --period 1023"
    );
    let longer: Value =
        serde_json::from_str(&folder.done(&format!("{line} --format json")).stdout).expect("JSON");
    for (figure, error) in numbers(&longer["signals"][0]["standard_errors"]).iter().enumerate() {
        assert!(*error <= number(&longer, &format!("/figures/{figure}/limit")), "{figure}: {error}");
    }
    assert!(needed > 1023);
}

#[test]
fn without_signals_all_are_compared_and_without_wants_all_figures() {
    let folder = modelled();
    let text = folder.done("design --for model.json --format json -o design.json").stdout;
    assert_eq!(text, "");
    let found: Value = serde_json::from_str(&folder.read("design.json")).expect("JSON");
    let names = |part: &str, name: &str| -> Vec<String> {
        let all = found[part].as_array().expect("a list").iter();
        all.map(|one| one[name].as_str().expect("a name").to_owned()).collect()
    };
    assert_eq!(names("figures", "name"), ["a1", "b1", "dc-gain", "time-constant"]);
    let all = ["prbs", "rbs", "multisine", "chirp", "white", "sines", "steps"];
    assert_eq!(names("signals", "signal"), all);
    assert!(found["signals"].as_array().expect("a list").iter().all(|signal| signal["needed"].is_null()));
    // A power budget of half the amplitude doubles the errors of what the input alone tells.
    let rms = |rms: f64| -> f64 {
        let line = format!("design --for model.json --signal rbs --rms {rms} --format json");
        let found: Value = serde_json::from_str(&folder.done(&line).stdout).expect("JSON");
        found["signals"][0]["standard_errors"][1].as_f64().expect("a number")
    };
    assert!((rms(0.1) / rms(0.2) - 2.0).abs() < 0.05);
    // A band is of those signals that have one.
    folder.done("design --for model.json --signal prbs,multisine --band 0.1..1");
    assert_eq!(folder.done("schema design").code, 0);
}

#[test]
fn what_makes_no_sense_is_one_sentence_and_nothing_is_written() {
    let folder = modelled();
    for (options, part) in [
        ("--signal saw", "--signal: 'saw' is none of prbs, rbs"),
        ("--signal prbs:0", "from 1 on"),
        ("--signal prbs,rbs", "--signal: one signal is written at a time"),
        ("--signal multisine:4", "--band makes it slower"),
        ("--length 0", "--length: 0"),
        ("--length 99999999999", "--length: 99999999999 samples"),
        ("--length 100 --period 101", "--period: 101 samples"),
        ("--channels 0", "--channels: 0"),
        ("--range 1..1", "--range: 1 to 1"),
        ("--range 1", "--range: '1': write it as LOW..HIGH"),
        ("--range nan..1", "--range: 'nan..1': write it as LOW..HIGH"),
        ("--band 0.1..1", "--band: a prbs signal has no band"),
        ("--signal chirp --band 1..4", "half the sampling frequency"),
        ("--signal chirp --points 4", "--points: a chirp signal"),
        ("--rms -1", "--rms: -1"),
        ("--sample-time 0", "--sample-time: 0"),
        (
            "--for model.json --want a9:1",
            "--want: the model has no 'a9'; there are: a1, b1, dc-gain, time-constant",
        ),
        ("--for model.json --want a1", "--want: 'a1': write a figure and its standard error"),
        ("--for model.json --channels 2", "--channels: there are 2 for the inputs of the model"),
        ("--for model.json --sample-time 1", "the model's is 0.5; leave it out"),
        ("--for model.json --signal prbs --band 0.1..1", "--band: none of these signals has one"),
    ] {
        folder.assert_refused(&format!("design {options} -o out.csv"), 2, part);
    }
    for options in ["--want a1:1", "--for model.json --spectrum s.csv"] {
        assert_eq!(folder.run(&format!("design {options}")).code, 2, "{options}");
    }
    folder.assert_refused("design --for nowhere.json", 5, "nowhere.json: ");
    folder.assert_refused("design --for log.csv", 3, "log.csv: this is not a thetahat report");
    assert!(!folder.names().contains(&"out.csv".to_owned()));
    let report = folder.read("model.json");
    folder.refused("design --for model.json -o model.json", 2);
    assert_eq!(folder.read("model.json"), report);
}

#[test]
fn models_of_other_kinds_and_without_inputs_are_refused() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --narx poly --report nonlinear.json");
    let line = folder.refused("design --for nonlinear.json", 3);
    assert!(line.contains("nonlinear.json: ") && line.contains("the plan of an experiment"), "{line}");
    folder.write("series.csv", csv(&[("y", &Experiment::new(200).y)]));
    folder.done("fit series.csv --model ar --na 2 --report series.json");
    folder.assert_refused("design --for series.json", 3, "series.json: the model has no inputs");
}
