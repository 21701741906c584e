//! Errors that count by their squares up to a bound, and linearly beyond: sums with weights.

use thetahat_numerics::regression::product;

use super::loss::weight;
use super::section::Section;
use super::{Layout, Predictor};
use crate::data::Record;

impl Predictor<'_> {
    /// Lets errors count linearly from a bound on: the cost is 2 sum rho(e), rho(e) = e^2/2 up to the bound d and d
    /// |e| - d^2/2 beyond, and the normal equations have the weights min(1, d/|e|). None: by their squares all of them.
    pub(in crate::estimate) fn count_linearly_from(&mut self, bound: Option<f64>) {
        for layout in &mut self.layouts {
            layout.bound = bound;
            layout.linear.iter_mut().for_each(|linear| linear.bound = bound);
        }
    }
}

impl Predictor<'_> {
    /// The output of the record with errors cut off at a bound, y - e + psi(e), where they count.
    pub(in crate::estimate) fn cleaned(&self, record: &Record<'_>, bound: f64) -> Vec<f64> {
        let mut output = record.output.to_vec();
        for section in &self.sections {
            for row in section.runs.iter().cloned().flatten() {
                let e = section.signals[0][row];
                output[section.first + row] += e.clamp(-bound, bound) - e;
            }
        }
        output
    }
}

impl Section<'_> {
    /// The normal equations of psi with weights. O(N (p + n)^2) for n initial-condition responses.
    pub(super) fn weigh(&mut self, layout: &Layout, bound: f64) {
        let columns = self.raw_columns(layout);
        // Zero where samples do not count, as the columns are.
        let mut errors = vec![0.0; self.output.len() - layout.counted];
        for run in &self.runs {
            errors[run.start - layout.counted..run.end - layout.counted]
                .copy_from_slice(&self.signals[0][run.clone()]);
        }
        let weights: Vec<f64> = errors.iter().map(|e| weight(*e, bound)).collect();
        let count = columns.len();
        let mut weighted = vec![0.0; errors.len()];
        for (row, column) in columns.iter().enumerate() {
            for ((weighted, value), weight) in weighted.iter_mut().zip(column).zip(&weights) {
                *weighted = value * weight;
            }
            self.right[row] = product(&weighted, &errors);
            for (other, values) in columns.iter().enumerate().take(row + 1) {
                let value = product(&weighted, values);
                self.gram[row * count + other] = value;
                self.gram[other * count + row] = value;
            }
        }
    }
}
