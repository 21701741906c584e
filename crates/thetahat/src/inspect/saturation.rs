//! Runs at the largest or the smallest value.

use super::{Saturation, named::NAMED};
use crate::data::Rows;

/// A limit must have this many rows in runs, for each row of the most frequent value near it.
const CROWDED: usize = 5;
/// The values near a limit that it is compared with.
pub(super) const NEAR: usize = 8;
/// Fewer rows in runs are chance.
const FEWEST: usize = 5;

/// Consecutive rows of one value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    pub(super) value: f64,
    pub(super) rows: usize,
    /// The position of the first of them.
    pub(super) start: usize,
}

/// The runs of equal values, those of missing ones left out. A missing value ends a run.
pub(super) fn runs(values: &[f64]) -> impl Iterator<Item = Run> {
    let mut next = 0;
    let runs = values.chunk_by(|left, right| left == right).map(move |run| {
        let start = next;
        next += run.len();
        Run { value: run[0], rows: run.len(), start }
    });
    runs.filter(|run| !run.value.is_nan())
}

/// Rows in runs of two and more at the limits, where a limit is crowded.
///
/// A clipped signal piles up at its limit: far more rows stand there than at any of the values next to it. A binary or
/// stepped signal has no such values; a smooth signal that was rounded has at most 2.4 times as many rows at its peak
/// as at the level below, whatever its curvature (a parabola spends sqrt(q) within one rounding step q of its top and
/// sqrt(2q) - sqrt(q) within the next: 1/(sqrt 2 - 1)), hence the factor of 5. A run with which the log begins or ends
/// does not count: experiments begin and end at rest.
///
/// `sorted` are the values that are there, in rising order.
pub(super) fn saturation(values: &[f64], sorted: &[f64]) -> Option<Saturation> {
    let levels = || sorted.chunk_by(|left, right| left == right);
    // Two limits, and this many levels between them.
    levels().nth(NEAR + 1)?;
    let count = runs(values).count();
    let most = |near: &mut dyn Iterator<Item = &[f64]>| near.map(<[f64]>::len).max().unwrap_or(0);
    let at = |limit: f64| {
        // Without the first and the last.
        let inner = runs(values).take(count.saturating_sub(1)).skip(1);
        inner.filter(move |run| run.value == limit && run.rows > 1)
    };
    let rows = |limit: f64, most: usize| crowded(at(limit).map(|run| run.rows).sum(), most);
    let (lowest, highest) = (*sorted.first()?, *sorted.last()?);
    let low = rows(lowest, most(&mut levels().skip(1).take(NEAR)));
    let high = rows(highest, most(&mut levels().rev().skip(1).take(NEAR)));
    let named = |limit: f64| {
        at(limit).take(NAMED).map(|run| Rows::from_positions(&(run.start..run.start + run.rows)))
    };
    Saturation::of(low, high, || named(lowest).collect(), || named(highest).collect())
}

/// The rows at a limit, if they are more than chance: `most` are those of the most frequent value near it.
pub(super) fn crowded(rows: usize, most: usize) -> usize {
    if rows >= FEWEST && rows > CROWDED * most { rows } else { 0 }
}
