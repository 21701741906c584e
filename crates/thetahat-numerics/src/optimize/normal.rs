//! Normal equations on preallocated memory: a Cholesky factor that knows dependent columns.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, Par};

/// A pivot below this fraction of its diagonal entry is rounding.
const DEPENDENT: f64 = 1e-13;

/// How many columns are factored at once.
const BLOCK: usize = 64;

/// `G = L L'` in place for a symmetric matrix of `size` rows, of which the lower triangle is read and replaced by L.
/// Gives the number of columns that depend on those before them: they are left out, and solutions are zero there. n^3/6
/// multiply-adds.
///
/// By blocks of columns, each less what those before it explain of it, which is one product of matrices (Golub and Van
/// Loan, 4th ed. 2013, section 4.2.9): faer's own Cholesky factor stops at the first dependent column.
pub fn factor(matrix: &mut [f64], size: usize) -> usize {
    let (mut dependent, mut diagonals) = (0, [0.0; BLOCK]);
    for first in (0..size).step_by(BLOCK) {
        let count = BLOCK.min(size - first);
        for (column, diagonal) in diagonals[..count].iter_mut().enumerate() {
            *diagonal = matrix[(first + column) * (size + 1)];
        }
        if first > 0 {
            let below = MatMut::from_row_major_slice_mut(&mut matrix[first * size..], size - first, size);
            let (explained, block) = below.split_at_col_mut(first);
            let explained = explained.as_ref();
            let (block, own) = (block.subcols_mut(0, count), explained.subrows(0, count).transpose());
            matmul(block, Accum::Add, explained, own, -1.0, Par::Seq);
        }
        dependent += factor_block(&mut matrix[first * size..], size, first, &diagonals[..count]);
    }
    dependent
}

/// The columns of a block from `first` on, in the rows from there on: with the diagonal before anything was subtracted.
fn factor_block(rows: &mut [f64], size: usize, first: usize, diagonals: &[f64]) -> usize {
    let mut dependent = 0;
    for (place, whole) in diagonals.iter().enumerate() {
        let column = first + place;
        let (above, below) = rows.split_at_mut((place + 1) * size);
        let row = &mut above[place * size..][first..=column];
        let (earlier, diagonal) = row.split_at_mut(place);
        let pivot = diagonal[0] - earlier.iter().map(|value| value * value).sum::<f64>();
        let independent = pivot > DEPENDENT * whole;
        // Divided by infinity, what belongs to a dependent column becomes zero.
        let root = if independent { pivot.sqrt() } else { f64::INFINITY };
        dependent += usize::from(!independent);
        diagonal[0] = root;
        for other in below.chunks_exact_mut(size) {
            let products = earlier.iter().zip(&other[first..]).map(|(a, b)| a * b).sum::<f64>();
            other[column] = (other[column] - products) / root;
        }
    }
    dependent
}

/// Solves `L L' x = right` in place. n^2 multiply-adds.
pub fn solve(factor: &[f64], size: usize, right: &mut [f64]) {
    for row in 0..size {
        let known: f64 = factor[row * size..][..row].iter().zip(&*right).map(|(a, x)| a * x).sum();
        right[row] = (right[row] - known) / factor[row * size + row];
    }
    for row in (0..size).rev() {
        let known: f64 = (row + 1..size).map(|below| factor[below * size + row] * right[below]).sum();
        right[row] = (right[row] - known) / factor[row * size + row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// G = X'X of a matrix of this many columns, of which `copies` are sums of those before them.
    fn gram(size: usize, copies: &[usize]) -> Vec<f64> {
        let mut random = Random::of(7, 1);
        let rows = size + 20;
        let mut x: Vec<f64> = (0..rows * size).map(|_| random.normal()).collect();
        for row in x.chunks_exact_mut(size) {
            for &copy in copies {
                row[copy] = row[..copy].iter().sum();
            }
        }
        let column = |i: usize| x.iter().skip(i).step_by(size);
        let entry = |place: usize| column(place / size).zip(column(place % size)).map(|(a, b)| a * b).sum();
        (0..size * size).map(entry).collect()
    }

    #[test]
    fn solutions_solve_across_blocks() {
        for size in [1, 3, BLOCK, BLOCK + 1, 3 * BLOCK + 7] {
            let gram = gram(size, &[]);
            let truth: Vec<f64> = (0..size).map(|place| 1.0 + place as f64 / size as f64).collect();
            let product = |row: &[f64]| row.iter().zip(&truth).map(|(g, x)| g * x).sum();
            let mut right: Vec<f64> = gram.chunks_exact(size).map(product).collect();
            let mut factored = gram.clone();
            assert_eq!(factor(&mut factored, size), 0);
            solve(&factored, size, &mut right);
            let distance = right.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(distance < 1e-9, "{size}: {distance}");
            // L L' = G.
            for row in 0..size {
                for column in 0..=row {
                    let l = |row: usize| factored[row * size..][..=column].iter();
                    let product: f64 = l(row).zip(l(column)).map(|(a, b)| a * b).sum();
                    let entry = gram[row * size + column];
                    assert!((product - entry).abs() < 1e-11 * gram[0] * size as f64, "{size} {row} {column}");
                }
            }
        }
    }

    #[test]
    fn dependent_columns_are_left_out_in_each_block() {
        let (size, copies) = (2 * BLOCK + 9, [5, BLOCK + 3, 2 * BLOCK + 1]);
        let gram = gram(size, &copies);
        let mut factored = gram.clone();
        assert_eq!(factor(&mut factored, size), copies.len());
        let mut right = vec![1.0; size];
        solve(&factored, size, &mut right);
        for (place, value) in right.iter().enumerate() {
            assert_eq!(*value == 0.0, copies.contains(&place), "{place}: {value}");
        }
    }
}
