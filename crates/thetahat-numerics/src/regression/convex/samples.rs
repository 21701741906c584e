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
    rows: Rows<'a>,
    /// The largest size of each regressor, and of the target after them.
    peaks: Vec<f64>,
    count: usize,
}

/// Where the numbers of a regression stand.
#[derive(Debug)]
enum Rows<'a> {
    /// Regressors are past samples of signals.
    Lagged {
        lagged: &'a Lagged<'a>,
        /// The signal, lag and sign of each regressor.
        columns: Vec<(usize, usize, f64)>,
        segments: Vec<Segment>,
    },
    /// Each regressor is a column of its own.
    Columns { target: &'a [f64], columns: &'a [Vec<f64>] },
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
    pub(super) fn of_lagged(lagged: &'a Lagged<'a>) -> Self {
        let (mut segments, mut count) = (Vec::new(), 0);
        for segment in lagged.segments {
            let rows = lagged.counted(segment);
            if !rows.is_empty() {
                segments.push(Segment { number: count, row: rows.start, start: segment.start });
                count += rows.len();
            }
        }
        Self::new(Rows::Lagged { lagged, columns: lagged.columns().collect(), segments }, count)
    }

    /// Columns of the target's length.
    pub(super) fn of_columns(target: &'a [f64], columns: &'a [Vec<f64>]) -> Self {
        Self::new(Rows::Columns { target, columns }, target.len())
    }

    fn new(rows: Rows<'a>, count: usize) -> Self {
        let mut samples = Self { rows, peaks: Vec::new(), count };
        let peak = |column| {
            let mut peak = 0.0_f64;
            samples.each(column, |_, value| peak = peak.max(value.abs()));
            peak
        };
        samples.peaks = (0..samples.regressors()).map(Some).chain([None]).map(peak).collect();
        samples
    }

    /// N.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    fn regressors(&self) -> usize {
        match &self.rows {
            Rows::Lagged { columns, .. } => columns.len(),
            Rows::Columns { columns, .. } => columns.len(),
        }
    }

    /// Calls `with` with each sample's number and its value of a regressor, or of the target.
    fn each(&self, column: Option<usize>, mut with: impl FnMut(usize, f64)) {
        match &self.rows {
            Rows::Lagged { lagged, columns, segments } => {
                let (signal, lag, sign) = column.map_or((0, 0, 1.0), |column| columns[column]);
                let ends = segments.iter().skip(1).map(|next| next.number).chain([self.count]);
                for (segment, end) in segments.iter().zip(ends) {
                    for number in segment.number..end {
                        let row = segment.row + number - segment.number;
                        with(number, sign * lagged.sample(signal, segment.start, row, lag));
                    }
                }
            }
            Rows::Columns { target, columns } => {
                let values = column.map_or(*target, |column| &columns[column]);
                values.iter().enumerate().for_each(|(number, value)| with(number, *value));
            }
        }
    }

    /// phi of a sample.
    pub(super) fn regressor(&self, number: usize) -> DVector<f64> {
        match &self.rows {
            Rows::Lagged { lagged, columns, segments } => {
                let next = segments.partition_point(|segment| segment.number <= number);
                let segment = &segments[next - 1];
                let row = segment.row + number - segment.number;
                let value = |&(signal, lag, sign): &(usize, usize, f64)| {
                    sign * lagged.sample(signal, segment.start, row, lag)
                };
                DVector::from_iterator(columns.len(), columns.iter().map(value))
            }
            Rows::Columns { columns, .. } => {
                DVector::from_iterator(columns.len(), columns.iter().map(|column| column[number]))
            }
        }
    }

    /// `y - Phi theta`. 2 N p flops.
    pub(super) fn residuals(&self, parameters: &DVector<f64>) -> Vec<f64> {
        let mut residuals = vec![0.0; self.count];
        self.each(None, |number, value| residuals[number] = value);
        for (column, theta) in parameters.iter().enumerate() {
            self.each(Some(column), |number, value| residuals[number] -= theta * value);
        }
        residuals
    }

    /// The sum of phi over the samples that `of` has. 2 N p flops.
    pub(super) fn sum(&self, of: impl Fn(usize) -> bool) -> DVector<f64> {
        let sum = |column| {
            let mut sum = 0.0;
            self.each(Some(column), |number, value| sum += if of(number) { value } else { 0.0 });
            sum
        };
        DVector::from_iterator(self.regressors(), (0..self.regressors()).map(sum))
    }

    /// What rounding may add to a residual.
    pub(super) fn rounding(&self, parameters: &DVector<f64>) -> f64 {
        let terms = self.peaks.iter().zip(parameters).map(|(peak, theta)| peak * theta.abs());
        let target = self.peaks.last().copied().unwrap_or(0.0);
        ROUNDING * (target + terms.sum::<f64>())
    }
}

/// The `count` samples with the largest `|residuals|` above `level` that are not among `known`, the largest first:
/// number, and whether the residual is positive.
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
