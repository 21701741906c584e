//! No output replaces what is read, whatever the two are called.
#![cfg(unix)]

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::symlink;
use std::process::Stdio;

use crate::harness::{Folder, Run};
use crate::signals::plain_log;

/// Every verb with every option that names an output, as OUT, and what it reads.
const LINES: [(&str, &[&str]); 24] = [
    ("fit log.csv --na 2 --nb 2 --report OUT", &["log.csv"]),
    ("fit log.csv --na 2 --nb 2 --html OUT", &["log.csv"]),
    ("fit --grey model.json log.csv --report OUT", &["log.csv", "model.json"]),
    ("inspect log.csv -o OUT", &["log.csv"]),
    ("inspect log.csv --html OUT", &["log.csv"]),
    ("predict model.json log.csv -o OUT", &["log.csv", "model.json"]),
    ("simulate model.json log.csv -o OUT", &["log.csv", "model.json"]),
    ("simulate model.json log.csv --draws 2 --draws-file OUT", &["log.csv", "model.json"]),
    ("validate model.json log.csv -o OUT", &["log.csv", "model.json"]),
    ("validate model.json log.csv --html OUT", &["log.csv", "model.json"]),
    ("compare model.json model.json log.csv -o OUT", &["log.csv", "model.json"]),
    ("compare model.json model.json log.csv --html OUT", &["log.csv", "model.json"]),
    ("track log.csv --na 1 --nb 1 -o OUT", &["log.csv"]),
    ("track log.csv --na 1 --nb 1 --state OUT", &["log.csv"]),
    ("track log.csv --na 1 --nb 1 --summary OUT", &["log.csv"]),
    ("track log.csv --warm model.json -o OUT", &["log.csv", "model.json"]),
    ("track log.csv --warm model.json --state OUT", &["log.csv", "model.json"]),
    ("filter model.json log.csv -o OUT", &["log.csv", "model.json"]),
    ("filter model.json log.csv -o states --summary OUT", &["log.csv", "model.json"]),
    ("filter model.json log.csv --smooth -o OUT", &["log.csv", "model.json"]),
    ("bode model.json -o OUT", &["model.json"]),
    ("step model.json -o OUT", &["model.json"]),
    ("impulse model.json -o OUT", &["model.json"]),
    ("bode model.json --frequencies 0.1..1 -o OUT", &["model.json"]),
];

fn folder() -> Folder {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder
}

#[test]
fn an_output_that_is_an_input_under_another_name_is_refused_before_anything_is_written() {
    let folder = folder();
    let before = ["log.csv", "model.json"].map(|name| folder.read(name));
    fs::create_dir(folder.path("sub")).unwrap();
    for (line, inputs) in LINES {
        for input in inputs {
            let _ = [fs::remove_file(folder.path("hard")), fs::remove_file(folder.path("soft"))];
            fs::hard_link(folder.path(input), folder.path("hard")).unwrap();
            symlink(input, folder.path("soft")).unwrap();
            let names = folder.names();
            for out in [*input, "hard", "soft", &format!("sub/../{input}")] {
                let line = line.replace("OUT", out);
                let refusal = folder.refused(&line, 2);
                assert!(refusal.contains(&format!("{input} would be replaced")), "{line}: {refusal}");
                assert_eq!(refusal.contains(&format!("{out}, which is the same file")), out != *input);
            }
            assert_eq!(folder.names(), names);
        }
    }
    assert_eq!(["log.csv", "model.json"].map(|name| folder.read(name)), before);
}

#[test]
fn an_output_that_cannot_be_written_is_told_before_anything_is_read() {
    let folder = folder();
    fs::create_dir(folder.path("folder")).unwrap();
    let names = folder.names();
    for (line, _) in LINES {
        // Whoever read the log first would say that it is not there.
        let line = line.replace("log.csv", "missing.csv").replace(" model.json", " gone.json");
        for (out, why) in
            [("nope/x", "nope/x: cannot be written: its folder is not there"), ("folder", "folder: cannot")]
        {
            folder.assert_refused(&line.replace("OUT", out), 5, why);
        }
    }
    assert_eq!(folder.names(), names);
}

#[test]
fn a_log_that_would_grow_by_what_is_printed_is_noticed() {
    let folder = folder();
    let before = folder.read("log.csv");
    for line in [
        "fit log.csv --na 2 --nb 2",
        "inspect log.csv",
        "predict model.json log.csv",
        "validate model.json log.csv",
        "track log.csv --na 1 --nb 1",
        "filter model.json log.csv",
        "filter model.json -",
        "track - --na 1 --nb 1 --format csv",
    ] {
        let mut command = folder.command(line);
        if line.split(' ').any(|word| word == "-") {
            command.stdin(File::open(folder.path("log.csv")).unwrap());
        }
        command.stdout(OpenOptions::new().append(true).open(folder.path("log.csv")).unwrap());
        let run = Run::from(command.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap());
        assert_eq!(run.code, 2, "{line}: {}", run.stderr);
        assert!(run.refusal().contains("is read, and standard output goes to it"), "{line}: {}", run.stderr);
        assert_eq!(folder.read("log.csv"), before, "{line}");
    }
    // Another file may grow.
    let mut command = folder.command("predict model.json log.csv");
    command.stdout(OpenOptions::new().append(true).create(true).open(folder.path("all.csv")).unwrap());
    assert!(command.stderr(Stdio::null()).status().unwrap().success());
    assert_eq!(folder.read("all.csv").lines().count(), 201);
}

#[test]
fn two_outputs_are_two_files() {
    let folder = folder();
    folder.write("one", "old");
    fs::hard_link(folder.path("one"), folder.path("two")).unwrap();
    for line in [
        "fit log.csv --na 2 --nb 2 --report one --html two",
        "fit log.csv --na 2 --nb 2 --report new --html ./new",
        "fit log.csv --na 2 --nb 2 --report - --html -",
        "inspect log.csv -o one --html two",
        "validate model.json log.csv -o one --html two",
        "track log.csv --na 1 --nb 1 -o one --state two",
        "track log.csv --na 1 --nb 1 -o one --summary two",
        "track log.csv --na 1 --nb 1 --state new --summary new",
        "filter model.json log.csv -o one --summary two",
        "filter model.json log.csv --summary -",
    ] {
        folder.assert_refused(line, 2, "is named for two outputs");
    }
    let mut command = folder.command("track log.csv --na 1 --nb 1 --summary one");
    command.stdout(OpenOptions::new().append(true).open(folder.path("two")).unwrap());
    let run = Run::from(command.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap());
    assert!(run.code == 2 && run.stderr.contains("standard output goes to it too"), "{}", run.stderr);
    assert_eq!((folder.read("one"), folder.names().len()), ("old".to_owned(), 4));
}

#[test]
fn links_that_go_round_in_a_circle_are_no_place_for_an_output() {
    let folder = folder();
    symlink("b", folder.path("a")).unwrap();
    symlink("a", folder.path("b")).unwrap();
    let names = folder.names();
    for (line, _) in LINES {
        let line = line.replace("OUT", "a");
        let refusal = folder.refused(&line, 5);
        assert!(
            refusal.contains("a: cannot be written: ") && refusal.contains("symbolic links"),
            "{refusal}"
        );
    }
    assert_eq!(folder.names(), names);
    assert!(fs::symlink_metadata(folder.path("a")).unwrap().is_symlink());
}
