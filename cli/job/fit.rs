use std::path::{Path, PathBuf};

use thetahat::fit::FitDraft;
use thetahat::options::Options;
use thetahat::plan::{FitOptions, Fitted};

use super::LogJob;
use crate::args::FitArguments;
use crate::failure::Failure;
use crate::memory::PerValue;

/// A model to fit.
#[derive(Debug)]
pub(crate) struct FitJob {
    /// The logs, at least one unless a response is there instead.
    pub(crate) paths: Vec<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    /// A model in equations.
    pub(crate) equations: Option<PathBuf>,
    /// The document of a frequency response.
    pub(crate) response: Option<PathBuf>,
    /// Whether the logs are read part by part.
    pub(crate) in_pieces: bool,
    /// Whether the log is wanted afterwards.
    pub(crate) keeps_log: bool,
    pub(crate) options: FitOptions,
    fitted: Fitted,
}

impl FitJob {
    /// A log that is there already may have several outputs without their names. `plan` reads the options of a file.
    pub(crate) fn resolve(
        arguments: &FitArguments,
        plan: impl FnOnce(&Path) -> Result<FitOptions, Failure>,
    ) -> Result<Self, Failure> {
        let options = arguments.options.options()?;
        let options = match &arguments.plan {
            Some(path) => options.or(plan(path)?),
            None => options,
        };
        let fitted = match (&arguments.grey, &arguments.from) {
            (Some(_), _) => Fitted::Equations,
            (None, Some(_)) => Fitted::Response,
            (None, None) => Fitted::Log { several_outputs: false },
        };
        let files = arguments.logs.iter().chain(&arguments.grey).chain(&arguments.plan);
        if files.filter(|path| *path == Path::new("-")).count() > 1 {
            let what = if arguments.grey.is_some() { "the model and the logs" } else { "the logs" };
            return Err(Failure::usage(format!("only one of {what} can come from standard input (-)")));
        }
        let mut job = Self {
            paths: arguments.logs.clone(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            equations: arguments.grey.clone(),
            response: arguments.from.clone(),
            in_pieces: arguments.stream,
            keeps_log: arguments.html.is_some(),
            options,
            fitted,
        };
        if !job.draft()?.is_one_step() || job.keeps_log {
            job.log.per_value = PerValue::Search;
        }
        Ok(job)
    }

    /// The fit before the log says what its channels are.
    pub(crate) fn draft(&self) -> Result<FitDraft, Failure> {
        FitDraft::new(&self.options, self.fitted).map_err(|error| Failure::option(&error))
    }
}
