//! The rows before the scales are known.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::missing;
use super::plan::PerChannel;

/// A number below this is none: its square could not be told from 0. No scale can be smaller.
pub(super) const SMALLEST: f64 = 1e-98;
/// No scale can be larger.
pub(super) const LARGEST: f64 = 1e98;
/// Fewer rows are not enough to tell a magnitude.
const FEWEST: usize = 10;

/// The latest rows, and the largest magnitudes of all.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Collecting {
    /// L.
    enough: usize,
    rows: VecDeque<Row>,
    /// Of the inputs, then of the output.
    magnitudes: Vec<f64>,
    gap: bool,
}

/// One row.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Row {
    /// What the estimator will be given as inputs.
    #[serde(with = "missing::vector")]
    pub(super) inputs: Vec<f64>,
    #[serde(with = "missing::number")]
    pub(super) output: f64,
    /// Whether an unknown number of samples is missing before it.
    pub(super) after_gap: bool,
}

impl Collecting {
    /// No rows yet; `enough` are the rows that it takes. Of inputs without coefficients nothing is asked.
    pub(super) fn new(enough: usize, nb: &[usize]) -> Self {
        let inputs = nb.iter().map(|&nb| if nb == 0 { 1.0 } else { 0.0 });
        let magnitudes = inputs.chain([0.0]).collect();
        Self { enough: enough.max(FEWEST), rows: VecDeque::new(), magnitudes, gap: false }
    }

    /// Takes a row.
    pub(super) fn push(&mut self, inputs: &[f64], output: f64) {
        // The larger of a number and NaN is the number.
        if let Some((largest_output, largest)) = self.magnitudes.split_last_mut() {
            largest.iter_mut().zip(inputs).for_each(|(largest, input)| *largest = largest.max(input.abs()));
            *largest_output = largest_output.max(output.abs());
        }
        let full = self.rows.len() >= self.enough;
        let oldest = if full { self.rows.pop_front() } else { None };
        let mut row = oldest.unwrap_or(Row { inputs: Vec::new(), output, after_gap: false });
        row.inputs.clear();
        row.inputs.extend_from_slice(inputs);
        (row.output, row.after_gap) = (output, std::mem::take(&mut self.gap));
        self.rows.push_back(row);
    }

    pub(super) fn gap(&mut self) {
        self.gap = true;
    }

    /// The scales, once there are enough rows and every channel has shown a value.
    pub(super) fn scales(&self) -> Option<PerChannel> {
        if self.rows.len() < self.enough || self.magnitudes.iter().any(|&largest| largest < SMALLEST) {
            return None;
        }
        let (&output, inputs) = self.magnitudes.split_last()?;
        Some(PerChannel { inputs: inputs.to_vec(), output })
    }

    /// Whether its rows are of this many inputs, and no more than those of another one could be.
    pub(super) fn fits(&self, other: &Self, inputs: usize) -> bool {
        let is_sample = |value: &f64| value.is_nan() || value.abs() <= LARGEST;
        self.enough == other.enough
            && self.rows.len() <= self.enough
            && self.magnitudes.len() == inputs + 1
            && self.magnitudes.iter().all(|largest| (0.0..=LARGEST).contains(largest))
            && self.rows.iter().all(|row| {
                row.inputs.len() == inputs && row.inputs.iter().chain([&row.output]).all(is_sample)
            })
    }

    /// The latest rows, the oldest first; whether a gap follows the last one.
    pub(super) fn rows(&self) -> (impl Iterator<Item = &Row>, bool) {
        (self.rows.iter(), self.gap)
    }
}
