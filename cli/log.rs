//! From a text table to a log: which columns, which clock, and on which line an error is.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use thetahat::{Channel, Error, Log, Resampling, Source};

use crate::failure::Failure;
use crate::job::{Clock, LogJob};
use crate::output::warn;
use crate::table::{Reader, Selection};

/// A reading that takes longer shows its progress on a terminal.
const PATIENCE: Duration = Duration::from_secs(1);

/// A log and where it came from.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) log: Log,
    pub(crate) source: Source,
}

impl Loaded {
    /// What the library says of this log.
    pub(crate) fn failure(source: &Source) -> impl Fn(Error) -> Failure {
        move |error| Failure::about(&error, |_| source.file.clone())
    }
}

/// Reads the columns of a log that `choose` names, seeing those there are.
///
/// Without a clock of its own the log gets `sample_time`, or one row a second if there is none.
pub(crate) fn load(
    job: &LogJob,
    sample_time: Option<f64>,
    choose: impl FnOnce(&[String]) -> Result<Vec<String>, String>,
) -> Result<Loaded, Failure> {
    let reader = Reader::open(&job.path, &job.options)?;
    let file = job.path.display().to_string();
    let bad = |message: String| Failure::data(format!("{file}: {message}"));
    let header = reader.names().to_vec();
    if job.options.header && header.iter().all(|name| name.trim().parse::<f64>().is_ok()) {
        warn("the names of all columns are numbers; if the first row is data, read it with --no-header");
    }
    let names = choose(&header).map_err(bad)?;
    let time = match &job.clock {
        Clock::Column { name, .. } => Some(find(name, &header).map_err(bad)?),
        Clock::Fixed(_) => None,
        Clock::Unknown => {
            if let Some(name) =
                header.iter().find(|name| ["t", "time"].contains(&name.to_lowercase().as_str()))
            {
                warn(&format!("column '{name}' looks like a clock; --time {name} would use it"));
            }
            None
        }
    };
    let columns: Vec<usize> =
        names.iter().map(|name| find(name, &header).map_err(bad)).collect::<Result<_, _>>()?;
    for (position, &column) in columns.iter().enumerate() {
        if columns[..position].contains(&column) || time == Some(column) {
            return Err(Failure::usage(format!(
                "column '{}' is named twice; each has one role",
                header[column]
            )));
        }
    }

    let mut progress = Progress::default();
    let table = reader.read(&Selection { columns, time }, &mut |read, total| progress.update(read, total))?;
    progress.finish();

    let channels =
        names.into_iter().zip(table.columns).map(|(name, values)| Channel { name, values }).collect();
    let clock = if let Clock::Column { name, .. } = &job.clock { Some(name.clone()) } else { None };
    let mut source = Source { file: file.clone(), time: clock, start: table.start, resampled: None };
    let log = match (&job.clock, table.time) {
        (Clock::Column { resample: Some((step, interpolation)), .. }, Some(time)) => {
            source.resampled =
                Some(Resampling { step: *step, interpolation: *interpolation, rows: table.rows });
            Log::resampled(channels, &time, *step, *interpolation)
        }
        (_, Some(time)) => Log::with_time(channels, time),
        (Clock::Fixed(seconds), None) => Log::new(channels, *seconds),
        (_, None) => Log::new(channels, sample_time.unwrap_or(1.0)),
    };
    let log = log.map_err(|error| {
        Failure::about(&error, |row| match row {
            // The library counts rows from 1, the table from 0.
            Some(row) => format!("{file}:{}", table.lines.of(row - 1)),
            None => file.clone(),
        })
    })?;
    Ok(Loaded { log, source })
}

/// The one column of a name.
fn find(name: &str, header: &[String]) -> Result<usize, String> {
    let mut found = header.iter().enumerate().filter(|(_, other)| *other == name);
    match (found.next(), found.next()) {
        (Some((column, _)), None) => Ok(column),
        (Some(_), Some(_)) => Err(format!("two columns are called '{name}'; rename one of them")),
        _ => Err(format!("there is no column '{}'; there are: {}", brief(name), listed(header))),
    }
}

/// The names of columns as a message lists them: not all of very many, and not all of a very long one.
pub(crate) fn listed(header: &[String]) -> String {
    const MOST: usize = 12;
    let names: Vec<String> = header.iter().take(MOST).map(|name| brief(name)).collect();
    let more = if header.len() > MOST { format!(", … ({} in all)", header.len()) } else { String::new() };
    format!("{}{more}", names.join(", "))
}

fn brief(name: &str) -> String {
    const LONGEST: usize = 24;
    match name.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_owned(),
    }
}

/// A bar on a terminal, for those who wait.
#[derive(Default)]
struct Progress {
    began: Option<Instant>,
    bar: Option<ProgressBar>,
}

impl Progress {
    fn update(&mut self, read: u64, total: Option<u64>) {
        let began = *self.began.get_or_insert_with(Instant::now);
        if self.bar.is_none() && began.elapsed() > PATIENCE && std::io::stderr().is_terminal() {
            let bar = total.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
            let style = if total.is_some() {
                "reading {wide_bar} {bytes}/{total_bytes} {eta}"
            } else {
                "reading {spinner} {bytes}"
            };
            self.bar = Some(bar.with_style(
                ProgressStyle::with_template(style).unwrap_or_else(|_| ProgressStyle::default_bar()),
            ));
        }
        if let Some(bar) = &self.bar {
            bar.set_position(read);
        }
    }

    fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
