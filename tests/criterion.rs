//! Other criteria than least squares, bounds, and what is known of errors that are bounded.

use serde_json::{Value, json};

use crate::harness::{Folder, distance, number, numbers, parameters};
use crate::signals::{Experiment, Random, csv, plain_log, response};

/// y(t) = 0.8 y(t-1) + 0.5 u(t-1) + e(t), e within 0.1, and every 20th sample far off if there are `outliers`.
fn first_order(outliers: f64) -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(71);
    let u = random.signal(300);
    let e: Vec<f64> = random.signal(300).iter().map(|e| 0.1 * e).collect();
    let mut y = response(&[1.0, -0.8], &[(&[0.0, 0.5], &u)], &e);
    (0..300).step_by(20).for_each(|t| y[t] += outliers);
    (u, y)
}

fn folder(outliers: f64) -> Folder {
    let (u, y) = first_order(outliers);
    Folder::with_log(csv(&[("u", &u), ("y", &y)]))
}

/// The errors of y(t) = -a1 y(t-1) + b1 u(t-1), from the second sample on.
fn errors(theta: &[f64], u: &[f64], y: &[f64]) -> Vec<f64> {
    (1..y.len()).map(|t| y[t] + theta[0] * y[t - 1] - theta[1] * u[t - 1]).collect()
}

const FIT: &str = "log.csv --detrend none --na 1 --nb 1";

#[test]
fn the_second_norm_is_least_squares() {
    let folder = folder(0.0);
    assert_eq!(folder.fit(&format!("{FIT} --norm 2")), folder.fit(FIT));
    assert_eq!(folder.fit(&format!("{FIT} --norm 2"))["estimation"]["method"], "least-squares");
}

#[test]
fn the_first_norm_is_the_least_of_its_kind_and_ignores_wild_samples() {
    let folder = folder(4.0);
    let (u, y) = first_order(4.0);
    let report = folder.fit(&format!("{FIT} --norm 1"));
    assert_eq!(report["estimation"]["method"], "constrained");
    let cost = |theta: &[f64]| errors(theta, &u, &y).iter().map(|e| e.abs()).sum::<f64>();
    let best = parameters(&report);
    assert!((number(&report, "/estimation/objective") / cost(&best) - 1.0).abs() < 1e-8);
    for change in [[1e-4, 0.0], [-1e-4, 0.0], [0.0, 1e-4], [0.0, -1e-4], [1e-4, 1e-4], [1e-4, -1e-4]] {
        assert!(cost(&[best[0] + change[0], best[1] + change[1]]) > cost(&best), "{change:?}");
    }
    let squares = parameters(&folder.fit(FIT));
    let far = |theta: &[f64]| distance(theta, &[-0.8, 0.5]);
    assert!(far(&best) < 0.5 * far(&squares), "{best:?} {squares:?}");
}

#[test]
fn the_largest_error_is_the_least_possible() {
    let folder = folder(0.0);
    let (u, y) = first_order(0.0);
    let report = folder.fit(&format!("{FIT} --norm inf"));
    let cost = |theta: &[f64]| errors(theta, &u, &y).iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    let best = parameters(&report);
    assert!((number(&report, "/estimation/objective") / cost(&best) - 1.0).abs() < 1e-7);
    for change in [[1e-4, 0.0], [-1e-4, 0.0], [0.0, 1e-4], [0.0, -1e-4], [1e-4, 1e-4], [1e-4, -1e-4]] {
        assert!(cost(&[best[0] + change[0], best[1] + change[1]]) > cost(&best), "{change:?}");
    }
    // No theory gives its standard errors.
    assert_eq!(report["model"]["parameters"][0]["standard_error"], Value::Null);
    assert_eq!(report["model"]["covariance"], Value::Null);
    let table = folder.done(&format!("fit {FIT} --norm inf")).stdout;
    let row = table.lines().find(|line| line.starts_with("a1 ")).unwrap();
    assert!(row.ends_with('-'), "{table}");
    assert!(table.contains("criterion: largest absolute error "), "{table}");
}

#[test]
fn the_largest_error_of_a_free_run_is_the_least_possible() {
    let folder = folder(0.0);
    let (u, y) = first_order(0.0);
    let options =
        "log.csv --model oe --nb 1 --nf 1 --detrend none --constant no --initial zero --sample-time 1";
    let largest = |[b, f]: [f64; 2]| {
        let mut x = 0.0;
        let errors = u.iter().zip(&y).scan(0.0, |before, (u, y)| {
            x = b * *before - f * x;
            *before = *u;
            Some((y - x).abs())
        });
        errors.fold(0.0, f64::max)
    };
    let report = folder.fit(&format!("{options} --norm inf"));
    let best: [f64; 2] = parameters(&report).try_into().unwrap();
    let least = largest(best);
    assert!((number(&report, "/estimation/objective") / least - 1.0).abs() < 1e-9);
    assert_eq!(report["estimation"]["search"]["stopped"], "converged");
    for change in [[1e-5, 0.0], [-1e-5, 0.0], [0.0, 1e-5], [0.0, -1e-5], [1e-5, 1e-5], [1e-5, -1e-5]] {
        assert!(largest([best[0] + change[0], best[1] + change[1]]) > least, "{change:?}");
    }
    let squares = largest(parameters(&folder.fit(options)).try_into().unwrap());
    assert!(least < squares && (number(&report, "/estimation/search/costs/0") / squares - 1.0).abs() < 1e-3);
    let table = folder.done(&format!("fit {options} --norm inf")).stdout;
    assert!(table.contains("\ncriterion: largest absolute error "), "{table}");
    assert!(table.contains("\nlinear programs, ") && table.contains(" from least squares ("), "{table}");
}

#[test]
fn bounds_are_kept_and_named_where_they_matter() {
    let folder = folder(0.0);
    let report = folder.fit(&format!("{FIT} --bound a1=-0.7..0 --bound b1=0..10"));
    assert_eq!(parameters(&report)[0], -0.7);
    assert_eq!(report["estimation"]["active"], json!(["a1=-0.7..0"]));
    let table = folder.done(&format!("fit {FIT} --bound a1=-0.7..0 --bound b1=0..10")).stdout;
    assert!(table.contains("\nat a bound: a1=-0.7..0\n"), "{table}");
    // Bounds that do not matter change nothing.
    let free = folder.fit(&format!("{FIT} --bound a1=-1..0"));
    assert!(distance(&parameters(&free), &parameters(&folder.fit(FIT))) < 1e-9);
    assert_eq!(free["estimation"]["active"], json!([]));
    assert_eq!(parameters(&folder.fit(&format!("{FIT} --bound a1=-0.6")))[0], -0.6);
}

#[test]
fn a_static_gain_is_kept() {
    let folder = folder(0.0);
    let gain = |report: &Value| number(report, "/model/dc_gain/0/value");
    for (options, expected) in [("--dc-gain 2", 2.0), ("--dc-gain u=2", 2.0), ("--dc-gain 1..2.2", 2.2)] {
        let report = folder.fit(&format!("{FIT} {options}"));
        assert!((gain(&report) / expected - 1.0).abs() < 1e-6, "{options}: {}", gain(&report));
    }
    let free = folder.fit(&format!("{FIT} --dc-gain 1..3"));
    assert!((gain(&free) - 2.5).abs() < 0.2);
    assert!(distance(&parameters(&free), &parameters(&folder.fit(FIT))) < 1e-9);
}

#[test]
fn a_ridge_makes_parameters_smaller() {
    let folder = folder(0.0);
    let size = |options: &str| {
        let report = folder.fit(&format!("{FIT} {options}"));
        parameters(&report).iter().map(|p| p * p).sum::<f64>()
    };
    let sizes = [size(""), size("--ridge 1"), size("--ridge 30"), size("--ridge 1000")];
    assert!(sizes.windows(2).all(|pair| pair[1] < pair[0]), "{sizes:?}");
}

#[test]
fn errors_of_a_known_size_leave_a_box_that_holds_the_truth() {
    let folder = folder(0.0);
    let report = folder.fit(&format!("{FIT} --noise-bound 0.1"));
    let box_: Vec<Vec<f64>> = report["estimation"]["box"].as_array().unwrap().iter().map(numbers).collect();
    for ((range, truth), value) in box_.iter().zip([-0.8, 0.5]).zip(parameters(&report)) {
        assert!(range[0] <= truth && truth <= range[1] && range[1] - range[0] < 0.2, "{range:?}");
        assert!(range[0] <= value && value <= range[1]);
    }
    let (u, y) = first_order(0.0);
    assert!(errors(&parameters(&report), &u, &y).iter().all(|e| e.abs() <= 0.1 + 1e-8));
    let table = folder.done(&format!("fit {FIT} --noise-bound 0.1")).stdout;
    assert!(table.contains("no error above 0.1") && table.contains("largest"), "{table}");
}

#[test]
fn what_cannot_be_says_so_and_names_what_clashes() {
    let folder = folder(0.0);
    for (options, parts) in [
        ("--noise-bound 0.01", &["infeasible", "0.01", "smallest possible"][..]),
        ("--bound a1=0..1 --bound b1=-1..0 --dc-gain 2", &["infeasible", "dc-gain"]),
    ] {
        let line = folder.refused(&format!("fit {FIT} {options}"), 3);
        for part in parts {
            assert!(line.contains(part), "{options}: {part}: {line}");
        }
    }
}

#[test]
fn instrumental_variables_are_not_misled_by_coloured_noise() {
    let mut random = Random::new(81);
    let u = random.signal(4000);
    let v = response(&[1.0, -0.9], &[], &random.signal(4000).iter().map(|e| 0.3 * e).collect::<Vec<f64>>());
    let x = response(&[1.0, -1.5, 0.7], &[(&[0.0, 1.0, 0.5], &u)], &[0.0; 4000]);
    let y: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + v).collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let truth = [-1.5, 0.7, 1.0, 0.5];
    let squares = folder.fit("log.csv --na 2 --nb 2");
    let iv = folder.fit("log.csv --na 2 --nb 2 --method iv");
    assert_eq!(iv["estimation"]["method"], "instrumental-variables");
    assert_eq!(iv["model"]["structure"], "arx");
    let far = |report: &Value| distance(&parameters(report), &truth);
    assert!(far(&iv) < 0.3 * far(&squares), "{} {}", far(&iv), far(&squares));

    let sriv = folder.fit("log.csv --model oe --nb 2 --nf 2 --method sriv");
    assert_eq!(sriv["estimation"]["method"], "refined-instrumental-variables");
    assert_eq!(sriv["model"]["structure"], "oe");
    assert!(distance(&parameters(&sriv), &[1.0, 0.5, -1.5, 0.7]) < 0.05, "{:?}", parameters(&sriv));
    for (report, expected) in [(&iv, &truth[..]), (&sriv, &[1.0, 0.5, -1.5, 0.7])] {
        for (position, (found, truth)) in parameters(report).into_iter().zip(expected).enumerate() {
            let error = number(report, &format!("/model/parameters/{position}/standard_error"));
            assert!((found - truth).abs() < 5.0 * error, "{found} {truth} {error}");
        }
    }
    let table = folder.done("fit log.csv --model oe --nb 2 --nf 2 --method sriv").stdout;
    assert!(table.contains("refined instrumental variables, "), "{table}");
}

#[test]
fn criteria_that_do_not_go_with_the_model_or_the_method() {
    let folder = Folder::new();
    for (options, parts) in [
        ("--model oe --nb 2 --nf 2 --norm 1 --ridge 2", &["--ridge", "not linear"][..]),
        ("--model oe --nb 2 --nf 2 --norm inf --noise-bound 2", &["--noise-bound", "not linear"]),
        ("--na 2 --nb 2 --norm huber --ridge 2", &["--ridge", "goes with --norm 2, 1 and inf"]),
        ("--na 2 --nb 2 --norm huber:0", &["--norm", "huber:K"]),
        ("--na 2 --nb 2 --norm 3", &["--norm", "huber:K"]),
        ("--model armax --na 2 --nb 2 --nc 1 --bound a1=0..1", &["--bound", "not linear"]),
        ("--model armax --na 2 --nb 2 --nc 1 --dc-gain 1", &["--dc-gain", "not linear"]),
        ("--model armax --na 2 --nb 2 --nc 1 --ridge 1", &["--ridge", "not linear"]),
        ("--model arma --na 2 --nc 1 --noise-bound 1", &["--noise-bound", "not linear"]),
        ("--na 2 --nb 2 --method iv --norm 1", &["--norm", "--method pem"]),
        ("--model oe --nb 2 --nf 2 --method sriv --search lm", &["--search", "--method pem"]),
        ("--model armax --na 2 --nb 2 --nc 1 --method iv", &["--method: iv"]),
        ("--model ar --na 2 --method iv", &["--method: iv", "inputs"]),
        ("--na 2 --nb 2 --method sriv", &["--method: sriv", "--model oe"]),
        ("--model bj --nb 2 --nf 2 --nc 1 --nd 0 --method sriv", &["--method: sriv", "--model oe"]),
        ("--na 2 --nb 2 --norm 1 --search lm", &["--search", "one step"]),
        ("--na 2 --nb 2 --bound a1", &["--bound", "a1"]),
        ("--na 2 --nb 2 --bound a1=1..0", &["--bound", "a1=1..0"]),
        ("--na 2 --nb 2 --bound a1=x..0", &["--bound", "'x'"]),
        ("--na 2 --nb 2 --bound a1=..", &["--bound", "a1=.."]),
        ("--na 2 --nb 2 --dc-gain high", &["--dc-gain", "'high'"]),
        ("--na 2 --nb 2 --dc-gain -1..-2", &["--dc-gain", "-1..-2"]),
        ("--na 2 --nb 2 --ridge -1", &["--ridge: -1", "positive"]),
        ("--na 2 --nb 2 --ridge inf", &["--ridge: 'inf'", "finite"]),
        ("--na 2 --nb 2 --noise-bound 0", &["--noise-bound: 0", "positive"]),
        ("--na 2 --nb 2 --noise-bound nan", &["--noise-bound: 'nan'", "finite"]),
    ] {
        let line = folder.refused(&format!("fit nowhere.csv {options}"), 2);
        for part in parts {
            assert!(line.contains(part), "{options}: {part}: {line}");
        }
    }
    // These need the log.
    let folder = Folder::with_log(plain_log());
    for (options, parts) in [
        ("--bound c1=0..1", &["--bound", "'c1'", "a1, a2, b1, b2"][..]),
        ("--dc-gain heater=1", &["--dc-gain", "'heater'", "u"]),
    ] {
        let line = folder.refused(&format!("fit log.csv --na 2 --nb 2 {options}"), 2);
        for part in parts {
            assert!(line.contains(part), "{options}: {part}: {line}");
        }
    }
    let Experiment { u, y } = Experiment::new(100);
    folder.write("two.csv", csv(&[("u1", &u), ("u2", &Random::new(5).signal(100)), ("y", &y)]));
    let line = folder.refused("fit two.csv --na 2 --nb 2 --dc-gain 2", 2);
    assert!(line.contains("--dc-gain") && line.contains("which input"), "{line}");
}
