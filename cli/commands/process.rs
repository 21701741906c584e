//! `thetahat fit --structure`: a process in continuous time.

use thetahat::Error;
use thetahat::report::{fit_process, fit_process_to_response};

use super::experiments::{Wanted, read};
use super::search::{Identified, Telling};
use super::stored;
use crate::failure::Failure;
use crate::job::ProcessJob;
use crate::log;

/// Reads the logs, or the response, and fits the model.
pub(super) fn found(job: &ProcessJob, telling: &Telling) -> Result<Identified, Failure> {
    if let Some(path) = &job.from {
        let response = stored::response(path)?;
        let plan = job.plan_of_response();
        let report = telling.watched(|monitor| fit_process_to_response(&response, &plan, monitor))?;
        let report = report.map_err(|error| match error {
            Error::Argument { .. } => Failure::option(&error),
            _ => log::failure(&response.logs)(error),
        })?;
        return Ok(Identified { report, log: None, sources: Vec::new() });
    }
    let wanted = Wanted {
        inputs: job.inputs.as_deref(),
        outputs: &job.outputs,
        driven: true,
        none: "another --model",
    };
    let found = read(&job.paths, &job.log, &wanted, true, |_| Ok(()))?;
    found.words.iter().for_each(|word| telling.warn(word));
    let (inputs, output) = found.channels.single();
    let plan = job.plan(inputs, output)?;
    let report = telling.watched(|monitor| fit_process(&found.log, &found.sources, &plan, monitor))?;
    let report = report.map_err(log::failure(&found.sources))?;
    Ok(Identified { report, log: Some(found.log), sources: found.sources })
}
