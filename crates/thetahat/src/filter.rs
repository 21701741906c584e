//! The state of a model, estimated row by row.

mod engine;
mod estimate;
mod estimator;
mod linear;
mod look;
mod matrices;
mod model;
mod smooth;
mod step;
mod summary;
#[cfg(test)]
mod tests;

pub use estimate::{StateEstimate, Totals, Values};
pub use estimator::{Estimator, ObserverGain};
pub use model::StateModel;
pub use smooth::SmoothedStates;
pub use step::StateFilter;
pub use summary::{Estimated, FilterSummary, NisSummary};
