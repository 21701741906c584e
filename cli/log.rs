//! From a text table to a log: which columns, which clock, and on which line an error is.

use std::path::Path;

use thetahat::{Channel, Error, Log, Resampling, Rows, Source};

use crate::failure::Failure;
use crate::job::{Clock, LogJob};
use crate::output::warn;
use crate::progress::Reading;
use crate::table::{Reader, Selection};

/// A log and where it came from, its rows counted from 1.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) log: Log,
    pub(crate) source: Source,
}

/// What the library says of some logs, with the file that has the row or, without a row, all of them.
pub(crate) fn failure(sources: &[Source]) -> impl Fn(Error) -> Failure {
    const MOST: usize = 6;
    move |error| {
        Failure::about(&error, |row| {
            let has = |source: &&Source| {
                row.is_some_and(|row| (source.rows.first()..=source.rows.last()).contains(&row))
            };
            let files = |sources: &[Source]| {
                let files: Vec<&str> = sources.iter().map(|source| source.file.as_str()).collect();
                files.join(", ")
            };
            match (sources.iter().find(has), sources.get(..MOST)) {
                (Some(source), _) => source.file.clone(),
                (None, Some(first)) if sources.len() > MOST => {
                    format!("{}, … ({} logs)", files(first), sources.len())
                }
                _ => files(sources),
            }
        })
    }
}

/// Reads the columns of a log that `choose` names, seeing those there are.
///
/// Without a clock of its own the log gets `sample_time`, or one row a second if there is none.
pub(crate) fn load(
    path: &Path,
    job: &LogJob,
    sample_time: Option<f64>,
    choose: impl FnOnce(&[String]) -> Result<Vec<String>, Failure>,
) -> Result<Loaded, Failure> {
    let reader = Reader::open(path, &job.options)?;
    let file = path.display().to_string();
    let bad = |message: String| Failure::data(format!("{file}: {message}"));
    let header = reader.names().to_vec();
    if job.options.header && header.iter().all(|name| name.trim().parse::<f64>().is_ok()) {
        warn(&format!(
            "{file}: the names of all columns are numbers; if the first row is data, read it with --no-header"
        ));
    }
    let names = choose(&header)?;
    let time = match &job.clock {
        Clock::Column { name, .. } => Some(find(name, &header).map_err(bad)?),
        Clock::Fixed(_) => None,
        Clock::Unknown => {
            if let Some(name) =
                header.iter().find(|name| ["t", "time"].contains(&name.to_lowercase().as_str()))
            {
                warn(&format!("{file}: column '{name}' looks like a clock; --time {name} would use it"));
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

    let progress = Reading::new();
    let table = reader.read(&Selection { columns, time }, &mut |read, total| progress.update(read, total))?;
    drop(progress);

    let channels =
        names.into_iter().zip(table.columns).map(|(name, values)| Channel { name, values }).collect();
    let clock = if let Clock::Column { name, .. } = &job.clock { Some(name.clone()) } else { None };
    let mut resampled = None;
    let log = match (&job.clock, table.time) {
        (Clock::Column { resample: Some((step, interpolation)), .. }, Some(time)) => {
            resampled = Some(Resampling { step: *step, interpolation: *interpolation, rows: table.rows });
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
    let rows = Rows::new(1, log.rows()).map_err(|error| bad(error.to_string()))?;
    let source = Source { file, rows, time: clock, start: table.start, resampled };
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
