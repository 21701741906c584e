//! `thetahat fit`: from logs to a model and its report.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use thetahat::Document;
use thetahat::data::{Log, Rows, Source};
use thetahat::present::{fit_page, tables};
use thetahat::report::{Report, Validated, ValidationPlan, held_out_runs, identify_monitored, validate};

use super::each::{Done, each};
use super::experiments::{Experiments, experiments};
use super::pieces::PiecesJob;
use super::search::{Identified, Telling};
use super::{grey_box, narx, process, state_space, stored};
use crate::args::{EachArguments, FitArguments, FormatArgument, MapArgument};
use crate::failure::Failure;
use crate::job::{FitJob, GreyBoxJob, NarxJob, ProcessJob, StateSpaceJob, check_linear};
use crate::log;
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn fit(arguments: &FitArguments, line: &str) -> Result<(), Failure> {
    if arguments.each.each {
        return each(&arguments.each, &arguments.logs, &of_many(arguments)?, |log| one(arguments, log));
    }
    let outputs = [&arguments.report, &arguments.html];
    let Identified { report, log, sources } = resolved(arguments)?.found(&Telling::Aloud)?;
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
        FormatArgument::Table => output::print(&tables::report(&report, stdout_layout())),
    }
}

/// A fit, resolved: what model, and how it is fitted.
enum Resolved {
    GreyBox(Box<GreyBoxJob>),
    Narx(Box<NarxJob>),
    Process(Box<ProcessJob>),
    StateSpace(Box<StateSpaceJob>),
    /// The logs are read part by part.
    Pieces(PiecesJob),
    Polynomial {
        job: Box<FitJob>,
        /// Whether the log is wanted afterwards.
        keeps_log: bool,
    },
}

fn resolved(arguments: &FitArguments) -> Result<Resolved, Failure> {
    check_linear(&arguments.narx)?;
    if let Some(model) = &arguments.grey {
        return Ok(Resolved::GreyBox(Box::new(GreyBoxJob::resolve(arguments, model)?)));
    }
    if let Some(map) = MapArgument::asked(arguments.narx.narx).filter(|_| !arguments.stream) {
        return Ok(Resolved::Narx(Box::new(NarxJob::resolve(arguments, map)?)));
    }
    if let Some(job) = ProcessJob::resolve(arguments)? {
        return Ok(Resolved::Process(Box::new(job)));
    }
    if arguments.stream {
        return Ok(Resolved::Pieces(PiecesJob::resolve(arguments, false)?));
    }
    if let Some(job) = StateSpaceJob::resolve(arguments, false)? {
        return Ok(Resolved::StateSpace(Box::new(job)));
    }
    let job = FitJob::resolve(arguments)?;
    job.check_output()?;
    Ok(Resolved::Polynomial { job: Box::new(job), keeps_log: arguments.html.is_some() })
}

impl Resolved {
    /// The same without a word on how a log is read: with many logs there would be as many.
    fn quiet(mut self) -> Self {
        let log = match &mut self {
            Self::GreyBox(job) => &mut job.log,
            Self::Narx(job) => &mut job.log,
            Self::Process(job) => &mut job.log,
            Self::StateSpace(job) => &mut job.log,
            Self::Pieces(job) => job.log(),
            Self::Polynomial { job, .. } => &mut job.log,
        };
        log.quiet = true;
        self
    }

    /// Reads the logs and fits the model.
    fn found(&self, telling: &Telling) -> Result<Identified, Failure> {
        match self {
            Self::GreyBox(job) => grey_box::found(job, telling),
            Self::Narx(job) => narx::found(job, telling),
            Self::Process(job) => process::found(job, telling),
            Self::StateSpace(job) => state_space::found(job, telling),
            Self::Pieces(job) => job.found(telling),
            Self::Polynomial { job, keeps_log } => found(job, *keeps_log, telling),
        }
    }
}

/// Reads the logs and fits the model.
fn found(job: &FitJob, keeps_log: bool, telling: &Telling) -> Result<Identified, Failure> {
    let Experiments { log, sources, channels, words } = experiments(job, false)?;
    words.iter().for_each(|word| telling.warn(word));
    let kept = keeps_log.then(|| log.clone());
    let (inputs, output) = channels.single();
    let plan = job.plan(inputs, output)?;
    let report = telling.watched(|monitor| identify_monitored(log, &sources, &plan, monitor))?;
    Ok(Identified { report: report.map_err(log::failure(&sources))?, log: kept, sources })
}

/// What fits of many logs have in common, in words that differ where they do: the options, and a model in equations.
fn of_many(arguments: &FitArguments) -> Result<String, Failure> {
    let own = FitArguments {
        logs: vec![PathBuf::from("log")],
        each: EachArguments::default(),
        ..arguments.clone()
    };
    // What is wrong with the options is so with all logs.
    resolved(&own)?;
    let equations = arguments.grey.as_ref().map(|model| stored::text(model)).transpose()?;
    Ok(format!("fit {own:?} {equations:?}"))
}

/// Fits a model to one log of many.
fn one(arguments: &FitArguments, log: &Path) -> Result<Done, Failure> {
    let own = FitArguments { logs: vec![log.to_owned()], ..arguments.clone() };
    let telling = Telling::Kept(RefCell::default());
    let Identified { report, .. } = resolved(&own)?.quiet().found(&telling)?;
    Done::new(&report, report.row(), telling.kept(), &report.warnings)
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
    job.check_output()?;
    Ok(found(job, false, &Telling::Aloud)?.report)
}
