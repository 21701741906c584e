//! `thetahat fit`: from a log to a model and its report.

use std::path::Path;

use thetahat::{Plan, Report, identify};

use super::summary;
use crate::args::{FitArguments, FormatArgument};
use crate::failure::Failure;
use crate::job::FitJob;
use crate::log::{self, Loaded};
use crate::output::{self, warn};

pub(crate) fn fit(arguments: &FitArguments) -> Result<(), Failure> {
    let job = FitJob::resolve(arguments)?;
    if let Some(path) = &arguments.report {
        output::apart(path, &job.log.path)?;
    }
    let report = identified(&job)?;
    let json = report.to_json().map_err(|error| Failure::data(error.to_string()))?;
    let to_stdout = arguments.report.as_deref() == Some(Path::new("-"));
    if let Some(path) = &arguments.report {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    for warning in &report.warnings {
        warn(warning);
    }
    match arguments.format {
        // Standard output holds one document.
        _ if to_stdout => Ok(()),
        FormatArgument::Json => output::print(&json),
        FormatArgument::Table => output::print(&summary::table(&report)),
    }
}

/// Reads the log and fits the model.
pub(super) fn identified(job: &FitJob) -> Result<Report, Failure> {
    let mut inputs = Vec::new();
    let mut output = String::new();
    let Loaded { log, source } = log::load(&job.log, None, |header| {
        (inputs, output) = channels(job, header)?;
        Ok(inputs.iter().chain([&output]).cloned().collect())
    })?;
    let orders = job.orders(inputs.len())?;
    let plan = Plan {
        inputs,
        output,
        estimate: job.estimate.clone(),
        validate: job.validate.clone(),
        detrend: job.detrend,
        offsets: job.offsets.clone(),
        orders,
        initial: job.initial,
    };
    identify(log, &source, &plan).map_err(Loaded::failure(&source))
}

/// The input and output columns: the named ones, or those called u, u1, u2, … and y.
fn channels(job: &FitJob, header: &[String]) -> Result<(Vec<String>, String), String> {
    let there_are = || format!("there are: {}", log::listed(header));
    let output = match &job.output {
        Some(name) => name.clone(),
        None if header.iter().any(|name| name == "y") => "y".to_owned(),
        None => return Err(format!("no column is called y; name the output with --output; {}", there_are())),
    };
    if job.is_autoregression() {
        return Ok((Vec::new(), output));
    }
    if let Some(inputs) = &job.inputs {
        return Ok((inputs.clone(), output));
    }
    let mut inputs: Vec<(Option<u32>, String)> = header
        .iter()
        .filter_map(|name| {
            let number = name.strip_prefix('u')?;
            let number = if number.is_empty() { None } else { Some(plain_number(number)?) };
            Some((number, name.clone()))
        })
        .collect();
    inputs.sort();
    if inputs.is_empty() {
        return Err(format!(
            "no column is called u, u1, u2, …; name the inputs with --input, or give --nb 0 for a model without; {}",
            there_are()
        ));
    }
    Ok((inputs.into_iter().map(|(_, name)| name).collect(), output))
}

/// 1, 2, …: digits without a leading zero.
fn plain_number(text: &str) -> Option<u32> {
    let number: u32 = text.parse().ok()?;
    (number > 0 && number.to_string() == text).then_some(number)
}
