//! The document that a fit leaves behind, and the way there.

mod apply;
mod identify;
mod schema;

pub use apply::{Applied, apply};
pub use identify::{Plan, identify, identify_monitored};
pub use schema::{Data, Estimation, Missing, Report, Resampling, Source};
