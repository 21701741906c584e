//! What estimates of dynamic systems are computed with, whatever the model: the ground floor of [`thetahat`], compiled
//! once beside it. Use it through that crate; what it gives on is stable there, all else here may change with any
//! version.
//!
//! | module | what it is for |
//! |---|---|
//! | [`regression`] | linear regressions on lagged signals, in the precision that they need |
//! | [`optimize`] | the search for the parameters of the least cost |
//! | [`fourier`] | Fourier transforms of two real signals at once |
//! | [`distribution`] | probabilities and quantiles for tests and intervals |
//! | [`random`] | random numbers, the same on every machine |
//! | [`noise`] | random signals for tests |
//! | [`figures`] | numbers for people |
//! | [`text`] | texts from outside, harmless in a terminal |
//!
//! [`thetahat`]: https://docs.rs/thetahat

pub mod distribution;
mod error;
pub mod figures;
pub mod fourier;
pub mod noise;
pub mod optimize;
pub mod random;
pub mod regression;
pub mod text;

pub use error::Error;
