use std::path::{Path, PathBuf};

use thetahat::Rows;

use super::{LogJob, rows};
use crate::args::FitArguments;
use crate::failure::Failure;

/// A model in equations to fit.
#[derive(Debug)]
pub(crate) struct GreyJob {
    pub(crate) model: PathBuf,
    /// The logs, at least one.
    pub(crate) paths: Vec<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    /// The rows asked for, counted through all logs; none: all.
    pub(crate) estimate: Vec<Rows>,
}

impl GreyJob {
    pub(crate) fn resolve(arguments: &FitArguments, model: &Path) -> Result<Self, Failure> {
        let job = Self {
            model: model.to_owned(),
            paths: arguments.logs.clone(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            estimate: rows("--estimate", &arguments.estimate)?,
        };
        if job.paths.iter().chain([&job.model]).filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Failure::usage(
                "only one of the model and the logs can come from standard input (-)",
            ));
        }
        Ok(job)
    }
}
