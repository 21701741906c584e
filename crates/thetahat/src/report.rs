//! From a log to a document: fits, validations and comparisons of whole logs, and their pages.
//!
//! - [`identify`] fits what a [`Plan`] says and gives a [`Report`]; [`identify_monitored`] can be watched and ended,
//!   [`PendingEvaluation`] is a fit before its figures. [`fit_equations`] does the same for a model in equations with
//!   an [`EquationsPlan`], [`fit_process`] for a process in continuous time with a [`ProcessPlan`],
//!   [`fit_process_to_response`] for one of a measured frequency response, [`fit_state_space`]
//!   ([`fit_state_space_monitored`]) for a model with any number of outputs with a [`StateSpacePlan`],
//!   [`fit_states_to_response`] for one of a measured frequency response,
//!   [`fit_nonlinear_arx`] for a nonlinear ARX model with a [`NonlinearArxPlan`] ([`InputLags`], [`MapPlan`],
//!   [`Centres`]), [`fit_arima`] for a seasonal ARIMA model with an [`ArimaPlan`].
//! - [`NormalEquations`] are made from pieces of the data, add up, and are solved for one model: for logs larger than
//!   memory.
//! - [`Experiments`] are what others hold, in other processes or on other machines, as a search for one model of all
//!   sees them; a model in equations is found by [`fit_equations_distributed`], whose questions get an
//!   [`answer_equations`].
//! - [`Report`] is the JSON document of a fit: its [`Data`] ([`Parts`], [`Missing`]), the model, its [`Estimation`] and
//!   its figures.
//! - [`validate`] tests a report on a log as a [`ValidationPlan`] says. It gives a [`Validated`]: the document, a
//!   [`Validation`] with [`NoiseLevel`], [`Coverage`] and whether the fit has [`InSample`] the rows, and the
//!   [`Signals`] for charts ([`OutputSignals`]).
//! - [`Report::reduced`] is a report of a model with fewer states.
//! - [`compare`] puts several validations side by side in a [`Comparison`]. A [`Requirement`] (a [`Demand`] of an
//!   output or of all) makes a gate of a validation.
//! - [`apply`] predicts or simulates a log with a stored model ([`Applied`], [`AppliedOutput`]), [`sample`] draws from
//!   it. [`held_out_runs`] are the free runs of the models between which a choice was made.
//!
//! ```
//! use thetahat::Document;
//! use thetahat::data::{Channel, Log};
//! use thetahat::model::Orders;
//! use thetahat::report::{Plan, Report, Requirement, ValidationPlan, identify, validate};
//!
//! let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
//! let y = [vec![0.0], u[..199].to_vec()].concat();
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
//! let report = identify(log.clone(), &[], &Plan::new(&["u"], "y", Orders::arx(0, &[1], &[1])?))?;
//! let stored = Report::from_json(&report.to_json()?)?;
//! let validation = validate(&stored, None, &log, &[], &ValidationPlan::default())?.validation;
//! let requirement: Requirement = "fit>=90".parse()?;
//! assert_eq!(requirement.unmet(&validation, 0.05), None);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod apply;
mod arima;
mod blocks;
mod convert;
mod equations;
mod evaluate;
mod experiments;
mod fitted_rows;
mod from_sums;
mod held_out_runs;
mod identify;
mod known;
mod nonlinear_arx;
mod nonlinear_choice;
mod normal_equations;
mod pending;
mod plan;
mod process;
mod purpose;
mod reduce;
mod requirement;
mod response;
mod row;
mod sample;
mod schema;
mod shares;
mod state_space;
mod suited;
#[cfg(test)]
mod tests;
mod totals;
mod validation;
mod warnings;

pub use apply::{Applied, AppliedOutput, apply};
pub use arima::{ArimaPlan, fit_arima};
pub use blocks::{BlocksPlan, fit_blocks};
pub use equations::{
    EquationsPlan, answer_equations, fit_equations, fit_equations_distributed, fit_equations_to_response,
};
pub use experiments::Experiments;
pub use held_out_runs::held_out_runs;
pub use identify::{identify, identify_monitored};
pub use nonlinear_arx::{Centres, InputLags, MapPlan, NonlinearArxPlan};
pub use nonlinear_choice::{fit_nonlinear_arx, fit_nonlinear_arx_monitored};
pub use normal_equations::NormalEquations;
pub use pending::PendingEvaluation;
pub use plan::Plan;
pub use process::{ProcessPlan, fit_process, fit_process_to_response};
pub use requirement::{Demand, Requirement};
pub use sample::sample;
pub use schema::{Data, Estimation, Missing, Parts, Report};
pub use state_space::{StateSpacePlan, fit_state_space, fit_state_space_monitored, fit_states_to_response};
pub(crate) use suited::{SAME_TIME, check_sample_time};
pub use validation::{
    Comparison, Coverage, InSample, LikelihoodRatio, NoiseLevel, Offsets, OutputSignals, Signals, Validated,
    Validation, ValidationOptions, ValidationPlan, compare, validate,
};
