#![no_std]
//! System identification for microcontrollers: regressors and least squares without a heap.
//!
//! - [`LeastSquares`]: linear least squares that takes one row at a time, keeps a triangular factor, merges
//!   with others, and answers with parameters, their covariance, and which columns are at fault if there is
//!   no answer.
//! - [`Lags`]: delay lines that turn inputs and outputs, as they are sampled, into the regressor of an ARX
//!   model. They know of missing samples. [`ArxOrders`] says how long they are.
//!
//! Both work with `f32` and `f64` ([`Real`]) and with sizes in the type, `Const<4>`, or at run time, `Dyn`
//! ([`Dimension`]). Vectors and matrices are those of [nalgebra](mod@nalgebra), which this crate re-exports.
//!
//! # An example
//!
//! A first-order plant y(k) = 0.8 y(k-1) + 0.5 u(k-1), identified as y(k) + a y(k-1) = b u(k-1):
//!
//! ```
//! use thetahat_core::nalgebra::{Const, Vector2};
//! use thetahat_core::{ArxOrders, Error, InputOrders, Lags, LeastSquares};
//!
//! let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }] };
//! let mut lags: Lags<f32, Const<2>> = Lags::new(&orders)?;
//! let mut problem = LeastSquares::<f32, Const<2>>::new();
//!
//! let mut y = 0.0;
//! for k in 0..50 {
//!     let u = if k % 7 < 3 { 1.0 } else { -1.0 };
//!     lags.push_inputs(&[u])?;
//!     if let Some(regressor) = lags.regressor() {
//!         problem.add(regressor, y)?;
//!     }
//!     lags.push_output(y)?;
//!     y = 0.8 * y + 0.5 * u;
//! }
//! let solution = problem.solve()?;
//! assert!((solution.parameters() - Vector2::new(-0.8, 0.5)).amax() < 1e-5);
//! # Ok::<(), Error>(())
//! ```
//!
//! # What it does not do
//!
//! - It does not read files, choose orders, or validate models: the crate `thetahat` does.
//! - It does not panic. A release build links no panic for the static sizes; with `Dyn` only the allocator
//!   can fail.
//! - It does not allocate, but for creating, cloning and evaluating what has size `Dyn`. Adding a row or a
//!   sample never does.
//! - It has no types but real scalars, no sparse matrices, and no multithreading.
//! - It logs nothing.
//!
//! # Features
//!
//! - `alloc`: sizes known only at run time, nalgebra's `Dyn`, for callers with a heap, such as a batch
//!   program that reads the orders from its user. Off by default, so that firmware needs no allocator.
//!
//! # Missing and infinite numbers
//!
//! NaN in a delay line is a missing sample. Anywhere else NaN is an error, and infinity is an error
//! everywhere. Whatever returns an [`Error`] has changed nothing.

mod covariance;
mod dim;
mod error;
mod innovation;
mod kalman;
mod lags;
mod least_squares;
#[cfg(test)]
mod noise;
mod scalar;
mod solution;
mod state_space;
mod triangle;
mod ud;

pub use nalgebra;

pub use covariance::Covariance;
pub use dim::Dimension;
pub use error::Error;
pub use innovation::{Action, Innovation};
pub use kalman::KalmanFilter;
pub use lags::{ArxOrders, InputOrders, Lags};
pub use least_squares::{LeastSquares, Rank};
pub use scalar::Real;
pub use solution::Solution;
pub use state_space::{LinearObservation, LinearTransition, Observation, Transition};
