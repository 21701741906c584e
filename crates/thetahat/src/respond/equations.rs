//! What models in equations say of a log: the extended Kalman filter along it, predictions from its estimates, and free
//! runs.

mod experiment;
mod free_run;
mod frequency;
mod on_log;
mod predictor;
mod settled;
mod walk;

pub(crate) use experiment::{Experiment, experiments};
pub(crate) use frequency::response;
pub(crate) use on_log::EquationsOnLog;
pub(crate) use predictor::{Innovation, Predictor};
pub(crate) use walk::{Failure, step, walk};
