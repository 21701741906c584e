//! The state of a model, estimated row by row.
//!
//! - [`StateModel`] is a model with states: of a report, of matrices, or in equations, of which parameters may be
//!   unknown. It begins in an [`InitialState`].
//! - [`StateFilter`] estimates the state by an [`Estimator`]: a Kalman filter, an extended or unscented one, a set for
//!   noise that is bounded, or a Luenberger observer with an [`ObserverGain`]. Each row gives a [`StateEstimate`] with
//!   [`StateValues`].
//! - [`SmoothedStates`] are those given all rows, [`FilterSnapshot`] is a filter that is stored to go on later,
//!   [`FilterSummary`] is the document of a run, with an [`EstimatedNumber`] for each unknown parameter.
//! - [`StateModel::fit_noise`] finds the noises of a model in matrices from some [`NoiseLog`]s: a [`NoiseEstimate`].
//!
//! The filters, with equations and sources, are in [`thetahat_core`].
//!
//! ```
//! use thetahat::filter::{Estimator, StateFilter, StateModel};
//!
//! let model = StateModel::from_toml(
//!     "sample_time = 1
//!      states = ['level']
//!      outputs = ['y']
//!      F = [[1]]
//!      H = [[1]]
//!      Q = [[1]]
//!      R = [[3]]
//!      P0 = [[1]]",
//! )?;
//! let mut filter = StateFilter::new(model, Estimator::Kalman)?;
//! let level = filter.step(None, &[], &[2.0])?.filtered.expect("a filtered state");
//! assert!((level.values[0] - 0.5).abs() < 1e-12); // P0/(P0 + R) of the innovation 2
//! # Ok::<(), thetahat::Error>(())
//! ```

mod bounded;
mod estimate;
mod estimator;
mod frame;
mod kind;
mod lags;
mod linear;
mod linearization;
mod matrices;
mod model;
mod noises;
mod past;
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
pub use frame::InitialState;
pub use model::StateModel;
pub use noises::{NoiseEstimate, NoiseLog};
pub use smooth::SmoothedStates;
pub use snapshot::FilterSnapshot;
pub use step::StateFilter;
pub use summary::{EstimatedNumber, FilterSummary};
