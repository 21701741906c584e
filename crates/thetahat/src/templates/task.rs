//! A log as a starting procedure sees it.

use super::{Columns, Template};
use crate::Error;
use crate::data::{Log, Rows, inside};
use crate::text::{brief, suggestion};

/// What a starting procedure works on.
pub(super) struct Task<'a> {
    pub(super) template: &'a Template,
    pub(super) log: &'a Log,
    columns: &'a Columns,
    pub(super) known: &'a [(String, f64)],
    /// The rows that it may use.
    pub(super) rows: Vec<Rows>,
    /// A run for each experiment.
    pub(super) runs: Vec<Run>,
    /// The usual time from row to row.
    pub(super) step: f64,
}

/// The rows of one experiment.
pub(super) struct Run {
    /// Seconds since its first row.
    pub(super) time: Vec<f64>,
    /// The values of each column of the template, missing ones by straight lines; empty for a column that is not there.
    pub(super) values: Vec<Vec<f64>>,
}

impl<'a> Task<'a> {
    pub(super) fn new(
        template: &'a Template,
        log: &'a Log,
        columns: &'a Columns,
        known: &'a [(String, f64)],
        rows: &[Rows],
    ) -> Result<Self, Error> {
        for (name, value) in known {
            let settings = template.settings.iter().map(|setting| setting.name);
            let names: Vec<&str> =
                settings.chain(template.parameters.iter().map(|(name, _)| *name)).collect();
            // What a log decides how many of there are ends with an ellipsis.
            let is_one = |own: &&str| own.strip_suffix('…').map_or(*own == name, |own| name.starts_with(own));
            let is_noise = name.starts_with("process.") || name.starts_with("measurement.");
            if !is_noise && !names.iter().any(is_one) {
                let near = suggestion(name, names.iter().copied());
                let message = format!(
                    "{} has no '{}'{near}; it has {}",
                    template.name,
                    brief(name, 40),
                    names.join(", ")
                );
                return Err(Error::argument("known", message));
            }
            if !value.is_finite() {
                return Err(Error::argument("known", format!("{name} is {value}; give a finite number")));
            }
        }
        let all = Rows::new(1, log.rows())?;
        let rows = if rows.is_empty() { vec![all] } else { rows.to_vec() };
        let mut runs = Vec::new();
        for part in log.logs() {
            let asked = inside(&rows, &part);
            let Some((first, last)) = asked.first().zip(asked.last()) else { continue };
            let whole = part.start + first.start..part.start + last.end;
            let time: Vec<f64> = match log.time() {
                Some(time) => time[whole.clone()].iter().map(|seconds| seconds - time[whole.start]).collect(),
                None => (0..whole.len()).map(|row| row as f64 * log.sample_time()).collect(),
            };
            let mut values = Vec::new();
            for place in 0..template.columns.len() {
                let Some(name) = columns.name(place) else {
                    values.push(Vec::new());
                    continue;
                };
                let mut own = log.channel(name)?.values[whole.clone()].to_vec();
                if !filled(&time, &mut own) {
                    return Err(Error::in_channel(
                        name,
                        None,
                        format!("column '{name}' has no values in these rows"),
                    ));
                }
                values.push(own);
            }
            runs.push(Run { time, values });
        }
        let mut steps: Vec<f64> =
            runs.iter().flat_map(|run| run.time.windows(2).map(|pair| pair[1] - pair[0])).collect();
        steps.sort_by(f64::total_cmp);
        let step = steps.get(steps.len() / 2).copied().filter(|step| *step > 0.0 && step.is_finite());
        let Some(step) = step else {
            return Err(Error::data(format!(
                "{} needs a log of some rows, with a clock that rises",
                template.name
            )));
        };
        let rounded: f64 = format!("{step:.6e}").parse().unwrap_or(step);
        Ok(Self { template, log, columns, known, rows, runs, step: rounded })
    }

    /// Whether the log has the template's column at this place.
    pub(super) fn has(&self, column: usize) -> bool {
        self.columns.name(column).is_some()
    }

    /// What the log calls it.
    pub(super) fn channel(&self, column: usize) -> &str {
        self.columns.name(column).unwrap_or_default()
    }

    /// What is known of a setting or a parameter.
    pub(super) fn known(&self, name: &str) -> Option<f64> {
        self.known.iter().rfind(|(own, _)| own == name).map(|(_, value)| *value)
    }

    /// The value of a setting that has one without the log.
    pub(super) fn setting(&self, name: &str) -> f64 {
        let own = self.template.settings.iter().find(|setting| setting.name == name);
        self.known(name).or(own.and_then(|setting| setting.default)).unwrap_or(f64::NAN)
    }

    /// The same, which must be above 0.
    pub(super) fn positive(&self, name: &str) -> Result<f64, Error> {
        above_zero(name, self.setting(name))
    }

    /// All values of a column.
    pub(super) fn values(&self, column: usize) -> impl Iterator<Item = f64> + Clone {
        self.runs.iter().flat_map(move |run| run.values[column].iter().copied())
    }

    /// The largest |value| of a column.
    pub(super) fn largest(&self, column: usize) -> f64 {
        self.values(column).fold(0.0, |largest: f64, value| largest.max(value.abs()))
    }

    pub(super) fn mean(&self, column: usize) -> f64 {
        self.values(column).sum::<f64>() / self.values(column).count().max(1) as f64
    }

    /// The least and the largest value of a column.
    pub(super) fn range(&self, column: usize) -> (f64, f64) {
        let wider = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
        self.values(column).fold((f64::INFINITY, f64::NEG_INFINITY), wider)
    }

    /// How far apart they are.
    pub(super) fn span(&self, column: usize) -> f64 {
        let (low, high) = self.range(column);
        high - low
    }

    /// That a column moves.
    pub(super) fn must_move(&self, column: usize) -> Result<(), Error> {
        let (low, high) = self.range(column);
        if high > low {
            return Ok(());
        }
        let name = self.template.columns[column].name;
        let message = format!(
            "column '{}' is {low} in all rows: {} cannot say its parameters unless {name} moves",
            self.channel(column),
            self.template.name
        );
        Err(Error::undetermined(Vec::new(), message))
    }

    /// The first values of a column in all runs: their mean, and by how much they differ.
    pub(super) fn first(&self, column: usize) -> (f64, f64) {
        let first: Vec<f64> =
            self.runs.iter().filter_map(|run| run.values[column].first().copied()).collect();
        let mean = first.iter().sum::<f64>() / first.len().max(1) as f64;
        let far = first.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
        (mean, far)
    }

    /// The standard deviation of the noise of a column: by third differences, which a smooth signal has hardly any of,
    /// √20 sd for white noise; their median, as some of them are steps. Not less than the rounding of the values and a
    /// small part of their range.
    pub(super) fn noise(&self, column: usize) -> f64 {
        let third = |run: &Run| -> Vec<f64> {
            let rows = run.values[column].windows(4);
            rows.map(|y| (y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0]).abs()).collect()
        };
        let mut all: Vec<f64> = self.runs.iter().flat_map(third).collect();
        all.sort_by(f64::total_cmp);
        let median = all.get(all.len() / 2).copied().unwrap_or(0.0);
        let mut steps: Vec<f64> = self
            .runs
            .iter()
            .flat_map(|run| run.values[column].windows(2).map(|pair| (pair[1] - pair[0]).abs()))
            .filter(|step| *step > 0.0)
            .collect();
        steps.sort_by(f64::total_cmp);
        let least = 1e-5 * self.span(column).max(1e-12);
        // The least change that is there often: the last digit.
        let digit = steps
            .first()
            .copied()
            .filter(|digit| steps.iter().filter(|step| **step < 1.5 * digit).count() * 20 > steps.len());
        (median / (0.6745 * 20.0_f64.sqrt())).max(digit.unwrap_or(0.0) / 12.0_f64.sqrt()).max(least)
    }
}

/// That a known number is above 0.
pub(super) fn above_zero(name: &str, value: f64) -> Result<f64, Error> {
    if value > 0.0 {
        Ok(value)
    } else {
        Err(Error::argument("known", format!("{name} is {value}; give one above 0")))
    }
}

/// Fills what is missing by straight lines; false if there is nothing.
fn filled(time: &[f64], values: &mut [f64]) -> bool {
    let there: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_finite()).collect();
    let (Some(&first), Some(&last)) = (there.first(), there.last()) else { return false };
    let (low, high) = (values[first], values[last]);
    values[..first].fill(low);
    values[last..].fill(high);
    for pair in there.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        for row in a + 1..b {
            let share = (time[row] - time[a]) / (time[b] - time[a]);
            values[row] = values[a] + share * (values[b] - values[a]);
        }
    }
    true
}
