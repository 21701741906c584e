use std::path::{Path, PathBuf};

use thetahat::data::Detrend;
use thetahat::report::{Requirement, ValidationPlan};

use super::{LogJob, parsed, rows};
use crate::args::EvaluationArguments;
use crate::failure::Failure;

/// How to evaluate one model or several on a log.
#[derive(Debug)]
pub(crate) struct EvaluationJob {
    pub(crate) log: LogJob,
    pub(crate) plan: ValidationPlan,
}

impl EvaluationJob {
    /// `read` are the reports and the log.
    pub(crate) fn resolve(arguments: &EvaluationArguments, read: &[PathBuf]) -> Result<Self, Failure> {
        if read.iter().filter(|path| path.as_path() == Path::new("-")).count() > 1 {
            return Err(Failure::usage(
                "only one of the reports and the log can come from standard input (-)",
            ));
        }
        let detrend: Option<Detrend> = match arguments.detrend.as_str() {
            "model" => None,
            text => Some(parsed("--detrend", text)?),
        };
        let plan = ValidationPlan {
            rows: rows("--rows", &arguments.rows)?,
            detrend,
            horizons: arguments.horizon.iter().map(|text| steps(text)).collect::<Result<_, _>>()?,
            lags: arguments.lags,
            alpha: arguments.alpha,
            alphas: arguments.alphas.clone(),
        };
        plan.check().map_err(|error| Failure::option(&error))?;
        Ok(Self { log: LogJob::resolve(&arguments.log, &arguments.clock)?, plan })
    }

    /// What is required, and evaluated for it.
    pub(crate) fn requirements(&mut self, texts: &[String]) -> Result<Vec<Requirement>, Failure> {
        let requirements: Vec<Requirement> =
            texts.iter().map(|text| parsed("--require", text)).collect::<Result<_, _>>()?;
        self.plan.horizons.extend(requirements.iter().filter_map(Requirement::steps));
        self.plan.check().map_err(|error| Failure::option(&error))?;
        Ok(requirements)
    }
}

fn steps(text: &str) -> Result<usize, Failure> {
    text.trim()
        .parse()
        .ok()
        .filter(|steps| *steps > 0)
        .ok_or_else(|| Failure::usage(format!("--horizon {text}: give a number of steps from 1 on")))
}
