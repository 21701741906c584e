//! How good a model is on a record.

mod fit;

pub use fit::{Fit, Horizon, Part};
