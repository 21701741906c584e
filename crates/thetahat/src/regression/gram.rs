//! The Gram matrix of lagged signals from their lagged products.
//!
//! An entry is a product of two signals over a window that moves with the lag,
//!
//! ```text
//! G(l, m) = sum_{t0 <= t < t1} x(t - l) z(t - m) = sum_{t0 - l <= tau < t1 - l} x(tau) z(tau - d),  d = m - l.
//! ```
//!
//! All entries of two signals with the same d share one long sum, their common interior, and differ by
//! at most L products at each end (L is the longest lag). The ends are added to the interior, never
//! subtracted from a longer sum: subtraction loses digits when a signal grows.
//! Cost for p lags: about 2 N p multiply-adds and one reading of the signals, instead of N p^2 / 2, however short
//! the segments are.

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::blocks::{Stretch, blocks, sum_blocks};
use super::kernel::correlations;
use super::lagged::Lagged;

/// The lags `low..=high` of one signal; they stand at `offset` in the list of all lags.
struct Span {
    signal: usize,
    low: usize,
    high: usize,
    offset: usize,
}

/// The entries of two signals whose lags differ by d.
struct Diagonal<'s> {
    left: &'s Span,
    right: &'s Span,
    difference: isize,
}

impl Diagonal<'_> {
    /// The lags of the left signal on this diagonal.
    fn lags(&self) -> Range<usize> {
        let low = self.left.low.max(self.right.low.saturating_add_signed(-self.difference));
        let high = self.left.high.min(self.right.high.saturating_add_signed(-self.difference));
        low..high + 1
    }

    /// `x(row - lag) z(row - lag - d)`, zero before the segment's start.
    fn product(&self, lagged: &Lagged<'_>, start: usize, row: usize, lag: usize) -> f64 {
        lagged.sample(self.left.signal, start, row, lag)
            * lagged.sample(self.right.signal, start, row, lag.saturating_add_signed(self.difference))
    }

    fn entry(&self, lag: usize, size: usize) -> usize {
        let left = self.left.offset + lag - self.left.low;
        let right = self.right.offset + lag.saturating_add_signed(self.difference) - self.right.low;
        left * size + right
    }
}

/// `Phi' Phi`, `Phi' y` and `y' y` of a regression. O(N p) time, O(p^2) memory.
pub(super) fn gram(lagged: &Lagged<'_>) -> (DMatrix<f64>, DVector<f64>, f64) {
    let (spans, size) = spans(lagged);
    let diagonals = diagonals(&spans);
    let longest = lagged.longest();

    let mut interiors = Vec::new();
    let mut entries = vec![0.0; size * size];
    for segment in lagged.segments() {
        let start = segment.start;
        let rows = lagged.counted(segment);
        if rows.is_empty() {
            continue;
        }
        // Inside every window: tau from t0, and L samples into the segment so that every partner
        // exists, up to t1 - L.
        let interior = rows.start.max(start + longest)..rows.end.saturating_sub(longest);
        for diagonal in &diagonals {
            add_ends(lagged, diagonal, start, &rows, &interior, size, &mut entries);
        }
        interiors.push(Stretch { start, rows: interior });
    }
    let shared = sum_blocks(&blocks(interiors.into_iter()), diagonals.len(), |stretch, sums| {
        add_interior(lagged, &diagonals, &stretch.rows, sums);
    });
    for (diagonal, shared) in diagonals.iter().zip(shared) {
        for lag in diagonal.lags() {
            entries[diagonal.entry(lag, size)] += shared;
        }
    }

    let position = |signal: usize, lag: usize| {
        let span = spans.iter().find(|span| span.signal == signal);
        span.map_or(0, |span| span.offset + lag - span.low)
    };
    let columns: Vec<(usize, f64)> =
        lagged.columns().map(|(signal, lag, sign)| (position(signal, lag), sign)).collect();
    let entry = |a: usize, b: usize| entries[a.min(b) * size + a.max(b)];
    let target = position(0, 0);
    let matrix = DMatrix::from_fn(columns.len(), columns.len(), |row, column| {
        let ((a, s), (b, r)) = (columns[row], columns[column]);
        s * r * entry(a, b)
    });
    let right = DVector::from_iterator(columns.len(), columns.iter().map(|&(a, s)| s * entry(a, target)));
    (matrix, right, entry(target, target))
}

/// One span for each signal in use (the target, lag 0, first) and the number of all lags.
fn spans(lagged: &Lagged<'_>) -> (Vec<Span>, usize) {
    let mut spans = vec![Span { signal: 0, low: 0, high: 0, offset: 0 }];
    for taps in lagged.taps().iter().filter(|taps| taps.count > 0) {
        match spans.iter_mut().find(|span| span.signal == taps.signal) {
            Some(span) => {
                span.low = span.low.min(taps.first);
                span.high = span.high.max(taps.last());
            }
            None => spans.push(Span { signal: taps.signal, low: taps.first, high: taps.last(), offset: 0 }),
        }
    }
    let mut size = 0;
    for span in &mut spans {
        span.offset = size;
        size += span.high - span.low + 1;
    }
    (spans, size)
}

/// All diagonals, those of two signals beside one another with d falling.
fn diagonals(spans: &[Span]) -> Vec<Diagonal<'_>> {
    let mut diagonals = Vec::new();
    for (position, left) in spans.iter().enumerate() {
        for right in &spans[position..] {
            let largest = right.high as isize - left.low as isize;
            let smallest =
                if left.signal == right.signal { 0 } else { right.low as isize - left.high as isize };
            diagonals.extend((smallest..=largest).rev().map(|difference| Diagonal {
                left,
                right,
                difference,
            }));
        }
    }
    diagonals
}

/// Adds the products of the interior samples `taus`, diagonal by diagonal.
fn add_interior(lagged: &Lagged<'_>, diagonals: &[Diagonal<'_>], taus: &Range<usize>, sums: &mut [f64]) {
    let same = |a: &Diagonal<'_>, b: &Diagonal<'_>| {
        a.left.signal == b.left.signal && a.right.signal == b.right.signal
    };
    let mut sums = sums;
    for pair in diagonals.chunk_by(same) {
        let (into, rest) = sums.split_at_mut(pair.len());
        sums = rest;
        let (Some(first), Some(last)) = (pair.first(), pair.last()) else { continue };
        let x = &lagged.signal(first.left.signal)[taus.clone()];
        // z(tau - d) with d falling: the same stretch of the partner, one sample later each.
        let from = taus.start.saturating_add_signed(-first.difference);
        let to = taus.end.saturating_add_signed(-last.difference);
        correlations(x, &lagged.signal(first.right.signal)[from..to], into);
    }
}

/// Adds what a diagonal's entries have outside the interior of one segment, of which the samples `rows` count.
fn add_ends(
    lagged: &Lagged<'_>,
    diagonal: &Diagonal<'_>,
    start: usize,
    rows: &Range<usize>,
    interior: &Range<usize>,
    size: usize,
    entries: &mut [f64],
) {
    let product = |row: usize, lag: usize| diagonal.product(lagged, start, row, lag);
    // A lag, or its partner, that is as long as the segment meets zeros only.
    let length = rows.end - start;
    let mut lags = diagonal.lags();
    lags.end = lags.end.min(length).min(length.saturating_add_signed(-diagonal.difference));
    while lags.start < lags.end {
        // Lags of which the windows share a sample: all of them, or as many as there are rows.
        let (low, high) = (lags.start, lags.end.min(lags.start + rows.len()) - 1);
        lags.start = high + 1;
        // Row t has tau = t - l. The windows part into a head, a body that they share, and a tail. Without an
        // interior the body is empty and lies where the last window ends.
        let (head_end, tail_start) = if interior.is_empty() {
            (rows.end - (high - low), rows.end)
        } else {
            (interior.start + low, interior.end + high)
        };
        // The head grows by row t0 with each further lag, the tail by the last row with each lag less.
        let mut head: f64 = (rows.start..head_end).map(|row| product(row, low)).sum();
        for lag in low..=high {
            entries[diagonal.entry(lag, size)] += head;
            if lag < high {
                head += product(rows.start, lag + 1);
            }
        }
        let mut tail: f64 = (tail_start..rows.end).map(|row| product(row, high)).sum();
        for lag in (low..=high).rev() {
            entries[diagonal.entry(lag, size)] += tail;
            if lag > low {
                tail += product(rows.end - 1, lag - 1);
            }
        }
    }
}
