//! Rows that a finding names: not all of very many.

use crate::data::Rows;

/// This many places of a kind are named.
pub(super) const NAMED: usize = 20;

/// The first ranges of rows at these positions, which rise.
pub(super) fn ranges(positions: impl Iterator<Item = usize>) -> Vec<Rows> {
    let mut ranges = Vec::new();
    positions.take_while(|position| name(&mut ranges, *position)).for_each(drop);
    ranges
}

/// Adds the row at a position after the others, unless enough are named; says whether it is among them.
pub(super) fn name(ranges: &mut Vec<Rows>, position: usize) -> bool {
    let full = ranges.len() >= NAMED;
    match ranges.last_mut() {
        Some(last) if last.last() == position => {
            *last = Rows::from_positions(&(last.first() - 1..position + 1))
        }
        _ if full => return false,
        _ => ranges.push(Rows::from_positions(&(position..position + 1))),
    }
    true
}
