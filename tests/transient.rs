//! The step and impulse responses of a stored model.

use crate::harness::{Folder, number, numbers};
use crate::signals::{Random, csv, plain_log};

/// Input, time, value and its standard error of each row of the CSV.
fn rows(folder: &Folder, line: &str) -> Vec<(String, f64, f64, Option<f64>)> {
    let run = folder.done(line);
    assert_eq!(run.stderr, "");
    let mut reader = csv::Reader::from_reader(run.stdout.as_bytes());
    assert_eq!(
        reader.headers().expect("there is a header"),
        &["input", "time", "value", "standard_error"][..]
    );
    reader.deserialize().map(|row| row.expect("a name and numbers")).collect()
}

#[test]
fn impulses_are_those_of_the_polynomials_and_add_up_to_steps() {
    let folder = Folder::with_log(plain_log());
    let report = folder.fit("log.csv --sample-time 0.5 --na 2 --nb 2 --nk 1 --report model.json");
    let (a, b) = (numbers(&report["model"]["a"]), numbers(&report["model"]["b"][0]));
    let impulse = rows(&folder, "impulse model.json --samples 40");
    let step = rows(&folder, "step model.json --samples 40");
    assert_eq!((impulse.len(), step.len()), (40, 40));
    // A(q) g(t) = B(q) delta(t)
    let (mut g, mut sum) = (Vec::new(), 0.0);
    for t in 0..40 {
        let past: f64 = (1..=t.min(2)).map(|k| a[k] * g[t - k]).sum();
        g.push(b.get(t).unwrap_or(&0.0) - past);
        sum += g[t];
        assert_eq!((impulse[t].0.as_str(), impulse[t].1), ("u", 0.5 * t as f64));
        assert!((impulse[t].2 - g[t]).abs() < 1e-12 && (step[t].2 - sum).abs() < 1e-12, "{t}");
    }
    // Nothing is uncertain before the delay is over.
    assert_eq!(impulse[0].3, Some(0.0));
    assert_eq!(impulse[1].3, step[1].3);
    assert!(impulse[2..].iter().chain(&step[2..]).all(|row| row.3.is_some_and(|error| error > 0.0)));
}

#[test]
fn a_step_ends_at_the_static_gain_and_each_input_has_its_rows() {
    let folder = Folder::new();
    let mut random = Random::new(3);
    let (u1, u2) = (random.signal(300), random.signal(300));
    let mut y = vec![0.0; 300];
    for t in 1..300 {
        y[t] = 0.8 * y[t - 1] + 0.5 * u1[t - 1] - 0.2 * u2[t - 1] + 0.01 * random.uniform();
    }
    folder.write("log.csv", csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    let report = folder.fit("log.csv --na 1 --nb 1 --report model.json");
    let step = rows(&folder, "step model.json");
    for (index, input) in ["u1", "u2"].into_iter().enumerate() {
        let own: Vec<_> = step.iter().filter(|row| row.0 == input).collect();
        let gain = number(&report, &format!("/model/dc_gain/{index}/value"));
        assert!((own.last().unwrap().2 / gain - 1.0).abs() < 0.01);
    }
    folder.done("impulse model.json -o impulse.csv");
    assert_eq!(folder.read("impulse.csv"), folder.done("impulse model.json").stdout);
}

#[test]
fn what_has_no_such_response_is_refused() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 0 --report series.json");
    for verb in ["step", "impulse"] {
        folder.assert_refused(
            &format!("{verb} series.json"),
            3,
            &format!("series.json: the model has no inputs, so it has no {verb} response"),
        );
        folder.refused(&format!("{verb} nowhere.json"), 5);
        assert_eq!(folder.run(&format!("{verb} series.json --samples 0")).code, 2);
    }
}
