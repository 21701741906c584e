//! Frequency responses from data, without a model.
//!
//! - [`spectrum()`] estimates the response of a [`Log`](crate::data::Log) from its inputs to its output, as a
//!   [`SpectrumPlan`] says: by a [`Method`] ([`Estimator`]) at some [`Frequencies`].
//! - [`MeasuredResponse`] is the document: points with covariance, noise and coherence ([`NoisePoint`]), and whether
//!   the bands are honest ([`BandQuality`]). It can be compared with a model ([`Agreement`]). Its points may have been
//!   measured elsewhere, too ([`GivenPoint`]).
//!
//! ```
//! use thetahat::data::{Channel, Log};
//! use thetahat::spectrum::{Method, SpectrumPlan, spectrum};
//!
//! // Ten periods of 50 rows of a sine; the output is twice the input, one row late.
//! let u: Vec<f64> = (0..500).map(|t| (std::f64::consts::TAU * f64::from(t) / 50.0).sin()).collect();
//! let y = [vec![0.0], u[..499].iter().map(|u| 2.0 * u).collect()].concat();
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
//! let method = Method::Sines { period: None, discard: None };
//! let found = spectrum(&log, &[], &SpectrumPlan { method, ..SpectrumPlan::new(&["u"], "y") })?;
//! let point = found.responses[0].points[0];
//! assert!((point.magnitude.value - 2.0).abs() < 1e-9);
//! assert!((point.phase.value + std::f64::consts::TAU / 50.0).abs() < 1e-9);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod agreement;
mod estimate;
mod etfe;
mod given;
mod honesty;
mod lpm;
mod options;
mod periods;
mod plan;
mod response;
mod run;
mod signals;
mod sines;
mod spa;
#[cfg(test)]
mod tests;
mod welch;

pub use agreement::Agreement;
pub use given::GivenPoint;
pub use options::{FrequencyRange, SpectrumMethod, SpectrumOptions};
pub use plan::{Estimator, Frequencies, Method, SpectrumPlan};
pub use response::{BandQuality, MeasuredResponse, NoisePoint};
pub use run::spectrum;
