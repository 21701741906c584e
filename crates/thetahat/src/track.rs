//! Models that are estimated while the plant runs.

mod collecting;
mod estimator;
mod missing;
mod plan;
mod run_length;
mod score;
mod summary;
mod tracker;
mod warm;
mod words;

#[cfg(test)]
mod tests;

pub use plan::{Beginning, PerChannel, Policy, TrackMethod, TrackPlan};
pub use run_length::change_detector;
pub use score::TrackScore;
pub use summary::{TrackSummary, TrackerSummary};
pub use tracker::{Tracked, Tracker};
