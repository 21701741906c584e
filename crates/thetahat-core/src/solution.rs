//! What a least squares problem answers.

use nalgebra::{OMatrix, OVector};

use crate::triangle::{column, column_mut, dot, norm};
use crate::{Dimension, Real};

/// The solution of a least squares problem: the parameters, and how sure they are.
///
/// With rows φ(k)' and outputs y(k), k = 1 … m, and R the triangular factor of the rows,
///
/// ```text
/// θ̂ = arg min Σ (y(k) - φ(k)'θ)²          parameters
/// SSE = Σ (y(k) - φ(k)'θ̂)²                 residual sum of squares
/// σ̂² = SSE / (m - n)                       residual variance
/// cov θ̂ = σ̂² (R'R)⁻¹ = σ̂² R⁻¹ R⁻¹'         covariance
/// ```
///
/// The variance and what follows from it are estimates for residuals that are white and independent of φ.
/// They are `None` if m = n: then the rows fix the parameters and say nothing of the residuals.
///
/// Units: θ̂_j has the unit of y over that of φ_j.
///
/// Source: Ljung, System Identification, 2nd ed., section 7.3 and appendix II.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Error, LeastSquares};
///
/// // A mean: (1 + 2 + 3)/3, with the residual variance 2/(3 - 1) and the standard error √(1/3).
/// let mut rows = LeastSquares::<f64, Const<1>>::new();
/// for y in [1.0, 2.0, 3.0] {
///     rows.add(&Vector1::new(1.0), y)?;
/// }
/// let solution = rows.solve()?;
/// assert!((solution.parameters()[0] - 2.0).abs() < 1e-14);
/// assert!((solution.residual_variance().unwrap() - 1.0).abs() < 1e-14);
/// assert!((solution.standard_errors().unwrap()[0] - 3f64.sqrt().recip()).abs() < 1e-14);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solution<T: Real, N: Dimension> {
    pub(crate) parameters: OVector<T, N>,
    /// R^-1, transposed: column i is row i of R^-1, from the diagonal on.
    pub(crate) inverse_rows: OMatrix<T, N, N>,
    pub(crate) residual_norm: T,
    pub(crate) rows: usize,
}

impl<T: Real, N: Dimension> Solution<T, N> {
    /// The parameters θ̂.
    pub fn parameters(&self) -> &OVector<T, N> {
        &self.parameters
    }

    /// The norm of the residuals, the square root of SSE.
    pub fn residual_norm(&self) -> T {
        self.residual_norm
    }

    /// The sum of the squared residuals, SSE.
    ///
    /// It underflows to 0 where [`residual_norm`](Solution::residual_norm) does not yet.
    pub fn residual_sum_of_squares(&self) -> T {
        self.residual_norm * self.residual_norm
    }

    /// The number of rows less the number of parameters, m - n.
    pub fn degrees_of_freedom(&self) -> usize {
        self.rows.saturating_sub(self.parameters.len())
    }

    /// The residual variance σ̂² = SSE / (m - n). `None` if m = n.
    pub fn residual_variance(&self) -> Option<T> {
        self.standard_deviation().map(|deviation| deviation * deviation)
    }

    /// The covariance of the parameters, σ̂² (R'R)⁻¹, n x n. `None` if m = n.
    ///
    /// It comes from R⁻¹; R'R is never formed. An entry too large for `T` is infinite. n³ flops.
    pub fn covariance(&self) -> Option<OMatrix<T, N, N>> {
        let errors = self.standard_errors()?;
        let size = errors.len();
        // Correlations first: they lie in -1 … 1, so that no partial sum overflows.
        let mut units = self.inverse_rows.clone();
        for index in 0..size {
            let unit = column_mut(units.as_mut_slice(), size, index);
            let length = norm(unit.iter());
            for entry in unit {
                *entry /= length;
            }
        }
        let units = units.as_slice();
        let mut covariance = self.inverse_rows.shape_generic().0.square(T::zero());
        for (j, &error_j) in errors.as_slice().iter().enumerate() {
            let entries = column_mut(covariance.as_mut_slice(), size, j);
            for (i, (entry, &error_i)) in entries.iter_mut().zip(errors.as_slice()).enumerate() {
                let correlation = dot(column(units, size, i), column(units, size, j));
                // In this order the matrix is symmetric to the bit, and an infinity never meets a zero.
                *entry = correlation * error_i.max(error_j) * error_i.min(error_j);
            }
        }
        Some(covariance)
    }

    /// The standard errors of the parameters: the square roots of the diagonal of
    /// [`covariance`](Solution::covariance). `None` if m = n.
    ///
    /// Nothing is squared on the way, so that badly scaled columns do not overflow. n² flops.
    pub fn standard_errors(&self) -> Option<OVector<T, N>> {
        let deviation = self.standard_deviation()?;
        let (size, _) = self.inverse_rows.shape_generic();
        let mut errors = size.vector(T::zero());
        for (index, error) in errors.as_mut_slice().iter_mut().enumerate() {
            let inverse_row = column(self.inverse_rows.as_slice(), self.parameters.len(), index);
            *error = deviation * norm(inverse_row.iter());
        }
        Some(errors)
    }

    /// The square root of the residual variance.
    fn standard_deviation(&self) -> Option<T> {
        match self.degrees_of_freedom() {
            0 => None,
            freedom => Some(self.residual_norm / T::from_count(freedom).sqrt()),
        }
    }
}
