//! How good a model is on a record.

pub(crate) mod feedback;
mod fit;
mod independence;
mod moments;
mod nonlinear;
mod residuals;
#[cfg(test)]
mod tests;
mod verdict;
mod whiteness;

pub use fit::{Fit, Part};
pub use nonlinear::Nonlinearity;
pub(crate) use nonlinear::nonlinearities;
pub(crate) use residuals::Relation;
pub use residuals::Residuals;
pub use verdict::{Anderson, AndersonLevel, Independence, Test};
