//! `thetahat validate`: how a stored model does on a log, and whether it is good enough.

use std::path::Path;

use thetahat::Document;
use thetahat::report::{Report, Validated, ValidationPlan, validate as validated, validation_page};

use super::{stored, summary};
use crate::args::{EvaluationArguments, FormatArgument, ValidateArguments};
use crate::failure::Failure;
use crate::job::EvaluationJob;
use crate::log::{self, Clocks, Loaded};
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_width;

pub(crate) fn validate(arguments: &ValidateArguments, line: &str) -> Result<(), Failure> {
    let evaluation = &arguments.evaluation;
    let mut job = EvaluationJob::resolve(evaluation, &[&arguments.report, &arguments.path])?;
    let requirements = job.requirements(&arguments.require)?;
    let report = stored::report(&arguments.report)?;
    let refused = |error| Failure::option(&error);
    requirements.iter().try_for_each(|requirement| requirement.check(&report)).map_err(refused)?;

    let loaded = loaded(&arguments.path, &job, &[&report])?;
    let found = one(&arguments.report, &report, &loaded, &job.plan)?;
    let validation = &found.validation;
    let json = validation.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &evaluation.html {
        output::page(path, &validation_page(&report, &found, line))?;
    }
    for warning in &validation.warnings {
        warn(warning);
    }
    print(evaluation, &json, || {
        summary::validation(validation, &requirements, job.plan.alpha, stdout_width())
    })?;

    let unmet = requirements.iter().filter_map(|requirement| requirement.unmet(validation, job.plan.alpha));
    let unmet: Vec<String> = unmet.collect();
    if unmet.is_empty() {
        return Ok(());
    }
    Err(Failure::unmet(format!("{}: not met: {}", arguments.report.display(), unmet.join("; "))))
}

/// Reads the channels of some models from a log.
pub(super) fn loaded(path: &Path, job: &EvaluationJob, reports: &[&Report]) -> Result<Loaded, Failure> {
    let mut names: Vec<String> = Vec::new();
    for name in reports.iter().flat_map(|report| report.model.channels()) {
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    let all = || reports.iter().map(|report| Clocks::from(&report.model));
    // A clock that one of them cannot follow is that model's to refuse.
    let clocks = Clocks {
        sample_time: all().find_map(|clocks| clocks.sample_time),
        any: all().any(|clocks| clocks.any),
    };
    let loaded = log::load(path, &job.log, clocks, |_| Ok(names))?;
    loaded.words.iter().for_each(|word| warn(word));
    Ok(loaded)
}

/// Validates one model.
pub(super) fn one(
    path: &Path,
    report: &Report,
    loaded: &Loaded,
    plan: &ValidationPlan,
) -> Result<Validated, Failure> {
    let name = path.display().to_string();
    let sources = [loaded.source.clone()];
    validated(report, Some(&name), &loaded.log, &sources, plan).map_err(log::failure(&sources))
}

/// Writes the document, and prints it or the table.
pub(super) fn print(
    evaluation: &EvaluationArguments,
    json: &str,
    table: impl FnOnce() -> String,
) -> Result<(), Failure> {
    if let Some(path) = &evaluation.out {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    match evaluation.format {
        // Standard output holds one document.
        _ if [&evaluation.out, &evaluation.html].into_iter().flatten().any(|path| path == Path::new("-")) => {
            Ok(())
        }
        FormatArgument::Json => output::print(json),
        FormatArgument::Table => output::print(&table()),
    }
}
