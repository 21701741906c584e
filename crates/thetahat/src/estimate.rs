//! From a record and orders to parameters.

mod arx;
#[cfg(test)]
mod tests;

pub use crate::regression::Solver;
pub(crate) use arx::enough;
pub use arx::{Estimate, arx, arx_factor};
