//! How good a model is on a record: figures of fit, and tests of what is left.
//!
//! - [`Fit`] says how close a response comes to the measured output, and what the rows served for ([`Part`]).
//! - [`Residuals`] are tests of the one-step errors: whether they are white (Ljung and Box 1978, a [`Test`];
//!   [`Anderson`] with its [`AndersonLevel`]s), and whether they depend on an input ([`Independence`]).
//!
//! [`report::validate`](crate::report::validate) makes all of them for a model and a log:
//!
//! ```
//! use thetahat::data::{Channel, Log};
//! use thetahat::model::Orders;
//! use thetahat::report::{Plan, ValidationPlan, identify, validate};
//!
//! let u: Vec<f64> = (0..300).map(|t| f64::from(t * t % 11)).collect();
//! let mut y = vec![0.0];
//! for (t, u) in (1..300_u32).zip(&u) {
//!     let noise = f64::from(t * t * t % 101) - 50.0;
//!     y.push(0.8 * y[y.len() - 1] + 0.5 * u + 0.003 * noise);
//! }
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
//! let report = identify(log.clone(), &[], &Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1])?))?;
//! let found = validate(&report, None, &log, &[], &ValidationPlan::default())?.validation;
//! assert!(found.fit[0].percent > Some(75.0));
//! assert_eq!(found.residuals[0].independence[0].input, "u");
//! # Ok::<(), thetahat::Error>(())
//! ```

pub(crate) mod feedback;
mod fit;
mod independence;
mod moments;
mod nonlinear;
mod portmanteau;
mod residuals;
#[cfg(test)]
mod tests;
mod verdict;
mod whiteness;

pub use fit::{Fit, Part};
pub use nonlinear::Nonlinearity;
pub(crate) use nonlinear::nonlinearities;
pub(crate) use portmanteau::portmanteau;
pub use residuals::Residuals;
pub use verdict::{Anderson, AndersonLevel, Independence, Test};
