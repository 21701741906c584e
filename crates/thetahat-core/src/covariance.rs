//! A covariance, kept as its U·D·U' factors.

use core::fmt;

use nalgebra::{ArrayStorage, Const, OMatrix, OVector};

use crate::dim::filled;
use crate::error::{check_finite, check_length};
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
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N>"))]
pub struct Covariance<T: Real, N: Dimension> {
    /// D on the diagonal, U above it. What lies below is anything: the kernels write there.
    factor: OMatrix<T, N, N>,
}

/// Equal to the bit: the same factors.
impl<T: Real, N: Dimension> PartialEq for Covariance<T, N> {
    fn eq(&self, other: &Self) -> bool {
        self.factor() == other.factor()
    }
}

impl<T: Real, N: Dimension> fmt::Debug for Covariance<T, N> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Covariance").field("factor", &self.factor()).finish()
    }
}

impl<T: Real, N: Dimension> Covariance<T, N> {
    /// Factors a symmetric matrix, n x n.
    ///
    /// Errors: [`Error::Length`] if it is not square (only with `Dyn`); [`Error::NotFinite`];
    /// [`Error::NotSymmetric`] if two entries that should be equal differ by more than rounding;
    /// [`Error::NotPositive`] if a variance, given other elements, is negative by more than rounding. A singular
    /// matrix is none. What is below the smallest normal number may become 0. 2.5 n³ multiply-adds.
    ///
    /// Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, section 10.3 (elimination
    /// with pivots from the diagonal).
    pub fn new(matrix: &OMatrix<T, N, N>) -> Result<Self, Error> {
        let (size, columns) = matrix.shape_generic();
        let n = size.value();
        check_length("covariance", n, columns.value())?;
        check_finite("covariance", matrix.as_slice())?;
        let mut variances = size.vector(T::zero());
        // Of one element there is nothing to eliminate: so the noise of one sensor does not link what does that.
        if let ([variance], [given]) = (variances.as_mut_slice(), matrix.as_slice()) {
            if *given < T::zero() {
                return Err(Error::NotPositive { argument: "covariance", index: 0 });
            }
            *variance = if *given >= T::MIN_POSITIVE { *given } else { T::zero() };
            return Ok(Self::independent(&variances));
        }
        if let Some((row, column)) = first_asymmetry(matrix.as_slice(), n) {
            return Err(Error::NotSymmetric { row, column });
        }
        for (index, variance) in variances.as_mut_slice().iter_mut().enumerate() {
            *variance = ud::variance(matrix.as_slice(), n, index);
        }
        Self::decomposed(matrix.clone(), &variances, "covariance")
    }

    /// No uncertainty: P = 0, of size `Const::<4>`, or `Dyn(4)` with the feature `alloc`.
    ///
    /// ```
    /// use thetahat_core::Covariance;
    /// use thetahat_core::nalgebra::{Const, Matrix2};
    ///
    /// let known: Covariance<f32, Const<2>> = Covariance::zero(Const);
    /// assert_eq!(known.matrix(), Matrix2::zeros());
    /// ```
    pub fn zero(size: N) -> Self {
        Covariance { factor: size.square(T::zero()) }
    }

    /// Takes back what [`factor`](Covariance::factor) gave, to the bit.
    ///
    /// Errors: [`Error::Length`] if it is not square (only with `Dyn`); [`Error::NotFinite`];
    /// [`Error::NotTriangular`] if an entry below the diagonal is not 0; [`Error::Negative`] if one on it is
    /// negative; [`Error::Overflow`] if a variance does not fit `T`.
    pub fn from_factor(factor: OMatrix<T, N, N>) -> Result<Self, Error> {
        let n = factor.nrows();
        check_length("factor", n, factor.ncols())?;
        check_finite("factor", factor.as_slice())?;
        for index in 0..n {
            let entries = column(factor.as_slice(), n, index);
            if entries.get(index).is_some_and(|&variance| variance < T::zero()) {
                return Err(Error::Negative { argument: "factor" });
            }
            if let Some(below) = entries.iter().skip(index + 1).position(|entry| !entry.is_zero()) {
                return Err(Error::NotTriangular { row: index + 1 + below, column: index });
            }
        }
        let fits = ud::has_finite_variances(factor.as_slice(), n);
        fits.then_some(Covariance { factor }).ok_or(Error::Overflow)
    }

    /// The factors in one n x n matrix: D on the diagonal, U above it (its diagonal of ones is left out), zeros
    /// below. To store, and to take back by [`from_factor`](Covariance::from_factor).
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2};
    /// use thetahat_core::{Covariance, Error};
    ///
    /// let covariance: Covariance<f64, Const<2>> = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0))?;
    /// assert_eq!(covariance.factor(), Matrix2::new(3.5, 0.5, 0.0, 2.0));
    /// assert_eq!(Covariance::from_factor(covariance.factor())?, covariance);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn factor(&self) -> OMatrix<T, N, N> {
        let size = self.size();
        let mut factor = size.square(T::zero());
        for index in 0..size.value() {
            let entries = column(self.as_slice(), size.value(), index);
            let target = column_mut(factor.as_mut_slice(), size.value(), index);
            ud::copy(entries.get(..=index).unwrap_or_default(), target);
        }
        factor
    }

    /// The same to the bit, with its size in another type: `Const::<4>` for what `Dyn` held, or the other way round.
    ///
    /// Errors: [`Error::Length`] if it has another size.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// use thetahat_core::Covariance;
    /// use thetahat_core::nalgebra::{Const, DVector, Dyn};
    ///
    /// let covariance: Covariance<f64, Dyn> = Covariance::from_diagonal(&DVector::repeat(2, 3.0))?;
    /// let fixed = covariance.to_size(Const::<2>)?;
    /// assert_eq!(fixed.to_size(Dyn(2))?, covariance);
    /// assert!(covariance.to_size(Const::<3>).is_err());
    /// # }
    /// # Ok::<(), thetahat_core::Error>(())
    /// ```
    pub fn to_size<K: Dimension>(&self, size: K) -> Result<Covariance<T, K>, Error> {
        check_length("covariance", size.value(), self.size().value())?;
        Ok(Covariance { factor: filled(size.square(T::zero()), self.as_slice()) })
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
        check_finite("variances", variances.as_slice())?;
        if variances.as_slice().iter().any(|&variance| variance < T::zero()) {
            return Err(Error::Negative { argument: "variances" });
        }
        Ok(Self::independent(variances))
    }

    /// Independent elements, with these variances, which are finite and not negative.
    pub(crate) fn independent(variances: &OVector<T, N>) -> Self {
        let size = variances.shape_generic().0;
        let mut factor = size.square(T::zero());
        for (index, &variance) in variances.as_slice().iter().enumerate() {
            if let Some(diagonal) = column_mut(factor.as_mut_slice(), size.value(), index).get_mut(index) {
                *diagonal = variance;
            }
        }
        Covariance { factor }
    }

    /// The covariance A P A' of A x, where P is that of x and A is m x n.
    ///
    /// It stays factored: where A has more rows than columns, or noise enters some states only, the result is
    /// singular, and no less exact. m n²/2 + 1.5 m² n multiply-adds.
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
        check_length("matrix", n, columns.value())?;
        check_finite("matrix", matrix.as_slice())?;
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
        if !ud::has_finite_variances(factor.as_slice(), m) {
            return Err(Error::Overflow);
        }
        Ok(Covariance { factor })
    }

    /// The covariance P + Q of the sum of two independent vectors. It stays factored. 1.5 n³ multiply-adds.
    ///
    /// Errors: [`Error::Length`] if the sizes differ (only with `Dyn`); [`Error::Overflow`].
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2};
    /// use thetahat_core::{Covariance, Error};
    ///
    /// let one: Covariance<f64, Const<2>> = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0))?;
    /// let other = Covariance::new(&Matrix2::new(1.0, -1.0, -1.0, 1.0))?;
    /// assert_eq!(one.plus(&other)?.matrix(), Matrix2::new(5.0, 0.0, 0.0, 3.0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn plus(&self, other: &Self) -> Result<Self, Error> {
        let size = self.size();
        let n = size.value();
        check_length("other", n, other.size().value())?;
        let mut sum = self.clone();
        for index in 0..n {
            let mut column = size.vector(T::zero());
            ud::unit_column(other.as_slice(), column.as_mut_slice(), index);
            ud::add_dyad(sum.as_mut_slice(), column.as_mut_slice(), ud::variance(other.as_slice(), n, index));
        }
        if ud::has_finite_variances(sum.as_slice(), n) { Ok(sum) } else { Err(Error::Overflow) }
    }

    /// The covariance `factor` P. It stays factored. n multiplications.
    ///
    /// Errors: [`Error::OutOfRange`] if the factor is not finite and at least 1; [`Error::Overflow`].
    pub(crate) fn widened(&self, factor: T) -> Result<Self, Error> {
        if !(factor >= T::one() && factor.is_finite()) {
            return Err(Error::OutOfRange { argument: "factor", range: "finite and at least 1" });
        }
        let (n, mut wide) = (self.size().value(), self.clone());
        for index in 0..n {
            if let Some(variance) = column_mut(wide.as_mut_slice(), n, index).get_mut(index) {
                *variance *= factor;
            }
        }
        if ud::has_finite_variances(wide.as_slice(), n) { Ok(wide) } else { Err(Error::Overflow) }
    }

    /// P, symmetric to the bit, n x n. n³/6 multiply-adds.
    pub fn matrix(&self) -> OMatrix<T, N, N> {
        let size = self.factor.shape_generic().0;
        let mut matrix = size.square(T::zero());
        ud::expand(self.as_slice(), matrix.as_mut_slice(), size.value());
        matrix
    }

    /// Writes P, n² numbers, into `entries`: row by row and column by column are the same.
    ///
    /// Errors: [`Error::Length`] if there are not n² places.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2};
    /// use thetahat_core::{Covariance, Error};
    ///
    /// let covariance: Covariance<f64, Const<2>> = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0))?;
    /// let mut entries = [0.0; 4];
    /// covariance.write_into(&mut entries)?;
    /// assert_eq!(entries, [4.0, 1.0, 1.0, 2.0]);
    /// # Ok::<(), Error>(())
    /// ```
    #[inline]
    pub fn write_into(&self, entries: &mut [T]) -> Result<(), Error> {
        let n = self.size().value();
        check_length("entries", n * n, entries.len())?;
        ud::expand(self.as_slice(), entries, n);
        Ok(())
    }

    /// The diagonal of P. n²/2 multiply-adds.
    pub fn variances(&self) -> OVector<T, N> {
        let size = self.factor.shape_generic().0;
        let mut variances = size.vector(T::zero());
        ud::diagonals(self.as_slice(), T::one(), variances.as_mut_slice());
        variances
    }

    /// NaN, which every filter refuses: for models that have no other way to say that they have no answer.
    pub(crate) fn unknown(size: N) -> Self {
        Covariance { factor: size.square(T::NAN) }
    }

    /// That it has a size, and is not NaN.
    pub(crate) fn check(&self, argument: &'static str, size: usize) -> Result<(), Error> {
        check_length(argument, size, self.size().value())?;
        if ud::is_finite(self.as_slice(), size) { Ok(()) } else { Err(Error::NotFinite { argument }) }
    }

    /// The covariance of two independent vectors, one above the other. NaN if their sizes do not make `size`.
    pub(crate) fn block_diagonal<A: Dimension, B: Dimension>(
        size: N,
        above: &Covariance<T, A>,
        below: &Covariance<T, B>,
    ) -> Self {
        let (n, first, last) = (size.value(), above.size().value(), below.size().value());
        if first + last != n {
            return Covariance::unknown(size);
        }
        let mut blocks = Covariance::zero(size);
        for index in 0..n {
            let target = column_mut(blocks.as_mut_slice(), n, index);
            if index < first {
                ud::copy(column(above.as_slice(), first, index), target);
            } else {
                let entries = column(below.as_slice(), last, index - first);
                ud::copy(entries, target.get_mut(first..).unwrap_or_default());
            }
        }
        blocks
    }

    /// The covariance of those elements that are not `missing`; the others have variance 0.
    pub(crate) fn without(&self, missing: impl Fn(usize) -> bool) -> Self {
        let size = self.size();
        let n = size.value();
        let mut without = Covariance::zero(size);
        for index in 0..n {
            let mut column = size.vector(T::zero());
            ud::unit_column(self.as_slice(), column.as_mut_slice(), index);
            for (row, entry) in column.as_mut_slice().iter_mut().enumerate() {
                if missing(row) {
                    *entry = T::zero();
                }
            }
            let weight = ud::variance(self.as_slice(), n, index);
            ud::add_dyad(without.as_mut_slice(), column.as_mut_slice(), weight);
        }
        without
    }

    /// Factors a symmetric matrix, n x n, that may be singular, and that was computed from one with the diagonal
    /// `given`: see [`eliminate`].
    pub(crate) fn decomposed(
        mut rest: OMatrix<T, N, N>,
        given: &OVector<T, N>,
        argument: &'static str,
    ) -> Result<Self, Error> {
        let mut covariance = Self::zero(given.shape_generic().0);
        let mut weights = given.clone();
        let factor = covariance.as_mut_slice();
        match eliminate(rest.as_mut_slice(), given.as_slice(), factor, weights.as_mut_slice()) {
            Some(index) => Err(Error::NotPositive { argument, index }),
            None => Ok(covariance),
        }
    }

    /// What counts as nothing but rounding beside a variance.
    pub(crate) fn rounding(size: usize) -> T {
        rounding(size)
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

/// A covariance that is a constant, in single and in double precision.
macro_rules! constant {
    ($real:ty) => {
        impl<const N: usize> Covariance<$real, Const<N>> {
            /// Independent elements, with these variances, as a constant of the program. A wrong number does not
            /// compile, where the constant panics for the error.
            ///
            /// Errors: [`Error::NotFinite`]; [`Error::Negative`].
            ///
            /// ```
            /// use thetahat_core::Covariance;
            /// use thetahat_core::nalgebra::Const;
            ///
            /// type Prior = Covariance<f32, Const<2>>;
            /// const PRIOR: Prior = match Prior::constant([9.0, 1.0]) {
            ///     Ok(prior) => prior,
            ///     Err(_) => panic!("a variance is negative or not finite"),
            /// };
            /// assert_eq!(PRIOR.variances().as_slice(), [9.0, 1.0]);
            /// ```
            pub const fn constant(variances: [$real; N]) -> Result<Self, Error> {
                let mut factor = [[0.0; N]; N];
                let mut index = 0;
                while index < N {
                    let variance = variances[index];
                    if !variance.is_finite() {
                        return Err(Error::NotFinite { argument: "variances" });
                    }
                    if variance < 0.0 {
                        return Err(Error::Negative { argument: "variances" });
                    }
                    factor[index][index] = variance;
                    index += 1;
                }
                let factor = OMatrix::<$real, Const<N>, Const<N>>::from_array_storage(ArrayStorage(factor));
                Ok(Covariance { factor })
            }
        }
    };
}

constant!(f32);
constant!(f64);

/// What counts as nothing but rounding beside a variance.
fn rounding<T: Real>(size: usize) -> T {
    T::EPSILON * T::from_count(8 * size.max(1))
}

// What follows runs when a filter is set up. It knows no sizes but those of its slices, so that a program has it once.

/// The first two entries of a matrix, n x n, that should be equal and differ by more than rounding: row and column.
#[inline(never)]
fn first_asymmetry<T: Real>(matrix: &[T], size: usize) -> Option<(usize, usize)> {
    for index in 0..size {
        for row in 0..index {
            let (above, below) = (ud::entry(matrix, size, row, index), ud::entry(matrix, size, index, row));
            let excess = (above - below).abs() / rounding(size);
            if excess > above.abs()
                && excess > below.abs()
                && exceeds(excess, ud::variance(matrix, size, row), ud::variance(matrix, size, index))
            {
                return Some((row, index));
            }
        }
    }
    None
}

/// Factors a symmetric matrix, n x n, that may be singular, into `factor`, which holds zeros. Returns the first element
/// of which more is left than rounding, or of which the variance is negative: then the matrix is no covariance.
///
/// The matrix was computed from one with the diagonal `given`: so of element i, `given_i` times [`rounding`] is nothing
/// but rounding.
///
/// Elements are eliminated one by one, each time the one of which the largest share is left: in a fixed order,
/// small pivots would make large errors of the rounding of what comes after them, and singular matrices would
/// be taken for indefinite ones. What is eliminated is added to the factors.
#[inline(never)]
fn eliminate<T: Real>(rest: &mut [T], given: &[T], factor: &mut [T], weights: &mut [T]) -> Option<usize> {
    let (size, rounding) = (given.len(), rounding::<T>(given.len()));
    for _ in 0..size {
        let (mut index, mut share) = (0, T::zero());
        for (candidate, &given) in given.iter().enumerate() {
            let variance = ud::variance(rest, size, candidate);
            if variance > rounding * given && variance >= T::MIN_POSITIVE && variance / given > share {
                (index, share) = (candidate, variance / given);
            }
        }
        if share.is_zero() {
            break;
        }
        let pivot = ud::variance(rest, size, index);
        for (weight, &entry) in weights.iter_mut().zip(column(rest, size, index)) {
            *weight = entry / pivot;
        }
        for (k, &weight) in weights.iter().enumerate() {
            let target = column_mut(rest, size, k);
            ud::add_multiple(target, -(weight * pivot), weights);
            for (row, entry) in target.iter_mut().enumerate() {
                if k == index || row == index {
                    *entry = T::zero();
                }
            }
        }
        ud::add_dyad(factor, weights, pivot);
    }
    let twice = rounding + rounding;
    given.iter().enumerate().position(|(index, &variance)| {
        let left = column(rest, size, index).iter().zip(given);
        let off = |(entry, &other): (&T, &T)| {
            entry.abs() > T::MIN_POSITIVE && exceeds(entry.abs() / twice, variance, other)
        };
        variance < T::zero() || left.into_iter().any(off)
    })
}

/// Whether x, which is above 0, exceeds √(p q). A variance below `MIN_POSITIVE` counts as 0. (A square root would link
/// the one of the mathematical library, which is longer than all of this.)
fn exceeds<T: Real>(x: T, p: T, q: T) -> bool {
    let (small, large) = if p < q { (p, q) } else { (q, p) };
    small < T::MIN_POSITIVE || x / large > small / x
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
