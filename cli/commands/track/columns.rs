//! The lines of `track`.

use thetahat::thetahat_core::Alarm;
use thetahat::track::{Tracked, Tracker};

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
}

impl Columns {
    /// Those of a log that may have a clock, with a forecast this many rows ahead if one was asked for.
    pub(super) fn new(has_time: bool, horizon: Option<usize>, trackers: &[Tracker]) -> Self {
        let parameters = trackers.first().map_or(&[][..], Tracker::names);
        let policies: Vec<String> = match trackers {
            [_] => Vec::new(),
            several => several.iter().map(|tracker| tracker.plan().forgetting.to_string()).collect(),
        };
        let mut names: Vec<String> = vec!["event".to_owned(), "row".to_owned()];
        names.extend(has_time.then(|| "time".to_owned()));
        names.extend((!policies.is_empty()).then(|| "forgetting".to_owned()));
        names.extend(FIGURES.map(str::to_owned));
        names.extend(horizon.map(|_| "forecast".to_owned()));
        names.extend(parameters.iter().cloned());
        names.extend(parameters.iter().map(|name| format!("{name}_se")));
        if trackers.first().is_some_and(|tracker| tracker.detector().is_some()) {
            names.extend(ALARM.map(str::to_owned));
        }
        Self { names, has_time, policies, horizon, parameters: parameters.len() }
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// A line about a sample, with the standard errors of the parameters; gives the forecast, if there is one.
    pub(super) fn sample(
        &self,
        lines: &mut LineWriter,
        sample: &Sample,
        tracker: &mut Tracker,
        deviations: &mut [f64],
    ) -> Result<Option<f64>, Failure> {
        let Sample { row, time, index, action, output, tracked } = sample;
        tracker.write_standard_errors(deviations).map_err(|error| Failure::data(error.to_string()))?;
        let forecast = self.horizon.map(|rows| tracker.forecast(rows)).transpose();
        let forecast = forecast.map_err(|error| Failure::option(&error))?;
        lines.add(|cells| {
            self.head(cells, "sample", *row, *time, Some(*index));
            cells.word(action);
            cells.number(*output);
            cells.number(tracked.predicted);
            cells.number(tracked.error);
            cells.number(tracked.variance.sqrt());
            cells.number(if tracked.variance.is_finite() { tracked.nis } else { f64::NAN });
            cells.number(tracked.excitation);
            forecast.into_iter().for_each(|forecast| cells.number(forecast));
            match tracker.parameters() {
                Some(parameters) => parameters.iter().for_each(|&value| cells.number(value)),
                None => (0..self.parameters).for_each(|_| cells.number(f64::NAN)),
            }
            deviations.iter().for_each(|&value| cells.number(value));
        })?;
        Ok(forecast)
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
        if self.policies.is_empty() {
            return;
        }
        match index.and_then(|index| self.policies.get(index)) {
            Some(policy) => cells.word(policy),
            None => cells.skip(1),
        }
    }
}
