#![no_std]
//! System identification for controllers: estimators that are called once a sample for years, in single precision,
//! without a heap and without a panic.
//!
//! | parameters of a model | |
//! |---|---|
//! | [`RecursiveArx`], [`RecursiveArmax`] | from what is measured and applied, call by call; predict some samples ahead |
//! | [`RecursiveOutputError`] | the same where the sensor is noisy: by prediction errors of the output, or instrumental variables |
//! | [`RecursiveNarx`] | the same for a weighted sum of functions of lags, a [`Polynomial`], [`Radial`], [`Spline`] or [`Local`] [`Basis`] |
//! | [`RecursiveVectorArx`] | an ARX model with several outputs, each of which depends on the past of all |
//! | [`RecursiveLeastSquares`] | from any regressors; [`Forgetting`] policies that stay bounded, three ways to [`RlsStart`] |
//! | [`WindowedLeastSquares`] | from the last samples only, a [`Window`] of them |
//! | [`LeastSquares`] | all rows at once: merges with others, says which columns are at fault |
//! | [`NonlinearArx`] | a stored nonlinear model: predicts, and gives its slopes for an extended Kalman filter |
//! | [`Lags`], [`ArxOrders`] | delay lines that make regressors of samples, and know of missing ones |
//!
//! | state of a model | |
//! |---|---|
//! | [`KalmanFilter`] | for [`LinearTransition`] and [`LinearObservation`]; any number of sensors |
//! | [`ExtendedKalmanFilter`] | for any [`Transition`] and [`Observation`], iterated or not; [`Augmented`] makes unknown parameters states |
//! | [`UnscentedKalmanFilter`] | the same without Jacobians, from values of the functions at points |
//! | [`ZonotopeFilter`] | noise that is known by its bound alone: a set in which the state is for certain |
//! | [`OutOfSequenceFilter`] | either of the two, where measurements come late; a [`FilterHistory`] of them |
//! | [`LuenbergerObserver`] | a fixed gain, placed poles, or the gain of a [`SteadyState`] |
//! | [`GainSchedule`] | gains and covariances ahead of the data |
//! | `Smoother` | the states given the whole record (feature `alloc`) |
//! | `Differentiated` | exact Jacobians of one generic function (feature `autodiff`) |
//!
//! | what to do | |
//! |---|---|
//! | [`RstController`] | a linear controller with limits and without windup; its poles placed with a model and [`WantedPoles`] |
//!
//! | what a sample tells | |
//! |---|---|
//! | [`Innovation`] | what was not predicted, how likely it was (NIS), and the [`Action`] that was taken |
//! | [`ChangeDetector`] | charts that watch innovations, of estimators and filters; an [`Alarm`] says what changed, and since when |
//!
//! A [`Covariance`] is kept factored, so that it never becomes indefinite.
//!
//! All work with `f32` and `f64` ([`Real`]) and with sizes in the type, `Const<4>`, or at run time, `Dyn`
//! ([`Dimension`]). Vectors and matrices are those of [nalgebra](mod@nalgebra), which this crate re-exports.
//!
//! # An example
//!
//! A first-order plant y(k) = 0.8 y(k-1) + 0.5 u(k-1), identified as y(k) + a y(k-1) = b u(k-1):
//!
//! ```
//! use thetahat_core::nalgebra::{Const, Vector2};
//! use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, RecursiveArx};
//!
//! let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
//! let mut plant: RecursiveArx<f32, Const<2>> = RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::default())?;
//! let (mut y, mut u) = (0.0, 0.0);
//! for k in 0..200 {
//!     y = 0.8 * y + 0.5 * u; // the plant
//!     plant.measured(y)?; // what it answered to all that was applied before
//!     u = if k % 7 < 3 { 1.0 } else { -1.0 };
//!     plant.applied(&[u])?; // what acts from now on
//! }
//! assert!((plant.estimator().parameters() - Vector2::new(-0.8, 0.5)).amax() < 1e-4);
//! # Ok::<(), Error>(())
//! ```
//!
//! # What it does not do
//!
//! - It does not read files, choose orders, or validate models: the crate `thetahat` does.
//! - It does not panic. A release build links no panic for the static sizes; with `Dyn` only the allocator can fail.
//! - It does not allocate with static sizes. With `Dyn`, least squares allocates when it is created, cloned or
//!   evaluated, and never for a row or a sample; filters allocate in a step too, for what has the size of the
//!   measurement.
//! - It has no types but real scalars, no sparse matrices, and no multithreading.
//! - It logs nothing. (What it answers can be logged: see the features.)
//!
//! # Features
//!
//! - `alloc`: sizes known only at run time, nalgebra's `Dyn`, for callers with a heap, such as a batch
//!   program that reads the orders from its user. Off by default, so that firmware needs no allocator.
//! - `serde`: snapshots that can be written and read back, and [`Error`], [`Action`] and [`Innovation`] for telemetry
//!   (an error is written only: its words are constants of the program). Off by default, as a clone is a snapshot too.
//! - `defmt`: `defmt::Format` of [`Error`], [`Action`], [`Innovation`] and [`Alarm`], whose words stay on the host. On
//!   microcontrollers only (`target_os = "none"`), where the program brings the logger; nalgebra's own feature `defmt`
//!   has that of vectors, so of states. Off by default, as a program that logs in another way needs none of it.
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
//! NaN is a missing sample: in a delay line, a regressor, an output, an element of a measurement. Time goes on, nothing
//! is corrected by it, and the [`Action`] says so. Anywhere else NaN is an error, and infinity is an error everywhere.
//! Whatever returns an [`Error`] has changed nothing.
//!
//! # Snapshots
//!
//! Every estimator is plain data: a clone is a snapshot. With the feature `serde` it can be written and read back,
//! and goes on to the bit as if nothing had happened. What is read is checked as the constructors check it, and carries
//! a version: a snapshot that was damaged, edited or written by another release is an error.

#[cfg(feature = "alloc")]
extern crate alloc;

mod armax;
mod around;
mod arx;
mod augmented;
mod basis;
mod control;
mod covariance;
mod detect;
#[cfg(feature = "autodiff")]
mod differentiated;
mod dim;
#[cfg(feature = "autodiff")]
mod dual;
mod ekf;
mod error;
mod forgetting;
mod gradient;
mod innovation;
mod kalman;
mod lags;
mod least_squares;
mod luenberger;
#[cfg(test)]
mod noise;
mod nonlinear_arx;
mod out_of_sequence;
mod outliers;
mod output_error;
mod recursive_narx;
mod rls;
mod scalar;
mod schedule;
#[cfg(feature = "alloc")]
mod smoother;
#[cfg(feature = "serde")]
mod snapshot;
mod solution;
mod stability;
mod state_space;
#[cfg(test)]
mod textbook;
mod triangle;
mod ud;
mod unscented;
mod vector_arx;
mod windowed;
mod zonotope;

pub use nalgebra;

pub use armax::{ArmaxMethod, ArmaxOrders, RecursiveArmax};
pub use arx::RecursiveArx;
pub use augmented::{Augmented, ParametricObservation, ParametricTransition, WithoutParameters};
pub use basis::{
    Activation, Basis, Local, MOST_NEIGHBOURS, MOST_SLOPES, Membership, Neighbours, Network, Polynomial,
    Radial, Spline,
};
pub use control::{
    DirectOrders, DirectSelfTuner, Distrust, Fallback, IndirectSelfTuner, LinearQuadratic, MinimumVariance,
    MinimumVarianceOrders, PidSettings, PlacementOrders, Probing, ResponseWanted, RstController, Sensor,
    Supervision, TunerModel, TunerOrders, TunerSettings, TunerState, WantedPoles,
};
pub use covariance::Covariance;
pub use detect::{Alarm, ChangeDetector, Chart};
#[cfg(feature = "autodiff")]
pub use differentiated::{Differentiated, ObservationFunction, TransitionFunction};
pub use dim::Dimension;
#[cfg(feature = "autodiff")]
pub use dual::{Dual, Number};
pub use ekf::ExtendedKalmanFilter;
pub use error::Error;
pub use forgetting::{Forgetting, ForgettingPolicy, PolicyNumber, PolicyRange, RlsStart};
pub use innovation::{Action, Innovation};
pub use kalman::KalmanFilter;
pub use lags::{ArxOrders, ConstantOrders, InputOrders, Lags};
pub use least_squares::{LeastSquares, Rank};
pub use luenberger::LuenbergerObserver;
pub use nonlinear_arx::{NonlinearArx, Scaling};
pub use out_of_sequence::{FilterHistory, OutOfSequenceFilter};
pub use outliers::Outliers;
pub use output_error::{OutputErrorMethod, RecursiveOutputError};
pub use recursive_narx::RecursiveNarx;
pub use rls::RecursiveLeastSquares;
pub use scalar::Real;
pub use schedule::{GainSchedule, SteadyState};
#[cfg(feature = "alloc")]
pub use smoother::{Smoothed, Smoother};
#[cfg(feature = "serde")]
pub use snapshot::SnapshotVersion;
pub use solution::Solution;
pub use state_space::{LinearObservation, LinearTransition, Observation, Transition};
pub use unscented::UnscentedKalmanFilter;
pub use vector_arx::RecursiveVectorArx;
pub use windowed::{Window, WindowedLeastSquares};
pub use zonotope::{SetInnovation, ZonotopeFilter};
