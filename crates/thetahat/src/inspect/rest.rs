//! Where a step test begins.

use std::ops::Range;

/// An input that changes so many times at most is one of a step test.
const FEW_CHANGES: usize = 5;
/// An output is at rest while it stays within this part of its range.
const STAYS: f64 = 0.05;
/// Fewer rows do not show that the output stays.
const FEWEST: usize = 5;

/// How many first rows a step test is at rest: all inputs hold their first value, and so does the output but for a twentieth of
/// its range. None where it is no step test, that is if an input changes more than five times or none changes at all, or if
/// that is not seen in five rows. O(N).
pub(super) fn rest(inputs: &[&[f64]], output: &[f64], segments: &[Range<usize>]) -> Option<usize> {
    let first = segments.first()?;
    let changes = |input: &[f64]| segments.iter().map(|rows| changes(&input[rows.clone()])).sum::<usize>();
    if inputs.is_empty() || inputs.iter().any(|input| changes(input) > FEW_CHANGES) {
        return None;
    }
    let holds = |row: &usize| inputs.iter().all(|input| input[*row] == input[first.start]);
    let rows = first.clone().take_while(holds).count();
    if rows == first.len() || rows < FEWEST {
        return None;
    }
    let range = |rows: &mut dyn Iterator<Item = usize>| {
        let (low, high) = rows.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), row| {
            (output[row].min(low), output[row].max(high))
        });
        high - low
    };
    let whole = range(&mut segments.iter().cloned().flatten());
    let stays = range(&mut (first.start..first.start + rows)) <= STAYS * whole;
    (stays && whole > 0.0).then_some(rows)
}

/// How often a signal leaves a value that it held: a step that takes several rows is one.
fn changes(values: &[f64]) -> usize {
    let moves = |row: usize| values[row] != values[row - 1];
    (1..values.len()).filter(|&row| moves(row) && (row == 1 || !moves(row - 1))).count()
}
