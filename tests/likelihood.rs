//! The exact likelihood: models fitted through missing outputs.

use crate::harness::{Folder, number, parameters};
use crate::signals::{Polynomials, Random, csv};

/// The sunspots, with every row t (0-based) missing for which 7 t^3 mod 23 < 7.
fn sunspots() -> Folder {
    let whole = include_str!("data/public/sunspots.csv");
    let mut log = String::new();
    for (line, text) in whole.lines().enumerate() {
        let missing = line > 0 && 7 * (line - 1).pow(3) % 23 < 7;
        let (year, y) = text.split_once(',').expect("two columns");
        log += &format!("{year},{}\n", if missing { "" } else { y });
    }
    Folder::with_log(log)
}

const ARMA: &str = "log.csv --model arma --na 2 --nc 1 --likelihood exact --tolerance 1e-15";

/// As statsmodels 0.15.0 has it (`tests/data/public/sarimax_cases.py`).
#[test]
fn a_series_with_holes_is_fitted_as_by_statsmodels() {
    let folder = sunspots();
    let report = folder.fit(&format!("{ARMA} --report model.json"));
    let expected = [-1.472_485_840_269_8, 0.762_016_626_492_9, -0.151_343_801_231_4];
    assert!(parameters(&report).iter().zip(expected).all(|(own, expected)| (own - expected).abs() < 1e-7));
    assert_eq!(report["estimation"]["method"], "exact-likelihood");
    assert!((number(&report, "/estimation/log_likelihood") + 955.085_166_676_5).abs() < 1e-8);
    assert_eq!(report["estimation"]["search"]["stopped"], "converged");
    let table = folder.done(&format!("fit {ARMA}")).stdout.replace("\n  ", " ");
    assert!(table.contains("exact likelihood, ln L -955.0852, "), "{table}");
    assert!(table.contains("stationary from the first sample on"), "{table}");
    // The report is one for the other verbs.
    let validation = folder.done("validate model.json log.csv --format json").stdout;
    assert!(validation.contains("\"in_sample\": \"yes\""), "{validation}");
    let ahead = folder.done("predict model.json log.csv --horizon 3").stdout;
    assert!(ahead.lines().count() > 309, "{ahead}");
    // What it starts from is the conditional estimate of a log that is cut at each hole, which is not as near.
    let cut = folder.fit("log.csv --model arma --na 2 --nc 1");
    assert_eq!(cut["estimation"]["method"], "prediction-error");
    assert!(number(&cut, "/estimation/samples") < 0.7 * number(&report, "/estimation/samples"));
}

#[test]
fn inputs_go_on_through_holes() {
    let mut random = Random::new(7);
    let (u, e) = (random.signal(600), random.signal(600));
    let plant = Polynomials::new(&[-0.8], &[0.0, 0.5], &[0.4], &[], &[]);
    let y = plant.outputs(&[&u], &e);
    let mut rows = csv(&[("u", &u), ("y", &y)]).lines().map(str::to_owned).collect::<Vec<_>>();
    for row in (1..=600).filter(|row| row % 3 == 1) {
        rows[row] = rows[row].split_once(',').expect("two columns").0.to_owned() + ",";
    }
    let folder = Folder::with_log(rows.join("\n"));
    let line = "log.csv --model armax --na 1 --nb 1 --nc 1 --likelihood exact";
    for (options, initial) in [("", "zero"), ("--initial zero", "zero"), ("--initial estimate", "estimate")] {
        let report = folder.fit(&format!("{line} {options}"));
        assert_eq!(report["estimation"]["initial"], initial, "{options}");
        for (place, truth) in [-0.8, 0.5, 0.4].into_iter().enumerate() {
            let at = format!("/model/parameters/{place}");
            let (value, error) =
                (number(&report, &format!("{at}/value")), number(&report, &format!("{at}/standard_error")));
            assert!(
                (value - truth).abs() < 4.0 * error && error < 0.2,
                "{options} {place}: {value} ± {error}"
            );
        }
    }
    // Inputs before the rows of the fit are known.
    let later = folder.fit(&format!("{line} --estimate 101..600"));
    assert_eq!(later["estimation"]["initial"], "estimate");
    folder.done(&format!("fit {line} --html page.html"));
    assert!(folder.read("page.html").contains("exact likelihood"));
}

#[test]
fn what_it_does_not_go_with_is_refused_in_a_sentence() {
    let folder = sunspots();
    for (options, words) in [
        ("--model oe --nb 1 --nf 1", "for ar, arma, arx and armax"),
        ("--model bj --nb 1 --nc 1 --nd 1 --nf 1", "for ar, arma, arx and armax"),
        ("--model general --na 1 --nb 1 --nd 1", "for ar, arma, arx and armax"),
        ("--model arma --na 1..2 --nc 1", "for one model"),
        ("", "for one model"),
        ("--model arma --na 1 --nc 1 --norm huber", "--norm: does not go with"),
        ("--na 1 --nb 1 --ridge 1", "--ridge: does not go with"),
        ("--na 1 --nb 1 --method iv", "--method: does not go with"),
        ("--na 1 --nb 1 --prefilter ..0.1", "--prefilter: does not go with"),
        ("--model arma --na 1 --nc 1 --initial drop", "--initial: drop leaves samples out"),
        ("--model arma --na 1 --nc 1 --initial estimate", "this model has none"),
    ] {
        folder.assert_refused(&format!("fit log.csv {options} --likelihood exact"), 2, words);
    }
}
