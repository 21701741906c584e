//! What a model says: driven by its inputs alone, or by what was measured.

mod predict;
mod simulate;
#[cfg(test)]
mod tests;

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::Record;
use crate::{Error, Model};

pub use predict::predict;
pub use simulate::simulate;

/// What a response starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Start {
    /// Rest: all samples before the first of a segment are zero.
    Zero,
    /// Measured samples, as many as the model reaches back: those directly before the segment where the log has them,
    /// else the segment's first ones, which then do not count.
    Measured,
    /// The initial condition that fits the segment's output best in the least-squares sense.
    Estimated,
}

/// A record must have as many inputs as the model.
fn check_inputs(model: &Model, record: &Record<'_>) -> Result<(), Error> {
    let (expected, found) = (model.b.len(), record.inputs.len());
    if found == expected {
        return Ok(());
    }
    Err(Error::argument("inputs", format!("the model has {expected} inputs, the record {found}")))
}

/// For a start from measured samples: the first of them, and the samples that are then covered.
fn from_measured(segment: &Range<usize>, past: usize, reach: usize) -> (usize, Range<usize>) {
    let history = segment.start - past;
    (history, (history + reach).clamp(segment.start, segment.end)..segment.end)
}

/// A response to a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// One value for each sample, in deviations like the record; NaN outside `counted`.
    pub values: Vec<f64>,
    /// The samples that the response covers, as 0-based ranges.
    pub counted: Vec<Range<usize>>,
}

impl Response {
    fn empty(samples: usize) -> Self {
        Self { values: vec![f64::NAN; samples], counted: Vec::new() }
    }
}

/// Adds `sum_l weights[l] x(t - l)` to `target`, which stands for the samples `rows`; before sample `start` x is zero.
fn add_filtered(target: &mut [f64], rows: &Range<usize>, weights: &[f64], x: &[f64], start: usize) {
    let reach = weights.len().saturating_sub(1);
    let full = (start + reach).clamp(rows.start, rows.end);
    let (head, tail) = target.split_at_mut(full - rows.start);
    for (row, value) in (rows.start..full).zip(head) {
        let known = (row + 1).saturating_sub(start).min(weights.len());
        let past = x[row + 1 - known..=row].iter().rev();
        *value += weights.iter().zip(past).map(|(weight, x)| weight * x).sum::<f64>();
    }
    if full < rows.end && !weights.is_empty() {
        crate::regression::add_filtered(tail, weights, &x[full - reach..rows.end]);
    }
}
