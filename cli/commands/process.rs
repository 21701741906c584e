//! `thetahat fit --structure`: a process in continuous time.

use thetahat::report::fit_process;

use super::experiments::{Wanted, read};
use super::search::{Identified, watched};
use crate::failure::Failure;
use crate::job::ProcessJob;
use crate::log;
use crate::messages::warn;

/// Reads the logs and fits the model.
pub(super) fn found(job: &ProcessJob) -> Result<Identified, Failure> {
    let wanted = Wanted {
        inputs: job.inputs.as_deref(),
        outputs: &job.outputs,
        driven: true,
        none: "another --model",
    };
    let found = read(&job.paths, &job.log, &wanted, true, |_| Ok(()))?;
    found.words.iter().for_each(|word| warn(word));
    let (inputs, output) = found.channels.single();
    let plan = job.plan(inputs, output)?;
    let report = watched(|monitor| fit_process(&found.log, &found.sources, &plan, monitor))?;
    let report = report.map_err(log::failure(&found.sources))?;
    Ok(Identified { report, log: Some(found.log), sources: found.sources })
}
