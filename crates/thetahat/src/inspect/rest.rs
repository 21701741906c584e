//! Where a step test begins.

use std::ops::Range;

/// An input that changes at most this many times is one of a step test.
pub(super) const FEW_CHANGES: usize = 5;
/// And it moves in no more than this part of the rows: a step may take several, noise moves in all of them.
pub(super) const MOVES: f64 = 0.25;
/// At rest the standard deviation of an output is no more than this part of its range, and neither is what it moves by:
/// the difference between the means of the first and the second half.
const STAYS: f64 = 0.05;
/// Fewer rows do not show that the output stays.
const FEWEST: usize = 5;

/// How many first rows a step test is at rest: all inputs hold their first value, and so does the output but for noise.
/// None where it is no step test, that is if an input changes more than five times or none changes at all, or if that
/// is not seen in five rows. O(N).
pub(super) fn rest(inputs: &[&[f64]], output: &[f64], segments: &[Range<usize>]) -> Option<usize> {
    let first = segments.first()?;
    let changes = |input: &[f64]| segments.iter().map(|rows| changes(&input[rows.clone()])).sum::<usize>();
    let count: usize = segments.iter().map(Range::len).sum();
    let moves = |input: &[f64]| {
        let each = segments.iter().flat_map(|rows| input[rows.clone()].windows(2));
        each.filter(|pair| pair[0] != pair[1]).count() as f64
    };
    let few = |input: &&[f64]| changes(input) <= FEW_CHANGES && moves(input) <= MOVES * count as f64;
    if inputs.is_empty() || !inputs.iter().all(few) {
        return None;
    }
    let holds = |row: &usize| inputs.iter().all(|input| input[*row] == input[first.start]);
    let rows = first.clone().take_while(holds).count();
    if rows == first.len() || rows < FEWEST {
        return None;
    }
    let all = segments.iter().cloned().flatten().map(|row| output[row]);
    let (low, high) =
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (value.min(low), value.max(high)));
    let limit = STAYS * (high - low);
    let at_rest = &output[first.start..first.start + rows];
    let (earlier, later) = at_rest.split_at(rows / 2);
    let moves = (mean(later) - mean(earlier)).abs();
    let centre = mean(at_rest);
    let variance = at_rest.iter().map(|value| (value - centre).powi(2)).sum::<f64>() / rows as f64;
    (limit > 0.0 && moves <= limit && variance.sqrt() <= limit).then_some(rows)
}

/// How often a signal leaves a value that it held: a step that takes several rows is one.
fn changes(values: &[f64]) -> usize {
    let moves = |row: usize| values[row] != values[row - 1];
    (1..values.len()).filter(|&row| moves(row) && (row == 1 || !moves(row - 1))).count()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
