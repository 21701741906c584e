//! Linear least squares by a triangular factor that grows row by row.

use nalgebra::{Const, OMatrix, OVector};

use crate::error::{check_finite, check_length};
use crate::triangle::{
    Sum, column, column_mut, condition, equilibrate, fold_row, invert, mark_independent, norm, solve,
};
use crate::{Dimension, Error, Real, Solution};

/// Linear least squares: rows in, a triangular factor kept, factors merge, a solution at the end.
///
/// With rows φ(k)', n numbers each, and outputs y(k), k = 1 … m, it keeps
///
/// ```text
/// [ φ(1)' y(1) ]       [ R  z ]
/// [   …    …   ]  =  Q [ 0  ρ ]     R upper triangular, n x n;  z = Q'y, n numbers;  ρ = ‖y - Φ θ̂‖
/// [ φ(m)' y(m) ]       [ 0  0 ]
/// ```
///
/// and minimises Σ (y(k) - φ(k)'θ)². There is no offset and no sign convention: a column of ones is an
/// offset, and what the columns mean is the caller's.
///
/// A new row is rotated into the triangle by n Givens rotations. Φ'Φ is never formed, so that the error of
/// the parameters grows with the condition number of Φ where that of the normal equations grows with its
/// square, as in Householder's QR factorisation. ρ is kept as a norm, not as a sum of squares, so that it
/// does not vanish beside large outputs.
///
/// The entries of R, z and ρ are compensated sums. So rounding does not add up over the rows: it leaves a few
/// epsilons in R after ten rows and after 10^6, in `f32` too, where plain rotations leave 10^5. (Measured.
/// The error of the parameters was 0.4 to 0.75 times that of Householder's factorisation of n + 1, 30 and 300
/// rows at once.)
///
/// Memory: 2 n² + 2 n + 2 numbers and two counters; with `Dyn` n more, so that [`add`](LeastSquares::add)
/// does not allocate.
///
/// Source: Golub and Van Loan, Matrix Computations, 4th ed., sections 5.1, 5.2 and 6.5; Björck, Numerical
/// Methods for Least Squares Problems, 1996, chapter 3 (updating); Gentleman, Least squares computations by
/// Givens transformations without square roots, 1973 (row by row; here with square roots, which do not
/// overflow); Rutishauser, The Jacobi method for real symmetric matrices, 1966 (the form of the rotation);
/// Kahan, Further remarks on reducing truncation errors, 1965 (the sums).
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector2};
/// use thetahat_core::{Error, LeastSquares};
///
/// // A line through four points: y = 2 + 0.5 x, and an error in each point.
/// let mut problem = LeastSquares::<f64, Const<2>>::new();
/// for (x, y) in [(0.0, 2.1), (1.0, 2.4), (2.0, 2.9), (3.0, 3.6)] {
///     problem.add(&Vector2::new(1.0, x), y)?;
/// }
/// let solution = problem.solve()?;
/// assert!((solution.parameters() - Vector2::new(2.0, 0.5)).norm() < 1e-14);
/// assert!((solution.residual_sum_of_squares() - 0.04).abs() < 1e-15);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N>"))]
pub struct LeastSquares<T: Real, N: Dimension> {
    /// R, transposed: column i is row i of R, so that a rotation runs over contiguous numbers.
    factor_rows: OMatrix<Sum<T>, N, N>,
    rotated_output: OVector<Sum<T>, N>,
    residual_norm: Sum<T>,
    rows: usize,
    /// Those of the rows that came by `from_factor`: `rank` expects more rounding of them.
    uncompensated_rows: usize,
    scratch: N::Scratch<T>,
}

impl<T: Real, const K: usize> LeastSquares<T, Const<K>> {
    /// No rows yet, and as many parameters as the type says.
    pub fn new() -> Self {
        Self::with_size(Const)
    }
}

impl<T: Real, const K: usize> Default for LeastSquares<T, Const<K>> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, N: Dimension> LeastSquares<T, N> {
    /// No rows yet, and `size` parameters: `Const::<4>`, or `Dyn(4)` with the feature `alloc`.
    ///
    /// With `Dyn` it allocates, and fails as a `Vec` does if there is no memory.
    pub fn with_size(size: N) -> Self {
        LeastSquares {
            factor_rows: size.square(Sum::new(T::zero())),
            rotated_output: size.vector(Sum::new(T::zero())),
            residual_norm: Sum::new(T::zero()),
            rows: 0,
            uncompensated_rows: 0,
            scratch: size.scratch::<T, 1, 0>(),
        }
    }

    /// Continues from a factor that was computed elsewhere: R, z = Q'y, ρ and the number of rows m, as in the
    /// equation above. For instance from a QR factorisation of a block of rows: factorise each block alone
    /// and [`merge`](LeastSquares::merge) the factors, rather than fold one block into the next. Reflections
    /// are not compensated: folding adds an error of ε/4 with each block, all of one sign (measured with
    /// nalgebra's QR).
    ///
    /// The diagonal of R may have any sign. Rows of a factor of fewer than n rows are filled up with zeros.
    ///
    /// Errors: [`Error::Length`] if R is not n x n (only with `Dyn`); [`Error::NotFinite`];
    /// [`Error::TooLarge`] if the norm of a column is above 2 √m times [`Real::LARGEST_ENTRY`];
    /// [`Error::NotTriangular`]; [`Error::Negative`] if ρ is; [`Error::TooFewRows`] if m is less than the
    /// number of rows of \[R z; 0 ρ\] that are not zero.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2, Vector2};
    /// use thetahat_core::{Error, LeastSquares};
    ///
    /// let factor = Matrix2::new(2.0, 1.0, 0.0, 4.0);
    /// let problem = LeastSquares::<f64, Const<2>>::from_factor(&factor, &Vector2::new(3.0, 4.0), 0.5, 10)?;
    /// assert_eq!(problem.solve()?.parameters(), &Vector2::new(1.0, 1.0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn from_factor(
        factor: &OMatrix<T, N, N>,
        rotated_output: &OVector<T, N>,
        residual_norm: T,
        rows: usize,
    ) -> Result<Self, Error> {
        let (size, columns) = factor.shape_generic();
        let n = size.value();
        for (argument, found) in [("factor", columns.value()), ("rotated_output", rotated_output.len())] {
            check_length(argument, n, found)?;
        }
        check_finite("factor", factor.as_slice())?;
        check_finite("rotated_output", rotated_output.as_slice())?;
        check_finite("residual_norm", &[residual_norm])?;
        if residual_norm < T::zero() {
            return Err(Error::Negative { argument: "residual_norm" });
        }
        // Twice what rows within the limit of `add` can make, for the rounding.
        let limit = T::LARGEST_ENTRY * T::from_count(2) * T::from_count(rows.max(1)).sqrt();
        for index in 0..n {
            let entries = column(factor.as_slice(), n, index);
            if let Some((row, _)) =
                entries.iter().enumerate().skip(index + 1).find(|(_, entry)| !entry.is_zero())
            {
                return Err(Error::NotTriangular { row, column: index });
            }
            check_size("factor", norm(entries.iter()), limit)?;
        }
        check_size("rotated_output", norm(rotated_output.iter()), limit)?;
        check_size("residual_norm", residual_norm, limit)?;

        let mut problem = Self::with_size(size);
        transpose(factor.as_slice(), problem.factor_rows.as_mut_slice(), n, Sum::new);
        let mut needed = usize::from(!residual_norm.is_zero());
        for (index, &output) in rotated_output.as_slice().iter().enumerate() {
            if let Some(sum) = problem.rotated_output.get_mut(index) {
                *sum = Sum::new(output);
            }
            let row = column(problem.factor_rows.as_slice(), n, index);
            if !output.is_zero() || row.iter().any(|sum| !sum.value.is_zero()) {
                needed += 1;
            }
        }
        if rows < needed {
            return Err(Error::TooFewRows { needed, found: rows });
        }
        problem.residual_norm = Sum::new(residual_norm);
        problem.rows = rows;
        problem.uncompensated_rows = rows;
        Ok(problem)
    }

    /// Adds the row φ' with its output y: y = φ'θ + e.
    ///
    /// The row's weight is 1; to weight it by w, multiply both by the square root of w.
    ///
    /// 5 n² flops, n square roots; no allocation. An entry that is 0 costs nothing.
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`]; [`Error::TooLarge`] for an entry above
    /// [`Real::LARGEST_ENTRY`], so that nothing that is accepted can overflow later; [`Error::Length`] (only
    /// with `Dyn`); [`Error::TooManyRows`].
    pub fn add(&mut self, regressor: &OVector<T, N>, output: T) -> Result<(), Error> {
        self.check(regressor, output)?;
        let rows = self.rows.checked_add(1).ok_or(Error::TooManyRows)?;
        self.fold(regressor, output);
        self.rows = rows;
        Ok(())
    }

    /// What [`add`](LeastSquares::add) checks of a row.
    #[inline(always)]
    pub(crate) fn check(&self, regressor: &OVector<T, N>, output: T) -> Result<(), Error> {
        check_length("regressor", self.size().value(), regressor.len())?;
        check_row("regressor", regressor.as_slice())?;
        check_row("output", &[output])
    }

    /// Rotates a row in that is checked. It is not counted.
    #[inline(always)]
    fn fold(&mut self, regressor: &OVector<T, N>, output: T) {
        let size = self.size();
        let (factor, rotated) = (self.factor_rows.as_mut_slice(), self.rotated_output.as_mut_slice());
        let rest = size.with_scratch(&mut self.scratch, |[row], []| {
            for (entry, &given) in row.iter_mut().zip(regressor.as_slice()) {
                *entry = given;
            }
            fold_row(factor, rotated, row, 0, output)
        });
        self.residual_norm.lengthen(rest);
    }

    /// Adds all rows of another problem, as if they had been added here one by one.
    ///
    /// Segments, files and machines combine in this way. The two triangles are stacked and rotated into one,
    /// which is as accurate as a factorisation of all rows. 5/3 n³ flops, n²/2 square roots.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] (only with `Dyn`); [`Error::TooManyRows`].
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector1};
    /// use thetahat_core::{Error, LeastSquares};
    ///
    /// let (mut first, mut second) = (LeastSquares::<f64, Const<1>>::new(), LeastSquares::new());
    /// first.add(&Vector1::new(3.0), 3.0)?;
    /// second.add(&Vector1::new(4.0), 29.0)?;
    /// first.merge(&second)?;
    /// assert_eq!(first.rows(), 2);
    /// assert!((first.solve()?.parameters()[0] - 5.0).abs() < 1e-14);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn merge(&mut self, other: &Self) -> Result<(), Error> {
        let size = self.size();
        check_length("other", size.value(), other.rotated_output.len())?;
        let rows = self.rows.checked_add(other.rows).ok_or(Error::TooManyRows)?;
        self.fold_factor(other.residual_norm.value, |index, row| {
            copy_values(column(other.factor_rows.as_slice(), size.value(), index), row);
            other.rotated_output.as_slice().get(index).map_or(T::zero(), |output| output.value)
        });
        self.uncompensated_rows += other.uncompensated_rows;
        self.rows = rows;
        Ok(())
    }

    /// Rotates in the rows of another triangle: `row_of` writes one, from its diagonal on, and returns its output.
    fn fold_factor(&mut self, residual_norm: T, mut row_of: impl FnMut(usize, &mut [T]) -> T) {
        let size = self.size();
        let (factor, rotated) = (self.factor_rows.as_mut_slice(), self.rotated_output.as_mut_slice());
        let own_norm = &mut self.residual_norm;
        own_norm.lengthen(residual_norm);
        size.with_scratch(&mut self.scratch, |[row], []| {
            for index in 0..size.value() {
                let output = row_of(index, row);
                own_norm.lengthen(fold_row(factor, rotated, row, index, output));
            }
        });
    }

    /// R, upper triangular, n x n: a copy. Its diagonal is not negative, unless
    /// [`from_factor`](LeastSquares::from_factor) was given one that is.
    pub fn factor(&self) -> OMatrix<T, N, N> {
        let size = self.size();
        let mut factor = size.square(T::zero());
        transpose(self.factor_rows.as_slice(), factor.as_mut_slice(), size.value(), |sum| sum.value);
        factor
    }

    /// z = Q'y, the outputs rotated with the rows: n numbers, in the unit of y. A copy.
    pub fn rotated_output(&self) -> OVector<T, N> {
        let mut outputs = self.size().vector(T::zero());
        copy_values(self.rotated_output.as_slice(), outputs.as_mut_slice());
        outputs
    }

    /// ρ, the norm of the residuals of the least squares solution, in the unit of y.
    pub fn residual_norm(&self) -> T {
        self.residual_norm.value
    }

    /// The number of rows added so far, m.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Which columns are linearly independent, decided on columns of unit norm, so that units do not matter.
    ///
    /// R is triangularised with column pivoting. A column is dependent if what remains of it, once the
    /// columns chosen before it are projected out, is at most
    ///
    /// ```text
    /// ε (4 n + √m')          ε = T::EPSILON, m' the number of rows that came by from_factor
    /// ```
    ///
    /// of its norm. What rounding leaves of a column that depends on others was at most ε (2 + n / 5),
    /// whatever m (measured for n = 2 … 60, m up to 3·10^6). The factorisations that
    /// [`from_factor`](LeastSquares::from_factor) takes leave more, up to ε √m' for blocks of 1000 rows.
    ///
    /// See [`Rank`]. About 5 n³ flops.
    ///
    /// Source: Golub and Van Loan, section 5.4; Björck 1996, section 2.7.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector3};
    /// use thetahat_core::{Error, LeastSquares};
    ///
    /// // The third column is the sum of the first two.
    /// let mut problem = LeastSquares::<f64, Const<3>>::new();
    /// for (a, b) in [(1.0, 0.3), (0.2, -0.7), (-0.4, 0.1), (0.5, 0.9)] {
    ///     problem.add(&Vector3::new(a, b, a + b), a)?;
    /// }
    /// let rank = problem.rank();
    /// assert_eq!(rank.value(), 2);
    /// assert!(rank.dependent().eq([2]));
    /// assert_eq!(problem.solve().err(), Some(Error::RankDeficient { column: 2 }));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn rank(&self) -> Rank<N> {
        let size = self.size();
        let n = size.value();
        let mut scaled = self.plain_rows();
        equilibrate(scaled.as_mut_slice(), n);
        let mut columns = size.square(T::zero());
        transpose(scaled.as_slice(), columns.as_mut_slice(), n, |entry| entry);
        let mut independent = size.vector(false);
        let noise = T::from_count(4) * T::from_count(n) + T::from_count(self.uncompensated_rows).sqrt();
        mark_independent(
            columns.as_mut_slice(),
            independent.as_mut_slice(),
            size.vector(T::zero()).as_mut_slice(),
            noise * T::EPSILON,
        );
        Rank { independent }
    }

    /// The condition number of the rows with their columns scaled to unit norm, by power and inverse
    /// iteration on R. Infinite if R is singular, which it is with fewer rows than parameters.
    ///
    /// The relative error of the parameters is about this number times the relative error of the data. The
    /// estimate lies between 0.77 and 1.01 times the 2-norm condition number (measured). About 80 n² flops.
    ///
    /// Source: Golub and Van Loan, section 3.5.4 (estimation), section 8.2 (iteration).
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector2};
    /// use thetahat_core::{Error, LeastSquares};
    ///
    /// // Orthogonal columns of very different units: as good as can be.
    /// let mut problem = LeastSquares::<f64, Const<2>>::new();
    /// problem.add(&Vector2::new(1e-6, 1e6), 0.0)?;
    /// problem.add(&Vector2::new(1e-6, -1e6), 0.0)?;
    /// assert!((problem.condition() - 1.0).abs() < 1e-12);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn condition(&self) -> T {
        let size = self.size();
        let mut scaled = self.plain_rows();
        equilibrate(scaled.as_mut_slice(), size.value());
        condition(scaled.as_slice(), size.vector(T::zero()).as_mut_slice())
    }

    /// The least squares solution: R θ̂ = z by back substitution, and R⁻¹ for the covariance.
    ///
    /// About 6 n³ flops, most of them for [`rank`](LeastSquares::rank).
    ///
    /// Errors: [`Error::TooFewRows`] with fewer rows than parameters; [`Error::RankDeficient`] with the first
    /// dependent column; [`Error::Overflow`] if a parameter or an entry of R⁻¹ does not fit `T`.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector1};
    /// use thetahat_core::{Error, LeastSquares};
    ///
    /// // The mean of 1, 2, 3, 6 and its standard error.
    /// let mut problem = LeastSquares::<f64, Const<1>>::new();
    /// for output in [1.0, 2.0, 3.0, 6.0] {
    ///     problem.add(&Vector1::new(1.0), output)?;
    /// }
    /// let solution = problem.solve()?;
    /// assert!((solution.parameters()[0] - 3.0).abs() < 1e-14);
    /// // σ̂² = (4 + 1 + 0 + 9) / 3
    /// assert!((solution.residual_variance().unwrap() - 14.0 / 3.0).abs() < 1e-13);
    /// // √(σ̂² / 4)
    /// assert!((solution.standard_errors().unwrap()[0] - (14.0_f64 / 12.0).sqrt()).abs() < 1e-14);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn solve(&self) -> Result<Solution<T, N>, Error> {
        let size = self.size();
        if self.rows < size.value() {
            return Err(Error::TooFewRows { needed: size.value(), found: self.rows });
        }
        if let Some(column) = self.rank().dependent().next() {
            return Err(Error::RankDeficient { column });
        }
        let factor_rows = self.plain_rows();
        let mut parameters = self.rotated_output();
        solve(factor_rows.as_slice(), parameters.as_mut_slice());
        let mut inverse_rows = size.square(T::zero());
        invert(factor_rows.as_slice(), inverse_rows.as_mut_slice(), size.value());
        let mut results = parameters.as_slice().iter().chain(inverse_rows.as_slice());
        if !results.all(T::is_finite) {
            return Err(Error::Overflow);
        }
        Ok(Solution { parameters, inverse_rows, residual_norm: self.residual_norm.value, rows: self.rows })
    }

    /// R, row after row, as plain numbers.
    fn plain_rows(&self) -> OMatrix<T, N, N> {
        let mut rows = self.size().square(T::zero());
        copy_values(self.factor_rows.as_slice(), rows.as_mut_slice());
        rows
    }

    fn size(&self) -> N {
        self.rotated_output.shape_generic().0
    }
}

fn check_size<T: Real>(argument: &'static str, size: T, limit: T) -> Result<(), Error> {
    if size <= limit { Ok(()) } else { Err(Error::TooLarge { argument }) }
}

/// What a row must be: finite, and within the limit that keeps later sums from overflowing.
fn check_row<T: Real>(argument: &'static str, entries: &[T]) -> Result<(), Error> {
    check_finite(argument, entries)?;
    for entry in entries {
        check_size(argument, entry.abs(), T::LARGEST_ENTRY)?;
    }
    Ok(())
}

fn copy_values<T: Real>(from: &[Sum<T>], into: &mut [T]) {
    for (value, sum) in into.iter_mut().zip(from) {
        *value = sum.value;
    }
}

/// Writes the transpose of the square matrix `from` into `into`.
fn transpose<A: Copy, B>(from: &[A], into: &mut [B], size: usize, convert: impl Fn(A) -> B) {
    for index in 0..size {
        for (position, entry) in column_mut(into, size, index).iter_mut().enumerate() {
            if let Some(&given) = from.get(position * size + index) {
                *entry = convert(given);
            }
        }
    }
}

/// Which columns of a regression are linearly independent: what [`LeastSquares::rank`] reports.
///
/// Dependence is mutual: of the columns that are related, the report calls dependent those that are left over
/// when the rest has been chosen. Of two equal columns that is the later one. Removing every dependent column
/// makes the rest solvable.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector4};
/// use thetahat_core::{Error, LeastSquares};
///
/// // The second column is zero, the fourth a multiple of the first.
/// let mut problem = LeastSquares::<f64, Const<4>>::new();
/// for (a, b) in [(1.0, 0.3), (0.2, -0.7), (-0.4, 0.1), (0.5, 0.9)] {
///     problem.add(&Vector4::new(a, 0.0, b, -3.0 * a), a)?;
/// }
/// let rank = problem.rank();
/// assert_eq!(rank.value(), 2);
/// assert!(!rank.is_full());
/// assert!(rank.dependent().eq([1, 3]));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Rank<N: Dimension> {
    independent: OVector<bool, N>,
}

impl<N: Dimension> Rank<N> {
    /// The number of independent columns.
    pub fn value(&self) -> usize {
        self.independent.iter().filter(|&&mark| mark).count()
    }

    /// Whether all columns are independent.
    pub fn is_full(&self) -> bool {
        self.dependent().next().is_none()
    }

    /// The columns that depend on the others, from 0, in ascending order.
    pub fn dependent(&self) -> impl Iterator<Item = usize> + '_ {
        let marks = self.independent.iter().enumerate();
        marks.filter(|(_, mark)| !**mark).map(|(index, _)| index)
    }
}

mod packed;
pub(crate) use packed::packed_numbers;
#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
