//! Test signals for experiments, and what an experiment with them is worth.
//!
//! - [`TestSignal`] is a signal of some [`Waveform`] (a [`SignalKind`], and how long its values are held), made of a
//!   [`SignalPlan`]; [`SignalFigures`] says how rich it is.
//! - [`planned()`] is a model as it would be known after an experiment. [`compare_signals`] puts signals side by side
//!   in an [`ExperimentDesign`]: the [`SignalWorth`] of each for some [`DesignFigure`]s, and how long each has to be
//!   for the errors that a [`Want`] says, with its [`Limit`].
//!
//! ```
//! use thetahat::design::{SignalFigures, SignalKind, SignalPlan, TestSignal};
//!
//! let plan = SignalPlan { length: 1000, band: Some([0.1, 1.0]), ..SignalPlan::new(SignalKind::Multisine) };
//! let values = TestSignal::new(&plan)?.values(plan.length);
//! let figures = SignalFigures::of(&values[0], plan.sample_time);
//! // 144 sinusoids below a third of half the sampling frequency: the slow ones look alike over a few samples.
//! assert!(figures.crest_factor.unwrap() < 1.43 && figures.order > 15);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod figures;
mod multisine;
mod options;
mod planned;
mod prbs;
mod signal;
#[cfg(test)]
mod tests;
mod want;
mod waveform;
mod worth;

pub use figures::SignalFigures;
pub use options::DesignOptions;
pub use planned::planned;
pub use signal::{SignalPlan, TestSignal};
pub use want::{Limit, Want};
pub use waveform::{SignalKind, Waveform};
pub use worth::{DesignFigure, ExperimentDesign, SignalWorth, compare_signals};
