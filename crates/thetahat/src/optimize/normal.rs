//! Normal equations on preallocated memory: a Cholesky factor that knows dependent columns.

/// A pivot below this fraction of its diagonal entry is rounding.
const DEPENDENT: f64 = 1e-13;

/// `G = L L'` in place for a symmetric matrix of `size` rows, of which the lower triangle is read and replaced by L. Gives
/// the number of columns that depend on those before them: they are left out, and solutions are zero there. n^3/6 multiply-adds.
pub(crate) fn factor(matrix: &mut [f64], size: usize) -> usize {
    let mut dependent = 0;
    for column in 0..size {
        let (above, below) = matrix.split_at_mut((column + 1) * size);
        let row = &mut above[column * size..][..=column];
        let (earlier, diagonal) = row.split_at_mut(column);
        let pivot = diagonal[0] - earlier.iter().map(|value| value * value).sum::<f64>();
        let independent = pivot > DEPENDENT * diagonal[0];
        // Divided by infinity, what belongs to a dependent column becomes zero.
        let root = if independent { pivot.sqrt() } else { f64::INFINITY };
        dependent += usize::from(!independent);
        diagonal[0] = root;
        for other in below.chunks_exact_mut(size) {
            let products = earlier.iter().zip(&*other).map(|(a, b)| a * b).sum::<f64>();
            other[column] = (other[column] - products) / root;
        }
    }
    dependent
}

/// Solves `L L' x = right` in place. n^2 multiply-adds.
pub(crate) fn solve(factor: &[f64], size: usize, right: &mut [f64]) {
    for row in 0..size {
        let known: f64 = factor[row * size..][..row].iter().zip(&*right).map(|(a, x)| a * x).sum();
        right[row] = (right[row] - known) / factor[row * size + row];
    }
    for row in (0..size).rev() {
        let known: f64 = (row + 1..size).map(|below| factor[below * size + row] * right[below]).sum();
        right[row] = (right[row] - known) / factor[row * size + row];
    }
}
