//! A log as the filter sees it, row after row.

use std::ops::Range;

use crate::Error;
use crate::data::{Log, Rows, inside};
use crate::model::{GreyBox, equations::Drive};

/// Inputs and outputs of a log on its own clock, from its first row to the last one that counts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Experiment {
    /// The row of the whole log that it begins with, counted from 0.
    pub(crate) first: usize,
    /// Which of its rows count: those before are what the filter starts from.
    counted: Vec<Range<usize>>,
    /// Seconds since the first row.
    pub(crate) times: Vec<f64>,
    /// How the step to each row but the first is taken: as a number of equal ones, and the seconds of each.
    steps: Vec<(usize, f64)>,
    /// Row after row; a missing one holds the value before it, 0 before the first.
    inputs: Vec<f64>,
    /// Row after row; NaN where missing.
    outputs: Vec<f64>,
    /// Which inputs go in straight lines from row to row; empty where none does.
    linear: Vec<bool>,
    /// How many inputs and outputs there are.
    width: usize,
    height: usize,
    /// How many values each input misses.
    pub(crate) held: Vec<usize>,
}

/// An experiment for each of the joined logs that has some of the rows. A log without a clock has the model's.
///
/// It begins, in the state that the model says, with the first of the rows that the model was fitted to, if they are in
/// this log and stand before those asked for; else with the first row of the log.
///
/// # Errors
/// [`Error::Data`] for a channel that is not there, and a step that the model cannot take.
pub(crate) fn experiments(
    model: &GreyBox,
    log: &Log,
    rows: &[Rows],
    fitted: &[Rows],
) -> Result<Vec<Experiment>, Error> {
    let of_part = |part: Range<usize>| {
        let asked = inside(rows, &part);
        let first = asked.first()?.start;
        let begin = inside(fitted, &part).first().map_or(0, |fitted| fitted.start);
        let begin = if begin <= first { begin } else { 0 };
        let whole = part.start + begin..part.start + asked.last()?.end;
        let counted = asked.into_iter().map(|rows| rows.start - begin..rows.end - begin).collect();
        Some(Experiment::new(model, log, whole, counted))
    };
    log.logs().filter_map(of_part).collect()
}

impl Experiment {
    fn new(
        model: &GreyBox,
        log: &Log,
        rows: Range<usize>,
        counted: Vec<Range<usize>>,
    ) -> Result<Self, Error> {
        let channel = |name: &String| values(log, name, &rows);
        let sources: Vec<&[f64]> = model.inputs().iter().map(channel).collect::<Result<_, Error>>()?;
        let targets: Vec<Option<&[f64]>> = model
            .outputs()
            .iter()
            .map(|name| if log.has(name) { channel(name).map(Some) } else { Ok(None) })
            .collect::<Result<_, Error>>()?;
        let times: Vec<f64> = match log.time() {
            Some(time) => time[rows.clone()].iter().map(|seconds| seconds - time[rows.start]).collect(),
            None => (0..rows.len()).map(|row| row as f64 * log.sample_time()).collect(),
        };
        // Steps that differ by the rounding of their times are equal where one is prepared for all rows of its length.
        let last = log.time().map_or(&times[..], |time| &time[rows.clone()]).last();
        let rounding = match last {
            Some(last) if model.has_constant_covariances() => 4.0 * f64::EPSILON * last.abs(),
            _ => 0.0,
        };
        let mut equal = f64::INFINITY;
        let steps = times.windows(2).zip(rows.start + 2..).map(|(pair, row)| {
            let step = pair[1] - pair[0];
            let is_equal = (step - equal).abs() <= rounding && equal > rounding;
            if !is_equal {
                equal = step;
            }
            model.division(equal).map_err(|error| Error::Data {
                channel: None,
                row: Some(row),
                message: format!("row {row}: {error}"),
            })
        });
        let steps = steps.collect::<Result<_, Error>>()?;
        let across = |channels: &[Option<&[f64]>]| -> Vec<f64> {
            let value =
                |row: usize| channels.iter().map(move |values| values.map_or(f64::NAN, |values| values[row]));
            (0..rows.len()).flat_map(value).collect()
        };
        let mut held = vec![0; sources.len()];
        let mut last = vec![0.0; sources.len()];
        let mut inputs = across(&sources.iter().map(|source| Some(*source)).collect::<Vec<_>>());
        for row in inputs.chunks_exact_mut(sources.len().max(1)) {
            for ((value, last), held) in row.iter_mut().zip(&mut last).zip(&mut held) {
                if value.is_nan() {
                    *held += 1;
                    *value = *last;
                }
                *last = *value;
            }
        }
        Ok(Self {
            first: rows.start,
            counted,
            times,
            steps,
            inputs,
            outputs: across(&targets),
            linear: model.linear_holds().to_vec(),
            width: sources.len(),
            height: targets.len(),
            held,
        })
    }

    pub(crate) fn rows(&self) -> usize {
        self.times.len()
    }

    /// Whether a filter does the same to its covariance in two rows: after equal steps, the same outputs are measured.
    pub(crate) fn is_alike(&self, row: usize, other: usize) -> bool {
        let step = |row: usize| row.checked_sub(1).and_then(|before| self.steps.get(before));
        let mut outputs = self.output(row).iter().zip(self.output(other));
        step(row) == step(other) && outputs.all(|(one, other)| one.is_nan() == other.is_nan())
    }

    /// The rows that count, in rising order.
    pub(crate) fn counted(&self) -> &[Range<usize>] {
        &self.counted
    }

    /// Whether a row counts.
    pub(crate) fn counts(&self, row: usize) -> bool {
        self.counted.iter().any(|rows| rows.contains(&row))
    }

    /// Whether a row stands before all that count: the filter gets warm in it.
    pub(crate) fn warms(&self, row: usize) -> bool {
        self.counted.first().is_some_and(|rows| row < rows.start)
    }

    pub(crate) fn input(&self, row: usize) -> &[f64] {
        &self.inputs[row * self.width..(row + 1) * self.width]
    }

    /// The inputs at a row and on to the next.
    pub(crate) fn drive(&self, row: usize) -> Drive<'_> {
        Drive::of_rows((&self.times, &self.inputs), self.width, &self.linear, row)
    }

    pub(crate) fn output(&self, row: usize) -> &[f64] {
        &self.outputs[row * self.height..(row + 1) * self.height]
    }

    /// The steps to a row, each as its time and its seconds; none for the first row. The input is that of the row
    /// before.
    pub(crate) fn steps(&self, row: usize) -> impl Iterator<Item = (f64, f64)> {
        let step = row.checked_sub(1).and_then(|before| self.times.get(before).zip(self.steps.get(before)));
        step.into_iter().flat_map(|(&time, &(count, length))| {
            (0..count).map(move |number| (time + number as f64 * length, length))
        })
    }

    /// How often an output is measured in rows that count.
    pub(crate) fn measurements(&self, output: usize) -> usize {
        self.counted.iter().cloned().flatten().filter(|row| !self.output(*row)[output].is_nan()).count()
    }
}

fn values<'a>(log: &'a Log, name: &str, rows: &Range<usize>) -> Result<&'a [f64], Error> {
    if !log.has(name) {
        let names: Vec<&str> = log.channels().iter().map(|channel| channel.name.as_str()).collect();
        let message = format!(
            "the model needs channel '{name}', the log has: {}; rename one of them",
            names.join(", ")
        );
        return Err(Error::in_channel(name, None, message));
    }
    Ok(&log.channel(name)?.values[rows.clone()])
}
