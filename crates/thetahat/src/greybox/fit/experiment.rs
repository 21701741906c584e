//! A log as the filter sees it, row after row.

use crate::data::check;
use crate::{Channel, Error, Recording, Times};

/// Inputs and outputs of a log on its own clock.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Experiment {
    /// Seconds since the first row.
    pub(super) times: Vec<f64>,
    /// How the step to each row but the first is taken: as so many equal ones of so many seconds.
    steps: Vec<(usize, f64)>,
    /// Row after row; a missing one holds the value before it, 0 before the first.
    inputs: Vec<f64>,
    /// Row after row; NaN where missing.
    outputs: Vec<f64>,
    /// How many inputs and outputs there are.
    width: usize,
    height: usize,
    /// How many values each input misses.
    pub(super) held: Vec<usize>,
}

impl Experiment {
    /// Of the channels of a log. `division` says how a step of some seconds is taken.
    ///
    /// # Errors
    /// [`Error::Data`] for a channel that is not there, channels that are no log, a clock that does not run forward, and a
    /// step that the division refuses; [`Error::Argument`] for a sample time that is not positive.
    pub(super) fn new(
        recording: &Recording,
        inputs: &[String],
        outputs: &[String],
        division: impl Fn(f64) -> Result<(usize, f64), Error>,
    ) -> Result<Self, Error> {
        let rows = check(&recording.channels)?;
        let channel = |name: &str| values(&recording.channels, name);
        let sources: Vec<&[f64]> = inputs.iter().map(|name| channel(name)).collect::<Result<_, Error>>()?;
        let targets: Vec<&[f64]> = outputs.iter().map(|name| channel(name)).collect::<Result<_, Error>>()?;
        let times = seconds(&recording.times, rows)?;
        let steps = times.windows(2).zip(2..).map(|(pair, row)| {
            division(pair[1] - pair[0]).map_err(|error| Error::Data {
                channel: None,
                row: Some(row),
                message: format!("row {row}: {error}"),
            })
        });
        let steps = steps.collect::<Result<_, Error>>()?;
        let across = |channels: &[&[f64]]| -> Vec<f64> {
            (0..rows).flat_map(|row| channels.iter().map(move |values| values[row])).collect()
        };
        let mut held = vec![0; sources.len()];
        let mut last = vec![0.0; sources.len()];
        let mut inputs = across(&sources);
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
            times,
            steps,
            inputs,
            outputs: across(&targets),
            width: sources.len(),
            height: targets.len(),
            held,
        })
    }

    pub(super) fn rows(&self) -> usize {
        self.times.len()
    }

    pub(super) fn input(&self, row: usize) -> &[f64] {
        &self.inputs[row * self.width..(row + 1) * self.width]
    }

    pub(super) fn output(&self, row: usize) -> &[f64] {
        &self.outputs[row * self.height..(row + 1) * self.height]
    }

    /// The steps to a row, each as its time and its seconds; none for the first row. The input is that of the row before.
    pub(super) fn steps(&self, row: usize) -> impl Iterator<Item = (f64, f64)> {
        let step = row.checked_sub(1).and_then(|before| self.times.get(before).zip(self.steps.get(before)));
        step.into_iter().flat_map(|(&time, &(count, length))| {
            (0..count).map(move |number| (time + number as f64 * length, length))
        })
    }

    /// How often an output is measured.
    pub(super) fn readings(&self, output: usize) -> usize {
        (0..self.rows()).filter(|row| !self.output(*row)[output].is_nan()).count()
    }
}

fn values<'a>(channels: &'a [Channel], name: &str) -> Result<&'a [f64], Error> {
    let found = channels.iter().find(|channel| channel.name == name);
    found.map(|channel| channel.values.as_slice()).ok_or_else(|| {
        let names: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
        let message = format!(
            "the model needs channel '{name}', the log has: {}; rename one of them",
            names.join(", ")
        );
        Error::in_channel(name, None, message)
    })
}

/// Seconds since the first row.
fn seconds(times: &Times, rows: usize) -> Result<Vec<f64>, Error> {
    let time = match times {
        Times::Uniform(step) if step.is_finite() && *step > 0.0 => {
            return Ok((0..rows).map(|row| row as f64 * step).collect());
        }
        Times::Uniform(step) => {
            let message = format!("{step} is not a positive number of seconds");
            return Err(Error::argument("sample time", message));
        }
        Times::Measured(time) => time,
    };
    if time.len() != rows {
        return Err(Error::data(format!("there are {} time stamps for {rows} rows", time.len())));
    }
    let at = |row: usize, message: String| Error::Data { channel: None, row: Some(row), message };
    let since: Vec<f64> = time.iter().map(|seconds| seconds - time[0]).collect();
    if let Some(row) = since.iter().position(|seconds| !seconds.is_finite()) {
        return Err(at(row + 1, format!("the time in row {} is not a finite number", row + 1)));
    }
    if let Some(row) = since.windows(2).position(|pair| pair[1] <= pair[0]) {
        let message = format!(
            "the time does not advance from {} s in row {} to {} s in row {}; sort the log by time and remove repeated rows",
            time[row],
            row + 1,
            time[row + 1],
            row + 2
        );
        return Err(at(row + 2, message));
    }
    Ok(since)
}
