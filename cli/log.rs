//! From a table to a log: which columns, which clock, and in which row an error is.

mod topics;

use std::collections::{HashMap, HashSet};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use thetahat::data::{Calendar, Channel, Log, Recording, Resample, Resampling, Rows, Source, Times, mended};
use thetahat::model::{GreyBox, Model};
use thetahat::{Error, text};
use thetahat_table::{Bound, ClockColumns, Lines, Options, Reader, Selection, Stream, Table};

use crate::failure::Failure;
use crate::interrupt;
use crate::job::{Clock, LogJob};
use crate::messages;
use crate::progress::Reading;

pub(crate) use topics::list as list_of_topics;

/// A log and where it came from, its rows counted from 1.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) log: Log,
    pub(crate) source: Source,
    /// What the reader should know, in plain words.
    pub(crate) warnings: Vec<String>,
}

/// Which clocks what is done with a log can go by.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Clocks {
    /// The sample time of a log without a clock of its own; one row a second if there is none.
    pub(crate) sample_time: Option<f64>,
    /// Whether an irregular one will do.
    pub(crate) any: bool,
}

impl From<&Model> for Clocks {
    fn from(model: &Model) -> Self {
        Self { sample_time: Some(model.sample_time()), any: model.takes_any_clock() }
    }
}

impl From<&GreyBox> for Clocks {
    fn from(model: &GreyBox) -> Self {
        Self { sample_time: Some(model.sample_time()), any: true }
    }
}

/// Several logs as one, and where they came from, their rows counted through.
#[derive(Debug)]
pub(crate) struct Joined {
    pub(crate) log: Log,
    pub(crate) sources: Vec<Source>,
    /// What the reader should know, in plain words.
    pub(crate) warnings: Vec<String>,
}

/// Reads the columns of some logs that `choose` names of each, seeing those there are, one log after the other.
pub(crate) fn joined(
    paths: &[PathBuf],
    job: &LogJob,
    clocks: Clocks,
    mut choose: impl FnMut(&Path, &[String]) -> Result<Vec<String>, Failure>,
) -> Result<Joined, Failure> {
    let (mut logs, mut sources, mut warnings) = (Vec::new(), Vec::<Source>::new(), Vec::new());
    for path in paths {
        let Loaded { log, mut source, warnings: own } =
            load(path, job, clocks, |header| choose(path, header))?;
        let before = sources.last().map_or(0, |source| source.rows.last());
        source.rows = Rows::new(before + 1, before + log.rows())
            .map_err(|error| Failure::data(format!("{}: {error}", path.display())))?;
        logs.push(log);
        warnings.extend(own);
        sources.push(source);
    }
    let log = Log::join(logs).map_err(failure(&sources))?;
    Ok(Joined { log, sources, warnings })
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
pub(crate) fn load(
    path: &Path,
    job: &LogJob,
    clocks: Clocks,
    choose: impl FnOnce(&[String]) -> Result<Vec<String>, Failure>,
) -> Result<Loaded, Failure> {
    let Columns { channels, table, mut source, clock, restarts, mut warnings } =
        columns(open(path, job)?, path, job, false, |reader| choose(reader.names()))?;
    let file = source.file.clone();
    let rows = table.rows;
    if let (Some(how), Some(time)) = (clock.resample(), &table.time) {
        // Up to where the clock begins again.
        let first = restarts.first().map_or(time.as_slice(), |end| &time[..*end]);
        source.resampled = Some(Resampling::new(&how, first).map_err(at_line(&file, &table.lines))?);
    }
    let one = |channels: Vec<Channel>, time: Option<Vec<f64>>| match (clock.resample(), time) {
        (Some(how), Some(time)) => Ok((Log::resampled(channels, &time, &how)?, None)),
        (None, Some(time)) if !clocks.any => Log::recorded(channels, time)?.on_one_rate(),
        (_, time) => Ok((made(channels, time, &clock, clocks)?, None)),
    };
    let each = match (restarts.as_slice(), table.time) {
        ([_, ..], Some(time)) => {
            cut(channels, &time, &restarts).map(|(channels, time)| one(channels, Some(time))).collect()
        }
        (_, time) => one(channels, time).map(|own| vec![own]),
    };
    let each: Vec<(Log, Option<Resample>)> = each.map_err(at_line(&file, &table.lines))?;
    if let Some(Resample { step, interpolation, .. }) = each.iter().find_map(|(_, how)| *how) {
        warnings.push(format!(
            "{file}: the log has two rates, and what it is used for needs one: it is resampled every {step} s, channels that move in steps \
             by hold, the others by straight lines; --resample says otherwise"
        ));
        source.resampled = Some(Resampling { step, interpolation, rows, anti_alias: None });
    }
    let logs = each.into_iter().map(|(log, _)| log).collect();
    let log = Log::join(logs).map_err(at_line(&file, &table.lines))?;
    source.rows = Rows::new(1, log.rows()).map_err(at_line(&file, &table.lines))?;
    Ok(Loaded { log, source, warnings })
}

/// The parts of a log that begin at these rows, and the one before.
fn cut<'l>(
    channels: Vec<Channel>,
    time: &'l [f64],
    starts: &'l [usize],
) -> impl Iterator<Item = (Vec<Channel>, Vec<f64>)> + 'l {
    let firsts = std::iter::once(0).chain(starts.iter().copied());
    let ends = starts.iter().copied().chain([time.len()]);
    firsts.zip(ends).map(move |(first, end)| {
        let part = |channel: &Channel| Channel {
            name: channel.name.clone(),
            values: channel.values[first..end].to_vec(),
        };
        (channels.iter().map(part).collect(), time[first..end].to_vec())
    })
}

/// The values of a part are at most so many, or a few more.
const PART: usize = 1 << 20;
/// What is left at the end of a log and has fewer rows than this belongs to the part before it.
const FEW: usize = 1 << 10;

/// A part of a log that is read in several.
#[derive(Debug)]
pub(crate) struct Part<'l> {
    /// The rows, with some of the part before it in front.
    pub(crate) recording: Recording,
    /// The log's name, with the rows of the part that are its own.
    pub(crate) source: Source,
    /// How many rows are of the part before it.
    pub(crate) past: usize,
    file: &'l str,
    lines: Lines,
    /// How many rows there were before it.
    before: usize,
}

impl Part<'_> {
    /// The rows, which are then no longer here.
    pub(crate) fn taken(&mut self) -> Recording {
        let empty = Recording { channels: Vec::new(), times: Times::Uniform(1.0) };
        std::mem::replace(&mut self.recording, empty)
    }

    /// What the library says of its rows, with the line.
    pub(crate) fn failure(&self, error: &Error) -> Failure {
        // Rows of the part before it have no line here; what a clock says of them it has said before.
        let place = |row: usize| self.lines.place(self.file, row.saturating_sub(self.past + 1), self.before);
        Failure::about(error, |row| row.map_or_else(|| self.file.to_owned(), place))
    }
}

/// A part of a log whose clock is uniform.
#[derive(Debug)]
pub(crate) struct Piece {
    pub(crate) log: Log,
    pub(crate) source: Source,
    pub(crate) past: usize,
}

/// As [`in_parts`], of a log whose clock is uniform.
pub(crate) fn in_pieces<T>(
    path: &Path,
    job: &LogJob,
    choose: impl FnOnce(&[String]) -> Result<(Vec<String>, usize, T), Failure>,
    take: &mut dyn FnMut(&T, Piece) -> Result<(), Failure>,
) -> Result<Vec<String>, Failure> {
    let choose = |reader: &Reader| choose(reader.names());
    in_parts(path, job, choose, &mut |chosen, mut part| {
        let Recording { channels, times } = part.taken();
        let log = match times {
            Times::Measured(time) => Log::with_time(channels, time),
            Times::Uniform(step) => Log::new(channels, step),
        };
        let log = log.map_err(|error| part.failure(&error))?;
        take(chosen, Piece { log, source: part.source, past: part.past })
    })
}

/// Reads the columns of a log that `choose` names, each part with as many rows of the one before it as it says, and
/// hands them on with what it chose: memory does not grow with the rows. Gives what the reader should know, in plain
/// words.
pub(crate) fn in_parts<T>(
    path: &Path,
    job: &LogJob,
    choose: impl FnOnce(&Reader) -> Result<(Vec<String>, usize, T), Failure>,
    take: &mut dyn FnMut(&T, Part<'_>) -> Result<(), Failure>,
) -> Result<Vec<String>, Failure> {
    let reader = Reader::open(path, &options(job))?;
    let file = path.display().to_string();
    let (names, lags, chosen) =
        choose(&reader).map_err(|failure| topics::explained(failure, &reader, path))?;
    let Selected { selection, clock, note, mut warnings } = selected(&reader, &file, job, &names)?;
    let most = (PART / (names.len() + 1)).max(2 * lags);
    let mut before = Before { file: &file, names: &names, clock, lags, rows: 0, tail: Tail::default() };
    let mut waiting: Option<Table> = None;
    let progress = (!job.quiet).then(Reading::new);
    let mut update = |read, total| progress.iter().for_each(|progress| progress.update(read, total));
    let mut taken = |mut part: Table| -> Result<(), Failure> {
        for warning in std::mem::take(&mut part.words) {
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        match &mut waiting {
            Some(waiting) if part.rows < FEW => waiting.extend(part),
            waiting => {
                if let Some(whole) = waiting.replace(part) {
                    take(&chosen, before.with(whole)?)?;
                }
            }
        }
        if interrupt::asked() { Err(Failure::interrupted()) } else { Ok(()) }
    };
    let mut failure = None;
    reader.read_parts(&selection, Some(most), &mut update, &mut |part| match taken(part) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            failure = Some(error);
            ControlFlow::Break(())
        }
    })?;
    if let Some(failure) = failure {
        return Err(failure);
    }
    if let Some(last) = waiting {
        take(&chosen, before.with(last)?)?;
    }
    note.iter().for_each(|note| messages::note(note));
    Ok(warnings)
}

/// Columns, and their times where there is a clock.
#[derive(Debug, Default)]
struct Tail {
    columns: Vec<Vec<f64>>,
    time: Option<Vec<f64>>,
}

/// What a part of a log has to know of those before it.
struct Before<'l> {
    file: &'l str,
    names: &'l [String],
    clock: Clock,
    lags: usize,
    /// How many rows there were.
    rows: usize,
    /// The last of them.
    tail: Tail,
}

impl<'l> Before<'l> {
    /// The next part, with the rows before it.
    fn with(&mut self, table: Table) -> Result<Part<'l>, Failure> {
        let Table { columns, time, start, rows, lines, .. } = table;
        let (file, past) = (self.file, self.tail.columns.first().map_or(0, Vec::len));
        let front = |tail: Option<&Vec<f64>>, values: Vec<f64>| match tail {
            Some(tail) if !tail.is_empty() => [tail.as_slice(), &values].concat(),
            _ => values,
        };
        let columns: Vec<Vec<f64>> = columns
            .into_iter()
            .enumerate()
            .map(|(column, values)| front(self.tail.columns.get(column), values))
            .collect();
        let time = time.map(|time| front(self.tail.time.as_ref(), time));
        let last = |values: &Vec<f64>| values[values.len() - self.lags.min(values.len())..].to_vec();
        self.tail = Tail { columns: columns.iter().map(last).collect(), time: time.as_ref().map(last) };
        let channels = self.names.iter().cloned().zip(columns);
        let channels = channels.map(|(name, values)| Channel { name, values }).collect();
        let recording = Recording { channels, times: times(&self.clock, time) };
        let (first, end) = (self.rows + 1, self.rows + rows);
        let source = Source {
            file: format!("{file} (rows {first}..{end})"),
            rows: Rows::new(1, past + rows).map_err(|error| Failure::data(format!("{file}: {error}")))?,
            time: self.clock.column(),
            start,
            resampled: None,
        };
        let before = std::mem::replace(&mut self.rows, end);
        Ok(Part { recording, source, past, file, lines, before })
    }
}

/// A log of channels, with the clock of the job.
fn made(channels: Vec<Channel>, time: Option<Vec<f64>>, clock: &Clock, clocks: Clocks) -> Result<Log, Error> {
    match (clock, time) {
        (_, Some(time)) if clocks.any => Log::recorded(channels, time),
        (_, Some(time)) => Log::with_time(channels, time),
        (Clock::Fixed(seconds), None) => Log::new(channels, *seconds),
        (_, None) => Log::new(channels, clocks.sample_time.unwrap_or(1.0)),
    }
}

/// A log as it was recorded, its clock irregular or not.
#[derive(Debug)]
pub(crate) struct Recorded {
    pub(crate) recording: Recording,
    pub(crate) source: Source,
    /// The line on which each row is.
    pub(crate) lines: Lines,
    /// What the reader should know, in plain words.
    pub(crate) warnings: Vec<String>,
}

/// Reads the columns of a log that `choose` names as they are, one row a second without a clock.
pub(crate) fn record(
    reader: Reader,
    path: &Path,
    job: &LogJob,
    choose: impl FnOnce(&Reader) -> Result<Vec<String>, Failure>,
) -> Result<Recorded, Failure> {
    let Columns { channels, table, source, clock, restarts, warnings } =
        columns(reader, path, job, true, choose)?;
    let time = table.time.map(|time| after_pauses(time, &restarts));
    let times = times(&clock, time);
    Ok(Recorded { recording: Recording { channels, times }, source, lines: table.lines, warnings })
}

/// The times of experiments, each after a pause that is a gap to whoever looks at the clock.
fn after_pauses(mut time: Vec<f64>, starts: &[usize]) -> Vec<f64> {
    const PAUSE: f64 = 10.0;
    for &start in starts {
        let step = time[start - 1] - start.checked_sub(2).map_or(time[start - 1], |row| time[row]);
        let ahead = time[start - 1] + PAUSE * step - time[start];
        time[start..].iter_mut().for_each(|time| *time += ahead);
    }
    time
}

/// When the rows were recorded: one a second without a clock.
fn times(clock: &Clock, time: Option<Vec<f64>>) -> Times {
    match (clock, time) {
        (Clock::Fixed(seconds), _) => Times::Uniform(*seconds),
        (_, Some(time)) => Times::Measured(time),
        (_, None) => Times::Uniform(1.0),
    }
}

/// Opens a log to be read row by row, as it comes, for the columns that `choose` names. Gives it with what the reader
/// should know, in plain words. Dates count from `start`, or from the first one.
pub(crate) fn follow(
    path: &Path,
    job: &LogJob,
    whole_lines: bool,
    start: Option<&str>,
    choose: impl FnOnce(&[String]) -> Result<Vec<String>, Failure>,
) -> Result<(Stream, Vec<String>), Failure> {
    let reader = Reader::open_live(path, &options(job))?;
    let names = choose(reader.names()).map_err(|failure| topics::explained(failure, &reader, path))?;
    let file = path.display().to_string();
    // A clock that is not named is not taken: of a log that is still being written there may be one row.
    let mut hint = None;
    let live = match &job.clock {
        // A topic has its own.
        Clock::Unknown { .. } if reader.topics().is_none() => {
            let columns = find_all(&names, reader.names()).unwrap_or_default();
            hint = free_clocks(&reader, &columns).first().map(|clock| called(*clock, reader.names()));
            &LogJob { clock: Clock::Fixed(1.0), options: job.options.clone(), ..*job }
        }
        _ => job,
    };
    let Selected { selection, mut warnings, .. } = selected(&reader, &file, live, &names)?;
    warnings.extend(
        hint.map(|name| format!("{file}: column '{name}' looks like a clock; --time {name} would use it")),
    );
    let stream = reader.stream(&selection, whole_lines, start)?;
    interrupt::follows(stream.waker());
    Ok((stream, warnings))
}

/// What the library says of the rows of one log, with the line.
pub(crate) fn at_line(file: &str, lines: &Lines) -> impl Fn(Error) -> Failure {
    move |error| {
        Failure::about(&error, |row| match row {
            // The library counts rows from 1, the table from 0.
            Some(row) => lines.place(file, row - 1, 0),
            None => file.to_owned(),
        })
    }
}

/// Columns as they stand in a file; the rest of the table has their times.
struct Columns {
    channels: Vec<Channel>,
    table: Table,
    /// Where they came from, the rows as they stand there.
    source: Source,
    clock: Clock,
    /// The rows (from 0) at which the clock begins again.
    restarts: Vec<usize>,
    /// What the reader should know, in plain words.
    warnings: Vec<String>,
}

/// Opens a log, and reads as far as its first row.
pub(crate) fn open(path: &Path, job: &LogJob) -> Result<Reader, Failure> {
    Ok(Reader::open(path, &options(job))?)
}

/// Reads the columns of a log that `choose` names. `any_order` is whether a clock that stands still or goes back will
/// do.
fn columns(
    reader: Reader,
    path: &Path,
    job: &LogJob,
    any_order: bool,
    choose: impl FnOnce(&Reader) -> Result<Vec<String>, Failure>,
) -> Result<Columns, Failure> {
    let file = path.display().to_string();
    let names = choose(&reader).map_err(|failure| topics::explained(failure, &reader, path))?;
    let Selected { selection, mut clock, mut note, mut warnings } = selected(&reader, &file, job, &names)?;

    let progress = (!job.quiet).then(Reading::new);
    let mut update = |read, total| progress.iter().for_each(|progress| progress.update(read, total));
    let mut table = reader.read(&selection, &mut update)?;
    drop(progress);
    warnings.append(&mut table.words);
    let mut resampled = None;
    if !table.clocks.is_empty() {
        let (how, said) = topics::on_one_clock(&file, &names, &mut table, clock.resample())?;
        (resampled, note) = (Some(how), Some(said).filter(|_| !job.quiet));
        clock = Clock::Unknown { resample: None };
    }
    // Rows that are evenly apart have no times, also where the log has some.
    if let Clock::Fixed(_) = clock {
        table.time = None;
    }
    let mut restarts = Vec::new();
    if let Some(time) = table.time.take() {
        let kept = any_order.then(|| time.clone());
        match (mended(time, calendar(table.calendar)), kept) {
            (Ok(mended), _) => {
                warnings.extend(mended.words.iter().map(|warning| format!("{file}: {warning}")));
                (table.time, restarts) = (Some(mended.time), mended.restarts);
            }
            (Err(_), Some(time)) => table.time = Some(time),
            (Err(error), None) => return Err(at_line(&file, &table.lines)(error)),
        }
    }

    note.iter().for_each(|note| messages::note(note));

    let values = std::mem::take(&mut table.columns);
    let channels = names.into_iter().zip(values).map(|(name, values)| Channel { name, values }).collect();
    let rows = Rows::new(1, table.rows).map_err(|error| Failure::data(format!("{file}: {error}")))?;
    let source = Source { file, rows, time: clock.column(), start: table.start.take(), resampled };
    Ok(Columns { channels, table, source, clock, restarts, warnings })
}

/// What the times of a table are, to the library.
fn calendar(of: thetahat_table::Calendar) -> Calendar {
    match of {
        thetahat_table::Calendar::None => Calendar::None,
        thetahat_table::Calendar::TimesOfDay => Calendar::TimesOfDay,
        thetahat_table::Calendar::Wall { first } => Calendar::Wall { first: first as f64 / 1e9 },
        thetahat_table::Calendar::Instants => Calendar::Instants,
    }
}

/// How a log is written, and as much memory as there is now: other logs may be in memory already.
fn options(job: &LogJob) -> Options {
    Options { bound: Some(Bound::now(job.per_value as u64)), ..job.options.clone() }
}

/// The columns that are read.
struct Selected {
    selection: Selection,
    /// Where the times come from: not left to the log any more, unless it has no clock.
    clock: Clock,
    /// Which clock was taken, if none was named.
    note: Option<String>,
    /// What the reader should know, in plain words.
    warnings: Vec<String>,
}

/// Where the named columns are, and the clock: that of the job, or the one column of the log that is a clock and not
/// among those.
fn selected(reader: &Reader, file: &str, job: &LogJob, names: &[String]) -> Result<Selected, Failure> {
    let bad = |message: String| Failure::data(format!("{file}: {message}"));
    let header = reader.names();
    let columns = find_all(names, header).map_err(bad);
    let columns = columns.map_err(|failure| topics::explained(failure, reader, Path::new(file)))?;
    let (mut taken, mut warnings) = (None, Vec::new());
    let (clock, found) = match &job.clock {
        _ if reader.topics().is_some() => {
            let topics = reader.topics().unwrap_or_default();
            (topics::clock(topics, &columns, job).map_err(bad)?, None)
        }
        Clock::Unknown { resample } => {
            let found = free_clocks(reader, &columns);
            let found = match found.as_slice() {
                [] => None,
                [one] => Some(*one),
                several => return Err(bad(several_clocks(several, header))),
            };
            let clock = match (found, resample) {
                (Some(found), resample) => {
                    let name = called(found, header);
                    taken = Some(format!(
                        "{file}: the clock is column '{name}'; --time names another, --sample-time says that rows are evenly apart"
                    ));
                    Clock::Column { name, resample: *resample }
                }
                (None, Some(_)) => {
                    return Err(bad(
                        "no column is a clock, and --resample needs one; name it with --time".to_owned()
                    ));
                }
                (None, None) => {
                    let meant = reader.called_clocks().into_iter().find(|column| !columns.contains(column));
                    warnings.extend(meant.map(|column| {
                        let name = &header[column];
                        format!(
                            "{file}: column '{name}' is called as a clock is, or holds dates, but its times do not rise or are not \
                             understood: rows are taken to be evenly apart; --time {name} says what is wrong with them, and \
                             --time-format how they are written"
                        )
                    }));
                    job.clock.clone()
                }
            };
            (clock, found)
        }
        Clock::Column { name, .. } => (job.clock.clone(), Some(named_clock(name, header).map_err(bad)?)),
        Clock::Fixed(_) => (job.clock.clone(), None),
    };
    let mut roles: HashSet<usize> =
        found.iter().flat_map(|found| [Some(found.time), found.date]).flatten().collect();
    for &column in &columns {
        if !roles.insert(column) {
            return Err(Failure::usage(format!(
                "column '{}' is named twice; each has one role",
                header[column]
            )));
        }
    }
    let (time, date) = found.map_or((None, None), |found| (Some(found.time), found.date));
    Ok(Selected {
        selection: Selection { columns, time, date },
        clock,
        note: taken.filter(|_| !job.quiet),
        warnings,
    })
}

/// The columns that are the clock of a log, or may be it.
pub(crate) fn clocks(reader: &Reader, job: &LogJob) -> Vec<usize> {
    let found = match &job.clock {
        Clock::Unknown { .. } => reader.times(),
        Clock::Column { name, .. } => named_clock(name, reader.names()).into_iter().collect(),
        Clock::Fixed(_) => Vec::new(),
    };
    found.iter().flat_map(|found| [Some(found.time), found.date]).flatten().collect()
}

/// The clocks of a log of which no column has another role.
fn free_clocks(reader: &Reader, columns: &[usize]) -> Vec<ClockColumns> {
    let is_free = |column: usize| !columns.contains(&column);
    reader.times().into_iter().filter(|found| is_free(found.time) && found.date.is_none_or(is_free)).collect()
}

/// The columns of a clock: the one of this name, or two with a comma between their names, of dates and of times of day.
fn named_clock(name: &str, header: &[String]) -> Result<ClockColumns, String> {
    let pair = thetahat_table::names(name)
        .ok()
        .filter(|pair| pair.len() == 2 && !header.iter().any(|own| own == name));
    match pair.as_deref() {
        Some([date, time]) => Ok(ClockColumns { time: find(time, header)?, date: Some(find(date, header)?) }),
        _ => Ok(ClockColumns { time: find(name, header)?, date: None }),
    }
}

/// A clock as `--time` names it.
fn called(clock: ClockColumns, header: &[String]) -> String {
    match clock.date {
        Some(date) => thetahat_table::list(&[&header[date], &header[clock.time]]),
        None => header[clock.time].clone(),
    }
}

fn several_clocks(clocks: &[ClockColumns], header: &[String]) -> String {
    let names: Vec<String> = clocks.iter().map(|clock| format!("'{}'", called(*clock, header))).collect();
    format!(
        "several columns may be the clock: {}; name one with --time, or give --sample-time to count rows",
        names.join(", ")
    )
}

/// The one column of each name.
fn find_all(names: &[String], header: &[String]) -> Result<Vec<usize>, String> {
    let mut columns: HashMap<&str, Option<usize>> = HashMap::with_capacity(header.len());
    for (column, name) in header.iter().enumerate() {
        // None for a name that is there twice.
        columns.entry(name).and_modify(|twice| *twice = None).or_insert(Some(column));
    }
    let one = |name: &String| match columns.get(name.as_str()) {
        Some(Some(column)) => Ok(*column),
        _ => find(name, header),
    };
    names.iter().map(one).collect()
}

/// The one column of a name.
fn find(name: &str, header: &[String]) -> Result<usize, String> {
    let mut found = header.iter().enumerate().filter(|(_, other)| *other == name);
    match (found.next(), found.next()) {
        (Some((column, _)), None) => Ok(column),
        (Some(_), Some(_)) => Err(format!("two columns are called '{name}'; rename one of them")),
        _ => Err(format!("there is no column '{}'; there are: {}", text::brief(name, 40), listed(header))),
    }
}

/// The names of columns as a message lists them: not all of very many, and not all of a very long one.
pub(crate) fn listed(header: &[String]) -> String {
    const MOST: usize = 12;
    let names: Vec<String> = header.iter().take(MOST).map(|name| text::brief(name, 24)).collect();
    let more = if header.len() > MOST { format!(", … ({} in all)", header.len()) } else { String::new() };
    format!("{}{more}", names.join(", "))
}
