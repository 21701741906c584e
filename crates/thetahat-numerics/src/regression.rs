//! Linear regression on lagged signals: `lagged` states the problem, `solve` solves it; `gram` forms its Gram matrix
//! from lagged products, `qr` folds its rows into a triangle where that is not exact enough, `extended` sums products
//! in twice the precision where the rows are gone when it is solved.

mod blocks;
pub mod convex;
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
mod tests;

pub use extended::{Column, DividedMonomials, ExtendedGram};
pub use filter::{add_filtered, divide, divide_from, divide_together};
pub use forward::{Chosen as ChosenTerm, Path, forward};
pub use gram::{Interior, Products, gram, joint_gram};
pub use kernel::{
    add_scaled, differences, extended_product, extended_sum, largest, product, squares_above, sum, sum_above,
    sum_of_squares,
};
pub use lagged::{Lagged, Presample, Taps};
pub use lagged_moments::LaggedMoments;
pub use monomials::{Moments, Monomials};
pub use qr::{Folding, factor_rows};
pub use solve::Solver;
pub use solve::{Regression, SAFE_NORMS, Unsolved, condition};
pub use span::Span;
