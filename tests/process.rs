//! Processes in continuous time on measured step tests, in every verb.

use std::fmt::Write;

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::Random;

const TCLAB: &str = "log.csv --time t -u q1 -y t1";

fn value(report: &Value, name: &str) -> (f64, f64) {
    let parameters = report["model"]["parameters"].as_array().expect("a list");
    let own = parameters.iter().find(|own| own["name"] == name).expect("the parameter is there");
    (own["value"].as_f64().expect("a number"), own["standard_error"].as_f64().unwrap_or(f64::NAN))
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{found} {expected}");
}

/// An independent program: the exact response of each step, least squares for gain and level, Nelder and Mead for the
/// rest.
#[test]
fn a_heater_is_what_an_independent_program_finds() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    let report = folder.fit(&format!("{TCLAB} --model process --structure p1d"));
    for (name, expected) in [("K", 0.360727), ("tau", 138.0946), ("theta", 14.24183)] {
        near(value(&report, name).0, expected, 1e-5);
    }
    near(number(&report, "/fit/1/rmse"), 0.3811776, 1e-6);
    near(number(&report, "/estimation/white_standard_errors/1"), 0.39, 0.005);
    // Its errors are far from white, and so are those of its parameters.
    assert!(value(&report, "tau").1 > 2.9, "{:?}", value(&report, "tau"));
    let report = folder.fit(&format!("{TCLAB} --structure p2d"));
    for (name, expected) in [("K", 0.362616), ("tau1", 136.48185), ("tau2", 9.96608), ("theta", 4.66505)] {
        near(value(&report, name).0, expected, 1e-5);
    }
    near(number(&report, "/fit/1/rmse"), 0.3126266, 1e-6);
}

/// The first pulse of a battery cell, without rows that repeat a time: an independent program has R0 = 1.755 mOhm,
/// tau = 7.883 and 224.3 s, rmse 1.29 mV.
#[test]
fn a_battery_is_what_an_independent_program_finds() {
    let mut log = "t,i,v\n".to_owned();
    let mut last = "";
    for line in include_str!("data/public/leaf_cell_hppc_25c.csv").lines().skip(356).take(620) {
        let time = line.split(',').next().expect("a time");
        if time != last {
            writeln!(log, "{line}").expect("memory");
        }
        last = time;
    }
    let folder = Folder::with_log(log);
    let report = folder.fit("log.csv --time t -u i -y v --structure rc2");
    near(value(&report, "R0").0, 1.755e-3, 3e-4);
    near(value(&report, "tau1").0, 7.883, 1e-3);
    near(value(&report, "tau2").0, 224.3, 1e-3);
    near(number(&report, "/fit/1/rmse"), 1.29e-3, 2e-3);
}

#[test]
fn every_verb_takes_a_process() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    let report = folder.fit(&format!(
        "{TCLAB} --structure p2d --estimate 1..400 --validate 401..571 --report model.json --html page.html"
    ));
    assert_eq!(report["model"]["kind"], "process");
    assert!(number(&report, "/fit/3/percent") > 50.0, "{report:#}");
    let table = folder.done(&format!("fit {TCLAB} --structure p2d")).stdout;
    assert!(table.contains("G = K e^(-theta s)/((1 + tau1 s) (1 + tau2 s)) from q1"), "{table}");
    let (figures, purpose) = table.split_once("Good for").expect("it is good for something");
    assert!(figures.contains("assuming white residuals") && !figures.contains("rad/s"), "{table}");
    assert!(purpose.contains("control design up to"), "{table}");
    let step = folder.done("step model.json").stdout;
    let last: Vec<f64> =
        step.lines().last().expect("rows").split(',').filter_map(|cell| cell.parse().ok()).collect();
    near(last[1], value(&report, "K").0, 0.02);
    for line in [
        "impulse model.json",
        "bode model.json",
        "predict model.json log.csv --time t --horizon 3",
        "simulate model.json log.csv --time t",
        "simulate model.json log.csv --time t --initial estimate",
        "validate model.json log.csv --time t --rows 401..571 --html validation.html",
        "compare model.json log.csv --time t --rows 401..571 --html comparison.html",
    ] {
        folder.done(line);
    }
    // States need an even clock.
    folder.refused("filter model.json log.csv --time t -o states.csv", 3);
    folder.done("filter model.json log.csv --sample-time 1 -o states.csv");
}

/// The course's experiment: sines, points, and a process through them.
#[test]
fn a_frequency_response_makes_a_process() {
    let mut log = "u,y\n".to_owned();
    let (mut y, mut random) = (0.0, Random::new(1));
    let pole = (-0.2_f64).exp();
    let mut held = 0.0;
    for k in 0..4000 {
        if k % 3 == 0 {
            held = random.uniform().signum();
        }
        writeln!(log, "{held},{}", y + 0.03 * random.uniform()).expect("memory");
        y = pole * y + 2.0 * (1.0 - pole) * held;
    }
    let folder = Folder::with_log(log);
    folder.done("spectrum log.csv --sample-time 1 --format json -o response.json");
    let report = folder.fit("--from response.json --structure p1d --report model.json");
    near(value(&report, "K").0, 2.0, 0.01);
    near(value(&report, "tau").0, 5.0, 0.02);
    assert!(value(&report, "theta").0 < 0.05 && report["estimation"]["method"] == "frequency-response");
    let table = folder.done("fit --from response.json --structure p1").stdout;
    assert!(table.contains("parts of points") && table.contains("by the points alone"), "{table}");
    folder.done("bode model.json --over response.json");
    folder.done("fit log.csv --sample-time 1 --na 1 --nb 1 --nk 3 --report late.json");
    let table = folder
        .done("compare model.json late.json log.csv --sample-time 1 --over response.json --html compare.html")
        .stdout;
    assert!(
        table.contains("outside of the response, u") && table.contains("apart from the response, u [%]"),
        "{table}"
    );
    assert!(folder.read("compare.html").contains("outside of the response, u"));
    let json = folder
        .done("compare model.json late.json log.csv --sample-time 1 --over response.json --format json")
        .stdout;
    let found: Value = serde_json::from_str(&json).expect("a document");
    let outside = |model: usize| number(&found, &format!("/models/{model}/response/0/outside"));
    assert!(outside(0) < 30.0 && outside(1) > 100.0, "{table}");
    folder.done("validate model.json log.csv --sample-time 1");
    folder.assert_refused("fit --from response.json --structure p1d -u v", 2, "none called 'v'");
    folder.refused("fit --from log.csv --structure p1d", 3);
    folder.refused("fit --from nowhere.json --structure p1d", 5);
    for line in ["fit --from response.json", "fit --from response.json log.csv --structure p1d", "fit"] {
        assert_eq!(folder.run(line).code, 2, "{line}");
    }
}

/// A tank that fills: its level goes on rising after the step.
#[test]
fn an_integrator_and_a_free_start_are_found() {
    let mut log = "u,y\n".to_owned();
    let mut level = 3.0;
    for k in 0..200 {
        let flow = |k: i32| f64::from(u8::from((20..120).contains(&k)));
        writeln!(log, "{},{level}", flow(k)).expect("memory");
        level += 0.5 * flow(k - 4);
    }
    let folder = Folder::with_log(log);
    let report = folder.fit("log.csv --structure p0di --sample-time 0.5");
    near(value(&report, "K").0, 1.0, 1e-6);
    near(value(&report, "theta").0, 2.0, 1e-6);
    near(number(&report, "/estimation/level/value"), 3.0, 1e-6);

    let mut log = "u,y\n".to_owned();
    for k in 0..200_u32 {
        let t = f64::from(k);
        let rise = |start: f64| 2.0 * (1.0 - (-(t - start).max(0.0) / 10.0).exp());
        writeln!(log, "{},{}", u8::from(k >= 50), 1.0 + 4.0 * (-t / 10.0).exp() + rise(50.0))
            .expect("memory");
    }
    let folder = Folder::with_log(log);
    let report = folder.fit("log.csv --structure p1 --initial estimate --sample-time 1");
    near(value(&report, "tau").0, 10.0, 1e-6);
    assert_eq!(number(&report, "/estimation/initial_conditions"), 1.0);
}

#[test]
fn what_cannot_be_is_told() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    for (options, code, words) in [
        ("--model process", 2, "needs --structure"),
        ("--structure p7d", 2, "no structure of a process"),
        ("--model arx --structure p1d", 2, "leave one of the two out"),
        ("--structure p1d,p1d", 2, "2 for 1 inputs"),
        ("--structure p1d --initial drop", 2, "--initial: drop"),
        ("--structure p1d --trend --offset t1=3", 2, "leave one of them out"),
        ("--structure p1d --estimate 1..5", 4, "never changes"),
        ("--structure p1d --estimate 1..900", 3, "900"),
    ] {
        let before = folder.names();
        folder.assert_refused(&format!("fit {TCLAB} {options} --report model.json"), code, words);
        assert_eq!(folder.names(), before);
    }
    // What is of other models.
    for option in ["--na 2", "--detrend mean", "--narx poly", "--kernel dc", "--constant yes"] {
        let run = folder.run(&format!("fit {TCLAB} --structure p1d {option}"));
        assert!(run.code == 2 && run.stderr.contains("does not work with --"), "{option}: {}", run.stderr);
    }
}

/// Who gives nothing but channels gets a process where the log is a step test, and where one does better than
/// polynomial models.
///
/// Takes 12 s: a choice of a model for each of nine command lines.
#[test]
fn a_step_test_without_orders_is_described_by_a_process() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    let report = folder.fit(TCLAB);
    assert_eq!(report["model"]["kind"], "process");
    for (name, expected) in [("K", 0.362616), ("tau1", 136.48185), ("tau2", 9.96608), ("theta", 4.66505)] {
        near(value(&report, name).0, expected, 1e-5);
    }
    let processes = report["selection"]["processes"].as_array().expect("a list");
    let structures: Vec<&Value> = processes.iter().map(|process| &process["structure"]).collect();
    // The pair of p2du has more damping than one, which p2d says as well; and there is no integrator beside a lag.
    assert_eq!(structures, ["p2d", "p1d", "p0di"]);
    assert_eq!(processes[0]["held_out"]["refits"], 3);
    let said = folder.done(&format!("fit {TCLAB} --html page.html"));
    assert!(said.stdout.contains("Taken instead: the process p2d"), "{}", said.stdout);
    assert!(folder.read("page.html").contains("process: p2d, "));
    // Whoever asks for something that a process is not gets a polynomial model.
    for asked in ["--focus prediction", "--model oe", "--nk 1", "--detrend linear", "--initial drop"] {
        let report = folder.fit(&format!("{TCLAB} {asked}"));
        assert_eq!(report["model"]["kind"], "polynomial", "{asked}");
        assert_eq!(report["selection"]["processes"], Value::Null, "{asked}");
    }
    // The process is unlike the other models: what is compared are free runs, and one in state space is closer.
    let half = folder.fit(&format!("{TCLAB} --estimate 1..399 --validate 400..571"));
    assert_eq!(half["model"]["kind"], "state-space");
    assert_eq!(half["selection"]["processes"][0]["structure"], "p2d");
}

/// 20/(s^2 + 2 s + 20) e^(-0.13 s) on an uneven clock, its input moving from the first row on.
fn resonance(folder: &Folder) {
    let (mut text, mut random, mut steps) = ("t,u,y\n".to_owned(), Random::new(1), Vec::new());
    let mut level = 0.0;
    let damped = 19.0_f64.sqrt();
    for row in 0..500 {
        let time = 0.05 * f64::from(row) + 0.01 * f64::from(row % 3);
        if row % 7 == 0 {
            let next = random.uniform();
            steps.push((time, next - level));
            level = next;
        }
        let rises = steps.iter().map(|(start, by)| {
            let since = (time - start - 0.13).max(0.0);
            by * (1.0 - (-since).exp() * ((damped * since).cos() + (damped * since).sin() / damped))
        });
        let noise = f64::from((row * 7919) % 101 - 50) * 4e-4;
        writeln!(text, "{time},{level},{}", 3.0 + rises.sum::<f64>() + noise).expect("memory");
    }
    folder.write("resonance.csv", text);
}

#[test]
fn transfer_functions_are_found_in_every_verb() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    resonance(&folder);
    let line = "resonance.csv --time t -u u -y y --model tf --np 2 --nz 0 --delay --estimate 1..400 --validate 401..500";
    let report = folder.fit(&format!("{line} --report model.json --html page.html"));
    assert_eq!(report["model"]["structures"][0], "tf20d");
    for (name, expected) in [("b0", 20.0), ("a1", 2.0), ("a0", 20.0), ("theta", 0.13)] {
        let (found, error) = value(&report, name);
        assert!((found - expected).abs() < 4.0 * error && error < 0.02 * expected, "{name}: {found} {error}");
    }
    assert!(folder.read("page.html").contains("tf20d"));
    for verb in
        ["validate model.json resonance.csv --time t", "predict model.json resonance.csv --time t -o p.csv"]
    {
        folder.done(verb);
    }
    for verb in ["step", "impulse", "bode"] {
        folder.done(&format!("{verb} model.json -o {verb}.csv"));
    }
    // The pole of its own table is that of the parameters: -1 +- 4.36i, with its error.
    folder.done("convert model.json --to continuous -o c.json");
    let continuous: Value = serde_json::from_str(&folder.read("c.json")).expect("a document");
    near(number(&continuous, "/model/poles/0/re"), -0.5 * value(&report, "a1").0, 1e-9);
    let variance = number(&continuous, "/model/poles/0/covariance/0/0");
    near(variance.sqrt(), 0.5 * value(&report, "a1").1, 1e-3);
    near(
        number(&continuous, "/model/dc_gain/0/0/value"),
        value(&report, "b0").0 / value(&report, "a0").0,
        1e-9,
    );
    folder.assert_refused("tune model.json", 2, "tf20d");

    // What is no resonance comes to the same as lags.
    let lags = folder.fit(&format!("{TCLAB} --structure p2"));
    let found = folder.fit(&format!("{TCLAB} --model tf --np 2 --nz 0 --initial zero"));
    near(number(&found, "/fit/1/rmse"), number(&lags, "/fit/1/rmse"), 1e-6);
    near(value(&found, "a0").0, 1.0 / (value(&lags, "tau1").0 * value(&lags, "tau2").0), 1e-3);

    // The response that the model has, as measured.
    folder.done(
        "spectrum resonance.csv --resample 0.05:linear --time t -u u -y y --format json -o response.json",
    );
    let found = folder.fit("--from response.json --np 2 --nz 0 --delay");
    near(value(&found, "a0").0, 20.0, 0.1);

    // An integrator, driven from the first row on by an input that rests at 0.3.
    let (mut text, mut random, mut state) = ("u,y\n".to_owned(), Random::new(1), [0.0, 0.0]);
    let (mut u, decay) = (-1.0, (-0.2_f64).exp());
    for row in 0..400 {
        if row > 0 && row % 5 == 0 {
            u = random.uniform().signum();
        }
        let noise = f64::from((row * 7919) % 101 - 50) * 4e-4;
        writeln!(text, "{u},{}", state[0] + noise).expect("memory");
        // 1/(s (s + 1)) of a held input, less 0.3.
        let [y, rate] = state;
        let driven = u - 0.3;
        state = [y + (rate - driven) * (1.0 - decay) + 0.2 * driven, driven + (rate - driven) * decay];
    }
    folder.write("integrator.csv", text);
    let found = folder.fit("integrator.csv --sample-time 0.2 --structure tf20i --initial estimate");
    for (name, expected) in [("b0", 1.0), ("a0", 1.0)] {
        let (found, error) = value(&found, name);
        assert!((found - expected).abs() < 4.0 * error && error < 0.02, "{name}: {found} {error}");
    }
    // Its first input is -1, from which it is measured.
    near(number(&found, "/estimation/slope/value"), -1.3, 0.02);
    let words = folder.done("fit integrator.csv --sample-time 0.2 --np 2 --nz 0 --trend").stderr;
    assert!(words.contains("slower than the log is long"), "{words}");

    for (options, words) in [
        ("--model tf", "--model: tf needs --np"),
        ("--model arx --np 2", "--np: does not work with --model arx"),
        ("--np 0", "--np: 0 poles"),
        ("--np 7", "--np: 7 poles"),
        ("--np 2 --nz 3", "--np: 3 zeros of 2 poles"),
        ("--np 2,1 --nz 1,0,0", "--nz: 3 numbers beside 2"),
        ("--np 2,1", "2 for 1 inputs"),
        ("--structure tf13", "3 zeros of 1 poles"),
        ("--structure tf10i", "an integrator alone is p0i"),
        ("--structure tf2", "no structure of a process"),
        ("--model ss --np 2", "--np"),
    ] {
        folder.assert_refused(&format!("fit {TCLAB} {options}"), 2, words);
    }
    for options in ["--nz 1", "--delay", "--np 2 --structure p1d", "--np 2 --na 1"] {
        assert_eq!(folder.run(&format!("fit {TCLAB} {options}")).code, 2, "{options}");
    }
}
