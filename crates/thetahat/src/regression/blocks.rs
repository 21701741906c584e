//! Long sums in fixed blocks, folded in index order: the same bits on any number of threads.

use std::ops::Range;

use rayon::prelude::*;

/// Samples in a block: a few signals of it fit the second-level cache.
const BLOCK: usize = 1 << 13;
/// Blocks from which threads pay for themselves.
const PARALLEL_FROM: usize = 8;

/// Consecutive samples of one segment, which begins at sample `start`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stretch {
    pub(super) start: usize,
    pub(super) rows: Range<usize>,
}

/// Cuts stretches into blocks: a long one gives many blocks, many short ones share one, so that neither
/// 10^6 samples nor 10^5 segments cost more than their samples do.
pub(super) fn blocks(stretches: impl Iterator<Item = Stretch>) -> Vec<Vec<Stretch>> {
    let mut blocks = Vec::new();
    let mut block = Vec::new();
    let mut room = BLOCK;
    for Stretch { start, rows } in stretches {
        let mut first = rows.start;
        while first < rows.end {
            let end = rows.end.min(first + room);
            block.push(Stretch { start, rows: first..end });
            room -= end - first;
            first = end;
            if room == 0 {
                blocks.push(std::mem::take(&mut block));
                room = BLOCK;
            }
        }
    }
    if !block.is_empty() {
        blocks.push(block);
    }
    blocks
}

/// What `of` makes of each block, in their order.
pub(super) fn map_blocks<T: Send>(blocks: &[Vec<Stretch>], of: impl Fn(&[Stretch]) -> T + Sync) -> Vec<T> {
    if blocks.len() < PARALLEL_FROM {
        blocks.iter().map(|block| of(block)).collect()
    } else {
        blocks.par_iter().map(|block| of(block)).collect()
    }
}

/// The sum over all stretches of the `size` values that `add` adds for each of them.
pub(super) fn sum_blocks(
    blocks: &[Vec<Stretch>],
    size: usize,
    add: impl Fn(&Stretch, &mut [f64]) + Sync,
) -> Vec<f64> {
    let mut sums = map_blocks(blocks, |block| {
        let mut sums = vec![0.0; size];
        for stretch in block {
            add(stretch, &mut sums);
        }
        sums
    });
    // A tree of sums: neighbours first, then neighbours of neighbours.
    while sums.len() > 1 {
        sums = sums
            .chunks(2)
            .map(|pair| match pair {
                [a, b] => a.iter().zip(b).map(|(a, b)| a + b).collect(),
                _ => pair.concat(),
            })
            .collect();
    }
    sums.pop().unwrap_or_else(|| vec![0.0; size])
}
