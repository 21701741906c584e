//! Long sums in fixed blocks, folded in index order: the same bits on any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use super::total::Total;

/// Samples in a block: a few signals of it fit the second-level cache.
const BLOCK: usize = 1 << 13;
/// Blocks from which threads pay for themselves.
const PARALLEL_FROM: usize = 8;

/// Consecutive samples of one segment, which begins at sample `start`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Segment {
    pub(super) start: usize,
    pub(super) rows: Range<usize>,
}

/// Cuts segments into blocks: a long one gives many blocks, many short ones share one, so that neither
/// 10^6 samples nor 10^5 segments cost more than their samples do.
pub(super) fn blocks(segments: impl Iterator<Item = Segment>) -> Vec<Vec<Segment>> {
    let mut blocks = Vec::new();
    let mut block = Vec::new();
    let mut left = BLOCK;
    for Segment { start, rows } in segments {
        let mut first = rows.start;
        while first < rows.end {
            let end = rows.end.min(first + left);
            block.push(Segment { start, rows: first..end });
            left -= end - first;
            first = end;
            if left == 0 {
                blocks.push(std::mem::take(&mut block));
                left = BLOCK;
            }
        }
    }
    if !block.is_empty() {
        blocks.push(block);
    }
    blocks
}

/// What `of` makes of each block, in their order.
pub(super) fn map_blocks<T: Send>(blocks: &[Vec<Segment>], of: impl Fn(&[Segment]) -> T + Sync) -> Vec<T> {
    if blocks.len() < PARALLEL_FROM {
        blocks.iter().map(|block| of(block)).collect()
    } else {
        blocks.par_iter().map(|block| of(block)).collect()
    }
}

/// The sum over all segments of the `size` values that `add` adds for each of them: the first of `sums`, which has room
/// for as many for each block, at least one.
pub(super) fn sum_blocks<T: Total>(
    blocks: &[Vec<Segment>],
    size: usize,
    sums: &mut [T],
    add: impl Fn(&Segment, &mut [T]) + Sync,
) {
    sums.fill(T::ZERO);
    if size == 0 {
        return;
    }
    let of = |(block, sums): (&Vec<Segment>, &mut [T])| block.iter().for_each(|segment| add(segment, sums));
    if blocks.len() < PARALLEL_FROM {
        blocks.iter().zip(sums.chunks_mut(size)).for_each(of);
    } else {
        blocks.par_iter().zip(sums.par_chunks_mut(size)).for_each(of);
    }
    // A tree of sums: neighbours first, then neighbours of neighbours.
    let mut apart = 1;
    while apart < blocks.len() {
        for pair in sums.chunks_mut(2 * apart * size) {
            if pair.len() > apart * size {
                let (left, right) = pair.split_at_mut(apart * size);
                left[..size].iter_mut().zip(&right[..size]).for_each(|(left, right)| left.add(*right));
            }
        }
        apart *= 2;
    }
}
