//! Linear regression on lagged signals: `lagged` states the problem, `solve` solves it; `gram` forms its Gram matrix from lagged
//! products, `qr` folds its rows into a triangle where that is not exact enough, `extended` sums products in twice the precision
//! where the rows are gone when it is solved.

mod blocks;
pub(crate) mod convex;
mod extended;
mod filter;
mod forward;
mod gram;
mod kernel;
mod lagged;
mod lagged_moments;
mod monomials;
mod qr;
mod solve;
mod span;
mod total;

#[cfg(test)]
pub(crate) mod noise;
#[cfg(test)]
mod tests;

pub(crate) use extended::{Column, DividedMonomials, ExtendedGram};
pub(crate) use filter::{add_filtered, divide, divide_from, divide_together};
pub(crate) use forward::{Chosen as ChosenTerm, Path, forward};
pub(crate) use gram::{Interior, Products, gram, joint_gram};
pub(crate) use kernel::{
    differences, extended_product, extended_sum, largest, product, squares_above, sum, sum_above,
    sum_of_squares,
};
pub(crate) use lagged::{Lagged, Presample, Taps};
pub(crate) use lagged_moments::LaggedMoments;
pub(crate) use monomials::{Moments, Monomials};
pub(crate) use qr::factor_rows;
pub use solve::Solver;
pub(crate) use solve::{Regression, SAFE_NORMS, Unsolved, condition};
pub(crate) use span::Span;
