//! Checks of a log before a fit.
//!
//! - [`inspect()`] inspects a [`Recording`](crate::data::Recording), [`inspect_log`] at a [`Log`](crate::data::Log); an
//!   [`InspectionPlan`] names the channels. [`PiecewiseInspection`] takes a log of any length part by part.
//! - [`Inspection`] is the document: the [`Clock`], the quality of each channel ([`ChannelQuality`], [`Saturation`]),
//!   how rich the inputs are ([`Excitation`], [`SpectrumPoint`]), their delays ([`DelayEstimate`]), and whether they
//!   follow the output ([`Feedback`]). What a careful reader should know of all that is a list of
//!   [`Finding`](crate::data::Finding)s.
//! - A [`TopicList`] says what there is in a log of topics that have clocks of their own.
//!
//! ```
//! use thetahat::data::{Channel, Log, Rows, Source};
//! use thetahat::inspect::{InspectionPlan, inspect_log};
//!
//! let u: Vec<f64> = (0..200).map(|t| f64::from(t * t * t % 1009)).collect();
//! let y = [vec![0.0; 3], u[..197].to_vec()].concat();
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
//! let source = Source { file: "log".into(), rows: Rows::new(1, 200)?, time: None, start: None, resampled: None };
//! let plan = InspectionPlan { inputs: vec!["u".into()], output: Some("y".into()), resample: None };
//! assert_eq!(inspect_log(&log, &source, &plan)?.delays[0].nk, Some(3));
//! # Ok::<(), thetahat::Error>(())
//! ```

mod channel;
mod clock;
mod delay;
mod excitation;
mod findings;
mod inspection;
mod moments;
mod named;
mod outliers;
mod pieces;
mod plan;
mod quantization;
mod rest;
mod row;
mod run;
mod saturation;
mod spectrum;
#[cfg(test)]
mod tests;
mod topics;
mod whitening;

pub(crate) use channel::outliers_of;
pub(crate) use excitation::{excitation, is_few_sinusoids, order_with_mean};
pub use inspection::{
    ChannelQuality, Clock, DelayEstimate, Excitation, Feedback, Inspection, Saturation, SpectrumPoint,
};
pub use pieces::PiecewiseInspection;
pub use plan::InspectionPlan;
pub(crate) use quantization::quantization;
pub use run::{inspect, inspect_log};
pub use topics::{TopicList, TopicSummary};
pub(crate) use whitening::autoregression;
