//! `thetahat filter`: reference values, models in text files, and what a log may lack.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use serde_json::Value;

use crate::fit_reference::folder_with;
use crate::harness::{Answer, Folder, distance, number};
use crate::signals::{Experiment, Random, csv};
use crate::track::objects;

const NILE: &str = "sample_time = 1
states = ['level']
outputs = ['y']
F = [[1]]
H = [[1]]
Q = [[1469.1]]
R = [[15099]]
x0 = [0]
P0 = [[1e7]]
";

const ALPHA_BETA: &str = "sample_time = 1
states = ['position', 'velocity']
outputs = ['y']
F = [[1, 1], [0, 1]]
H = [[1, 0]]
# A constant acceleration of variance 1 over each sample.
Q = [[0.25, 0.5], [0.5, 1]]
R = [[1]]
P0 = [[100, 0], [0, 100]]
";

/// One of the models of tests/data with its log, in a folder.
fn example(name: &str) -> Folder {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let read = |file: String| fs::read(data.join(file)).expect("the models are in the repository");
    let folder = Folder::with_log(read(format!("{name}.csv")));
    folder.write("model.toml", read(format!("{name}.toml")));
    folder
}

fn filtered(folder: &Folder, line: &str) -> Vec<Value> {
    objects(&folder.done(&format!("filter {line}")).stdout)
}

fn summary(folder: &Folder, line: &str) -> Value {
    folder.done(&format!("filter {line} -o lines.jsonl --summary summary.json"));
    serde_json::from_str(&folder.read("summary.json")).expect("it is JSON")
}

/// Value and standard deviation of a state or parameter in a summary.
fn estimate(summary: &Value, kind: &str, name: &str) -> (f64, f64) {
    let all = summary[kind].as_array().into_iter().flatten();
    let one = all.into_iter().find(|one| one["name"] == name).expect("the summary has it");
    (number(one, "/value"), number(one, "/standard_deviation"))
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() < tolerance, "{found} {expected}");
}

#[test]
fn the_level_of_the_nile() {
    let folder = Folder::with_log("year,y\n1871,1120\n1872,1160\n");
    folder.write("nile.toml", NILE);
    let lines = filtered(&folder, "nile.toml log.csv");
    let values = [(0, 1_118.311_462, 15_076.236_391), (1, 1_140.108_439, 7_894.557_531)];
    for (row, level, variance) in values {
        close(number(&lines[row], "/level"), level, 1e-6);
        close(number(&lines[row], "/level_sd").powi(2), variance, 1e-5);
    }
    close(number(&lines[0], "/innovation_y_sd").powi(2), 1e7 + 15_099.0, 1e-6);

    let folder = folder_with("nile.csv");
    folder.write("nile.toml", NILE);
    let found = summary(&folder, "nile.toml log.csv");
    let (level, deviation) = estimate(&found, "states", "level");
    close(level, 798.370_293, 1e-6);
    close(deviation.powi(2), 4_032.157_942, 1e-6);
    close(number(&found, "/log_likelihood"), -641.585_578, 1e-6);
    assert_eq!(number(&found, "/nis/rows"), 100.0);
    let share = number(&found, "/nis/below") + number(&found, "/nis/above");
    assert!(share < 0.1, "{found}");
}

#[test]
fn the_steady_gains_of_the_alpha_beta_filter_and_of_three_states() {
    let y = Random::new(3).signal(200);
    let folder = Folder::with_log(csv(&[("y", &y)]));
    folder.write("model.toml", ALPHA_BETA);
    let lines = filtered(&folder, "model.toml log.csv");
    let last = lines.last().expect("there are lines");
    let gain = |line: &Value, state: &str| {
        (number(line, &format!("/{state}")) - number(line, &format!("/{state}_predicted")))
            / number(line, "/innovation_y")
    };
    close(gain(last, "position"), 0.75, 1e-9);
    close(gain(last, "velocity"), 0.5, 1e-9);
    for (name, variance) in [
        ("position_predicted_sd", 3.0),
        ("velocity_predicted_sd", 2.0),
        ("position_sd", 0.75),
        ("velocity_sd", 1.0),
    ] {
        close(number(last, &format!("/{name}")).powi(2), variance, 1e-9);
    }

    let u = Random::new(4).signal(200);
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    let noise = [-0.3832, 0.5919, 0.5191];
    let rows = noise.map(|a| format!("{:?}", noise.map(|b| 2.3 * a * b)));
    folder.write(
        "model.toml",
        format!(
            "sample_time = 1\ninputs = ['u']\noutputs = ['y']\nF = [[1.1269, -0.494, 0.1129], [1, 0, 0], [0, 1, 0]]\n\
             G = [[-0.3832], [0.5919], [0.5191]]\nH = [[1, 0, 0]]\nQ = [{}]\nR = [[1]]\n\
             P0 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n",
            rows.join(", ")
        ),
    );
    let last = filtered(&folder, "model.toml log.csv").pop().expect("there are lines");
    for (state, expected) in [("x1", 0.534_537_54), ("x2", 0.010_133_19), ("x3", -0.477_567_89)] {
        close(gain(&last, state), expected, 1e-7);
    }
}

#[test]
fn a_report_of_fit_is_a_model() {
    let folder = Folder::with_log(Experiment::new(600).csv());
    folder.done("fit log.csv --model armax --na 2 --nb 2 --nc 1 --report model.json");
    let lines = filtered(&folder, "model.json log.csv --initial zero");
    let predicted = Answer::read(&folder.done("predict model.json log.csv --initial zero").stdout).predicted;
    let found: Vec<f64> = lines.iter().map(|line| number(line, "/predicted_y")).collect();
    let expected: Vec<f64> =
        predicted.into_iter().map(|value| value.expect("all rows are predicted")).collect();
    assert!(distance(&found, &expected) < 1e-9, "{}", distance(&found, &expected));
    // The model was fitted to this log: its innovations are as large as it says.
    let found = summary(&folder, "model.json log.csv");
    close(number(&found, "/nis/mean"), 1.0, 0.05);
    assert_eq!(found["estimator"], "kalman");
    // Where it began is forgotten, known or not.
    let last = filtered(&folder, "model.json log.csv").pop().expect("there are lines");
    close(number(&last, "/predicted_y"), expected[599], 1e-9);
    // The extended filter of a linear model is the same.
    assert_eq!(filtered(&folder, "model.json log.csv --initial zero --estimator ekf"), lines);
    assert_eq!(folder.run("filter model.json log.csv --initial drop").code, 2);
    folder.write("model.toml", ALPHA_BETA);
    folder.assert_refused("filter model.toml log.csv --initial zero", 2, "--initial is for reports");
}

#[test]
fn an_observer_has_the_poles_or_the_gain_asked_for() {
    // A cart from somewhere else, without noise.
    let y: Vec<f64> = (0..60).map(|k| 3.0 + 0.5 * f64::from(k)).collect();
    let folder = Folder::with_log(csv(&[("y", &y)]));
    folder.write("model.toml", ALPHA_BETA);
    for how in ["--poles 0.5,0.4", "--poles 0.3+0.2i,0.3-0.2i", "--gain 1.1;0.3"] {
        let lines = filtered(&folder, &format!("model.toml log.csv --estimator luenberger {how}"));
        let last = lines.last().expect("there are lines");
        close(number(last, "/velocity_predicted"), 0.5, 1e-9);
        close(number(last, "/innovation_y"), 0.0, 1e-9);
        // It knows no noise.
        assert!(last["nis"].is_null() && last["position_sd"].is_null(), "{last}");
        // e(k+1) has the modes of the poles: with 0.5 and 0.4 they add up like this.
        if how == "--poles 0.5,0.4" {
            let e: Vec<f64> = lines.iter().map(|line| number(line, "/innovation_y")).collect();
            for k in 2..8 {
                close(e[k], 0.9 * e[k - 1] - 0.2 * e[k - 2], 1e-12);
            }
        }
    }
    for (options, words) in [
        ("--estimator luenberger", "needs --poles or --gain"),
        ("--poles 0.5,0.4", "are for --estimator luenberger"),
        ("--estimator luenberger --poles 0.5", "--poles"),
        ("--estimator luenberger --poles 0.5,x", "--poles x: write a pole as"),
        ("--estimator luenberger --gain 1,2", "--gain: it must have 2 rows"),
        ("--estimator luenberger --gain 2;3", "has a pole of modulus"),
        ("--estimator luenberger --gain nan;0", "--gain: it must be finite"),
        ("--estimator luenberger --gain 1;a", "--gain 1;a: write numbers"),
        ("--estimator luenberger --gain 1;1 --smooth", "--smooth: an observer"),
        ("--estimator bounded --smooth", "--smooth: a set for bounded noise"),
        ("--deviations 3", "--deviations is for --estimator bounded"),
        ("--estimator bounded --deviations 0", "--deviations: 0 is no number above 0"),
        ("--estimator bounded", "process_bound, measurement_bound and initial_bound"),
    ] {
        folder.assert_refused(&format!("filter model.toml log.csv {options}"), 2, words);
    }
}

#[test]
fn unknown_parameters_are_found_with_the_state_and_by_a_fit() {
    let models: [(&str, &[(&str, f64)]); 3] = [
        ("mass_spring_damper", &[("mass", 1.6)]),
        ("battery", &[("r0", 0.002), ("r1", 0.0015), ("c1", 20_000.0)]),
        ("dc_motor", &[("torque_constant", 0.05), ("friction", 1e-4)]),
    ];
    for (name, truth) in models {
        let folder = example(name);
        let text = folder.read("model.toml");
        let found = summary(&folder, "model.toml log.csv --time t");
        assert_eq!(found["estimator"], "ekf");
        let run = folder.done("fit --grey model.toml log.csv --time t --report report.json");
        let report: Value = serde_json::from_str(&folder.read("report.json")).expect("it is JSON");
        assert_eq!(
            (&report["schema"], &report["model"]["kind"], &report["model"]["equations"]),
            (&"thetahat.report/1".into(), &"equations".into(), &text.as_str().into())
        );
        for &(parameter, value) in truth {
            assert!(text.contains(&format!("{parameter} = {{ start")), "{name}: {parameter}");
            // The linearised filter may promise too much; the fit may not.
            let (estimated, deviation) = estimate(&found, "parameters", parameter);
            assert!(
                (estimated - value).abs() < 4.0 * deviation,
                "{name} {parameter}: {estimated} {deviation}"
            );
            let named = |list: &Value| -> Value {
                let all = list.as_array().into_iter().flatten();
                all.into_iter().find(|one| one["name"] == parameter).expect("it was fitted").clone()
            };
            let one = named(&report["model"]["parameters"]);
            let known = named(&report["estimation"]["unknown"]);
            let (fitted, error) = (number(&one, "/value"), number(&one, "/standard_error"));
            assert!((fitted - value).abs() < 3.0 * error && error < 0.1 * value, "{name}: {one}");
            assert!(
                run.stdout.contains(known["change_of_variable"].as_str().expect("it is said")),
                "{}",
                run.stdout
            );
        }
        // The change of variable is named where the parameter is.
        let all = found["parameters"].as_array().into_iter().flatten();
        assert!(
            all.into_iter()
                .all(|one| one["change_of_variable"].as_str().is_some_and(|words| words.contains("exp(")))
        );
        // What was fitted is a model without unknowns, and no worse.
        let fitted = summary(&folder, "report.json log.csv --time t");
        assert_eq!(fitted["parameters"], Value::Array(Vec::new()));
        assert!(number(&fitted, "/log_likelihood") > number(&found, "/log_likelihood"), "{name}");
        close(
            number(&fitted, "/nis/mean") / (number(&fitted, "/measured") / number(&fitted, "/rows")),
            1.0,
            0.1,
        );
    }
}

#[test]
fn the_series_resistance_of_a_cell_from_its_first_pulse() {
    let folder = folder_with("leaf_cell_hppc_25c.csv");
    let log = folder.read("log.csv");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/leaf_cell.toml");
    // The rows around the first discharge: from a minute of rest to half a minute after the pulse.
    let rows: Vec<(f64, f64)> = log
        .lines()
        .skip(1)
        .map(|line| {
            let mut fields = line.split(',').map(|field| field.parse().expect("a number"));
            (fields.next().expect("a time"), fields.next().expect("a current"))
        })
        .collect();
    let start = rows.iter().position(|&(_, i)| i < -20.0).expect("there is a pulse");
    let from = rows.iter().position(|&(t, _)| t > rows[start].0 - 60.0).expect("there is rest before");
    let to = rows.iter().rposition(|&(t, _)| t < rows[start].0 + 70.0).expect("there is rest behind");
    let range = format!("{}..{}", from + 1, to + 1);
    folder.write("cell.toml", fs::read(model).expect("it is there"));
    let found = summary(&folder, &format!("cell.toml log.csv --time t --rows {range}"));
    let (r0, deviation) = estimate(&found, "parameters", "r0");
    assert!((r0 / 0.00177 - 1.0).abs() < 0.1, "{r0} {deviation}");
    let run = folder.done(&format!("fit --grey cell.toml log.csv --time t --estimate {range} --format json"));
    let report: Value = serde_json::from_str(&run.stdout).expect("it is JSON");
    let all = report["model"]["parameters"].as_array().into_iter().flatten();
    let one = all.into_iter().find(|one| one["name"] == "r0").expect("it was fitted");
    assert!((number(one, "/value") / 0.00177 - 1.0).abs() < 0.1, "{one}");
}

#[test]
fn an_element_that_is_missing_is_skipped_alone_and_an_input_is_held() {
    let folder = example("dc_motor");
    let mut rows: Vec<String> = folder.read("log.csv").lines().map(str::to_owned).collect();
    let cut = |row: &str, column: usize| -> String {
        let fields =
            row.split(',').enumerate().map(|(index, field)| if index == column { "" } else { field });
        fields.collect::<Vec<_>>().join(",")
    };
    rows[101] = cut(&rows[101], 2);
    rows[102] = cut(&cut(&rows[102], 2), 3);
    rows[103] = cut(&rows[103], 1);
    folder.write("log.csv", rows.join("\n"));
    let lines = filtered(&folder, "model.toml log.csv --time t");
    let [one, none, held] = [&lines[100], &lines[101], &lines[102]];
    assert!(one["innovation_i"].is_null() && one["innovation_speed"].is_f64() && one["predicted_i"].is_f64());
    assert_eq!(one["action"], "updated");
    close(number(one, "/nis_high"), 5.0239, 1e-4);
    close(number(&lines[99], "/nis_high"), 7.3778, 1e-4);
    assert!(
        none["nis"].is_null()
            && none["action"] == "missing"
            && number(none, "/speed_sd") > number(one, "/speed_sd")
    );
    assert_eq!((&held["held"], &lines[103]["held"]), (&"u".into(), &Value::Null));
}

#[test]
fn each_step_has_its_own_length() {
    // Rows that are left out are steps that are longer: the estimate hardly changes.
    let folder = example("mass_spring_damper");
    let whole = summary(&folder, "model.toml log.csv --time t");
    let text = folder.read("log.csv");
    let kept = text.lines().enumerate().filter(|(line, _)| line % 7 != 3).map(|(_, row)| row);
    folder.write("log.csv", kept.collect::<Vec<_>>().join("\n"));
    let fewer = summary(&folder, "model.toml log.csv --time t");
    let ((mass, deviation), (other, _)) =
        (estimate(&whole, "parameters", "mass"), estimate(&fewer, "parameters", "mass"));
    assert!((mass - other).abs() < 5.0 * deviation, "{mass} {other} {deviation}");
    // Taken for steps of the same length it fits worse.
    let wrong = summary(&folder, "model.toml log.csv");
    assert!(number(&wrong, "/nis/mean") > 1.3 * number(&fewer, "/nis/mean"), "{wrong}");

    // Matrices hold for their sample time, and for multiples of it.
    folder.write("matrices.toml", ALPHA_BETA);
    folder.write("log.csv", "t,y\n0,0\n1,1\n3,3\n4,4\n");
    folder.write("holes.csv", "y\n0\n1\n\"\"\n3\n4\n");
    let last = |line: &str| filtered(&folder, line).pop().expect("there are lines");
    let (steps, holes) = (last("matrices.toml log.csv --time t"), last("matrices.toml holes.csv"));
    close(number(&steps, "/velocity"), number(&holes, "/velocity"), 1e-12);
    folder.write("log.csv", "t,y\n0,0\n1,1\n2.5,3\n");
    let run = folder.run("filter matrices.toml log.csv --time t");
    assert_eq!(run.code, 3);
    assert_eq!(run.stdout.lines().count(), 2);
    assert!(run.stderr.contains("error: log.csv:4: "), "{}", run.stderr);
}

#[test]
fn rows_in_the_middle_of_a_log_have_their_own_time() {
    // A report whose offsets are lines in time.
    let Experiment { u, y } = Experiment::new(600);
    let y: Vec<f64> = y.iter().enumerate().map(|(t, y)| y + 0.05 * t as f64).collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done("fit log.csv --na 2 --nb 2 --detrend linear --report model.json");
    let whole = filtered(&folder, "model.json log.csv");
    for how in ["", "--smooth"] {
        let late = filtered(&folder, &format!("model.json log.csv --rows 401..600 {how}"));
        assert_eq!(late.len(), 200);
        close(number(&late[199], "/predicted_y"), number(&whole[599], "/predicted_y"), 1e-6);
        assert!(number(&late[5], "/nis") < 20.0, "{}", late[5]);
    }
}

#[test]
fn a_parameter_that_wants_out_of_its_bounds_stays_at_one() {
    let folder = example("mass_spring_damper");
    let text = folder.read("model.toml");
    folder.write(
        "model.toml",
        text.replace(
            "start = 3, sd = 1, unknown = true, min = 0.1",
            "start = 1, sd = 1, unknown = true, min = 0.5, max = 1.2",
        ),
    );
    let run = folder.done("fit --grey model.toml log.csv --time t --format json");
    let report: Value = serde_json::from_str(&run.stdout).expect("it is JSON");
    close(number(&report, "/model/parameters/0/value"), 1.2, 1e-3);
    assert!(run.stderr.contains("'mass' is within its standard error of its bound 1.2"), "{}", run.stderr);
}

#[test]
fn smoothed_states_are_better_known() {
    let folder = example("mass_spring_damper");
    // From another time on, with a line in it that is no row.
    let mut rows: Vec<String> = folder.read("log.csv").lines().map(str::to_owned).collect();
    for (index, row) in rows.iter_mut().enumerate().skip(1) {
        let (_, rest) = row.split_once(',').expect("it has columns");
        *row = format!("{:.2},{rest}", 100.0 + 0.05 * (index - 1) as f64);
    }
    rows[300] = "x".to_owned();
    folder.write("log.csv", rows.join("\n"));
    let lines = filtered(&folder, "model.toml log.csv --time t --smooth");
    assert_eq!(lines.len(), 799);
    for line in &lines {
        assert!(
            number(line, "/velocity_smoothed_sd") <= number(line, "/velocity_sd") * (1.0 + 1e-9),
            "{line}"
        );
    }
    let last = lines.last().expect("there are lines");
    assert_eq!(last["position"], last["position_smoothed"]);
    // A parameter that does not walk is the same in all rows.
    close(number(&lines[0], "/mass_smoothed"), number(last, "/mass"), 1e-9);
    // The other figures are those of the filter.
    let plain = filtered(&folder, "model.toml log.csv --time t");
    for (line, plain) in lines.iter().zip(&plain) {
        for name in ["row", "time", "velocity", "nis"] {
            assert_eq!(line[name], plain[name]);
        }
    }
}

#[test]
fn csv_has_the_same_columns_and_every_nth_row() {
    let folder = example("dc_motor");
    let objects = filtered(&folder, "model.toml log.csv --every 50");
    assert_eq!(objects.len(), 20);
    let table = folder.done("filter model.toml log.csv --every 50 --format csv").stdout;
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let header: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    for (record, object) in reader.records().zip(&objects) {
        for (name, field) in header.iter().zip(record.unwrap().iter()) {
            match &object[name] {
                Value::Null => assert_eq!(field, "", "{name}"),
                Value::String(word) => assert_eq!(field, word),
                number => assert_eq!(field.parse::<f64>().ok(), number.as_f64(), "{name}"),
            }
        }
    }
    let rows = filtered(&folder, "model.toml log.csv --rows 11..20");
    assert_eq!((rows.len(), number(&rows[0], "/row")), (10, 11.0));
    let run = folder.run("filter model.toml log.csv --rows 900..1100");
    assert_eq!((run.code, run.stdout.lines().count()), (3, 101));
    assert!(run.stderr.contains("error: log.csv: --rows 900..1100: there are 1000 rows"), "{}", run.stderr);
}

#[test]
fn a_slow_pipe_is_answered_row_by_row() {
    use std::io::{BufRead, BufReader};
    let folder = example("mass_spring_damper");
    let log = folder.read("log.csv");
    let mut command = folder.command("filter model.toml - --time t");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    let mut input = child.stdin.take().expect("it is a pipe");
    let mut lines = BufReader::new(child.stdout.take().expect("it is a pipe")).lines();
    let mut rows = log.lines();
    writeln!(input, "{}", rows.next().expect("it has a header")).expect("the program reads");
    for (index, row) in rows.take(40).enumerate() {
        writeln!(input, "{row}").and_then(|()| input.flush()).expect("the program reads");
        // Nothing more is written before this line is there.
        let line = objects(&lines.next().expect("a line comes").expect("it can be read")).remove(0);
        assert_eq!(number(&line, "/row"), index as f64 + 1.0);
        std::thread::sleep(Duration::from_millis(2));
    }
    drop(input);
    assert!(child.wait().expect("the program ends").success());
}

#[test]
fn models_that_make_no_sense_are_refused_where_they_do_not() {
    let folder = example("mass_spring_damper");
    let text = folder.read("model.toml");
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        folder.write("bad.toml", text.replace(from, to));
        let message = folder.refused("filter bad.toml log.csv", 3);
        let same = folder.refused("fit --grey bad.toml log.csv", 3);
        assert_eq!(message, same);
        message
    };
    let line_of = |word: &str| text.lines().position(|line| line.contains(word)).expect("it is there") + 1;
    let message = refused("- damping * velocity", "- dampin * velocity");
    let velocity = line_of("velocity = \"velocity");
    assert!(message.starts_with(&format!("error: bad.toml: line {velocity}, column ")), "{message}");
    assert!(message.contains("'dampin'") && message.contains("damping"), "{message}");
    for (from, to, word) in [
        ("/ mass\"", "/ (mass\"", ")"),
        ("/ mass\"", "/ sine(mass)\"", "sine"),
        ("velocity = \"velocity", "speed = \"velocity", "speed"),
        ("unknown = true, min = 0.1", "unknown = true, min = 5", "5"),
        ("sd = 1, unknown", "sd = -1, unknown", "sd"),
        ("sd = 1, unknown = true", "sd = 1", "add unknown = true"),
        ("sample_time = 0.05", "sample_time = 0", "sample_time"),
        ("[outputs]", "[output]", "output"),
        ("sample_time = 0.05", "sample_time = = 0.05", "line 3"),
    ] {
        let message = refused(from, to);
        assert!(message.contains(word) && message.contains("line "), "{to}: {message}");
    }
    folder.write("bad.toml", "");
    folder.refused("filter bad.toml log.csv", 3);
    folder.write("bad.toml", [0xff, 0xfe, 0x00]);
    folder.refused("filter bad.toml log.csv", 3);
    folder.write("bad.toml", "{\"schema\": \"thetahat.report/1\"}");
    folder.refused("filter bad.toml log.csv", 3);
    folder.write("bad.toml", "{\"schema\": \"thetahat.report/2\"}");
    folder.assert_refused("filter bad.toml log.csv", 3, "thetahat.report/2");
    folder.refused("filter nothing.toml log.csv", 5);
    folder.assert_refused("filter model.toml log.csv --estimator kalman", 2, "--estimator");
    folder.assert_refused("filter - -", 2, "only one");
    folder.assert_refused("fit --grey model.toml log.csv --na 2", 2, "--na: does not work with --grey");
    folder.assert_refused("filter model.toml log.csv -o model.toml", 2, "would be replaced");

    folder.write("other.csv", "a,b\n1,2\n");
    folder.assert_refused("filter model.toml other.csv", 3, "there is no column 'force'");
    folder.write("other.csv", "");
    folder.refused("filter model.toml other.csv", 3);
    folder.assert_refused(
        "fit --grey model.toml log.csv --time t --estimate 700..900",
        3,
        "the log has 800 rows",
    );
    folder.write("other.csv", "force,position\n1,x\n1,2\n");
    assert_eq!(filtered(&folder, "model.toml other.csv").len(), 2);
    assert_eq!(folder.run("filter model.toml other.csv --strict").code, 3);
    // A parameter that the log tells nothing of.
    let idle = text.replace("[next]", "idle = { start = 1, sd = 1, unknown = true }\n\n[next]");
    folder.write("idle.toml", idle.replace("\"position\"", "\"position + 0 * idle\""));
    let message = folder.refused("fit --grey idle.toml log.csv --time t", 4);
    assert!(message.contains("idle") && !message.contains("mass"), "{message}");
}

const TANK: &str = "sample_time = 1
states = ['level']
outputs = ['y']
F = [[1]]
H = [[1]]
process_bound = [0.1]
measurement_bound = [1]
initial_bound = [100]
";

#[test]
fn a_level_with_bounded_noise() {
    let folder = Folder::with_log("y\n3\n4\n3.5\n9\n");
    folder.write("tank.toml", TANK);
    let answer = folder.done("filter tank.toml log.csv --estimator bounded --summary summary.json");
    let lines = objects(&answer.stdout);
    // By hand: 3 ± 1; wider by 0.1, cut by 4 ± 1; wider by 0.1, within 3.5 ± 1; and 9 is out of reach.
    for (line, [low, high]) in lines.iter().zip([[2.0, 4.0], [3.0, 4.1], [2.9, 4.2], [2.8, 4.3]]) {
        close(number(line, "/level_low"), low, 1e-9);
        close(number(line, "/level_high"), high, 1e-9);
        close(number(line, "/level"), f64::midpoint(low, high), 1e-9);
    }
    let told: Vec<_> = lines.iter().map(|line| (&line["action"], &line["contradicts"])).collect();
    assert_eq!(told[2], (&"updated".into(), &"".into()));
    assert_eq!(told[3], (&"gated".into(), &"y".into()));
    assert!(answer.stderr.contains("1 row is explained by no state within the bounds"), "{}", answer.stderr);
    let summary: Value = serde_json::from_str(&folder.read("summary.json")).expect("it is JSON");
    assert_eq!((&summary["estimator"], &summary["contradictions"]), (&"bounded".into(), &1.into()));
    close(number(&summary, "/states/0/bound"), 0.75, 1e-9);
    // Without covariances the noise is uniform.
    let kalman = filtered(&folder, "tank.toml log.csv");
    close(number(&kalman[0], "/level_predicted_sd"), 100.0 / 3.0_f64.sqrt(), 1e-9);
}

#[test]
fn a_report_with_bounds_of_three_deviations() {
    let folder = folder_with("nile.csv");
    folder.done("fit log.csv --model arma --na 1 --nc 1 --report model.json");
    let lines = filtered(&folder, "model.json log.csv --estimator bounded --deviations 4");
    assert!(lines.iter().all(|line| line["contradicts"] == ""));
    let width = |line: &Value| number(line, "/x1_high") - number(line, "/x1_low");
    assert!(width(&lines[20]) < width(&lines[0]));
}

#[test]
fn the_unscented_and_the_iterated_filter() {
    let folder = example("mass_spring_damper");
    let ekf = summary(&folder, "model.toml log.csv --estimator ekf");
    for estimator in ["iekf", "ukf"] {
        let found = summary(&folder, &format!("model.toml log.csv --estimator {estimator}"));
        assert_eq!(found["estimator"], estimator);
        // It bends little within its deviations, so that all agree within one.
        for one in ekf["states"].as_array().into_iter().flatten() {
            let name = one["name"].as_str().unwrap_or_default();
            let ((value, deviation), (other, _)) =
                (estimate(&ekf, "states", name), estimate(&found, "states", name));
            assert!((value - other).abs() < deviation, "{estimator} {name}: {value} {other} {deviation}");
        }
        assert_eq!(found["rows"], ekf["rows"]);
    }
    let nile = folder_with("nile.csv");
    nile.write("nile.toml", NILE);
    let kalman = filtered(&nile, "nile.toml log.csv --smooth");
    let unscented = filtered(&nile, "nile.toml log.csv --smooth --estimator ukf");
    for (kalman, unscented) in kalman.iter().zip(&unscented) {
        for name in ["/level", "/level_sd", "/level_smoothed", "/level_smoothed_sd", "/nis"] {
            let expected = number(kalman, name);
            close(number(unscented, name), expected, 1e-9 * (1.0 + expected.abs()));
        }
    }
}

#[test]
fn the_noises_of_the_nile() {
    let folder = folder_with("nile.csv");
    folder.write("nile.toml", NILE.replace("1469.1", "1000").replace("15099", "10000"));
    let answer = folder.done("filter nile.toml log.csv --fit-noise -o fitted.toml");
    assert!(answer.stdout.is_empty(), "{}", answer.stdout);
    for words in ["100 values measured", "Q[level]", "R[y]"] {
        assert!(answer.stderr.contains(words), "{words}: {}", answer.stderr);
    }
    // Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed. 2012, section 2.10: 1469.1 and 15098.5.
    let fitted = folder.read("fitted.toml");
    let entry = |key: &str| -> f64 {
        let line = fitted.lines().find_map(|line| line.strip_prefix(key)).expect(key);
        line.trim_matches(['[', ']']).parse().expect("a number")
    };
    close(entry("Q = ") / 1469.1, 1.0, 2e-3);
    close(entry("R = ") / 15098.5, 1.0, 5e-4);
    let likelihood = |model: &str| number(&summary(&folder, &format!("{model} log.csv")), "/log_likelihood");
    assert!(likelihood("fitted.toml") > likelihood("nile.toml"));
    let written = folder.done("filter nile.toml log.csv --fit-noise=scaled --rows 1..50 --quiet");
    assert!(written.stdout.starts_with("sample_time = 1.0\n") && written.stderr.is_empty());
    for (line, code, words) in [
        ("nile.toml log.csv --fit-noise --rows 1..2", 4, "need more than 2 measured values"),
        ("nile.toml log.csv --fit-noise --rows 90..200", 3, "there are 100 rows"),
    ] {
        folder.assert_refused(&format!("filter {line}"), code, words);
    }
    // Of what does not go together more than a line is said.
    for (more, words) in [
        ("--smooth", "--smooth"),
        ("--format csv", "--format"),
        ("=all", "diagonal, full, scaled, innovations"),
    ] {
        let joined = if more.starts_with('=') { "" } else { " " };
        let run = folder.run(&format!("filter nile.toml log.csv --fit-noise{joined}{more}"));
        assert!(run.code == 2 && run.stdout.is_empty() && run.stderr.contains(words), "{}", run.stderr);
    }
}
