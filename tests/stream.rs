//! `fit --stream` and `inspect --stream`: a log is read once, part by part.

use serde_json::{Value, json};

use crate::harness::{Folder, distance, number, parameters};
use crate::signals::{Experiment, csv, plain_log};

/// More rows than a part has, so that several are put together.
const ROWS: usize = 800_000;

fn deviation(one: &Value, other: &Value) -> f64 {
    distance(&parameters(one), &parameters(other))
}

/// A long log, as text: its parts meet at rows 349,526 and 699,051.
fn long() -> String {
    of(ROWS)
}

fn of(rows: usize) -> String {
    let Experiment { u, y, .. } = Experiment::new(rows);
    csv(&[("u", &u), ("y", &y)])
}

/// Takes 15 s: a stream has more than one part only where it is long: 800,000 rows.
#[test]
fn a_stream_gives_the_model_of_the_whole() {
    let folder = Folder::with_log(long());
    let whole = folder.fit("log.csv --na 2 --nb 2");
    let stream = folder.planned("log.csv --na 2 --nb 2 --stream");
    assert!(deviation(&whole, &stream) < 1e-12);
    for figure in ["/estimation/mse", "/estimation/samples", "/fit/0/percent"] {
        let (whole, stream) = (number(&whole, figure), number(&stream, figure));
        assert!((whole / stream - 1.0).abs() < 1e-11, "{figure}: {whole} {stream}");
    }
    // What takes a second pass is not there.
    assert_eq!(stream["fit"].as_array().map(Vec::len), Some(1));
    assert!(stream["data"]["logs"].as_array().is_some_and(|logs| logs.len() > 1));
    assert_eq!(
        stream["data"]["logs"][1]["file"].as_str().map(|file| file.starts_with("log.csv (rows ")),
        Some(true)
    );
    // From a pipe, and on one thread, the same bytes but for the name.
    let text = folder.read("log.csv");
    let line = "fit - --na 2 --nb 2 --stream --format json";
    let piped = folder.run_on(line, &text);
    assert_eq!(piped.code, 0, "{}", piped.stderr);
    let mut command = folder.command("fit log.csv --na 2 --nb 2 --stream --format json");
    command.env("RAYON_NUM_THREADS", "1");
    let single = crate::harness::Run::of(command).stdout;
    assert_eq!(piped.stdout.replace("\"- (rows", "\"log.csv (rows"), single);
    assert_eq!(serde_json::from_str::<Value>(&single).ok(), Some(stream));
    // The model is as good as any.
    folder.done("fit log.csv --na 2 --nb 2 --stream --report model.json");
    folder.write("short.csv", plain_log());
    folder.done("validate model.json short.csv");
}

#[test]
fn gaps_clocks_and_several_logs_are_what_they_are() {
    let folder = Folder::new();
    let Experiment { u, mut y, .. } = Experiment::new(3000);
    y[700] = f64::NAN;
    let time: Vec<f64> = (0..3000).map(|row| 0.1 * row as f64 + if row > 2000 { 5.0 } else { 0.0 }).collect();
    folder.write("a.csv", csv(&[("t", &time), ("u", &u), ("y", &y)]));
    let other = Experiment::new(500);
    folder.write("b.csv", csv(&[("t", &time[..500]), ("u", &other.u), ("y", &other.y)]));
    for model in
        ["--na 3 --nb 2", "--model ar --na 2", "--na 1 --nb 1 --constant no --detrend none", "--na 0 --nb 30"]
    {
        let whole = folder.fit(&format!("a.csv b.csv --time t {model}"));
        let stream = folder.fit(&format!("a.csv b.csv --time t {model} --stream"));
        assert!(deviation(&whole, &stream) < 1e-12, "{model}");
        assert_eq!(number(&whole, "/estimation/samples"), number(&stream, "/estimation/samples"), "{model}");
        assert_eq!(stream["data"]["segments"], whole["data"]["segments"], "{model}");
        assert_eq!(stream["data"]["time_gaps"], json!(1), "{model}");
    }
}

/// Takes 10 s: rows for several parts, read four times.
#[test]
fn states_are_of_one_pass_too() {
    let folder = Folder::with_log(long());
    for line in ["--model ss", "--model ss --order 2 --weighting moesp --past 12 --future 8"] {
        let whole = folder.fit(&format!("log.csv {line}"));
        let stream = folder.fit(&format!("log.csv {line} --stream"));
        let outcome = |report: &Value, figure: &str| report["estimation"][figure].clone();
        for figure in ["past", "future", "feedthrough", "constant"] {
            assert_eq!(outcome(&whole, figure), outcome(&stream, figure), "{figure}");
        }
        for matrix in ["f", "g", "h", "d", "k"] {
            let values = |report: &Value| {
                let rows = report["model"][matrix].as_array().expect("a matrix").clone();
                let entries = rows.iter().flat_map(|row| row.as_array().expect("a row").clone());
                entries.map(|entry| entry.as_f64().expect("a number")).collect::<Vec<_>>()
            };
            let far = distance(&values(&whole), &values(&stream));
            assert!(far < 1e-9, "{line}: {matrix}: {far:e}");
        }
        let percent = |report: &Value| number(report, "/fit/0/percent");
        assert!((percent(&whole) - percent(&stream)).abs() < 1e-2);
    }
}

#[test]
fn several_outputs_are_of_one_pass_too() {
    let folder = Folder::new();
    let Experiment { u, y, .. } = Experiment::new(300_000);
    let other: Vec<f64> = y.iter().zip(&u).map(|(y, u)| 20.0 + 0.5 * y + (3.0 * u).sin()).collect();
    folder.write("log.csv", csv(&[("u", &u), ("y1", &y), ("y2", &other)]));
    for orders in [
        "--na 2 --nb 2 --couple full",
        "--na 1..3 --nb 1..2 --nk 0",
        "--model arx --na 2 --nb 0 --constant yes",
    ] {
        let whole = folder.fit(&format!("log.csv --output y1,y2 {orders}"));
        let stream = folder.fit(&format!("log.csv --output y1,y2 {orders} --stream"));
        let gains = |report: &Value| report["model"]["k"].clone();
        let numbers = |value: &Value| -> Vec<f64> {
            let rows = value.as_array().into_iter().flatten();
            rows.flat_map(|row| row.as_array().into_iter().flatten().filter_map(Value::as_f64)).collect()
        };
        assert!(distance(&numbers(&gains(&whole)), &numbers(&gains(&stream))) < 1e-11, "{orders}");
        assert_eq!(stream["estimation"]["samples"], whole["estimation"]["samples"], "{orders}");
        assert_eq!(stream["fit"].as_array().map(Vec::len), Some(2), "{orders}");
        let mse = [&whole, &stream].map(|report| number(report, "/estimation/mse"));
        assert!((mse[0] / mse[1] - 1.0).abs() < 1e-11, "{orders}: {mse:?}");
    }
}

#[test]
fn products_are_of_one_pass_too() {
    let folder = Folder::new();
    let Experiment { u, mut y, .. } = Experiment::new(400_000);
    y[300_000] = f64::NAN;
    folder.write("log.csv", csv(&[("u", &u), ("y", &y)]));
    let model = "--narx poly --ny 2 --nu 2 --term 1 --term y(k-1) --term y(k-2) --term u(k-1) --term u(k-2) --term y(k-1)*u(k-1)^2";
    let whole = folder.fit(&format!("log.csv {model}"));
    let stream = folder.fit(&format!("log.csv {model} --stream"));
    assert!(deviation(&whole, &stream) < 1e-12);
    assert_eq!(stream["estimation"]["samples"], whole["estimation"]["samples"]);
    assert!((number(&whole, "/estimation/mse") / number(&stream, "/estimation/mse") - 1.0).abs() < 1e-12);
}

#[test]
fn a_plant_that_rests_for_long_is_no_piece_given_twice() {
    let Experiment { mut u, mut y, .. } = Experiment::new(2000);
    u.resize(ROWS * 2, 3.0);
    y.resize(ROWS * 2, 7.0);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let (whole, stream) = (folder.fit("log.csv --na 2 --nb 2"), folder.fit("log.csv --na 2 --nb 2 --stream"));
    assert!(deviation(&whole, &stream) < 1e-9);
}

#[test]
fn what_one_pass_cannot_do_is_refused() {
    let folder = Folder::with_log(plain_log());
    folder.write("word.csv", "u,y\n1,2\n3,4\n5,six\n");
    folder.write("back.csv", "t,u,y\n0,1,2\n1,3,4\n0.5,5,6\n");
    folder.write("header.csv", "u,y\n");
    folder.write("other.csv", "u1,u2,y\n1,2,3\n4,5,6\n7,8,8\n");
    for (line, code, why) in [
        ("log.csv", 2, "give its orders"),
        ("log.csv --na 1..3 --nb 2", 2, "give its orders"),
        ("log.csv --model oe --nb 2 --nf 2", 2, "C, D or F"),
        ("log.csv --model ss --order 2 --refine prediction", 2, "a search reads the log again and again"),
        ("other.csv --input u2 --output u1,y --na 1 --nb 1 --nk 1..3", 2, "nk"),
        ("other.csv --input u2 --output u1,y", 4, "lagged signals"),
        ("log.csv --narx poly", 2, "name the products"),
        ("log.csv --narx poly --select cv", 2, "free runs say how many"),
        ("log.csv --narx rbf", 2, "found from the samples"),
        ("other.csv --input u2 --output u1,y --narx poly --term 1", 2, "one output"),
        ("log.csv --narx poly --term y(k-1) --html page.html", 2, "--html"),
        ("log.csv --na 2 --nb 2 --html page.html", 2, "--html"),
        ("log.csv --na 2 --nb 2 --split 60/20/20", 2, "all rows of a piece"),
        ("log.csv --na 2 --nb 2 --detrend linear", 2, "mean or none"),
        ("log.csv --na 2 --nb 2 --norm 1", 2, "least squares"),
        ("log.csv --na 2 --nb 2 --time t --resample 0.1:hold", 2, "--resample"),
        ("word.csv --na 1 --nb 1", 3, "word.csv:4:3: column 'y': \"six\""),
        ("back.csv --na 1 --nb 1 --time t", 3, "back.csv:4: "),
        ("header.csv --na 1 --nb 1", 3, "no data rows"),
        ("none.csv --na 1 --nb 1", 5, "none.csv"),
        ("log.csv other.csv --na 1 --nb 1", 3, "other.csv"),
        ("log.csv --na 400 --nb 400", 4, "too few rows"),
    ] {
        let run = folder.run(&format!("fit {line} --stream --report model.json"));
        assert_eq!(run.code, code, "{line}: {}", run.stderr);
        assert!(run.stderr.contains(why), "{line}: {}", run.stderr);
        assert!(!folder.names().contains(&"model.json".to_owned()), "{line}");
    }
}

/// The document of an inspection.
fn inspected(folder: &Folder, line: &str) -> Value {
    let run = folder.done(&format!("inspect {line} --format json"));
    assert_eq!(run.stderr, "");
    serde_json::from_str(&run.stdout).expect("the document is JSON")
}

/// Takes 12 s: rows for two parts.
#[test]
fn an_inspection_of_a_stream_tells_what_the_whole_tells() {
    // Two parts.
    let rows = ROWS / 2;
    let folder = Folder::with_log(of(rows));
    let whole = inspected(&folder, "log.csv");
    let stream = inspected(&folder, "log.csv --stream");
    assert_eq!((&stream["rows"], &stream["log"]), (&json!(rows), &whole["log"]));
    for channel in 0..2 {
        let figure = |of: &Value, name: &str| number(of, &format!("/channels/{channel}/{name}"));
        for name in ["mean", "standard_deviation", "trend"] {
            let (whole, stream) = (figure(&whole, name), figure(&stream, name));
            assert!((whole - stream).abs() <= 1e-9 * whole.abs(), "{name}: {whole} {stream}");
        }
        for name in ["minimum", "maximum", "repeated", "longest_hold", "outlier_count"] {
            assert_eq!(figure(&whole, name), figure(&stream, name), "{name}");
        }
    }
    assert_eq!(whole["excitation"][0]["order"], stream["excitation"][0]["order"]);
    assert_eq!((&stream["delays"][0]["nk"], &whole["delays"][0]["nk"]), (&json!(1), &json!(1)));
    assert_eq!(stream["command"], whole["command"]);
    let words = stream["findings"].to_string();
    // An input that does not step is not that of a step test, of which the rest before it would be missed.
    assert!(words.contains("those of the first 100000 rows") && !words.contains("left out"), "{words}");
    // A pipe gives the same bytes, and the number of threads does not matter.
    let piped = folder.run_on("inspect - --stream --format json", folder.read("log.csv"));
    let mut command = folder.command("inspect log.csv --stream --format json");
    command.env("RAYON_NUM_THREADS", "1");
    let single = crate::harness::Run::of(command).stdout;
    assert_eq!(piped.stdout.replace("\"-\"", "\"log.csv\"").replace("fit -", "fit log.csv"), single);
    assert_eq!(serde_json::from_str::<Value>(&single).ok(), Some(stream));
}

#[test]
fn an_inspection_of_one_part_has_the_same_bytes() {
    let folder = Folder::with_log(plain_log());
    for line in ["inspect log.csv", "inspect log.csv --format json", "inspect log.csv -u u"] {
        assert_eq!(folder.done(line).stdout, folder.done(&format!("{line} --stream")).stdout, "{line}");
    }
    folder.done("inspect --each log.csv --table each.csv");
    folder.done("inspect --each log.csv --table stream.csv --stream");
    assert_eq!(folder.read("each.csv"), folder.read("stream.csv"));
}

#[test]
fn a_stream_that_cannot_be_inspected_leaves_nothing() {
    let folder = Folder::with_log(plain_log());
    folder.write("word.csv", "u,y\n1,2\n3,4\n5,six\n");
    folder.write("words.csv", "u,y\na,b\n");
    folder.write("header.csv", "u,y\n");
    folder.write("still.csv", "t,u,y\n1,1,2\n1,3,4\n");
    let mut late = of(ROWS / 2);
    late.push_str("1,two\n");
    folder.write("late.csv", late);
    for (line, code, why) in [
        ("log.csv --html page.html", 2, "--html"),
        ("log.csv --time t --resample 0.1:hold", 2, "--resample"),
        ("word.csv", 3, "word.csv:4:3: column 'y': \"six\""),
        ("words.csv", 3, "no column holds numbers"),
        ("header.csv", 3, "no data rows"),
        ("still.csv --time t", 3, "never advances"),
        ("late.csv", 3, "late.csv:400002:3: column 'y': \"two\""),
        ("none.csv", 5, "none.csv"),
    ] {
        let run = folder.run(&format!("inspect {line} --stream --format json -o found.json"));
        assert_eq!(run.code, code, "{line}: {}", run.stderr);
        assert!(run.stderr.contains(why), "{line}: {}", run.stderr);
        assert!(!folder.names().contains(&"found.json".to_owned()), "{line}");
    }
}
