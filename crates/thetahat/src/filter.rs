//! The state of a model, estimated row by row.

mod estimate;
mod estimator;
mod kind;
mod linear;
mod linearization;
mod matrices;
mod model;
mod row;
mod smooth;
mod snapshot;
mod step;
mod summary;
#[cfg(test)]
mod tests;
mod totals;

pub use estimate::{StateEstimate, StateValues};
pub use estimator::{Estimator, ObserverGain};
pub use linear::InitialState;
pub use model::StateModel;
pub use smooth::SmoothedStates;
pub use snapshot::FilterSnapshot;
pub use step::StateFilter;
pub use summary::{EstimatedNumber, FilterSummary};
