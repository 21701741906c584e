//! Tracking in memory: rows come from a caller, and nothing is read or written.

use thetahat::report::Report;
use thetahat::track::{TrackOptions, TrackSummary, Tracked, Tracker, forecasts, predictions};

use super::channels::Channels;
use super::columns::Columns;
use super::session::{Memory, Row, Session};
use super::state::{self, Lines, State};
use crate::failure::Failure;
use crate::line_writer::{Format, LineWriter, Written};

/// What `thetahat track` does with the rows of a log, fed row by row, with its state and its documents.
///
/// The state counts the lines that the program writes of these rows: so it is the state of the program, which goes on
/// from it as from its own.
pub struct Tracking {
    inputs: Vec<String>,
    outputs: Vec<String>,
    every: u64,
    horizon: Option<usize>,
    columns: Columns,
    state: State,
    lines: LineWriter,
    memory: Memory,
}

/// What one of the trackers made of a row.
#[derive(Debug)]
#[non_exhaustive]
pub struct TrackedRow<'a> {
    /// Which tracker, in the order of the ways to forget and, of each, of the outputs.
    pub index: usize,
    /// The tracker after the row.
    pub tracker: &'a Tracker,
    /// What it made of it.
    pub tracked: Tracked,
    /// What was done, in a word.
    pub action: &'static str,
    /// The standard errors of its parameters.
    pub standard_errors: &'a [f64],
    /// The output as many rows later as was asked for.
    pub forecast: Option<f64>,
}

impl Tracking {
    /// That of a log with these channels; `sample_time` are the seconds between its rows, if they are known.
    ///
    /// # Errors
    /// As for [`TrackOptions::check`] and [`TrackOptions::trackers`].
    pub fn new(
        options: &TrackOptions,
        sample_time: Option<f64>,
        inputs: Vec<String>,
        outputs: Vec<String>,
        report: Option<&Report>,
    ) -> Result<Self, thetahat::Error> {
        options.check(report.is_some())?;
        if let Some(seconds) = sample_time.filter(|seconds| !(*seconds > 0.0 && seconds.is_finite())) {
            let message = format!("{seconds}: not a positive number of seconds; give one above 0");
            return Err(thetahat::Error::argument("sample-time", message));
        }
        let trackers = options.trackers(&inputs, &outputs, report)?;
        let channels = Channels { inputs, outputs };
        let (horizon, every, format) = (options.horizon, 1, Format::JsonLines);
        let setting = state::setting(&Lines { time: "", horizon, every, format }, &channels, &trackers);
        let sample_time = sample_time.or(report.map(|report| report.model.sample_time()));
        let Channels { inputs, outputs } = channels;
        let state = State::new(setting, &outputs, trackers, None, sample_time);
        let columns = Columns::new(false, horizon, &state.outputs, &state.trackers);
        let lines = LineWriter::counting(format, columns.names(), None);
        Ok(Self::of(inputs, outputs, every, horizon, columns, state, lines))
    }

    fn of(
        inputs: Vec<String>,
        outputs: Vec<String>,
        every: u64,
        horizon: Option<usize>,
        columns: Columns,
        state: State,
        lines: LineWriter,
    ) -> Self {
        let memory = Memory::of(&state.trackers);
        Self { inputs, outputs, every, horizon, columns, state, lines, memory }
    }

    /// Goes on from the state that `thetahat track --state` has written, or [`Tracking::state`].
    ///
    /// # Errors
    /// A [`Failure`] if the text is no such state, or was edited; if the names of inputs hold commas, which do not tell
    /// where one ends, and `inputs` does not say them.
    pub fn from_state(text: &str, inputs: Option<Vec<String>>) -> Result<Self, Failure> {
        let state = State::parse(text.as_bytes()).map_err(Failure::data)?;
        let damaged = || Failure::data("its parts do not fit together; give a state that was not edited");
        let set = |option: &str| state.set(option).ok_or_else(damaged);
        let Some(first) = state.trackers.first() else { return Err(damaged()) };
        let count = first.orders().inputs();
        let joined = set("--input")?;
        let written: Vec<String> = match count {
            0 => Vec::new(),
            1 => vec![joined.to_owned()],
            _ => joined.split(',').map(str::to_owned).collect(),
        };
        let inputs = match inputs {
            Some(inputs) if inputs.join(",") == joined => inputs,
            Some(_) => return Err(Failure::data(format!("the inputs of this state are {joined}"))),
            None => written,
        };
        if inputs.len() != count {
            return Err(Failure::data(format!(
                "the names of its inputs hold commas: {joined}; say which they are"
            )));
        }
        let alike = |tracker: &Tracker| {
            tracker.orders() == first.orders()
                && tracker.coupled_outputs() == first.coupled_outputs()
                && tracker.map() == first.map()
                && tracker.names() == first.names()
                && tracker.score().samples() <= state.rows
        };
        let every = set("--every")?.parse().ok().filter(|&every: &u64| every > 0).ok_or_else(damaged)?;
        let horizon = match set("--horizon")? {
            "" => None,
            rows => Some(rows.parse().ok().filter(|rows| (1..=10_000).contains(rows)).ok_or_else(damaged)?),
        };
        let format = match set("--format")? {
            "jsonl" => Format::JsonLines,
            "csv" => Format::Csv,
            _ => return Err(damaged()),
        };
        if !state.trackers.iter().all(alike) {
            return Err(damaged());
        }
        let columns = Columns::new(!set("--time")?.is_empty(), horizon, &state.outputs, &state.trackers);
        let outputs = match &state.outputs[..] {
            [] => vec![set("--output")?.to_owned()],
            several if several.join(",") == set("--output")? => several.to_vec(),
            _ => return Err(damaged()),
        };
        let lines = LineWriter::counting(format, columns.names(), Some(state.written.clone()));
        Ok(Self::of(inputs, outputs, every, horizon, columns, state, lines))
    }

    /// Takes rows as long as there are some: `next` gives their values, the inputs and then the outputs, their time,
    /// and whether an unknown number of rows is missing before them; `seen` is told what each tracker made of each row.
    /// After a failure nothing has changed.
    ///
    /// `clock` is what the first rows of all say of theirs: the column of times, which is empty without one, and the
    /// first time as it is written if times are dates.
    ///
    /// # Errors
    /// What `next` says; a [`Failure`] if a value is infinite.
    pub fn rows<'a, E: From<Failure>>(
        &mut self,
        clock: Option<(&str, Option<String>)>,
        mut next: impl FnMut() -> Result<Option<(&'a [f64], Option<f64>, bool)>, E>,
        mut seen: impl FnMut(&TrackedRow<'_>),
        stop_on_alarm: bool,
    ) -> Result<(), E> {
        self.lines.flush()?;
        let kept = (self.state.clone(), self.lines.written());
        if let Some((name, start)) = clock.filter(|_| self.state.rows == 0) {
            self.state.name_clock(name, start);
            self.set_columns(None);
        }
        let done = self.take(&mut next, &mut seen, stop_on_alarm);
        if done.is_err() {
            self.state = kept.0;
            self.set_columns(Some(kept.1));
        }
        done
    }

    /// Takes one row, as [`rows`](Self::rows) takes many, without a copy of where it stood: its values are checked
    /// before anything changes.
    ///
    /// # Errors
    /// A [`Failure`] if a value is infinite.
    pub fn row(
        &mut self,
        clock: &str,
        values: &[f64],
        time: Option<f64>,
        mut seen: impl FnMut(&TrackedRow<'_>),
    ) -> Result<(), Failure> {
        let mut named = self.inputs.iter().chain(&self.outputs).zip(values);
        if let Some((name, _)) = named.find(|(_, value)| value.is_infinite()) {
            return Err(Failure::data(format!("'{name}' is infinite; NaN is a missing sample")));
        }
        if self.state.rows == 0 {
            self.state.name_clock(clock, None);
            self.set_columns(None);
        }
        let mut next = Some((values, time, false));
        self.take(&mut || Ok::<_, Failure>(next.take()), &mut seen, false)
    }

    /// The columns of the lines, which depend on whether there is a clock; they go on after what was written.
    fn set_columns(&mut self, written: Option<Written>) {
        self.columns =
            Columns::new(self.clock().is_some(), self.horizon, &self.state.outputs, &self.state.trackers);
        self.lines = LineWriter::counting(self.lines.format(), self.columns.names(), written);
    }

    fn take<'a, E: From<Failure>>(
        &mut self,
        next: &mut impl FnMut() -> Result<Option<(&'a [f64], Option<f64>, bool)>, E>,
        seen: &mut impl FnMut(&TrackedRow<'_>),
        stop_on_alarm: bool,
    ) -> Result<(), E> {
        let Self { every, columns, state, lines, memory, .. } = self;
        let mut count = 0_usize;
        while let Some((values, time, after_gap)) = next()? {
            let row = Row { values, time, malformed: false, has_clock: time.is_some(), after_gap };
            let mut session =
                Session { every: *every, details: true, columns, state: &mut *state, lines, memory };
            let alarm = session.row(
                &row,
                || format!("row {count}"),
                |one| {
                    seen(&TrackedRow {
                        index: one.index,
                        tracker: one.tracker,
                        tracked: one.tracked,
                        action: one.action,
                        standard_errors: one.standard_errors,
                        forecast: one.forecast,
                    });
                },
            )?;
            count += 1;
            if alarm && stop_on_alarm {
                break;
            }
        }
        Ok(())
    }

    /// Tells that an unknown number of rows is missing here, of a log without a clock.
    ///
    /// # Errors
    /// A [`Failure`] if the line about it cannot be counted.
    pub fn gap(&mut self) -> Result<(), Failure> {
        let Self { columns, state, lines, .. } = self;
        state.trackers.iter_mut().for_each(Tracker::gap);
        state.gaps = state.gaps.saturating_add(1);
        columns.gap(lines, state.rows.saturating_add(1), None)
    }

    /// The state, as `thetahat track --state` writes it.
    ///
    /// # Errors
    /// A [`Failure`] if it cannot be written as JSON.
    pub fn state(&mut self) -> Result<String, Failure> {
        self.lines.flush()?;
        self.state.written = self.lines.written();
        self.state.to_json()
    }

    /// The document that `thetahat track --summary` writes.
    pub fn summary(&self) -> TrackSummary {
        self.state.summary()
    }

    /// How many rows were taken.
    pub fn count(&self) -> u64 {
        self.state.rows
    }

    /// The trackers: for each way to forget one for each output.
    pub fn trackers(&self) -> &[Tracker] {
        &self.state.trackers
    }

    /// The prediction this many steps ahead of each, see [`forecasts`].
    ///
    /// # Errors
    /// A [`Failure`] if the steps are out of their range.
    pub fn forecast(&mut self, steps: usize) -> Result<Vec<f64>, Failure> {
        let models = self.state.trackers.chunks_mut(self.outputs.len().max(1));
        let each = models.map(|trackers| forecasts(trackers, steps));
        each.collect::<Result<Vec<_>, _>>()
            .map(|models| models.concat())
            .map_err(|error| Failure::option(&error))
    }

    /// The predictions of the next rows of each, a row for each step, see [`predictions`].
    ///
    /// # Errors
    /// A [`Failure`] if the steps are out of their range, or the inputs not as many.
    pub fn predict(&mut self, future: Option<&[f64]>, steps: usize) -> Result<Vec<Vec<f64>>, Failure> {
        let count = self.outputs.len().max(1);
        let mut rows = vec![Vec::with_capacity(self.state.trackers.len()); steps];
        for trackers in self.state.trackers.chunks_mut(count) {
            let found = predictions(trackers, future, steps).map_err(|error| Failure::option(&error))?;
            for (row, found) in rows.iter_mut().zip(found.chunks_exact(count)) {
                row.extend_from_slice(found);
            }
        }
        Ok(rows)
    }

    /// The input channels.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// The output channels.
    pub fn outputs(&self) -> &[String] {
        &self.outputs
    }

    /// The column of times; none if rows have none, or there was none yet that says.
    pub fn clock(&self) -> Option<&str> {
        self.state.set("--time").filter(|name| !name.is_empty())
    }

    /// The first time as it is written, if times are dates.
    pub fn start(&self) -> Option<&str> {
        self.state.start.as_deref()
    }

    /// The latest time.
    pub fn last_time(&self) -> Option<f64> {
        self.state.pace.last()
    }

    /// How many rows ahead a forecast is, if one was asked for.
    pub fn horizon(&self) -> Option<usize> {
        self.horizon
    }
}
