//! Impulse responses by regularised least squares: values of an independent program, and their report in every verb.

use crate::harness::{Folder, number};

/// Hair dryer, means removed, 70 taps, samples 70 to 1000: the marginal likelihood by its definition, with dense
/// matrices, maximised by another program.
#[test]
fn kernels_are_those_of_an_independent_program() {
    let folder = Folder::with_log(include_str!("data/public/hair_dryer.csv"));
    for (kernel, likelihood) in [("dc", -4376.915), ("tc", -4364.948)] {
        let line =
            format!("log.csv --model fir --taps 70 --kernel {kernel} --constant no --sample-time 0.08");
        let report = folder.fit(&line);
        assert_eq!(number(&report, "/estimation/samples"), 931.0);
        let found = number(&report, "/estimation/minus_two_log_likelihood");
        assert!((found - likelihood).abs() < 0.002, "{kernel}: {found}");
        for (tap, expected) in [(3, 0.0685), (4, 0.1272), (5, 0.1407), (6, 0.1305)] {
            let found = number(&report, &format!("/model/parameters/{tap}/value"));
            assert!((found - expected).abs() < 1.5e-4, "{kernel} {tap}: {found}");
        }
    }
}

#[test]
fn every_verb_takes_the_response() {
    let folder = Folder::with_log(include_str!("data/public/hair_dryer.csv"));
    let common = "--sample-time 0.08 --estimate 1..500 --validate 501..1000";
    let report =
        folder.fit(&format!("log.csv --model fir --taps 60 {common} --report model.json --html page.html"));
    let free = number(&report, "/estimation/effective_parameters");
    assert!(free > 5.0 && free < 25.0, "{free}");
    // Least squares has all of them, and simulates fresh rows no better.
    let plain = folder.fit(&format!("log.csv --model fir --taps 60 --kernel none {common}"));
    assert_eq!(plain["estimation"]["method"], "least-squares");
    assert!(number(&report, "/fit/2/percent") > number(&plain, "/fit/2/percent") - 1.0);
    let table = folder.done(&format!("fit log.csv --model fir --taps 60 {common}")).stdout;
    assert!(table.contains("regularised by the DC kernel") && !table.contains("zero of B"), "{table}");
    let impulse = folder.done("impulse model.json --samples 10").stdout;
    let tap: Vec<f64> =
        impulse.lines().nth(6).unwrap().split(',').filter_map(|cell| cell.parse().ok()).collect();
    assert!(
        (tap[1] - number(&report, "/model/parameters/5/value")).abs() < 1e-15 && tap[2] > 0.0,
        "{impulse}"
    );
    for line in [
        "step model.json",
        "bode model.json",
        "predict model.json log.csv --sample-time 0.08 --horizon 3",
        "simulate model.json log.csv --sample-time 0.08",
        "validate model.json log.csv --sample-time 0.08 --rows 501..1000",
        "compare model.json log.csv --sample-time 0.08 --rows 501..1000",
    ] {
        folder.done(line);
    }
}

#[test]
fn what_cannot_be_is_told() {
    let folder = Folder::with_log(include_str!("data/public/hair_dryer.csv"));
    for (options, code, words) in [
        ("--model fir", 2, "--taps"),
        ("--model fir --taps 0", 2, "one tap at least"),
        ("--model fir --taps 2000", 2, "1000"),
        ("--model fir --taps 20,20", 2, "2 values for 1 input"),
        ("--model fir --taps 20 --nb 2", 2, "--nb: does not work with --model fir"),
        ("--model fir --taps 20 --nk 0..3", 2, "--nk: --model fir is one model: give one value"),
        ("--model fir --taps 20 --kernel rbf", 2, "rbf"),
        ("--model fir --taps 20 --norm 1", 2, "--norm: it goes with --kernel none"),
        ("--model fir --taps 20 --ridge 1", 2, "--ridge: it goes with --kernel none"),
        ("--model fir --taps 20 --likelihood exact", 2, "--likelihood: it goes with --kernel none"),
        ("--taps 20", 2, "--model fir"),
        ("--model arx --na 1 --nb 1 --kernel dc", 2, "--kernel: does not work with --model arx"),
        ("--narx poly --taps 20", 2, "--taps: does not work with --narx"),
        ("--model fir --taps 400 --estimate 1..300", 4, "too few rows"),
    ] {
        let run = folder.run(&format!("fit log.csv --sample-time 0.08 {options} --report report.json"));
        assert_eq!(run.code, code, "{options}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{options}: {}", run.stderr);
        assert!(!folder.path("report.json").exists(), "{options}");
    }
}
