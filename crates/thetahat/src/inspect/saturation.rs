//! Stretches at the largest or the smallest value.

use super::Saturation;

/// A limit must have so many rows in stretches, for each row of the most frequent value near it.
const CROWDED: usize = 5;
/// The values near a limit that it is compared with.
const NEAR: usize = 8;
/// Fewer rows in stretches are chance.
const FEWEST: usize = 5;

/// Consecutive rows of one value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    pub(super) value: f64,
    pub(super) rows: usize,
}

/// A value, and in how many rows it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Level {
    pub(super) value: f64,
    pub(super) rows: usize,
}

/// The stretches of equal values, those of missing ones left out. A missing value ends a stretch.
pub(super) fn runs(values: &[f64]) -> Vec<Run> {
    values
        .chunk_by(|left, right| left == right)
        .filter(|run| !run[0].is_nan())
        .map(|run| Run { value: run[0], rows: run.len() })
        .collect()
}

/// The different values in rising order.
pub(super) fn levels(sorted: &[f64]) -> Vec<Level> {
    sorted
        .chunk_by(|left, right| left == right)
        .map(|level| Level { value: level[0], rows: level.len() })
        .collect()
}

/// Rows in stretches of two and more at the limits, where a limit is crowded.
///
/// A clipped signal piles up at its limit: far more rows stand there than at any of the values next to it. A binary or
/// stepped signal has no such values; a smooth signal that was rounded has at most 2.4 times as many rows at its peak as at the
/// level below, whatever its curvature (a parabola spends sqrt(q) within one rounding step q
/// of its top and sqrt(2q) - sqrt(q) within the next: 1/(sqrt 2 - 1)), hence the factor of 5. A stretch with which the log begins or ends does not count:
/// experiments begin and end at rest.
pub(super) fn saturation(runs: &[Run], levels: &[Level]) -> Option<Saturation> {
    let (low, between, high) = match levels {
        [low, between @ .., high] if between.len() >= NEAR => (low, between, high),
        _ => return None,
    };
    let inner = runs.get(1..runs.len().saturating_sub(1)).unwrap_or(&[]);
    let rows = |limit: &Level, near: &[Level]| {
        let rows: usize =
            inner.iter().filter(|run| run.value == limit.value && run.rows > 1).map(|run| run.rows).sum();
        let most = near.iter().map(|level| level.rows).max().unwrap_or(0);
        if rows >= FEWEST && rows > CROWDED * most { rows } else { 0 }
    };
    let saturation =
        Saturation { low: rows(low, &between[..NEAR]), high: rows(high, &between[between.len() - NEAR..]) };
    (saturation.low + saturation.high > 0).then_some(saturation)
}
