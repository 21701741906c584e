//! Least squares on lagged signals without their regressor matrix.
//!
//! A row of the regressor matrix Phi holds lagged samples, `phi_c(t) = s_c x_c(t - l_c)`. Its Gram matrix comes
//! from lagged products (see `gram`), its columns are scaled to unit norm, the normal equations are
//! solved by Cholesky, and the solution is corrected with true residuals:
//!
//! ```text
//! G = R' R,  R' R theta = Phi' y;   repeat  r = y - Phi theta,  R' R delta = Phi' r,  theta += delta.
//! ```
//!
//! Source: Björck, Stability analysis of the method of seminormal equations for linear least squares
//! problems, Linear Algebra and its Applications 88/89 (1987), section 3. The error stays below
//! `4 eps (kappa + kappa^2 |r| / |theta|)`, the bound of Householder QR, where the corrections contract;
//! elsewhere, and above a condition number of 5e6, the rows go through `qr`. The covariance comes from R as it is:
//! the relative error of the standard errors is up to eps kappa^2 / 2, 0.2 % at 5e6 (measured).
//! Cost: O(N p) for the Gram matrix and for each correction, p^3 / 6 for the factor.

use std::ops::{Range, RangeInclusive};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::blocks::{Segment, blocks, sum_blocks};
use super::gram::gram;
use super::kernel::{add_filtered, correlations, product};
use super::lagged::Lagged;
use super::qr;

/// Above this condition number the normal equations do not reach QR's accuracy.
const MAXIMUM_CONDITION: f64 = 5e6;
/// Up to this condition number one correction is enough, unless the Gram matrix is a sum over very many segments.
const ONE_CORRECTION: f64 = 1e5;
/// While above the rounding floor, each correction must be this much smaller than the one before.
const CONTRACTION: f64 = 0.02;
const MAXIMUM_CORRECTIONS: usize = 10;
/// What a difference of two sums keeps of them at least, to be exact to 13 digits.
const CANCELLATION: f64 = 1e-3;
/// Column norms of which products neither overflow nor lose digits.
pub const SAFE_NORMS: RangeInclusive<f64> = 1e-140..=1e140;

/// How a least-squares problem was solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Cholesky of the Gram matrix, corrected with true residuals.
    NormalEquations,
    /// Householder reflections on blocks of rows: where the regressors are nearly dependent.
    Qr,
    /// Cholesky of the Gram matrix in twice the precision: where the rows are gone, as those of pieces that were
    /// merged.
    ExtendedPrecision,
}

/// A solved regression.
#[derive(Debug, Clone)]
pub struct Regression {
    /// theta-hat, p values.
    pub parameters: DVector<f64>,
    /// `sigma^2 (Phi' Phi)^-1`, p x p, with `sigma^2 = |y - Phi theta|^2 / (N - p)`.
    pub covariance: DMatrix<f64>,
    /// `|y - Phi theta|`.
    pub residual_norm: f64,
    /// The condition number of Phi, its columns scaled to unit norm.
    pub condition: f64,
    /// What solved it.
    pub solver: Solver,
}

/// Why a regression has no solution.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unsolved {
    /// These columns are zero or combinations of the others, to rounding.
    Deficient(Vec<usize>),
    /// Samples or results leave the range of `f64`.
    Range,
}

impl Lagged<'_> {
    /// The normal equations Phi' Phi theta = Phi' y, and y' y. O(N p).
    ///
    /// With the instruments among the columns, the block Z' Phi of an instrumental-variable system is a part of Phi'
    /// Phi.
    pub fn normal_equations(&self) -> (DMatrix<f64>, DVector<f64>, f64) {
        gram(self)
    }

    /// Solves the regression, which must have more rows than parameters.
    ///
    /// # Errors
    /// [`Unsolved`] says which columns depend on others.
    pub fn solve(&self) -> Result<Regression, Unsolved> {
        match self.solve_normal_equations() {
            Some(solved) => Ok(solved),
            None => Regression::from_factor(&self.factor().map_err(|_| Unsolved::Range)?),
        }
    }

    /// Corrected semi-normal equations; `None` where they are not exact enough.
    fn solve_normal_equations(&self) -> Option<Regression> {
        let (mut matrix, right, square) = gram(self);
        let size = right.len();
        let norms = matrix.diagonal().map(f64::sqrt);
        if !norms.iter().chain([&square.sqrt()]).all(|norm| SAFE_NORMS.contains(norm)) {
            return None;
        }
        for (column, norm) in norms.iter().enumerate() {
            matrix.column_mut(column).component_div_assign(&norms);
            matrix.column_mut(column).unscale_mut(*norm);
        }
        let factor = Cholesky::new(matrix)?;
        let triangle = factor.l().transpose();
        let condition = condition(&triangle, self.rows())?;
        if condition > MAXIMUM_CONDITION {
            return None;
        }

        let mut scaled = factor.solve(&right.component_div(&norms));
        let mut previous = scaled.norm();
        for pass in 1..=MAXIMUM_CORRECTIONS {
            let (sum_of_squares, gradient) = self.residuals(&scaled.component_div(&norms));
            let gradient = gradient.component_div(&norms);
            let correction = factor.solve(&gradient);
            scaled += &correction;
            let (step, length) = (correction.norm(), scaled.norm());
            let residual = sum_of_squares.sqrt();
            let rounding = f64::EPSILON * (condition * length + condition * condition * residual);
            // |r - Phi delta|^2 = |r|^2 - delta' Phi' r, as R' R delta = Phi' r.
            let corrected = sum_of_squares - correction.dot(&gradient);
            // Where only rounding is left of it (data without noise), the residuals are computed once more.
            let exact = pass > 1 || corrected >= CANCELLATION * sum_of_squares;
            // The next correction would be as much smaller than this one as this one is than the one before.
            let settled = condition <= ONE_CORRECTION && step * (step / previous) <= rounding;
            if (settled || step <= 4.0 * rounding) && exact {
                let sum_of_squares = corrected.max(0.0);
                let variance = sum_of_squares / (self.rows() - size) as f64;
                let inverse = factor.solve(&DMatrix::identity(size, size));
                return Some(Regression {
                    parameters: scaled.component_div(&norms),
                    covariance: DMatrix::from_fn(size, size, |i, j| {
                        variance * (inverse[(i, j)] / norms[i] / norms[j])
                    }),
                    residual_norm: sum_of_squares.sqrt(),
                    condition,
                    solver: Solver::NormalEquations,
                });
            }
            if !step.is_finite() || (pass > 1 && step > CONTRACTION * previous) {
                return None;
            }
            previous = step;
        }
        None
    }

    /// `|r|^2` and `Phi' r` of the residuals `r = y - Phi theta`. 4 N p flops.
    fn residuals(&self, parameters: &DVector<f64>) -> (f64, DVector<f64>) {
        let size = parameters.len();
        // The first L rows of a segment that has no past are taken one by one.
        let mut edges = vec![0.0; size + 1];
        let mut inner = Vec::new();
        for segment in self.segments {
            let rows = self.counted(segment);
            let full = rows.start.max(segment.start + self.longest).min(rows.end);
            for row in rows.start..full {
                let regressor =
                    || self.columns().map(|(x, lag, sign)| sign * self.sample(x, segment.start, row, lag));
                let predicted: f64 = regressor().zip(parameters).map(|(phi, theta)| phi * theta).sum();
                let residual = self.sample(0, segment.start, row, 0) - predicted;
                edges[0] += residual * residual;
                for (sum, phi) in edges.iter_mut().skip(1).zip(regressor()) {
                    *sum += phi * residual;
                }
            }
            inner.push(Segment { start: segment.start, rows: full..rows.end });
        }
        let blocks = blocks(inner.into_iter());
        let mut sums = vec![0.0; blocks.len().max(1) * (size + 1)];
        sum_blocks(&blocks, size + 1, &mut sums, |Segment { rows, .. }, sums| {
            let residuals = self.full_residuals(rows, parameters);
            sums[0] += product(&residuals, &residuals);
            let mut next = 1;
            for taps in self.taps.iter().filter(|taps| taps.count > 0) {
                let x = &self.signals[taps.signal][rows.start - taps.last()..rows.end - taps.first];
                correlations(&residuals, x, &mut sums[next..next + taps.count]);
                next += taps.count;
            }
        });
        let mut next = 1;
        for taps in &self.taps {
            // They come with the largest lag first.
            let products = &mut sums[next..next + taps.count];
            products.reverse();
            products.iter_mut().for_each(|product| *product *= taps.sign);
            next += taps.count;
        }
        sums.iter_mut().zip(edges).for_each(|(sum, edge)| *sum += edge);
        (sums[0], DVector::from_column_slice(&sums[1..=size]))
    }

    /// The residuals of rows with a full regressor.
    fn full_residuals(&self, rows: &Range<usize>, parameters: &DVector<f64>) -> Vec<f64> {
        let mut residuals = self.signals[0][rows.clone()].to_vec();
        let mut next = 0;
        for taps in self.taps.iter().filter(|taps| taps.count > 0) {
            let weights: Vec<f64> = parameters.as_slice()[next..next + taps.count]
                .iter()
                .map(|theta| -taps.sign * theta)
                .collect();
            next += taps.count;
            let x = &self.signals[taps.signal][rows.start - taps.last()..rows.end - taps.first];
            add_filtered(&mut residuals, &weights, x);
        }
        residuals
    }

    /// The triangular factor of the rows, in the signals' own units, as exact as Householder QR. 2 N p^2 flops.
    ///
    /// # Errors
    /// If a sample is not finite, or too large for its squares to be summed without overflow.
    pub fn factor(&self) -> Result<LeastSquares<f64, Dyn>, thetahat_core::Error> {
        let scales: Vec<f64> = self.signals.iter().map(|signal| scale(signal, self.segments)).collect();
        let columns: Vec<(usize, usize, f64)> = self.columns().chain([(0, 0, 1.0)]).collect();
        let segments =
            self.segments.iter().map(|segment| Segment { start: segment.start, rows: self.counted(segment) });
        qr::factor(
            &blocks(segments),
            |segment, row, column| {
                let (signal, lag, sign) = columns[column];
                sign * scales[signal] * self.sample(signal, segment.start, row, lag)
            },
            &columns.iter().map(|&(signal, _, _)| scales[signal]).collect::<Vec<_>>(),
        )
    }
}

impl Regression {
    /// The solution that a triangular factor of more rows than columns holds.
    pub fn from_factor(factor: &LeastSquares<f64, Dyn>) -> Result<Self, Unsolved> {
        let unsolved = |error| match error {
            thetahat_core::Error::RankDeficient { .. } => {
                Unsolved::Deficient(factor.rank().dependent().collect())
            }
            _ => Unsolved::Range,
        };
        let solution = factor.solve().map_err(unsolved)?;
        let size = solution.parameters().len();
        Ok(Self {
            parameters: solution.parameters().clone(),
            covariance: solution
                .covariance()
                .unwrap_or_else(|| DMatrix::from_element(size, size, f64::INFINITY)),
            residual_norm: solution.residual_norm(),
            condition: factor.condition(),
            solver: Solver::Qr,
        })
    }
}

/// A power of two that brings a signal near one where its squares could overflow or lose digits; else 1.
fn scale(signal: &[f64], segments: &[Range<usize>]) -> f64 {
    let largest = segments
        .iter()
        .flat_map(|segment| &signal[segment.clone()])
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if largest == 0.0 || (1e-100..=1e100).contains(&largest) {
        return 1.0;
    }
    // 2^1000 at most: scales and their quotients stay finite.
    (-largest.log2().round().clamp(-1000.0, 1000.0)).exp2()
}

/// The condition number of a triangular factor of which the columns have unit norm.
pub fn condition(triangle: &DMatrix<f64>, rows: usize) -> Option<f64> {
    let zeros = DVector::zeros(triangle.ncols());
    LeastSquares::from_factor(triangle, &zeros, 0.0, rows).ok().map(|factor| factor.condition())
}
