use std::path::{Path, PathBuf};

use thetahat::report::{Requirement, ValidationPlan};

use super::{LogJob, parsed};
use crate::args::EvaluationArguments;
use crate::failure::Failure;

/// How to evaluate one model or several on a log.
#[derive(Debug)]
pub(crate) struct EvaluationJob {
    pub(crate) log: LogJob,
    pub(crate) plan: ValidationPlan,
    pub(crate) requirements: Vec<Requirement>,
}

impl EvaluationJob {
    /// `read` are the reports and the log.
    pub(crate) fn resolve(
        arguments: &EvaluationArguments,
        required: &[String],
        read: &[PathBuf],
    ) -> Result<Self, Failure> {
        if read.iter().filter(|path| path.as_path() == Path::new("-")).count() > 1 {
            return Err(Failure::usage(
                "only one of the reports and the log can come from standard input (-)",
            ));
        }
        let requirements = required.iter().map(|text| parsed("--require", text));
        let requirements: Vec<Requirement> = requirements.collect::<Result<_, _>>()?;
        let further: Vec<usize> = requirements.iter().filter_map(Requirement::steps).collect();
        let plan = ValidationPlan::of(&arguments.options.options()?, &further);
        let plan = plan.map_err(|error| Failure::option(&error))?;
        Ok(Self { log: LogJob::resolve(&arguments.log, &arguments.clock)?, plan, requirements })
    }
}
