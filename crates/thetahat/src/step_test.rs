//! Step tests: what a course reads off the response to a step by hand, with the spread of each way.
//!
//! - [`step_test()`] finds the steps of an input in a [`Log`](crate::data::Log), as a [`StepTestPlan`] says, and
//!   evaluates each response.
//! - [`sine_test`] reads the time constant off a measured frequency response, where its phase is -45 degrees.
//! - [`StepTest`] is the document: each [`Step`] with its [`StepResponse`], a list of [`StepEstimate`]s (a
//!   [`StepFigure`] by a [`StepMethod`]), and their [`StepSummary`] over the steps, beside the [`FittedProcess`] of
//!   least squares. [`Shape`] says which picture fits.
//!
//! ```
//! use thetahat::data::{Channel, Log};
//! use thetahat::step_test::{StepFigure, StepMethod, StepTestPlan, step_test};
//!
//! // A gain of 2, a time constant of 10 s; the input steps from 1 to 4 at 50 s.
//! let u: Vec<f64> = (0..250).map(|t| if t < 50 { 1.0 } else { 4.0 }).collect();
//! let y = (0..250).map(|t| 20.0 + 6.0 * (1.0 - (-f64::from((t - 50).max(0)) / 10.0).exp())).collect();
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
//! let found = step_test(&log, &[], &StepTestPlan::new("u", "y"))?;
//! let value = |figure, method| found.summary(figure, method).unwrap().value.value;
//! assert!((value(StepFigure::Gain, StepMethod::Regime) - 2.0).abs() < 1e-3);
//! assert!((value(StepFigure::TimeConstant, StepMethod::WeightedAverage) - 10.0).abs() < 0.02);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod document;
mod evaluate;
mod first_order;
mod influence;
mod levels;
mod noise;
mod process;
mod response;
mod run;
mod second_order;
mod sines;
#[cfg(test)]
mod tests;

pub use document::{
    FittedProcess, Shape, Step, StepEstimate, StepFigure, StepMethod, StepResponse, StepSummary, StepTest,
};
pub use run::{StepTestPlan, step_test};
pub use sines::sine_test;
