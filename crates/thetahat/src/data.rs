//! Logs: channels on a common clock, cut into segments; and what is done to them before a fit.
//!
//! - [`Log`] holds [`Channel`]s with one value for each row. It is built from values in memory, with a sample time or
//!   with a time for each row. A missing value is NaN. [`Log::join`] puts several experiments one after the other.
//! - [`Record`] borrows the signals of a log that an estimate sees: an output, the inputs, and the segments without a
//!   gap. A [`JointRecord`] has any number of outputs.
//! - [`mended`] makes a clock rise that stood still or went back where it is certain how.
//! - A [`Finding`] is what a careful reader should know of a log, of a [`FindingKind`]; a [`Decision`] is what a fit
//!   did because of one.
//! - [`Rows`] and [`Split`] say which rows serve for what. Rows are counted from 1, and a range includes both ends.
//! - [`Detrend`] finds the [`Offset`] of each channel, [`Prefilter`] is a band of frequencies.
//! - [`Recording`] and its [`Times`] are a log with any clock. [`Resample`] puts it on a uniform one by
//!   [`Interpolation`], after a filter ([`AntiAlias`]); a document has a note of it ([`Resampling`]) in its [`Source`].
//!
//! ```
//! use thetahat::data::{Channel, Log};
//!
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let u = channel("u", vec![1.0, 0.0, 1.0, 1.0, 0.0]);
//! let y = channel("y", vec![0.0, 0.5, f64::NAN, 0.5, 0.75]);
//! let log = Log::new(vec![u, y], 0.1)?;
//! let record = log.record(&["u".into()], "y", &["1..5".parse()?])?;
//! assert_eq!(record.segments, [0..2, 3..5]); // the missing value is a gap
//! # Ok::<(), thetahat::Error>(())
//! ```

mod differenced;
mod digest;
mod finding;
mod joint_record;
mod log;
mod mend;
mod offset;
mod padding;
mod prefilter;
mod prepare;
mod record;
mod recording;
mod regular;
mod resample;
mod source;
mod split;
mod steps;
#[cfg(test)]
mod tests;

pub(crate) use differenced::Differenced;
pub(crate) use digest::{digest, digests, inside, text_digest};
pub use finding::{Decision, Finding, FindingKind};
pub use joint_record::JointRecord;
pub use log::{Channel, Interpolation, Log};
pub(crate) use log::{check, measured};
pub use mend::{Calendar, Mended, mended};
pub use offset::Offset;
pub(crate) use padding::Padding;
pub use prefilter::Prefilter;
pub(crate) use prefilter::Prefiltered;
pub use prepare::Detrend;
pub use record::Record;
pub use recording::{Recording, Times};
pub(crate) use regular::{Regular, shortest};
pub use resample::{AntiAlias, Resample, Resampling};
pub use source::Source;
pub use split::{Rows, Split};
pub(crate) use split::{between, checked};
pub(crate) use steps::{GAP, JITTER, gap_above, gap_of};
