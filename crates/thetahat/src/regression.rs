//! Linear regression on lagged signals: `lagged` states the problem and solves it, `gram` forms its Gram
//! matrix from lagged products, `qr` folds its rows into a triangle where that is not exact enough.

mod blocks;
pub(crate) mod convex;
mod filter;
mod gram;
mod kernel;
mod lagged;
mod qr;

#[cfg(test)]
pub(crate) mod noise;
#[cfg(test)]
mod tests;

pub(crate) use filter::{add_filtered, divide, divide_from, divide_together};
pub(crate) use gram::{Interior, Products};
pub(crate) use kernel::{product, sum, sum_of_squares};
pub use lagged::Solver;
pub(crate) use lagged::{Lagged, Presample, Regression, SAFE_NORMS, Taps, Unsolved, condition};
pub(crate) use qr::factor_rows;
