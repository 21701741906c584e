//! Linear regression on lagged signals: `lagged` states the problem and solves it, `gram` forms its Gram
//! matrix from lagged products, `qr` folds its rows into a triangle where that is not exact enough.

mod blocks;
mod gram;
mod kernel;
mod lagged;
mod qr;

#[cfg(test)]
pub(crate) mod noise;
#[cfg(test)]
mod tests;

pub(crate) use kernel::{add_filtered, sum};
pub use lagged::{Initial, Solver};
pub(crate) use lagged::{Lagged, Regression, Taps, Unsolved};
