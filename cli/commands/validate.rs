//! `thetahat validate`: how a stored model does on a log, and whether it is good enough.

use std::cell::RefCell;
use std::path::Path;

use thetahat::Document;
use thetahat::present::{tables, validation_page};
use thetahat::report::{Report, Validated, Validation, ValidationPlan, validate as validated};

use super::each::{Done, each};
use super::search::Telling;
use super::stored;
use crate::args::{EachArguments, EvaluationArguments, FormatArgument, ValidateArguments};
use crate::failure::Failure;
use crate::job::{EvaluationJob, only};
use crate::log::{self, Clocks, Loaded};
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn validate(arguments: &ValidateArguments, line: &str) -> Result<(), Failure> {
    let evaluation = &arguments.evaluation;
    let read = [std::slice::from_ref(&arguments.report), &arguments.logs].concat();
    let mut job = EvaluationJob::resolve(evaluation, &arguments.require, &read)?;
    job.log.quiet = arguments.each.each;
    let log = (!arguments.each.each).then(|| only("validate", &arguments.logs)).transpose()?;
    let report = stored::report(&arguments.report)?;
    let refused = |error| Failure::option(&error);
    job.requirements.iter().try_for_each(|requirement| requirement.check(&report)).map_err(refused)?;
    let Some(log) = log else {
        let common = of_many(arguments, &report)?;
        return each(&arguments.each, &arguments.logs, &common, |log| {
            one_of_many(arguments, &report, &job, log)
        });
    };

    let loaded = loaded(log, &job, &[&report], &Telling::Aloud)?;
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
        tables::validation(validation, &job.requirements, job.plan.alpha, stdout_layout())
    })?;

    unmet(&arguments.report, validation, &job).map_or(Ok(()), Err)
}

/// What is required and not met.
fn unmet(report: &Path, validation: &Validation, job: &EvaluationJob) -> Option<Failure> {
    let unmet =
        job.requirements.iter().filter_map(|requirement| requirement.unmet(validation, job.plan.alpha));
    let unmet: Vec<String> = unmet.collect();
    (!unmet.is_empty())
        .then(|| Failure::unmet(format!("{}: not met: {}", report.display(), unmet.join("; "))))
}

/// What validations on many logs have in common, in words that differ where they do: the options and the model.
fn of_many(arguments: &ValidateArguments, report: &Report) -> Result<String, Failure> {
    let own = ValidateArguments { logs: Vec::new(), each: EachArguments::default(), ..arguments.clone() };
    let report = report.to_json().map_err(|error| Failure::data(error.to_string()))?;
    Ok(format!("validate {own:?} {report}"))
}

/// Validates the model on one log of many.
fn one_of_many(
    arguments: &ValidateArguments,
    report: &Report,
    job: &EvaluationJob,
    log: &Path,
) -> Result<Done, Failure> {
    let telling = Telling::Kept(RefCell::default());
    let loaded = loaded(log, job, &[report], &telling)?;
    let Validated { validation, .. } = one(&arguments.report, report, &loaded, &job.plan)?;
    let unmet = unmet(&arguments.report, &validation, job);
    Ok(Done::new(&validation, validation.row(), telling.kept(), &validation.warnings)?.with(unmet))
}

/// Reads the channels of some models from a log.
pub(super) fn loaded(
    path: &Path,
    job: &EvaluationJob,
    reports: &[&Report],
    telling: &Telling,
) -> Result<Loaded, Failure> {
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
    loaded.warnings.iter().for_each(|warning| telling.warn(warning));
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
