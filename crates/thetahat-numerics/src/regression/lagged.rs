//! Rows of lagged signals.

use std::ops::Range;

/// What stands for the samples before the first of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presample {
    /// Nothing: samples without a full regressor are left out.
    Drop,
    /// Zeros: all samples count.
    Zero,
}

/// Consecutive lags of one signal: `count` columns `sign * x(t - first - i)`.
#[derive(Debug, Clone, Copy)]
pub struct Taps {
    /// Which of the signals.
    pub signal: usize,
    /// The smallest lag.
    pub first: usize,
    /// How many lags.
    pub count: usize,
    /// The sign of the columns.
    pub sign: f64,
}

impl Taps {
    pub(super) fn last(&self) -> usize {
        (self.first + self.count).saturating_sub(1)
    }
}

/// The regression of `signals[0](t)` on lagged signals.
#[derive(Debug)]
pub struct Lagged<'a> {
    pub(super) signals: Vec<&'a [f64]>,
    pub(super) taps: Vec<Taps>,
    pub(super) segments: &'a [Range<usize>],
    initial: Presample,
    /// The first sample of a segment that has a full regressor.
    pub(super) longest: usize,
}

impl<'a> Lagged<'a> {
    /// `segments` are ranges of samples inside every signal; the target is `signals[0]`.
    pub fn new(
        signals: &[&'a [f64]],
        taps: Vec<Taps>,
        segments: &'a [Range<usize>],
        initial: Presample,
    ) -> Self {
        let longest = taps.iter().filter(|taps| taps.count > 0).map(Taps::last).max().unwrap_or(0);
        Self { signals: signals.to_vec(), taps, segments, initial, longest }
    }

    /// Leaves out the first `first` samples of each segment, those with a full regressor too; all samples count still
    /// where zeros stand before a segment.
    pub fn after(self, first: usize) -> Self {
        Self { longest: self.longest.max(first), ..self }
    }

    /// Sample `row - lag` of a signal, zero before the segment's start.
    pub(super) fn sample(&self, signal: usize, start: usize, row: usize, lag: usize) -> f64 {
        sample(&self.signals, signal, start, row, lag)
    }

    /// The signal, lag and sign of each column.
    pub(super) fn columns(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.taps
            .iter()
            .flat_map(|taps| (0..taps.count).map(move |i| (taps.signal, taps.first + i, taps.sign)))
    }

    /// The samples of a segment that count.
    pub(super) fn counted(&self, segment: &Range<usize>) -> Range<usize> {
        match self.initial {
            Presample::Drop => (segment.start + self.longest).min(segment.end)..segment.end,
            Presample::Zero => segment.clone(),
        }
    }

    /// The number of rows N.
    pub fn rows(&self) -> usize {
        self.segments.iter().map(|segment| self.counted(segment).len()).sum()
    }
}

/// Sample `row - lag` of a signal, zero before the segment's start.
pub(super) fn sample<S: AsRef<[f64]>>(
    signals: &[S],
    signal: usize,
    start: usize,
    row: usize,
    lag: usize,
) -> f64 {
    if row < start + lag { 0.0 } else { signals[signal].as_ref()[row - lag] }
}
