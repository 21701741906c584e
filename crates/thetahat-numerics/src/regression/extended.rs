//! Normal equations in twice the precision: those of parts of the data add up, and are solved once.
//!
//! The Gram matrix has the square of the condition number kappa of its regressors, and rounding of eps in it becomes
//! eps kappa^2 in the solution. Residuals of the data correct that (see `solve`), but here the data are gone. In
//! numbers of twice the precision, with eps^2 = 1e-32, the same becomes eps^2 kappa^2, which is less than what rounding
//! of the data themselves does, eps kappa, wherever they determine anything. So sums of products do what a triangular
//! factor does, and
//!
//! ```text
//! add up: S(1 and 2) = S(1) + S(2), whatever the order, to 1e-31;
//! cost O(N p) where regressors are lagged signals, O(p^2) memory;
//! with a column of ones beside the regressors can be moved by any offsets m afterwards:  S <- T' S T,  T = [1 -m'; 0 I].
//! ```
//!
//! The last needs (offset/standard deviation)^2 digits, of which there are 32.
//!
//! Source: Björck, Numerical Methods for Least Squares Problems, 1996, sections 2.2 and 2.8 (normal equations, and
//! their accumulation in higher precision); Dekker, A floating-point technique for extending the available precision,
//! Numerische Mathematik 18 (1971).

mod monomials;

use faer::fx128;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, DVector};

use super::gram::Products;
use super::lagged::{Lagged, Taps};
use super::solve::{Regression, SAFE_NORMS, Solver, Unsolved};
use super::total::Total;
pub use monomials::DividedMonomials;

/// What rounding leaves of the square of a column that depends on others, of unit norm.
const ROUNDING: f64 = 1e-28;

/// The sums over rows of the products of some columns, the first of which is one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(into = "Stored", try_from = "Stored")]
#[schemars(with = "Stored")]
pub struct ExtendedGram {
    rows: usize,
    size: usize,
    /// The upper triangle, row by row.
    entries: Vec<fx128>,
}

/// As it is written.
#[derive(Serialize, Deserialize, JsonSchema)]
pub struct Stored {
    rows: usize,
    size: usize,
    /// Each number, and what it lacks.
    entries: Vec<[f64; 2]>,
}

impl From<ExtendedGram> for Stored {
    fn from(ExtendedGram { rows, size, entries }: ExtendedGram) -> Self {
        Self { rows, size, entries: entries.iter().map(|entry| [entry.0, entry.1]).collect() }
    }
}

impl TryFrom<Stored> for ExtendedGram {
    type Error = &'static str;

    fn try_from(Stored { rows, size, entries }: Stored) -> Result<Self, Self::Error> {
        let triangle = size.checked_add(1).and_then(|next| size.checked_mul(next)).map(|twice| twice / 2);
        let counted = entries.first().is_some_and(|count| *count == [rows as f64, 0.0]);
        // What a number lacks is less than half of its last digit.
        let exact = |[value, rest]: &[f64; 2]| value.is_finite() && value + rest == *value;
        if triangle != Some(entries.len()) || !counted || !entries.iter().all(exact) {
            return Err("the sums of products do not fit together");
        }
        let entries =
            entries.iter().map(|&[value, rest]| fx128::from_f64(value).add_accurate(fx128::from_f64(rest)));
        Ok(Self { rows, size, entries: entries.collect() })
    }
}

/// A column of a regression: where it stands, and its sign.
pub type Column = (usize, f64);

impl ExtendedGram {
    /// The columns are one, the target, and the lags of each signal in their order. Every row has a full regressor.
    pub fn of(lagged: &Lagged<'_>) -> Self {
        let counted = lagged.segments.iter().map(|segment| (segment.start, lagged.counted(segment)));
        let products = Products::new(&lagged.taps);
        let inner = products.size();
        let sums: Vec<fx128> = products.entries(&lagged.signals, counted.clone());
        let mut first = vec![fx128::ZERO; inner];
        for (_, rows) in counted.clone().filter(|(_, rows)| !rows.is_empty()) {
            products.add_sums(&lagged.signals, &rows, &mut first);
        }
        let rows = counted.map(|(_, rows)| rows.len()).sum();
        let head = std::iter::once(fx128::from_f64(rows as f64)).chain(first);
        let rest = (0..inner).flat_map(|row| sums[row * inner + row..(row + 1) * inner].iter().copied());
        Self { rows, size: inner + 1, entries: head.chain(rest).collect() }
    }

    /// Where the columns of taps stand.
    pub fn columns(taps: &[Taps]) -> Vec<Column> {
        let products = Products::new(taps);
        let each = taps.iter().flat_map(|taps| (0..taps.count).map(move |i| (taps, taps.first + i)));
        each.map(|(taps, lag)| (products.position(taps.signal, lag) + 1, taps.sign)).collect()
    }

    /// The same sums of the columns of fewer taps, each of which stands at a place of this.
    pub fn restricted(&self, taps: &[Taps], places: impl Iterator<Item = usize>) -> Self {
        let size = Products::new(taps).size() + 1;
        let mut of_own = vec![0; size];
        for ((own, _), place) in Self::columns(taps).into_iter().zip(places) {
            of_own[own] = place;
        }
        let entries = (0..size).flat_map(|row| (row..size).map(move |column| (row, column)));
        let entries = entries.map(|(row, column)| self.entry(of_own[row], of_own[column])).collect();
        Self { rows: self.rows, size, entries }
    }

    /// Less an offset of each signal: none of the column of ones.
    pub fn less(&self, taps: &[Taps], offsets: &[f64]) -> Self {
        let of_signals = Products::new(taps);
        let offsets: Vec<f64> =
            std::iter::once(0.0).chain(of_signals.signals().map(|signal| offsets[signal])).collect();
        self.moved(&offsets)
    }

    /// How many columns there are.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Whether all sums are numbers that have kept their digits.
    pub fn is_in_range(&self) -> bool {
        let squares = || (0..self.size).map(|column| self.entry(column, column).0);
        self.entries.iter().all(|entry| entry.is_finite())
            && squares().all(|square| square == 0.0 || SAFE_NORMS.contains(&square.sqrt()))
    }

    /// Phi' Phi, Phi' y and y' y of some columns.
    pub fn plain(&self, columns: &[Column], target: usize) -> (DMatrix<f64>, DVector<f64>, f64) {
        let size = columns.len();
        let entry = |(a, s): Column, (b, t): Column| s * t * self.entry(a, b).0;
        let matrix = DMatrix::from_fn(size, size, |row, column| entry(columns[row], columns[column]));
        let right = DVector::from_fn(size, |row, _| entry(columns[row], (target, 1.0)));
        (matrix, right, self.entry(target, target).0)
    }

    /// N.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds the rows of another one with the same columns.
    pub fn merge(&mut self, other: &Self) {
        self.rows += other.rows;
        self.entries.iter_mut().zip(&other.entries).for_each(|(entry, more)| entry.add(*more));
    }

    fn place(&self, row: usize, column: usize) -> usize {
        let (row, column) = (row.min(column), row.max(column));
        row * self.size - row * (row + 1) / 2 + column
    }

    fn entry(&self, row: usize, column: usize) -> fx128 {
        self.entries[self.place(row, column)]
    }

    /// The sums of the columns less their offsets: S <- T' S T.
    pub(super) fn moved(&self, offsets: &[f64]) -> Self {
        let mut moved = self.clone();
        let rows = fx128::from_f64(self.rows as f64);
        let offset = |column: usize| fx128::from_f64(-offsets[column]);
        for row in 0..self.size {
            for column in row..self.size {
                // (x - m)' (z - n) = x'z - m 1'z - n (1'x - m N).
                let left = self.entry(0, row).add_accurate(offset(row) * rows);
                let across = offset(row) * self.entry(0, column);
                let entry = &mut moved.entries[self.place(row, column)];
                *entry = if row == 0 {
                    entry.add_accurate(offset(column) * rows)
                } else {
                    entry.add_accurate(across).add_accurate(offset(column) * left)
                };
            }
        }
        moved
    }

    /// The sum of the squares of a column about its mean.
    pub fn spread(&self, column: usize) -> f64 {
        self.about_means(column, column).0.max(0.0)
    }

    /// The sum of the products of two columns, less their means.
    fn about_means(&self, one: usize, other: usize) -> fx128 {
        let (one, other) = (one.min(other), one.max(other));
        let level = self.entry(0, one) * self.entry(0, other) / fx128::from_f64(self.rows as f64);
        self.entry(one, other).sub_accurate(level)
    }

    /// The means of the products of some columns; if `centred`, of their deviations from their means, and these.
    pub fn mean_products(&self, columns: &[Column], centred: bool) -> (DMatrix<f64>, Option<DVector<f64>>) {
        let (size, rows) = (columns.len(), fx128::from_f64(self.rows as f64));
        let entry = |(one, s): Column, (other, t): Column| {
            let sum = if centred { self.about_means(one, other) } else { self.entry(one, other) };
            s * t * (sum / rows).0
        };
        let products = DMatrix::from_fn(size, size, |row, column| entry(columns[row], columns[column]));
        let mean = |(place, sign): Column| sign * (self.entry(0, place) / rows).0;
        (products, centred.then(|| DVector::from_fn(size, |row, _| mean(columns[row]))))
    }

    /// The means of the products of combinations of some columns, C S C' / N, if `centred` of their deviations from
    /// their means. In all digits: what combinations leave of the columns may be much smaller than these. O(p^2) for
    /// each combination of p columns.
    pub fn mean_products_of(
        &self,
        columns: &[Column],
        combinations: &DMatrix<f64>,
        centred: bool,
    ) -> DMatrix<f64> {
        let entry = |one: usize, other: usize| {
            if centred { self.about_means(one, other) } else { self.entry(one, other) }
        };
        let weighted = |combination: usize, value: &dyn Fn(usize) -> fx128| {
            let each = (0..columns.len()).map(|k| (k, columns[k].1 * combinations[(combination, k)]));
            each.fold(fx128::ZERO, |sum, (k, factor)| sum.add_accurate(value(k) * fx128::from_f64(factor)))
        };
        let count = combinations.nrows();
        // C S.
        let through = |combination: usize| -> Vec<fx128> {
            let places = columns.iter().map(|(place, _)| *place);
            places.map(|place| weighted(combination, &|k| entry(place, columns[k].0))).collect()
        };
        let through: Vec<Vec<fx128>> = (0..count).map(through).collect();
        let rows = fx128::from_f64(self.rows as f64);
        DMatrix::from_fn(count, count, |row, column| {
            let (row, column) = (row.min(column), row.max(column));
            (weighted(row, &|k| through[column][k]) / rows).0
        })
    }

    /// The regression of a target on some columns: Cholesky, R' R = G, with the target last.
    ///
    /// # Errors
    /// As for [`Lagged::solve`].
    pub fn solve(&self, columns: &[Column], target: usize) -> Result<Regression, Unsolved> {
        let all: Vec<Column> = columns.iter().copied().chain([(target, 1.0)]).collect();
        let size = columns.len();
        // Powers of two: exact.
        let norms: Vec<f64> = all.iter().map(|&(place, _)| self.entry(place, place).0.sqrt()).collect();
        if norms.iter().any(|norm| *norm != 0.0 && !SAFE_NORMS.contains(norm)) {
            return Err(Unsolved::Range);
        }
        let scale = |norm: &f64| if *norm == 0.0 { 1.0 } else { norm.log2().round().exp2() };
        let scales: Vec<f64> = norms.iter().map(scale).collect();
        let mut r = vec![fx128::ZERO; (size + 1) * (size + 1)];
        let at = |row: usize, column: usize| row * (size + 1) + column;
        for column in 0..=size {
            for row in 0..=column {
                let ((a, s), (b, t)) = (all[row], all[column]);
                let entry = self.entry(a, b);
                let (by, other) = (s / scales[row], t / scales[column]);
                let whole = entry * fx128::from_f64(by * other);
                let left =
                    (0..row).fold(whole, |left, k| left.sub_accurate(r[at(k, row)] * r[at(k, column)]));
                let pivot = r[at(row, row)];
                r[at(row, column)] = if row < column {
                    if pivot.0 > 0.0 { left / pivot } else { fx128::ZERO }
                } else if left.0 > ROUNDING * whole.0 || row == size && left.0 > 0.0 {
                    left.sqrt()
                } else {
                    fx128::ZERO
                };
            }
        }
        let plain =
            DMatrix::from_fn(size, size, |row, column| if row > column { 0.0 } else { r[at(row, column)].0 });
        let factor = LeastSquares::from_factor(&plain, &DVector::zeros(size), 0.0, self.rows);
        let factor = factor.map_err(|_| Unsolved::Range)?;
        let rank = factor.rank();
        if !rank.is_full() {
            return Err(Unsolved::Deficient(rank.dependent().collect()));
        }
        // R theta = z, and R X = 1: back substitution.
        let substituted = |mut x: Vec<fx128>| {
            for row in (0..x.len()).rev() {
                let left = (row + 1..x.len()).fold(x[row], |left, k| left.sub_accurate(r[at(row, k)] * x[k]));
                x[row] = left / r[at(row, row)];
            }
            x
        };
        let theta = substituted((0..size).map(|row| r[at(row, size)]).collect());
        let inverse: Vec<Vec<fx128>> = (0..size)
            .map(|column| {
                substituted((0..=column).map(|row| fx128::from_f64(f64::from(row == column))).collect())
            })
            .collect();
        let residual_norm = r[at(size, size)].0 * scales[size];
        let degrees = self.rows.saturating_sub(size).max(1) as f64;
        let variance = residual_norm / degrees * residual_norm;
        let covariance = |i: usize, j: usize| {
            let zero = fx128::ZERO;
            let both = (i.max(j)..size).fold(zero, |sum, k| sum.add_accurate(inverse[k][i] * inverse[k][j]));
            variance * (both.0 / scales[i] / scales[j])
        };
        Ok(Regression {
            parameters: DVector::from_fn(size, |row, _| theta[row].0 * (scales[size] / scales[row])),
            covariance: DMatrix::from_fn(size, size, covariance),
            residual_norm,
            condition: factor.condition(),
            solver: Solver::ExtendedPrecision,
        })
    }
}
