//! Whole signals beside the errors: responses, what they leave of the output, and both filtered.

use thetahat_core::nalgebra::Complex;

use super::ProcessObjective;
use crate::model::{Parts, ProcessStructure};
use crate::respond::process::{HeldLog, responses, run};

impl ProcessObjective<'_> {
    /// The response from an input in every row of each part, or at every point.
    pub(in crate::estimate::process) fn responses_of(
        &self,
        input: usize,
        structure: &ProcessStructure,
        parts: &Parts<f64>,
    ) -> Vec<Vec<f64>> {
        let weighted = |columns: &[f64]| -> f64 {
            parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum()
        };
        if self.is_of_points() {
            let points = &self.points[input];
            let mut own = vec![0.0; 2 * points.frequencies.len()];
            responses(structure, &parts.shape, parts.dead_time, points.at(), |row, re, im| {
                (own[2 * row], own[2 * row + 1]) = (weighted(re), weighted(im));
            });
            return vec![own];
        }
        let of_part = |part: &HeldLog| {
            let mut own = vec![0.0; part.times.len()];
            let signals = (part.times.as_slice(), part.inputs[input].as_slice());
            run(structure, &parts.shape, parts.dead_time, signals, |row, columns| {
                own[row] = weighted(columns)
            });
            own
        };
        self.held.iter().map(of_part).collect()
    }

    /// What the responses from some inputs leave of the output in every row of each part, on a straight line where it
    /// is not measured; or the points of an input.
    pub(in crate::estimate::process) fn left_by(
        &self,
        input: usize,
        others: &[(usize, &ProcessStructure, &Parts<f64>)],
    ) -> Vec<Vec<f64>> {
        if self.is_of_points() {
            return vec![self.points[input].values.iter().flatten().copied().collect()];
        }
        let mut left: Vec<Vec<f64>> = self.held.iter().map(|part| vec![f64::NAN; part.times.len()]).collect();
        for ((part, row), output) in self.rows.iter().zip(&self.outputs) {
            left[*part][*row] = *output;
        }
        left.iter_mut().zip(self.held).for_each(|(values, part)| joined(values, &part.times));
        for (other, structure, parts) in others {
            for (left, response) in left.iter_mut().zip(self.responses_of(*other, structure, parts)) {
                left.iter_mut().zip(response).for_each(|(value, own)| *value -= own);
            }
        }
        left
    }

    /// A signal that is there in every row of each part, or at every point, in those that count; times their weights.
    pub(in crate::estimate::process) fn seen_of(&self, input: usize, signal: &[Vec<f64>]) -> Vec<f64> {
        if self.is_of_points() {
            let columns = self.of_input(input, 1, |_, columns| columns[0].copy_from_slice(&signal[0]));
            return columns.into_iter().flatten().collect();
        }
        self.rows.iter().map(|(part, row)| signal[*part][*row]).collect()
    }

    /// s^k/A(s) of such a signal, less its first value, for k = 0 … n. It moves along straight lines: that is an
    /// integrator fed with slopes.
    pub(in crate::estimate::process) fn filtered(
        &self,
        input: usize,
        shape: &[f64],
        signal: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        let Some(structure) = self.structures.get(input).map(|own| own.derivatives(true)) else {
            return Vec::new();
        };
        let count = shape.len() + 1;
        if self.is_of_points() {
            return self.of_input(input, count, |points, columns| {
                for (row, frequency) in points.frequencies.iter().enumerate() {
                    let s = Complex::new(0.0, *frequency);
                    let below = shape.iter().fold(Complex::new(1.0, 0.0), |sum, own| sum * s + own);
                    let mut value = Complex::new(signal[0][2 * row], signal[0][2 * row + 1]) / below;
                    for column in &mut *columns {
                        (column[2 * row], column[2 * row + 1]) = (value.re, value.im);
                        value *= s;
                    }
                }
            });
        }
        self.stacked(count, |part, number, whole| {
            let (times, values) = (&part.times, &signal[number]);
            let step = times.windows(2).next().map_or(1.0, |pair| pair[1] - pair[0]);
            // One row before the first, from where nothing moves.
            let before = std::iter::once(times[0] - step);
            let clock: Vec<f64> = before.chain(times.iter().copied()).collect();
            let pairs = values.windows(2).zip(times.windows(2));
            let slopes = pairs.map(|(values, times)| (values[1] - values[0]) / (times[1] - times[0]));
            let slopes: Vec<f64> = std::iter::once(0.0).chain(slopes).chain([0.0]).collect();
            run(&structure, shape, 0.0, (&clock, &slopes), |row, columns| {
                if let Some(row) = row.checked_sub(1) {
                    whole.iter_mut().zip(columns).for_each(|(column, value)| column[row] = *value);
                }
            });
        })
    }
}

/// Puts values that are missing on the line between those beside them; before the first and after the last they are
/// these.
fn joined(values: &mut [f64], times: &[f64]) {
    let known: Vec<usize> = (0..values.len()).filter(|row| !values[*row].is_nan()).collect();
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else { return };
    let (start, end) = (values[first], values[last]);
    values[..first].fill(start);
    values[last..].fill(end);
    for pair in known.windows(2).filter(|pair| pair[1] > pair[0] + 1) {
        let (from, to) = (pair[0], pair[1]);
        let slope = (values[to] - values[from]) / (times[to] - times[from]);
        for row in from + 1..to {
            values[row] = values[from] + slope * (times[row] - times[from]);
        }
    }
}
