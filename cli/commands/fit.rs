//! `thetahat fit`: from logs to a model and its report.

use std::path::Path;

use thetahat::Document;
use thetahat::data::{Log, Rows, Source};
use thetahat::report::{
    Report, Validated, ValidationPlan, fit_page, held_out_runs, identify_monitored, validate,
};

use super::experiments::{Experiments, experiments};
use super::search::{Identified, watched};
use super::{grey_box, narx, process, state_space, summary};
use crate::args::{FitArguments, FormatArgument};
use crate::failure::Failure;
use crate::job::{FitJob, GreyBoxJob, NarxJob, ProcessJob, StateSpaceJob, check_linear};
use crate::log;
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_width;

pub(crate) fn fit(arguments: &FitArguments, line: &str) -> Result<(), Failure> {
    check_linear(&arguments.narx)?;
    let outputs = [&arguments.report, &arguments.html];
    let Identified { report, log, sources } = match &arguments.grey {
        Some(model) => grey_box::found(&GreyBoxJob::resolve(arguments, model)?)?,
        None => match arguments.narx.narx {
            Some(map) => narx::found(&NarxJob::resolve(arguments, map)?)?,
            None => match ProcessJob::resolve(arguments)? {
                Some(job) => process::found(&job)?,
                None => match StateSpaceJob::resolve(arguments, false)? {
                    Some(job) => state_space::found(&job)?,
                    None => found(&FitJob::resolve(arguments)?, arguments.html.is_some())?,
                },
            },
        },
    };
    let json = report.to_json().map_err(|error| Failure::data(error.to_string()))?;
    let page =
        arguments.html.as_ref().zip(log).map(|(_, log)| page(&report, &log, &sources, line)).transpose()?;
    if let Some(path) = &arguments.report {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    if let (Some(path), Some(page)) = (&arguments.html, page) {
        output::page(path, &page)?;
    }
    for warning in &report.warnings {
        warn(warning);
    }
    match arguments.format {
        // Standard output holds one document.
        _ if outputs.into_iter().flatten().any(|path| path == Path::new("-")) => Ok(()),
        FormatArgument::Json => output::print(&json),
        FormatArgument::Table => output::print(&summary::table(&report, stdout_width())),
    }
}

/// Reads the logs and fits the model.
fn found(job: &FitJob, keeps_log: bool) -> Result<Identified, Failure> {
    job.check_output()?;
    let Experiments { log, sources, channels, words } = experiments(job, false)?;
    words.iter().for_each(|word| warn(word));
    let kept = keeps_log.then(|| log.clone());
    let (inputs, output) = channels.single();
    let plan = job.plan(inputs, output)?;
    let report = watched(|monitor| identify_monitored(log, &sources, &plan, monitor))?;
    Ok(Identified { report: report.map_err(log::failure(&sources))?, log: kept, sources })
}

/// The page of a fit, with a validation of each part of the log.
fn page(report: &Report, log: &Log, sources: &[Source], line: &str) -> Result<String, Failure> {
    let data = &report.data;
    let test = data.split.as_ref().map_or(&[][..], |parts| &parts.test);
    let parts = [&data.estimation[..], &data.validation, test].into_iter().filter(|rows| !rows.is_empty());
    let validated = |rows: &[Rows]| {
        let plan = ValidationPlan { rows: rows.to_vec(), ..ValidationPlan::default() };
        validate(report, None, log, sources, &plan).map_err(log::failure(sources))
    };
    let validated: Vec<Validated> = parts.map(validated).collect::<Result<_, _>>()?;
    let held_out = held_out_runs(report, log).map_err(log::failure(sources))?;
    Ok(fit_page(report, &validated, &held_out, line))
}

/// Reads the logs and fits the model.
pub(super) fn fitted(job: &FitJob) -> Result<Report, Failure> {
    Ok(found(job, false)?.report)
}
