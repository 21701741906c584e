//! Colours and progress: on a terminal, and nowhere else.

use crate::harness::{Folder, Run};

const BAD: &str = "fit nowhere.csv --na 2 --nb 2";

#[test]
fn there_are_no_colours_in_a_pipe() {
    let folder = Folder::new();
    for line in [BAD, "fit", "--help", "fit --help", "demo"] {
        let run = folder.run(line);
        assert!(!run.stdout.contains('\u{1b}') && !run.stderr.contains('\u{1b}'), "{line}");
    }
}

#[test]
fn colours_can_be_asked_for_in_a_pipe() {
    let folder = Folder::new();
    let mut command = folder.command(BAD);
    command.env("CLICOLOR_FORCE", "1");
    let run = Run::of(command);
    assert!(run.stderr.starts_with('\u{1b}') && run.stderr.contains("error:"), "{:?}", run.stderr);
}

#[cfg(unix)]
mod unix {
    use std::io::Write;
    use std::process::{Child, Command, Stdio};
    use std::time::Duration;

    use super::*;
    use crate::pseudo_terminal::Terminal;
    use crate::signals::Experiment;

    /// Runs the program with standard error on a terminal, and gives what that shows.
    fn on_terminal(command: Command, feed: impl FnOnce(&mut Child)) -> String {
        let mut terminal = Terminal::start(command);
        feed(&mut terminal.child);
        terminal.end().stderr
    }

    #[test]
    fn an_error_is_coloured_on_a_terminal() {
        let folder = Folder::new();
        let shown = on_terminal(folder.command(BAD), |_| {});
        assert!(shown.starts_with('\u{1b}') && shown.contains("error:"), "{shown:?}");
    }

    #[test]
    fn a_terminal_without_colours_is_respected() {
        let folder = Folder::new();
        let mut command = folder.command(BAD);
        command.env("NO_COLOR", "1");
        let shown = on_terminal(command, |_| {});
        assert!(shown.starts_with("error:") && !shown.contains('\u{1b}'), "{shown:?}");
    }

    #[test]
    fn messages_are_wrapped_at_the_width_of_the_terminal() {
        let folder = Folder::with_log("a,b,y\n1,2,3\n");
        let mut command = folder.command("fit log.csv --na 2 --nb 2");
        command.env("NO_COLOR", "1");
        let shown = on_terminal(command, |_| {});
        assert!(shown.starts_with("error: log.csv: no column is called u"), "{shown:?}");
        assert!(shown.contains("\r\n  "), "{shown:?}");
        assert!(shown.lines().all(|line| line.trim_end().chars().count() <= 80), "{shown:?}");
        assert_eq!(
            folder.run("fit log.csv --na 2 --nb 2").stderr,
            shown.replace("\r\n  ", " ").replace('\r', "")
        );
    }

    /// A log in two pieces of more than two mebibytes, the second of which comes more than a second later.
    fn slowly(child: &mut Child) {
        let mut into = child.stdin.take().expect("standard input is a pipe");
        let log = Experiment::new(1000).csv();
        let piece = log.split_once('\n').map_or("", |(_, rows)| rows).repeat(80);
        let mut write = |text: &str| into.write_all(text.as_bytes()).expect("the program reads on");
        write("u,y\n");
        write(&piece);
        std::thread::sleep(Duration::from_millis(1200));
        write(&piece);
    }

    #[test]
    fn a_log_that_takes_a_second_shows_its_progress_on_a_terminal_only() {
        let folder = Folder::new();
        let line = "fit - --na 1 --nb 1";
        let shown = on_terminal(folder.command(line), slowly);
        assert!(shown.contains("reading"), "{shown:?}");

        let mut child = folder.command(line);
        let mut child =
            child.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        slowly(&mut child);
        assert_eq!(Run::from(child.wait_with_output().unwrap()).stderr, "");
    }

    #[test]
    fn a_search_that_takes_a_second_shows_its_progress_on_a_terminal_only() {
        let folder = Folder::with_log(Experiment::new(200).csv());
        let line = "fit log.csv --model oe --nb 2 --nf 2 --search gradient --step 1e-6 --max-iterations 1000000 \
                    --tolerance 1e-300 --time-limit 2";
        let shown = on_terminal(folder.command(line), |_| {});
        assert!(
            shown.contains("searching") && shown.contains("iteration") && shown.contains("cost"),
            "{shown:?}"
        );
        // The bar is cleared before anything is said.
        let last = shown.rfind("searching").unwrap_or_default();
        assert!(shown[last..].contains("\u{1b}[2K") && shown[last..].contains("warning:"), "{shown:?}");

        let run = folder.run(line);
        assert!(!run.stderr.contains("searching"), "{}", run.stderr);
    }

    #[test]
    fn ctrl_c_clears_the_bar_and_leaves_one_line() {
        let folder = Folder::with_log(Experiment::new(200).csv());
        let line = "fit log.csv --model oe --nb 2 --nf 2 --search gradient --step 1e-6 --max-iterations 1000000 \
                    --tolerance 1e-300 --report model.json";
        let mut terminal = Terminal::start(folder.command(line));
        terminal.wait_for("searching");
        terminal.press_control_c();
        let shown = terminal.end().stderr;
        let last = shown.rfind("searching").expect("the bar was drawn");
        assert!(shown[last..].contains("\u{1b}[2K"), "{shown:?}");
        assert!(shown.ends_with("interrupted; nothing was written\r\n"), "{shown:?}");
        assert_eq!(folder.names(), ["log.csv"]);
    }
}
