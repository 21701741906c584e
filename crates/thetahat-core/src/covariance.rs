//! A covariance, kept as its U·D·U' factors.

use nalgebra::{OMatrix, OVector};

use crate::triangle::{column, column_mut};
use crate::{Dimension, Error, Real, ud};

/// The covariance P of a vector of n numbers: symmetric, no variance negative, and so for ever.
///
/// ```text
/// P = U D U'          U unit upper triangular, D diagonal and not negative
/// ```
///
/// It is kept as these factors, so that no rounding makes it indefinite. P may be singular: a variance of 0
/// says that something is known.
///
/// Units: P_ij has the product of the units of elements i and j. Memory: n² numbers.
///
/// Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter III.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, Vector2};
/// use thetahat_core::{Covariance, Error};
///
/// let given = Matrix2::new(4.0, 1.0, 1.0, 2.0);
/// let covariance: Covariance<f64, Const<2>> = Covariance::new(&given)?;
/// assert!((covariance.matrix() - given).amax() < 1e-15);
///
/// let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
/// assert!(matches!(Covariance::new(&indefinite), Err(Error::NotPositive { .. })));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance<T: Real, N: Dimension> {
    /// D on the diagonal, U above it, zeros below.
    factor: OMatrix<T, N, N>,
}

impl<T: Real, N: Dimension> Covariance<T, N> {
    /// Factors a symmetric matrix, n x n.
    ///
    /// Errors: [`Error::Length`] if it is not square (only with `Dyn`); [`Error::NotFinite`];
    /// [`Error::NotSymmetric`] if two entries that should be equal differ by more than rounding;
    /// [`Error::NotPositive`] if a variance, given the elements after it, is negative by more than rounding.
    /// n³/6 multiply-adds.
    ///
    /// Source: Bierman 1977, section III.3.
    pub fn new(matrix: &OMatrix<T, N, N>) -> Result<Self, Error> {
        let (size, columns) = matrix.shape_generic();
        let n = size.value();
        if columns.value() != n {
            return Err(Error::Length { argument: "covariance", expected: n, found: columns.value() });
        }
        if !matrix.as_slice().iter().all(T::is_finite) {
            return Err(Error::NotFinite { argument: "covariance" });
        }
        let entry = |row, index| column(matrix.as_slice(), n, index).get(row).copied().unwrap_or(T::zero());
        let rounding = Self::rounding(n);
        for index in 0..n {
            for row in 0..index {
                let largest = entry(row, index).abs().max(entry(index, row).abs());
                if (entry(row, index) - entry(index, row)).abs() > rounding * largest {
                    return Err(Error::NotSymmetric { row, column: index });
                }
            }
        }
        let mut factor = size.square(T::zero());
        for index in 0..n {
            let target = column_mut(factor.as_mut_slice(), n, index);
            ud::copy(column(matrix.as_slice(), n, index).get(..=index).unwrap_or_default(), target);
        }
        Self::decomposed(factor)
    }

    /// Independent elements, with these variances.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Negative`].
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2, Vector2};
    /// use thetahat_core::{Covariance, Error};
    ///
    /// let covariance: Covariance<f32, Const<2>> = Covariance::from_diagonal(&Vector2::new(0.5, 0.0))?;
    /// assert_eq!(covariance.matrix(), Matrix2::new(0.5, 0.0, 0.0, 0.0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn from_diagonal(variances: &OVector<T, N>) -> Result<Self, Error> {
        let size = variances.shape_generic().0;
        let mut factor = size.square(T::zero());
        for (index, &variance) in variances.as_slice().iter().enumerate() {
            if !variance.is_finite() {
                return Err(Error::NotFinite { argument: "variances" });
            }
            if variance < T::zero() {
                return Err(Error::Negative { argument: "variances" });
            }
            if let Some(diagonal) = column_mut(factor.as_mut_slice(), size.value(), index).get_mut(index) {
                *diagonal = variance;
            }
        }
        Ok(Covariance { factor })
    }

    /// The covariance A P A' of A x, where P is that of x and A is m x n.
    ///
    /// It stays factored: where A has more rows than columns, or noise enters some states only, the result is
    /// singular, and no less exact. m² n multiply-adds.
    ///
    /// Errors: [`Error::Length`] if A has not n columns (only with `Dyn`); [`Error::NotFinite`];
    /// [`Error::Overflow`].
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2, Vector1, Vector2};
    /// use thetahat_core::{Covariance, Error};
    ///
    /// // A random acceleration of variance 4 during one second moves position and velocity.
    /// let acceleration: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(4.0))?;
    /// let covariance = acceleration.transformed(&Vector2::new(0.5, 1.0))?;
    /// assert_eq!(covariance.matrix(), Matrix2::new(1.0, 2.0, 2.0, 4.0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn transformed<M: Dimension + Dimension<N>>(
        &self,
        matrix: &OMatrix<T, M, N>,
    ) -> Result<Covariance<T, M>, Error> {
        let (rows, columns) = matrix.shape_generic();
        let (m, n) = (rows.value(), self.factor.ncols());
        if columns.value() != n {
            return Err(Error::Length { argument: "matrix", expected: n, found: columns.value() });
        }
        if !matrix.as_slice().iter().all(T::is_finite) {
            return Err(Error::NotFinite { argument: "matrix" });
        }
        let mut factor = rows.square(T::zero());
        for index in 0..n {
            let mut product = rows.vector(T::zero());
            ud::multiply_column(matrix.as_slice(), self.as_slice(), product.as_mut_slice(), n, index);
            ud::add_dyad(
                factor.as_mut_slice(),
                product.as_mut_slice(),
                ud::variance(self.as_slice(), n, index),
            );
        }
        if ud::is_finite(factor.as_slice(), m) { Ok(Covariance { factor }) } else { Err(Error::Overflow) }
    }

    /// P, symmetric to the bit, n x n. n³/6 multiply-adds.
    pub fn matrix(&self) -> OMatrix<T, N, N> {
        let size = self.factor.shape_generic().0;
        let mut matrix = size.square(T::zero());
        ud::expand(self.as_slice(), matrix.as_mut_slice(), size.value());
        matrix
    }

    /// The diagonal of P. n²/2 multiply-adds.
    pub fn variances(&self) -> OVector<T, N> {
        let size = self.factor.shape_generic().0;
        let mut variances = size.vector(T::zero());
        for (index, variance) in variances.as_mut_slice().iter_mut().enumerate() {
            *variance = ud::diagonal(self.as_slice(), size.value(), index);
        }
        variances
    }

    /// The covariance of those elements that are not `missing`; the others have variance 0.
    pub(crate) fn without(&self, missing: impl Fn(usize) -> bool) -> Result<Self, Error> {
        let mut factor = self.matrix();
        let size = factor.shape_generic().0;
        for index in 0..size.value() {
            for (row, entry) in column_mut(factor.as_mut_slice(), size.value(), index).iter_mut().enumerate()
            {
                if missing(row) || missing(index) || row > index {
                    *entry = T::zero();
                }
            }
        }
        Self::decomposed(factor)
    }

    /// Factors an upper half in place.
    fn decomposed(mut factor: OMatrix<T, N, N>) -> Result<Self, Error> {
        let n = factor.ncols();
        match ud::decompose_singular(factor.as_mut_slice(), n, Self::rounding(n)) {
            Ok(()) => Ok(Covariance { factor }),
            Err(index) => Err(Error::NotPositive { argument: "covariance", index }),
        }
    }

    /// What counts as nothing but rounding beside a variance.
    fn rounding(size: usize) -> T {
        T::EPSILON * T::from_count(8 * size.max(1))
    }

    /// The factors in one square: D on the diagonal, U above it.
    pub(crate) fn as_slice(&self) -> &[T] {
        self.factor.as_slice()
    }

    /// The factors in one square, to be written by the kernels of `ud`.
    pub(crate) fn as_mut_slice(&mut self) -> &mut [T] {
        self.factor.as_mut_slice()
    }

    pub(crate) fn size(&self) -> N {
        self.factor.shape_generic().0
    }
}
