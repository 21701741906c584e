//! `thetahat inspect` from end to end: what it takes, what it writes, and that the line it ends with works.

use std::process::Command;

use serde_json::{Value, json};

use crate::harness::{Folder, Run, number, numbers};
use crate::signals::{Experiment, Random, csv, plain_log, response};

/// The document of a log in a folder.
fn inspected(folder: &Folder, line: &str) -> Value {
    let run = folder.done(&format!("inspect {line} --format json"));
    assert_eq!(run.stderr, "");
    serde_json::from_str(&run.stdout).expect("the document is JSON")
}

fn says(document: &Value, what: &str) -> bool {
    sentences(document).iter().any(|sentence| sentence.contains(what))
}

/// The findings of a document, as the table has them.
fn sentences(document: &Value) -> Vec<String> {
    let findings = document["findings"].as_array().expect("there is a list of findings");
    let sentence = |finding: &Value| {
        let words = [&finding["seen"], &finding["advice"]].into_iter().filter_map(Value::as_str);
        words.collect::<Vec<_>>().join(": ")
    };
    findings.iter().map(sentence).collect()
}

/// Runs the line that a document ends with, in a shell, with orders.
fn fitted(folder: &Folder, document: &Value) -> Run {
    let line = document["command"].as_str().expect("there is a command");
    let program = env!("CARGO_BIN_EXE_thetahat");
    let line = line.strip_prefix("thetahat").expect("it is a line of thetahat");
    let mut command = Command::new("sh");
    command.args(["-c", &format!("'{program}'{line} --na 2 --nb 2")]).current_dir(folder.path(""));
    Run::of(command)
}

/// Runs that line, which must fit the model of [`Experiment`].
fn assert_fits(folder: &Folder, document: &Value) {
    let run = fitted(folder, document);
    assert_eq!(run.code, 0, "{}: {}", document["command"], run.stderr);
    let report: Value = serde_json::from_str(&folder.read("model.json")).expect("a report was written");
    assert!((number(&report, "/model/parameters/0/value") - Experiment::A[1]).abs() < 0.2);
}

#[test]
fn the_document_says_what_the_log_is() {
    let folder = Folder::with_log(plain_log());
    let document = inspected(&folder, "log.csv --sample-time 0.5");
    assert_eq!(document["schema"], "thetahat.inspection/1");
    assert_eq!(document["log"]["file"], "log.csv");
    assert_eq!((number(&document, "/rows"), number(&document, "/clock/sample_time")), (200.0, 0.5));
    let Experiment { u, y } = Experiment::new(200);
    for (channel, (name, role, values)) in
        document["channels"].as_array().into_iter().flatten().zip([("u", "input", u), ("y", "output", y)])
    {
        assert_eq!((&channel["name"], &channel["role"]), (&json!(name), &json!(role)));
        let mean = values.iter().sum::<f64>() / 200.0;
        assert!((number(channel, "/mean") - mean).abs() < 1e-12);
        let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 200.0;
        assert!((number(channel, "/standard_deviation") - square.sqrt()).abs() < 1e-12);
        assert_eq!(number(channel, "/minimum"), values.iter().copied().fold(f64::INFINITY, f64::min));
        assert_eq!(channel["quantization"], Value::Null);
    }
    assert_eq!(document["excitation"][0]["order"], 50);
    assert_eq!((&document["delays"][0]["nk"], &document["feedback"][0]["found"]), (&json!(1), &json!(false)));
    assert!(number(&document, "/delays/0/confidence") > 0.9);
    let correlation = numbers(&document["delays"][0]["correlation"]);
    assert!(correlation[1].abs() > 3.0 * number(&document, "/delays/0/band"));
    assert_eq!(document["command"], "thetahat fit log.csv --sample-time 0.5 -u u -y y --report model.json");
    assert_eq!(document["findings"], json!([]));
    assert_fits(&folder, &document);
}

#[test]
fn the_table_says_the_same_to_people() {
    let folder = Folder::with_log(plain_log());
    let run = folder.done("inspect log.csv --sample-time 0.5");
    assert_eq!(run.stderr, "");
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert_eq!(lines[0], "log.csv: 200 rows, sample time 0.5 s");
    assert_eq!(lines.last(), Some(&"thetahat fit log.csv --sample-time 0.5 -u u -y y --report model.json"));
    for words in [["u", "input"], ["y", "output"], ["u", "50 or more"]] {
        assert!(lines.iter().any(|line| words.iter().all(|word| line.contains(word))), "{words:?}");
    }
    folder.done("inspect log.csv --sample-time 0.5 -o table.txt");
    assert_eq!(folder.read("table.txt"), run.stdout);
    folder.done("inspect log.csv --sample-time 0.5 --format json --out log.json");
    let document: Value = serde_json::from_str(&folder.read("log.json")).expect("the document is JSON");
    assert_eq!(document, inspected(&folder, "log.csv --sample-time 0.5"));
    // Its warnings are part of the table.
    folder.write("log.csv", "u,y\n1,2\n3,\n");
    let run = folder.done("inspect log.csv");
    assert!(run.stdout.contains("\nwarning: channel 'y' misses 1 of 2 values"), "{}", run.stdout);
}

#[test]
fn an_irregular_clock_does_not_stop_it() {
    let mut random = Random::new(3);
    let mut now = 100.0;
    let time: Vec<f64> = (0..400)
        .map(|_| {
            now += 0.25 * (1.0 + 0.3 * random.uniform());
            now
        })
        .collect();
    // Held inputs, so that the resampled log has about the same dynamics.
    let folder = Folder::with_log(Experiment::new(400).timed(&time));
    folder.refused("fit log.csv --time time --na 2 --nb 2", 3);
    let document = inspected(&folder, "log.csv --time time");
    assert_eq!((number(&document, "/rows"), &document["clock"]["irregular"]), (400.0, &json!(true)));
    assert!(says(&document, "irregular"));
    let step = number(&document, "/log/resampled/step");
    let expected =
        format!("thetahat fit log.csv --time time --resample {step}:linear -u u -y y --report model.json");
    assert_eq!(document["command"], expected);
    let run = fitted(&folder, &document);
    assert_eq!(run.code, 0, "{}", run.stderr);

    let asked = inspected(&folder, "log.csv --time time --resample 0.5:hold");
    assert_eq!(asked["log"]["resampled"], json!({"step": 0.5, "interpolation": "hold", "rows": 400}));
    assert!(asked["command"].as_str().is_some_and(|line| line.contains("--resample 0.5:hold")));
    assert_eq!(asked["channels"], document["channels"]);
}

#[test]
fn a_clock_that_goes_back_is_said_and_not_fitted() {
    let mut time: Vec<f64> = (0..200).map(f64::from).collect();
    time[100] = 50.0;
    let folder = Folder::with_log(Experiment::new(200).timed(&time));
    let document = inspected(&folder, "log.csv --time time");
    assert!(says(&document, "goes back at row 101"));
    assert_eq!((&document["command"], &document["excitation"]), (&Value::Null, &json!([])));
    let line = Folder::with_log("t,y\n1,1\n1,2\n").refused("inspect log.csv --time t", 3);
    assert!(line.contains("log.csv:3") && line.contains("never advances"), "{line}");
}

#[test]
fn names_and_options_come_back_ready_for_a_shell() {
    let Experiment { u, y } = Experiment::new(200);
    let log =
        csv(&[("heat it's $HOME", &u), ("-y", &y), ("t", &(0..200).map(f64::from).collect::<Vec<_>>())]);
    let log: String = log
        .replace(',', ";")
        .replace('.', ",")
        .lines()
        .enumerate()
        .map(|(row, line)| if row == 3 { "-999;-999;2\n# no row\n".to_owned() } else { format!("{line}\n") })
        .collect();
    let folder = Folder::new();
    folder.write("-my log.csv", &log);
    let mut command =
        folder.command("inspect --time t --decimal-comma --delimiter ; --comment # --missing -999");
    command.args(["--output=-y", "-u", "heat it's $HOME", "--format", "json", "--", "-my log.csv"]);
    let run = Run::of(command);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    let document: Value = serde_json::from_str(&run.stdout).expect("the document is JSON");
    assert_eq!(
        document["command"],
        r"thetahat fit './-my log.csv' --time t -u 'heat it'\''s $HOME' --output=-y --delimiter ';' --comment '#' --missing=-999 --report model.json --decimal-comma"
    );
    assert_eq!(document["channels"][0]["missing"], 1);
    assert_fits(&folder, &document);
}

#[test]
fn names_with_commas_and_quotes_stand_between_quotes() {
    let Experiment { u, y } = Experiment::new(200);
    let other = Random::new(4).signal(200);
    let log =
        csv(&[("in", &u), ("2nd", &other), ("y", &y)]).replacen("in,2nd", "\"flow, in\",\"5\"\" pipe\"", 1);
    let folder = Folder::with_log(log);
    let mut command = folder.command("inspect log.csv --format json");
    command.args(["-u", "\"flow, in\",5\" pipe"]);
    let run = Run::of(command);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let document: Value = serde_json::from_str(&run.stdout).expect("the document is JSON");
    let names: Vec<&Value> =
        document["channels"].as_array().into_iter().flatten().map(|channel| &channel["name"]).collect();
    assert_eq!(names, ["flow, in", "5\" pipe", "y"]);
    for (options, name) in [("fit", "--nb"), ("track", "-o lines.jsonl --nb")] {
        let mut command = folder.command(&format!("{options} log.csv --na 2 {name} 2,2"));
        command.args(["--input", "\"flow, in\",\"5\"\" pipe\""]);
        let run = Run::of(command);
        assert_eq!(run.code, 0, "{}", run.stderr);
    }
    // What inspect suggests is written so, too.
    let log = folder.read("log.csv").replace("5\"\" pipe", "other");
    folder.write("log.csv", log);
    let mut command = folder.command("inspect log.csv --format json");
    command.args(["-u", "\"flow, in\""]);
    let document: Value = serde_json::from_str(&Run::of(command).stdout).expect("the document is JSON");
    assert_eq!(document["command"], "thetahat fit log.csv -u '\"flow, in\"' -y y --report model.json");
    assert_fits(&folder, &document);
    let mut command = folder.command("fit log.csv --na 2 --nb 2");
    command.args(["-u", "\"flow, in"]);
    let run = Run::of(command);
    assert!(run.code == 2 && run.stderr.contains("a double quote is not closed"), "{}", run.stderr);
}

#[test]
fn all_columns_of_numbers_are_looked_at() {
    let mut log = String::from("u2,note,u1,x,y,x,when\n");
    let (Experiment { u, y }, mut random) = (Experiment::new(200), Random::new(5));
    for row in 0..200 {
        let other = random.uniform();
        log += &format!("{},fine,{other},{row},{},{row},2024-01-01T00:00:00Z\n", u[row], y[row]);
    }
    let folder = Folder::with_log(log);
    let document = inspected(&folder, "log.csv");
    let channels: Vec<(&Value, &Value)> = document["channels"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|channel| (&channel["name"], &channel["role"]))
        .collect();
    let (input, output) = (json!("input"), json!("output"));
    assert_eq!(channels, [(&json!("u2"), &input), (&json!("u1"), &input), (&json!("y"), &output)]);
    for word in ["column 2 ('note') is left out: it holds no numbers", "column 7 ('when')", "column 6 ('x')"]
    {
        assert!(says(&document, word), "{word}: {:?}", sentences(&document));
    }
    // In the order of a fit.
    let inputs: Vec<&Value> =
        document["excitation"].as_array().into_iter().flatten().map(|of| &of["input"]).collect();
    assert_eq!(inputs, [&json!("u1"), &json!("u2")]);
    // Named columns, and nothing else; one that holds words is then an error.
    let document = inspected(&folder, "log.csv -u u1 -y u2");
    assert_eq!(document["channels"].as_array().map(Vec::len), Some(2));
    assert!(!says(&document, "left out"), "{:?}", sentences(&document));
    let line = folder.refused("inspect log.csv -u note", 3);
    assert!(line.contains("log.csv:2:") && line.contains("column 'note'"), "{line}");
    // Words among numbers are a fault and not another kind of column.
    Folder::with_log("u,y\n1,2\n3,broken\n").assert_refused("inspect log.csv", 3, "log.csv:3:3");
}

#[test]
fn other_inputs_and_outputs() {
    let Experiment { u, y } = Experiment::new(200);
    // A series.
    let folder = Folder::with_log(csv(&[("count", &y)]));
    let document = inspected(&folder, "log.csv -y count");
    assert_eq!(document["command"], "thetahat fit log.csv --nb 0 -y count --report model.json");
    let document = inspected(&folder, "log.csv");
    assert_eq!((&document["command"], &document["channels"][0]["role"]), (&Value::Null, &Value::Null));
    // An input without output; an idle input is left out of the line.
    folder.write("log.csv", csv(&[("u", &u)]));
    assert_eq!(inspected(&folder, "log.csv")["command"], Value::Null);
    folder.write("log.csv", csv(&[("u1", &u), ("u2", &[3.0; 200]), ("y", &y)]));
    let document = inspected(&folder, "log.csv");
    assert_eq!(document["command"], "thetahat fit log.csv -u u1 -y y --report model.json");
    assert!(says(&document, "'u2' excites nothing"));
    assert_fits(&folder, &document);
    // So is one that repeats another.
    let twice: Vec<f64> = u.iter().map(|u| 2.0 * u - 1.0).collect();
    folder.write("log.csv", csv(&[("u1", &u), ("u2", &twice), ("y", &y)]));
    let document = inspected(&folder, "log.csv");
    assert_eq!(document["command"], "thetahat fit log.csv -u u1 -y y --report model.json");
    assert_eq!(document["excitation"][1]["same_as"], "u1");
    folder.write("log.csv", csv(&[("u", &u), ("y", &[3.0; 200])]));
    assert_eq!(inspected(&folder, "log.csv")["command"], Value::Null);
    // A clock is no channel.
    folder.write("log.csv", Experiment::new(50).timed(&(0..50).map(f64::from).collect::<Vec<_>>()));
    let run = folder.done("inspect log.csv --format json");
    assert!(run.stderr.contains("the clock is column 'time'"), "{}", run.stderr);
    let document: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(document["channels"].as_array().map(Vec::len), Some(2));
    assert!(document["command"].as_str().is_some_and(|command| command.contains("--time time")));
    // From standard input.
    let run = folder.run_on("inspect - --format json", plain_log());
    assert_eq!(run.code, 0, "{}", run.stderr);
}

#[test]
fn a_closed_loop_is_pointed_out() {
    let mut random = Random::new(11);
    let (e, r) = (random.signal(1000), random.signal(1000));
    let (mut u, mut y) = (vec![0.0], vec![0.0]);
    for t in 1..1000 {
        y.push(0.9 * y[t - 1] + 0.5 * u[t - 1] + e[t]);
        u.push(0.6 * (r[t] - y[t]));
    }
    let document = inspected(&Folder::with_log(csv(&[("u", &u), ("y", &y)])), "log.csv");
    assert_eq!(document["feedback"][0]["found"], true);
    assert!(number(&document, "/feedback/0/p_value") < 0.01 && says(&document, "that is feedback"));
    let open = response(&[1.0, -0.9], &[(&[0.0, 0.5], &r)], &e);
    let document = inspected(&Folder::with_log(csv(&[("u", &r), ("y", &open)])), "log.csv");
    assert_eq!(document["feedback"][0]["found"], false);
}

#[test]
fn small_and_odd_logs() {
    for (log, options) in [
        ("u,y\n1,2\n", ""),
        ("u,y\n1,2\n1,2\n", ""),
        ("u,y\n,\n,\n", ""),
        ("u,y\n1e300,1e-300\n-1e300,0\n1e300,1\n", "--sample-time 1e-300"),
        ("u,y\nnan,1\n1,nan\n", "--sample-time 1e300"),
        ("t,y\n0,1\n1,2\n", "--time t"),
        ("t,y\n2024-01-01,1\n2024-01-02,2\n2024-01-03,2\n", "--time t"),
        ("1,2\n3,4\n", "--no-header"),
        ("t,y\n0,1\n1,2\n1000000000,2\n1000000000.5,4\n", "--time t"),
    ] {
        let folder = Folder::with_log(log);
        let document = inspected(&folder, &format!("log.csv {options}"));
        assert!(number(&document, "/rows") >= 1.0, "{log}");
        folder.done(&format!("inspect log.csv {options}"));
    }
    for (log, options, code, word) in [
        ("", "", 3, "empty"),
        ("u,y\n", "", 3, "no data rows"),
        ("a,b\nx,y\n", "", 3, "no column holds numbers"),
        ("u,y\n1,inf\n", "", 3, "log.csv:2:3"),
        ("u,y\n1,2\n", "-u x", 3, "no column 'x'"),
        ("u,y\n1,2\n", "-y z", 3, "no column 'z'"),
        ("u,y\n1,2\n", "-u u -y u", 2, "named twice"),
        ("u,y\n1,2\n", "-u u,u", 2, "named twice"),
        ("t,y\n1,2\n", "--time t -y t", 2, "named twice"),
        ("t,y\n1,2\n", "--time x", 3, "no column 'x'"),
        ("t,y\n1,2\n", "--time t", 3, "one row"),
        ("u,y\n1,2\n", "--sample-time 0", 2, "--sample-time"),
        ("t,y\n1,2\n2,3\n", "--time t --resample 1", 2, "--resample"),
        ("t,y\n0,1\n1e9,2\n", "--time t --resample 1e-6:hold", 2, "--resample"),
        ("u,y\n1,2\n", "-o log.csv", 2, "replaced"),
        ("u,y\n1,2\n", "--html log.csv", 2, "replaced"),
    ] {
        let folder = Folder::with_log(log);
        folder.assert_refused(&format!("inspect log.csv {options}"), code, word);
        assert_eq!(folder.read("log.csv"), log);
    }
    Folder::new().refused("inspect nowhere.csv", 5);
}

#[test]
fn rows_that_repeat_at_the_end_are_told_by_inspect_and_fit() {
    let Experiment { u, y, .. } = Experiment::new(300);
    let padded = |values: &[f64]| [values, &[values[299]; 40][..]].concat();
    let log = |u: &[f64], y: &[f64]| csv(&[("u", u), ("y", y)]);
    let folder = Folder::with_log(log(&padded(&u), &padded(&y)));
    let words = "from row 300 to the end (41 rows) no channel changes";
    assert!(says(&inspected(&folder, "log.csv --sample-time 1"), words));
    let fit = |line: &str| folder.done(&format!("fit log.csv --sample-time 1 --na 2 --nb 2 {line}")).stderr;
    assert!(fit("").contains(words), "{}", fit(""));
    assert!(!fit("--estimate 1..299").contains("no channel changes"));
    // One channel that rests is none.
    folder.write("log.csv", log(&padded(&u), &[&y[..], &Random::new(3).signal(40)].concat()));
    assert!(!says(&inspected(&folder, "log.csv --sample-time 1"), "no channel changes"));
}

#[test]
fn a_sensor_that_is_stuck_is_named_with_its_rows() {
    let Experiment { u, mut y } = Experiment::new(400);
    let held = y[250];
    y[250..330].fill(held);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let document = inspected(&folder, "log.csv");
    assert_eq!(document["channels"][1]["stuck"], json!([251, 330]));
    assert!(says(&document, "channel 'y' stands still in rows 251..330, as nowhere else"));
    // Nothing is stuck that goes from level to level, is switched on once, or rests at the beginning.
    let steps: Vec<f64> = (0..400).map(|row| f64::from(row / 50 % 3)).collect();
    let switch: Vec<f64> = (0..400).map(|row| f64::from(u8::from(row > 40))).collect();
    let mut rest = u.clone();
    rest[..100].fill(0.0);
    folder.write("log.csv", csv(&[("u", &u), ("rest", &rest), ("steps", &steps), ("switch", &switch)]));
    let document = inspected(&folder, "log.csv");
    assert!(!says(&document, "stands still"), "{:?}", sentences(&document));
}

#[test]
fn outliers_that_another_channel_explains_are_none() {
    // A hammer blow every 100 rows, and what rings after it.
    let blow = |row: usize| if row % 100 == 20 { 50.0 } else { 0.0 };
    let mut random = crate::signals::Random::new(3);
    let ring = |row: usize| {
        let since = (row + 80) % 100;
        9.0 * (-0.4 * since as f64).exp() * (1.5 * since as f64).cos() * f64::from(u8::from(row >= 20))
    };
    let y: Vec<f64> = (0..600).map(|row| ring(row) + 0.01 * random.uniform()).collect();
    let u: Vec<f64> = (0..600).map(|row| blow(row) + 0.01 * random.uniform()).collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let document = inspected(&folder, "log.csv");
    assert!(!says(&document, "far from their neighbours"), "{:?}", sentences(&document));
    // A glitch of the sensor is one.
    let mut y = y;
    y[370] = 80.0;
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    assert!(says(
        &inspected(&folder, "log.csv"),
        "channel 'y' has values far from their neighbours at row 371"
    ));
}

#[test]
fn one_step_is_no_sample_of_feedback_and_delays() {
    // A heater that is switched on once, with a slow sensor and drifting surroundings.
    let mut random = crate::signals::Random::new(8);
    let (mut x, mut drift) = (0.0, 0.0);
    let u: Vec<f64> = (0..500).map(|row| if row < 60 { 0.0 } else { 40.0 }).collect();
    let y: Vec<f64> = (0..500)
        .map(|row| {
            drift = 0.995 * drift + 0.02 * random.uniform();
            x += (if row >= 74 { 0.5 * u[row] } else { 0.0 } - x) / 80.0;
            20.0 + x + drift + 0.02 * random.uniform()
        })
        .collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let document = inspected(&folder, "log.csv");
    assert!(!says(&document, "feedback is suspected"), "{:?}", sentences(&document));
    assert_eq!(document["feedback"][0]["p_value"], Value::Null);
    let certain = document["delays"][0]["confidence"].as_f64().is_none_or(|confidence| confidence >= 0.5);
    assert!(certain, "{}", document["delays"][0]);
    assert!(says(&document, "whether the input follows the output cannot be told"));
}

#[test]
fn findings_name_their_channels_and_rows() {
    // Values that are missing, a sensor at its limit, a time that jumps and an outlier.
    let mut random = crate::signals::Random::new(12);
    let u: Vec<f64> = random.signal(400);
    let mut y: Vec<f64> =
        (0..400).map(|row| 3.0 * (0.05 * row as f64).sin() + 0.01 * random.uniform()).collect();
    y.iter_mut().for_each(|value| *value = value.min(2.5));
    (y[100], y[101], y[205], y[300]) = (f64::NAN, f64::NAN, f64::NAN, 90.0);
    let mut text = "t,u,y\n".to_owned();
    for row in 0..400 {
        let time = if row < 250 { row } else { row + 40 };
        let value = if y[row].is_nan() { String::new() } else { y[row].to_string() };
        text += &format!("{time},{},{value}\n", u[row]);
    }
    let folder = Folder::with_log(text);
    let document = inspected(&folder, "log.csv --time t");
    let find = |kind: &str| {
        let found = document["findings"].as_array().and_then(|all| all.iter().find(|of| of["kind"] == kind));
        found.unwrap_or_else(|| panic!("{kind}: {:?}", sentences(&document))).clone()
    };
    assert_eq!(find("gaps")["rows"], json!([[251, 251]]));
    assert_eq!(find("gaps").get("channels"), None);
    let missing = find("missing");
    assert_eq!((&missing["channels"], &missing["rows"]), (&json!(["y"]), &json!([[101, 102], [206, 206]])));
    assert_eq!(missing["seen"], "channel 'y' misses 3 of 400 values");
    assert_eq!(find("outliers")["rows"], json!([[301, 301]]));
    // Part by part the same.
    let parts = inspected(&folder, "log.csv --time t --stream");
    assert_eq!(parts["findings"], document["findings"]);

    // A sensor at its limit, in runs.
    let clipped: Vec<f64> = (0..400).map(|row| (3.0 * (0.05 * row as f64).sin()).min(2.5)).collect();
    folder.write("log.csv", csv(&[("u", &u), ("y", &clipped)]));
    let document = inspected(&folder, "log.csv");
    let kind = |finding: &&Value| finding["kind"] == "saturation";
    let rests = document["findings"].as_array().and_then(|all| all.iter().find(kind)).expect("it saturates");
    let rows = rests["rows"].as_array().expect("there are rows");
    for row in rows {
        let [first, last] = [0, 1].map(|end| row[end].as_u64().unwrap_or(0) as usize);
        assert!(last > first && clipped[first - 1..last].iter().all(|value| *value == 2.5), "{row}");
    }
    assert_eq!(rows.len(), 3);
}
