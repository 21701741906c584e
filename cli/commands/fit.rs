//! `thetahat fit`: from logs to a model and its report.

use std::borrow::Cow;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

use thetahat::Document;
use thetahat::data::{Log, Rows, Source};
use thetahat::model::GreyBox;
use thetahat::present::{fit_page, tables};
use thetahat::report::{Report, Validated, ValidationPlan, held_out_runs, validate};

use super::each::{Done, each};
use super::experiments::{Experiments, experiments};
use super::search::{Identified, Telling};
use super::{pieces, response, stored, templates};
use crate::args::{EachArguments, FitArguments, FormatArgument, template_name};
use crate::failure::Failure;
use crate::job::{Equations, FitJob, TemplateOptions};
use crate::log::{self, Clocks, Joined};
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn fit(arguments: &FitArguments, line: &str) -> Result<(), Failure> {
    if arguments.each.each {
        return each(&arguments.each, &arguments.logs, &of_many(arguments)?, |log| one(arguments, log));
    }
    let outputs = [&arguments.report, &arguments.html];
    let Identified { report, log, sources } = found(&resolved(arguments)?, &Telling::Aloud)?;
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

fn resolved(arguments: &FitArguments) -> Result<FitJob, Failure> {
    FitJob::resolve(arguments, stored::plan)
}

/// Reads the logs, or the response, and fits the model.
fn found(job: &FitJob, telling: &Telling) -> Result<Identified, Failure> {
    if job.in_pieces {
        return pieces::found(job, telling);
    }
    if let Some(path) = &job.response {
        let draft = job.draft()?;
        let equations = match &job.equations {
            Some(Equations::File(path)) => Some(of_text(path, &job.template)?),
            _ => None,
        };
        let named = channels(job, equations.as_ref());
        let response = response::read(path, job.table.as_ref(), &job.template.columns, named)?;
        let response = match job.band {
            Some([low, high]) => response.within(low, high).map_err(|error| Failure::option(&error))?,
            None => response,
        };
        let report = telling.watched(|monitor| match &equations {
            Some(model) => draft.fit_equations_to_response(model, &response, monitor),
            None => draft.fit_response(&response, monitor),
        })?;
        let report = report.map_err(log::failure(&response.logs))?;
        return Ok(Identified { report, log: None, sources: Vec::new() });
    }
    if let Some(from) = &job.equations {
        return equations(job, from, telling);
    }
    let draft = job.draft()?;
    let Experiments { log, sources, channels, warnings } = experiments(job, draft.takes_any_clock())?;
    warnings.iter().for_each(|warning| telling.warn(warning));
    let plan = draft.plan(channels.inputs, channels.outputs).map_err(|error| Failure::option(&error))?;
    let (report, kept) = if job.keeps_log {
        (telling.watched(|monitor| plan.fit(Cow::Borrowed(&log), &sources, monitor))?, Some(log))
    } else {
        (telling.watched(|monitor| plan.fit(Cow::Owned(log), &sources, monitor))?, None)
    };
    Ok(Identified { report: report.map_err(log::failure(&sources))?, log: kept, sources })
}

/// A model in equations that is in a file, with what is known of its parameters.
fn of_text(path: &Path, options: &TemplateOptions) -> Result<GreyBox, Failure> {
    let known: Vec<(&str, f64)> = options.known.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let model = GreyBox::from_toml(&stored::text(path)?)
        .map_err(|error| Failure::data(format!("{}: {error}", path.display())))?;
    model
        .with_parameters(&known)
        .map_err(|error| Failure::usage(format!("--known: {}: {error}", path.display())))
}

/// What input and output of a table are called: as the options say, else as the equations do if they have one of each.
fn channels<'j>(job: &'j FitJob, equations: Option<&'j GreyBox>) -> [&'j str; 2] {
    let own = |channels: &'j [String]| match channels {
        [only] => Some(only.as_str()),
        _ => None,
    };
    let input = job.options.input.first().map(|name| name.0.as_str());
    let output = job.options.output.first().map(|name| name.0.as_str());
    [
        input.or_else(|| own(equations?.inputs())).unwrap_or("u"),
        output.or_else(|| own(equations?.outputs())).unwrap_or("y"),
    ]
}

/// Reads the logs and fits the unknown parameters of a model in equations.
fn equations(job: &FitJob, from: &Equations, telling: &Telling) -> Result<Identified, Failure> {
    let draft = job.draft()?;
    let (model, Joined { log, sources, warnings }) = match from {
        Equations::File(path) => {
            let model = of_text(path, &job.template)?;
            let joined = log::joined(&job.paths, &job.log, Clocks::from(&model), |_, _| {
                Ok(model.inputs().iter().chain(model.outputs()).cloned().collect())
            })?;
            (model, joined)
        }
        Equations::Template(template) => {
            let plan = draft.equations_plan().map_err(|error| Failure::option(&error))?;
            templates::of_logs(template, &job.paths, &job.log, &job.template, |log| {
                plan.fitted_rows(log.rows())
            })?
        }
    };
    warnings.iter().for_each(|warning| telling.warn(warning));
    let report = telling.watched(|monitor| draft.fit_equations(&model, &log, &sources, monitor))?;
    Ok(Identified { report: report.map_err(log::failure(&sources))?, log: Some(log), sources })
}

/// What fits of many logs have in common, in words that differ where they do: the options, a plan, and a model in
/// equations.
fn of_many(arguments: &FitArguments) -> Result<String, Failure> {
    let own = FitArguments {
        logs: vec![PathBuf::from("log")],
        each: EachArguments::default(),
        ..arguments.clone()
    };
    // What is wrong with the options is so with all logs.
    resolved(&own)?;
    let text = |path: &Option<PathBuf>| path.as_deref().map(stored::text).transpose();
    // A template is not in a file.
    let grey = arguments.grey.clone().filter(|path| template_name(path).is_none());
    Ok(format!("fit {own:?} {:?} {:?}", text(&grey)?, text(&arguments.plan)?))
}

/// Fits a model to one log of many.
fn one(arguments: &FitArguments, log: &Path) -> Result<Done, Failure> {
    let own = FitArguments { logs: vec![log.to_owned()], ..arguments.clone() };
    let telling = Telling::Kept(RefCell::default());
    // Without a word on how a log is read: with many logs there would be as many.
    let mut job = resolved(&own)?;
    job.log.quiet = true;
    let Identified { report, .. } = found(&job, &telling)?;
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
pub(super) fn fitted(arguments: &FitArguments) -> Result<Report, Failure> {
    Ok(found(&resolved(arguments)?, &Telling::Aloud)?.report)
}
