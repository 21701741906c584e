//! System identification: models of dynamic systems from logged data.
//!
//! A model has the form
//!
//! ```text
//! A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t)
//! ```
//!
//! with A, C, D, F monic in q^-1 and e white (Ljung, System Identification: Theory for the User, 2nd ed. 1999).
//! This version fits ARX models, those with C = D = F = 1.
//!
//! - [`Log`] holds channels on a common clock, [`Record`] the signals of one experiment.
//! - [`arx`] gives an [`Estimate`] from a [`Record`]; [`arx_factor`] gives a triangular factor that merges with others.
//! - [`predict`] and [`simulate`] say what a [`Model`] says; [`Fit`] says how close that is.
//! - [`identify`] goes the whole way from a [`Log`] to a [`Report`], the JSON document; [`apply`] takes a stored model to a log.
//!
//! Rows of a log are counted from 1 and ranges include both ends; sample positions inside a [`Record`] are counted from 0.
//! The same input gives the same bits, whatever the number of threads.
//!
//! What it does not do: open files, print, or estimate while a system runs. For the last see `thetahat-core`.

mod data;
mod error;
mod estimate;
mod model;
mod regression;
mod report;
mod respond;
mod select;
mod validate;

pub use data::{Channel, Detrend, Interpolation, Log, Offset, Record, Rows};
pub use error::Error;
pub use estimate::{Estimate, Solver, arx, arx_factor};
pub use model::{Complex, Model, Orders, Parameter, Signal, Structure};
pub use regression::Initial;
pub use report::{Applied, Data, Estimation, Missing, Plan, Report, Resampling, Source, apply, identify};
pub use respond::{Response, Start, predict, simulate};
pub use select::Criteria;
pub use thetahat_core;
pub use validate::{Fit, Horizon, Part};
