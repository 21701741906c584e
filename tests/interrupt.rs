//! Ctrl-C: exit code 130, and no file is left half written.
#![cfg(unix)]

use std::io::{Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::harness::{Folder, HANGS, Run};
use crate::pseudo_terminal::Terminal;
use crate::signals::{Experiment, csv, plain_log};

/// A search that goes on for minutes.
const ENDLESS: &str = "--model bj --nb 2 --nc 2 --nd 2 --nf 2 --search gradient --step 1e-3 --max-iterations 1000000 \
                       --tolerance 1e-300";
const NOTHING: &str = "interrupted; nothing was written\n";

fn started(mut command: Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

fn press(child: &Child) {
    kill_process(Pid::from_child(child), Signal::INT).expect("the program runs");
}

fn ended(child: Child) -> Run {
    Run::from(child.wait_with_output().expect("the program ends"))
}

/// Starts the program on a terminal, which shows when it is in its search, and presses Ctrl-C then.
fn pressed_in_its_search(command: Command) -> Run {
    let mut terminal = Terminal::start(command);
    terminal.wait_for("searching");
    terminal.press_control_c();
    terminal.end()
}

#[test]
fn a_search_ends_without_a_report() {
    let folder = Folder::with_log(plain_log());
    folder.write("old.json", "old");
    for report in ["new.json", "old.json", "-"] {
        let run = pressed_in_its_search(folder.command(&format!("fit log.csv {ENDLESS} --report {report}")));
        assert_eq!((run.code, run.stdout.as_str()), (130, ""));
        assert!(run.stderr.ends_with("interrupted; nothing was written\r\n"), "{:?}", run.stderr);
        assert_eq!(folder.names(), ["log.csv", "old.json"]);
        assert_eq!(folder.read("old.json"), "old");
    }
}

#[test]
fn searches_from_many_starts_end_together() {
    let folder = Folder::with_log(plain_log());
    let run = pressed_in_its_search(folder.command(&format!("fit log.csv {ENDLESS} --starts 8")));
    assert_eq!(run.code, 130);
    assert!(run.stderr.ends_with("interrupted; nothing was written\r\n"), "{:?}", run.stderr);
}

#[test]
fn reading_ends_at_once() {
    let folder = Folder::new();
    let mut command = folder.command("fit - --na 2 --nb 2 --report model.json");
    command.stdin(Stdio::piped());
    let mut child = started(command);
    let mut input = child.stdin.take().expect("standard input is a pipe");
    // More than a pipe holds: the program is reading once it is written.
    let rows = "1,2\n".repeat(1 << 19);
    input.write_all(b"u,y\n").and_then(|()| input.write_all(rows.as_bytes())).expect("the program reads");
    press(&child);
    let run = ended(child);
    assert_eq!((run.code, run.stderr.as_str()), (130, NOTHING));
    assert!(folder.names().is_empty());
    drop(input);
}

#[test]
fn a_file_that_is_being_written_goes() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder.write("old.csv", "old");
    // log.csv, long.csv, model.json and old.csv; then the passing file.
    let others = |folder: &Folder| folder.names().iter().filter(|name| *name != "new.csv").count();
    for out in ["new.csv", "old.csv"] {
        let mut rows = 100_000;
        let run = loop {
            let Experiment { u, y } = Experiment::new(rows);
            folder.write("long.csv", csv(&[("u", &u), ("y", &y)]));
            let mut child = started(folder.command(&format!("predict model.json long.csv -o {out}")));
            let began = Instant::now();
            while others(&folder) == 4 && child.try_wait().expect("it can be asked").is_none() {
                assert!(began.elapsed() < HANGS, "nothing is written");
                std::thread::sleep(Duration::from_millis(1));
            }
            press(&child);
            let run = ended(child);
            if run.code != 0 {
                break run;
            }
            // A machine that held this test up has let the program come to its end: there is more to write next time.
            rows *= 2;
            assert!(rows < 2_000_000, "it cannot be interrupted");
            let _ = std::fs::remove_file(folder.path("new.csv"));
            folder.write("old.csv", "old");
        };
        assert_eq!((run.code, run.stderr.as_str()), (130, NOTHING));
        assert_eq!(folder.names(), ["log.csv", "long.csv", "model.json", "old.csv"]);
        assert_eq!(folder.read("old.csv"), "old");
    }
}

#[test]
fn what_goes_to_standard_output_may_be_cut_and_the_line_does_not_deny_it() {
    let folder = Folder::with_log(Experiment::new(20_000).csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    // More than a pipe holds, so that it waits for a reader.
    let mut child = started(folder.command("predict model.json log.csv"));
    let mut first = [0; 10];
    child.stdout.as_mut().expect("it is a pipe").read_exact(&mut first).expect("there is a first line");
    press(&child);
    let run = ended(child);
    assert_eq!((run.code, run.stderr.as_str()), (130, "interrupted\n"));
}

/// A log of a walk in two dimensions, and its model.
fn walk(rows: usize) -> Folder {
    let Experiment { u, y } = Experiment::new(rows);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.write(
        "walk.toml",
        "sample_time = 1\noutputs = ['y', 'u']\nF = [[1, 1], [0, 1]]\nH = [[1, 0], [0, 1]]\nQ = [[1, 0], [0, 1]]\n\
         R = [[1, 0], [0, 1]]\nP0 = [[1, 0], [0, 1]]\n",
    );
    folder
}

#[test]
fn smoothing_ends_while_it_writes() {
    let folder = walk(5000);
    // More than a pipe holds, so that it waits for a reader.
    let mut child = started(folder.command("filter walk.toml log.csv --smooth"));
    let mut first = [0; 10];
    child.stdout.as_mut().expect("it is a pipe").read_exact(&mut first).expect("there is a first line");
    press(&child);
    // Whoever is slow to hear of it has written one buffer more.
    std::thread::sleep(Duration::from_millis(200));
    let run = ended(child);
    assert_eq!(run.code, 130, "{}", run.stderr);
    assert!(run.stderr.ends_with("interrupted\n") && run.stdout.ends_with("}\n"), "{}", run.stderr);
    assert!(run.stdout.lines().count() < 4000, "{}", run.stdout.lines().count());
}

/// Starts to smooth what comes through a pipe, and writes rows to it: more than a pipe holds, so that the program is
/// reading once they are written.
fn smoothing(folder: &Folder, out: &str, rows: usize) -> (Child, ChildStdin) {
    let mut command = folder.command(&format!("filter walk.toml - --smooth{out}"));
    command.stdin(Stdio::piped());
    let mut child = started(command);
    let mut input = child.stdin.take().expect("standard input is a pipe");
    let rows = "1,2\n".repeat(rows);
    input.write_all(b"u,y\n").and_then(|()| input.write_all(rows.as_bytes())).expect("the program reads");
    (child, input)
}

#[test]
fn smoothing_ends_before_it_writes() {
    let folder = walk(10);
    // On a machine that is fast, or that held this test up, the program comes to its end: there is more to smooth next
    // time.
    let mut rows = 40_000;
    let run = loop {
        let (child, input) = smoothing(&folder, " -o lines.jsonl", rows);
        drop(input);
        std::thread::sleep(Duration::from_millis(200));
        press(&child);
        let run = ended(child);
        if run.code != 0 {
            break run;
        }
        rows *= 2;
        assert!(rows < 2_000_000, "it cannot be interrupted");
    };
    assert_eq!(run.code, 130, "{}", run.stderr);
    assert!(folder.read("lines.jsonl").lines().count() < rows);
}

#[test]
fn a_log_that_has_not_ended_is_not_smoothed() {
    let folder = walk(10);
    let (child, input) = smoothing(&folder, "", 1 << 17);
    press(&child);
    let run = ended(child);
    assert_eq!((run.code, run.stdout.as_str()), (130, ""), "{}", run.stderr);
    assert!(run.stderr.ends_with(NOTHING), "{}", run.stderr);
    drop(input);
}

#[test]
fn a_job_that_ignores_interrupts_goes_on() {
    let folder = Folder::with_log(plain_log());
    let inner = folder.command(
        "fit log.csv --model bj --nb 2 --nc 2 --nd 2 --nf 2 --search gradient --step 1e-3 --max-iterations 1000000 \
         --tolerance 1e-300 --time-limit 2",
    );
    let mut command = Command::new("sh");
    command.arg("-c").arg("trap '' INT; exec \"$0\" \"$@\"").arg(inner.get_program()).args(inner.get_args());
    command.current_dir(folder.path(""));
    assert_eq!(pressed_in_its_search(command).code, 0);
}

#[test]
fn a_run_over_many_logs_goes_on_after_it_was_interrupted() {
    let folder = Folder::new();
    let names: Vec<String> = (0..5).map(|index| format!("{index}.csv")).collect();
    names[..4].iter().for_each(|name| folder.write(name, "u,y\n1,2\n"));
    folder.write(&names[4], plain_log());
    let line =
        format!("fit --each {} {ENDLESS} --threads 1 --table fleet.csv --reports out", names.join(" "));
    let child = started(folder.command(&line));
    let journal = || folder.read("out/journal.jsonl").lines().count();
    let began = Instant::now();
    while journal() < 4 && began.elapsed() < HANGS {
        std::thread::sleep(Duration::from_millis(10));
    }
    // The next log is in its search, or about to be.
    press(&child);
    let run = ended(child);
    assert_eq!((run.code, run.stdout.as_str()), (130, ""), "{}", run.stderr);
    assert!(!folder.names().contains(&"fleet.csv".to_owned()));
    folder.write(&names[4], "u,y\n1,2\n");
    let run = folder.run(&line);
    assert!(run.stdout.contains("5 rows, 0 of them without a failure; 4 as in an earlier run"), "{run:?}");
}

/// Nobody writes to the pipe: the run waits for its first byte until it is told to end.
#[test]
fn one_signal_ends_many_logs_whatever_they_wait_for() {
    let folder = Folder::with_log(plain_log());
    let made = Command::new("mkfifo").arg(folder.path("pipe")).status().expect("it is there");
    assert!(made.success());
    let line = "fit --each log.csv pipe --na 1 --nb 1 --table t.csv --reports out --threads 1";
    let child = started(folder.command(line));
    let begun = Instant::now();
    while !folder.path("out/log.json").exists() {
        assert!(begun.elapsed() < HANGS);
        std::thread::sleep(Duration::from_millis(20));
    }
    kill_process(Pid::from_child(&child), Signal::TERM).expect("the program runs");
    let run = ended(child);
    assert_eq!((run.code, run.stdout.as_str()), (143, ""));
    assert!(run.stderr.ends_with("interrupted\n"), "{}", run.stderr);
    assert!(!folder.path("t.csv").exists());
}
