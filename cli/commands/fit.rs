//! `thetahat fit`: from logs to a model and its report.

use std::path::Path;

use thetahat::Document;
use thetahat::data::{Log, Rows, Source};
use thetahat::report::{
    Report, Validated, ValidationPlan, fit_page, held_out_runs, identify_monitored, validate,
};

use super::search::{Identified, watched};
use super::{grey_box, summary};
use crate::args::{FitArguments, FormatArgument};
use crate::failure::Failure;
use crate::job::{FitJob, GreyBoxJob};
use crate::log::{self, Clocks, Joined};
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_width;

pub(crate) fn fit(arguments: &FitArguments, line: &str) -> Result<(), Failure> {
    let outputs = [&arguments.report, &arguments.html];
    let Identified { report, log, sources } = match &arguments.grey {
        Some(model) => grey_box::found(&GreyBoxJob::resolve(arguments, model)?)?,
        None => found(&FitJob::resolve(arguments)?, arguments.html.is_some())?,
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
    let Experiments { log, sources, channels, words } = experiments(job, false)?;
    words.iter().for_each(|word| warn(word));
    let kept = keeps_log.then(|| log.clone());
    let plan = job.plan(channels.inputs, channels.output)?;
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

/// All logs as one, where they came from, and the columns that the model is about.
pub(crate) struct Experiments {
    pub(crate) log: Log,
    pub(crate) sources: Vec<Source>,
    pub(crate) channels: Channels,
    /// What the reader should know, in plain words.
    pub(crate) words: Vec<String>,
}

/// The columns that the model is about.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Channels {
    pub(crate) inputs: Vec<String>,
    pub(crate) output: String,
}

/// Reads all logs, one after the other, with any clock or with an even one.
pub(crate) fn experiments(job: &FitJob, any_clock: bool) -> Result<Experiments, Failure> {
    let mut channels: Option<Channels> = None;
    let Joined { log, sources, words } =
        log::joined(&job.paths, &job.log, Clocks { any: any_clock, sample_time: None }, |path, header| {
            let bad = |message: String| Failure::data(format!("{}: {message}", path.display()));
            let own = Channels::choose(job, header).map_err(bad)?;
            let first = channels.get_or_insert_with(|| own.clone());
            if own != *first {
                return Err(bad(format!(
                    "its inputs are {}, those of the first log {}; name with --input what all have",
                    log::listed(&own.inputs),
                    log::listed(&first.inputs)
                )));
            }
            job.orders.of(own.inputs.len())?;
            Ok(own.inputs.into_iter().chain([own.output]).collect())
        })?;
    Ok(Experiments { log, sources, channels: channels.unwrap_or_default(), words })
}

impl Channels {
    /// The named ones, or those called u, u1, u2, … and y.
    fn choose(job: &FitJob, header: &[String]) -> Result<Self, String> {
        let there_are = || format!("there are: {}", log::listed(header));
        let output = match &job.output {
            Some(name) => name.clone(),
            None if header.iter().any(|name| name == "y") => "y".to_owned(),
            None => {
                return Err(format!("no column is called y; name the output with --output; {}", there_are()));
            }
        };
        if !job.orders.has_inputs() {
            return Ok(Self { inputs: Vec::new(), output });
        }
        if let Some(inputs) = &job.inputs {
            return Ok(Self { inputs: inputs.clone(), output });
        }
        let inputs = usual_inputs(header);
        if inputs.is_empty() {
            return Err(format!(
                "no column is called u, u1, u2, …; name the inputs with --input, or give --nb 0 for a model without; {}",
                there_are()
            ));
        }
        Ok(Self { inputs, output })
    }
}

/// The columns called u, u1, u2, … in this order.
pub(super) fn usual_inputs(header: &[String]) -> Vec<String> {
    let mut inputs: Vec<(Option<u32>, String)> = header
        .iter()
        .filter_map(|name| {
            let number = name.strip_prefix('u')?;
            let number = if number.is_empty() { None } else { Some(plain_number(number)?) };
            Some((number, name.clone()))
        })
        .collect();
    inputs.sort();
    inputs.into_iter().map(|(_, name)| name).collect()
}

/// 1, 2, …: digits without a leading zero.
fn plain_number(text: &str) -> Option<u32> {
    let number: u32 = text.parse().ok()?;
    (number > 0 && number.to_string() == text).then_some(number)
}
