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
//! faer's blocked QR was tried first. Since 0.24 it treats a column as dependent when what the columns
//! before it leave is below 16 m eps of its norm (m rows), and drops that rest: at m = 1024 that is 4e-12,
//! which spoils the fourth digit at a condition number of 1e8. These reflections drop nothing, and their
//! eight-lane sums give the same bits on every instruction set.

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, Dyn};

use super::kernel::{add_scaled, product};

/// Rows folded at once: with some ten columns a block stays in the first-level cache.
pub(super) const ROWS: usize = 256;

/// A triangular factor that takes blocks of rows. Column p is the target.
pub(super) struct Folding {
    /// R, (p + 1) x (p + 1).
    triangle: DMatrix<f64>,
    rows: usize,
    /// The block's columns, one behind the other.
    block: Vec<f64>,
}

impl Folding {
    pub(super) fn new(parameters: usize) -> Self {
        let size = parameters + 1;
        Self { triangle: DMatrix::zeros(size, size), rows: 0, block: vec![0.0; size * ROWS] }
    }

    /// Folds a block of at most [`ROWS`] rows; `fill` writes its columns.
    pub(super) fn fold(&mut self, rows: usize, mut fill: impl FnMut(usize, &mut [f64])) {
        let size = self.triangle.ncols();
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

    /// The factor of all rows so far; each column, the target last, is divided by its scale.
    pub(super) fn finish(
        mut self,
        scales: impl Iterator<Item = f64>,
    ) -> Result<LeastSquares<f64, Dyn>, thetahat_core::Error> {
        for (mut column, scale) in self.triangle.column_iter_mut().zip(scales) {
            column.unscale_mut(scale);
        }
        let size = self.triangle.ncols() - 1;
        let factor = self.triangle.view((0, 0), (size, size)).into_owned();
        let rotated = self.triangle.view((0, size), (size, 1)).column(0).into_owned();
        LeastSquares::from_factor(&factor, &rotated, self.triangle[(size, size)].abs(), self.rows)
    }
}
