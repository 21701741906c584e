//! Models in equations as source code, the ready-made ones too.

use std::fs;
use std::path::Path;

use super::{goes_round, goes_round_once};
use crate::harness::Folder;
use crate::signals::Random;

/// Takes 10 s: six models in Rust and in C are compiled and run.
#[test]
fn models_in_equations_say_what_the_library_does() {
    let folder = Folder::with_log(include_str!("../data/dc_motor.csv"));
    folder.write(
        "motor.toml",
        "sample_time = 0.01
         [states]
         current = { start = 0, sd = 1 }
         speed = { start = 0, sd = 1 }
         [inputs]
         voltage = 'u'
         [parameters]
         resistance = { start = 1, sd = 1, unknown = true, min = 0 }
         inertia = { start = 0.02, sd = 0.02, unknown = true, min = 0 }
         [derivative]
         current = '(voltage - resistance * current - 0.1 * speed) / 0.05'
         speed = '(0.1 * current - 0.001 * speed * abs(speed) - 0.001 * tanh(speed) + 0 * t) / inertia'
         [outputs]
         i = 'current'
         speed = 'speed'
         [noise]
         process = { speed = 0.1 }
         measurement = { i = 0.1, speed = 0.1 }",
    );
    folder.done("fit --grey motor.toml log.csv --time t --report r.json");
    goes_round(&folder, "r.json", "log.csv --time t", &["simulator", "predictor", "observer"]);
    // One state and one output, of which no loop is made, and a step of the log in two.
    folder.write(
        "speed.toml",
        "sample_time = 0.01
         substeps = 2
         [states]
         speed = { start = 0, sd = 1 }
         [inputs]
         voltage = 'u'
         [parameters]
         gain = { start = 10, sd = 10, unknown = true }
         [derivative]
         speed = '10 * (gain * voltage - speed)'
         [outputs]
         speed = 'speed'
         [noise]
         process = { speed = 1 }
         measurement = { speed = 1 }",
    );
    folder.done("fit --grey speed.toml log.csv --time t --report r.json");
    goes_round(&folder, "r.json", "log.csv --time t", &["simulator", "predictor", "observer"]);
}

/// Takes 10 s: as above, with tables of known and found values, branches and limits.
#[test]
fn tables_and_branches_say_what_the_library_does() {
    let folder = Folder::with_log(include_str!("../data/dc_motor.csv"));
    folder.write(
        "motor.toml",
        "sample_time = 0.01
         [states]
         speed = { start = 0, sd = 1 }
         [inputs]
         voltage = 'u'
         [parameters]
         gain = { start = 10, sd = 10, unknown = true }
         low = { start = 0.5, sd = 1, unknown = true }
         middle = 2
         [next]
         speed = 'speed + dt * 10 * (table(dead(voltage, -0.1, 0.1); -9:-9, -2:-middle, 1:low, 9:9) * gain - speed)'
         [outputs]
         speed = 'speed + lines(speed; -20:0, 0:-0.1, 7:0.4) + if speed > 5 within 2 then 0.1 else sat(speed, -1, 1)'
         [noise]
         process = { speed = 1 }
         measurement = { speed = 1 }",
    );
    folder.done("fit --grey motor.toml log.csv --time t --max-iterations 3 --report r.json");
    goes_round(&folder, "r.json", "log.csv --time t", &["simulator", "predictor", "observer"]);
}

/// Equations of so many states and inputs, random but stable, with a log along which they run.
fn random_equations(seed: u64) -> (String, String) {
    let mut random = Random::new(seed);
    let mut below = |count: usize| random.below(count);
    let (states, inputs, outputs, substeps) = (1 + below(6), below(4), 1 + below(2), 1 + below(3));
    let kind = ["derivative", "next"][below(2)];
    let line = |text: &mut String, line: String| *text += &(line + "\n");
    let mut text = String::from("sample_time = 0.1\n");
    if kind == "derivative" {
        line(&mut text, format!("substeps = {substeps}"));
    }
    text += "[states]\n";
    (1..=states).for_each(|i| line(&mut text, format!("x{i} = {{ start = 0.{i}, sd = 1 }}")));
    text += "[inputs]\n";
    (1..=inputs).for_each(|i| line(&mut text, format!("u{i} = 'u{i}'")));
    text += "[parameters]\ngain = { start = 0.5, sd = 1, unknown = true }\n";
    line(&mut text, format!("[{kind}]"));
    for i in 1..=states {
        let other = 1 + below(states);
        let function = ["sin", "tanh", "atan", "abs"][below(4)];
        let driven =
            if inputs > 0 { format!(" + gain * u{}", 1 + below(inputs)) } else { " + gain".to_owned() };
        line(&mut text, format!("x{i} = '-0.{} * x{i} + 0.1 * {function}(x{other}){driven}'", 1 + below(8)));
    }
    text += "[outputs]\n";
    (1..=outputs).for_each(|i| line(&mut text, format!("y{i} = 'x{} + 0 * t'", 1 + below(states))));
    let each = |letter: char, count: usize, value: &str| {
        (1..=count).map(|i| format!("{letter}{i} = {value}")).collect::<Vec<_>>().join(", ")
    };
    let (process, measurement) = (each('x', states, "0.01"), each('y', outputs, "0.1"));
    line(&mut text, format!("[noise]\nprocess = {{ {process} }}\nmeasurement = {{ {measurement} }}"));

    let names = (1..=inputs).map(|i| format!("u{i}")).chain((1..=outputs).map(|i| format!("y{i}")));
    let mut log = format!("t,{}\n", names.collect::<Vec<_>>().join(","));
    for row in 0..60 {
        let cells = (0..inputs + outputs).map(|_| format!("{}", below(2001) as f64 / 1000.0 - 1.0));
        line(&mut log, format!("{:.1},{}", f64::from(row) * 0.1, cells.collect::<Vec<_>>().join(",")));
    }
    (text, log)
}

/// EXPORTS says how many; of each one purpose in one precision, in both languages.
#[test]
fn whatever_the_equations_what_is_exported_compiles_and_says_what_the_library_does() {
    let count = std::env::var("EXPORTS").map_or(4, |count| count.parse().expect("EXPORTS: a number"));
    for seed in 0..count {
        let (model, log) = random_equations(seed);
        let folder = Folder::with_log(log);
        folder.write("model.toml", &model);
        folder.done("fit --grey model.toml log.csv --time t --max-iterations 2 --report r.json");
        let purpose = ["observer", "predictor", "simulator"][seed as usize % 3];
        let precision = ["f64", "f32"][seed as usize / 3 % 2];
        goes_round_once(&folder, "r.json", "log.csv --time t", purpose, precision);
    }
}

/// Takes 30 s: what each template finds is compiled in Rust and C and run.
#[test]
fn templates_say_what_the_library_does() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/templates");
    for (name, purpose) in [
        ("motor", "predictor"),
        ("mechanism", "simulator"),
        ("elevator", "predictor"),
        ("arm", "simulator"),
        ("battery", "observer"),
        ("battery2", "simulator"),
        ("room", "predictor"),
        ("room2", "observer"),
        ("tank", "predictor"),
        ("pendulum", "simulator"),
        ("spring", "observer"),
        ("exchanger", "predictor"),
        ("multirotor", "simulator"),
    ] {
        let folder = Folder::with_log(fs::read(data.join(format!("{name}.csv"))).expect("its log"));
        folder.done(&format!("fit --grey template:{name} log.csv --max-iterations 3 --report r.json"));
        goes_round_once(&folder, "r.json", "log.csv", purpose, "f64");
    }
}
