//! `thetahat track` on pipes, ended in all ways, and taken up again.
#![cfg(unix)]

use std::fs::OpenOptions;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::harness::{Folder, HANGS, Run, number};
use crate::signals::{Experiment, Random, csv};
use crate::track::objects;

/// A run with a pipe at each end.
struct Live {
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Live {
    fn start(folder: &Folder, line: &str) -> Self {
        let mut command = folder.command(line);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        let output = child.stdout.take().expect("standard output is a pipe");
        let (sender, lines) = channel();
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Self { input: child.stdin.take(), child, lines }
    }

    fn write(&mut self, text: &str) {
        let input = self.input.as_mut().expect("the pipe is open");
        input.write_all(text.as_bytes()).and_then(|()| input.flush()).expect("the program reads");
    }

    fn line(&self) -> Value {
        let line = self.lines.recv_timeout(HANGS).expect("a line comes");
        serde_json::from_str(&line).expect("it is whole")
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).expect("the program runs");
    }

    /// The exit code, the lines that were not read yet, and standard error.
    fn end(mut self) -> (i32, Vec<String>, String) {
        let Run { code, stderr, .. } = Run::from(self.child.wait_with_output().expect("the program ends"));
        drop(self.input.take());
        (code, self.lines.iter().collect(), stderr)
    }
}

const MODEL: &str = "--na 1 --nb 1 --scale u=1 --scale y=2";

#[test]
fn a_sample_is_told_as_soon_as_it_comes() {
    let Experiment { u, y } = Experiment::new(60);
    let folder = Folder::new();
    let mut live = Live::start(&folder, &format!("track - {MODEL}"));
    live.write("u,y\n");
    for (row, (u, y)) in u.iter().zip(&y).enumerate() {
        live.write(&format!("{u},{y}\n"));
        assert_eq!(number(&live.line(), "/row"), row as f64 + 1.0);
        // A slow writer.
        thread::sleep(Duration::from_millis(3));
    }
    // A row in two pieces is told once it is whole.
    live.write("0.5,");
    assert!(live.lines.recv_timeout(Duration::from_millis(50)).is_err());
    live.write("1.5\n");
    assert_eq!(number(&live.line(), "/measured"), 1.5);
    drop(live.input.take());
    let (code, rest, stderr) = live.end();
    assert_eq!((code, rest.len()), (0, 0), "{stderr}");
    assert!(stderr.contains("61 rows"), "{stderr}");
}

#[test]
fn a_file_that_grows_is_followed_by_way_of_tail() {
    let Experiment { u, y } = Experiment::new(40);
    let folder = Folder::with_log(csv(&[("u", &u[..20]), ("y", &y[..20])]));
    let mut command = std::process::Command::new("sh");
    let inner = folder.command(&format!("track - {MODEL}"));
    // tail ends with its reader, or with the pipe it was told to watch.
    command.arg("-c").arg("tail -n +1 -s 0.05 -F log.csv 2>/dev/null | \"$0\" \"$@\"");
    command.arg(inner.get_program()).args(inner.get_args()).current_dir(folder.path(""));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().expect("the shell starts");
    let mut lines = BufReader::new(child.stdout.take().expect("it is a pipe")).lines();
    let mut next = || objects(&lines.next().expect("a line comes").expect("it can be read")).remove(0);
    for row in 1..=20 {
        assert_eq!(number(&next(), "/row"), f64::from(row));
    }
    let mut log = OpenOptions::new().append(true).open(folder.path("log.csv")).expect("the log is there");
    for (row, (u, y)) in u.iter().zip(&y).enumerate().skip(20) {
        writeln!(log, "{u},{y}").expect("the log can be written");
        assert_eq!(number(&next(), "/row"), row as f64 + 1.0);
    }
    drop(lines);
    // The program notices that nobody reads at the next row, and tail that the program is gone at the one after.
    let began = Instant::now();
    while child.try_wait().expect("the shell can be asked").is_none() {
        assert!(began.elapsed() < HANGS, "the program went on without a reader");
        writeln!(log, "0,0").expect("the log can be written");
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn signals_end_a_run_with_its_last_line_whole_and_its_state_saved() {
    for (signal, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let folder = Folder::new();
        let mut live = Live::start(&folder, &format!("track - {MODEL} --state state.json"));
        live.write("u,y\n1,2\n2,3\n3,");
        for _ in 0..2 {
            live.line();
        }
        live.signal(signal);
        let (found, rest, stderr) = live.end();
        assert_eq!((found, rest.len()), (code, 0), "{stderr}");
        assert!(stderr.contains("2 rows") && stderr.ends_with("interrupted\n"), "{stderr}");
        let state: Value = serde_json::from_str(&folder.read("state.json")).expect("it is JSON");
        assert_eq!(state["rows"], 2);
        assert_eq!(folder.names(), ["state.json"]);
    }
}

#[test]
fn a_busy_run_ends_between_two_lines() {
    let Experiment { u, y } = Experiment::new(100_000);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    for signal in [Signal::INT, Signal::TERM] {
        let mut command = folder.command(&format!("track log.csv {MODEL} --state state.json"));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        let mut output = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let mut lines = String::new();
        output.read_line(&mut lines).expect("a line comes");
        // The pipe holds a small part of what is still to come: the run is in its midst for as long as nobody reads.
        kill_process(Pid::from_child(&child), signal).expect("the program runs");
        output.read_to_string(&mut lines).expect("lines are text");
        let run = Run::from(child.wait_with_output().expect("the program ends"));
        let last = objects(lines.lines().last().expect("there are lines")).remove(0);
        let state: Value = serde_json::from_str(&folder.read("state.json")).expect("it is JSON");
        assert_eq!(number(&last, "/row"), number(&state, "/rows"), "{}", run.stderr);
        assert!(lines.ends_with('\n') && number(&state, "/rows") < 100_000.0);
        std::fs::remove_file(folder.path("state.json")).expect("it is there");
    }
}

#[test]
fn a_closed_pipe_ends_a_run_in_silence() {
    let Experiment { u, y } = Experiment::new(20_000);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let mut command = folder.command(&format!("track log.csv {MODEL} --state state.json --save-every 100"));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    let mut first = [0; 100];
    child.stdout.take().expect("it is a pipe").read_exact(&mut first).expect("there is a first line");
    let run = Run::from(child.wait_with_output().expect("the program ends"));
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
}

/// The state's rows, and the bytes of output that belong to them; nothing before the first save.
fn saved(folder: &Folder) -> (u64, u64) {
    match std::fs::read_to_string(folder.path("state.json")) {
        Ok(text) => {
            let state: Value = serde_json::from_str(&text).expect("a state is always whole");
            let count = |pointer: &str| state.pointer(pointer).and_then(Value::as_u64).expect("it is there");
            (count("/rows"), count("/written/bytes"))
        }
        Err(_) => (0, 0),
    }
}

#[test]
fn killed_at_any_moment_it_goes_on_as_if_nothing_had_happened() {
    let Experiment { u, y } = Experiment::new(30_000);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let log = folder.read("log.csv");
    let row_ends: Vec<usize> = log.match_indices('\n').map(|(end, _)| end + 1).collect();
    let options = "--na 2 --nb 2 --forgetting 0.99,0.999 --alarm 2000 --horizon 2";
    let whole = folder.done(&format!("track log.csv {options}")).stdout;
    let mut random = Random::new(2024);
    // On a file, which is cut back to the state each time, and on standard output, which is joined here.
    for out in ["-o lines.jsonl", ""] {
        let line = |log: &str| {
            format!("track {log} {options} --state state.json --save-every 700 --resume start {out}")
        };
        let (mut joined, mut moments) = (Vec::new(), Vec::new());
        for life in 0..10 {
            let (before, from) = saved(&folder);
            let mut command = folder.command(&line("-"));
            let piece = std::fs::File::create(folder.path("piece")).expect("the folder can be written to");
            let mut child =
                command.stdin(Stdio::piped()).stdout(piece).stderr(Stdio::null()).spawn().expect("it starts");
            // It gets the log from its start, some rows more than in the life before, and never its end: it cannot end
            // by itself.
            let mut input = child.stdin.take().expect("it is a pipe");
            let given = &log[..row_ends[2_900 * (life + 1) + random.below(100)]];
            thread::scope(|scope| {
                let feeder = scope.spawn(move || {
                    // It ends when the program is killed.
                    let _ = input.write_all(given.as_bytes());
                    input
                });
                // Every other one gets as far as a save.
                let began = Instant::now();
                while life % 2 == 0 && saved(&folder).0 == before {
                    assert!(began.elapsed() < HANGS, "nothing is saved: {moments:?}");
                    thread::sleep(Duration::from_millis(1));
                }
                thread::sleep(Duration::from_micros(random.below(20_000) as u64));
                assert!(child.try_wait().expect("it can be asked").is_none(), "it ended: {moments:?}");
                kill_process(Pid::from_child(&child), Signal::KILL).expect("the program runs");
                child.wait().expect("the program ends");
                drop(feeder.join());
            });
            let (rows, to) = saved(&folder);
            moments.push(rows);
            if out.is_empty() {
                let piece = std::fs::read(folder.path("piece")).expect("it is there");
                joined.extend_from_slice(&piece[..(to - from) as usize]);
            }
        }
        // Every other one; before the first there is none to compare with.
        assert!(moments.windows(2).filter(|pair| pair[0] < pair[1]).count() >= 4, "{moments:?}");
        let run = folder.done(&line("log.csv"));
        assert!(run.stderr.contains("goes on after row"), "{}", run.stderr);
        joined.extend_from_slice(run.stdout.as_bytes());
        let joined = if out.is_empty() { joined } else { folder.read("lines.jsonl").into_bytes() };
        assert!(joined == whole.as_bytes(), "{moments:?}: {} and {} bytes", joined.len(), whole.len());
        // At the end of the log there is nothing more to do, and a longer log goes on.
        let again = format!("track log.csv {options} --state state.json --save-every 700 -o -");
        assert_eq!(folder.done(&again).stdout, "");
        std::fs::remove_file(folder.path("state.json")).expect("it is there");
    }
}

#[test]
fn a_log_that_has_grown_goes_on_behind_its_last_whole_line() {
    let Experiment { u, y } = Experiment::new(400);
    let log = csv(&[("u", &u), ("y", &y)]);
    let folder = Folder::with_log(&log);
    let whole = folder.done(&format!("track log.csv {MODEL}")).stdout;
    let mut joined = String::new();
    // Cut in the middle of a line, after a line break, and at the end.
    for cut in [log.len() / 3, log.len() / 2, log[..log.len() / 2 + 40].rfind('\n').unwrap() + 1, log.len()] {
        folder.write("log.csv", &log[..cut]);
        let run = folder.done(&format!("track log.csv {MODEL} --state state.json"));
        let unfinished = !log[..cut].ends_with('\n');
        assert_eq!(run.stderr.contains("the last line has no line break yet"), unfinished, "{}", run.stderr);
        joined.push_str(&run.stdout);
    }
    assert_eq!(joined, whole);
}

#[test]
fn a_live_pipe_that_has_moved_on_leaves_a_gap() {
    let Experiment { u, y } = Experiment::new(300);
    let folder = Folder::new();
    let line = format!("track - {MODEL} --state state.json");
    folder.run_on(&line, csv(&[("u", &u[..100]), ("y", &y[..100])]));
    // From its start again: nothing is told twice.
    let again = folder.run_on(&line, csv(&[("u", &u[..110]), ("y", &y[..110])]));
    let rows: Vec<f64> = objects(&again.stdout).iter().map(|line| number(line, "/row")).collect();
    assert_eq!(rows, (101..=110).map(f64::from).collect::<Vec<_>>(), "{}", again.stderr);
    // Later on.
    let later = folder.run_on(&line, csv(&[("u", &u[150..]), ("y", &y[150..])]));
    let lines = objects(&later.stdout);
    assert_eq!((&lines[0]["event"], number(&lines[0], "/row")), (&"gap".into(), 111.0));
    assert_eq!(lines[1]["action"], "not ready");
    assert_eq!(lines[2]["action"], "updated");
    assert_eq!(lines.len(), 151);
    // Said to be later although its first row is that of the state.
    folder.run_on(&line, csv(&[("u", &u[..5]), ("y", &y[..5])]));
    let now = folder.run_on(&format!("{line} --resume now"), csv(&[("u", &u[..5]), ("y", &y[..5])]));
    assert_eq!(objects(&now.stdout)[0]["event"], "gap", "{}", now.stderr);
}

#[test]
fn with_a_clock_a_pipe_may_overlap() {
    let Experiment { u, y } = Experiment::new(300);
    let time: Vec<String> = (0..300).map(|t| format!("2026-11-22T10:{:02}:{:02}Z", t / 60, t % 60)).collect();
    let log = |from: usize, to: usize| -> String {
        (from..to).fold("t,u,y\n".to_owned(), |text, t| text + &format!("{},{},{}\n", time[t], u[t], y[t]))
    };
    let folder = Folder::new();
    let line = format!("track - --time t {MODEL}");
    let whole = folder.run_on(&line, log(0, 200)).stdout;
    let line = format!("{line} --state state.json");
    let mut joined = folder.run_on(&line, log(0, 90)).stdout;
    joined.push_str(&folder.run_on(&line, log(50, 200)).stdout);
    assert_eq!(joined, whole);
    let later = objects(&folder.run_on(&line, log(210, 220)).stdout);
    assert_eq!((&later[0]["event"], number(&later[0], "/time")), (&"gap".into(), 210.0));
    assert_eq!(later.len(), 11);
}

#[test]
fn a_state_that_does_not_fit_is_refused_in_words() {
    let Experiment { u, y } = Experiment::new(100);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    folder.done(&format!("track log.csv {MODEL} --state state.json"));
    let before = folder.read("state.json");
    let refused = |line: &str, words: &str| {
        let run = folder.run(&format!("track {line} --state state.json"));
        assert_eq!((run.code, run.stdout.as_str()), (3, ""), "{line}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{line}: '{words}' is not in: {}", run.stderr);
    };
    folder.write("other.csv", csv(&[("u", &y), ("y", &u)]));
    folder.write("short.csv", csv(&[("u", &u[..50]), ("y", &y[..50])]));
    for (log, options, words) in [
        ("log.csv", format!("{MODEL} --forgetting 0.9"), "--forgetting was 'exponential:0.99'"),
        ("log.csv", "--na 2 --nb 1".to_owned(), "the model was"),
        ("log.csv", format!("{MODEL} --every 2"), "--every was '1' and is '2' now"),
        ("other.csv", MODEL.to_owned(), "other.csv:2: this is not row 1 of the log"),
        ("short.csv", MODEL.to_owned(), "it ends before row 100"),
    ] {
        refused(&format!("{log} {options}"), words);
    }
    assert_eq!(folder.read("state.json"), before);

    for (text, expected) in [
        (
            before.replace("thetahat.track-state/1", "thetahat.track-state/2"),
            "this state is of version 'thetahat.track-state/2'",
        ),
        (before[..before.len() / 2].to_owned(), "this is no state of thetahat track"),
        (before.replace("\"trackers\":[", "\"trackers\":[],\"x\":["), "its parts do not fit together"),
        (
            before.replace("\"na\":1", "\"na\":7"),
            "this is no state of thetahat track: the orders make 8 parameters",
        ),
        (before.replace("\"factor\":0.99", "\"factor\":1.99"), "factor is out of range"),
        (
            before.replace("\"mean_squares\":[1,1,[", "\"mean_squares\":[1,1,[-"),
            "mean_squares is out of range",
        ),
        (
            before.replace("\"mean_squared_error\":", "\"mean_squared_error\":-"),
            "its parts do not fit together",
        ),
        (
            before.replace("\"version\":1", "\"version\":2"),
            "this snapshot is of version 2, and version 1 is understood",
        ),
        (before.replace("\"inputs\":[0.0]", "\"inputs\":[]"), "its parts do not fit together"),
        (before.replace("\"names\":[\"a1\",", "\"names\":["), "its parts do not fit together"),
        ("{}".to_owned(), "this is no state of thetahat track"),
        (String::new(), "this is no state of thetahat track"),
    ] {
        folder.write("state.json", &text);
        refused(&format!("log.csv {MODEL}"), expected);
        assert_eq!(folder.read("state.json"), text);
    }
    // Output that is shorter than the state says.
    std::fs::remove_file(folder.path("state.json")).expect("it is there");
    folder.done(&format!("track log.csv {MODEL} --state state.json -o lines.jsonl"));
    let lines = folder.read("lines.jsonl");
    folder.write("lines.jsonl", format!("{}x", &lines[..lines.len() - 1]));
    let run = folder.run(&format!("track log.csv {MODEL} --state state.json -o lines.jsonl"));
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("lines.jsonl: it holds something else"), "{}", run.stderr);
    folder.write("lines.jsonl", "short\n");
    let run = folder.run(&format!("track log.csv {MODEL} --state state.json -o lines.jsonl"));
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("lines.jsonl: it has 6 bytes, but the state says"), "{}", run.stderr);
    assert_eq!(folder.read("lines.jsonl"), "short\n");
}

#[test]
fn one_run_at_a_time_has_a_state_and_an_output() {
    let Experiment { u, y } = Experiment::new(50);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let line = |state: &str, out: &str| format!("track log.csv {MODEL} --state {state} -o {out}");
    let mut live =
        Live::start(&folder, &format!("track - {MODEL} --state state.json --save-every 1 -o lines.jsonl"));
    live.write("u,y\n1,2\n2,3\n");
    let began = Instant::now();
    while saved(&folder).0 < 2 {
        assert!(began.elapsed() < HANGS, "nothing is saved");
        thread::sleep(Duration::from_millis(1));
    }
    // Though it was replaced since the run began.
    let before = (folder.read("state.json"), folder.read("lines.jsonl"));
    for (state, out, name) in [
        ("state.json", "other.jsonl", "state.json"),
        ("other.json", "lines.jsonl", "lines.jsonl"),
        ("state.json", "lines.jsonl", "state.json"),
    ] {
        folder.assert_refused(&line(state, out), 5, &format!("{name}: another run is writing it"));
        assert_eq!((folder.read("state.json"), folder.read("lines.jsonl")), before);
    }
    assert_eq!(folder.names(), ["lines.jsonl", "log.csv", "state.json"]);
    // In whatever way a run ends, the next one has both.
    live.signal(Signal::KILL);
    live.end();
    folder.done(&format!("track log.csv {MODEL} --state state.json -o lines.jsonl --resume now"));
    assert!(folder.read("lines.jsonl").starts_with(&before.1));
}

#[test]
fn a_state_whose_numbers_were_edited_is_refused() {
    let Experiment { u, y } = Experiment::new(100);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let line = format!("track log.csv {MODEL} --state state.json");
    folder.done(&line);
    let whole: Value = serde_json::from_str(&folder.read("state.json")).expect("it is JSON");
    for (place, value) in [
        ("/rows", 0.into()),
        ("/written/lines", u64::MAX.into()),
        ("/written/bytes", 1.into()),
        ("/first", Value::Array(Vec::new())),
        ("/last/1", "x".into()),
        ("/pace/sample_time", (-1).into()),
        ("/gaps", 101.into()),
        ("/alarms/0", 1000.into()),
        ("/trackers/0/score/mean_squared_error", (-1.0).into()),
        ("/trackers/0/score/output_variance", (-1.0).into()),
        ("/trackers/0/score/mean_nis", (-1.0).into()),
        ("/trackers/0/score/samples", 101.into()),
        ("/trackers/0/score/evaluated", 1000.into()),
        ("/trackers/0/scales/output", (-2.0).into()),
        ("/trackers/0/settling", 1000.into()),
        ("/trackers/0/has_estimate", false.into()),
    ] {
        let mut edited = whole.clone();
        *edited.pointer_mut(place).unwrap_or_else(|| panic!("{place}: {whole:#}")) = value;
        folder.write("state.json", edited.to_string());
        let refusal = folder.refused(&line, 3);
        assert!(refusal.contains("state.json: "), "{place}: {refusal}");
        assert_eq!(folder.read("state.json"), edited.to_string());
    }
}
