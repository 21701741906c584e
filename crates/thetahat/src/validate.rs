//! How good a model is on a record.

mod distribution;
mod fit;
mod independence;
mod moments;
mod residuals;
#[cfg(test)]
mod tests;
mod whiteness;

pub(crate) use distribution::two_sided;
pub use fit::{Fit, Horizon, Part};
pub(crate) use residuals::Relation;
pub use residuals::{Anderson, AndersonLevel, Independence, Residuals, Test};
