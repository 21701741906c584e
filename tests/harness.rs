//! Runs the binary in a folder of its own, and reads what it says.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

/// So long a test waits for something that has to happen before it takes it for lost. Nothing else depends on the
/// clock: a loaded machine is slow, not wrong.
pub(crate) const HANGS: Duration = Duration::from_secs(120);

/// A temporary folder in which the program runs.
pub(crate) struct Folder(TempDir);

/// What a run left behind.
#[derive(Debug)]
pub(crate) struct Run {
    /// The exit code; -1 after a signal.
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Folder {
    pub(crate) fn new() -> Self {
        #[cfg(unix)]
        handle_signals();
        Self(TempDir::new().expect("there is a place for temporary folders"))
    }

    /// A folder with a log in it, called log.csv.
    pub(crate) fn with_log(log: impl AsRef<[u8]>) -> Self {
        let folder = Self::new();
        folder.write("log.csv", log);
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("the folder can be written to");
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| format!("{name}: {error}"))
    }

    /// The names of all that is in the folder, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("the folder is there");
        let name = |entry: std::io::Result<fs::DirEntry>| {
            entry.expect("the folder can be listed").file_name().to_string_lossy().into_owned()
        };
        let mut names: Vec<String> = entries.map(name).collect();
        names.sort();
        names
    }

    /// The program with the words of a line, run in this folder.
    pub(crate) fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_thetahat"));
        command.current_dir(self.0.path()).args(words(line)).stdin(Stdio::null());
        for variable in ["CLICOLOR", "CLICOLOR_FORCE", "NO_COLOR", "RAYON_NUM_THREADS", "RUST_BACKTRACE"] {
            command.env_remove(variable);
        }
        command
    }

    pub(crate) fn run(&self, line: &str) -> Run {
        Run::of(self.command(line))
    }

    /// Runs the program with something on its standard input.
    pub(crate) fn run_on(&self, line: &str, input: impl AsRef<[u8]> + Send) -> Run {
        let mut command = self.command(line);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        let mut stdin = child.stdin.take().expect("standard input is a pipe");
        std::thread::scope(|scope| {
            // A program that refuses its input may not read all of it.
            scope.spawn(move || stdin.write_all(input.as_ref()));
            Run::from(child.wait_with_output().expect("the program ends"))
        })
    }

    /// Runs the program, which must do what was asked.
    pub(crate) fn done(&self, line: &str) -> Run {
        let run = self.run(line);
        assert_eq!(run.code, 0, "thetahat {line}: {}", run.stderr);
        run
    }

    /// Runs `thetahat fit` and gives its report without its plan, which may say the same in other words: what was
    /// found.
    pub(crate) fn fit(&self, line: &str) -> Value {
        let mut report = self.planned(line);
        report.as_object_mut().and_then(|report| report.remove("plan")).expect("a plan");
        report
    }

    /// Runs `thetahat fit` and gives its report.
    pub(crate) fn planned(&self, line: &str) -> Value {
        let run = self.done(&format!("fit {line} --format json"));
        serde_json::from_str(&run.stdout).expect("the report is JSON")
    }

    /// Runs the program, which must refuse with this exit code and one line, and gives the line.
    pub(crate) fn refused(&self, line: &str, code: i32) -> String {
        let run = self.run(line);
        assert_eq!(run.code, code, "thetahat {line}: {}", run.stderr);
        run.refusal()
    }

    /// Runs the program, which must refuse with this exit code and one line that has these words.
    #[track_caller]
    pub(crate) fn assert_refused(&self, line: &str, code: i32, words: &str) {
        let said = self.refused(line, code);
        assert!(said.contains(words), "thetahat {line}: '{words}' is not in: {said}");
    }
}

/// Gives all that this process starts the default signals, whatever it was started with itself: a script has its jobs
/// in the background ignore SIGINT, and what is ignored stays so in a new program. What is handled does not (POSIX,
/// `execve`), so this process handles them, as the default would.
#[cfg(unix)]
fn handle_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ};
    use signal_hook::flag::register_conditional_default;
    use std::sync::{Arc, Once, atomic::AtomicBool};
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for signal in [SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ] {
            register_conditional_default(signal, Arc::new(AtomicBool::new(true)))
                .expect("a signal can be handled");
        }
    });
}

impl Run {
    pub(crate) fn of(mut command: Command) -> Self {
        Self::from(command.output().expect("the program starts"))
    }

    /// The one line on standard error, with nothing on standard output.
    pub(crate) fn refusal(&self) -> String {
        assert_eq!(self.stdout, "", "{}", self.stderr);
        let lines: Vec<&str> = self.stderr.lines().collect();
        assert!(matches!(lines[..], [line] if line.starts_with("error: ")), "{}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        lines.concat()
    }
}

impl From<std::process::Output> for Run {
    fn from(output: std::process::Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

/// The words of a command line; what stands between single quotes is one.
fn words(line: &str) -> Vec<&str> {
    let parts = line.split('\'').enumerate();
    parts
        .flat_map(
            |(position, part)| {
                if position % 2 == 1 { vec![part] } else { part.split_whitespace().collect() }
            },
        )
        .collect()
}

/// What predict and simulate write: one entry for each row.
pub(crate) struct Answer {
    /// Time or row.
    pub(crate) time: Vec<f64>,
    pub(crate) measured: Vec<Option<f64>>,
    pub(crate) predicted: Vec<Option<f64>>,
    /// What simulate does not write is empty.
    pub(crate) deviation: Vec<Option<f64>>,
}

impl Answer {
    /// Reads the CSV.
    pub(crate) fn read(csv: &str) -> Self {
        let mut answer =
            Self { time: Vec::new(), measured: Vec::new(), predicted: Vec::new(), deviation: Vec::new() };
        for row in csv::Reader::from_reader(csv.as_bytes()).deserialize() {
            let row: Vec<Option<f64>> = row.expect("columns of numbers");
            answer.time.push(row[0].expect("every row has a time or a number"));
            answer.measured.push(row[1]);
            answer.predicted.push(row[2]);
            answer.deviation.push(row.get(3).copied().flatten());
        }
        answer
    }

    /// Measured and predicted, where there are both.
    fn pairs(&self) -> Vec<(f64, f64)> {
        self.measured.iter().zip(&self.predicted).filter_map(|(y, x)| (*y).zip(*x)).collect()
    }

    /// How many rows count.
    pub(crate) fn samples(&self) -> usize {
        self.pairs().len()
    }

    /// Root mean square error.
    pub(crate) fn rmse(&self) -> f64 {
        let pairs = self.pairs();
        (pairs.iter().map(|(y, x)| (y - x).powi(2)).sum::<f64>() / pairs.len() as f64).sqrt()
    }

    /// The mean and the largest |y - y^|.
    pub(crate) fn absolute_errors(&self) -> (f64, f64) {
        let errors: Vec<f64> = self.pairs().iter().map(|(y, x)| (y - x).abs()).collect();
        (errors.iter().sum::<f64>() / errors.len() as f64, errors.iter().copied().fold(0.0, f64::max))
    }

    /// 100 (1 - |y - y^| / |y - mean(y)|).
    pub(crate) fn percent(&self) -> f64 {
        let pairs = self.pairs();
        let n = pairs.len() as f64;
        let mean = pairs.iter().map(|(y, _)| y).sum::<f64>() / n;
        let spread = (pairs.iter().map(|(y, _)| (y - mean).powi(2)).sum::<f64>() / n).sqrt();
        100.0 * (1.0 - self.rmse() / spread)
    }
}

/// The number at a place of a JSON document.
pub(crate) fn number(document: &Value, pointer: &str) -> f64 {
    document.pointer(pointer).and_then(Value::as_f64).unwrap_or(f64::NAN)
}

/// The numbers of a JSON array.
pub(crate) fn numbers(array: &Value) -> Vec<f64> {
    array.as_array().into_iter().flatten().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
}

/// The values of a report's parameters, in their order.
pub(crate) fn parameters(report: &Value) -> Vec<f64> {
    let parameters = report["model"]["parameters"].as_array().into_iter().flatten();
    parameters.map(|parameter| number(parameter, "/value")).collect()
}

/// The names of a report's parameters, in their order.
pub(crate) fn names(report: &Value) -> Vec<String> {
    let parameters = report["model"]["parameters"].as_array().into_iter().flatten();
    parameters.map(|parameter| parameter["name"].as_str().unwrap_or_default().to_owned()).collect()
}

/// The largest distance between two lists of numbers, which must be as long.
pub(crate) fn distance(left: &[f64], right: &[f64]) -> f64 {
    assert_eq!(left.len(), right.len());
    // Written so that a NaN is far away.
    left.iter().zip(right).map(|(a, b)| (a - b).abs()).fold(0.0, |far, d| if d <= far { far } else { d })
}
