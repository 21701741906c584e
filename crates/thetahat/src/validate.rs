//! How good a model is on a record.

pub(crate) mod feedback;
mod fit;
mod independence;
mod moments;
mod nis;
mod residuals;
#[cfg(test)]
mod tests;
mod verdict;
mod whiteness;

pub(crate) use fit::closeness;
pub use fit::{Fit, Horizon, Part};
pub(crate) use nis::NisCount;
pub use nis::NisSummary;
pub(crate) use residuals::Relation;
pub use residuals::Residuals;
pub use verdict::{Anderson, AndersonLevel, Independence, Test};
