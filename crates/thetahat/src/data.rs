//! Logs: channels on a common clock, cut into segments; and what is done to them before a fit.

mod digest;
mod log;
mod offset;
mod prefilter;
mod prepare;
mod recording;
mod regular;
mod resample;
mod source;
mod split;
#[cfg(test)]
mod tests;

pub(crate) use digest::{digest, digests, inside};
pub use log::{Channel, Interpolation, Log, Record};
pub(crate) use log::{GAP, JITTER, check, measured};
pub use offset::Offset;
pub use prefilter::Prefilter;
pub(crate) use prefilter::Prefiltered;
pub use prepare::Detrend;
pub use recording::{Recording, Times};
pub(crate) use regular::{Regular, shortest};
pub use resample::{AntiAlias, Resample};
pub use source::{Resampling, Source};
pub use split::{Rows, Split};
pub(crate) use split::{between, checked};
