//! The rows of one part.

use std::ops::Range;

use crate::data::{Log, Rows};

/// The rows of a part, with those before it in front.
pub(super) struct Part<'l> {
    pub(super) log: &'l Log,
    /// How many rows are of the parts before it.
    pub(super) past: usize,
}

impl Part<'_> {
    /// The segments of some signals that have rows of the part's own.
    pub(super) fn segments(&self, signals: &[&[f64]]) -> Vec<Range<usize>> {
        let Ok(all) = Rows::new(1, self.log.rows()) else { return Vec::new() };
        let mut segments = self.log.segments_of(signals, &[all]);
        segments.retain(|segment| segment.end > self.past);
        segments
    }

    /// Such segments, cut in front so that those of their samples that have all lags up to the longest are rows of the
    /// part's own.
    pub(super) fn own(&self, segments: &[Range<usize>], longest: usize) -> Vec<Range<usize>> {
        let first = self.past.saturating_sub(longest);
        segments.iter().map(|segment| segment.start.max(first)..segment.end).collect()
    }
}
