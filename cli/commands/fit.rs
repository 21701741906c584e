//! `thetahat fit`: from logs to a model and its report.

use std::ops::ControlFlow;
use std::path::Path;

use thetahat::{Log, Plan, Report, Rows, Source, identify_monitored};

use super::summary;
use crate::args::{FitArguments, FormatArgument};
use crate::failure::Failure;
use crate::interrupt;
use crate::job::FitJob;
use crate::log::{self, Loaded};
use crate::output::{self, warn};
use crate::progress::Searching;

pub(crate) fn fit(arguments: &FitArguments) -> Result<(), Failure> {
    let job = FitJob::resolve(arguments)?;
    if let Some(report) = &arguments.report {
        job.paths.iter().try_for_each(|path| output::apart(report, path))?;
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

/// Reads the logs and fits the model.
pub(super) fn identified(job: &FitJob) -> Result<Report, Failure> {
    let (log, sources, channels) = experiments(job)?;
    let plan = Plan {
        orders: job.orders.of(channels.inputs.len())?,
        inputs: channels.inputs,
        output: channels.output,
        estimate: job.estimate.clone(),
        validate: job.validate.clone(),
        detrend: job.detrend,
        offsets: job.offsets.clone(),
        method: job.method.clone(),
        initial: job.initial,
    };
    let progress = Searching::new();
    let monitor = |now| {
        progress.update(now);
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let found = interrupt::during(|| identify_monitored(log, &sources, &plan, &monitor));
    drop(progress);
    found?.map_err(log::failure(&sources))
}

/// The columns that the model is about.
#[derive(Debug, Clone, Default, PartialEq)]
struct Channels {
    inputs: Vec<String>,
    output: String,
}

/// Reads all logs, one behind the other.
fn experiments(job: &FitJob) -> Result<(Log, Vec<Source>, Channels), Failure> {
    let mut channels: Option<Channels> = None;
    let (mut logs, mut sources) = (Vec::new(), Vec::<Source>::new());
    for path in &job.paths {
        let bad = |message: String| Failure::data(format!("{}: {message}", path.display()));
        let Loaded { log, mut source } = log::load(path, &job.log, None, |header| {
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
        let before = sources.last().map_or(0, |source| source.rows.last());
        source.rows = Rows::new(before + 1, before + log.rows()).map_err(|error| bad(error.to_string()))?;
        logs.push(log);
        sources.push(source);
    }
    let log = Log::join(logs).map_err(log::failure(&sources))?;
    Ok((log, sources, channels.unwrap_or_default()))
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
        Ok(Self { inputs: inputs.into_iter().map(|(_, name)| name).collect(), output })
    }
}

/// 1, 2, …: digits without a leading zero.
fn plain_number(text: &str) -> Option<u32> {
    let number: u32 = text.parse().ok()?;
    (number > 0 && number.to_string() == text).then_some(number)
}
