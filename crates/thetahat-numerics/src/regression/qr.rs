//! Householder QR by blocks of rows, for regressions that the normal equations cannot carry.
//!
//! The running triangle R and a block B of new rows are brought to one triangle by reflections that
//! leave R's zeros alone (the structured factorization of LAPACK's `tpqrt`; Golub and Van Loan, Matrix
//! Computations, 4th ed., sections 5.2.2 and 6.5.3):
//!
//! ```text
//! for each column k:   v = [alpha - beta; B_k],  beta = -sign(alpha) |(alpha, B_k)|,  alpha = R_kk
//!                      [R; B] <- (I - tau v v') [R; B]
//! ```
//!
//! These reflections drop nothing, and their eight-lane sums give the same bits on every instruction set. faer's QR
//! (0.24) does neither: a column that those before it explain to 16 m eps of its norm (m rows; 4e-12 at m = 1024) is
//! taken as dependent, the rest of it is dropped, and the factor is no longer triangular.
//!
//! Reflections are not compensated: each fold leaves an error of about eps / 4 in R, all of one sign. So rows are
//! folded in blocks of 8192, and the blocks' factors are merged by [`LeastSquares`], which is compensated (folding
//! 10^6 rows into one triangle cost five times the error bound at condition number 1).

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Error, LeastSquares};

use super::blocks::{Segment, blocks, map_blocks};
use super::kernel::{add_scaled, product};

/// Rows folded at once: with some ten columns they stay in the first-level cache.
const ROWS: usize = 256;
/// Blocks of which the factors are in memory at once.
const BATCH: usize = 16;

/// The triangular factor of the rows of `blocks`. `entry` gives the value of a row in a column, the target last;
/// column c comes multiplied by `scales[c]`, which the factor does not have.
pub(super) fn factor(
    blocks: &[Vec<Segment>],
    entry: impl Fn(&Segment, usize, usize) -> f64 + Sync,
    scales: &[f64],
) -> Result<LeastSquares<f64, Dyn>, Error> {
    let mut whole = LeastSquares::with_size(Dyn(scales.len() - 1));
    for batch in blocks.chunks(BATCH) {
        for factor in map_blocks(batch, |block| block_factor(block, &entry, scales)) {
            whole.merge(&factor?)?;
        }
    }
    Ok(whole)
}

/// The same for consecutive rows and columns of any meaning.
pub fn factor_rows(
    rows: Range<usize>,
    entry: impl Fn(usize, usize) -> f64 + Sync,
    columns: usize,
) -> Result<LeastSquares<f64, Dyn>, Error> {
    let segment = Segment { start: rows.start, rows };
    factor(&blocks(std::iter::once(segment)), |_, row, column| entry(row, column), &vec![1.0; columns])
}

/// The factor of one block.
fn block_factor(
    block: &[Segment],
    entry: &impl Fn(&Segment, usize, usize) -> f64,
    scales: &[f64],
) -> Result<LeastSquares<f64, Dyn>, Error> {
    let rows: Vec<(&Segment, usize)> =
        block.iter().flat_map(|segment| segment.rows.clone().map(move |row| (segment, row))).collect();
    let size = scales.len();
    if rows.len() < size {
        // Reflections would leave rounding in the rows of R that must be zero.
        let mut factor = LeastSquares::with_size(Dyn(size - 1));
        for &(segment, row) in &rows {
            let value = |column: usize| entry(segment, row, column) / scales[column];
            factor.add(&DVector::from_fn(size - 1, |column, _| value(column)), value(size - 1))?;
        }
        return Ok(factor);
    }
    let mut folding = Folding::new(size);
    for some in rows.chunks(ROWS) {
        folding.fold(some.len(), |column, values| {
            for (value, &(segment, row)) in values.iter_mut().zip(some) {
                *value = entry(segment, row, column);
            }
        });
    }
    folding.finish(scales)
}

/// A triangle that takes blocks of rows, on memory that is taken once. The last column is the target.
///
/// ```
/// use thetahat_numerics::regression::Folding;
///
/// // y = 2 x, in two rows.
/// let rows = [[3.0, 6.0], [4.0, 8.0]];
/// let mut folding = Folding::new(2);
/// folding.fold(2, |column, values| values.iter_mut().zip(rows).for_each(|(value, row)| *value = row[column]));
/// assert!((folding.entry(0, 1) / folding.entry(0, 0) - 2.0).abs() < 1e-15);
/// ```
#[derive(Debug)]
pub struct Folding {
    triangle: DMatrix<f64>,
    rows: usize,
    /// The new rows, column by column.
    block: Vec<f64>,
}

impl Folding {
    /// Rows that are folded at once, at most.
    pub const ROWS: usize = ROWS;

    /// For rows of so many numbers.
    pub fn new(size: usize) -> Self {
        Self { triangle: DMatrix::zeros(size, size), rows: 0, block: vec![0.0; size * ROWS] }
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        self.triangle.fill(0.0);
        self.rows = 0;
    }

    /// A number of the triangle.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        self.triangle[(row, column)]
    }

    /// Folds at most [`Self::ROWS`] rows, and of more the first; `fill` writes their columns. 2 rows size² flops.
    pub fn fold(&mut self, rows: usize, mut fill: impl FnMut(usize, &mut [f64])) {
        let (size, rows) = (self.triangle.ncols(), rows.min(ROWS));
        if rows == 0 {
            return;
        }
        let block = &mut self.block[..size * rows];
        for (column, values) in block.chunks_exact_mut(rows).enumerate() {
            fill(column, values);
        }
        for k in 0..size {
            let (head, tail) = block[k * rows..].split_at_mut(rows);
            let alpha = self.triangle[(k, k)];
            let norm = alpha.hypot(product(head, head).sqrt());
            if norm == 0.0 {
                continue;
            }
            let beta = -norm.copysign(alpha);
            // v scaled to 1 in the triangle's row.
            let pivot = alpha - beta;
            head.iter_mut().for_each(|value| *value /= pivot);
            let tau = -pivot / beta;
            self.triangle[(k, k)] = beta;
            for (column, values) in (k + 1..size).zip(tail.chunks_exact_mut(rows)) {
                let weight = tau * (self.triangle[(k, column)] + product(head, values));
                self.triangle[(k, column)] -= weight;
                add_scaled(values, -weight, head);
            }
        }
        self.rows += rows;
    }

    /// The factor of all rows so far, with its columns divided by their scales.
    fn finish(mut self, scales: &[f64]) -> Result<LeastSquares<f64, Dyn>, Error> {
        for (mut column, scale) in self.triangle.column_iter_mut().zip(scales) {
            column.unscale_mut(*scale);
        }
        let size = self.triangle.ncols() - 1;
        let factor = self.triangle.view((0, 0), (size, size)).into_owned();
        let rotated = self.triangle.view((0, size), (size, 1)).column(0).into_owned();
        LeastSquares::from_factor(&factor, &rotated, self.triangle[(size, size)].abs(), self.rows)
    }
}
