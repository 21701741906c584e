//! What processes make of a log: exact responses to inputs that are held from row to row.

mod held;
mod on_log;
mod sampled;

pub(crate) use held::{HeldLog, at_rest, free_sensitivities, held_logs, modes, run, sensitivities};
pub(crate) use on_log::ProcessOnLog;
pub(crate) use sampled::{Points, response_slopes, responses};
