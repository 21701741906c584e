//! Many logs, each by itself: a table with a row for each, and a folder with the document of each.
//!
//! A row has the log's name, the exit code that the verb would have had with this log alone, and its message; then what
//! the document says ([`Row`]). Logs are shared out to threads one by one, and rows stand in the order of the logs, so
//! that what is written does not depend on the number of threads. Where there are no more logs than threads, each of
//! them gets several.

mod journal;
mod logs;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;

use rayon::ThreadPoolBuilder;
use thetahat::{Cell, Document, Row, text};

pub use self::journal::Journal;
use self::logs::Named;
use crate::args::EachArguments;
use crate::failure::{Failure, Kind};
use crate::files::Files;
use crate::interrupt;
use crate::messages::tell;
use crate::output;
use crate::progress::Counting;
use crate::replace;

/// What separates the warnings of a log in its cell.
const BETWEEN: &str = " | ";
/// This many kinds of failure are told, those of most logs first.
const MOST_TOLD: usize = 8;

/// What was done with one log.
pub(super) struct Done {
    json: String,
    row: Row,
    warnings: Vec<String>,
    /// What a gate says of it.
    unmet: Option<Failure>,
}

impl Done {
    /// What a document says in a row, and what the reader should know: what was said while it was made, then its own
    /// warnings.
    pub(super) fn new(
        document: &impl Document,
        row: Row,
        mut said: Vec<String>,
        warnings: &[String],
    ) -> Result<Self, Failure> {
        let json = document.to_json().map_err(|error| Failure::data(error.to_string()))?;
        said.extend(warnings.iter().map(|warning| crate::options::with_options(warning)));
        Ok(Self { json, row, warnings: said, unmet: None })
    }

    /// The same, with what a gate says of it.
    pub(super) fn with(self, unmet: Option<Failure>) -> Self {
        Self { unmet, ..self }
    }
}

/// Does the work with each log, writes the table and the documents, and says how it went.
///
/// `common` is what the work depends on beside the log, in words that differ where it does.
///
/// # Errors
/// As said of the logs' names; that something cannot be written; that a gate is not met by some log; that all logs
/// failed.
pub(super) fn each(
    arguments: &EachArguments,
    patterns: &[PathBuf],
    common: &str,
    work: impl Fn(&Path) -> Result<Done, Failure> + Sync,
) -> Result<(), Failure> {
    let table = arguments.table.as_deref().unwrap_or(Path::new("-"));
    let logs = logs::named(patterns, arguments.list.as_deref(), arguments.reports.is_some())?;
    let journal = arguments.reports.as_deref().map(|folder| Journal::open(folder, common)).transpose()?;
    if let Some((folder, journal)) = arguments.reports.as_deref().zip(journal.as_ref()) {
        check_documents(folder, journal, &logs, table)?;
    }
    let run = Run {
        logs: &logs,
        folder: arguments.reports.as_deref(),
        journal: journal.as_ref(),
        work: &work,
        next: AtomicUsize::new(0),
        rows: logs.iter().map(|_| OnceLock::new()).collect(),
        failed: Mutex::new(None),
        ended: AtomicBool::new(false),
        progress: Counting::new(logs.len()),
    };
    let threads = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    if let Err(failure) = run.on(threads) {
        if journal.is_some() && failure.kind() == Kind::Interrupted {
            let done = run.rows.iter().filter(|row| row.get().is_some()).count();
            tell(&format!("{done} of {} logs are done; the same command goes on from there", logs.len()));
        }
        return Err(failure);
    }
    let Run { rows, .. } = run;
    let rows: Vec<Row> = rows.into_iter().filter_map(OnceLock::into_inner).collect();
    write(table, &rows)?;
    let reused = journal.as_ref().map_or(0, Journal::reused);
    end(table, &rows, reused)
}

/// That no document of another log is replaced, nor the journal or a document by the table.
fn check_documents(folder: &Path, journal: &Journal, logs: &[Named], table: &Path) -> Result<(), Failure> {
    let documents = journal.documents();
    let mut read: Vec<PathBuf> = documents.keys().map(|document| document.to_path_buf()).collect();
    read.push(journal.path().to_owned());
    for log in logs {
        let report = folder.join(&log.report);
        let other = documents.get(report.as_path()).filter(|other| is_another(Path::new(other), &log.path));
        if let Some(other) = other.filter(|_| report.exists()) {
            return Err(Failure::usage(format!(
                "{} is the document of {other}, of an earlier run, and would be that of {}; name both logs in one run, or give \
                 --reports another folder",
                report.display(),
                log.path.display()
            )));
        }
        if report == table {
            return Err(Failure::usage(format!(
                "{} is the document of {}; give --table another name",
                report.display(),
                log.path.display()
            )));
        }
        read.push(report);
    }
    Files { read, written: vec![table.to_owned()], ..Files::default() }.check()
}

/// Whether these are two files; one that is not there any more is none.
fn is_another(other: &Path, log: &Path) -> bool {
    match (fs::canonicalize(other), fs::canonicalize(log)) {
        (Ok(other), Ok(log)) => other != log,
        _ => false,
    }
}

/// A run over all logs.
struct Run<'r, W> {
    logs: &'r [Named],
    folder: Option<&'r Path>,
    journal: Option<&'r Journal>,
    work: &'r W,
    /// The log that is taken next.
    next: AtomicUsize,
    /// The row of each log, once it is done.
    rows: Vec<OnceLock<Row>>,
    /// What ended the run.
    failed: Mutex<Option<Failure>>,
    ended: AtomicBool,
    progress: Counting,
}

impl<W: Fn(&Path) -> Result<Done, Failure> + Sync> Run<'_, W> {
    /// Shares the logs out to threads.
    fn on(&self, threads: usize) -> Result<(), Failure> {
        let workers = threads.min(self.logs.len()).max(1);
        let own = |worker: usize| threads / workers + usize::from(worker < threads % workers);
        interrupt::during(|| {
            // As many as there are anyway: also where the system has no more than this one.
            if workers == 1 && threads == rayon::current_num_threads() {
                self.take();
                return Ok(());
            }
            let refused = |error: &dyn std::error::Error| {
                self.end(Failure::usage(format!(
                    "--threads {threads}: the threads cannot be started: {error}; give fewer"
                )));
            };
            thread::scope(|scope| {
                for worker in 0..workers {
                    let work = move || match ThreadPoolBuilder::new().num_threads(own(worker)).build() {
                        Ok(pool) => pool.install(|| self.take()),
                        Err(error) => refused(&error),
                    };
                    if let Err(error) = thread::Builder::new().spawn_scoped(scope, work) {
                        refused(&error);
                    }
                }
            });
            Ok(())
        })?
        .map_err(|error| Failure::option(&error))?;
        match self.failed.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(failure) => Err(failure),
            None => Ok(()),
        }
    }

    /// Takes one log after the other until there is none.
    fn take(&self) {
        while !self.ended.load(Ordering::Relaxed) {
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(log) = self.logs.get(index) else { break };
            if interrupt::asked() {
                break;
            }
            match self.one(log) {
                Ok(row) => {
                    self.progress.done(row.get("exit_code") != Some(&Cell::Count(0)));
                    let _ = self.rows[index].set(row);
                }
                Err(failure) => self.end(failure),
            }
        }
    }

    /// The row of one log: as it was in the last run, or new.
    fn one(&self, log: &Named) -> Result<Row, Failure> {
        let path = log.path.display().to_string();
        let digest = self.journal.and_then(|journal| journal.digest(&log.path));
        if let Some((journal, digest)) = self.journal.zip(digest.as_deref())
            && let Some(row) = journal.row(&path, digest)
        {
            return Ok(row);
        }
        let mut row = Row::default();
        row.text("log", &path);
        // A failure of the machine is tried again by the next run.
        let mut lasts = true;
        match (self.work)(&log.path) {
            Ok(Done { json, row: figures, warnings, unmet }) => {
                row.count("exit_code", unmet.as_ref().map_or(0, |failure| failure.exit_code().into()));
                if let Some(unmet) = unmet {
                    row.text("message", unmet.message());
                }
                figures.cells().iter().for_each(|(name, cell)| row.add(name, cell.clone()));
                if !warnings.is_empty() {
                    row.text("warnings", text::message(&warnings.join(BETWEEN)));
                }
                if let Some(folder) = self.folder {
                    let report = folder.join(&log.report);
                    fs::create_dir_all(replace::folder(&report))
                        .map_err(|error| Failure::io(&report, "its folder cannot be made", &error))?;
                    replace::put(&report, |file| file.write_all(json.as_bytes()))?;
                    row.text("report", report.display().to_string());
                }
            }
            Err(failure) if matches!(failure.kind(), Kind::Interrupted | Kind::Closed) => {
                return Err(failure);
            }
            Err(failure) => {
                lasts = !failure.may_pass();
                row.count("exit_code", failure.exit_code().into());
                row.text("message", failure.message());
            }
        }
        if let Some((journal, digest)) = self.journal.zip(digest).filter(|_| lasts) {
            journal.note(&digest, &row)?;
        }
        Ok(row)
    }

    fn end(&self, failure: Failure) {
        self.ended.store(true, Ordering::Relaxed);
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(failure);
    }
}

/// Writes the table. What went wrong stands in front, also where nothing did.
fn write(path: &Path, rows: &[Row]) -> Result<(), Failure> {
    let mut first = Row::default();
    ["log", "exit_code", "message"].into_iter().for_each(|name| first.text(name, ""));
    let names = Row::names([&first].into_iter().chain(rows));
    output::write_csv(path, |csv| {
        csv.write_record(names.iter().map(|name| output::cell(name)))?;
        for row in rows {
            csv.write_record(names.iter().map(|name| match row.get(name) {
                Some(Cell::Text(text)) => output::cell(text),
                Some(cell) => cell.to_string(),
                None => String::new(),
            }))?;
        }
        Ok(())
    })
}

/// Says how many logs went how, and what is the exit code of all: that of a gate which some log did not meet; where no
/// log went well, that of the first.
fn end(table: &Path, rows: &[Row], reused: usize) -> Result<(), Failure> {
    let code = |row: &Row| match row.get("exit_code") {
        Some(Cell::Count(code)) => *code,
        _ => 0,
    };
    let message = |row: &Row| match (row.get("log"), row.get("message")) {
        (_, Some(Cell::Text(message))) => message.clone(),
        (log, _) => log.map(ToString::to_string).unwrap_or_default(),
    };
    let failed: Vec<&Row> = rows.iter().filter(|row| code(row) != 0).collect();
    let mut lines = vec![format!(
        "{}: {} row{}, {} of them without a failure{}",
        if table == Path::new("-") { "table".to_owned() } else { table.display().to_string() },
        rows.len(),
        if rows.len() == 1 { "" } else { "s" },
        rows.len() - failed.len(),
        if reused > 0 { format!("; {reused} as in an earlier run") } else { String::new() }
    )];
    let mut codes: Vec<u64> = failed.iter().map(|row| code(row)).collect();
    codes.sort_unstable();
    codes.dedup();
    for own in codes.into_iter().take(MOST_TOLD) {
        let mut with = failed.iter().filter(|row| code(row) == own);
        let first = with.next().map(|row| message(row)).unwrap_or_default();
        lines.push(format!("  {} with exit code {own}, the first: {first}", with.count() + 1));
    }
    if table == Path::new("-") {
        lines.iter().for_each(|line| tell(line));
    } else {
        output::print(&format!("{}\n", lines.join("\n")))?;
    }
    match failed.iter().find(|row| code(row) == 6).or(failed.first().filter(|_| failed.len() == rows.len())) {
        Some(row) if code(row) == 6 => {
            let unmet = failed.iter().filter(|row| code(row) == 6).count();
            Err(Failure::unmet(format!("{unmet} of {} logs do not meet what is required", rows.len())))
        }
        Some(row) => {
            Err(Failure::of_exit_code(code(row), format!("no log went well; the first: {}", message(row))))
        }
        None => Ok(()),
    }
}
