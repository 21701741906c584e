//! Whether a log suits a model.

use crate::Error;
use crate::data::Log;
use crate::model::Model;

/// Sample times that differ by less than this part of one are the same.
pub(crate) const SAME_TIME: f64 = 0.01;

/// The log must have the model's sample time, unless the model takes any.
pub(crate) fn check_sample_time(model: &Model, log: &Log) -> Result<(), Error> {
    let differs = (log.sample_time() / model.sample_time() - 1.0).abs() > SAME_TIME;
    // One in continuous time is sampled as the log is.
    if !model.is_continuous() && !model.takes_any_clock() && differs {
        return Err(Error::data(format!(
            "the log's sample time is {} s, the model's {} s; resample the log, convert the model, or fit one to it",
            log.sample_time(),
            model.sample_time()
        )));
    }
    Ok(())
}

/// Models in equations describe signals as they are.
pub(super) fn check_offsets(model: &Model) -> Result<(), Error> {
    if model.has_offsets() {
        return Ok(());
    }
    Err(Error::argument(
        "detrend",
        "a model in equations describes signals as they are, and takes nothing from them; leave it out",
    ))
}
