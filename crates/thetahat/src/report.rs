//! The document that a fit leaves behind, and the way there.

mod identify;
mod schema;

pub use identify::{Plan, Source, identify};
pub use schema::{Data, Estimation, Missing, Report, Resampling};
