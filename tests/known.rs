//! `model`: models whose numbers are known.

use crate::harness::{Answer, Folder, number, numbers};

/// y(t) = 1.5 y(t-1) - 0.7 y(t-2) + u(t-2) + 0.5 u(t-3) around 20, driven around 4.
fn log() -> String {
    let (mut y, mut u) = (vec![0.0; 3], vec![0.0; 3]);
    for t in 3..400_usize {
        u.push(f64::from(u8::from(t * t % 11 < 5)));
        y.push(1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 2] + 0.5 * u[t - 3]);
    }
    let rows = u.iter().zip(&y).map(|(u, y)| format!("{},{}\n", u + 4.0, y + 20.0));
    format!("u,y\n{}", rows.collect::<String>())
}

const KNOWN: &str = "model --b 0,0,1,0.5 --f 1,-1.5,0.7 --sample-time 0.5 --offset u=4 --offset y=20";

#[test]
fn all_verbs_take_a_model_that_is_known() {
    let folder = Folder::with_log(log());
    let table = folder.done(&format!("{KNOWN} --report known.json")).stdout;
    assert!(table.contains("The numbers were given, and nothing was estimated."), "{table}");
    assert!(!table.contains("samples") && !table.contains("RMSE"), "{table}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("known.json")).expect("a document");
    assert_eq!(report["estimation"]["method"], "given");
    assert!((number(&report, "/model/dc_gain/0/value") - 7.5).abs() < 1e-9);

    // The log is its own.
    folder.done("simulate known.json log.csv --sample-time 0.5 -o simulated.csv");
    let simulated = Answer::read(&folder.read("simulated.csv"));
    assert!(simulated.rmse() < 1e-9, "{}", simulated.rmse());
    folder.done("predict known.json log.csv --sample-time 0.5 --horizon 5");
    folder.done("validate known.json log.csv --sample-time 0.5 --require stable,fit>=99.9");
    folder.done("fit log.csv --sample-time 0.5 --model oe --nb 2 --nf 2 --nk 2 --report fit.json");
    let compared = folder.done("compare known.json fit.json log.csv --sample-time 0.5").stdout;
    assert!(compared.contains("known") && compared.contains("100.000"), "{compared}");
    for verb in ["step", "impulse", "bode", "reduce"] {
        folder.done(&format!("{verb} known.json"));
    }
    // Without noise there is nothing to weigh measurements by.
    folder.assert_refused("filter known.json log.csv --sample-time 0.5", 3, "its noise variance is 0");
    folder.done(&format!("{KNOWN} --noise-covariance 0.01 --report noisy.json"));
    folder.done("filter noisy.json log.csv --sample-time 0.5");
    folder.done("convert known.json --to 1 -o slower.json");
    folder.done("control known.json --poles 0.8,0.7");
    folder.done("export known.json --to c --what simulator -o code.c");
}

#[test]
fn what_was_estimated_is_the_same_as_what_is_known() {
    let folder = Folder::with_log(log());
    folder.done(&format!("{KNOWN} --report known.json"));
    let fit =
        folder.fit("log.csv --sample-time 0.5 --model oe --nb 2 --nf 2 --nk 2 --offset u=4 --offset y=20");
    let known: serde_json::Value = serde_json::from_str(&folder.read("known.json")).expect("a document");
    for part in ["/model/b/0", "/model/f/0"] {
        let pointer = |document: &serde_json::Value| numbers(document.pointer(part).expect("numbers"));
        for (one, other) in pointer(&fit).iter().zip(pointer(&known)) {
            assert!((one - other).abs() < 1e-8, "{part}: {one} {other}");
        }
    }
}

#[test]
fn transfer_functions_and_matrices_are_models_too() {
    let folder = Folder::new();
    folder.done("model --num 3 --den 10,1 --delay 2 -u heater -y temperature --report process.json");
    let tuned = folder.done("tune process.json").stdout;
    assert!(tuned.contains("SIMC"), "{tuned}");
    let step = folder.done("step process.json --samples 200").stdout;
    let last: f64 =
        step.lines().last().and_then(|row| row.split(',').nth(2)?.parse().ok()).expect("a value of the step");
    assert!((last - 3.0).abs() < 1e-6, "{last}");
    let options = "--state-matrix 0.9,0.1;0,0.8 --input-matrix 0;1 --output-matrix 1,0 --sample-time 0.1";
    let report = folder.done(&format!("model {options} --format json")).stdout;
    let report: serde_json::Value = serde_json::from_str(&report).expect("a document");
    assert_eq!(report["model"]["kind"], "state-space");
    assert!((number(&report, "/model/dc_gain/0/0/value") - 5.0).abs() < 1e-9);
}

#[test]
fn numbers_that_make_no_model_are_refused_and_nothing_is_written() {
    let folder = Folder::new();
    for (options, words) in [
        ("", "there are no numbers: give polynomials (--b, --f"),
        ("--b 0,1", "--sample-time: polynomials in q^-1 are of sampled models"),
        ("--b 0,x --sample-time 1", "--b: '0,x': write numbers with commas"),
        ("--b 0,nan --sample-time 1", "--b: '0,nan': write numbers"),
        ("--b 0,0 --sample-time 1", "--b: all of its coefficients are zero"),
        ("--b 1 --f 2,1 --sample-time 1", "--f: it begins with 2"),
        ("--b 1 --sample-time -1", "--sample-time: it is -1 s"),
        ("--num 1,0 --den 1", "--num: its degree is above"),
        ("--num 1 --den 0", "--den: its first coefficient"),
        ("--num 1 --den 1,1 --b 1 --sample-time 1", "--num: it is for transfer functions"),
        ("--state-matrix 1,2 --output-matrix 1,0", ""),
        (
            "--state-matrix 1 --output-matrix 1 --noise-covariance -1 --sample-time 1",
            "--noise-covariance: it is no covariance",
        ),
        ("--b 1 --sample-time 1 --offset v=1", "--offset: 'v' is no channel"),
        ("--b 1 --sample-time 1 -u y", "'y' is named twice"),
    ] {
        folder.assert_refused(&format!("model {options} --report new.json"), 2, words);
        assert!(folder.names().is_empty(), "{options}");
    }
}
