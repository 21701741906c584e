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
//! - `autodiff`: models that are written as one function, with exact Jacobians from dual numbers. Off by default,
//!   as linear models and Jacobians by hand need none.
//!
//! # Notation
//!
//! That of Ljung, System Identification: A(q) y(k) = B(q)/F(q) u(k-nk) + C(q)/D(q) e(k), with A, C, D, F monic in
//! q⁻¹. In state space x(k+1) = F x + G u + Γ w and y = H x + D u + v, with w ~ (0, Q), v ~ (0, R), cov(w, v) = S.
//! Some course notes write other letters:
//!
//! | | here | there |
//! |---|---|---|
//! | numerator of the noise model | C | D |
//! | denominator of the noise model | D | C |
//! | degree of B(q) | nb - 1 | m |
//! | forgetting factor | λ | μ |
//! | input matrix | G | W |
//! | output matrix | H | G |
//! | gain of the filter | K | H(k) |
//!
//! # Missing and infinite numbers
//!
//! NaN in a delay line is a missing sample. Anywhere else NaN is an error, and infinity is an error
//! everywhere. Whatever returns an [`Error`] has changed nothing.

#[cfg(feature = "alloc")]
extern crate alloc;

mod armax;
mod arx;
mod augmented;
mod covariance;
#[cfg(feature = "autodiff")]
mod differentiated;
mod dim;
#[cfg(feature = "autodiff")]
mod dual;
mod ekf;
mod error;
mod forgetting;
mod innovation;
mod kalman;
mod lags;
mod least_squares;
mod luenberger;
#[cfg(test)]
mod noise;
mod rls;
mod scalar;
mod schedule;
#[cfg(feature = "alloc")]
mod smoother;
mod solution;
mod state_space;
#[cfg(test)]
mod textbook;
mod triangle;
mod ud;

pub use nalgebra;

pub use armax::{ArmaxMethod, ArmaxOrders, RecursiveArmax};
pub use arx::RecursiveArx;
pub use augmented::{Augmented, ParametricObservation, ParametricTransition, WithoutParameters};
pub use covariance::Covariance;
#[cfg(feature = "autodiff")]
pub use differentiated::{Differentiated, ObservationFunction, TransitionFunction};
pub use dim::Dimension;
#[cfg(feature = "autodiff")]
pub use dual::{Dual, Number};
pub use ekf::ExtendedKalmanFilter;
pub use error::Error;
pub use forgetting::{Forgetting, Start};
pub use innovation::{Action, Innovation};
pub use kalman::KalmanFilter;
pub use lags::{ArxOrders, InputOrders, Lags};
pub use least_squares::{LeastSquares, Rank};
pub use luenberger::LuenbergerObserver;
pub use rls::RecursiveLeastSquares;
pub use scalar::Real;
pub use schedule::{GainSchedule, SteadyState};
#[cfg(feature = "alloc")]
pub use smoother::{Smoothed, Smoother};
pub use solution::Solution;
pub use state_space::{LinearObservation, LinearTransition, Observation, Transition};
