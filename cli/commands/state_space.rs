//! `thetahat fit --model ss`: a model in state space.

use thetahat::report::fit_state_space_monitored;

use super::experiments::{Wanted, read};
use super::search::{Identified, Telling};
use crate::failure::Failure;
use crate::job::StateSpaceJob;
use crate::log;

/// The columns that the model wants.
pub(super) fn wanted(job: &StateSpaceJob) -> Wanted<'_> {
    Wanted { inputs: job.inputs.as_deref(), outputs: &job.outputs, driven: job.driven, none: "--nb 0" }
}

/// Reads the logs and fits the model.
pub(super) fn found(job: &StateSpaceJob, telling: &Telling) -> Result<Identified, Failure> {
    let found = read(&job.paths, &job.log, &wanted(job), false, |_| Ok(()))?;
    found.words.iter().for_each(|word| telling.warn(word));
    let plan = job.plan(found.channels.inputs, found.channels.outputs)?;
    let report =
        telling.watched(|monitor| fit_state_space_monitored(&found.log, &found.sources, &plan, monitor))?;
    let report = report.map_err(log::failure(&found.sources))?;
    Ok(Identified { report, log: Some(found.log), sources: found.sources })
}
