use std::path::PathBuf;

use thetahat::step_test::StepTestPlan;

use super::{LogJob, rows};
use crate::args::StepArguments;
use crate::failure::Failure;

/// A step test to evaluate.
#[derive(Debug)]
pub(crate) struct StepTestJob {
    pub(crate) path: PathBuf,
    pub(crate) log: LogJob,
    /// The named input; none: u.
    pub(crate) input: Option<String>,
    /// The named output; none: y.
    pub(crate) output: Option<String>,
    /// All but the channels.
    plan: StepTestPlan,
}

impl StepTestJob {
    pub(crate) fn resolve(arguments: &StepArguments) -> Result<Self, Failure> {
        let of_models = [("samples", arguments.samples.is_some()), ("impulse", arguments.impulse)];
        if let Some((option, _)) = of_models.iter().find(|(_, given)| *given) {
            return Err(Failure::usage(format!(
                "--{option} is for the report of a model, and {} is a log: leave it out",
                arguments.path.display()
            )));
        }
        Ok(Self {
            path: arguments.path.clone(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            input: arguments.input.clone(),
            output: arguments.output.clone(),
            plan: StepTestPlan { rows: rows("--rows", &arguments.rows)?, ..StepTestPlan::new("", "") },
        })
    }

    /// The plan for a log with these channels.
    pub(crate) fn plan(&self, input: String, output: String) -> StepTestPlan {
        StepTestPlan { input, output, ..self.plan.clone() }
    }
}

impl StepArguments {
    /// Refuses what is for a log where the file is a document, `what` kind of one; of a frequency response the options
    /// that say which input and what to write have a meaning.
    pub(crate) fn check_document(&self, what: &str, is_response: bool) -> Result<(), Failure> {
        let (log, clock) = (&self.log, &self.clock);
        let of_logs = [
            ("rows", !self.rows.is_empty()),
            ("output", self.output.is_some()),
            ("time", clock.time.is_some()),
            ("time-format", clock.time_format.is_some()),
            ("time-unit", clock.time_unit.is_some()),
            ("time-zone", clock.time_zone.is_some()),
            ("sample-time", clock.sample_time.is_some()),
            ("resample", clock.resample.is_some()),
            ("delimiter", log.delimiter.is_some()),
            ("decimal-comma", log.decimal_comma.is_some()),
            ("header-row", log.header_row.is_some()),
            ("no-header", log.no_header),
            ("skip-rows", log.skip_rows > 0),
            ("comment", log.comment.is_some()),
            ("missing", !log.missing.is_empty()),
            ("value", !log.value.is_empty()),
            ("encoding", log.encoding.is_some()),
            ("sheet", log.sheet.is_some()),
        ];
        let of_tests = [
            ("input", self.input.is_some()),
            ("format", self.format.is_some()),
            ("report", self.report.is_some()),
        ];
        let of_models = [("samples", self.samples.is_some()), ("impulse", self.impulse)];
        let foreign = if is_response { &of_models[..] } else { &of_tests[..] };
        let Some((option, _)) = of_logs.iter().chain(foreign).find(|(_, given)| *given) else {
            return Ok(());
        };
        let owner =
            if of_models.iter().any(|(name, _)| name == option) { "the report of a model" } else { "a log" };
        Err(Failure::usage(format!(
            "--{option} is for {owner}, and {} is {what}: leave it out",
            self.path.display()
        )))
    }
}
