//! Logs: channels on a common clock, cut into segments; and what is done to them before a fit.

mod log;
mod prefilter;
mod prepare;
mod regular;
mod resample;
mod split;
#[cfg(test)]
mod tests;

pub use log::{Channel, Interpolation, Log, Record};
pub(crate) use log::{GAP, JITTER, check, measured, shortest};
pub use prefilter::Prefilter;
pub(crate) use prefilter::Prefiltered;
pub use prepare::{Detrend, Offset};
pub(crate) use regular::Regular;
pub use resample::{AntiAlias, Resample};
pub use split::{Rows, Split};
pub(crate) use split::{between, checked};
