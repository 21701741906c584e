//! A row after another through the trackers, wherever they come from.

use thetahat::track::{Tracked, Tracker};

use super::columns::{Columns, Sample};
use super::pace::Step;
use super::state::State;
use crate::failure::Failure;
use crate::line_writer::LineWriter;

/// What rows go through: the state, and the lines about it.
pub(super) struct Session<'a> {
    /// A line for each row of which the number is a multiple of this.
    pub(super) every: u64,
    /// Whether what a line has is wanted of rows without a line too.
    pub(super) details: bool,
    pub(super) columns: &'a Columns,
    pub(super) state: &'a mut State,
    pub(super) lines: &'a mut LineWriter,
    pub(super) memory: &'a mut Memory,
}

/// What a row needs memory for: what each tracker of a model made of it, and the standard errors of one.
pub(super) struct Memory {
    tracked: Vec<Tracked>,
    pub(super) deviations: Vec<f64>,
}

impl Memory {
    pub(super) fn of(trackers: &[Tracker]) -> Self {
        let parameters = trackers.first().map_or(0, |tracker| tracker.names().len());
        Self { tracked: Vec::with_capacity(trackers.len()), deviations: vec![f64::NAN; parameters] }
    }
}

/// A row.
pub(super) struct Row<'a> {
    /// The inputs, then the outputs.
    pub(super) values: &'a [f64],
    pub(super) time: Option<f64>,
    /// Whether it is a malformed line.
    pub(super) malformed: bool,
    pub(super) has_clock: bool,
    /// Whether an unknown number of rows is missing before it.
    pub(super) after_gap: bool,
}

/// What became of a row in one of the trackers.
pub(super) struct Seen<'a> {
    /// Which tracker it is about.
    pub(super) index: usize,
    pub(super) tracker: &'a Tracker,
    pub(super) tracked: Tracked,
    /// What was done, in a word.
    pub(super) action: &'static str,
    /// The standard errors of the parameters and the forecast, where the row has a line or details are wanted.
    pub(super) standard_errors: &'a [f64],
    pub(super) forecast: Option<f64>,
}

impl Session<'_> {
    /// Takes in a row, of which `place_of` says where it is; says whether there was an alarm. `seen` is told what each
    /// tracker made of it.
    pub(super) fn row(
        &mut self,
        row: &Row<'_>,
        place_of: impl Fn() -> String,
        mut seen: impl FnMut(&Seen<'_>),
    ) -> Result<bool, Failure> {
        let Self { every, details, columns, state, lines, memory } = self;
        let Row { values, time, malformed, has_clock, after_gap } = *row;
        state.rows = state.rows.saturating_add(1);
        let row = state.rows;
        let step = time.map_or(Step::Regular, |time| state.pace.step(time));
        if after_gap || step != Step::Regular {
            state.trackers.iter_mut().for_each(Tracker::gap);
            state.gaps = state.gaps.saturating_add(1);
            columns.gap(lines, row, time)?;
        }
        state.remember(values, time);
        // With a clock the next time tells what is missing.
        if malformed && has_clock {
            return Ok(false);
        }
        let count = state.outputs.len().max(1);
        let Some((inputs, outputs)) = values.split_at_checked(values.len().saturating_sub(count)) else {
            return Ok(false);
        };
        let Memory { tracked, deviations } = &mut **memory;
        let mut any = false;
        for (policy, trackers) in state.trackers.chunks_mut(count).enumerate() {
            tracked.clear();
            for (place, tracker) in trackers.iter_mut().enumerate() {
                let taken = tracker.log_row_of(place, outputs, inputs);
                tracked.push(taken.map_err(|error| Failure::data(format!("{}: {error}", place_of())))?);
            }
            let written = row.is_multiple_of(*every);
            let detailed = written || *details;
            let forecasts = if detailed { columns.forecasts(trackers)? } else { None };
            for (place, (tracker, &tracked)) in trackers.iter().zip(&*tracked).enumerate() {
                let index = policy * count + place;
                let action = match (malformed, tracked.too_large) {
                    (true, _) => "malformed",
                    (_, true) => "too large",
                    _ => tracked.action.word(),
                };
                let forecast = forecasts.as_ref().and_then(|forecasts| forecasts.get(place)).copied();
                if detailed {
                    let known = tracker.write_standard_errors(deviations);
                    known.map_err(|error| Failure::data(error.to_string()))?;
                }
                if written {
                    let output = outputs[place];
                    let sample = Sample { row, time, index, action, output, tracked, forecast };
                    columns.sample(lines, &sample, tracker, deviations)?;
                }
                seen(&Seen { index, tracker, tracked, action, standard_errors: deviations, forecast });
                if let Some(alarm) = tracked.alarm {
                    any = true;
                    if let Some(alarms) = state.alarms.get_mut(index) {
                        *alarms = alarms.saturating_add(1);
                    }
                    columns.alarm(lines, row, time, index, &alarm)?;
                }
            }
        }
        Ok(any)
    }
}
