//! Seasonal ARIMA models beside a record: what they expect of each sample given all before it, from the first one on.
//!
//! Of the first d + s D values nothing is expected, as differencing takes them. From there on the differences are
//! stationary, and their innovations are those of the exact likelihood: by the recursions of `scan` where all values
//! are measured, by the Kalman filter of `filter` where some are missing.

mod arma;
mod filter;
mod on_log;
mod scan;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::model::ArimaOrders;
use arma::Arma;
use filter::Filter;
pub(crate) use on_log::ArimaOnLog;

/// The process of a seasonal ARIMA model, with var e = 1.
#[derive(Debug, Clone)]
pub(crate) struct ArimaProcess {
    difference: Vec<f64>,
    arma: Arma,
}

/// What is known of each value of a segment that is expected.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scanned {
    /// v; NaN where the value is missing.
    pub(crate) errors: Vec<f64>,
    /// The variance of v over that of e.
    pub(crate) variances: Vec<f64>,
    /// What v is of columns beside the values: v depends linearly on these.
    pub(crate) columns: Vec<Vec<f64>>,
    /// dv for each parameter of the factors.
    pub(crate) error_slopes: Vec<Vec<f64>>,
    /// The derivatives of the variances.
    pub(crate) variance_slopes: Vec<Vec<f64>>,
}

impl Scanned {
    fn new(rows: usize, columns: usize, slopes: usize) -> Self {
        let zeros = || vec![0.0; rows];
        Self {
            errors: zeros(),
            variances: zeros(),
            columns: vec![zeros(); columns],
            error_slopes: vec![zeros(); slopes],
            variance_slopes: vec![zeros(); slopes],
        }
    }
}

impl ArimaProcess {
    /// The process of these parameters of the factors; none if it is not stationary.
    pub(crate) fn new(orders: &ArimaOrders, parameters: &[f64], slopes: bool) -> Option<Self> {
        let arma = Arma::new(&orders.expanded(parameters, slopes))?;
        Some(Self { difference: orders.differencing(), arma })
    }

    /// The values of a segment, its first row 0, that are expected: from the first so many measured values on that
    /// differencing needs, to the last measured one. None if there is none.
    pub(crate) fn expected(values: &[f64], differences: usize) -> Option<Range<usize>> {
        let end = values.iter().rposition(|value| !value.is_nan())? + 1;
        let mut run = 0;
        for (row, value) in values[..end].iter().enumerate() {
            if run >= differences && !value.is_nan() {
                return Some(row..end);
            }
            run = if value.is_nan() { 0 } else { run + 1 };
        }
        None
    }

    /// The innovations of the values of a segment in these rows, which [`expected`](Self::expected) gave, and of
    /// columns beside it.
    pub(crate) fn scan(
        &self,
        values: &[f64],
        columns: &[&[f64]],
        rows: Range<usize>,
        slopes: bool,
    ) -> Scanned {
        if values[rows.clone()].iter().all(|value| !value.is_nan()) {
            let differenced = |values: &[f64]| self.differenced(values, &rows);
            let columns: Vec<Vec<f64>> = columns.iter().map(|column| differenced(column)).collect();
            return scan::scan(&self.arma, &differenced(values), &columns, slopes);
        }
        let mut filter = self.filter(values, columns, rows.start, slopes);
        let count = if slopes { self.arma.slopes.len() } else { 0 };
        let mut found = Scanned::new(rows.len(), columns.len(), count);
        for (place, row) in rows.enumerate() {
            if values[row].is_nan() {
                found.errors[place] = f64::NAN;
                found.variances[place] = f64::NAN;
                filter.missing();
                continue;
            }
            let beside: Vec<f64> = columns.iter().map(|column| column[row]).collect();
            let innovation = filter.measured(values[row], &beside);
            found.errors[place] = innovation.value;
            found.variances[place] = innovation.variance;
            found.columns.iter_mut().zip(&innovation.columns).for_each(|(out, own)| out[place] = *own);
            let slopes = found.error_slopes.iter_mut().zip(&mut found.variance_slopes);
            for ((errors, variances), (error, variance)) in slopes.zip(&innovation.slopes) {
                (errors[place], variances[place]) = (*error, *variance);
            }
        }
        found
    }

    /// The filter that is about to see row `first`.
    fn filter(&self, values: &[f64], columns: &[&[f64]], first: usize, slopes: bool) -> Filter {
        let rows = first + 1 - self.difference.len()..first;
        let columns: Vec<Vec<f64>> = columns.iter().map(|column| column[rows.clone()].to_vec()).collect();
        Filter::new(&self.arma, &self.difference, &values[rows], &columns, slopes)
    }

    fn differenced(&self, values: &[f64], rows: &Range<usize>) -> Vec<f64> {
        let mut found = values[rows.clone()].to_vec();
        for (lag, value) in arma::terms(&self.difference) {
            let earlier = &values[rows.start - lag..rows.end - lag];
            found.iter_mut().zip(earlier).for_each(|(found, earlier)| *found += value * earlier);
        }
        found
    }
}
