//! The state of a run, kept in a file: a run that was ended, even in the middle of a row, goes on from it.

use std::path::Path;

use serde::{Deserialize, Serialize};
use thetahat::text;
use thetahat::track::{PerChannel, TrackSummary, Tracker, TrackerSummary};

use super::channels::Channels;
use super::pace::Pace;
use crate::args::ResumeArgument;
use crate::failure::Failure;
use crate::job::TrackJob;
use crate::line_writer::{Format, Written};
use crate::live::Live;
use crate::replace::Held;

/// The version that this program writes.
const SCHEMA: &str = "thetahat.track-state/1";

/// All that a run must know to go on as if it had never ended.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct State {
    schema: String,
    generator: String,
    /// What must be the same when it goes on: the option that says it, and its value.
    setting: Vec<(String, String)>,
    /// The rows that were absorbed.
    pub(super) rows: u64,
    /// The output that belongs to them.
    pub(super) written: Written,
    /// The first and the last of the rows, the time in front: what a log is known by. A missing value is null.
    first: Vec<Option<f64>>,
    last: Vec<Option<f64>>,
    /// The first time as it is written, if times are dates.
    pub(super) start: Option<String>,
    pub(super) pace: Pace,
    pub(super) gaps: u64,
    /// The names of several outputs, for each of which a policy has a tracker; empty if there is one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) outputs: Vec<String>,
    /// How many alarms each tracker gave.
    pub(super) alarms: Vec<u64>,
    pub(super) trackers: Vec<Tracker>,
}

impl State {
    pub(super) fn new(
        setting: Vec<(String, String)>,
        outputs: &[String],
        trackers: Vec<Tracker>,
        start: Option<String>,
        sample_time: Option<f64>,
    ) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            generator: format!("thetahat {}", env!("CARGO_PKG_VERSION")),
            setting,
            rows: 0,
            written: Written::default(),
            first: Vec::new(),
            last: Vec::new(),
            start,
            pace: Pace::new(sample_time),
            gaps: 0,
            outputs: if outputs.len() > 1 { outputs.to_vec() } else { Vec::new() },
            alarms: vec![0; trackers.len()],
            trackers,
        }
    }

    /// Reads a state; none if there is no file yet.
    pub(super) fn read(file: &mut Held, path: &Path) -> Result<Option<Self>, Failure> {
        let Some(bytes) = file.read()? else { return Ok(None) };
        Self::parse(&bytes)
            .map(Some)
            .map_err(|message| Failure::data(format!("{}: {message}", path.display())))
    }

    /// Reads a state; an error is a message.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Head {
            schema: String,
        }
        let malformed = |error: serde_json::Error| {
            format!(
                "this is no state of thetahat track: {error}; name another file, or remove it to start anew"
            )
        };
        let head: Head = serde_json::from_slice(bytes).map_err(malformed)?;
        if head.schema != SCHEMA {
            return Err(format!(
                "this state is of version '{}', this program reads '{SCHEMA}'; remove it to start anew, or use the \
                 program that wrote it",
                text::brief(&head.schema, 40)
            ));
        }
        let state: Self = serde_json::from_slice(bytes).map_err(malformed)?;
        if !state.is_sound() {
            return Err("its parts do not fit together; remove it to start anew".to_owned());
        }
        Ok(state)
    }

    /// Whether its own parts fit together, as they do if nobody has edited it. The trackers are compared with new ones.
    fn is_sound(&self) -> bool {
        let Self { rows, written, first, last, pace, gaps, outputs, alarms, trackers, .. } = self;
        let count = outputs.len().max(1);
        !trackers.is_empty()
            && trackers.len() == alarms.len()
            && outputs.len() != 1
            && trackers.len().is_multiple_of(count)
            && trackers.iter().all(|tracker| [0, outputs.len()].contains(&tracker.coupled_outputs()))
            && alarms.iter().all(|alarms| alarms <= rows)
            && gaps <= rows
            && first.len() == last.len()
            && (*rows == 0) == first.is_empty()
            && written.is_sound()
            && pace.is_sound()
    }

    /// This state, if it is of the same model and options.
    pub(super) fn checked(
        self,
        setting: &[(String, String)],
        trackers: &[Tracker],
        job: &TrackJob,
    ) -> Result<Self, Failure> {
        let path = job.state.as_ref().map_or_else(String::new, |state| state.path.display().to_string());
        for (option, now) in setting {
            let before = self.set(option);
            if before != Some(now.as_str()) {
                return Err(Failure::data(format!(
                    "{path}: this state is of another model or run: {option} was '{}' and is '{now}' now; give what it was, or \
                     another --state",
                    before.unwrap_or_default()
                )));
            }
        }
        let fits = |(mine, new): (&Tracker, &Tracker)| {
            mine.orders() == new.orders()
                && mine.coupled_outputs() == new.coupled_outputs()
                && mine.map() == new.map()
                && mine.names() == new.names()
                && mine.plan() == new.plan()
                && mine.score().samples() <= self.rows
        };
        if self.trackers.len() != trackers.len() || !self.trackers.iter().zip(trackers).all(fits) {
            return Err(Failure::data(format!(
                "{path}: its parts do not fit together or to this command line; give the options of the run that wrote it, or \
                 remove it to start anew"
            )));
        }
        Ok(self)
    }

    /// Writes it: the file holds the old state or this one, whatever happens.
    pub(super) fn write(&self, file: &mut Held) -> Result<(), Failure> {
        file.write(self.to_json()?.as_bytes())
    }

    /// The document.
    pub(super) fn to_json(&self) -> Result<String, Failure> {
        let json = serde_json::to_string(self).map_err(|error| Failure::data(error.to_string()))?;
        Ok(json + "\n")
    }

    /// What the setting says of an option.
    pub(super) fn set(&self, option: &str) -> Option<&str> {
        self.setting.iter().find(|(other, _)| other == option).map(|(_, value)| value.as_str())
    }

    /// Names the clock, before the first row: the column of times, and the first one as it is written if times are
    /// dates.
    pub(super) fn name_clock(&mut self, name: &str, start: Option<String>) {
        if let Some((_, value)) = self.setting.iter_mut().find(|(option, _)| option == "--time") {
            name.clone_into(value);
        }
        self.start = start;
    }

    /// What the trackers have come to.
    pub(super) fn summary(&self) -> TrackSummary {
        let outputs = self.outputs.iter().map(Some).cycle();
        let outputs = outputs.chain(std::iter::repeat(None));
        let trackers =
            self.trackers.iter().zip(&self.alarms).zip(outputs).map(|((tracker, &alarms), output)| {
                TrackerSummary { output: output.cloned(), ..tracker.summary(alarms) }
            });
        TrackSummary::new(self.rows, self.gaps, trackers.collect())
    }

    /// Keeps what the row that was just absorbed is known by.
    pub(super) fn remember(&mut self, values: &[f64], time: Option<f64>) {
        if self.first.is_empty() {
            self.first = print(values, time).collect();
        }
        self.last.clear();
        self.last.extend(print(values, time));
    }
}

/// What a row is known by.
fn print(values: &[f64], time: Option<f64>) -> impl Iterator<Item = Option<f64>> {
    [time].into_iter().chain(values.iter().map(|value| Some(*value).filter(|value| value.is_finite())))
}

/// What the lines of a run have in common.
pub(super) struct Lines<'a> {
    /// The column of times; empty without one.
    pub(super) time: &'a str,
    /// How many rows ahead a forecast is.
    pub(super) horizon: Option<usize>,
    /// A line for each row of which the number is a multiple of this.
    pub(super) every: u64,
    pub(super) format: Format,
}

/// What must be the same when a run goes on.
pub(super) fn setting(lines: &Lines<'_>, channels: &Channels, trackers: &[Tracker]) -> Vec<(String, String)> {
    let mut setting = vec![
        ("--input".to_owned(), channels.inputs.join(",")),
        ("--output".to_owned(), channels.outputs.join(",")),
    ];
    let mut add = |option: &str, value: String| setting.push((option.to_owned(), value));
    add("--time", lines.time.to_owned());
    if let Some(tracker) = trackers.first() {
        let plan = tracker.plan();
        add("the model", tracker.model());
        add("--constant", plan.constant.to_string());
        add("--method", plan.method.to_string());
        add("--start", plan.start.to_string());
        add("--horizon", lines.horizon.map_or_else(String::new, |rows| rows.to_string()));
        add("--dead-zone", plan.dead_zone.to_string());
        add("--outliers", plan.outliers.to_string());
        let several = trackers.get(..channels.outputs.len()).unwrap_or_default();
        let each =
            |numbers: &dyn Fn(&Tracker) -> String| several.iter().map(numbers).collect::<Vec<_>>().join(";");
        add("--offset", each(&|tracker| numbers(Some(tracker.offsets()))));
        add("--scale", each(&|tracker| numbers(tracker.plan().scales.as_ref())));
        add("--alarm", plan.alarm_interval.map_or_else(String::new, |interval| interval.to_string()));
    }
    let policies: Vec<String> =
        trackers.iter().map(|tracker| tracker.plan().forgetting.to_string()).collect();
    add("--forgetting", policies.join(","));
    add("--every", lines.every.to_string());
    let format = match lines.format {
        Format::JsonLines => "jsonl",
        Format::Csv => "csv",
    };
    add("--format", format.to_owned());
    setting
}

/// The numbers of all channels, the output's last.
fn numbers(values: Option<&PerChannel>) -> String {
    let all = values.iter().flat_map(|values| values.inputs.iter().chain([&values.output]));
    all.map(f64::to_string).collect::<Vec<_>>().join(",")
}

/// Where a log stands against the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// The next row is new.
    There,
    /// The first row tells whether the log starts over.
    Unknown,
    /// At its start: the rows that were absorbed are skipped.
    After,
    /// Beyond a hole.
    Beyond,
}

impl Place {
    pub(super) fn resumed(resume: ResumeArgument, path: &Path) -> Self {
        match resume {
            ResumeArgument::Start => Self::After,
            ResumeArgument::Now => Self::Beyond,
            ResumeArgument::Auto if path == Path::new("-") => Self::Unknown,
            ResumeArgument::Auto => Self::After,
        }
    }

    /// What the row at hand is to the state.
    pub(super) fn of_row(&mut self, state: &State, live: &Live) -> Result<RowPlace, Failure> {
        let is = |known: &[Option<f64>]| print(live.values(), live.time()).eq(known.iter().copied());
        if *self == Self::Unknown {
            *self = if is(&state.first) { Self::After } else { Self::Beyond };
        }
        match self {
            Self::After if state.rows > 0 => {
                let row = live.row();
                if row == 1 && !is(&state.first) || row == state.rows && !is(&state.last) {
                    return Err(Failure::data(format!(
                        "{}: this is not row {row} of the log that the state is of; give that log, say --resume now \
                         if this is a pipe that has moved on, or remove the state to start anew",
                        live.place()
                    )));
                }
                if row == state.rows {
                    *self = Self::There;
                }
                Ok(RowPlace::Old)
            }
            Self::Beyond => {
                let clock = live.time().zip(state.pace.last());
                // What came before the last row was absorbed already.
                if clock.is_some_and(|(time, last)| time <= last) {
                    return Ok(RowPlace::Old);
                }
                *self = Self::There;
                // The clock tells whether there is a hole.
                Ok(if clock.is_some() || state.rows == 0 { RowPlace::Next } else { RowPlace::AfterGap })
            }
            _ => {
                *self = Self::There;
                Ok(RowPlace::Next)
            }
        }
    }

    /// That the log did not end before the rows that were absorbed.
    pub(super) fn check_end(self, state: &State, file: &str) -> Result<(), Failure> {
        if let (Self::Beyond, Some(last)) = (self, state.pace.last()) {
            return Err(Failure::data(format!(
                "{file}: no row is later than {last} s, the last time of the state; if that was wrong, remove the state to \
                 start anew"
            )));
        }
        if self == Self::After && state.rows > 0 {
            return Err(Failure::data(format!(
                "{file}: it ends before row {}, the last one that the state has absorbed; give the log that the state is of",
                state.rows
            )));
        }
        Ok(())
    }
}

/// What a row is to a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RowPlace {
    /// It was absorbed already.
    Old,
    /// It follows the last one.
    Next,
    /// Between it and the last one an unknown number is missing.
    AfterGap,
}
