//! What a fit without orders does by itself because of what it finds in the log, and who says otherwise.

use serde_json::{Value, json};

use crate::harness::{Folder, number};
use crate::signals::{Random, csv, response};

/// The kinds of the decisions of a report.
fn kinds(report: &Value) -> Vec<&str> {
    let decisions = report["decisions"].as_array().into_iter().flatten();
    decisions.filter_map(|decision| decision["kind"].as_str()).collect()
}

/// A signal that holds each of two values for a number of rows.
fn telegraph(random: &mut Random, rows: usize, hold: usize) -> Vec<f64> {
    let levels: Vec<f64> =
        (0..rows.div_ceil(hold)).map(|_| if random.uniform() > 0.0 { 1.0 } else { -1.0 }).collect();
    (0..rows).map(|row| levels[row / hold]).collect()
}

#[test]
fn an_input_that_follows_the_output_gets_models_with_noise() {
    // y(t) = 1.5 y(t-1) - 0.56 y(t-2) + 0.06 u(t-2) + e(t), and u = 2 (r - y) of the same row.
    let mut random = Random::new(21);
    let (mut u, mut y) = (Vec::new(), Vec::<f64>::new());
    for row in 0..2000_usize {
        let past = |signal: &[f64], lag: usize| row.checked_sub(lag).map_or(0.0, |at| signal[at]);
        let own = 1.5 * past(&y, 1) - 0.56 * past(&y, 2) + 0.06 * past(&u, 2) + 0.1 * random.uniform();
        let reference = if row / 150 % 2 == 0 { 1.0 } else { 3.0 };
        u.push(2.0 * (reference - own));
        y.push(own);
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv");
    assert_eq!(kinds(&report), ["feedback"]);
    assert_eq!(report["decisions"][0]["channels"], json!(["u"]));
    assert_ne!(report["model"]["structure"], "oe");
    assert!(report["selection"]["delays"][0]["nk"].as_u64() > Some(0), "{}", report["selection"]["delays"]);
    // An inspection says the same.
    let inspection: Value = serde_json::from_str(&folder.done("inspect log.csv --format json").stdout)
        .expect("the document is JSON");
    assert_eq!(inspection["delays"][0]["nk"], report["selection"]["delays"][0]["nk"]);
    // Who names a structure or a purpose has it, and who names a delay.
    for options in ["--model oe", "--focus simulation"] {
        let report = folder.fit(&format!("log.csv {options}"));
        assert_eq!(report["decisions"][0]["did"], "it acts one sample later at the earliest", "{options}");
        assert_eq!(kinds(&folder.fit(&format!("log.csv {options} --nk 0"))), [""; 0], "{options}");
    }
    let report = folder.fit("log.csv --nk 0");
    assert_eq!((kinds(&report), &report["model"]["orders"]["nk"]), (vec!["feedback"], &json!([0])));
}

#[test]
fn data_without_noise_give_the_smallest_model_with_its_level() {
    // From rest at 0 with u = 0, while the mean of u is not 0.
    let mut random = Random::new(22);
    let u: Vec<f64> = telegraph(&mut random, 400, 4).iter().map(|level| f64::from(*level > 0.0)).collect();
    let y = response(&[1.0, -0.9], &[(&[0.0, 0.1], &u)], &[0.0; 400]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv");
    assert_eq!(
        report["model"]["orders"],
        json!({"na": 1, "nb": [1], "nc": 0, "nd": 0, "nf": [0], "nk": [1]})
    );
    assert!((number(&report, "/model/dc_gain/0/value") - 1.0).abs() < 1e-9);
}

#[test]
fn a_sinusoid_shows_neither_delay_nor_gain_at_rest() {
    let mut random = Random::new(23);
    let u: Vec<f64> = (0..400).map(|row| 5.0 * (0.3 * f64::from(row)).sin()).collect();
    let y = response(&[1.0, -0.9, 0.5], &[(&[0.0, 1.0], &u)], &[0.0; 400]);
    let y: Vec<f64> = y.iter().map(|value| value + 0.2 * random.uniform()).collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv");
    assert_eq!(kinds(&report), ["few_sinusoids"]);
    assert_eq!(report["model"]["orders"]["nk"], json!([1]));
    assert_eq!(report["model"]["dc_gain"][0]["interval"], json!({"lower": null, "upper": null}));
    let table = folder.done("fit log.csv --model oe --nb 1 --nf 2").stdout;
    assert!(table.contains("DC gain not determined by this log"), "{table}");
}

#[test]
fn a_level_that_sums_its_input_gets_an_integrator() {
    // 0.02/s from a valve of which 45 holds the level, which begins in motion.
    let mut random = Random::new(24);
    let u: Vec<f64> = (0..1500).map(|row| 45.0 + 15.0 * f64::from((row / 37 * 7 % 5) - 2) / 2.0).collect();
    let mut level = 20.0;
    let y: Vec<f64> = (0..1500)
        .map(|row| {
            let own = level + 0.05 * random.uniform();
            level += 0.02 * (u[row] - 45.0);
            own
        })
        .collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv");
    assert!(kinds(&report).contains(&"integration"), "{:?}", kinds(&report));
    assert_eq!(report["model"]["kind"], "process");
    assert!(
        (number(&report, "/model/parameters/0/value") - 0.02).abs() < 2e-4,
        "{}",
        report["model"]["parameters"]
    );
    assert!(!kinds(&folder.fit("log.csv --model oe")).contains(&"integration"));
}

#[test]
fn a_process_that_does_not_begin_at_rest_gets_a_state() {
    let mut random = Random::new(25);
    let u = telegraph(&mut random, 600, 9);
    let mut state = -3.0;
    let y: Vec<f64> = (0..600)
        .map(|row| {
            let own = state + 0.02 * random.uniform();
            state += (1.2 * u[row] - state) * (1.0 - (-1.0_f64 / 60.0).exp());
            own
        })
        .collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv --structure p1");
    assert_eq!(kinds(&report), ["in_motion"]);
    assert!(
        (number(&report, "/model/parameters/0/value") - 1.2).abs() < 0.02,
        "{}",
        report["model"]["parameters"]
    );
    assert!((number(&report, "/model/parameters/1/value") - 60.0).abs() < 2.0);
    assert_eq!(kinds(&folder.fit("log.csv --structure p1 --initial zero")), [""; 0]);
    // At rest there is nothing to estimate.
    let y: Vec<f64> = response(&[1.0, -0.9], &[(&[0.0, 0.1], &u)], &[0.0; 600]);
    let y: Vec<f64> = y.iter().zip(&u).map(|(value, _)| value + 0.02 * random.uniform()).collect();
    folder.write(
        "log.csv",
        csv(&[
            ("u", &[vec![0.0; 20], u[..580].to_vec()].concat()),
            ("y", &[vec![0.0; 20], y[..580].to_vec()].concat()),
        ]),
    );
    assert_eq!(kinds(&folder.fit("log.csv --structure p1")), [""; 0]);
}

#[test]
fn a_plant_far_from_linear_gets_a_nonlinear_model() {
    // A tank: what flows out goes with the root of the level.
    let mut random = Random::new(26);
    let mut level = 3.0_f64;
    let mut inflow = 1.0;
    let (mut u, mut y) = (Vec::new(), Vec::new());
    for row in 0..1500 {
        if row % 40 == 0 {
            inflow = 1.6 + 1.4 * random.uniform();
        }
        u.push(inflow);
        y.push(level + 0.01 * random.uniform());
        level = (level + 0.1 * (inflow - 1.2 * level.max(0.0).sqrt())).max(0.0);
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let nonlinear = folder.fit("log.csv --split 60/0/40");
    assert_eq!(kinds(&nonlinear), ["nonlinear"]);
    assert_eq!(nonlinear["model"]["kind"], "nonlinear-arx");
    let linear = folder.fit("log.csv --split 60/0/40 --narx none");
    assert_eq!(kinds(&linear), [""; 0]);
    assert_ne!(linear["model"]["kind"], "nonlinear-arx");
    // A log that leaves the range is said to do so.
    folder.done("fit log.csv --report tank.json");
    folder.write(
        "full.csv",
        csv(&[
            ("u", &u.iter().map(|u| u + 3.0).collect::<Vec<_>>()),
            ("y", &y.iter().map(|y| y + 8.0).collect::<Vec<_>>()),
        ]),
    );
    let outside = "the model read values outside of those that it was fitted to";
    let words = |log: &str| folder.done(&format!("validate tank.json {log} --format json")).stdout;
    assert!(words("full.csv").contains(outside));
    assert!(!words("log.csv").contains(outside));
    let free_run = |report: &Value| {
        let fits = report["fit"].as_array().into_iter().flatten();
        let test = fits.filter(|fit| fit["part"] == "test" && fit["horizon"]["kind"] == "free-run");
        test.filter_map(|fit| fit["percent"].as_f64()).next().expect("there is a free run over the test part")
    };
    assert!(free_run(&nonlinear) > free_run(&linear) + 5.0, "{} {}", free_run(&nonlinear), free_run(&linear));
}

#[test]
fn a_level_that_wanders_is_noise_that_integrates() {
    // A random walk beside a first order: y(t) = 0.9 y(t-1) + 0.2 u(t-2) at its own level.
    let mut random = Random::new(27);
    let u = telegraph(&mut random, 2000, 12);
    let plant = response(&[1.0, -0.9], &[(&[0.0, 0.0, 0.2], &u)], &[0.0; 2000]);
    let mut level = 0.0;
    let drifting = plant.iter().map(|value| {
        level += 0.05 * random.uniform();
        value + level + 0.1 * random.uniform()
    });
    let y: Vec<f64> = drifting.collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv --report drift.json");
    assert_eq!(kinds(&report), ["drift"]);
    assert_eq!(report["selection"]["noise_integrates"], json!(true));
    let d = report["model"]["d"].as_array().expect("D is a list");
    assert!(d.iter().filter_map(Value::as_f64).sum::<f64>().abs() < 1e-12, "{d:?}");
    let gain = number(&report, "/model/dc_gain/0/value");
    assert!((gain - 2.0).abs() < 0.05, "{gain}");
    // Free runs have a level of their own: that of another day is found with the state.
    let other: Vec<f64> = plant.iter().map(|value| value + 40.0).collect();
    folder.write("other.csv", csv(&[("u", &u), ("y", &other)]));
    let free = folder.done("validate drift.json other.csv --format json").stdout;
    let free: Value = serde_json::from_str(&free).expect("the document is JSON");
    let runs = free["fit"].as_array().into_iter().flatten();
    let percent =
        runs.filter(|fit| fit["horizon"]["kind"] == "free-run").filter_map(|fit| fit["percent"].as_f64());
    assert!(percent.clone().count() == 1 && percent.min_by(f64::total_cmp) > Some(97.0), "{}", free["fit"]);
    // Whoever asks for a structure has it, or for free runs.
    for option in ["--model oe", "--focus simulation"] {
        assert_eq!(kinds(&folder.fit(&format!("log.csv {option}"))), [""; 0], "{option}");
    }
}

#[test]
fn values_far_from_their_neighbours_are_taken_for_missing() {
    let mut random = Random::new(28);
    let u = telegraph(&mut random, 1000, 7);
    let plant = response(&[1.0, -0.8], &[(&[0.0, 0.4], &u)], &[0.0; 1000]);
    let mut y: Vec<f64> = plant.iter().map(|value| value + 0.05 * random.uniform()).collect();
    for (row, by) in [(99, 9.0), (340, -12.0), (341, 11.0), (700, 6.0)] {
        y[row] += by;
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv");
    assert_eq!(kinds(&report), ["outliers"]);
    let because = report["decisions"][0]["because"].as_str().expect("it is a sentence");
    assert!(because.ends_with("at rows 100, 341, 342, 701"), "{because}");
    // They are no missing values of the log.
    assert_eq!(report["data"]["missing"][1]["rows"], json!(0), "{}", report["data"]["missing"]);
    let gain = |report: &Value| number(report, "/model/dc_gain/0/value");
    assert!((gain(&report) - 2.0).abs() < 0.01, "{}", gain(&report));
    let all = folder.fit("log.csv --norm 2");
    assert_eq!(kinds(&all), [""; 0]);
    assert!(number(&all, "/estimation/mse") > 20.0 * number(&report, "/estimation/mse"));
}

#[test]
fn the_answer_to_a_single_blow_is_no_outlier() {
    let mut random = Random::new(29);
    let mut u = vec![0.0; 300];
    u[60] = 1.0;
    let y: Vec<f64> =
        (0..300).map(|row| if row == 61 { 5.0 } else { 0.0 } + 0.02 * random.uniform()).collect();
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    assert!(!kinds(&folder.fit("log.csv")).contains(&"outliers"));
    let seen = folder.done("inspect log.csv --format json").stdout;
    assert!(!seen.contains("far from their neighbours") && !seen.contains("far from its"), "{seen}");
}
