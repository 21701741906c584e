//! `thetahat compare`: several stored models side by side on a log.

use thetahat::Document;
use thetahat::present::{comparison_page, tables};
use thetahat::report::{Report, Validated, compare as compared};

use super::search::Telling;
use super::stored;
use super::validate::{loaded, one, print};
use crate::args::CompareArguments;
use crate::failure::Failure;
use crate::job::EvaluationJob;
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn compare(arguments: &CompareArguments, line: &str) -> Result<(), Failure> {
    let evaluation = &arguments.evaluation;
    let read: Vec<_> =
        arguments.reports.iter().chain([&arguments.path]).chain(&arguments.over).cloned().collect();
    let job = EvaluationJob::resolve(evaluation, &[], &read)?;
    let reports: Vec<Report> =
        arguments.reports.iter().map(|path| stored::report(path)).collect::<Result<_, _>>()?;
    let loaded = loaded(&arguments.path, &job, &reports.iter().collect::<Vec<_>>(), &Telling::Aloud)?;
    let each = arguments.reports.iter().zip(&reports);
    let each =
        each.map(|(path, report)| one(path, report, &loaded, &job.plan).map_err(|failure| failure.of(path)));
    let mut found: Vec<Validated> = each.collect::<Result<_, _>>()?;
    if let Some(path) = &arguments.over {
        let response = stored::response(path)?;
        let each = found.into_iter().zip(&reports).zip(&arguments.reports);
        found = each
            .map(|((found, report), path)| {
                let failed = |error| Failure::data(format!("{}: {error}", path.display()));
                found.over(&report.model, &response).map_err(failed)
            })
            .collect::<Result<_, _>>()?;
    }
    let comparison = compared(&found).map_err(|error| Failure::option(&error))?;
    let json = comparison.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &evaluation.html {
        let page = comparison_page(&reports, &found, line);
        output::page(path, &page.map_err(|error| Failure::data(error.to_string()))?)?;
    }
    for (path, model) in arguments.reports.iter().zip(&comparison.models) {
        model.warnings.iter().for_each(|warning| warn(&format!("{}: {warning}", path.display())));
    }
    print(evaluation, &json, || tables::comparison(&comparison, stdout_layout()))
}
