//! System identification: models of dynamic systems from logged data.
//!
//! A model has the form
//!
//! ```text
//! A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t)
//! ```
//!
//! with A, C, D, F monic in q^-1 and e white (Ljung, System Identification: Theory for the User, 2nd ed. 1999), is
//! written as equations of its states, or is a nonlinear map of past outputs and inputs.
//!
//! # From a log to a model
//!
//! ```
//! use thetahat::Document;
//! use thetahat::data::{Channel, Log};
//! use thetahat::model::Orders;
//! use thetahat::report::{Plan, ValidationPlan, identify, validate};
//! use thetahat::respond::{Horizon, InitialCondition, step_response};
//!
//! // A room of 20 degrees with a heater that is switched on and off, one row every minute.
//! let (mut heater, mut temperature, mut random) = (vec![0.0], vec![20.0], 1_u32);
//! for t in 1..400 {
//!     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
//!     let noise = f64::from(random >> 16) / 32_768.0 - 1.0;
//!     temperature.push(20.0 + 0.9 * (temperature[t - 1] - 20.0) + 0.5 * heater[t - 1] + 0.1 * noise);
//!     heater.push(f64::from(random >> 28 & 1));
//! }
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("heater", heater), channel("temperature", temperature)], 60.0)?;
//!
//! // y(t) + a1 y(t-1) = b1 u(t-1) + e(t), fitted to the first 300 rows.
//! let orders = Orders::arx(1, &[1], &[1])?;
//! let plan = Plan { estimate: vec!["1..300".parse()?], ..Plan::new(&["heater"], "temperature", orders) };
//! let report = identify(log.clone(), &[], &plan)?;
//! let a1 = &report.model.parameters()[0];
//! assert!((a1.value + 0.9).abs() < 3.0 * a1.standard_error.unwrap());
//! assert!(report.to_json()?.contains("thetahat.report/1")); // the document to store
//!
//! // On rows that the fit did not use: the model fits, and nothing is left in its residuals.
//! let held_out = ValidationPlan { rows: vec!["301..400".parse()?], ..ValidationPlan::default() };
//! let validation = validate(&report, None, &log, &[], &held_out)?.validation;
//! assert!(validation.fit[0].percent.unwrap() > 85.0);
//! assert!(validation.residuals[0].ljung_box.p_value.unwrap() > 0.05);
//!
//! // The temperature that the model expects from the heater alone, row by row.
//! let free_run = report.apply(&log, &[], None, Horizon::FreeRun, InitialCondition::Estimate)?;
//! assert_eq!(free_run.outputs[0].predicted.len(), 400);
//!
//! // What the heater does when it is switched on: half a degree in the first minute, five in the end.
//! let step = step_response(report.model.polynomials("a step response")?, 0, None)?;
//! assert!((step.values[1].value - 0.5).abs() < 0.1);
//! assert!((step.values.last().unwrap().value - 5.0).abs() < 0.5);
//! # Ok::<(), thetahat::Error>(())
//! ```
//!
//! # Modules
//!
//! | module | what it is for |
//! |---|---|
//! | [`data`] | logs, rows, records, and what is done to them before a fit |
//! | [`inspect`] | checks of a log before a fit |
//! | [`model`] | orders, models with polynomials, models in equations, nonlinear ARX models |
//! | [`estimate`] | from a record and orders to parameters |
//! | [`optimize`] | the search that estimates share |
//! | [`select`] | which of several models to believe |
//! | [`respond`] | predictions, free runs, forecasts, step and frequency responses |
//! | [`design`] | test signals, and what an experiment with them is worth |
//! | [`validate`] | figures of fit and tests of residuals |
//! | [`spectrum`] | frequency responses from data, without a model |
//! | [`step_test`] | what a course reads off the response to a step |
//! | [`tune`](mod@tune) | PI and PID settings for a process, and the loop that they give |
//! | [`control`](mod@control) | controllers for a model, and the loops that they give |
//! | [`options`] | options as data: tables of them, and those that were given in JSON |
//! | [`plan`] | the options of a fit: a plan |
//! | [`fit`] | from options to a model of any kind |
//! | [`templates`] | plants that are ready, with start values from a log |
//! | [`report`] | the whole way from a log to a document and its page |
//! | [`track`] | models that are estimated while the plant runs |
//! | [`filter`] | states that are estimated while the plant runs |
//! | [`export`](mod@export) | fitted models as source code for firmware |
//! | [`figures`], [`text`] | how numbers and names are written for people |
//!
//! Every [`Document`] is written as JSON and read back. Every function that can fail gives an [`Error`] that says what
//! is wrong, where, and what to do.
//!
//! Rows of a log are counted from 1 and ranges include both ends; sample positions inside a [`data::Record`] are
//! counted from 0. The same input gives the same bits, whatever the number of threads.
//!
//! The crate does not open files, print, or run without a heap. For the last see [`thetahat_core`], whose estimators a
//! [`track::Tracker`] and a [`filter::StateFilter`] are made of.

pub mod control;
pub mod data;
pub mod design;
mod document;
pub mod estimate;
pub mod export;
pub mod filter;
pub mod fit;
pub mod inspect;
pub mod model;
pub mod optimize;
pub mod options;
pub mod plan;
#[cfg(feature = "present")]
pub mod present;
pub mod report;
pub mod respond;
pub mod select;
pub mod spectrum;
pub mod step_test;
pub mod templates;
#[cfg(test)]
mod tests;
pub mod track;
pub mod tune;
pub mod validate;

pub use document::{Cell, Document, Row, is_document};
pub use thetahat_core;
pub use thetahat_numerics::{Error, figures, text};
