//! Fits that wild samples do not rule.

use crate::harness::{Folder, number, parameters};
use crate::signals::{Polynomials, Random, csv};

/// Output error with a wild sample in every 25 rows.
fn wild() -> String {
    let mut random = Random::new(31);
    let u = random.signal(800);
    let e: Vec<f64> = (0..800).map(|t| if t % 25 == 7 { 15.0 } else { 0.1 } * random.uniform()).collect();
    let y = Polynomials::new(&[], &[0.0, 0.5, 0.3], &[], &[], &[-1.2, 0.5]).outputs(&[&u], &e);
    csv(&[("u", &u), ("y", &y)])
}

#[test]
fn every_structure_has_its_robust_fit() {
    let folder = Folder::with_log(wild());
    let far = |options: &str| {
        let report = folder.fit(&format!("log.csv --model oe --nb 2 --nf 2 --detrend none {options}"));
        let found = parameters(&report);
        let far: f64 = found.iter().zip([0.5, 0.3, -1.2, 0.5]).map(|(p, truth)| (p - truth).powi(2)).sum();
        (far.sqrt(), report)
    };
    let (squares, _) = far("");
    let (huber, report) = far("--norm huber");
    let (absolute, by_size) = far("--norm 1");
    println!("off by {squares} with squares, {huber} with Huber's loss, {absolute} with absolute errors");
    assert!(huber < 0.1 * squares && absolute < 0.2 * squares, "{squares} {huber} {absolute}");
    assert_eq!(report["estimation"]["method"], "robust");
    assert_eq!(
        (number(&report, "/estimation/k"), &by_size["estimation"]["k"]),
        (1.345, &serde_json::Value::Null)
    );
    let bound = number(&report, "/estimation/bound");
    assert!((bound - 1.345 * number(&report, "/estimation/scale")).abs() < 1e-12);
    assert!((0.03..0.3).contains(&number(&report, "/estimation/beyond")));
    assert!(number(&report, "/model/parameters/0/standard_error") < 0.05);
    let table = folder.done("fit log.csv --model oe --nb 2 --nf 2 --norm huber:2 --report model.json").stdout;
    assert!(table.contains("mean of Huber's loss with k = 2 "), "{table}");
    assert!(table.contains("robust prediction error, "), "{table}");
    // The report is one for the other verbs.
    let validation = folder.done("validate model.json log.csv --format json").stdout;
    assert!(validation.contains("\"in_sample\": \"yes\""), "{validation}");
    for options in [
        "--na 2 --nb 2 --norm huber",
        "--na 2 --nb 2 --norm huber --search gauss-newton --tolerance 1e-10",
        "--model armax --na 2 --nb 2 --nc 1 --norm 1",
        "--model arma --na 1 --nc 1 --norm huber",
        "--model bj --nb 2 --nc 1 --nd 1 --nf 2 --norm huber --prefilter ..0.4",
    ] {
        let report = folder.fit(&format!("log.csv {options}"));
        assert_eq!(report["estimation"]["method"], "robust", "{options}");
    }
}
