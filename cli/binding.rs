//! How the program reads files, for a binding to another language. Options are those of the command line and mean the
//! same; nothing is printed, and nothing is drawn on a terminal.

use std::ffi::OsString;
use std::path::Path;

use clap::Args;
use thetahat::data::{Log, Source};
use thetahat::inspect::{Inspection, TopicList};

use crate::args::InspectArguments;
use crate::commands::{Experiments, experiments, inspected, plan};
use crate::failure::Failure;
use crate::job::{FitJob, InspectJob};
use crate::log;
use crate::replace::replace;

/// Logs that were read as one.
#[derive(Debug)]
pub struct Opened {
    /// The channels, their rows counted through all logs.
    pub log: Log,
    /// Where they came from.
    pub sources: Vec<Source>,
    /// The input channels: those named, or those called u, u1, u2, …
    pub inputs: Vec<String>,
    /// The output channels: those named, or y.
    pub outputs: Vec<String>,
    /// What the reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// Reads the logs that `thetahat fit` would with these options. Their clocks may be uneven unless they have to be
/// uniform.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn read(options: &[OsString], uniform: bool) -> Result<Opened, Failure> {
    let mut job = FitJob::resolve(&arguments("fit", options)?, plan)?;
    job.log.quiet = true;
    let Experiments { log, sources, channels, warnings } = experiments(&job, !uniform)?;
    Ok(Opened { log, sources, inputs: channels.inputs, outputs: channels.outputs, warnings })
}

/// What `thetahat inspect` says of a file with these options.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn inspect(options: &[OsString]) -> Result<Inspection, Failure> {
    let arguments: InspectArguments = arguments("inspect", options)?;
    let mut job = InspectJob::resolve(&arguments)?;
    job.log.quiet = true;
    Ok(inspected(&job, &arguments)?.0)
}

/// What `thetahat inspect` says of the topics of a file with these options, without names of columns.
///
/// # Errors
/// A [`Failure`] as the program would report it, and one for a log without topics.
pub fn topic_list(options: &[OsString]) -> Result<TopicList, Failure> {
    let arguments: InspectArguments = arguments("inspect", options)?;
    let job = InspectJob::resolve(&arguments)?;
    let reader = log::open(&job.path, &job.log)?;
    log::list_of_topics(&reader, &job.path).ok_or_else(|| {
        Failure::data(format!(
            "{}: it has no topics with clocks of their own, but columns with one; inspect it",
            job.path.display()
        ))
    })
}

/// Writes a file as the program does: whole, or not at all.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    replace(path, |file| file.write_all(text.as_bytes()))
}

/// The arguments of a verb.
fn arguments<T: Args>(verb: &'static str, warnings: &[OsString]) -> Result<T, Failure> {
    let command = clap::Command::new(verb).no_binary_name(true).disable_help_flag(true);
    let parsed = T::augment_args(command).try_get_matches_from(warnings);
    parsed.and_then(|matches| T::from_arg_matches(&matches)).map_err(|error| {
        use clap::error::{ContextKind, ContextValue};
        let context = |kind| error.get(kind);
        if let (
            Some(ContextValue::String(option)),
            Some(ContextValue::String(value)),
            Some(ContextValue::Strings(known)),
        ) = (
            context(ContextKind::InvalidArg),
            context(ContextKind::InvalidValue),
            context(ContextKind::ValidValue),
        ) {
            let name = option.split(' ').next().unwrap_or_default();
            return Failure::usage(format!("{name}: '{value}' is none of {}", known.join(", ")));
        }
        if let (Some(ContextValue::String(option)), Some(ContextValue::String(value)), Some(why)) = (
            context(ContextKind::InvalidArg),
            context(ContextKind::InvalidValue),
            std::error::Error::source(&error),
        ) {
            let name = option.split(' ').next().unwrap_or_default();
            return Failure::usage(format!("{name}: {value}: {why}"));
        }
        if let (clap::error::ErrorKind::MissingRequiredArgument, Some(ContextValue::Strings(missing))) =
            (error.kind(), context(ContextKind::InvalidArg))
        {
            let names: Vec<&str> = missing.iter().filter_map(|name| name.split(' ').next()).collect();
            return Failure::usage(format!("{} is needed with the other options", names.join(", ")));
        }
        // The first paragraph says what is wrong; the others how to call the program.
        let text = error.to_string();
        let first = text.split("\n\n").next().unwrap_or_default();
        let lines: Vec<&str> = first.trim_start_matches("error: ").lines().map(str::trim).collect();
        Failure::usage(lines.join(" "))
    })
}
