//! The samples of a regression one by one, and those with the largest or smallest errors.

use std::cmp::Ordering;
use std::collections::HashSet;

use thetahat_core::nalgebra::DVector;

use crate::regression::Lagged;

/// Rounding of one residual, in units of its largest terms.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

/// The samples of a regression that count, numbered from 0 over all segments.
#[derive(Debug)]
pub(super) struct Samples<'a> {
    lagged: &'a Lagged<'a>,
    /// The signal, lag and sign of each regressor.
    columns: Vec<(usize, usize, f64)>,
    segments: Vec<Segment>,
    /// The largest size of each regressor, and of the target after them.
    peaks: Vec<f64>,
    count: usize,
}

#[derive(Debug)]
struct Segment {
    /// The number of its first sample that counts.
    number: usize,
    /// The row of that sample in the signals.
    row: usize,
    /// The row at which the segment starts.
    start: usize,
}

impl<'a> Samples<'a> {
    pub(super) fn new(lagged: &'a Lagged<'a>) -> Self {
        let mut samples =
            Self { lagged, columns: lagged.columns().collect(), segments: vec![], peaks: vec![], count: 0 };
        for segment in lagged.segments {
            let rows = lagged.counted(segment);
            if !rows.is_empty() {
                samples.segments.push(Segment {
                    number: samples.count,
                    row: rows.start,
                    start: segment.start,
                });
                samples.count += rows.len();
            }
        }
        let peak = |column: &(usize, usize, f64)| {
            let mut peak = 0.0_f64;
            samples.each(*column, |_, value| peak = peak.max(value.abs()));
            peak
        };
        samples.peaks = samples.columns.iter().chain([&(0, 0, 1.0)]).map(peak).collect();
        samples
    }

    /// N.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Calls `with` with each sample's number and its value in a column.
    fn each(&self, (signal, lag, sign): (usize, usize, f64), mut with: impl FnMut(usize, f64)) {
        let ends = self.segments.iter().skip(1).map(|next| next.number).chain([self.count]);
        for (segment, end) in self.segments.iter().zip(ends) {
            for number in segment.number..end {
                let row = segment.row + number - segment.number;
                with(number, sign * self.lagged.sample(signal, segment.start, row, lag));
            }
        }
    }

    /// phi of a sample.
    pub(super) fn regressor(&self, number: usize) -> DVector<f64> {
        let next = self.segments.partition_point(|segment| segment.number <= number);
        let segment = &self.segments[next - 1];
        let row = segment.row + number - segment.number;
        let value = |&(signal, lag, sign): &(usize, usize, f64)| {
            sign * self.lagged.sample(signal, segment.start, row, lag)
        };
        DVector::from_iterator(self.columns.len(), self.columns.iter().map(value))
    }

    /// `y - Phi theta`. 2 N p flops.
    pub(super) fn residuals(&self, parameters: &DVector<f64>) -> Vec<f64> {
        let mut residuals = vec![0.0; self.count];
        self.each((0, 0, 1.0), |number, value| residuals[number] = value);
        for (&column, theta) in self.columns.iter().zip(parameters) {
            self.each(column, |number, value| residuals[number] -= theta * value);
        }
        residuals
    }

    /// The sum of phi over the samples that `of` has. 2 N p flops.
    pub(super) fn sum(&self, of: impl Fn(usize) -> bool) -> DVector<f64> {
        let sum = |&column: &(usize, usize, f64)| {
            let mut sum = 0.0;
            self.each(column, |number, value| sum += if of(number) { value } else { 0.0 });
            sum
        };
        DVector::from_iterator(self.columns.len(), self.columns.iter().map(sum))
    }

    /// What rounding may add to a residual.
    pub(super) fn rounding(&self, parameters: &DVector<f64>) -> f64 {
        let terms = self.peaks.iter().zip(parameters).map(|(peak, theta)| peak * theta.abs());
        let target = self.peaks.last().copied().unwrap_or(0.0);
        ROUNDING * (target + terms.sum::<f64>())
    }
}

/// The `count` samples with the largest `|residuals|` above `level` that are not among `known`, the largest first: number,
/// and whether the residual is positive.
pub(super) fn largest(
    residuals: &[f64],
    level: f64,
    count: usize,
    known: &[(usize, bool)],
) -> Vec<(usize, bool)> {
    let known: HashSet<&(usize, bool)> = known.iter().collect();
    let mut found: Vec<(usize, bool)> = residuals
        .iter()
        .enumerate()
        .filter(|(_, residual)| residual.abs() > level)
        .map(|(number, residual)| (number, *residual > 0.0))
        .filter(|sample| !known.contains(sample))
        .collect();
    found.sort_by(|(a, _), (b, _)| by_size(residuals, *b, *a).then(a.cmp(b)));
    found.truncate(count);
    found
}

/// The numbers of the `count` samples with the smallest `|residuals|`.
pub(super) fn smallest(residuals: &[f64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..residuals.len()).collect();
    if count < order.len() {
        order.select_nth_unstable_by(count, |a, b| by_size(residuals, *a, *b).then(a.cmp(b)));
        order.truncate(count);
    }
    order
}

fn by_size(residuals: &[f64], a: usize, b: usize) -> Ordering {
    residuals[a].abs().total_cmp(&residuals[b].abs())
}
