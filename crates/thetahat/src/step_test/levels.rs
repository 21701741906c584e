//! The levels that an input holds, and the steps between them.

use std::ops::Range;

/// A level has this many rows at least.
const FEWEST: usize = 4;
/// A value belongs to a level if it is no farther from its mean than this many standard deviations of the noise, or
/// than this fraction of the range of the input.
const NOISE: f64 = 6.0;
const SAME: f64 = 0.01;
/// A level does not move by more than this fraction of the step from it.
const FLAT: f64 = 0.1;
/// A step may take this fraction of the shorter of the levels beside it.
const QUICK: f64 = 0.05;

/// A level that the input holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    /// 0-based.
    pub(super) rows: Range<usize>,
    pub(super) value: f64,
}

/// What an input does between levels that it holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Moves {
    pub(super) steps: Vec<Jump>,
    /// Those that take too long beside their levels to be steps.
    pub(super) slow: Vec<Jump>,
}

/// A step from one level to another.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Jump {
    pub(super) from: Level,
    /// From the first row after the step on.
    pub(super) to: Level,
    /// How many rows the input took, 0 for a step at once.
    pub(super) taken: usize,
}

/// The standard deviation of the noise on an input that jumps seldom: from the median of its changes, which noise alone
/// makes.
pub(super) fn noise(input: &[f64]) -> f64 {
    // The median of |x| of a standard normal number, and two values in each change.
    const MEDIAN: f64 = 0.674_489_750_196_081_7 * std::f64::consts::SQRT_2;
    let mut changes: Vec<f64> = input.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let middle = changes.len() / 2;
    if changes.is_empty() {
        return 0.0;
    }
    let (_, median, _) = changes.select_nth_unstable_by(middle, f64::total_cmp);
    *median / MEDIAN
}

/// The steps of an input: from one level to the next, where both are held, are flat, and the way between them is short.
/// What lies between levels, such as the ramp of an actuator, is part of the step; it counts from the row in which the
/// input leaves the level. O(N).
pub(super) fn moves(input: &[f64]) -> Moves {
    let (low, high) =
        input.iter().fold((f64::MAX, f64::MIN), |(low, high), value| (value.min(low), value.max(high)));
    let tolerance = (NOISE * noise(input)).max(SAME * (high - low));
    let levels = levels(input, tolerance);
    let mut moves = Moves::default();
    for pair in levels.windows(2) {
        let [from, to] = pair else { continue };
        let size = (to.value - from.value).abs();
        let taken = to.rows.start - from.rows.end;
        let flat = |level: &Level| drift(&input[level.rows.clone()]) <= FLAT * size;
        let quick = taken as f64 <= QUICK * from.rows.len().min(to.rows.len()) as f64;
        if size > tolerance && flat(from) && flat(to) {
            let to = Level { rows: from.rows.end..to.rows.end, value: to.value };
            let jump = Jump { from: from.clone(), to, taken };
            if quick { moves.steps.push(jump) } else { moves.slow.push(jump) }
        }
    }
    moves
}

/// Runs of values near their mean.
fn levels(input: &[f64], tolerance: f64) -> Vec<Level> {
    let mut levels = Vec::new();
    let (mut start, mut sum) = (0, 0.0);
    for row in 0..=input.len() {
        let count = (row - start) as f64;
        let near = |value: &f64| row == start || (value - sum / count).abs() <= tolerance;
        match input.get(row).filter(|value| near(value)) {
            Some(value) => sum += value,
            None => {
                if row - start >= FEWEST {
                    levels.push(Level { rows: start..row, value: sum / count });
                }
                (start, sum) = (row, input.get(row).copied().unwrap_or(0.0));
            }
        }
    }
    levels
}

/// How far the mean of the last third of some values is from that of the first one.
fn drift(values: &[f64]) -> f64 {
    let third = values.len().div_ceil(3);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    (mean(&values[values.len() - third..]) - mean(&values[..third])).abs()
}
