//! Models that are estimated while the plant runs, row by row.
//!
//! - [`Tracker`] estimates an ARX, ARMAX or nonlinear ARX model, predicts, and raises alarms where the plant changes.
//!   Each row gives a [`Tracked`]. Several outputs are as many trackers ([`Tracker::coupled`]), of which [`forecasts`]
//!   are made at once.
//! - [`TrackPlan`] says how: the [`TrackMethod`], a [`Policy`] of forgetting, a [`TrackStart`], and numbers for each
//!   channel ([`PerChannel`]).
//! - [`TrackScore`] says how well it predicted so far, [`TrackerSummary`] what it knows, [`TrackSummary`] is the
//!   document of a run.
//! - [`change_detector`] makes a detector with a mean number of samples between false alarms.
//!
//! The estimators, with equations and sources, are in [`thetahat_core`].
//!
//! ```
//! use thetahat::model::Orders;
//! use thetahat::track::{TrackPlan, Tracker};
//!
//! let mut tracker = Tracker::new(&Orders::arx(1, &[1], &[1])?, &TrackPlan::default())?;
//! let mut y = 0.0;
//! for k in 0..200 {
//!     let u = if k % 7 < 3 { 1.0 } else { -1.0 };
//!     tracker.log_row(y, &[u])?;
//!     y = 0.8 * y + 0.5 * u;
//! }
//! let parameters = tracker.parameters().expect("an estimate");
//! assert!((parameters[0] + 0.8).abs() < 1e-3 && (parameters[1] - 0.5).abs() < 1e-3);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod checks;
mod collecting;
mod equation;
mod estimator;
mod forecasts;
mod missing;
mod options;
mod plan;
mod run_length;
mod score;
mod summary;
#[cfg(test)]
mod tests;
mod tracker;
mod warm;
mod words;

pub use forecasts::{forecasts, predictions};
pub use options::{TrackMap, TrackModel, TrackOptions};
pub use plan::{PerChannel, Policy, TrackMethod, TrackOutliers, TrackPlan, TrackStart};
pub use run_length::change_detector;
pub use score::TrackScore;
pub use summary::{TrackSummary, TrackerSummary};
pub use tracker::{Tracked, Tracker};
pub(crate) use warm::{polynomials, relative, scales};
