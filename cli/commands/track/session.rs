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
    pub(super) columns: &'a Columns,
    pub(super) state: &'a mut State,
    pub(super) lines: &'a mut LineWriter,
    /// Memory for standard errors.
    pub(super) deviations: &'a mut [f64],
}

/// A row.
pub(super) struct Row<'a> {
    /// The inputs, then the output.
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
    /// The standard errors of the parameters and the forecast, where the row has a line.
    pub(super) line: Option<(&'a [f64], Option<f64>)>,
}

impl Session<'_> {
    /// Takes in a row, of which `place` says where it is; says whether there was an alarm. `seen` is told what each tracker made
    /// of it.
    pub(super) fn row(
        &mut self,
        row: &Row<'_>,
        place: impl Fn() -> String,
        mut seen: impl FnMut(&Seen<'_>),
    ) -> Result<bool, Failure> {
        let Self { every, columns, state, lines, deviations } = self;
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
        let Some((&output, inputs)) = values.split_last() else { return Ok(false) };
        let mut any = false;
        for (index, (tracker, alarms)) in state.trackers.iter_mut().zip(&mut state.alarms).enumerate() {
            let tracked = tracker
                .log_row(output, inputs)
                .map_err(|error| Failure::data(format!("{}: {error}", place())))?;
            let action = match (malformed, tracked.too_large) {
                (true, _) => "malformed",
                (_, true) => "too large",
                _ => tracked.action.word(),
            };
            let mut line = None;
            if row.is_multiple_of(*every) {
                let sample = Sample { row, time, index, action, output, tracked };
                let forecast = columns.sample(lines, &sample, tracker, deviations)?;
                line = Some((&**deviations, forecast));
            }
            seen(&Seen { index, tracker, tracked, action, line });
            if let Some(alarm) = tracked.alarm {
                any = true;
                *alarms = alarms.saturating_add(1);
                columns.alarm(lines, row, time, index, &alarm)?;
            }
        }
        Ok(any)
    }
}
