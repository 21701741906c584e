//! `thetahat fit --narx`: a nonlinear ARX model.

use thetahat::report::fit_nonlinear_arx_monitored;

use super::experiments::{Wanted, read};
use super::search::{Identified, Telling};
use crate::failure::Failure;
use crate::job::NarxJob;
use crate::log;

/// The columns that the model wants.
pub(super) fn wanted(job: &NarxJob) -> Wanted<'_> {
    Wanted { inputs: job.inputs.as_deref(), outputs: &job.outputs, driven: job.driven, none: "--nu 0" }
}

/// Reads the logs and fits the model.
pub(super) fn found(job: &NarxJob, telling: &Telling) -> Result<Identified, Failure> {
    let found = read(&job.paths, &job.log, &wanted(job), false, |_| Ok(()))?;
    found.words.iter().for_each(|word| telling.warn(word));
    let plan = job.plan(found.channels.inputs, found.channels.outputs)?;
    let report =
        telling.watched(|monitor| fit_nonlinear_arx_monitored(&found.log, &found.sources, &plan, monitor))?;
    Ok(Identified {
        report: report.map_err(log::failure(&found.sources))?,
        log: Some(found.log),
        sources: found.sources,
    })
}
