//! `thetahat track` on whole logs: it is the library's estimator, ends at the batch fit, and says what it did.

use serde_json::Value;
use thetahat_core::nalgebra::Const;
use thetahat_core::{Action, ArxOrders, Forgetting, InputOrders, RecursiveArx};

use crate::harness::{Folder, Run, distance, number, parameters};
use crate::signals::{Experiment, Random, csv, response};

/// The objects of JSON Lines.
pub(crate) fn objects(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("each line is JSON")).collect()
}

/// What a run that did what was asked wrote.
fn tracked(folder: &Folder, line: &str) -> Vec<Value> {
    objects(&folder.done(&format!("track {line}")).stdout)
}

fn event<'a>(lines: &'a [Value], event: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["event"] == event).collect()
}

/// Two inputs that change at times, and some noise.
fn two_inputs(samples: usize) -> [Vec<f64>; 3] {
    let mut random = Random::new(7);
    let (u1, u2) = (random.signal(samples), random.signal(samples));
    let e: Vec<f64> = random.signal(samples).iter().map(|e| 0.1 * e).collect();
    let y = response(&[1.0, -1.2, 0.5], &[(&[0.0, 1.0, 0.4], &u1), (&[0.0, 0.0, -0.7], &u2)], &e);
    [u1, u2, y]
}

#[test]
fn its_numbers_are_those_of_the_library_to_the_bit() {
    let [u1, u2, y] = two_inputs(600);
    let folder = Folder::with_log(csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    let scales = "--scale u1=1 --scale u2=1 --scale y=3";
    let lines = tracked(&folder, &format!("log.csv --na 2 --nb 2,1 --nk 1,2 {scales} --forgetting 0.98"));
    assert_eq!(lines.len(), 600);

    let inputs = [InputOrders { nb: 2, nk: 1 }, InputOrders { nb: 1, nk: 2 }];
    let orders = ArxOrders { na: 2, inputs: &inputs, constant: false };
    let policy = Forgetting::Exponential { factor: 0.98 };
    let mut library: RecursiveArx<f64, Const<5>, Const<3>> =
        RecursiveArx::new(&orders, 3.0, &[1.0, 1.0], policy).unwrap();
    let mut compared = 0;
    for (row, line) in lines.iter().enumerate() {
        let innovation = library.log_row(y[row], &[u1[row], u2[row]]).unwrap();
        assert_eq!(number(line, "/row"), row as f64 + 1.0);
        assert_eq!(number(line, "/excitation").to_bits(), library.estimator().excitation().to_bits());
        if innovation.action == Action::NotReady {
            assert_eq!((&line["action"], &line["innovation"]), (&"not ready".into(), &Value::Null));
            continue;
        }
        compared += 1;
        assert_eq!(number(line, "/innovation").to_bits(), innovation.error.to_bits(), "row {row}");
        for (name, value) in ["a1", "a2", "b1_1", "b1_2", "b2_2"].iter().zip(library.estimator().parameters())
        {
            assert_eq!(number(line, &format!("/{name}")).to_bits(), value.to_bits(), "{line}");
        }
        if let Some(deviation) = line["innovation_sd"].as_f64() {
            assert!((deviation.powi(2) / innovation.variance - 1.0).abs() < 1e-15);
            assert_eq!(number(line, "/nis").to_bits(), innovation.nis.to_bits());
            let errors = library.estimator().standard_errors().unwrap();
            assert_eq!(number(line, "/a1_se").to_bits(), errors[0].to_bits());
        }
    }
    assert!(compared > 590, "{compared}");
}

#[test]
fn without_forgetting_it_ends_at_the_batch_fit() {
    let [u1, u2, y] = two_inputs(2000);
    let folder = Folder::with_log(csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    let batch = parameters(&folder.fit("log.csv --na 2 --nb 2,1 --nk 1,2 --detrend none"));
    for (start, tolerance) in [("exact", 1e-9), ("mixed:50", 1e-9), ("standard", 1e-4)] {
        let options = format!("--forgetting 1 --start {start} --every 2000");
        let lines = tracked(&folder, &format!("log.csv --na 2 --nb 2,1 --nk 1,2 {options}"));
        let [last] = &lines[..] else { panic!("{lines:?}") };
        let found = ["a1", "a2", "b1_1", "b1_2", "b2_2"].map(|name| number(last, &format!("/{name}")));
        assert!(distance(&found, &batch) < tolerance, "{start}: {found:?}, {batch:?}");
    }
}

#[test]
fn spikes_do_not_spoil_the_model_where_a_rule_for_them_is_asked_for() {
    let [u1, u2, mut y] = two_inputs(2000);
    for k in (150..2000).step_by(100) {
        y[k] += 30.0;
    }
    let folder = Folder::with_log(csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    let truth = [-1.2, 0.5, 1.0, 0.4, -0.7];
    let farthest = |line: &Value| {
        distance(&["a1", "a2", "b1_1", "b1_2", "b2_2"].map(|name| number(line, &format!("/{name}"))), &truth)
    };
    for (rule, action, least, most) in
        [("used", "updated", 0.5, 9.0), ("huber", "bounded", 0.0, 0.1), ("gate:25:20", "gated", 0.0, 0.1)]
    {
        let lines = tracked(&folder, &format!("log.csv --na 2 --nb 2,1 --nk 1,2 --outliers {rule}"));
        let worst = (500..2000).map(|row| farthest(&lines[row])).fold(0.0, f64::max);
        assert!((least..most).contains(&worst), "{rule}: {worst}");
        for k in (550..2000).step_by(100) {
            assert_eq!(lines[k]["action"], action, "{rule}, row {}", k + 1);
            assert!(number(&lines[k], "/nis") > 25.0);
        }
    }
    folder.assert_refused(
        "track log.csv --na 2 --nb 2,1 --outliers huber:0.1",
        2,
        "--outliers: 'huber:0.1' is no rule; write used, huber:THRESHOLD",
    );
}

#[test]
fn a_warm_start_goes_on_from_a_fit() {
    let Experiment { u, y } = Experiment::new(3000);
    let folder = Folder::with_log(csv(&[("u", &u[..2000]), ("y", &y[..2000])]));
    folder.write("next.csv", csv(&[("u", &u[2000..]), ("y", &y[2000..])]));
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let lines = tracked(&folder, "next.csv --warm model.json --forgetting 1");
    // From the first full regressor on it predicts as well as ever.
    let errors: Vec<f64> = lines.iter().filter_map(|line| line["innovation"].as_f64()).collect();
    assert_eq!(errors.len(), 998);
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!(rms(&errors[..100]) < 1.2 * rms(&errors[100..]), "{} {}", rms(&errors[..100]), rms(&errors));
    assert!(lines[20]["a1_se"].as_f64().is_some_and(|error| error > 0.0));

    folder.done("fit log.csv --model oe --nb 2 --nf 2 --report oe.json");
    let refusal = folder.refused("track next.csv --warm oe.json", 3);
    let words = "error: oe.json: the report has OE(2, 2, 1): only AR, ARX, ARMA, ARMAX and nonlinear ARX can be tracked";
    assert_eq!(refusal, words);
    let run = folder.run("track next.csv --warm model.json --na 3");
    assert!(run.code == 2 && run.stderr.contains("--na: does not work with --warm"), "{}", run.stderr);
}

#[test]
fn armax_is_tracked_by_both_methods() {
    let mut random = Random::new(3);
    let u = random.signal(4000);
    let e = random.signal(4000);
    let v = response(&[1.0], &[(&[1.0, 0.6], &e)], &vec![0.0; 4000]);
    let y = response(&[1.0, -0.8], &[(&[0.0, 1.0], &u)], &v.iter().map(|v| 0.3 * v).collect::<Vec<_>>());
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    for method in ["", "--method els", "--method rpem"] {
        let line = format!("log.csv --na 1 --nb 1 --nc 1 {method} --forgetting 1 --every 4000");
        let lines = tracked(&folder, &line);
        let found = ["a1", "b1", "c1"].map(|name| number(&lines[0], &format!("/{name}")));
        assert!(distance(&found, &[-0.8, 1.0, 0.6]) < 0.05, "{method}: {found:?}");
    }
    let refusal = folder.refused("track log.csv --na 1 --nb 1 --nc 1 --method rls", 2);
    assert!(refusal.starts_with("error: --method: rls has no C"), "{refusal}");
}

#[test]
fn policies_run_side_by_side_and_are_compared() {
    // The gain jumps: who forgets is right afterwards.
    let mut random = Random::new(11);
    let (u, e) = (random.signal(2000), random.signal(2000));
    let y: Vec<f64> = (0..2000)
        .map(|t| if t == 0 { 0.0 } else { (if t < 1000 { 1.0 } else { 2.0 }) * u[t - 1] + 0.05 * e[t] })
        .collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let policies = "1,0.99,selective:0.98,random-walk:1e-4,variable:0.99:0.9:0.001";
    let run = folder.done(&format!("track log.csv --nb 1 --forgetting {policies} --every 2000"));
    let lines = objects(&run.stdout);
    let names: Vec<&str> = lines.iter().map(|line| line["forgetting"].as_str().unwrap()).collect();
    let expected =
        ["none", "exponential:0.99", "selective:0.98", "random-walk:0.0001", "variable:0.99:0.9:0.001"];
    assert_eq!(names, expected);
    assert!((number(&lines[0], "/b1") - 1.5).abs() < 0.1);
    for line in &lines[1..] {
        assert!((number(line, "/b1") - 2.0).abs() < 0.05, "{line}");
    }
    // The summary has them all, as the last lines.
    folder.done(&format!(
        "track log.csv --nb 1 --forgetting {policies} --quiet -o lines.jsonl --summary summary.json"
    ));
    let summary: Value = serde_json::from_str(&folder.read("summary.json")).unwrap();
    assert_eq!((&summary["schema"], number(&summary, "/rows")), (&"thetahat.track/1".into(), 2000.0));
    for (tracker, line) in summary["trackers"].as_array().unwrap().iter().zip(&lines) {
        assert_eq!(tracker["forgetting"], line["forgetting"]);
        assert_eq!(tracker["parameters"][0]["value"], line["b1"]);
        assert_eq!(tracker["parameters"][0]["standard_error"], line["b1_se"]);
    }
    // The table has a line for each, and what forgets predicted better.
    let figure = |policy: &str| -> f64 {
        let row = run.stderr.lines().find(|line| line.starts_with(policy)).unwrap();
        row.split_whitespace().nth(2).unwrap().parse().unwrap()
    };
    assert!(figure("none ") > 2.0 * figure("exponential:0.99 "), "{}", run.stderr);
}

#[test]
fn an_alarm_is_a_line_of_its_own_and_ends_a_run_that_asks_for_it() {
    let mut random = Random::new(5);
    let (u, e) = (random.signal(4000), random.signal(4000));
    let mut y = response(&[1.0, -0.7], &[(&[0.0, 1.0], &u)], &e.iter().map(|e| 0.1 * e).collect::<Vec<_>>());
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let options = "--na 1 --nb 1 --forgetting 0.999 --alarm 1e6";
    let run = folder.done(&format!("track log.csv {options} --stop-on-alarm"));
    assert_eq!(run.stdout.lines().count(), 4000);

    // A sensor that drifts off.
    y[3000..].iter_mut().for_each(|y| *y += 0.5);
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    let lines = tracked(&folder, &format!("log.csv {options}"));
    let alarms = event(&lines, "alarm");
    let row = number(alarms[0], "/row");
    assert!((3001.0..3020.0).contains(&row), "{alarms:?}");
    assert!(number(alarms[0], "/statistic") > 5.0 && number(alarms[0], "/samples") <= row - 3000.0 + 2.0);
    assert!(["mean_up", "variance"].contains(&alarms[0]["chart"].as_str().unwrap()));
    assert_eq!(event(&lines, "sample").len(), 4000);

    let run = folder.run(&format!("track log.csv {options} --stop-on-alarm"));
    assert_eq!(run.code, 7, "{}", run.stderr);
    let lines = objects(&run.stdout);
    assert_eq!(lines.last().unwrap()["event"], "alarm");
    assert_eq!(number(lines.last().unwrap(), "/row"), row);
    assert!(run.stderr.lines().last().unwrap().contains(&format!("log.csv: an alarm in row {row}")));
}

#[test]
fn csv_has_the_same_columns() {
    let Experiment { u, y } = Experiment::new(300);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let options = "log.csv --na 1 --nb 1 --horizon 3 --alarm 1000";
    let objects = tracked(&folder, options);
    let table = folder.done(&format!("track {options} --format csv")).stdout;
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let header: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    assert_eq!(header[..4], ["event", "row", "action", "measured"]);
    let mut rows = 0;
    for (record, object) in reader.records().zip(&objects) {
        rows += 1;
        for (name, field) in header.iter().zip(record.unwrap().iter()) {
            match &object[name] {
                Value::Null => assert_eq!(field, "", "{name}"),
                Value::String(word) => assert_eq!(field, word),
                number => assert_eq!(field.parse::<f64>().ok(), number.as_f64(), "{name}"),
            }
        }
    }
    assert_eq!(rows, objects.len());
}

#[test]
fn a_forecast_is_what_the_model_says_with_inputs_held() {
    // y(t) = 0.5 y(t-1) + u(t-1) without noise: three steps ahead of a held input.
    let u: Vec<f64> = (0..200).map(|t| f64::from(t / 7 % 3)).collect();
    let y = response(&[1.0, -0.5], &[(&[0.0, 1.0], &u)], &[0.0; 200]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let lines = tracked(&folder, "log.csv --na 1 --nb 1 --horizon 3 --start exact");
    for (t, line) in lines.iter().enumerate().skip(100) {
        let expected = 0.125 * y[t] + 1.75 * u[t];
        assert!((number(line, "/forecast") - expected).abs() < 1e-9, "{line}");
    }
}

#[test]
fn offsets_are_taken_off_or_estimated() {
    let Experiment { u, y } = Experiment::new(2000);
    // Its own offsets are 5 and 20.
    let (u, y): (Vec<f64>, Vec<f64>) = u.iter().zip(&y).map(|(u, y)| (u + 15.0, y - 320.0)).unzip();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let last = |options: &str| {
        tracked(&folder, &format!("log.csv --na 2 --nb 2 --forgetting 1 --every 2000 {options}")).remove(0)
    };
    let known = last("--offset u=20 --offset y=-300");
    let found = last("--constant");
    for name in ["a1", "a2", "b1", "b2"] {
        let (known, found) = (number(&known, &format!("/{name}")), number(&found, &format!("/{name}")));
        assert!((known - found).abs() < 0.02, "{name}: {known} {found}");
    }
    // The constant makes up for the first values not being the offsets: 0 = A(1) (y0 - y_1) - B(1) (u0 - u_1) -
    // constant.
    let sum = |names: &[&str]| names.iter().map(|name| number(&found, &format!("/{name}"))).sum::<f64>();
    let expected = (1.0 + sum(&["a1", "a2"])) * (-300.0 - y[0]) - sum(&["b1", "b2"]) * (20.0 - u[0]);
    assert!((number(&found, "/constant") - expected).abs() < 0.1, "{expected} {found}");
    assert!((number(&known, "/predicted") + 300.0).abs() < 20.0);
}

#[test]
fn missing_values_gaps_and_malformed_lines() {
    let Experiment { u, y } = Experiment::new(200);
    let mut rows: Vec<String> =
        u.iter().zip(&y).enumerate().map(|(t, (u, y))| format!("{},{u},{y}", t as f64 * 0.5)).collect();
    rows[60] = format!("30.0,{},", u[60]);
    rows[80] = "40.0,x,1".to_owned();
    rows.drain(120..130);
    let folder = Folder::with_log(format!("t,u,y\n{}\n", rows.join("\n")));
    let scales = "--scale u=1 --scale y=3";
    let run = folder.done(&format!("track log.csv --time t --na 1 --nb 1 {scales}"));
    let lines = objects(&run.stdout);
    let actions = |row: f64| -> Vec<&Value> {
        lines.iter().filter(|line| number(line, "/row") == row).map(|line| &line["action"]).collect()
    };
    assert_eq!(actions(61.0), ["missing"]);
    assert!(lines.iter().any(|line| number(line, "/row") == 61.0 && line["predicted"].is_f64()));
    assert_eq!(actions(62.0), ["not ready"]);
    // Of the malformed line only the clock tells; both holes in time are gaps.
    assert!(actions(81.0).is_empty());
    let gaps: Vec<f64> = event(&lines, "gap").iter().map(|gap| number(gap, "/row")).collect();
    assert_eq!(gaps, [82.0, 121.0]);
    assert_eq!(lines.iter().find(|line| line["event"] == "gap").unwrap()["time"], 40.5);
    assert!(
        run.stderr.contains("warning: log.csv:82:6: column 'u': \"x\" is not a number"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("190 rows, 1 malformed, 2 gaps"), "{}", run.stderr);

    // Without a clock the line is a sample of missing values.
    let lines = tracked(&folder, &format!("log.csv --na 1 --nb 1 {scales}"));
    assert_eq!(lines[80]["action"], "malformed");
    assert_eq!(event(&lines, "sample").len(), 190);

    let run = folder.run("track log.csv --na 1 --nb 1 --strict");
    assert_eq!(run.code, 3);
    assert_eq!(run.stdout.lines().count(), 80);
    assert!(run.stderr.contains("error: log.csv:82:6: column 'u': \"x\" is not a number"), "{}", run.stderr);
}

#[test]
fn a_clock_that_goes_back_is_a_gap_or_an_error() {
    let folder = Folder::with_log("t,u,y\n0,1,1\n1,2,1\n1,2,1\n2,1,2\n1,2,3\n2,1,2\n");
    let run = folder.done("track log.csv --time t --nb 1");
    let lines = objects(&run.stdout);
    assert_eq!(event(&lines, "gap").iter().map(|gap| number(gap, "/row")).collect::<Vec<_>>(), [5.0]);
    // The row that is there twice is no sample.
    let rows: Vec<f64> = event(&lines, "sample").iter().map(|line| number(line, "/row")).collect();
    assert_eq!(rows, [1.0, 2.0, 4.0, 5.0, 6.0]);
    for words in [
        "warning: log.csv:4: the time is that of the row before",
        "warning: log.csv:6: the time is before that of the row before",
        "6 rows, 1 malformed, clock set back once, 1 gap\n",
    ] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    let run = folder.run("track log.csv --time t --nb 1 --strict");
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("error: log.csv:4: the time is that of the row before"), "{}", run.stderr);
}

#[test]
fn values_that_are_too_large_do_not_end_a_run() {
    let Experiment { u, mut y } = Experiment::new(300);
    y[200] = 1e200;
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let lines = tracked(&folder, "log.csv --na 1 --nb 1");
    assert_eq!(lines[200]["action"], "too large");
    assert_eq!(lines[250]["action"], "updated");
    assert!((number(&lines[250], "/a1") - number(&lines[199], "/a1")).abs() < 0.3);
}

/// A run that does not do what was asked: the line that says why.
fn refused(folder: &Folder, line: &str, code: i32) -> String {
    let Run { code: found, stderr, stdout } = folder.run(&format!("track {line}"));
    assert_eq!((found, stdout.as_str()), (code, ""), "track {line}: {stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    stderr.lines().find(|line| line.starts_with("error: ")).expect("it says why").to_owned()
}

/// Two outputs that feed each other, of two inputs, and some noise.
fn two_outputs(samples: usize) -> String {
    let [u1, u2, e1] = two_inputs(samples);
    let e2: Vec<f64> = Random::new(9).signal(samples);
    let (mut y1, mut y2) = (vec![0.0; samples], vec![0.0; samples]);
    for t in 1..samples {
        y1[t] = 0.8 * y1[t - 1] - 0.1 * y2[t - 1] + u1[t - 1] + 0.02 * e1[t];
        y2[t] = 0.3 * y1[t - 1] + 0.6 * y2[t - 1] - u2[t - 1] + 0.05 * e2[t];
    }
    csv(&[("u1", &u1), ("u2", &u2), ("y1", &y1), ("y2", &y2)])
}

#[test]
fn several_outputs_end_at_the_batch_fit() {
    let folder = Folder::with_log(two_outputs(1500));
    let batch = folder.fit("log.csv -y y1,y2 --na 2 --nb 2 --couple full --detrend none --constant no");
    let outcome = &batch["estimation"];
    let line = "log.csv -y y1,y2 --na 2 --nb 2 --forgetting 1,0.99 --start exact --every 1500 --horizon 4";
    let lines = tracked(&folder, line);
    let told: Vec<(&Value, &Value)> =
        lines.iter().map(|line| (&line["forgetting"], &line["output"])).collect();
    let (none, short) = (&"none".into(), &"exponential:0.99".into());
    let (y1, y2) = (&"y1".into(), &"y2".into());
    assert_eq!(told, [(none, y1), (none, y2), (short, y1), (short, y2)]);
    for (row, line) in lines[..2].iter().enumerate() {
        for lag in 1..=2 {
            for output in 0..2 {
                let of_batch = number(outcome, &format!("/a/{}/{row}/{output}/value", lag - 1));
                let found = number(line, &format!("/a{}_{lag}", output + 1));
                assert!((found - of_batch).abs() < 1e-9, "{line}");
            }
            for input in 0..2 {
                let of_batch = number(outcome, &format!("/b/{input}/{}/{row}/value", lag - 1));
                let found = number(line, &format!("/b{}_{lag}", input + 1));
                assert!((found - of_batch).abs() < 1e-9, "{line}");
            }
        }
    }
    // With the same forecast as the model's, whose inputs are held.
    assert!(lines.iter().all(|line| line["forecast"].is_f64()));

    // Without coupling each output is tracked as if it were alone.
    let apart = "--na 2 --nb 2 --forgetting 0.98 --every 1500";
    let both = tracked(&folder, &format!("log.csv -y y1,y2 --couple none {apart}"));
    for (name, mine) in ["y1", "y2"].into_iter().zip(&both) {
        let alone = tracked(&folder, &format!("log.csv -y {name} {apart}")).remove(0);
        for (key, value) in alone.as_object().expect("an object") {
            assert_eq!(&mine[key], value, "{key}");
        }
    }
}

#[test]
fn several_outputs_go_on_from_a_state() {
    let log = two_outputs(400);
    let folder = Folder::with_log(log.clone());
    let options = "-y y1,y2 --na 1 --nb 1 --forgetting none,0.98 --alarm 500 --horizon 2 --constant";
    let whole = folder.done(&format!("track log.csv {options} --state whole.json --summary whole.summary"));
    assert!(whole.stderr.contains("exponential:0.98      y2"), "{}", whole.stderr);
    let head: String = log.split_inclusive('\n').take(201).collect();
    folder.write("log.csv", head.as_bytes());
    let first = folder.done(&format!("track log.csv {options} --state half.json"));
    folder.write("log.csv", log.as_bytes());
    let second = folder.done(&format!("track log.csv {options} --state half.json --summary half.summary"));
    assert_eq!(first.stdout + &second.stdout, whole.stdout);
    assert_eq!(folder.read("half.json"), folder.read("whole.json"));
    assert_eq!(folder.read("half.summary"), folder.read("whole.summary"));
    // Other options are another model.
    let other = options.replace("--horizon 2", "--horizon 2 --couple none");
    assert!(folder.run(&format!("track log.csv {other} --state half.json")).code == 3);
}

#[test]
fn several_outputs_are_refused_where_a_model_has_one() {
    let folder = Folder::with_log(two_outputs(50));
    folder.done("fit log.csv -y y1 --na 1 --nb 1 --report one.json");
    folder.done("fit log.csv -y y1,y2 --na 1 --nb 1 --report two.json");
    folder.done("fit log.csv -y y1,y2 --model ss --order 2 --report states.json");
    folder.done("reduce two.json --order 1 -o reduced.json");
    for (code, line, words) in [
        (2, "-y y1,y2 --na 1 --nb 1 --nc 1", "--nc: several outputs are tracked as ARX"),
        (2, "-y y1,y2 --narx poly", "--narx: several outputs"),
        (2, "-y y1,y1 --na 1 --nb 1", "'y1' is named twice"),
        (2, "-y y1 --na 1 --nb 1 --couple full", "--couple: it is for several outputs"),
        (2, "-y y1,y2 --na 1 --nb 1 --couple auto", "invalid value 'auto' for '--couple"),
        (2, "-y y1,y2 --na 1 --nb 1 --scale y1=1", "has none; give one for each channel"),
        (2, "-y y1,y2 --warm one.json", "--output: 2 of the 1 outputs of --warm"),
        (2, "-y y1 --warm two.json", "--output: 1 of the 2 outputs of --warm"),
        (2, "--warm two.json --couple none", "--couple: that of --warm is taken"),
        (3, "--warm states.json", "of several outputs only an ARX model can be tracked"),
        (3, "--warm reduced.json", "the matrices are not those of A and B"),
    ] {
        let message = refused(&folder, &format!("log.csv {line}"), code);
        assert!(message.contains(words), "{line}: {message}");
    }
}

/// What a fit of the first half knows goes on in the second, to the fit of both halves.
#[test]
fn several_outputs_go_on_from_a_fit() {
    let folder = Folder::with_log(two_outputs(800));
    for (couple, nk) in [("full", "1"), ("none", "1"), ("full", "0")] {
        let orders =
            format!("-y y1,y2 --na 2 --nb 2 --nk {nk} --couple {couple} --detrend none --constant no");
        let report = folder.done(&format!("fit log.csv {orders} --estimate 1..400 --report half.json"));
        assert!(!report.stdout.is_empty());
        let whole = folder.fit(&format!("log.csv {orders}"));
        // The first rows fill the delay lines.
        let log = folder.read("log.csv");
        let lines = log.split_inclusive('\n').enumerate();
        let rest: String = lines.filter(|(at, _)| *at == 0 || *at > 398).map(|(_, line)| line).collect();
        folder.write("rest.csv", rest);
        let line = "rest.csv --warm half.json --forgetting none --every 402";
        let lines = tracked(&folder, line);
        assert_eq!(lines.len(), 2, "{lines:?}");
        for (row, line) in lines.iter().enumerate() {
            for output in 0..2 {
                let name = match (couple, output == row) {
                    ("full", _) => format!("/a{}_1", output + 1),
                    (_, true) => "/a1".to_owned(),
                    (_, false) => continue,
                };
                let wanted = number(&whole, &format!("/estimation/a/0/{row}/{output}/value"));
                assert!((number(line, &name) - wanted).abs() < 1e-8, "{couple} {nk}: {line}");
                let error = number(&whole, &format!("/estimation/a/0/{row}/{output}/standard_error"));
                let found = number(line, &format!("{name}_se"));
                assert!((found / error - 1.0).abs() < 0.02, "{couple} {nk}: {found} {error}");
            }
            for input in 0..2 {
                let first = nk.parse::<usize>().expect("a number");
                let wanted = number(&whole, &format!("/estimation/b/{input}/1/{row}/value"));
                let found = number(line, &format!("/b{}_{}", input + 1, first + 1));
                assert!((found - wanted).abs() < 1e-8, "{couple} {nk}: {line}");
            }
        }
    }
}

#[test]
fn bad_options_and_logs_are_refused() {
    let folder = Folder::with_log("u,y\n1,2\n2,3\n");
    let usage = |line: &str| refused(&folder, &format!("log.csv {line}"), 2);
    for (line, words) in [
        ("", "the orders are missing: give --na and --nb, or --warm"),
        ("--na 2", "--nb: missing: give it"),
        ("--nb 1,2", "--nb: 2 values for 1 inputs"),
        ("--nb 1 --forgetting 0.2", "--forgetting: "),
        ("--nb 1 --forgetting fast", "--forgetting: 'fast' is no policy"),
        ("--nb 1 --forgetting 0.99,0.99", "is there twice"),
        ("--nb 1 --start cold", "--start: 'cold' is none"),
        ("--nb 1 --alarm 1", "--alarm: 1 is not a number of samples"),
        ("--nb 1 --scale u=1", "--scale: 'y' has none"),
        ("--nb 1 --scale x=1 --scale u=1 --scale y=1", "--scale: 'x' is no channel"),
        ("--nb 1 --offset u", "--offset: 'u': write it as NAME=VALUE"),
        ("--nb 1 --model armax", "--model: armax needs --nc"),
        ("--nb 1 --nc 1 --model arx", "--nc: an arx model has no C"),
        ("--nb 1 --dead-zone -1", "--dead-zone: "),
        ("--nb 1 --scale u=0 --scale y=1", "--scale: u=0: give the typical magnitude"),
        ("--nb 1 -o log.csv", "would be replaced"),
        ("--nb 1 --state log.csv", "would be replaced"),
        ("--nb 1 --state -", "--state -: a state is kept in a file"),
        ("--nb 1 --state s --summary s", "s is named for two outputs"),
    ] {
        let message = usage(line);
        assert!(message.contains(words), "{line}: {message}");
    }
    assert_eq!(folder.names(), ["log.csv"]);

    for (log, line, words) in [
        ("", "log.csv --nb 1", "the file is empty"),
        ("u,y\n", "log.csv --nb 1", "there are no data rows"),
        ("u,z\n1,2\n", "log.csv --nb 1", "no column is called y"),
        ("v,y\n1,2\n", "log.csv --nb 1", "no column is called u"),
        ("u,y\n1,2\n", "log.csv --nb 1 --time t", "there is no column 't'"),
    ] {
        let folder = Folder::with_log(log);
        let message = refused(&folder, line, 3);
        assert!(message.contains(words), "{log:?} {line}: {message}");
        assert_eq!(folder.names(), ["log.csv"]);
    }
    refused(&folder, "nothing.csv --nb 1", 5);

    // Too short or constant: every row is told, and the table says that there is no estimate.
    for log in ["u,y\n1,2\n", "u,y\n0,2\n0,2\n0,2\n", "u,y\n,\n,\n"] {
        let folder = Folder::with_log(log);
        let run = folder.done("track log.csv --na 1 --nb 1");
        assert_eq!(run.stdout.lines().count(), log.lines().count() - 1);
        assert!(run.stderr.contains("no estimate yet"), "{}", run.stderr);
    }
    let constant = format!("u,y\n{}", "1,2\n".repeat(500));
    let folder = Folder::with_log(constant);
    let last = tracked(&folder, "log.csv --na 1 --nb 1 --every 500").remove(0);
    assert!(["a1", "b1"].iter().all(|name| last[*name].is_f64()), "{last}");
}
