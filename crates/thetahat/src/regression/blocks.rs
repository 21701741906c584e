//! Long sums in fixed blocks, folded in index order: the same bits on any number of threads.

use std::ops::Range;

use rayon::prelude::*;

/// Samples in a block: a few signals of it fit the second-level cache.
const BLOCK: usize = 1 << 13;
/// Blocks from which threads pay for themselves.
const PARALLEL_FROM: usize = 8;

/// Cuts ranges of samples into blocks.
pub(super) fn blocks(ranges: impl Iterator<Item = Range<usize>>) -> Vec<Range<usize>> {
    ranges
        .flat_map(|range| {
            let end = range.end;
            range.step_by(BLOCK).map(move |first| first..(first + BLOCK).min(end))
        })
        .collect()
}

/// The sum over all blocks of the `size` values that `of` writes for each of them.
pub(super) fn sum_blocks<B: Sync>(blocks: &[B], size: usize, of: impl Fn(&B, &mut [f64]) + Sync) -> Vec<f64> {
    let one = |block: &B| {
        let mut sums = vec![0.0; size];
        of(block, &mut sums);
        sums
    };
    let mut sums: Vec<Vec<f64>> = if blocks.len() < PARALLEL_FROM {
        blocks.iter().map(one).collect()
    } else {
        blocks.par_iter().map(one).collect()
    };
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
