//! `thetahat validate`: how a stored model does on a log, and the gate that it can be.

use serde_json::Value;

use crate::harness::{Answer, Folder, Run, number, numbers};
use crate::signals::{Experiment, Random, csv, response};

/// A log of 600 rows, and reports of models that were fitted to the first 300.
fn folder() -> Folder {
    let folder = Folder::with_log(Experiment::new(600).csv());
    for (name, model) in [
        ("arx", "--na 2 --nb 2"),
        ("wrong", "--na 1 --nb 1 --nk 2"),
        ("oe", "--model oe --nb 2 --nf 2"),
        ("iv", "--method iv --na 2 --nb 2"),
        ("sriv", "--model oe --method sriv --nb 2 --nf 2"),
        ("armax", "--model armax --na 2 --nb 2 --nc 1"),
        ("bj", "--model bj --nb 2 --nc 1 --nd 1 --nf 2"),
        ("ar", "--na 2 --nb 0"),
    ] {
        folder.done(&format!("fit log.csv --estimate 1..300 {model} --report {name}.json"));
    }
    folder
}

fn document(run: &Run) -> Value {
    serde_json::from_str(&run.stdout).expect("the document is JSON")
}

/// `thetahat validate` with these words; the document.
fn validation(folder: &Folder, words: &str) -> Value {
    document(&folder.done(&format!("validate {words} --format json")))
}

#[test]
fn the_figures_are_those_that_predict_and_simulate_give() {
    let folder = folder();
    for model in ["arx", "oe", "armax", "bj", "ar", "iv", "sriv"] {
        let found = validation(&folder, &format!("{model}.json log.csv --rows 301..600 --horizon 4"));
        assert_eq!(found["schema"], "thetahat.validation/1");
        assert_eq!((&found["report"], &found["in_sample"]), (&format!("{model}.json").into(), &"no".into()));
        assert_eq!(found["rows"], serde_json::json!([[301, 600]]));
        let fits = found["fit"].as_array().unwrap();
        assert_eq!(fits.len(), if model == "ar" { 2 } else { 3 });
        for (fit, verb) in fits.iter().zip(["predict", "predict --horizon 4", "simulate"]) {
            let (verb, options) = verb.split_once(' ').unwrap_or((verb, ""));
            let run = folder.done(&format!("{verb} {model}.json log.csv --rows 301..600 {options}"));
            let answer = Answer::read(&run.stdout);
            assert!((number(fit, "/percent") - answer.percent()).abs() < 1e-9, "{model} {verb}");
            assert!((number(fit, "/rmse") - answer.rmse()).abs() < 1e-12);
            let (mean, largest) = answer.absolute_errors();
            assert!((number(fit, "/mean_absolute_error") - mean).abs() < 1e-12);
            assert!((number(fit, "/largest_error") - largest).abs() < 1e-12);
            assert_eq!(fit["samples"], answer.samples());
            assert!(run.stderr.contains(&format!("initial {}", fit["initial"].as_str().unwrap())));
        }
        let mse = number(&fits[0], "/rmse").powi(2);
        assert!((number(&found, "/noise/0/mse") - mse).abs() < 1e-12);
        assert_eq!(found["coverage"].as_array().unwrap().len(), 8);
        let white = !["oe", "iv", "sriv"].contains(&model);
        assert_eq!(found["white_expected"], white);
    }
}

#[test]
fn rows_of_the_fit_are_known() {
    let folder = folder();
    for (rows, seen) in [("1..300", "yes"), ("50..200", "yes"), ("201..400", "partly"), ("301..600", "no")] {
        for model in ["arx", "oe", "armax", "bj", "ar", "iv", "sriv"] {
            let found = validation(&folder, &format!("{model}.json log.csv --rows {rows}"));
            assert_eq!(found["in_sample"], seen, "{model} {rows}");
            assert_eq!(found["residuals"][0]["fitted"] == 0, seen == "no");
        }
    }
    let other = csv(&[("u", &Experiment::new(600).u), ("y", &Random::new(3).signal(600))]);
    folder.write("other.csv", other);
    assert_eq!(validation(&folder, "arx.json other.csv --rows 1..300")["in_sample"], "no");
}

#[test]
fn residuals_are_tested() {
    let folder = folder();
    let found = validation(&folder, "arx.json log.csv --rows 301..600");
    let residuals = &found["residuals"][0];
    assert!(number(residuals, "/ljung_box/p_value") > 0.05 && residuals["samples"] == 300);
    assert_eq!(numbers(&residuals["autocorrelation"]).len(), 26);
    assert_eq!(numbers(&residuals["independence"][0]["correlation"]).len(), 51);
    assert_eq!(residuals["independence"][0]["input"], "u");
    let alphas: Vec<f64> =
        (0..5).map(|k| number(residuals, &format!("/anderson/levels/{k}/alpha"))).collect();
    assert_eq!(alphas, [0.01, 0.02, 0.05, 0.1, 0.2]);
    for k in 0..5 {
        let p_value = number(residuals, &format!("/anderson/levels/{k}/p_value"));
        assert_eq!(residuals["anderson"]["levels"][k]["white"], p_value >= 0.05);
    }

    let run = folder.done("validate wrong.json log.csv --rows 301..600");
    assert!(run.stderr.contains("warning: the residuals are not white"), "{}", run.stderr);
    assert!(run.stderr.contains("depend on past values of input 'u'"), "{}", run.stderr);

    let found = validation(&folder, "arx.json log.csv --lags 7 --alphas 0.3,0.04");
    assert_eq!(found["residuals"][0]["ljung_box"]["lags"], 7);
    assert_eq!(number(&found, "/residuals/0/anderson/levels/0/alpha"), 0.04);
}

#[test]
fn the_table_says_what_the_document_says() {
    let folder = folder();
    let table = folder.done("validate arx.json log.csv --rows 301..600").stdout;
    for part in [
        "arx.json, ARX(2, 2, 1), on log.csv rows 301..600: held out",
        "\nstable\n",
        "1 step ahead   drop",
        "5 steps ahead  drop",
        "free run       estimate",
        "\nerrors          mean |e|  largest |e|\n",
        "errors one step ahead: mean square ",
        "residuals: 300 samples, held out",
        "white (Ljung-Box)        25",
        "independent of past u    25",
        "no feedback to u         25",
        "Anderson: alpha",
        "of  fraction  p-value (mid)  at 0.05",
        "\nwhite at levels up to ",
    ] {
        assert!(table.contains(part), "{part}:\n{table}");
    }
    assert!(folder.done("validate oe.json log.csv").stdout.contains("which need not be white"));
    let table = folder.done("validate arx.json log.csv --require stable,fit>=10").stdout;
    assert!(table.contains("\nrequired\nstable    met\nfit>=10   met\n"), "{table}");
}

#[test]
fn a_gate_names_what_failed() {
    let folder = folder();
    let met = "validate arx.json log.csv --rows 301..600 --require white,independent,stable,fit>=80,fit@3>=70,coverage>=90";
    assert_eq!(folder.done(met).stderr, "");
    let run = folder.run(
        "validate wrong.json log.csv --rows 301..600 --require 'stable, white ,independent,fit>=99,fit@1>=0,fit@9>=99'",
    );
    assert_eq!(run.code, 6, "{}", run.stderr);
    assert!(run.stdout.contains("white        not met") && run.stdout.contains("stable       met"));
    let line = run.stderr.lines().last().unwrap();
    assert!(line.starts_with("error: wrong.json: not met: white: the p-value of Ljung-Box is "), "{line}");
    for part in ["independent: 'u' has p-value ", "fit>=99: the fit is ", "fit@9>=99: the fit is "] {
        assert!(line.contains(part), "{part}: {line}");
    }
    assert!(!line.contains("stable") && !line.contains("fit@1"), "{line}");
    let errors = "mean-error<=1e9,largest-error@1<=1e9,mean-error@3<=1e-9,largest-error<=0";
    let run = folder.run(&format!("validate arx.json log.csv --require {errors}"));
    assert_eq!(run.code, 6, "{}", run.stderr);
    let line = run.stderr.lines().last().unwrap();
    for part in [
        "mean-error@3<=0.000000001: the mean |e| is ",
        "(3 steps ahead)",
        "largest-error<=0: the largest |e| is ",
        "(free run)",
    ] {
        assert!(line.contains(part), "{part}: {line}");
    }
    assert!(!line.contains("mean-error<=") && !line.contains("largest-error@1"), "{line}");
    // The document is there all the same.
    let run = folder.run("validate wrong.json log.csv --require white --format json");
    assert_eq!((run.code, document(&run)["stable"].as_bool()), (6, Some(true)));
    // What cannot be told is not met.
    folder.write("short.csv", csv(&[("u", &Experiment::new(8).u), ("y", &Experiment::new(8).y)]));
    let run = folder.run("validate arx.json short.csv --require white,fit@9>=1");
    assert_eq!(run.code, 6, "{}", run.stderr);
    assert!(run.stderr.contains("white: the residuals could not be tested"), "{}", run.stderr);
    assert!(run.stderr.contains("fit@9>=1: there is no fit figure"), "{}", run.stderr);
    // A stricter level rejects less.
    let found = validation(&folder, "arx.json log.csv --rows 1..300");
    let p = number(&found, "/residuals/0/ljung_box/p_value");
    let words = "validate arx.json log.csv --rows 1..300 --require white";
    assert_eq!(folder.run(&format!("{words} --alpha {}", p * 0.99)).code, 0);
    assert_eq!(folder.run(&format!("{words} --alpha {}", p + 0.01 * (1.0 - p))).code, 6);
}

#[test]
fn a_model_in_a_loop_is_told() {
    let mut random = Random::new(5);
    let (r, e) = (random.signal(1000), random.signal(1000));
    let (mut u, mut y) = (vec![0.0], vec![0.0]);
    for t in 1..1000 {
        u.push(r[t] - 0.8 * y[t - 1]);
        y.push(0.6 * y[t - 1] + 0.5 * u[t - 1] + e[t]);
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done("fit log.csv --na 1 --nb 1 --report model.json");
    let run = folder.done("validate model.json log.csv --require independent,white");
    assert!(run.stderr.contains("warning: input 'u' follows past residuals"), "{}", run.stderr);
}

#[test]
fn an_unstable_model_is_told() {
    let u = Random::new(9).signal(60);
    let e: Vec<f64> = Random::new(10).signal(60).iter().map(|e| 0.1 * e).collect();
    let y = response(&[1.0, -1.05], &[(&[0.0, 1.0], &u)], &e);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done("fit log.csv --detrend none --na 1 --nb 1 --report model.json");
    let run = folder.run("validate model.json log.csv --require stable");
    assert_eq!(run.code, 6, "{}", run.stderr);
    assert!(run.stdout.contains("\nunstable\n") && run.stderr.contains("the model is unstable"));
    assert!(run.stderr.contains("not met: stable: the model has a pole outside"), "{}", run.stderr);
}

#[test]
fn options_that_make_no_sense_are_usage_errors() {
    let folder = folder();
    for (words, parts) in [
        ("oe.json log.csv --require white", ["OE(2, 2, 1) says nothing of the noise", "ask for independent"]),
        ("iv.json log.csv --require stable,white", ["instrumental variables", "ask for independent"]),
        ("sriv.json log.csv --require white", ["instrumental variables", "ask for independent"]),
        ("ar.json log.csv --require independent", ["no inputs", "ask for white"]),
        ("arx.json log.csv --require blue", ["'blue'", "white, independent, stable, fit>=P"]),
        ("arx.json log.csv --require fit>=120", ["fit>=120", "ask for less"]),
        ("arx.json log.csv --require fit@9999999>=1", ["--horizon", "1000000"]),
        ("arx.json log.csv --horizon 0", ["--horizon: 0", "from 1 on"]),
        ("arx.json log.csv --horizon inf", ["--horizon: 'inf'", "whole number"]),
        ("arx.json log.csv --lags 0", ["--lags", "1..1000"]),
        ("arx.json log.csv --alpha 1", ["--alpha", "between 0 and 1"]),
        ("arx.json log.csv --alphas 0.1,-1", ["--alphas", "between 0 and 1"]),
        ("arx.json log.csv --rows 5", ["--rows", "1..300"]),
        ("arx.json log.csv --rows 1..5,4..9", ["--rows", "overlap"]),
        ("arx.json log.csv --detrend half", ["--detrend", "linear"]),
        ("- -", ["standard input", "only one"]),
        ("arx.json log.csv -o log.csv", ["log.csv", "replaced"]),
        ("arx.json log.csv -o arx.json", ["arx.json", "replaced"]),
        ("arx.json log.csv --html log.csv", ["log.csv", "replaced"]),
        ("arx.json log.csv --html new --out new", ["new", "two outputs"]),
    ] {
        let line = folder.refused(&format!("validate {words}"), 2);
        for part in parts {
            assert!(line.contains(part), "{words}: {line}");
        }
    }
}

#[test]
fn logs_that_cannot_be_used_are_refused() {
    let folder = folder();
    let Experiment { u, y } = Experiment::new(100);
    folder.write("empty.csv", "u,y\n");
    folder.write("other.csv", csv(&[("v", &u), ("y", &y)]));
    folder.write("nothing.csv", csv(&[("u", &[f64::NAN; 20]), ("y", &y[..20])]));
    folder.write("infinite.csv", "u,y\n1,1\ninf,2\n");
    for (words, code, parts) in [
        ("arx.json empty.csv", 3, ["empty.csv", "no data rows"]),
        ("arx.json other.csv", 3, ["no column 'u'", "there are: v, y"]),
        ("arx.json nothing.csv", 3, ["nothing.csv", "no row has a value in every channel"]),
        ("arx.json infinite.csv", 3, ["infinite.csv:3", "infinite"]),
        ("arx.json log.csv --sample-time 2", 3, ["sample time", "resample"]),
        ("arx.json log.csv --rows 1..601", 3, ["--rows 1..601", "600 rows"]),
        ("nowhere.json log.csv", 5, ["nowhere.json", "cannot be read"]),
        ("log.csv log.csv", 3, ["log.csv", "not a thetahat report"]),
        ("arx.json nowhere.csv", 5, ["nowhere.csv", "cannot"]),
    ] {
        let line = folder.refused(&format!("validate {words}"), code);
        for part in parts {
            assert!(line.contains(part), "{words}: {line}");
        }
    }
}

#[test]
fn logs_of_which_little_can_be_told_leave_nulls() {
    let folder = folder();
    let Experiment { u, y } = Experiment::new(400);
    let scaled = |values: &[f64], by: f64| values.iter().map(|value| by * value).collect::<Vec<f64>>();
    let gaps: Vec<f64> = y.iter().enumerate().map(|(t, y)| if t % 6 == 5 { f64::NAN } else { *y }).collect();
    let clean = response(&Experiment::A, &[(&Experiment::B, &u)], &[0.0; 400]);
    for (u, y) in [
        (&u[..1], &y[..1]),
        (&u[..13], &y[..13]),
        (&[5.0; 100][..], &[20.0; 100][..]),
        (&[5.0; 400], &y),
        (&u, &scaled(&y, 1e200)),
        (&scaled(&u, 1e-200), &scaled(&y, 1e-200)),
        (&u, &gaps),
        (&u, &clean),
    ] {
        folder.write("other.csv", csv(&[("u", u), ("y", y)]));
        for model in ["arx", "oe", "bj", "ar", "iv"] {
            let run = folder.done(&format!("validate {model}.json other.csv --format json"));
            assert!(document(&run)["fit"].is_array());
            folder.done(&format!("validate {model}.json other.csv"));
        }
    }
    // Without noise there is nothing to test, and nothing to be white.
    folder.write("clean.csv", csv(&[("u", &u), ("y", &clean)]));
    folder.done("fit clean.csv --detrend none --na 2 --nb 2 --report exact.json");
    let run = folder.run("validate exact.json clean.csv --require white --format json");
    assert_eq!((run.code, document(&run)["residuals"] == Value::Array(vec![])), (6, true));
    assert!(run.stderr.contains("all but rounding"), "{}", run.stderr);
}

#[test]
fn gaps_cut_the_log() {
    let folder = folder();
    let Experiment { u, mut y } = Experiment::new(600);
    (40..600).step_by(53).for_each(|row| y[row] = f64::NAN);
    folder.write("gaps.csv", csv(&[("u", &u), ("y", &y)]));
    folder.done("fit gaps.csv --na 2 --nb 2 --report gaps.json");
    let found = validation(&folder, "gaps.json gaps.csv");
    assert_eq!(
        (&found["in_sample"], &found["residuals"][0]["samples"]),
        (&"yes".into(), &(600 - 11 - 24).into())
    );
    assert!(number(&found, "/residuals/0/ljung_box/p_value") > 0.01);
    let run = folder.run("validate gaps.json gaps.csv --require white,independent");
    assert_eq!(run.code, 0, "{}", run.stderr);
}

#[test]
fn residuals_that_stand_alone_are_said_to() {
    let folder = folder();
    let Experiment { u, mut y } = Experiment::new(600);
    // Of three rows, one can be predicted from the two before.
    (0..600).step_by(4).for_each(|row| y[row] = f64::NAN);
    folder.write("alone.csv", csv(&[("u", &u), ("y", &y)]));
    let run = folder.done("validate arx.json alone.csv");
    assert!(run.stderr.contains("the residuals are not tested: gaps leave 0 of "), "{}", run.stderr);
    assert!(!run.stderr.contains("range"), "{}", run.stderr);
}

#[test]
fn documents_go_where_they_are_asked_to() {
    let folder = folder();
    let json = folder.done("validate arx.json log.csv --format json").stdout;
    let table = folder.done("validate arx.json log.csv").stdout;
    assert_eq!(folder.done("validate arx.json log.csv -o out.json").stdout, table);
    assert_eq!(folder.read("out.json"), json);
    assert_eq!(folder.done("validate arx.json log.csv --out -").stdout, json);
    assert_eq!(
        folder
            .run_on("validate - log.csv", folder.read("arx.json"))
            .stdout
            .replace("\n  ", " ")
            .lines()
            .count(),
        table.replace("\n  ", " ").lines().count()
    );
    let run = folder.run_on("validate arx.json - --format json", folder.read("log.csv"));
    assert_eq!(run.stdout.replace("\"-\"", "\"log.csv\""), json);
}

#[test]
fn the_same_log_gives_the_same_bytes() {
    let folder = Folder::with_log(Experiment::new(100_000).csv());
    folder.done("fit log.csv --model armax --na 2 --nb 2 --nc 1 --report model.json");
    let run = |threads: &str| {
        let mut command = folder.command("validate model.json log.csv --format json");
        command.env("RAYON_NUM_THREADS", threads);
        Run::of(command).stdout
    };
    assert_eq!(run("1"), run("4"));
}
