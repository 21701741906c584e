//! What is written: whole files or none, and streams that may end early.

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::harness::{Folder, Run};
use crate::signals::{Experiment, plain_log};

const FIT: &str = "fit log.csv --na 2 --nb 2";

#[test]
fn the_report_on_standard_output_is_alone_there() {
    let folder = Folder::with_log(plain_log());
    folder.done(&format!("{FIT} --report model.json"));
    for options in
        ["--report -", "--format json", "--report - --format json", "--format json --report other.json"]
    {
        let run = folder.done(&format!("{FIT} {options}"));
        assert_eq!(run.stdout, folder.read("model.json"), "{options}");
        assert_eq!(run.stderr, "", "{options}");
    }
    assert_eq!(folder.read("other.json"), folder.read("model.json"));
    assert!(serde_json::from_str::<Value>(&folder.read("model.json")).unwrap().is_object());
}

#[test]
fn warnings_do_not_mix_with_the_report() {
    let folder = Folder::with_log(plain_log());
    let run = folder.done(&format!("{FIT} --validate 1..50 --report -"));
    assert!(serde_json::from_str::<Value>(&run.stdout).unwrap().is_object());
    assert!(run.stderr.starts_with("warning: "), "{}", run.stderr);
}

#[test]
fn an_existing_report_is_replaced_in_one_move() {
    let folder = Folder::with_log(plain_log());
    folder.write("model.json", "old");
    // A second name for the old file still shows the old content, so the new one is another file.
    fs::hard_link(folder.path("model.json"), folder.path("witness")).unwrap();
    folder.done(&format!("{FIT} --report model.json"));
    assert_eq!(folder.read("witness"), "old");
    assert!(folder.read("model.json").starts_with('{'));
    assert_eq!(folder.names(), ["log.csv", "model.json", "witness"]);
}

#[test]
fn a_report_to_a_folder_that_is_not_there_leaves_nothing_behind() {
    let folder = Folder::with_log(plain_log());
    let line = folder.refused(&format!("{FIT} --report nowhere/model.json"), 5);
    assert!(line.contains("nowhere/model.json: "), "{line}");
    // What the program calls its own file is nobody's business.
    assert!(!line.contains(".thetahat-"), "{line}");
    assert_eq!(folder.names(), ["log.csv"]);
    folder.done(&format!("{FIT} --report model.json"));
    folder.refused("predict model.json log.csv -o nowhere/predicted.csv", 5);
    assert_eq!(folder.names(), ["log.csv", "model.json"]);
}

#[test]
fn a_report_to_a_folder_is_refused() {
    let folder = Folder::with_log(plain_log());
    fs::create_dir(folder.path("models")).unwrap();
    let line = folder.refused(&format!("{FIT} --report models"), 5);
    assert!(line.contains("models: ") && line.contains("directory"), "{line}");
}

#[cfg(unix)]
mod unix {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
    use std::path::Path;

    use super::*;

    fn mode(folder: &Folder, name: &str) -> u32 {
        fs::metadata(folder.path(name)).expect("the file is there").permissions().mode() & 0o7777
    }

    #[test]
    fn an_existing_report_keeps_its_permissions() {
        let folder = Folder::with_log(plain_log());
        for permissions in [0o600, 0o640, 0o644, 0o664, 0o666, 0o755] {
            folder.write("model.json", "old");
            fs::set_permissions(folder.path("model.json"), fs::Permissions::from_mode(permissions)).unwrap();
            folder.done(&format!("{FIT} --report model.json"));
            let now = mode(&folder, "model.json");
            assert_eq!(now, permissions, "{now:o} instead of {permissions:o}");
            assert!(folder.read("model.json").starts_with('{'));
        }
    }

    #[test]
    fn a_new_report_may_be_used_like_any_new_file() {
        let folder = Folder::with_log(plain_log());
        folder.done(&format!("{FIT} --report model.json"));
        assert_eq!(mode(&folder, "model.json"), mode(&folder, "log.csv"));
    }

    #[test]
    fn a_link_is_followed() {
        let folder = Folder::with_log(plain_log());
        fs::create_dir(folder.path("models")).unwrap();
        folder.write("models/model.json", "old");
        symlink("models/model.json", folder.path("latest.json")).unwrap();
        folder.done(&format!("{FIT} --report latest.json"));
        assert_eq!(fs::read_link(folder.path("latest.json")).unwrap(), Path::new("models/model.json"));
        assert!(folder.read("models/model.json").starts_with('{'));
        assert!(fs::symlink_metadata(folder.path("models/model.json")).unwrap().is_file());
    }

    #[test]
    fn a_link_to_a_file_that_is_not_there_yet_is_followed() {
        let folder = Folder::with_log(plain_log());
        fs::create_dir(folder.path("models")).unwrap();
        symlink("models/model.json", folder.path("latest.json")).unwrap();
        folder.done(&format!("{FIT} --report latest.json"));
        assert_eq!(fs::read_link(folder.path("latest.json")).unwrap(), Path::new("models/model.json"));
        assert!(folder.read("models/model.json").starts_with('{'));
    }

    #[test]
    fn what_a_killed_run_left_is_swept_and_what_a_live_one_writes_is_not() {
        let folder = Folder::with_log(plain_log());
        folder.done(&format!("{FIT} --report model.json"));
        for line in [
            format!("{FIT} --report model.json"),
            "predict model.json log.csv -o predicted.csv".to_owned(),
            "track log.csv --na 1 --nb 1 --state state.json -o lines.jsonl".to_owned(),
        ] {
            folder.write(".thetahat-abcdefABCDEF.tmp", "left");
            folder.write(".thetahat-0123456789ab.tmp", "live");
            folder.write(".thetahat-config", "mine");
            let live = File::open(folder.path(".thetahat-0123456789ab.tmp")).unwrap();
            live.lock().unwrap();
            folder.done(&line);
            let hidden: Vec<String> =
                folder.names().into_iter().filter(|name| name.starts_with('.')).collect();
            assert_eq!(hidden, [".thetahat-0123456789ab.tmp", ".thetahat-config"], "{line}");
        }
    }

    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        let folder = Folder::with_log(plain_log());
        folder.done(&format!("{FIT} --report /dev/null"));
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }

    #[test]
    fn a_named_pipe_is_written_to_and_not_replaced() {
        let folder = Folder::with_log(plain_log());
        assert!(Command::new("mkfifo").arg(folder.path("pipe")).status().unwrap().success());
        let path = folder.path("pipe");
        let reader = std::thread::spawn(move || fs::read_to_string(path));
        folder.done(&format!("{FIT} --report pipe"));
        assert!(reader.join().unwrap().unwrap().starts_with('{'));
        assert!(fs::metadata(folder.path("pipe")).unwrap().file_type().is_fifo());
    }

    #[test]
    fn a_full_disk_or_a_crash_leaves_the_old_file() {
        let folder = Folder::with_log(plain_log());
        folder.done(&format!("{FIT} --report model.json"));
        folder.write("old", "old");
        let limited = |preparation: &str, line: &str| {
            // Files may have one block only; beyond it writing fails, or kills.
            let script = format!("{preparation} ulimit -f 1; exec \"$0\" \"$@\"");
            let inner = folder.command(line);
            let mut command = Command::new("sh");
            command.arg("-c").arg(script).arg(inner.get_program()).args(inner.get_args());
            command.current_dir(folder.path(""));
            Run::of(command)
        };
        for line in [format!("{FIT} --report old"), "predict model.json log.csv -o old".to_owned()] {
            let run = limited("trap '' XFSZ;", &line);
            assert_eq!(run.code, 5, "{line}: {}", run.stderr);
            assert!(run.refusal().contains("old: cannot be written"), "{line}: {}", run.stderr);
            assert_eq!(folder.read("old"), "old");
            assert_eq!(folder.names(), ["log.csv", "model.json", "old"]);
        }
        assert_eq!(limited("", &format!("{FIT} --report old")).code, -1);
        assert_eq!(folder.read("old"), "old");
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use super::*;

    fn full() -> File {
        File::options().write(true).open("/dev/full").expect("Linux has a full device")
    }

    #[test]
    fn what_cannot_be_written_is_exit_code_5() {
        let folder = Folder::with_log(plain_log());
        let line = folder.refused(&format!("{FIT} --report /dev/full"), 5);
        assert!(line.contains("/dev/full: ") && line.contains("No space left"), "{line}");
        folder.done(&format!("{FIT} --report model.json"));
        for line in [FIT, "predict model.json log.csv", "schema", "man", "completions bash"] {
            let mut command = folder.command(line);
            command.stdout(full());
            let run = Run::from(command.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap());
            assert_eq!(run.code, 5, "thetahat {line}: {}", run.stderr);
            assert!(run.refusal().contains("standard output"), "thetahat {line}: {}", run.stderr);
        }
    }

    /// Three are open, and what listens for signals has two before the log is read.
    #[test]
    fn too_many_open_files_are_told_as_such() {
        let folder = Folder::with_log(plain_log());
        let inner = folder.command(&format!("{FIT} --report model.json"));
        let mut command = Command::new("sh");
        command.arg("-c").arg("ulimit -n 5; exec \"$0\" \"$@\"").arg(inner.get_program());
        command.args(inner.get_args()).current_dir(folder.path(""));
        let run = Run::of(command);
        assert_eq!(run.code, 5, "{}", run.stderr);
        assert!(run.refusal().contains("Too many open files"), "{}", run.stderr);
        assert!(run.refusal().ends_with("raise the limit of open files (`ulimit -n`)"), "{}", run.stderr);
        assert_eq!(folder.names(), ["log.csv"]);
    }

    #[test]
    fn what_cannot_be_said_changes_no_exit_code() {
        let folder = Folder::with_log(plain_log());
        folder.write("bad.csv", "u,y\n1,oops\n");
        folder.done(&format!("{FIT} --report model.json"));
        for (line, code) in [
            ("fit bad.csv --na 2 --nb 2", 3),
            ("fit bad.csv --na 2", 2),
            ("fit log.csv --na 2 --nb 2 --validate 1..50", 0),
            ("predict model.json log.csv", 0),
        ] {
            let mut command = folder.command(line);
            command.stdout(Stdio::null()).stderr(full());
            assert_eq!(command.status().unwrap().code(), Some(code), "thetahat {line}");
        }
    }
}

#[test]
fn a_reader_that_had_enough_is_no_error() {
    // More than a pipe holds.
    let folder = Folder::with_log(Experiment::new(5000).csv());
    folder.done(&format!("{FIT} --report model.json"));
    let mut child = folder
        .command("predict model.json log.csv")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
    assert_eq!(first, "row,measured,predicted,standard_deviation\n");
    let run = Run::from(child.wait_with_output().unwrap());
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
}

#[test]
fn a_reader_that_is_gone_is_no_error() {
    let folder = Folder::with_log(plain_log());
    folder.done(&format!("{FIT} --report model.json"));
    for line in [
        FIT,
        "fit log.csv --na 2 --nb 2 --report -",
        "predict model.json log.csv",
        "simulate model.json log.csv",
        "demo",
        "schema",
        "man",
        "completions bash",
        "--help",
    ] {
        let mut child = folder.command(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let run = Run::from(child.wait_with_output().unwrap());
        assert_eq!((run.code, run.stderr.as_str()), (0, ""), "thetahat {line}");

        // Nor if nobody reads the messages.
        let mut child = folder.command(line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stderr.take());
        assert_eq!(child.wait().unwrap().code(), Some(0), "thetahat {line}");
    }
}
