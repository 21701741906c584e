//! Many linear models from one Gram matrix, that of all their columns.
//!
//! A model's columns are some of all lagged outputs and inputs. Its cost follows from the triangular factor of its own
//! part of the Gram matrix, bordered column by column,
//!
//! ```text
//! G = R'R,  z = R'^-1 Phi'y:   r_k = R_(k-1)'^-1 g_k,  rho_k^2 = g_kk - r_k'r_k,  z_k = (Phi_k'y - r_k'z)/rho_k,
//! sum e^2 = y'y - z'z
//! ```
//!
//! (Golub and Van Loan, Matrix Computations, 4th ed., section 4.2). Sorted by their columns, a model shares the first
//! rows of its factor with the one before it: all nb from one factor, which begins with that of A. Cost: O(N p) for
//! the Gram matrix of p columns, then k^2/2 multiply-adds for the k-th column of a model, and no pass over the data.
//!
//! Where y'y - z'z has lost its digits, or the columns nearly depend on one another, the columns of the triangular
//! factor of the rows stand for those of Phi, and are made orthogonal one after the other, each twice (Giraud, Langou
//! and Rozložník 2005, Computers and Mathematics with Applications 50): as exact as Householder QR. O(N p^2) for that
//! factor.

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use thetahat_numerics::regression::{Lagged, LaggedMoments, Presample, Taps, condition};

use super::EXACT;
use crate::Error;
use crate::data::Record;
use crate::model::Orders;

/// Above this condition number the Gram matrix is not exact enough.
const MAXIMUM_CONDITION: f64 = 1e5;
/// Costs keep at least seven digits.
const DIGITS: f64 = 1e7;
/// A column is dependent if less than this fraction of its norm is orthogonal to the columns before it.
const DEPENDENT: f64 = 1e-13;
/// The same for the norm, where columns are made orthogonal.
const PARALLEL: f64 = 1e-13;

/// All columns that some models have: -y(t-1) … -y(t-na), then u_j(t - l) for each input's lags from the least to the
/// largest.
#[derive(Debug)]
pub(super) struct Columns {
    na: usize,
    inputs: Vec<Lags>,
}

#[derive(Debug, Clone, Copy)]
struct Lags {
    low: usize,
    count: usize,
    /// Where they stand.
    offset: usize,
}

impl Columns {
    pub(super) fn new<'m>(models: impl Iterator<Item = &'m Orders> + Clone, inputs: usize) -> Self {
        let na = models.clone().map(|orders| orders.na).max().unwrap_or(0);
        let mut count = na;
        let lags = |j: usize| {
            let used = models.clone().filter(|orders| orders.nb[j] > 0);
            let low = used.clone().map(|orders| orders.nk[j]).min().unwrap_or(0);
            let end = used.map(|orders| orders.nk[j] + orders.nb[j]).max().unwrap_or(low);
            let lags = Lags { low, count: end - low, offset: count };
            count += lags.count;
            lags
        };
        let inputs = (0..inputs).map(lags).collect();
        Self { na, inputs }
    }

    fn taps(&self) -> Vec<Taps> {
        let output = Taps { signal: 0, first: 1, count: self.na, sign: -1.0 };
        let inputs = self.inputs.iter().enumerate();
        let input =
            |(j, lags): (usize, &Lags)| Taps { signal: j + 1, first: lags.low, count: lags.count, sign: 1.0 };
        std::iter::once(output).chain(inputs.map(input)).collect()
    }

    /// Where a model's columns stand, in the order of its parameters.
    fn of<'m>(&'m self, orders: &'m Orders) -> impl Iterator<Item = usize> + 'm {
        let own = self.inputs.iter().zip(orders.nb.iter().zip(&orders.nk)).filter(|(_, (nb, _))| **nb > 0);
        let inputs = own.flat_map(|(lags, (nb, nk))| {
            let first = lags.offset + nk - lags.low;
            first..first + nb
        });
        (0..orders.na).chain(inputs)
    }
}

/// What models are fitted to: products of columns, or a triangle that stands for them. Those of several parts add up.
#[derive(Debug, Clone)]
pub(super) enum Rows {
    /// Phi'Phi, Phi'y, y'y and N.
    Products(DMatrix<f64>, DVector<f64>, f64, usize),
    /// R and Q'y.
    Factor(LeastSquares<f64, Dyn>),
}

/// How rows are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kept {
    Products,
    Factor,
}

impl Rows {
    /// The rows of a record, of which the first `left_out` of each segment do not count.
    ///
    /// # Errors
    /// [`Error::Data`] if squares leave the range of numbers.
    pub(super) fn new(
        record: &Record<'_>,
        columns: &Columns,
        presample: Presample,
        left_out: usize,
        kept: Kept,
    ) -> Result<Self, Error> {
        let signals: Vec<&[f64]> =
            std::iter::once(record.output).chain(record.inputs.iter().copied()).collect();
        let lagged = Lagged::new(&signals, columns.taps(), &record.segments, presample).after(left_out);
        match kept {
            Kept::Products => {
                let (matrix, right, square) = lagged.normal_equations();
                Ok(Self::Products(matrix, right, square, lagged.rows()))
            }
            Kept::Factor => Ok(Self::Factor(lagged.factor().map_err(out_of_range)?)),
        }
    }

    /// Those of which the moments are known; y is the first of `signals`, which are numbers of theirs.
    pub(super) fn of_moments(moments: &LaggedMoments, signals: &[usize], columns: &Columns) -> Self {
        let (matrix, right, square) = moments.normal_equations(signals, &columns.taps());
        Self::Products(matrix, right, square, moments.rows())
    }

    /// How many rows these are.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Products(.., rows) => *rows,
            Self::Factor(factor) => factor.rows(),
        }
    }

    /// Whether the costs of all models keep their digits.
    pub(super) fn are_exact(&self) -> bool {
        let Self::Products(matrix, right, square, rows) = self else { return true };
        let norms = matrix.diagonal().map(f64::sqrt);
        let safe = |norm: &f64| thetahat_numerics::regression::SAFE_NORMS.contains(norm);
        if !norms.iter().chain([&square.sqrt()]).all(safe) {
            return false;
        }
        let unit =
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] / norms[i] / norms[j]);
        let Some(factor) = Cholesky::new(unit) else { return false };
        let parameters = factor.solve(&right.component_div(&norms));
        let least = square - parameters.dot(&right.component_div(&norms));
        let rounding = 8.0 * f64::EPSILON * (square + parameters.norm_squared());
        least > DIGITS * rounding
            && condition(&factor.l().transpose(), *rows).is_some_and(|c| c <= MAXIMUM_CONDITION)
    }

    /// These and others, kept alike.
    ///
    /// # Errors
    /// [`Error::Data`] if squares leave the range of numbers.
    pub(super) fn add(&mut self, other: &Self) -> Result<(), Error> {
        match (self, other) {
            (Self::Products(matrix, right, square, rows), Self::Products(m, r, s, n)) => {
                *matrix += m;
                *right += r;
                *square += s;
                *rows += n;
                Ok(())
            }
            (Self::Factor(factor), Self::Factor(other)) => factor.merge(other).map_err(out_of_range),
            // Rows of one comparison are kept alike.
            _ => Ok(()),
        }
    }
}

fn out_of_range(_: thetahat_core::Error) -> Error {
    Error::data("squares of the signals leave the range of numbers; scale the channels towards one")
}

/// A linear model and its least squares.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    /// sum e^2.
    pub(super) cost: f64,
    /// theta-hat; empty where it was not asked for.
    pub(super) parameters: Vec<f64>,
}

/// Rows with their columns scaled to unit norm, column by column.
pub(super) struct Scaled {
    /// The norms of the columns, the target's last; 1 of a column of zeros.
    norms: Vec<f64>,
    /// Unit columns, the target last: of the Gram matrix, or of the triangle.
    columns: Vec<f64>,
    size: usize,
    kept: Kept,
}

impl Scaled {
    pub(super) fn new(rows: &Rows) -> Self {
        let (matrix, kept) = match rows {
            Rows::Products(matrix, right, square, _) => {
                let size = right.len();
                let mut all = matrix.clone().resize(size + 1, size + 1, 0.0);
                all.view_mut((0, size), (size, 1)).copy_from(right);
                all.view_mut((size, 0), (1, size)).copy_from(&right.transpose());
                all[(size, size)] = *square;
                (all, Kept::Products)
            }
            Rows::Factor(factor) => {
                let triangle = factor.factor();
                let size = triangle.ncols();
                let mut all = triangle.resize(size + 1, size + 1, 0.0);
                all.view_mut((0, size), (size, 1)).copy_from(&factor.rotated_output());
                all[(size, size)] = factor.residual_norm();
                (all, Kept::Factor)
            }
        };
        let size = matrix.ncols();
        let norm = |k: usize| match kept {
            Kept::Products => matrix[(k, k)].max(0.0).sqrt(),
            Kept::Factor => matrix.column(k).norm(),
        };
        let norms: Vec<f64> = (0..size).map(norm).map(|norm| if norm > 0.0 { norm } else { 1.0 }).collect();
        let mut columns = Vec::with_capacity(size * size);
        for (k, column) in matrix.column_iter().enumerate() {
            match kept {
                Kept::Products => {
                    columns.extend(column.iter().zip(&norms).map(|(g, norm)| g / norm / norms[k]))
                }
                Kept::Factor => columns.extend(column.iter().map(|r| r / norms[k])),
            }
        }
        Self { norms, columns, size, kept }
    }

    fn column(&self, k: usize) -> &[f64] {
        &self.columns[k * self.size..][..self.size]
    }

    fn target(&self) -> usize {
        self.size - 1
    }

    /// y'y.
    fn square(&self) -> f64 {
        self.norms[self.target()] * self.norms[self.target()]
    }

    /// Fits models. None where a model's columns depend on one another.
    pub(super) fn fit(
        &self,
        columns: &Columns,
        models: &[&Orders],
        with_parameters: bool,
    ) -> Vec<Option<Fitted>> {
        let mut flat: Vec<usize> = Vec::new();
        let mut sequences = Vec::with_capacity(models.len());
        for orders in models {
            let from = flat.len();
            flat.extend(columns.of(orders));
            sequences.push(from..flat.len());
        }
        // Neighbours share the beginning of their factors.
        let mut order: Vec<usize> = (0..models.len()).collect();
        order.sort_by(|&a, &b| flat[sequences[a].clone()].cmp(&flat[sequences[b].clone()]));
        let mut ladder = Ladder::new(self, sequences.iter().map(ExactSizeIterator::len).max().unwrap_or(0));
        let mut fitted = vec![None; models.len()];
        for index in order {
            if ladder.climb(&flat[sequences[index].clone()]) {
                let parameters = if with_parameters { ladder.parameters() } else { Vec::new() };
                fitted[index] = Some(Fitted { cost: ladder.cost(), parameters });
            }
        }
        fitted
    }

    /// sum e^2 of given parameters on these rows; zero where it is rounding.
    pub(super) fn cost_of(&self, columns: &Columns, orders: &Orders, parameters: &[f64]) -> f64 {
        let target = self.target();
        // Of e, in terms of unit columns.
        let own = columns.of(orders).zip(parameters).map(|(k, theta)| (k, -theta * self.norms[k]));
        let weights: Vec<(usize, f64)> = own.chain([(target, self.norms[target])]).collect();
        match self.kept {
            Kept::Products => {
                let (mut sum, mut size) = (0.0, 0.0);
                for &(row, weight) in &weights {
                    let column = self.column(row);
                    sum += weights.iter().map(|&(other, value)| weight * value * column[other]).sum::<f64>();
                    size += weight * weight;
                }
                if sum > 8.0 * f64::EPSILON * size { sum } else { 0.0 }
            }
            Kept::Factor => {
                let mut errors = vec![0.0; self.size];
                for &(k, weight) in &weights {
                    errors.iter_mut().zip(self.column(k)).for_each(|(error, r)| *error += weight * r);
                }
                errors.iter().map(|error| error * error).sum()
            }
        }
    }
}

/// The factor of a model's columns. Columns are put on and taken off at its end.
struct Ladder<'s> {
    scaled: &'s Scaled,
    columns: Vec<usize>,
    /// The columns of R one after the other, without the zeros.
    factor: Vec<f64>,
    /// z.
    rotated: Vec<f64>,
    /// What each step leaves of the target's square, 1 first.
    left: Vec<f64>,
    /// Of a triangle: the orthogonal columns, and what each step leaves of the target.
    basis: Vec<f64>,
    targets: Vec<f64>,
    work: Vec<f64>,
}

impl<'s> Ladder<'s> {
    fn new(scaled: &'s Scaled, longest: usize) -> Self {
        let basis = if scaled.kept == Kept::Factor { longest * scaled.size } else { 0 };
        let mut targets = Vec::with_capacity(basis + scaled.size);
        if scaled.kept == Kept::Factor {
            targets.extend_from_slice(scaled.column(scaled.target()));
        }
        let mut left = Vec::with_capacity(longest + 1);
        left.push(1.0);
        Self {
            scaled,
            columns: Vec::with_capacity(longest),
            factor: Vec::with_capacity(longest * (longest + 1) / 2),
            rotated: Vec::with_capacity(longest),
            left,
            basis: Vec::with_capacity(basis),
            targets,
            work: Vec::with_capacity(scaled.size),
        }
    }

    /// Goes to a model's columns by the shortest way. False if they depend on one another.
    fn climb(&mut self, columns: &[usize]) -> bool {
        let common = self.columns.iter().zip(columns).take_while(|(a, b)| a == b).count();
        self.columns.truncate(common);
        self.factor.truncate(common * (common + 1) / 2);
        self.rotated.truncate(common);
        self.left.truncate(common + 1);
        if self.scaled.kept == Kept::Factor {
            self.basis.truncate(common * self.scaled.size);
            self.targets.truncate((common + 1) * self.scaled.size);
        }
        columns[common..].iter().all(|&column| match self.scaled.kept {
            Kept::Products => self.extend(column),
            Kept::Factor => self.orthogonalize(column),
        })
    }

    /// One more column of a Gram matrix.
    fn extend(&mut self, column: usize) -> bool {
        let products = self.scaled.column(column);
        let start = self.factor.len();
        let mut from = 0;
        for (k, &other) in self.columns.iter().enumerate() {
            let before = dot(&self.factor[from..from + k], &self.factor[start..]);
            let value = (products[other] - before) / self.factor[from + k];
            self.factor.push(value);
            from += k + 1;
        }
        let own = &self.factor[start..];
        let pivot = products[column] - dot(own, own);
        if pivot <= DEPENDENT {
            self.factor.truncate(start);
            return false;
        }
        let root = pivot.sqrt();
        let rotated = (products[self.scaled.target()] - dot(own, &self.rotated)) / root;
        self.factor.push(root);
        self.put(column, rotated, |left| left - rotated * rotated)
    }

    /// One more column of a triangle.
    fn orthogonalize(&mut self, column: usize) -> bool {
        let size = self.scaled.size;
        let start = self.factor.len();
        self.work.clear();
        self.work.extend_from_slice(self.scaled.column(column));
        self.factor.resize(start + self.columns.len(), 0.0);
        for _ in 0..2 {
            for (basis, entry) in self.basis.chunks_exact(size).zip(&mut self.factor[start..]) {
                let part = dot(basis, &self.work);
                *entry += part;
                self.work.iter_mut().zip(basis).for_each(|(value, basis)| *value -= part * basis);
            }
        }
        let norm = dot(&self.work, &self.work).sqrt();
        if norm <= PARALLEL {
            self.factor.truncate(start);
            return false;
        }
        self.factor.push(norm);
        self.basis.extend(self.work.iter().map(|value| value / norm));
        let basis = &self.basis[self.basis.len() - size..];
        let last = self.targets.len() - size;
        let rotated = dot(basis, &self.targets[last..]);
        self.targets.extend_from_within(last..);
        let target = &mut self.targets[last + size..];
        target.iter_mut().zip(basis).for_each(|(value, basis)| *value -= rotated * basis);
        let left = dot(target, target);
        self.put(column, rotated, |_| left)
    }

    fn put(&mut self, column: usize, rotated: f64, left: impl Fn(f64) -> f64) -> bool {
        self.columns.push(column);
        self.rotated.push(rotated);
        let before = self.left.last().copied().unwrap_or(1.0);
        self.left.push(left(before));
        true
    }

    /// sum e^2; zero where only rounding is left.
    fn cost(&self) -> f64 {
        let left = self.left.last().copied().unwrap_or(1.0);
        if left > EXACT { left * self.scaled.square() } else { 0.0 }
    }

    /// theta-hat: R theta = z, in the columns' own units.
    fn parameters(&self) -> Vec<f64> {
        let mut parameters = self.rotated.clone();
        for k in (0..parameters.len()).rev() {
            let column = &self.factor[k * (k + 1) / 2..][..=k];
            let value = parameters[k] / column[k];
            parameters[k] = value;
            parameters[..k].iter_mut().zip(column).for_each(|(other, r)| *other -= value * r);
        }
        let target = self.scaled.norms[self.scaled.target()];
        parameters
            .iter_mut()
            .zip(&self.columns)
            .for_each(|(value, &column)| *value *= target / self.scaled.norms[column]);
        parameters
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
