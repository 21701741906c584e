//! Nonlinear ARX models: values of an independent program on public logs.

use std::fs;

use serde_json::Value;

use crate::fit_reference::public_log;
use crate::harness::{Folder, number};

/// A term, its coefficient, the coefficient's standard error, and the term's error reduction ratio, in the order of the
/// choice.
type Term = (&'static str, f64, f64, f64);

const ROBOT_ARM: &[Term] = &[
    ("y(k-4)", -0.9864511975, 0.004994, 0.88244816),
    ("u(k-2)", -0.9135222188, 0.008188, 0.03288848),
    ("y(k-1)", 3.265132457, 0.005101, 0.01028164),
    ("y(k-2)", -4.594154179, 0.01195, 0.06850347),
    ("y(k-3)", 3.242892315, 0.01188, 0.00553037),
    ("u(k)", -0.2523549983, 0.002108, 0.00002332),
    ("u(k-1)", 0.7031338043, 0.006001, 0.00001296),
    ("u(k-3)", 0.6931623124, 0.006379, 0.00009015),
    ("u(k-4)", -0.2431127609, 0.002527, 0.00020988),
    ("y(k-2)*u(k-3)", -0.002952601864, 0.0009232, 0.00000014),
    ("u(k-1)^2", -0.00257474182, 0.001045, 0.00000011),
    ("y(k-2)*u(k)", -0.002197159543, 0.0008933, 0.00000014),
];

const TANKS: &[Term] = &[
    ("y(k-1)", 1.512511005, 0.03747, 0.99974850),
    ("y(k-2)", -0.5170613246, 0.03652, 0.00017915),
    ("u(k-2)^2", -0.5964894492, 0.1649, 0.00000745),
    ("u(k-1)^2", -0.5697270445, 0.164, 0.00000050),
    ("u(k-1)*u(k-2)", 1.170113438, 0.3288, 0.00000045),
    ("1", -0.007165732167, 0.00746, 0.00000019),
    ("y(k-2)*u(k-1)", -0.02942322198, 0.006314, 0.00000064),
    ("y(k-1)*u(k-2)", 0.02927028007, 0.006701, 0.00000117),
];

const SILVERBOX: &[Term] = &[
    ("y(k-1)", 1.449264519, 0.0005113, 0.58321267),
    ("y(k-2)", -0.8957362972, 0.0007575, 0.38803979),
    ("u(k-1)", 0.3719526872, 2.924e-05, 0.02685060),
    ("1", -0.002589934168, 1.333e-06, 0.00149459),
    ("y(k-1)^2*y(k-2)", 3.820242483, 0.02252, 0.00011083),
    ("u(k)", 0.04909342331, 2.469e-05, 0.00009824),
    ("u(k-2)", 0.05568174055, 0.0002133, 0.00016791),
    ("y(k-1)*y(k-3)^2", 0.9090399324, 0.009227, 0.00000647),
    ("y(k-1)^3", -2.825095702, 0.009366, 0.00000895),
    ("y(k-3)^3", 0.247104181, 0.000979, 0.00000307),
    ("y(k-1)*y(k-2)^2", -2.49939044, 0.01869, 0.00000251),
    ("y(k-1)^2", 0.01382420472, 8.188e-05, 0.00000108),
    ("y(k-1)*y(k-2)*y(k-3)", -1.196460428, 0.01411, 0.00000053),
    ("y(k-1)*y(k-3)*u(k-1)", 0.639465552, 0.008783, 0.00000014),
    ("y(k-3)", -0.024407696, 0.0004792, 0.00000009),
    ("y(k-2)^2*u(k-1)", -0.3362096499, 0.006612, 0.00000005),
    ("y(k-1)*u(k-1)^2", -0.3432376131, 0.008496, 0.00000004),
    ("y(k-3)^2", 0.002310667699, 8.054e-05, 0.00000003),
    ("y(k-1)*y(k-2)*u(k)", 0.1252478711, 0.004686, 0.00000003),
    ("y(k-1)*u(k-1)", 0.006047278641, 0.0002882, 0.00000002),
];

const COUPLED_DRIVES_1: &[Term] = &[
    ("y(k-1)", 1.768789517, 0.04722, 0.96888322),
    ("y(k-2)", -1.374817565, 0.07567, 0.01829545),
    ("y(k-3)", 0.4572692598, 0.04444, 0.00590218),
    ("u(k-4)*u(k-7)", 0.01520437117, 0.001913, 0.00182665),
    ("u(k-5)^2", 0.007767893084, 0.002408, 0.00058002),
    ("y(k-7)*u(k-6)", 0.01095177937, 0.004579, 0.00016973),
    ("1", 0.01977344705, 0.00477, 0.00014800),
    ("u(k-2)*u(k-4)", 0.005764871667, 0.00163, 0.00010535),
    ("y(k-1)*y(k-7)", 0.02846774543, 0.01954, 0.00008838),
    ("u(k-6)*u(k-7)", 0.002874789311, 0.002616, 0.00005994),
    ("y(k-1)*y(k-4)", 0.1332406708, 0.07043, 0.00005987),
    ("y(k-1)^2", 0.2386374414, 0.0379, 0.00010938),
    ("y(k-1)*y(k-3)", -0.4474575787, 0.08989, 0.00016012),
    ("y(k-3)*y(k-4)", 0.1014185675, 0.02537, 0.00009052),
    ("y(k-6)^2", -0.02656813771, 0.009925, 0.00006550),
];

const COUPLED_DRIVES_2: &[Term] = &[
    ("y(k-1)", 1.879737794, 0.04624, 0.98518821),
    ("y(k-2)", -1.335373395, 0.1002, 0.01098677),
    ("y(k-3)", 0.2608210834, 0.09427, 0.00205877),
    ("u(k-3)*u(k-6)", 0.007122298082, 0.001931, 0.00059931),
    ("y(k-1)*u(k-5)", 0.0123762739, 0.003026, 0.00008831),
    ("u(k-1)*u(k-3)", 0.004570538787, 0.0009092, 0.00008071),
    ("1", 0.01566686467, 0.003673, 0.00004465),
    ("y(k-7)*u(k-7)", 0.07512060272, 0.01094, 0.00005526),
    ("y(k-6)*u(k-7)", -0.06191134205, 0.01053, 0.00005173),
    ("u(k-4)*u(k-6)", 0.007168366459, 0.001971, 0.00002869),
    ("u(k-6)", 0.008857306615, 0.002887, 0.00001422),
    ("y(k-7)*u(k-6)", -0.01366732385, 0.003863, 0.00000725),
    ("y(k-3)*u(k-3)", 0.005392255409, 0.002505, 0.00001007),
    ("y(k-2)*u(k-6)", 0.00955945975, 0.003986, 0.00000887),
    ("y(k-4)", 0.08810028886, 0.03708, 0.00001143),
];

/// A log in the repository or beside it, and which of its rows and columns make a case.
struct Case {
    log: &'static str,
    columns: [&'static str; 2],
    rows: std::ops::RangeInclusive<usize>,
    options: &'static str,
    terms: &'static [Term],
    rmse: f64,
}

const CASES: [Case; 5] = [
    Case {
        log: "robot_arm.csv",
        columns: ["u", "y"],
        rows: 1..=512,
        options: "--ny 4 --nu 5 --nk 0",
        terms: ROBOT_ARM,
        rmse: 0.000931047814,
    },
    Case {
        log: "cascaded_tanks_est.csv",
        columns: ["u", "y"],
        rows: 1..=1024,
        options: "--ny 2 --nu 2",
        terms: TANKS,
        rmse: 0.0471403181,
    },
    Case {
        log: "silverbox.csv",
        columns: ["u", "y"],
        rows: 40651..=105_712,
        options: "--ny 3 --nu 3 --nk 0 --degree 3",
        terms: SILVERBOX,
        rmse: 8.38599575e-5,
    },
    Case {
        log: "ced_uniform.csv",
        columns: ["u11", "z11"],
        rows: 1..=400,
        options: "--ny 7 --nu 7",
        terms: COUPLED_DRIVES_1,
        rmse: 0.0414880689,
    },
    Case {
        log: "ced_uniform.csv",
        columns: ["u12", "z12"],
        rows: 1..=400,
        options: "--ny 7 --nu 7",
        terms: COUPLED_DRIVES_2,
        rmse: 0.0325473736,
    },
];

/// Some rows of two columns of a public log, called u and y; `None` if it is absent.
fn cut(log: &str, columns: [&str; 2], rows: &std::ops::RangeInclusive<usize>) -> Option<String> {
    let text = fs::read_to_string(public_log(log)?).expect("the log is readable");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("it has a header").split(',').collect();
    let places =
        columns.map(|name| header.iter().position(|column| *column == name).expect("the column is there"));
    let cut = lines.skip(rows.start() - 1).take(rows.end() - rows.start() + 1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        format!("{},{}\n", cells[places[0]].trim(), cells[places[1]].trim())
    });
    Some(std::iter::once("u,y\n".to_owned()).chain(cut).collect())
}

#[test]
fn terms_and_coefficients_are_those_of_an_independent_program() {
    for case in CASES {
        let Some(log) = cut(case.log, case.columns, &case.rows) else { continue };
        let folder = Folder::with_log(log);
        let report = folder.fit(&format!(
            "log.csv --narx poly {} --terms {} --detrend none --raw-terms --sample-time 1",
            case.options,
            case.terms.len()
        ));
        let (path, parameters) = (&report["estimation"]["maps"][0]["path"], &report["model"]["parameters"]);
        for (at, (name, value, error, reduction)) in case.terms.iter().enumerate() {
            let (step, parameter) = (&path[at], &parameters[at]);
            assert_eq!(
                (&step["term"], &parameter["name"]),
                (&(*name).into(), &(*name).into()),
                "{}",
                case.log
            );
            let found = number(parameter, "/value");
            assert!((found / value - 1.0).abs() < 1e-7, "{name}: {found} {value}");
            let found = number(parameter, "/standard_error");
            assert!((found / error - 1.0).abs() < 1e-3, "{name}: {found} {error}");
            let found = number(step, "/error_reduction");
            assert!((found - reduction).abs() < 1e-8, "{name}: {found} {reduction}");
        }
        let rmse = number(&report, "/estimation/mse").sqrt();
        assert!((rmse / case.rmse - 1.0).abs() < 1e-8, "{}: {rmse}", case.log);
    }
}

/// The free runs of models with given terms over rows that they were not fitted to, after the first `skip` samples.
#[test]
fn free_runs_are_those_of_an_independent_program() {
    let error = |case: &Case, rows: std::ops::RangeInclusive<usize>, log: &str, skip: usize| -> Option<f64> {
        let folder = Folder::with_log(cut(case.log, case.columns, &case.rows)?);
        let line = format!("{} --terms {} --detrend none --raw-terms", case.options, case.terms.len());
        folder.fit(&format!("log.csv --narx poly {line} --sample-time 1 --report model.json"));
        folder.write("fresh.csv", cut(log, case.columns, &rows)?);
        let run = folder.done("simulate model.json fresh.csv --sample-time 1");
        let pairs = run.stdout.lines().skip(1 + skip).filter_map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            Some(cells[1].parse::<f64>().ok()? - cells[2].parse::<f64>().ok()?)
        });
        let errors: Vec<f64> = pairs.collect();
        Some((errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt())
    };
    let [arm, tanks, silverbox, ..] = CASES;
    let found = error(&arm, 513..=1024, arm.log, 20).expect("the log comes with the tests");
    assert!((found / 0.061_163_117_6 - 1.0).abs() < 1e-6, "{found}");
    if let Some(found) = error(&tanks, 1..=1024, "cascaded_tanks_val.csv", 50) {
        assert!((found / 0.978_884_073 - 1.0).abs() < 1e-6, "{found}");
    }
    for (rows, expected) in [
        (105_713..=127_400, 0.000_305_496_963),
        (101..=40_575, 0.000_416_723_616),
        (101..=32_100, 0.000_321_015_389),
    ] {
        if let Some(found) = error(&silverbox, rows, silverbox.log, 50) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        }
    }
}

/// The coupled drives: two experiments together, the number of terms by the free run on held-out rows. Each part is a
/// log of its own, so that runs begin inside of it: after its first ten rows, which are the longest lag.
#[test]
fn the_coupled_drives_have_as_many_terms_as_run_best() {
    let folder = Folder::new();
    for (drive, columns) in [["u11", "z11"], ["u12", "z12"]].into_iter().enumerate() {
        for (part, rows) in [("estimate", 1..=200), ("validate", 201..=400), ("test", 401..=500)] {
            let Some(log) = cut("ced_uniform.csv", columns, &rows) else { return };
            folder.write(&format!("{part}{drive}.csv"), log);
        }
    }
    // In a report the validation rows come last.
    let free_run = |document: &Value| {
        let fits = document["fit"].as_array().expect("there are fits");
        number(fits.iter().rfind(|fit| fit["horizon"]["kind"] == "free-run").expect("it ran"), "/rmse")
    };
    for (options, terms, validation, test) in
        [("", 38, 0.2084, [0.0953, 0.0726]), ("--terms 10", 10, 0.2360, [0.1191, 0.1045])]
    {
        let report = folder.fit(&format!(
            "estimate0.csv estimate1.csv validate0.csv validate1.csv --narx poly --ny 10 --nu 10 --nk 0 \
             --sample-time 0.02 --estimate 1..400 --validate 401..800 {options} --report model.json"
        ));
        assert_eq!(report["model"]["parameters"].as_array().map(Vec::len), Some(terms));
        let found = free_run(&report);
        assert!((found - validation).abs() < 1e-3, "{terms} terms: {found} {validation}");
        for (drive, expected) in test.into_iter().enumerate() {
            let line = format!("validate model.json test{drive}.csv --sample-time 0.02 --format json");
            let found = free_run(&serde_json::from_str(&folder.done(&line).stdout).expect("it is JSON"));
            assert!((found - expected).abs() < 1e-3, "{terms} terms, drive {drive}: {found} {expected}");
        }
    }
}

/// A network of two units for the cascaded tanks, trained for the free run: the optimum that an independent program
/// converged to, from samples that its scales had been taken from. It is found from at least five of twenty starts.
#[test]
fn a_trained_network_is_the_optimum_of_an_independent_program() {
    let scaled = |log: &str| -> Option<String> {
        let text = cut(log, ["u", "y"], &(1..=1024))?;
        let scale = |cell: &str, offset: f64, scale: f64| {
            (cell.parse::<f64>().expect("it is a number") - offset) / scale
        };
        let lines = text.lines().skip(1).map(|line| {
            let (u, y) = line.split_once(',').expect("there are two");
            let u = scale(u, 2.824_661_260_17, 0.936_059_559_453);
            format!("{u:?},{:?}\n", scale(y, 5.441_981_928_96, 2.032_942_234_86))
        });
        Some(std::iter::once("u,y\n".to_owned()).chain(lines).collect())
    };
    let (Some(log), Some(fresh)) = (scaled("cascaded_tanks_est.csv"), scaled("cascaded_tanks_val.csv"))
    else {
        return;
    };
    let folder = Folder::with_log(log);
    folder.write("fresh.csv", fresh);
    let report = folder.fit(
        "log.csv --narx tanh --units 2 --ny 3 --nu 3 --ridge 1.024 --starts 19 --raw-terms --detrend none --sample-time 4 --report \
         model.json",
    );
    let training = &report["estimation"]["maps"][0]["training"];
    let cost = number(training, "/cost");
    assert!((cost / 12.638_680_485 - 1.0).abs() < 1e-6, "{cost}");
    let starts = training["starts"].as_array().expect("there are starts");
    let found = starts.iter().filter_map(Value::as_f64).filter(|start| start / cost - 1.0 < 1e-6).count();
    assert!(starts.len() == 20 && found >= 5, "{starts:?}");
    let run = |line: &str, skip: usize| -> f64 {
        let run = folder.done(line);
        let errors: Vec<f64> = (run.stdout.lines().skip(1 + skip))
            .filter_map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                Some(cells[1].parse::<f64>().ok()? - cells[2].parse::<f64>().ok()?)
            })
            .collect();
        2.032_942_234_86 * (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
    };
    let own = run("simulate model.json log.csv --sample-time 4", 0);
    assert!((own - 0.199_580_8).abs() < 1e-5, "{own}");
    let test = run("simulate model.json fresh.csv --sample-time 4", 50);
    assert!((test - 0.384_180_5).abs() < 1e-4, "{test}");
}

/// Products trained for the free run, from the least errors one step ahead, and a network; of the Silverbox and of a
/// robot arm.
#[test]
fn free_runs_are_trained_to_what_others_reached() {
    let rmse = |folder: &Folder, fresh: String| -> f64 {
        folder.write("fresh.csv", fresh);
        let run = folder.done("validate model.json fresh.csv --sample-time 1 --format json");
        let document: Value = serde_json::from_str(&run.stdout).expect("it is JSON");
        let fits = document["fit"].as_array().expect("there are fits");
        number(fits.iter().rfind(|fit| fit["horizon"]["kind"] == "free-run").expect("it ran"), "/rmse")
    };
    let [arm, _, silverbox, ..] = CASES;
    if let Some(log) = cut(silverbox.log, silverbox.columns, &silverbox.rows) {
        let folder = Folder::with_log(log);
        folder.fit(&format!(
            "log.csv --narx poly {} --terms 20 --focus simulation --sample-time 1 --report model.json",
            silverbox.options
        ));
        for (rows, expected) in
            [(105_713..=127_400, 0.2425e-3), (101..=40_575, 0.3542e-3), (101..=32_100, 0.2478e-3)]
        {
            let Some(fresh) = cut(silverbox.log, silverbox.columns, &rows) else { return };
            let found = rmse(&folder, fresh);
            assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
        }
    }
    let folder =
        Folder::with_log(cut(arm.log, arm.columns, &arm.rows).expect("the log comes with the tests"));
    folder.fit(
        "log.csv --narx tanh --units 4 --ny 6 --nu 6 --nk 0 --ridge 0.05 --sample-time 1 --report model.json",
    );
    let found =
        rmse(&folder, cut(arm.log, arm.columns, &(513..=1024)).expect("the log comes with the tests"));
    assert!(found < 0.013, "{found}");
}
