//! The lines of `track`.

use thetahat::thetahat_core::Alarm;
use thetahat::track::{Tracked, Tracker, forecasts};

use crate::failure::Failure;
use crate::line_writer::{Cells, LineWriter};

/// What stands in front of the parameters of each sample.
const FIGURES: [&str; 7] =
    ["action", "measured", "predicted", "innovation", "innovation_sd", "nis", "excitation"];
/// What an alarm has.
const ALARM: [&str; 3] = ["chart", "statistic", "samples"];

/// The columns of a run: which of them there are depends on what was asked for.
pub(super) struct Columns {
    names: Vec<String>,
    has_time: bool,
    /// The policies, where there are several.
    policies: Vec<String>,
    /// The outputs, where there are several.
    outputs: Vec<String>,
    horizon: Option<usize>,
    parameters: usize,
}

/// A sample and what became of it.
pub(super) struct Sample {
    pub(super) row: u64,
    pub(super) time: Option<f64>,
    /// Which tracker it is about.
    pub(super) index: usize,
    pub(super) action: &'static str,
    pub(super) output: f64,
    pub(super) tracked: Tracked,
    /// The output as many rows later as was asked for.
    pub(super) forecast: Option<f64>,
}

impl Columns {
    /// Those of a log that may have a clock, with a forecast this many rows ahead if one was asked for. Several outputs
    /// are named.
    pub(super) fn new(
        has_time: bool,
        horizon: Option<usize>,
        outputs: &[String],
        trackers: &[Tracker],
    ) -> Self {
        let parameters = trackers.first().map_or(&[][..], Tracker::names);
        let mut policies: Vec<String> = trackers
            .iter()
            .step_by(outputs.len().max(1))
            .map(|tracker| tracker.plan().forgetting.to_string())
            .collect();
        if policies.len() == 1 {
            policies.clear();
        }
        let mut names: Vec<String> = vec!["event".to_owned(), "row".to_owned()];
        names.extend(has_time.then(|| "time".to_owned()));
        names.extend((!policies.is_empty()).then(|| "forgetting".to_owned()));
        names.extend((!outputs.is_empty()).then(|| "output".to_owned()));
        names.extend(FIGURES.map(str::to_owned));
        names.extend(horizon.map(|_| "forecast".to_owned()));
        names.extend(parameters.iter().cloned());
        names.extend(parameters.iter().map(|name| format!("{name}_se")));
        if trackers.first().is_some_and(|tracker| tracker.detector().is_some()) {
            names.extend(ALARM.map(str::to_owned));
        }
        Self { names, has_time, policies, outputs: outputs.to_vec(), horizon, parameters: parameters.len() }
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The forecasts of all outputs of a model, if they were asked for.
    pub(super) fn forecasts(&self, trackers: &mut [Tracker]) -> Result<Option<Vec<f64>>, Failure> {
        let found = self.horizon.map(|rows| forecasts(trackers, rows)).transpose();
        found.map_err(|error| Failure::option(&error))
    }

    /// A line about a sample, with the standard errors of the parameters.
    pub(super) fn sample(
        &self,
        lines: &mut LineWriter,
        sample: &Sample,
        tracker: &Tracker,
        deviations: &[f64],
    ) -> Result<(), Failure> {
        let Sample { row, time, index, action, output, tracked, forecast } = sample;
        lines.add(|cells| {
            self.head(cells, "sample", *row, *time, Some(*index));
            cells.word(action);
            cells.number(*output);
            cells.number(tracked.predicted);
            cells.number(tracked.error);
            cells.number(tracked.variance.sqrt());
            cells.number(if tracked.variance.is_finite() { tracked.nis } else { f64::NAN });
            cells.number(tracked.excitation);
            forecast.iter().for_each(|&forecast| cells.number(forecast));
            match tracker.parameters() {
                Some(parameters) => parameters.iter().for_each(|&value| cells.number(value)),
                None => (0..self.parameters).for_each(|_| cells.number(f64::NAN)),
            }
            deviations.iter().for_each(|&value| cells.number(value));
        })
    }

    /// A line about an alarm.
    pub(super) fn alarm(
        &self,
        lines: &mut LineWriter,
        row: u64,
        time: Option<f64>,
        index: usize,
        alarm: &Alarm<f64>,
    ) -> Result<(), Failure> {
        lines.add(|cells| {
            self.head(cells, "alarm", row, time, Some(index));
            cells.skip(FIGURES.len() + usize::from(self.horizon.is_some()) + 2 * self.parameters);
            cells.word(alarm.chart.word());
            cells.number(alarm.statistic);
            cells.count(alarm.samples.into());
        })
    }

    /// A line about a gap before a row.
    pub(super) fn gap(&self, lines: &mut LineWriter, row: u64, time: Option<f64>) -> Result<(), Failure> {
        lines.add(|cells| self.head(cells, "gap", row, time, None))
    }

    /// What every line starts with.
    fn head(&self, cells: &mut Cells<'_>, event: &str, row: u64, time: Option<f64>, index: Option<usize>) {
        cells.word(event);
        cells.count(row);
        if self.has_time {
            cells.number(time.unwrap_or(f64::NAN));
        }
        let outputs = self.outputs.len().max(1);
        let named = [
            (&self.policies, index.and_then(|index| self.policies.get(index / outputs))),
            (&self.outputs, index.and_then(|index| self.outputs.get(index % outputs))),
        ];
        for (names, name) in named {
            match name {
                Some(name) => cells.word(name),
                None => cells.skip(usize::from(!names.is_empty())),
            }
        }
    }
}
