//! Nonlinear ARX models and their reports in every verb.

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::{Random, csv};

/// A plant whose gain grows with its input.
fn plant(rows: usize) -> String {
    let mut random = Random::new(1);
    let u: Vec<f64> = random.signal(rows);
    let mut y = vec![3.0];
    for k in 1..rows {
        let x = u[k - 1];
        y.push(3.0 + 0.5 * (y[k - 1] - 3.0) + x + 0.4 * x * x + 0.05 * random.uniform());
    }
    csv(&[("u", &u), ("y", &y)])
}

#[test]
fn every_verb_takes_a_network() {
    let folder = Folder::with_log(plant(700));
    folder.fit("log.csv --narx tanh --units 2 --ridge 0.1 --sample-time 0.1 --estimate 1..500 --validate 501..700 --html page.html --report model.json");
    let page = folder.read("page.html");
    assert!(page.contains("tanh network, 2 units") && page.contains("Slices of g"));
    let run = folder.done("validate model.json log.csv --sample-time 0.1 --rows 501..700 --require fit>=90");
    assert!(run.stdout.contains("NARX tanh network, 2 units"), "{}", run.stdout);
    for line in [
        "predict model.json log.csv --sample-time 0.1 --horizon 4 --rows 501..700",
        "simulate model.json log.csv --sample-time 0.1 --clamp",
        "track log.csv --warm model.json --sample-time 0.1",
        "filter model.json log.csv --measurement-noise 0.1 --smooth",
    ] {
        assert!(folder.done(line).stdout.lines().count() > 200, "{line}");
    }
    // Rows were held out from its fit.
    let run = folder.done("simulate model.json log.csv --sample-time 0.1").stdout;
    assert!(run.starts_with("row,measured,predicted,standard_deviation\n"), "{run}");
    assert!(run.lines().last().is_some_and(|line| line.split(',').all(|value| !value.is_empty())), "{run}");
    let auto = folder.fit("log.csv --narx auto --ny 2 --nu 2 --sample-time 0.1 --split 50/30/20");
    let outcome = &auto["estimation"]["maps"][0];
    assert_eq!(outcome["path"].as_array().map(Vec::len), Some(7));
    // No time leaves the linear model, and says what was not tried.
    let hurried = folder
        .done("fit log.csv --narx auto --ny 2 --nu 2 --sample-time 0.1 --time-limit 1e-6 --report h.json");
    assert!(hurried.stderr.contains("6 of 7 models were not tried"), "{}", hurried.stderr);
    let report: Value = serde_json::from_str(&folder.read("h.json")).expect("a report");
    assert_eq!(report["model"]["kind"], "polynomial");
    for (options, words) in [
        ("--narx tanh --terms 3", "units"),
        ("--narx poly --starts 3", "--starts"),
        ("--narx tanh --units 0", "--units"),
        ("--narx poly --drawn", "--drawn"),
        ("--narx auto --select mdl", "--select"),
        ("--narx tanh --select cv", "--select"),
        ("--narx tanh --units 400", "--units"),
        ("--narx tanh --focus 0", "--focus"),
    ] {
        let run = folder.run(&format!("fit log.csv --sample-time 0.1 {options} --report none.json"));
        assert!(run.code != 0 && run.stderr.contains(words), "{options}: {}", run.stderr);
        assert!(run.stderr.lines().count() < 4, "{options}: {}", run.stderr);
    }
    for wrong in ["-1", "nan", "0.1,0.2"] {
        folder.assert_refused(
            &format!("filter model.json log.csv --measurement-noise {wrong}"),
            2,
            "--measurement-noise",
        );
    }
}

#[test]
fn every_verb_takes_the_report() {
    let folder = Folder::with_log(plant(900));
    folder.fit("log.csv --narx poly --sample-time 0.1 --split 60/20/20 --html page.html --report model.json");
    folder.fit("log.csv --na 2 --nb 2 --sample-time 0.1 --estimate 1..720 --report line.json");
    let page = folder.read("page.html");
    for words in ["Complexity", "Slices of g", "Path of the choice", "u(k-1)^2"] {
        assert!(page.contains(words), "{words}");
    }
    let run = folder.done(
        "validate model.json log.csv --sample-time 0.1 --rows 721..900 --require fit>=90 --require white",
    );
    assert!(
        run.stdout.contains("no u^2 in errors") && run.stdout.contains("NARX polynomial"),
        "{}",
        run.stdout
    );
    let run = folder.done("validate line.json log.csv --sample-time 0.1 --rows 721..900");
    assert!(run.stdout.contains("no u^2 in errors") && run.stdout.contains("nonlinear"), "{}", run.stdout);
    let run = folder.done("compare model.json line.json log.csv --sample-time 0.1 --rows 721..900");
    assert!(run.stdout.contains("ARX(2, 2, 1)"), "{}", run.stdout);
    for (line, columns) in [
        (
            "predict model.json log.csv --sample-time 0.1 --horizon 4",
            "row,measured,predicted,standard_deviation",
        ),
        ("simulate model.json log.csv --sample-time 0.1", "row,measured,predicted,standard_deviation"),
    ] {
        let run = folder.done(line);
        assert_eq!(run.stdout.lines().next(), Some(columns), "{line}");
        assert_eq!(run.stdout.lines().count(), 901, "{line}");
    }
    for line in ["bode model.json", "step model.json", "impulse model.json"] {
        let run = folder.run(line);
        assert_eq!(run.code, 3, "{line}");
        assert!(
            run.stderr.contains("it predicts, simulates, validates and compares"),
            "{line}: {}",
            run.stderr
        );
    }
}

#[test]
fn forecasts_go_on_with_known_inputs() {
    let text = plant(300);
    let open: String = text
        .lines()
        .enumerate()
        .map(|(line, text)| match text.split_once(',') {
            Some((u, _)) if line > 290 => format!("{u},\n"),
            _ => format!("{text}\n"),
        })
        .collect();
    let folder = Folder::with_log(text);
    folder.fit("log.csv --narx poly --sample-time 0.1 --terms 5 --report model.json");
    folder.write("open.csv", open);
    let run = folder.done("predict model.json open.csv --sample-time 0.1 --horizon 20");
    let (log, said) = (folder.read("log.csv"), run.stdout);
    let truth = log.lines().skip(1).filter_map(|line| line.split(',').nth(1)?.parse::<f64>().ok());
    let forecast: Vec<(f64, f64, f64)> = said
        .lines()
        .skip(1)
        .zip(truth)
        .skip(290)
        .filter_map(|(line, truth)| {
            let cells: Vec<&str> = line.split(',').collect();
            Some((cells[2].parse().ok()?, cells[3].parse().ok()?, truth))
        })
        .collect();
    assert_eq!(forecast.len(), 10, "{said}");
    for (value, deviation, truth) in forecast {
        assert!((value - truth).abs() < 4.0 * deviation, "{value} ± {deviation}, {truth}");
    }
}

#[test]
fn bad_options_and_logs_are_told() {
    let folder = Folder::with_log(plant(60));
    for (options, words) in [
        ("--narx cubic", "cubic"),
        ("--narx spline --units 0", "--units"),
        ("--narx spline --units 100000", "--units"),
        ("--narx spline --degree 2", "--degree"),
        ("--narx poly --units 3", "--units: it is for --narx spline, --narx local, --narx knn, --narx tanh"),
        ("--narx poly --membership gaussian", "--membership"),
        ("--na 1 --nb 1 --membership gaussian", "--narx"),
        ("--narx poly --term y(k-7)", "none of the regressors"),
        ("--narx poly --term y(k-1) --term y(k-1)", "--term: y(k-1) is given twice"),
        ("--narx poly --term y(k-1) --terms 3", "does not work with --"),
        ("--narx poly --term y(k-1) --degree 3", "does not work with --"),
        ("--narx rbf --term y(k-1)", "--term"),
        ("--na 1 --nb 1 --term y(k-1)", "--narx"),
        ("--narx local --units 0", "one local model"),
        ("--narx local --units 50", "50 local models are asked for"),
        ("--narx local --terms 5", "--terms"),
        ("--narx local --membership round", "round"),
        ("--narx local --degree 2", "--degree"),
        ("--narx knn --units 58", "57"),
        ("--narx knn --units 65", "--units"),
        ("--narx knn --select mdl", "--select"),
        ("--narx knn --units 3 --select cv", "--select"),
        ("--narx knn --ridge 1", "--ridge"),
        ("--narx knn --most-terms 3", "--most-terms"),
        ("--na 1 --nb 1 --units 3", "--narx"),
        ("--narx poly --na 2", "does not work with --"),
        ("--narx poly --degree 0", "degree"),
        ("--narx poly --degree 99", "highest degree"),
        ("--narx poly --ny 0 --nu 0", "reads nothing"),
        ("--narx poly --terms 0", "one function"),
        ("--narx poly --terms 3 --select mdl", "does not work with --"),
        ("--narx poly --nu 1,2,3", "3 numbers for 1 inputs"),
        ("--narx poly --nk 1..3", "one delay"),
        ("--narx poly --centres grid:3", "--centres"),
        ("--narx rbf --degree 2", "--degree"),
        ("--narx rbf --centres here", "--centres: here"),
        ("--narx rbf --centres kmeans:0", "--centres"),
        ("--narx rbf --width -1", "--width"),
        ("--narx poly --ridge -1", "--ridge"),
        ("--narx poly --select validation", "--validate"),
        ("--narx poly --nu 0 --input u", "--nu: 0"),
        ("--degree 2", "--narx"),
        ("--na 1 --nb 1 --degree 2", "--narx"),
        ("--na 1 --nb 1 --raw-terms", "--narx"),
        ("--narx poly --estimate 1..3", "rows"),
        ("--narx poly --estimate 1..20 --ny 5 --nu 5 --terms 66", "functions"),
    ] {
        let run = folder.run(&format!("fit log.csv --sample-time 0.1 {options} --report report.json"));
        assert!([2, 3, 4].contains(&run.code), "{options}: {}", run.code);
        assert!(run.stderr.contains(words), "{options}: {}", run.stderr);
        assert!(!folder.path("report.json").exists(), "{options}");
    }
}

/// Logs that cannot be used, or not by all maps: a sentence that says what is wrong with what, the exit code, and
/// nothing written.
#[test]
fn bad_logs_are_told() {
    let folder = Folder::new();
    let log = |name: &str, u: &dyn Fn(usize) -> f64, y: &dyn Fn(usize) -> f64| {
        let column = |of: &dyn Fn(usize) -> f64| (0..40).map(of).collect::<Vec<f64>>();
        folder.write(name, csv(&[("u", &column(u)), ("y", &column(y))]));
    };
    let wave = |row: usize| ((row * row) % 7) as f64 - 3.0;
    let other = |row: usize| ((row * row * row) % 11) as f64;
    log("constant.csv", &wave, &|_| 1.0);
    log("still.csv", &|_| 1.0, &wave);
    log("nan.csv", &wave, &|_| f64::NAN);
    log("huge.csv", &wave, &|row| 1e300 * other(row));
    log("large.csv", &wave, &|row| 1e20 * other(row));
    log("spike.csv", &|row| if row == 9 { 1e300 } else { wave(row) }, &other);
    log("tiny.csv", &|row| 1e-300 * wave(row), &other);
    log("same.csv", &wave, &wave);
    log("good.csv", &wave, &other);
    folder.write("empty.csv", "");
    folder.write("header.csv", "u,y\n");
    folder.write("one.csv", "u,y\n1,2\n");
    folder.write("infinite.csv", "u,y\n1,2\n2,inf\n");
    let maps = ["poly", "rbf", "spline", "local", "knn"];
    for (log, options, code, words) in [
        ("empty", "", 3, "empty.csv: the file is empty"),
        ("header", "", 3, "header.csv:2:1: there are no data rows"),
        ("one", "", 4, "one.csv: output 'y' is constant"),
        ("nan", "", 3, "nan.csv: no estimation row has a value"),
        ("infinite", "", 3, "infinite.csv:3:3: column 'y'"),
        ("constant", "", 4, "output 'y' is constant"),
        ("still", "", 4, "input 'u' is constant"),
        ("huge", "", 3, "squares of 'y' leave the range of numbers; scale"),
        ("spike", "", 3, "squares of 'u' leave the range of numbers; scale"),
        ("tiny", "", 3, "squares of 'u' leave the range of numbers; scale"),
        ("good", "--nk 50", 4, "too few rows for the lags"),
        ("good", "--estimate 1..2", 4, "(reaching back 1), and 1 have them"),
        ("good", "--nk 1001", 2, "--nu: lags above 1000"),
    ] {
        for map in maps {
            let line = format!("fit {log}.csv --narx {map} --ny 1 --nu 1 --sample-time 1 {options}");
            folder.assert_refused(&format!("{line} --report report.json --html page.html"), code, words);
        }
    }
    for (log, options, code, words) in [
        ("same", "--narx rbf", 4, "u(k-1) is a sum of the other functions"),
        ("same", "--narx spline", 4, "u(k-1) is a sum of the other functions"),
        ("same", "--narx local", 4, "regressors are sums of one another"),
        ("good", "--narx local --estimate 1..4", 4, "needs 4 samples at least, and there are 3"),
        ("good", "--narx poly --terms 7", 4, "tell 6 of 6 apart"),
        ("good", "--narx poly --ridge 1e300", 4, "a smaller --ridge"),
        ("large", "--narx poly --degree 12 --raw-terms", 3, "take a lower degree"),
        ("good", "--narx rbf --centres kmeans:40", 2, "40 centres, for 39 samples"),
        ("good", "--narx rbf --centres grid:99999999999", 2, "--centres: a grid of 99999999999"),
        ("good", "--narx rbf --width 1e-300", 2, "--width: 1e-300 is not"),
        ("good", "--narx rbf --width 1e9 --centres kmeans:4", 4, "take fewer lags or centres"),
        ("good", "--narx knn --units 40", 2, "40 neighbours of 39 samples"),
        ("good", "--narx knn --units 35", 4, "39 samples are too few"),
    ] {
        let line = format!("fit {log}.csv --ny 1 --nu 1 --sample-time 1 {options}");
        folder.assert_refused(&format!("{line} --report report.json --html page.html"), code, words);
    }
    assert!(folder.names().iter().all(|name| name.ends_with(".csv")), "{:?}", folder.names());
}

/// What a model says of logs that are not like that of its fit, and of a run without bound: rows without a number are
/// empty.
#[test]
fn responses_without_bound_are_told() {
    let folder = Folder::with_log(plant(200));
    let text = folder.read("log.csv");
    let rows = |change: &dyn Fn(f64) -> f64| -> String {
        let row = |line: &str| {
            let (u, y) = line.split_once(',').expect("there are two columns");
            format!("{u},{}\n", change(y.parse().expect("a number")))
        };
        std::iter::once("u,y\n".to_owned()).chain(text.lines().skip(1).map(row)).collect()
    };
    folder.write("huge.csv", rows(&|y| y * 1e300));
    for map in ["poly", "rbf", "spline", "local", "knn"] {
        folder.fit(&format!("log.csv --narx {map} --sample-time 0.1 --report {map}.json"));
        for verb in ["simulate", "predict", "predict --horizon 3"] {
            let (verb, options) = verb.split_once(' ').unwrap_or((verb, ""));
            let run = folder.done(&format!("{verb} {map}.json huge.csv --sample-time 0.1 {options}"));
            assert!(run.stderr.contains("grow beyond the range of numbers"), "{map} {verb}: {}", run.stderr);
            assert!(!run.stdout.contains("inf") && !run.stdout.contains("NaN"), "{map} {verb}");
        }
        let run = folder.done(&format!("validate {map}.json huge.csv --sample-time 0.1"));
        assert!(run.stderr.contains("the response overflows"), "{map}: {}", run.stderr);
    }
    // Ten times the parameters: g is steep, and its free run leaves all bounds.
    let mut report: Value = serde_json::from_str(&folder.read("poly.json")).expect("it is JSON");
    for parameter in report["model"]["parameters"].as_array_mut().expect("there are parameters") {
        parameter["value"] = (10.0 * number(parameter, "/value")).into();
    }
    folder.write("steep.json", report.to_string());
    let run = folder.done("simulate steep.json log.csv --sample-time 0.1");
    assert!(run.stderr.contains("RMSE none") && run.stderr.contains("grow beyond"), "{}", run.stderr);
    assert!(run.stdout.lines().last().is_some_and(|line| line.ends_with(',')), "{}", run.stdout);
    let run = folder.run("validate steep.json log.csv --sample-time 0.1 --require fit>=50");
    assert_eq!(run.code, 6, "{}", run.stderr);
}

/// Products that are named are those that a choice finds, with the same parameters, in the order that they are named
/// in.
#[test]
fn products_are_taken_by_name() {
    let folder = Folder::with_log(plant(500));
    let chosen = folder.fit("log.csv --narx poly --sample-time 0.1 --terms 3 --report model.json");
    let mut names: Vec<(String, f64)> = chosen["model"]["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| (one["name"].as_str().unwrap().to_owned(), one["value"].as_f64().unwrap()))
        .collect();
    names.reverse();
    let options: String = names.iter().map(|(name, _)| format!(" --term {name}")).collect();
    let named = folder.fit(&format!("log.csv --narx poly --sample-time 0.1{options} --report named.json"));
    for (own, (name, value)) in named["model"]["parameters"].as_array().unwrap().iter().zip(&names) {
        assert_eq!(own["name"].as_str(), Some(name.as_str()));
        let found = own["value"].as_f64().unwrap();
        assert!((found - value).abs() < 1e-12 * value.abs().max(1.0), "{name}: {found} {value}");
    }
    assert_eq!(named["estimation"]["maps"][0]["selected_by"], "given");
}

/// Two outputs are two maps of one model in every verb, and so are expressions of channels.
#[test]
fn several_outputs_and_expressions_take_every_verb() {
    let text = plant(900);
    let mut random = Random::new(5);
    let (mut level, mut before) = (4.0_f64, 0.0);
    let lines = text.lines().skip(1).map(|line| {
        level += 0.3 * (2.0 + before - level.sqrt()) + 1e-3 * random.uniform();
        before = line.split(',').next().and_then(|cell| cell.parse().ok()).expect("it is a number");
        format!("{line},{level}\n")
    });
    let folder = Folder::with_log(std::iter::once("u,y,z\n".to_owned()).chain(lines).collect::<String>());
    let options =
        "--output y,z --narx poly --ny 1,1 --nu 1 --regressor sqrt(z) --sample-time 0.1 --split 60/20/20";
    let report = folder.fit(&format!("log.csv {options} --html page.html --report model.json"));
    let names: Vec<&str> = report["model"]["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|one| one["name"].as_str())
        .collect();
    // In the held-out rows the level rises above what it was before: models that follow it there are not put last.
    assert!(names.contains(&"y: u(k-1)^2") && names.contains(&"z: sqrt(z)(k-1)"), "{names:?}");
    assert_eq!(report["estimation"]["maps"].as_array().map(Vec::len), Some(2));
    let page = folder.read("page.html");
    assert!(page.contains("y: Choice of functions") && page.contains("z: Choice of functions"));
    let table = folder.done(&format!("fit log.csv {options}")).stdout;
    assert!(table.contains("output y") && table.contains("z: forward regression"), "{table}");
    let run = folder.done("predict model.json log.csv --sample-time 0.1 --horizon 3");
    let header =
        "row,measured_y,predicted_y,standard_deviation_y,measured_z,predicted_z,standard_deviation_z";
    assert_eq!(run.stdout.lines().next(), Some(header));
    assert_eq!(run.stdout.lines().count(), 901);
    let run = folder.done("simulate model.json log.csv --sample-time 0.1 -o run.csv");
    assert!(run.stderr.contains("y: fit ") && run.stderr.contains("z: fit "), "{}", run.stderr);
    let run = folder.done("simulate model.json log.csv --sample-time 0.1 --clamp -o run.csv");
    assert!(run.stderr.contains("kept within 1.1 times the range"), "{}", run.stderr);
    folder.done(
        "validate model.json log.csv --sample-time 0.1 --rows 721..900 --require fit>=90 --format json",
    );
    folder.done("compare model.json log.csv --sample-time 0.1 --rows 721..900");
    for (line, code, words) in [
        ("track log.csv --warm model.json -o t.jsonl", 3, "one output"),
        (
            "fit log.csv --output y,z --model armax --na 1 --nb 1 --nc 1",
            2,
            "--output: a polynomial model with C, D or F has one output",
        ),
        ("fit log.csv --narx poly --output y,y", 2, "named twice"),
        ("fit log.csv --narx poly --output y,z --ny 1,2,3", 2, "3 numbers for 2 outputs"),
        ("fit log.csv --narx poly --regressor sqrt(v)", 2, "unknown name 'v'"),
        ("fit log.csv --narx poly --regressor sqrt(u) --sample-time 0.1", 3, "sqrt(u) is no number in row"),
        ("fit log.csv --regressor sqrt(u) --na 1 --nb 1", 2, "--narx"),
    ] {
        let run = folder.run(line);
        assert_eq!(run.code, code, "{line}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{line}: {}", run.stderr);
        assert!(!folder.path("t.jsonl").exists(), "{line}");
    }
}

/// A report that was edited is refused, whatever is in it.
#[test]
fn damaged_reports_are_refused() {
    let folder = Folder::with_log(plant(60));
    let good = folder.fit("log.csv --narx rbf --centres grid:2 --ny 1 --nu 1 --sample-time 0.1");
    for (place, value) in [
        ("/model/regressors", serde_json::json!([])),
        ("/model/regressors/0/channel", "v".into()),
        ("/model/regressors/0/lag", 0.into()),
        ("/model/regressors/1/scale", 0.into()),
        ("/model/maps/0/functions/centres/0", serde_json::json!([1.0])),
        ("/model/maps/0/functions/widths", serde_json::json!([])),
        ("/model/parameters", serde_json::json!([])),
        ("/model/covariance/0", serde_json::json!([1.0])),
        ("/model/maps/0/scale", (-1).into()),
        ("/model/maps", serde_json::json!([])),
        ("/model/noise_covariance", serde_json::json!([[1.0, 0.0], [0.0, 1.0]])),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(place).expect("it is there") = value;
        folder.write("bad.json", bad.to_string());
        let run = folder.run("validate bad.json log.csv --sample-time 0.1");
        assert_eq!(run.code, 3, "{place}: {}", run.stdout);
        assert!(run.stderr.contains("edited or damaged"), "{place}: {}", run.stderr);
    }
}

/// A fit goes on online, and products of lags are found without one; the state takes up where it was.
#[test]
fn trackers_take_functions() {
    let folder = Folder::with_log(plant(900));
    let fitted = folder.fit(
        "log.csv --narx poly --ny 1 --nu 1 --sample-time 0.1 --terms 4 --estimate 1..300 --report model.json",
    );
    let names: Vec<&str> = fitted["model"]["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|one| one["name"].as_str())
        .collect();
    let run = folder
        .done("track log.csv --warm model.json --forgetting 1 --summary warm.json --format csv -o warm.csv");
    assert!(run.stderr.contains("NARX polynomial, 4 terms"), "{}", run.stderr);
    let header = folder.read("warm.csv").lines().next().unwrap().to_owned();
    assert!(names.iter().all(|name| header.contains(&format!(",{name},"))), "{header}");

    // Without forgetting, all products of lags: y(k-1)/2 + u(k-1) + 0.4 u(k-1)^2 about 3, by their true names.
    let options = "--narx poly --ny 1 --nu 1 --degree 2 --forgetting 1 --offset y=3 --scale y=1 --scale u=1";
    folder.done(&format!("track log.csv {options} --summary all.json -o all.jsonl"));
    let summary: Value = serde_json::from_str(&folder.read("all.json")).unwrap();
    for parameter in summary["trackers"][0]["parameters"].as_array().unwrap() {
        let truth = match parameter["name"].as_str().unwrap() {
            "y(k-1)" => 0.5,
            "u(k-1)" => 1.0,
            "u(k-1)^2" => 0.4,
            _ => 0.0,
        };
        let error = (number(parameter, "/value") - truth).abs();
        assert!(error < 4.0 * number(parameter, "/standard_error"), "{parameter}");
    }
    assert_eq!(summary["trackers"][0]["map"]["terms"].as_array().unwrap().len(), 6);

    // In two runs with a state it writes what it writes in one.
    let text = folder.read("log.csv");
    let half: String = text.lines().take(400).map(|line| format!("{line}\n")).collect();
    folder.write("half.csv", half);
    let with = format!("{options} --state state.json -o parts.jsonl --horizon 5");
    folder.done(&format!("track half.csv {with}"));
    folder.write("half.csv", text);
    folder.done(&format!("track half.csv {with}"));
    folder.done(&format!("track log.csv {options} --horizon 5 -o whole.jsonl"));
    assert_eq!(folder.read("parts.jsonl"), folder.read("whole.jsonl"));
    let other = folder.run(&format!("track half.csv {with} --degree 3"));
    assert!(other.code != 0 && !other.stderr.is_empty());

    for (options, words) in [
        ("--narx rbf", "possible values: poly"),
        ("--narx poly --na 2", "--na: does not work with --narx"),
        ("--narx poly --constant", "--constant: does not work with --narx"),
        ("--narx poly --ny 9 --nu 9 --degree 6", "--degree"),
        ("--narx poly --degree 0", "--degree"),
        ("--narx poly --ny 0 --nu 0", "orders"),
        ("--narx poly --nu 1,2", "2 values for 1 inputs"),
        ("--degree 2 --na 1 --nb 1", "--narx"),
        ("--warm model.json --narx poly", "--narx: does not work with --warm"),
        ("--warm model.json --scale u=1 --scale y=1", "its own scales"),
        ("--warm model.json --start exact", "--start"),
    ] {
        let run = folder.run(&format!("track log.csv {options} -o bad.jsonl"));
        assert!([2, 3].contains(&run.code), "{options}: {}", run.code);
        assert!(run.stderr.contains(words), "{options}: {}", run.stderr);
        assert!(!folder.path("bad.jsonl").exists(), "{options}");
    }
}

/// An additive function of two regressors, with a bend that products of degree two do not have: splines find it, and
/// every verb takes them.
#[test]
fn splines_find_what_bends() {
    let mut random = Random::new(7);
    let u: Vec<f64> = random.signal(1500);
    let mut y = vec![0.0];
    for k in 1..1500 {
        y.push(0.4 * y[k - 1] + (3.0 * u[k - 1]).tanh() + 0.02 * random.uniform());
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let common = "--ny 1 --nu 1 --sample-time 1 --estimate 1..1000 --validate 1001..1500";
    let fits = |options: &str| {
        let report = folder.fit(&format!("log.csv {options} {common} --report model.json --html page.html"));
        number(&report, "/fit/3/percent")
    };
    let products = fits("--narx poly --degree 2");
    let splines = fits("--narx spline --units 7");
    assert!(splines > 97.0 && splines > products + 5.0, "{splines} {products}");
    assert!(folder.read("page.html").contains("bend(u(k-1)"));
    let table = folder.done("validate model.json log.csv --sample-time 1 --rows 1001..1500").stdout;
    assert!(table.contains("NARX splines"), "{table}");
    folder.done("simulate model.json log.csv --sample-time 1 -o run.csv");
    folder.done("predict model.json log.csv --sample-time 1 --horizon 3 -o predicted.csv");
    folder.done("compare model.json log.csv --sample-time 1");
    let run = folder.done("track log.csv --warm model.json --forgetting 1 -o tracked.jsonl");
    assert!(run.stderr.contains("NARX splines"), "{}", run.stderr);

    let good: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
    for (place, value) in [
        ("/model/maps/0/functions/knots/0", serde_json::json!([1.0, 0.0, 2.0])),
        ("/model/maps/0/functions/regressors/0", 9.into()),
        ("/model/maps/0/functions/regressors", serde_json::json!([])),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(place).expect(place) = value;
        folder.write("bad.json", bad.to_string());
        let run = folder.run("simulate bad.json log.csv --sample-time 1");
        assert_eq!(run.code, 3, "{place}: {}", run.stderr);
    }
}

/// Local models and stored samples go through every verb too; samples have no parameters to track.
#[test]
fn local_models_and_neighbours_take_every_verb() {
    let folder = Folder::with_log(plant(900));
    let common = "--ny 1 --nu 1 --sample-time 0.1 --estimate 1..600 --validate 601..900";
    for (options, name, kind) in [
        ("--narx local", "NARX local models", "local"),
        ("--narx local --membership rectangle --units 4", "NARX local models, 4", "local"),
        ("--narx local --no-linear --membership trapezoid --most-terms 30", "NARX local models", "local"),
        ("--narx knn", "NARX nearest neighbours", "neighbours"),
        ("--narx knn --no-linear --units 5", "NARX nearest neighbours, 5 of 599 samples", "neighbours"),
    ] {
        let report = folder.fit(&format!("log.csv {options} {common} --report model.json --html page.html"));
        assert_eq!(
            report.pointer("/model/maps/0/functions/type").and_then(Value::as_str),
            Some(kind),
            "{options}"
        );
        let percent = number(&report, "/fit/3/percent");
        assert!(percent > 75.0, "{options}: {percent}");
        let page = folder.read("page.html");
        assert!(page.contains("Complexity") && page.contains("Path of the choice"), "{options}");
        let run = folder.done("validate model.json log.csv --sample-time 0.1 --rows 601..900");
        assert!(run.stdout.contains(name) && run.stdout.contains("no u^2 in errors"), "{}", run.stdout);
        folder.done("compare model.json log.csv --sample-time 0.1 --rows 601..900");
        let run = folder.done("predict model.json log.csv --sample-time 0.1 --horizon 3");
        assert_eq!(run.stdout.lines().count(), 901, "{options}");
        folder.done("simulate model.json log.csv --sample-time 0.1");
        let run = folder.run("track log.csv --warm model.json --forgetting 1 -o tracked.jsonl");
        match kind {
            "neighbours" => {
                assert_eq!(run.code, 3, "{}", run.stderr);
                assert!(run.stderr.contains("no parameters to track"), "{}", run.stderr);
            }
            _ => assert!(run.code == 0 && run.stderr.contains(name), "{}", run.stderr),
        }
        let good: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
        let edits = match kind {
            "local" => vec![
                ("/model/maps/0/functions/boxes/0/0", serde_json::json!([1.0, 1.0])),
                ("/model/maps/0/functions/domain", serde_json::json!([[0.0, 1.0]])),
                ("/model/maps/0/functions/membership", "round".into()),
            ],
            _ => vec![
                ("/model/maps/0/functions/count", 0.into()),
                ("/model/maps/0/functions/count", 600.into()),
                ("/model/maps/0/functions/points/0", serde_json::json!([1.0])),
            ],
        };
        for (place, value) in edits {
            let mut bad = good.clone();
            *bad.pointer_mut(place).expect(place) = value;
            folder.write("bad.json", bad.to_string());
            let run = folder.run("simulate bad.json log.csv --sample-time 0.1");
            assert_eq!(run.code, 3, "{options} {place}: {}", run.stderr);
        }
    }
}
