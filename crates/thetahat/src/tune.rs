//! PI and PID settings for a process, and the loop that they give.
//!
//! - [`tune`] gives a [`Tuning`], the document: for each [`Rule`] and [`Controller`] the settings, and what the loop
//!   with the fitted process does with them ([`ClosedLoop`]).
//!
//! Controllers are of the ideal form with the derivative filtered:
//!
//! ```text
//! C(s) = Kc (1 + 1/(Ti s) + Td s/(1 + Td s/10))
//! ```

mod closed_loop;
mod document;
mod lags;
mod rules;
#[cfg(test)]
mod tests;

pub use document::{ClosedLoop, Controller, ControllerSettings, ReducedProcess, Rule, Tuning};
pub use rules::{TuningPlan, tune};
