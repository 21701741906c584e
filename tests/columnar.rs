//! Logs in Parquet and Arrow files, of PyArrow and Polars: they are the same log as in text
//! (`tests/data/columnar/make.py`).

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::harness::{Folder, distance, parameters};

/// The files beside log.csv, and whether their times name no offset from UTC, so that the first is written in it.
const FILES: [(&str, bool); 6] = [
    ("pyarrow.parquet", false),
    ("pyarrow.arrow", false),
    ("pyarrow.arrows", false),
    ("polars.parquet", true),
    ("polars.arrow", true),
    ("polars.arrows", true),
];

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/columnar").join(name)
}

/// All of them in a folder.
fn folder() -> Folder {
    let folder = Folder::new();
    for name in FILES.map(|(name, _)| name).into_iter().chain(["log.csv"]) {
        folder.write(name, fs::read(data(name)).expect("a log"));
    }
    folder
}

/// A report without what names the file.
fn nameless(mut report: Value) -> Value {
    report["command"].take();
    report["data"]["logs"].take();
    report
}

#[test]
fn the_fit_is_that_of_the_text() {
    let folder = folder();
    let text = folder.fit("log.csv --time when --na 1 --nb 1 --validate 41..60");
    for (name, in_utc) in FILES {
        let report = folder.fit(&format!("{name} --time when --na 1 --nb 1 --validate 41..60"));
        let start = if in_utc { "2024-03-01T11:00:00.25Z" } else { "2024-03-01T12:00:00.25+01:00" };
        assert_eq!(report["data"]["logs"][0]["start"], start, "{name}");
        assert_eq!(report["data"]["logs"][0]["file"], name);
        assert_eq!(nameless(report), nameless(text.clone()), "{name}");
    }
}

#[test]
fn every_verb_reads_them() {
    let folder = folder();
    folder.done("fit log.csv --time when --na 1 --nb 1 --report model.json");
    for (name, _) in FILES {
        for verb in ["predict model.json", "simulate model.json", "track --na 1 --nb 1 --format csv --quiet"]
        {
            let of = |log: &str| {
                let mut words: Vec<&str> = verb.split(' ').collect();
                words.insert(if words[0] == "track" { 1 } else { 2 }, log);
                folder.done(&format!("{} --time when", words.join(" "))).stdout
            };
            // A zone that has a name is written in UTC: predictions have the same rows, and then the same values.
            let values = |csv: String| match verb.starts_with("track") {
                true => csv,
                false => {
                    csv.lines().filter_map(|line| Some(format!("{}\n", line.split_once(',')?.1))).collect()
                }
            };
            assert_eq!(values(of(name)), values(of("log.csv")), "{verb} {name}");
        }
        folder.done(&format!("validate model.json {name} --time when"));
        let json = folder.done(&format!("inspect {name} --time when --format json")).stdout;
        let inspection: Value = serde_json::from_str(&json).unwrap();
        let left_out = inspection["findings"].to_string();
        assert!(left_out.contains("('note') is left out: it holds no numbers"), "{left_out}");
    }
}

#[test]
fn a_column_of_times_is_the_clock() {
    let folder = folder();
    let run = folder.done("fit polars.parquet --na 1 --nb 1 --format json");
    assert!(run.stderr.contains("note: polars.parquet: the clock is column 'when'"), "{}", run.stderr);
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(report, folder.planned("polars.parquet --time when --na 1 --nb 1"));
    let said = folder.done("track polars.arrows --na 1 --nb 1").stderr;
    assert!(
        said.contains("polars.arrows: column 'when' looks like a clock; --time when would use it"),
        "{said}"
    );
}

#[test]
fn a_pipe_may_bring_a_stream() {
    let folder = folder();
    let options = "--time when --na 1 --nb 1 --quiet --format csv";
    let expected = folder.done(&format!("track log.csv {options}")).stdout;
    for (name, _) in FILES {
        let run = folder.run_on(&format!("track - {options}"), fs::read(data(name)).expect("a log"));
        if !name.ends_with(".arrows") {
            assert!(run.refusal().contains("cannot come through a pipe; name the file"), "{}", run.stderr);
        } else {
            assert_eq!((run.code, run.stdout), (0, expected.clone()), "{name}: {}", run.stderr);
        }
    }
}

#[test]
fn a_run_that_was_ended_goes_on() {
    let folder = folder();
    let options = "--time when --na 1 --nb 1 --quiet --format csv";
    let whole = folder.done(&format!("track log.csv {options}")).stdout;
    for (name, _) in FILES {
        folder.done(&format!("track {name} {options} --state {name}.state -o {name}.csv"));
        folder.done(&format!("track {name} {options} --state {name}.state -o {name}.csv"));
        assert_eq!(folder.read(&format!("{name}.csv")), whole, "{name}");
    }
}

#[test]
fn what_they_do_not_hold_is_refused() {
    let folder = folder();
    folder.write("short.parquet", &fs::read(data("polars.parquet")).unwrap()[..3000]);
    folder.write("short.arrow", &fs::read(data("polars.arrow")).unwrap()[..1500]);
    folder.write("short.arrows", &fs::read(data("polars.arrows")).unwrap()[..1500]);
    for (line, words) in [
        ("fit pyarrow.parquet -u note --na 1 --nb 1", "pyarrow.parquet: column 'note' holds texts"),
        ("fit pyarrow.parquet -u pair --na 1 --nb 1", "column 'pair' is of the type Struct"),
        ("fit pyarrow.parquet -u when --na 1 --nb 1", "column 'when' holds times"),
        (
            "fit pyarrow.arrow --delimiter ; --na 1 --nb 1",
            "--delimiter says how a text is written, and this is an Arrow file",
        ),
        ("fit polars.arrow --time when --time-format %Y --na 1 --nb 1", "--time-format says nothing of it"),
        ("fit short.parquet --na 1 --nb 1", "short.parquet: this is no whole Parquet file"),
        ("fit short.arrow --na 1 --nb 1", "short.arrow: this is no whole Arrow file"),
        ("fit short.arrows --na 1 --nb 1", "short.arrows: it ends too early"),
    ] {
        folder.assert_refused(line, 3, words);
    }
}

#[test]
fn they_are_read_part_by_part_too() {
    let folder = folder();
    let text = folder.fit("log.csv --time when --na 1 --nb 1");
    for (name, _) in FILES {
        let stream = folder.fit(&format!("{name} --time when --na 1 --nb 1 --stream"));
        assert!(distance(&parameters(&stream), &parameters(&text)) < 1e-12, "{name}");
        assert_eq!(stream["data"]["rows"], text["data"]["rows"], "{name}");
    }
}
