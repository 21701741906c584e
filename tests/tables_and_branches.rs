//! Models in equations with tables, branches and dead zones.

use std::fmt::Write;

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::Random;

/// The value of a parameter, and its standard error.
fn parameter(report: &Value, name: &str) -> (f64, f64) {
    let all = report["model"]["parameters"].as_array().into_iter().flatten();
    let own = all.into_iter().find(|parameter| parameter["name"] == name).expect("the parameter is there");
    (number(own, "/value"), number(own, "/standard_error"))
}

fn assert_found(report: &Value, truths: &[(&str, f64)]) {
    for (name, truth) in truths {
        let (value, error) = parameter(report, name);
        assert!((value - truth).abs() < 3.0 * error, "{name}: {value} with {error}, {truth}");
    }
}

fn report(folder: &Folder) -> Value {
    serde_json::from_str(&folder.read("report.json")).expect("it is JSON")
}

/// Gaussian, nearly: the sum of twelve uniform numbers.
fn normal(random: &mut Random) -> f64 {
    0.5 * random.signal(12).iter().sum::<f64>()
}

const OCV: [(f64, f64); 6] = [(0.0, 3.0), (0.1, 3.45), (0.3, 3.6), (0.6, 3.75), (0.9, 4.0), (1.0, 4.2)];

/// The voltage at rest, by straight lines.
fn at_rest(charge: f64) -> f64 {
    let piece = OCV.windows(2).find(|piece| charge <= piece[1].0).expect("a charge below 1");
    piece[0].1 + (charge - piece[0].0) / (piece[1].0 - piece[0].0) * (piece[1].1 - piece[0].1)
}

/// A cell of 0.02 Ohm that is discharged from 0.95 to nearly nothing.
fn cell() -> Folder {
    let mut random = Random::new(3);
    let (mut charge, mut current) = (0.95, 0.0);
    let mut log = String::from("t,i,v\n");
    for row in 0..900 {
        if row % 15 == 0 {
            let goal = 0.95 - 0.91 * f64::from(row + 15) / 900.0;
            current = (300.0 * (goal - charge) / 15.0 + 0.3 * random.uniform()).clamp(-2.0, 2.0);
            current = (current * 1e6).round() / 1e6;
        }
        let v = at_rest(charge) + 0.02 * current + 0.002 * normal(&mut random);
        writeln!(log, "{row},{current:.6},{v:.6}").expect("a string grows");
        charge += current / 300.0;
        assert!(charge > 0.02 && charge < 1.0, "{row} {charge}");
    }
    Folder::with_log(log)
}

/// The model of the cell, with more parameters and a voltage at rest.
fn model_of_cell(parameters: &str, table: &str) -> String {
    format!(
        "sample_time = 1
         [states]
         soc = {{ start = 0.95, sd = 0 }}
         [inputs]
         current = 'i'
         [parameters]
         r0 = {{ start = 0.1, sd = 0.1, unknown = true, min = 0 }}
         {parameters}
         [next]
         soc = 'soc + dt * current / 300'
         [outputs]
         v = '{table} + r0 * current'
         [noise]
         measurement = {{ v = 0.002 }}"
    )
}

#[test]
fn a_table_of_a_cell_is_known_or_found() {
    let folder = cell();
    let values: Vec<String> = OCV.iter().map(|(charge, voltage)| format!("{charge}:{voltage}")).collect();
    folder.write("known.toml", model_of_cell("", &format!("lines(soc; {})", values.join(", "))));
    folder.done("fit --grey known.toml log.csv --time t --report report.json");
    assert_found(&report(&folder), &[("r0", 0.02)]);

    let unknown: Vec<String> =
        (0..6).map(|i| format!("v{i} = {{ start = 3.7, sd = 0.5, unknown = true }}")).collect();
    let values: Vec<String> = OCV.iter().zip(0..).map(|((charge, _), i)| format!("{charge}:v{i}")).collect();
    let table = |name: &str| {
        let table = format!("{name}(soc; {})", values.join(", "));
        model_of_cell(&unknown.join("\n         "), &table)
    };
    folder.write("found.toml", table("lines"));
    folder.done("fit --grey found.toml log.csv --time t --report report.json");
    let found = report(&folder);
    assert_found(&found, &[("r0", 0.02)]);
    for (i, (_, voltage)) in OCV.iter().enumerate() {
        assert_found(&found, &[(&format!("v{i}"), *voltage)]);
    }
    let lines = number(&found, "/estimation/log_likelihood");
    // Cubics through unknown values are fitted too; the cell has lines, so they do worse, and little.
    folder.write("cubic.toml", table("table"));
    folder.done("fit --grey cubic.toml log.csv --time t --report report.json");
    let cubic = report(&folder);
    assert!(number(&cubic, "/estimation/log_likelihood") < lines);
    assert!((parameter(&cubic, "r0").0 - 0.02).abs() < 0.01);
    // Every verb takes them, and a filter finds the same resistance.
    folder.done("validate report.json log.csv --time t");
    folder.done("predict report.json log.csv --time t --horizon 5");
    folder.done("filter report.json log.csv --time t");
    let run = folder.done("filter known.toml log.csv --time t --format csv");
    let row = run.stderr.lines().find(|line| line.starts_with("r0 ")).expect("its parameter").to_owned();
    let resistance: f64 = row.split_whitespace().nth(1).and_then(|cell| cell.parse().ok()).expect("a number");
    assert!((resistance - 0.02).abs() < 0.002, "{row}");
}

/// A valve that lets nothing through between -0.2 and 0.3.
#[test]
fn a_dead_zone_of_a_valve_is_found() {
    let mut random = Random::new(11);
    let (mut flow, mut u) = (0.0, 0.0);
    let mut log = String::from("t,u,y\n");
    for row in 0..800 {
        if row % 10 == 0 {
            u = random.uniform();
        }
        let y: f64 = flow + 0.02 * normal(&mut random);
        writeln!(log, "{row},{u},{y}").expect("a string grows");
        flow = 0.8 * flow + 0.5 * ((u - 0.3_f64).max(0.0) + (u + 0.2_f64).min(0.0));
    }
    let folder = Folder::with_log(log);
    let truths = [("low", -0.2), ("high", 0.3), ("gain", 0.5)];
    for through in [
        "dead(command, low, high)",
        "command - sat(command, low, high)",
        "(if command > high then command - high else if command < low then command - low else 0)",
        // A smooth one over a width that is below the noise.
        "dead(command, low, high within 0.005)",
    ] {
        folder.write(
            "valve.toml",
            format!(
                "sample_time = 1
                 [states]
                 flow = {{ start = 0, sd = 0.01 }}
                 [inputs]
                 command = 'u'
                 [parameters]
                 low = {{ start = -0.1, sd = 0.2, unknown = true, max = 0 }}
                 high = {{ start = 0.1, sd = 0.2, unknown = true, min = 0 }}
                 gain = {{ start = 1, sd = 1, unknown = true }}
                 [next]
                 flow = '0.8 * flow + gain * ({through})'
                 [outputs]
                 y = 'flow'
                 [noise]
                 process = {{ flow = 0.001 }}
                 measurement = {{ y = 0.02 }}"
            ),
        );
        folder.done("fit --grey valve.toml log.csv --time t --report report.json");
        assert_found(&report(&folder), &truths);
    }
}

#[test]
fn what_is_wrong_with_a_table_has_line_and_column() {
    let folder = cell();
    for (table, place) in [
        ("lines(soc; 0:3, 0:4)", "line 12, column 31: the knots of a table must rise, but 0 follows 0"),
        ("(if soc > 0.5 then 1)", "line 12, column 35: 'else' is missing, here is ')'"),
        (
            "dead(soc, 1, 0)",
            "line 12, column 15: 'dead' is from 1 to 0: the first limit must be the lower one",
        ),
    ] {
        folder.write("wrong.toml", model_of_cell("", table));
        let run = folder.run("fit --grey wrong.toml log.csv --time t");
        assert!(run.code != 0 && run.stderr.contains(place), "{}", run.stderr);
    }
}
