use std::path::{Path, PathBuf};

use thetahat::spectrum::{SpectrumOptions, SpectrumPlan};

use super::LogJob;
use crate::args::SpectrumArguments;
use crate::failure::Failure;

/// A response to estimate from logs.
#[derive(Debug)]
pub(crate) struct SpectrumJob {
    pub(crate) paths: Vec<PathBuf>,
    pub(crate) log: LogJob,
    pub(crate) options: SpectrumOptions,
}

impl SpectrumJob {
    pub(crate) fn resolve(arguments: &SpectrumArguments) -> Result<Self, Failure> {
        if arguments.paths.iter().filter(|path| path.as_path() == Path::new("-")).count() > 1 {
            return Err(Failure::usage("only one of the logs can come from standard input (-)"));
        }
        let job = Self {
            paths: arguments.paths.clone(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            options: arguments.options.options()?,
        };
        // What needs no log is said before it is read.
        let inputs = job.options.inputs().unwrap_or_else(|| vec![String::new()]);
        job.plan(inputs, job.options.output().unwrap_or_else(|| "y".to_owned()))?;
        Ok(job)
    }

    /// The plan for a log with these channels.
    pub(crate) fn plan(&self, inputs: Vec<String>, output: String) -> Result<SpectrumPlan, Failure> {
        SpectrumPlan::of(&self.options, inputs, output).map_err(|error| Failure::option(&error))
    }
}
