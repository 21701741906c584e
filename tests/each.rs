//! Many logs, each by itself: a row for each in a table, a document for each in a folder.

use serde_json::Value;

use crate::harness::{Folder, Run};
use crate::signals::{Experiment, csv, plain_log};

/// Logs with which nothing can be done, and the exit code of each.
const BROKEN: [(&str, &[u8], u64); 10] = [
    ("empty.csv", b"", 3),
    ("header.csv", b"u,y\n", 3),
    ("row.csv", b"u,y\n1,2\n", 4),
    ("constant.csv", b"u,y\n1,2\n1,2\n1,2\n1,2\n1,2\n1,2\n1,2\n1,2\n", 4),
    ("word.csv", b"u,y\n1,2\n3,four\n5,6\n", 3),
    ("ragged.csv", b"u,y\n1,2\n3\n5,6\n", 3),
    ("names.csv", b"a,b\n1,2\n3,4\n5,6\n", 3),
    ("infinite.csv", b"u,y\n1,2\n3,inf\n5,6\n", 3),
    ("packed.csv", b"\x1f\x8b\x08\x00cut", 5),
    ("huge.csv", b"u,y\n1e300,2e300\n3e300,-4e300\n5e300,6e300\n1e300,1e300\n-3e300,1e299\n2e300,3e300\n", 3),
];

/// A folder with as many logs of one plant, of different lengths, among logs that are broken.
fn plants(count: usize) -> Folder {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("logs")).expect("a folder can be made");
    for index in 0..count {
        let Experiment { u, y, .. } = Experiment::new(150 + 20 * index);
        folder.write(&format!("logs/plant{index:02}.csv"), csv(&[("u", &u), ("y", &y)]));
    }
    for (name, bytes, _) in BROKEN {
        folder.write(&format!("logs/{name}"), bytes);
    }
    folder
}

/// The table's rows: each cell by the name of its column.
fn rows(table: &str) -> Vec<Value> {
    let mut csv = csv::Reader::from_reader(table.as_bytes());
    let names: Vec<String> = csv.headers().expect("the table has names").iter().map(str::to_owned).collect();
    let row = |record: Result<csv::StringRecord, csv::Error>| {
        let record = record.expect("the table can be read");
        names.iter().zip(&record).map(|(name, cell)| (name.clone(), Value::from(cell))).collect()
    };
    csv.records().map(row).collect()
}

fn on_threads(folder: &Folder, line: &str, threads: &str) -> Run {
    let mut command = folder.command(line);
    command.env("RAYON_NUM_THREADS", threads);
    Run::of(command)
}

#[test]
fn a_row_is_what_a_fit_of_its_log_alone_gives() {
    let folder = plants(5);
    let run = folder.done("fit --each logs/*.csv --na 1..3 --nb 1..3 --nk 1 --table fleet.csv --reports out");
    assert!(run.stdout.starts_with("fleet.csv: 15 rows, 5 of them without a failure\n"), "{}", run.stdout);
    assert!(
        run.stdout.contains("with exit code 3, the first: logs/empty.csv: the file is empty"),
        "{}",
        run.stdout
    );
    assert_eq!(run.stderr, "");
    let rows = rows(&folder.read("fleet.csv"));
    assert_eq!(rows.len(), 15);
    for row in &rows {
        let log = row["log"].as_str().expect("a name");
        let alone = folder.run(&format!("fit {log} --na 1..3 --nb 1..3 --nk 1 --report alone.json"));
        assert_eq!(row["exit_code"], alone.code.to_string().as_str(), "{log}");
        if alone.code == 0 {
            let stored = row["report"].as_str().expect("a report");
            assert_eq!(folder.read(stored), folder.read("alone.json"), "{log}");
            let report: Value = serde_json::from_str(&folder.read(stored)).expect("a report");
            let value = |cell: &str| row[cell].as_str().and_then(|text| text.parse::<f64>().ok());
            assert_eq!(value("fit_1"), report["fit"][0]["percent"].as_f64(), "{log}");
            for parameter in report["model"]["parameters"].as_array().expect("a list") {
                let name = parameter["name"].as_str().expect("a name");
                assert_eq!(value(name), parameter["value"].as_f64(), "{log} {name}");
                assert_eq!(
                    value(&format!("{name}_error")),
                    parameter["standard_error"].as_f64(),
                    "{log} {name}"
                );
            }
            assert_eq!(value("dc_gain"), report["model"]["dc_gain"][0]["value"].as_f64(), "{log}");
        } else {
            let why = row["message"].as_str().expect("a sentence");
            assert_eq!(alone.stderr, format!("error: {why}\n"), "{log}");
            assert_eq!(row["report"], "", "{log}");
        }
    }
    for (name, _, code) in BROKEN {
        let row = rows.iter().find(|row| row["log"] == format!("logs/{name}").as_str()).expect("a row");
        assert_eq!(row["exit_code"], code.to_string().as_str(), "{name}: {}", row["message"]);
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let folder = plants(4);
    let line = "fit --each logs/plant*.csv logs/word.csv --table";
    let first = on_threads(&folder, &format!("{line} 1.csv --reports one"), "1");
    assert_eq!(first.code, 0, "{}", first.stderr);
    for (threads, more) in [("2", ""), ("7", ""), ("1", "--threads 3")] {
        let run = on_threads(&folder, &format!("{line} - --reports {threads}{} {more}", more.len()), threads);
        assert_eq!(run.code, 0, "{}", run.stderr);
        let other = run.stdout.replace(&format!("{threads}{}/", more.len()), "one/");
        assert_eq!(other, folder.read("1.csv"), "{threads} {more}");
        for log in 0..4 {
            let report = |reports: &str| folder.read(&format!("{reports}/plant{log:02}.json"));
            assert_eq!(report(&format!("{threads}{}", more.len())), report("one"));
        }
    }
}

#[test]
fn a_run_goes_on_where_it_was() {
    let folder = plants(4);
    let line = "fit --each logs/*.csv --na 2 --nb 2 --table fleet.csv --reports out";
    folder.done(line);
    let table = folder.read("fleet.csv");
    // All but what could not be read is known.
    let again = folder.done(line);
    assert!(
        again.stdout.contains("4 of them without a failure; 13 as in an earlier run"),
        "{}",
        again.stdout
    );
    assert_eq!(folder.read("fleet.csv"), table);
    // A log that has changed, a document that is gone, a journal that was cut: these are done again.
    folder.write("logs/plant00.csv", plain_log());
    std::fs::remove_file(folder.path("out/plant01.json")).expect("it is there");
    let journal = folder.read("out/journal.jsonl");
    let cut = journal.trim_end().len() - 20;
    folder.write("out/journal.jsonl", &journal[..cut]);
    let again = folder.done(line);
    assert!(again.stdout.contains("; 10 as in an earlier run"), "{}", again.stdout);
    let changed = folder.read("fleet.csv");
    assert_ne!(changed, table);
    assert_eq!(changed.lines().skip(12).collect::<Vec<_>>(), table.lines().skip(12).collect::<Vec<_>>());
    assert!(folder.done(line).stdout.contains("; 13 as in an earlier run"));
    // Other options are another run.
    let other = folder.done(&line.replace("--na 2", "--na 1"));
    assert!(!other.stdout.contains("earlier run"), "{}", other.stdout);
    assert!(folder.done(line).stdout.contains("without a failure\n"));
}

#[test]
fn a_document_belongs_to_its_log_and_is_whole() {
    let folder = plants(2);
    for (name, plant) in [("a", 0), ("b", 1)] {
        std::fs::create_dir(folder.path(name)).expect("a folder");
        let log = folder.read(&format!("logs/plant{plant:02}.csv"));
        folder.write(&format!("{name}/x.csv"), log);
    }
    let each = |words: &str| format!("fit --each {words} --na 1 --nb 1 --reports out --table");
    folder.done(&format!("{} t.csv", each("a/x.csv")));
    let (document, journal) = (folder.read("out/x.json"), folder.read("out/journal.jsonl"));
    let refused = |line: &str, why: &str| {
        folder.assert_refused(line, 2, why);
        assert_eq!(
            (folder.read("out/x.json"), folder.read("out/journal.jsonl")),
            (document.clone(), journal.clone())
        );
    };
    refused(&format!("{} t.csv", each("b/x.csv")), "out/x.json is the document of a/x.csv");
    refused(&format!("{} out/journal.jsonl", each("a/x.csv")), "would be replaced");
    refused(&format!("{} out/x.json", each("a/x.csv")), "is the document of a/x.csv");
    refused(&format!("{} out/x.json", each("logs/plant00.csv")), "would be replaced");
    // What is no longer what was written is written anew.
    for changed in ["", &document[..100]] {
        folder.write("out/x.json", changed);
        let run = folder.done(&format!("{} t.csv", each("a/x.csv")));
        assert!(!run.stdout.contains("earlier run"), "{}", run.stdout);
        assert_eq!(folder.read("out/x.json"), document);
    }
    assert!(folder.done(&format!("{} t.csv", each("a/x.csv"))).stdout.contains("1 as in an earlier run"));
    // A log that is not there any more has no say.
    std::fs::remove_file(folder.path("a/x.csv")).expect("it is there");
    folder.done(&format!("{} t.csv", each("b/x.csv")));
}

#[test]
fn names_patterns_and_lists_are_logs() {
    let folder = plants(3);
    folder.write("list.txt", "logs/plant02.csv\nlogs/plant0[01].csv\n\n");
    let log = |row: &Value| row["log"].as_str().unwrap_or_default().to_owned();
    let logs = |line: &str| -> Vec<String> {
        rows(&folder.done(&format!("fit --each {line} --na 1 --nb 1 --table -")).stdout)
            .iter()
            .map(log)
            .collect()
    };
    let of = |numbers: &[usize]| -> Vec<String> {
        numbers.iter().map(|number| format!("logs/plant{number:02}.csv")).collect()
    };
    assert_eq!(logs("--list list.txt"), of(&[2, 0, 1]));
    assert_eq!(logs("logs/plant01.csv --list list.txt"), of(&[1, 2, 0]));
    assert_eq!(logs("logs/**/plant*.csv logs/plant01.csv"), of(&[0, 1, 2]));
    // A name that looks like a pattern, and is there, is a log.
    folder.write("[a].csv", plain_log());
    assert_eq!(logs("[a].csv"), ["[a].csv"]);
    // One that is not there is a row.
    let run = folder.done("fit --each logs/plant00.csv none.csv --na 1 --nb 1 --table -");
    let rows = rows(&run.stdout);
    assert_eq!(rows[1]["exit_code"], "5");
    assert!(rows[1]["message"].as_str().is_some_and(|why| why.contains("none.csv: cannot be opened")));
    let read = folder.run_on("fit --each --list - --na 1 --nb 1 --table -", "logs/plant00.csv\n");
    assert_eq!((read.code, read.stdout.lines().count()), (0, 2), "{}", read.stderr);
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_done() {
    let folder = plants(1);
    folder.write("file", "");
    for (line, code, why) in [
        ("fit --each logs/plant00.csv", 2, "--table"),
        ("fit logs/plant00.csv --table x.csv", 2, "--each"),
        ("fit --each logs/plant00.csv --table x.csv --report y.json", 2, "--report"),
        ("fit --each none/*.csv --table x.csv", 2, "no file matches"),
        ("fit --each - --table x.csv", 2, "standard input"),
        ("fit --each logs/[.csv --table x.csv", 2, "this is no pattern"),
        ("fit --each logs/plant00.csv --threads 0 --table x.csv", 2, "--threads"),
        ("fit --each logs/plant00.csv --na two --table x.csv", 2, "--na"),
        ("fit --each logs/plant00.csv --grey none.toml --table x.csv", 5, "none.toml"),
        ("fit --each --list none.txt --table x.csv", 5, "none.txt"),
        ("fit --each --list file --table x.csv", 2, "no log is named"),
        ("fit --each logs/plant00.csv --table logs/plant00.csv", 2, "would be replaced"),
        ("fit --each logs/plant00.csv --table x.csv --reports file", 5, "file"),
        ("fit --each logs/plant00.csv --table none/x.csv --reports out", 5, "its folder is not there"),
        ("inspect logs/plant00.csv logs/word.csv", 2, "--each"),
        ("inspect --each logs/plant00.csv --table x.csv -o y.json", 2, "--out"),
        ("validate file logs/plant00.csv logs/word.csv", 2, "--each"),
        ("validate none.json --each logs/plant00.csv --table x.csv", 5, "none.json"),
    ] {
        let run = folder.run(line);
        assert_eq!(run.code, code, "{line}: {}", run.stderr);
        assert!(run.stderr.contains(why), "{line}: {}", run.stderr);
        assert_eq!(folder.names(), ["file", "logs"], "{line}");
    }
    // A log for each document.
    std::fs::copy(folder.path("logs/plant00.csv"), folder.path("logs/plant00.txt"))
        .expect("it can be copied");
    folder.assert_refused(
        "fit --each logs/plant00.csv logs/plant00.txt --table x.csv --reports out",
        2,
        "would both be plant00.json",
    );
    folder.done("fit --each logs/plant00.csv logs/plant00.txt --na 1 --nb 1 --table x.csv");
}

#[test]
fn where_no_log_goes_well_the_run_does_not_either() {
    let folder = plants(0);
    let run = folder.run("fit --each logs/*.csv --na 1 --nb 1 --table fleet.csv");
    assert_eq!(run.code, 4, "{}", run.stderr);
    assert!(run.stderr.contains("no log went well; the first: logs/constant.csv"), "{}", run.stderr);
    assert_eq!(rows(&folder.read("fleet.csv")).len(), BROKEN.len());
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_ends_the_run_without_a_table() {
    let folder = plants(2);
    std::fs::create_dir(folder.path("out")).expect("a folder can be made");
    std::os::unix::fs::symlink("/dev/full", folder.path("out/plant01.json")).expect("a link can be made");
    folder.assert_refused(
        "fit --each logs/plant*.csv --na 1 --nb 1 --table fleet.csv --reports out",
        5,
        "plant01.json: cannot be written",
    );
    assert!(!folder.names().contains(&"fleet.csv".to_owned()));
}

#[test]
fn inspections_and_validations_have_tables_too() {
    let folder = plants(3);
    let run = folder.done("inspect --each logs/*.csv --table inspected.csv --reports inspected");
    assert!(run.stdout.contains("13 rows"), "{}", run.stdout);
    let table = rows(&folder.read("inspected.csv"));
    let plant = table.iter().find(|row| row["log"] == "logs/plant01.csv").expect("a row");
    let alone: Value = serde_json::from_str(&folder.done("inspect logs/plant01.csv --format json").stdout)
        .expect("a document");
    assert_eq!(plant["rows"], "170");
    assert_eq!(
        plant["mean_u"].as_str().and_then(|cell| cell.parse().ok()),
        alone["channels"][0]["mean"].as_f64()
    );
    assert_eq!(
        folder.read("inspected/plant01.json"),
        folder.done("inspect logs/plant01.csv --format json").stdout
    );

    folder.done("fit logs/plant02.csv --na 2 --nb 2 --report model.json");
    folder.done("validate model.json --each logs/plant*.csv --table validated.csv --reports validated");
    let table = rows(&folder.read("validated.csv"));
    assert_eq!(table.len(), 3);
    for row in &table {
        let log = row["log"].as_str().expect("a name");
        let alone = folder.done(&format!("validate model.json {log} --format json"));
        assert_eq!(folder.read(row["report"].as_str().expect("a report")), alone.stdout, "{log}");
        let alone: Value = serde_json::from_str(&alone.stdout).expect("a document");
        assert_eq!(
            row["fit_1"].as_str().and_then(|cell| cell.parse().ok()),
            alone["fit"][0]["percent"].as_f64()
        );
    }
    // A gate for each.
    let run =
        folder.run("validate model.json --each logs/plant*.csv logs/word.csv --require fit>=99.9 --table -");
    assert_eq!(run.code, 6, "{}", run.stderr);
    assert!(run.stderr.ends_with("3 of 4 logs do not meet what is required\n"), "{}", run.stderr);
    let codes: Vec<Value> = rows(&run.stdout).into_iter().map(|row| row["exit_code"].clone()).collect();
    assert_eq!(codes, ["6", "6", "6", "3"]);
}

/// It can be read once: for the work, and not for the journal.
#[test]
#[cfg(unix)]
fn a_log_may_come_through_a_pipe() {
    let folder = Folder::with_log(plain_log());
    let made = std::process::Command::new("mkfifo").arg(folder.path("pipe")).status().expect("it is there");
    assert!(made.success());
    let line = "fit --each pipe log.csv --na 1 --nb 1 --table t.csv --reports out";
    for run in 0..2 {
        let (pipe, log) = (folder.path("pipe"), folder.read("log.csv"));
        let writer = std::thread::spawn(move || std::fs::write(pipe, log));
        let done = folder.done(line);
        writer.join().expect("it does not panic").expect("somebody reads");
        // Only the file is known.
        assert_eq!(done.stdout.contains("1 as in an earlier run"), run == 1, "{}", done.stdout);
        let of = |name: &str| -> Value { serde_json::from_str(&folder.read(name)).expect("it is JSON") };
        assert_eq!(of("out/pipe.json")["model"]["a"], of("out/log.json")["model"]["a"]);
    }
}
