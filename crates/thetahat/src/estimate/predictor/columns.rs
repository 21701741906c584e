//! psi itself, column by column: for sums over its rows that no lagged products give.

use std::ops::Range;

use super::section::Section;
use super::{Layout, Predictor};

/// `target += weight x`.
fn add_scaled(target: &mut [f64], weight: f64, x: &[f64]) {
    target.iter_mut().zip(x).for_each(|(target, x)| *target += weight * x);
}

impl Predictor<'_> {
    /// For each segment the columns of psi with respect to the parameters over the samples that count, the best changes
    /// of the initial-condition responses taken out, at the current point. O(N p (n + 1)) for n initial-condition
    /// responses, and memory for N p numbers.
    pub(in crate::estimate) fn columns(&self) -> Vec<Vec<Vec<f64>>> {
        self.sections.iter().map(|section| section.columns(&self.layouts[section.layout])).collect()
    }

    /// The columns of psi with respect to the parameters, then to the weights of the initial-condition responses, one
    /// segment after the other, over the samples that count, at the current point. Memory for N numbers for each.
    pub(in crate::estimate) fn all_columns(&self) -> Vec<Vec<f64>> {
        let parameters = self.orders().parameters();
        let mut all = vec![vec![0.0; self.samples()]; parameters + self.initial_conditions()];
        let (mut row, mut place) = (0, parameters);
        for section in &self.sections {
            let layout = &self.layouts[section.layout];
            let places = (0..parameters).chain(place..place + layout.free);
            let first = row;
            for (place, column) in places.zip(section.raw_columns(layout)) {
                row = first;
                for run in &section.runs {
                    let counted = run.start - layout.counted..run.end - layout.counted;
                    all[place][row..row + run.len()].copy_from_slice(&column[counted]);
                    row += run.len();
                }
            }
            place += layout.free;
        }
        all
    }
}

impl Section<'_> {
    /// The columns of the parameters without the initial-condition responses.
    fn columns(&self, layout: &Layout) -> Vec<Vec<f64>> {
        let (parameters, free) = (layout.parameters, layout.free);
        let mut columns = self.raw_columns(layout);
        let responses = columns.split_off(parameters);
        for (index, column) in columns.iter_mut().enumerate() {
            let steps = &self.free_steps[(index + 1) * free..][..free];
            for (step, response) in steps.iter().zip(&responses) {
                add_scaled(column, -step, response);
            }
        }
        columns
    }

    /// The columns of the parameters, then of the initial-condition responses, from the first sample that may count on;
    /// zero where one does not.
    pub(super) fn raw_columns(&self, layout: &Layout) -> Vec<Vec<f64>> {
        let count = layout.parameters + layout.free;
        let rows = layout.counted..self.output.len();
        let column = |index: usize| {
            let mut values = vec![0.0; rows.len()];
            self.write_raw(layout, &rows, index, &mut values);
            let starts = std::iter::once(rows.start).chain(self.runs.iter().map(|run| run.end));
            let ends = self.runs.iter().map(|run| run.start).chain([rows.end]);
            for (start, end) in starts.zip(ends) {
                values[start - rows.start..end - rows.start].fill(0.0);
            }
            values
        };
        (0..count).map(column).collect()
    }

    /// Some rows of a column: first of those of the initial-condition responses, then of those of psi, and e last.
    pub(super) fn write_column(
        &self,
        layout: &Layout,
        rows: &Range<usize>,
        column: usize,
        values: &mut [f64],
    ) {
        let (parameters, free) = (layout.parameters, layout.free);
        if column == parameters + free {
            values.copy_from_slice(&self.signals[0][rows.clone()]);
        } else {
            let index = if column < free { parameters + column } else { column - free };
            self.write_raw(layout, rows, index, values);
        }
    }

    /// Some rows of a column, in the order of the layout.
    fn write_raw(&self, layout: &Layout, rows: &Range<usize>, index: usize, values: &mut [f64]) {
        let (columns, shifts) = layout.columns.split_at(layout.parameters + layout.free);
        let column = &columns[index];
        values.fill(0.0);
        add_shifted(values, rows, column.sign, &self.signals[column.signal], column.lag);
        let weights = &self.corrections[index * shifts.len()..][..shifts.len()];
        for (shift, weight) in shifts.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            let known = rows.start..rows.end.min(self.supports[shift.signal].saturating_add(shift.lag));
            add_shifted(values, &known, *weight, &self.signals[shift.signal], shift.lag);
        }
    }
}

/// `target += weight s(t - lag)` over some rows, s being zero before the first.
fn add_shifted(target: &mut [f64], rows: &Range<usize>, weight: f64, signal: &[f64], lag: usize) {
    let from = lag.max(rows.start);
    if from < rows.end {
        add_scaled(&mut target[from - rows.start..], weight, &signal[from - lag..rows.end - lag]);
    }
}
