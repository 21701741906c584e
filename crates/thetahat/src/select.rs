//! Which of several models to believe.
//!
//! - [`choose_orders`] compares the models of a [`Choice`] on the same samples and gives a [`Selection`].
//! - [`Choice`] is a model that is known, a [`Grid`] of [`OrderRange`]s that is walked along a [`Path`], or
//!   [`Automatic`]: structures and orders that the data suggest.
//! - [`Select`] is what makes one model better: an information criterion, or errors on samples that it was not fitted
//!   to ([`HeldOut`]). [`Focus`] is what the model is for.
//! - [`Selection`] has every model that was compared ([`Candidate`], [`ProcessCandidate`], [`StateSpaceCandidate`]),
//!   the winners ([`Best`]) and the delays ([`Delay`], [`DelayScore`]).
//!
//! ```
//! use thetahat::data::Record;
//! use thetahat::select::{Automatic, Choice, Select, choose_orders};
//!
//! // y(t) = 0.8 y(t-1) + u(t-2) + e(t)
//! let random = |t: u32, by: u32| f64::from(t * t % by) / f64::from(by) - 0.5;
//! let u: Vec<f64> = (0..300).map(|t| random(t, 71)).collect();
//! let mut y = vec![0.0; 2];
//! for t in 2..300 {
//!     y.push(0.8 * y[t - 1] + u[t - 2] + 0.05 * random(t as u32, 97));
//! }
//! let choice = Choice::Automatic(Automatic::default());
//! let found = choose_orders(&Record::new(&y, vec![&u])?, None, &choice, Select::MDL)?;
//! assert_eq!(found.chosen.orders.nk, [2]);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod automatic;
mod candidates;
mod choice;
mod choose;
mod compare;
mod delay;
mod drift;
mod focus;
mod folds;
mod grid;
mod held_out;
mod held_out_mse;
mod linear;
mod processes;
mod prose;
mod ranking;
mod rival;
mod search;
mod selection;
mod states;
mod task;
#[cfg(test)]
mod tests;
mod winners;

pub(crate) use automatic::constant_pays;
pub use choice::{Automatic, Choice, Grid, OrderRange, Path, Select};
pub(crate) use choose::choose;
pub use choose::choose_orders;
pub(crate) use compare::few_for_blocks;
pub(crate) use delay::{delays, delays_of};
pub(crate) use drift::drifting;
pub use focus::Focus;
pub(crate) use processes::{is_step_test, processes};
pub(crate) use rival::on_blocks;
pub use selection::{
    Best, Candidate, Delay, DelayScore, HeldOut, ProcessCandidate, Selection, StateSpaceCandidate,
};
pub(crate) use states::states;
use task::EXACT;
pub(crate) use task::{SelectedModel, Task};
