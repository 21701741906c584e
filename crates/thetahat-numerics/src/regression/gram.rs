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
//! They are sums of numbers, or of numbers of twice the precision (see `total`).
//! Cost for p lags: about 2 N p multiply-adds and one reading of the signals, instead of N p^2 / 2, however short
//! the segments are.

use std::ops::Range;

use faer::fx128;
use thetahat_core::nalgebra::{DMatrix, DVector};

use super::blocks::{Segment, blocks, sum_blocks};
use super::kernel::extended_sum;
use super::lagged::{Lagged, Taps, sample};
use super::total::Total;

/// The lags `low..=high` of one signal; they stand at `offset` in the list of all lags.
#[derive(Debug, Clone, Copy)]
struct Span {
    signal: usize,
    low: usize,
    high: usize,
    offset: usize,
}

/// The entries of two signals whose lags differ by d.
#[derive(Debug, Clone, Copy)]
struct Diagonal {
    left: Span,
    right: Span,
    difference: isize,
}

impl Diagonal {
    /// The lags of the left signal on this diagonal.
    fn lags(&self) -> Range<usize> {
        let low = self.left.low.max(self.right.low.saturating_add_signed(-self.difference));
        let high = self.left.high.min(self.right.high.saturating_add_signed(-self.difference));
        low..high + 1
    }

    /// `x(row - lag) z(row - lag - d)`, zero before the segment's start.
    fn product<S: AsRef<[f64]>, T: Total>(&self, signals: &[S], start: usize, row: usize, lag: usize) -> T {
        T::product(
            sample(signals, self.left.signal, start, row, lag),
            sample(signals, self.right.signal, start, row, lag.saturating_add_signed(self.difference)),
        )
    }

    fn entry(&self, lag: usize, size: usize) -> usize {
        let left = self.left.offset + lag - self.left.low;
        let right = self.right.offset + lag.saturating_add_signed(self.difference) - self.right.low;
        left * size + right
    }
}

/// Which products of lagged signals there are: those of all lags of the taps, and of the target `signals[0](t)`.
///
/// A plan, made once; sums over it take no memory of their own.
#[derive(Debug, Clone)]
pub struct Products {
    spans: Vec<Span>,
    diagonals: Vec<Diagonal>,
    size: usize,
    longest: usize,
}

/// The interior of some segments, and the buffer of the sums over it.
#[derive(Debug)]
pub struct Interior<T = f64> {
    blocks: Vec<Vec<Segment>>,
    sums: Vec<T>,
}

impl Products {
    /// The products of these signals' lags.
    pub fn new(taps: &[Taps]) -> Self {
        let used = || taps.iter().filter(|taps| taps.count > 0);
        let (spans, size) = spans(used());
        let diagonals = diagonals(&spans);
        Self { spans, diagonals, size, longest: used().map(Taps::last).max().unwrap_or(0) }
    }

    /// The number of lags, the target's among them: products have this many rows and columns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Where a lagged signal stands. Of two, the product is at `min * size + max`.
    pub fn position(&self, signal: usize, lag: usize) -> usize {
        let span = self.spans.iter().find(|span| span.signal == signal);
        span.map_or(0, |span| span.offset + lag - span.low)
    }

    /// The signal of each position.
    pub(super) fn signals(&self) -> impl Iterator<Item = usize> {
        self.spans.iter().flat_map(|span| (span.low..=span.high).map(|_| span.signal))
    }

    /// Inside every window: tau from t0, and L samples into the segment so that every partner exists, up to t1 - L.
    fn inside(&self, start: usize, rows: &Range<usize>) -> Range<usize> {
        rows.start.max(start + self.longest)..rows.end.saturating_sub(self.longest)
    }

    /// The interior of segments, each given by its first sample and the samples that count.
    pub fn interior<T: Total>(&self, segments: impl Iterator<Item = (usize, Range<usize>)>) -> Interior<T> {
        let segments = segments.map(|(start, rows)| Segment { start, rows: self.inside(start, &rows) });
        let blocks = blocks(segments);
        Interior { sums: vec![T::ZERO; blocks.len().max(1) * self.diagonals.len()], blocks }
    }

    /// Adds the products of interiors to `entries`. From sample `supports[s]` on signal s is known to be zero.
    pub fn add_interior<S: AsRef<[f64]> + Sync, T: Total>(
        &self,
        signals: &[S],
        supports: &[usize],
        interior: &mut Interior<T>,
        entries: &mut [T],
    ) {
        let count = self.diagonals.len();
        sum_blocks(&interior.blocks, count, &mut interior.sums, |segment, sums| {
            add_segment(signals, supports, &self.diagonals, &segment.rows, sums);
        });
        for (diagonal, shared) in self.diagonals.iter().zip(&interior.sums) {
            for lag in diagonal.lags() {
                entries[diagonal.entry(lag, self.size)].add(*shared);
            }
        }
    }

    /// Adds the products outside the interior of one segment to `entries`.
    pub fn add_ends<S: AsRef<[f64]>, T: Total>(
        &self,
        signals: &[S],
        start: usize,
        rows: &Range<usize>,
        entries: &mut [T],
    ) {
        if rows.is_empty() {
            return;
        }
        let interior = self.inside(start, rows);
        for diagonal in &self.diagonals {
            add_diagonal_ends(signals, diagonal, start, rows, &interior, self.size, entries);
        }
    }

    /// Adds the sum of each lagged signal over the samples `rows`, all lags of which are there, at its position. O(N +
    /// p).
    pub(super) fn add_sums(&self, signals: &[&[f64]], rows: &Range<usize>, sums: &mut [fx128]) {
        for &Span { signal, low, high, offset } in &self.spans {
            let x = signals[signal];
            let sums = &mut sums[offset..];
            if rows.len() <= high - low {
                for lag in low..=high {
                    sums[lag - low].add(extended_sum(&x[rows.start - lag..rows.end - lag]));
                }
                continue;
            }
            // What all windows share; then what each has before it, and after it.
            let shared = extended_sum(&x[rows.start - low..rows.end - high]);
            let (mut head, mut tail) = (shared, fx128::ZERO);
            for lag in low..=high {
                sums[lag - low].add(head);
                if lag < high {
                    head.add(fx128::from_f64(x[rows.start - lag - 1]));
                }
            }
            for lag in (low..high).rev() {
                tail.add(fx128::from_f64(x[rows.end - lag - 1]));
                sums[lag - low].add(tail);
            }
        }
    }

    /// All entries over some segments, each given by its first sample and the samples that count.
    pub(super) fn entries<T: Total>(
        &self,
        signals: &[&[f64]],
        segments: impl Iterator<Item = (usize, Range<usize>)> + Clone,
    ) -> Vec<T> {
        let mut entries = vec![T::ZERO; self.size * self.size];
        for (start, rows) in segments.clone() {
            self.add_ends(signals, start, &rows, &mut entries);
        }
        let mut interior = self.interior(segments.filter(|(_, rows)| !rows.is_empty()));
        let supports = vec![usize::MAX; signals.len()];
        self.add_interior(signals, &supports, &mut interior, &mut entries);
        entries
    }
}

/// The Gram matrix of z(t), z(t-1), …, z(t-L) over the samples of which all lags lie in their segment, z being the
/// values of all signals, and how many these samples are. O(N q^2 L) time for q signals, O(q^2 L^2) memory.
pub fn joint_gram(signals: &[&[f64]], segments: &[Range<usize>], longest: usize) -> (DMatrix<f64>, usize) {
    let taps = |signal| Taps { signal, first: 0, count: longest + 1, sign: 1.0 };
    let taps: Vec<Taps> = (0..signals.len()).map(taps).collect();
    let products = Products::new(&taps);
    let counted = || {
        let later = |segment: &Range<usize>| (segment.start + longest).min(segment.end)..segment.end;
        segments.iter().map(move |segment| (segment.start, later(segment)))
    };
    let entries: Vec<f64> = products.entries(signals, counted());
    let size = products.size();
    let place = |column: usize| products.position(column % signals.len(), column / signals.len());
    let matrix = DMatrix::from_fn(size, size, |row, column| {
        let (a, b) = (place(row), place(column));
        entries[a.min(b) * size + a.max(b)]
    });
    (matrix, counted().map(|(_, rows)| rows.len()).sum())
}

/// `Phi' Phi`, `Phi' y` and `y' y` of a regression. O(N p) time, O(p^2) memory.
pub fn gram(lagged: &Lagged<'_>) -> (DMatrix<f64>, DVector<f64>, f64) {
    let products = Products::new(&lagged.taps);
    let size = products.size();
    let counted = lagged.segments.iter().map(|segment| (segment.start, lagged.counted(segment)));
    let entries: Vec<f64> = products.entries(&lagged.signals, counted);

    let columns: Vec<(usize, f64)> =
        lagged.columns().map(|(signal, lag, sign)| (products.position(signal, lag), sign)).collect();
    let entry = |a: usize, b: usize| entries[a.min(b) * size + a.max(b)];
    let target = products.position(0, 0);
    let matrix = DMatrix::from_fn(columns.len(), columns.len(), |row, column| {
        let ((a, s), (b, r)) = (columns[row], columns[column]);
        s * r * entry(a, b)
    });
    let right = DVector::from_iterator(columns.len(), columns.iter().map(|&(a, s)| s * entry(a, target)));
    (matrix, right, entry(target, target))
}

/// One span for each signal in use (the target, lag 0, first) and the number of all lags.
fn spans<'t>(used: impl Iterator<Item = &'t Taps>) -> (Vec<Span>, usize) {
    let mut spans = vec![Span { signal: 0, low: 0, high: 0, offset: 0 }];
    for taps in used {
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
fn diagonals(spans: &[Span]) -> Vec<Diagonal> {
    let mut diagonals = Vec::new();
    for (position, left) in spans.iter().enumerate() {
        for right in &spans[position..] {
            let largest = right.high as isize - left.low as isize;
            let smallest =
                if left.signal == right.signal { 0 } else { right.low as isize - left.high as isize };
            diagonals.extend((smallest..=largest).rev().map(|difference| Diagonal {
                left: *left,
                right: *right,
                difference,
            }));
        }
    }
    diagonals
}

/// Adds the products of the interior samples `taus`, diagonal by diagonal.
fn add_segment<S: AsRef<[f64]>, T: Total>(
    signals: &[S],
    supports: &[usize],
    diagonals: &[Diagonal],
    taus: &Range<usize>,
    sums: &mut [T],
) {
    let same =
        |a: &Diagonal, b: &Diagonal| a.left.signal == b.left.signal && a.right.signal == b.right.signal;
    let mut sums = sums;
    for pair in diagonals.chunk_by(same) {
        let (into, rest) = sums.split_at_mut(pair.len());
        sums = rest;
        let (Some(first), Some(last)) = (pair.first(), pair.last()) else { continue };
        let x = &signals[first.left.signal].as_ref()[taus.clone()];
        // z(tau - d) with d falling: the same segment of the partner, one sample later each.
        let from = taus.start.saturating_add_signed(-first.difference);
        let to = taus.end.saturating_add_signed(-last.difference);
        if taus.start >= supports[first.left.signal] || from >= supports[first.right.signal] {
            continue;
        }
        T::add_correlations(x, &signals[first.right.signal].as_ref()[from..to], into);
    }
}

/// Adds what a diagonal's entries have outside the interior of one segment, of which the samples `rows` count.
fn add_diagonal_ends<S: AsRef<[f64]>, T: Total>(
    signals: &[S],
    diagonal: &Diagonal,
    start: usize,
    rows: &Range<usize>,
    interior: &Range<usize>,
    size: usize,
    entries: &mut [T],
) {
    let product = |row: usize, lag: usize| -> T { diagonal.product(signals, start, row, lag) };
    let total = |rows: Range<usize>, lag: usize| {
        let mut total = T::ZERO;
        rows.for_each(|row| total.add(product(row, lag)));
        total
    };
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
        let mut head = total(rows.start..head_end, low);
        for lag in low..=high {
            entries[diagonal.entry(lag, size)].add(head);
            if lag < high {
                head.add(product(rows.start, lag + 1));
            }
        }
        let mut tail = total(tail_start..rows.end, high);
        for lag in (low..=high).rev() {
            entries[diagonal.entry(lag, size)].add(tail);
            if lag > low {
                tail.add(product(rows.end - 1, lag - 1));
            }
        }
    }
}
