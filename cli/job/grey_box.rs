use std::path::{Path, PathBuf};

use thetahat::report::EquationsPlan;

use super::{LogJob, parsed, rows, search};
use crate::args::FitArguments;
use crate::failure::Failure;
use crate::memory::PerValue;

/// A model in equations to fit.
#[derive(Debug)]
pub(crate) struct GreyBoxJob {
    pub(crate) model: PathBuf,
    /// The logs, at least one.
    pub(crate) paths: Vec<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    pub(crate) plan: EquationsPlan,
}

impl GreyBoxJob {
    pub(crate) fn resolve(arguments: &FitArguments, model: &Path) -> Result<Self, Failure> {
        let job = Self {
            model: model.to_owned(),
            paths: arguments.logs.clone(),
            log: LogJob { per_value: PerValue::Search, ..LogJob::resolve(&arguments.log, &arguments.clock)? },
            plan: EquationsPlan {
                estimate: rows("--estimate", &arguments.estimate)?,
                validate: rows("--validate", &arguments.validate)?,
                split: arguments.choice.split.as_deref().map(|text| parsed("--split", text)).transpose()?,
                search: search::search(&arguments.search)?,
            },
        };
        if job.paths.iter().chain([&job.model]).filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Failure::usage(
                "only one of the model and the logs can come from standard input (-)",
            ));
        }
        Ok(job)
    }
}
