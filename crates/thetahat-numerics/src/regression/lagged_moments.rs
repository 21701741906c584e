//! Second moments of lagged signals that add up over parts of a log.
//!
//! ```text
//! z(t) = [x_1(t), …, x_q(t), x_1(t-1), …, x_q(t-L)],   m = mean z,   S = sum (z - m)(z - m)'
//! S(1 and 2) = S(1) + S(2) + N_1 N_2/(N_1 + N_2) d d',   d = m(2) - m(1)
//! ```
//!
//! Each lag has the mean of its own rows, as a regression with a constant takes it. A part is summed about its own
//! means and none of the sums is a difference of large ones, so that levels cost no digits, whatever they are and
//! however they move.
//!
//! Source: Chan, Golub and LeVeque, Algorithms for computing the sample variance, The American Statistician 37 (1983).

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::gram::joint_gram;
use super::kernel::sum;
use super::lagged::Taps;

/// The moments of some rows, at least one signal.
#[derive(Debug, Clone)]
pub struct LaggedMoments {
    signals: usize,
    longest: usize,
    rows: usize,
    /// Of lag l of signal s at l q + s.
    means: DVector<f64>,
    products: DMatrix<f64>,
}

impl LaggedMoments {
    /// Of the samples of which all lags up to `longest` lie in their segment. O(N q^2 L) time, O(q^2 L^2) memory.
    pub fn new(signals: &[&[f64]], segments: &[Range<usize>], longest: usize) -> Self {
        let inside = |signal: &[f64]| -> f64 {
            let count: usize = segments.iter().map(Range::len).sum();
            sum(segments.iter().flat_map(|segment| &signal[segment.clone()]).copied()) / count.max(1) as f64
        };
        let levels: Vec<f64> = signals.iter().map(|signal| inside(signal)).collect();
        let centred: Vec<Vec<f64>> = signals
            .iter()
            .zip(&levels)
            .map(|(signal, level)| signal.iter().map(|value| value - level).collect())
            .collect();
        let centred: Vec<&[f64]> = centred.iter().map(Vec::as_slice).collect();
        let (mut products, rows) = joint_gram(&centred, segments, longest);
        let count = signals.len();
        let mut means = DVector::zeros(products.nrows());
        for segment in segments.iter().filter(|segment| segment.len() > longest) {
            for (signal, x) in centred.iter().enumerate() {
                let mut total = sum(x[segment.start + longest..segment.end].iter().copied());
                means[signal] += total;
                for lag in 1..=longest {
                    total += x[segment.start + longest - lag] - x[segment.end - lag];
                    means[lag * count + signal] += total;
                }
            }
        }
        if rows > 0 {
            means /= rows as f64;
            products.ger(-(rows as f64), &means, &means, 1.0);
            for (column, mean) in means.iter_mut().enumerate() {
                *mean += levels[column % count];
            }
        }
        Self { signals: count, longest, rows, means, products }
    }

    /// Adds those of other rows, of as many signals and lags. O(q^2 L^2).
    pub fn merge(&mut self, other: &Self) {
        let rows = self.rows + other.rows;
        if other.rows == 0 || other.products.shape() != self.products.shape() {
            return;
        }
        let apart = &other.means - &self.means;
        let share = other.rows as f64 / rows as f64;
        self.products += &other.products;
        self.products.ger(self.rows as f64 * share, &apart, &apart, 1.0);
        self.means.axpy(share, &apart, 1.0);
        self.rows = rows;
    }

    /// N.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// L.
    pub fn longest(&self) -> usize {
        self.longest
    }

    /// Whether no square has left the range of numbers.
    pub fn is_finite(&self) -> bool {
        self.products.iter().all(|product| product.is_finite())
    }

    /// The matrix S/N.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.products / self.rows.max(1) as f64
    }

    /// The entry of S of two lagged signals, each given by its number and its lag.
    pub fn product(&self, left: (usize, usize), right: (usize, usize)) -> f64 {
        let place = |(signal, lag): (usize, usize)| lag * self.signals + signal;
        self.products[(place(left), place(right))]
    }

    /// `Phi' Phi`, `Phi' y` and `y' y` of the regression of one signal on lags of some, and on a constant, which is
    /// eliminated. The signals of the taps count among `signals`, the first of which is y.
    pub fn normal_equations(&self, signals: &[usize], taps: &[Taps]) -> (DMatrix<f64>, DVector<f64>, f64) {
        let columns: Vec<((usize, usize), f64)> = taps
            .iter()
            .flat_map(|taps| (0..taps.count).map(|i| ((signals[taps.signal], taps.first + i), taps.sign)))
            .collect();
        let target = (signals[0], 0);
        let entry = |row: usize, column: usize| {
            let ((left, s), (right, r)) = (columns[row], columns[column]);
            s * r * self.product(left, right)
        };
        let right = columns.iter().map(|&(column, sign)| sign * self.product(column, target));
        (
            DMatrix::from_fn(columns.len(), columns.len(), entry),
            DVector::from_iterator(columns.len(), right),
            self.product(target, target),
        )
    }
}
