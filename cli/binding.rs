//! The stages of the program for a binding to another language. Options are those of the command line and mean the
//! same; nothing is printed, and nothing is drawn on a terminal.

use std::ffi::OsString;
use std::path::Path;

use clap::Args;
use thetahat::control::Control;
use thetahat::data::{Log, Source};
use thetahat::design::{ExperimentDesign, SignalPlan};
use thetahat::inspect::{Inspection, TopicList};
use thetahat::model::Model;
use thetahat::report::{Report, Requirement, ValidationPlan};
use thetahat::spectrum::SpectrumPlan;
use thetahat::step_test::StepTestPlan;
use thetahat::tune::Tuning;

use crate::args::{ControlArguments, DesignArguments, InspectArguments, TuneArguments, ValidateArguments};
use crate::commands::{
    Experiments, Tracking, compared_signals, designed, experiments, inspected, plan, settings,
};
use crate::failure::Failure;
use crate::job::{DesignJob, EvaluationJob, FitJob, InspectJob, SpectrumJob, StepTestJob, control_plan};
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

/// How `thetahat validate` evaluates a model with these options, and what it requires.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn validation_plan(options: &[OsString]) -> Result<(ValidationPlan, Vec<Requirement>), Failure> {
    let files = ["report", "log"].map(OsString::from);
    let words: Vec<OsString> = options.iter().cloned().chain(files).collect();
    let arguments: ValidateArguments = arguments("validate", &words)?;
    let mut job = EvaluationJob::resolve(&arguments.evaluation, &[])?;
    let requirements = job.requirements(&arguments.require)?;
    Ok((job.plan, requirements))
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

/// The plan that `thetahat spectrum` makes of these options for a log with these channels.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn spectrum_plan(
    options: &[OsString],
    inputs: Vec<String>,
    output: String,
) -> Result<SpectrumPlan, Failure> {
    let log = OsString::from("log");
    let words: Vec<OsString> = options.iter().cloned().chain([log]).collect();
    SpectrumJob::resolve(&arguments("spectrum", &words)?)?.plan(inputs, output)
}

/// The plan that `thetahat step` makes of these options for a log with these channels.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn step_test_plan(options: &[OsString], input: String, output: String) -> Result<StepTestPlan, Failure> {
    let log = OsString::from("log");
    let words: Vec<OsString> = options.iter().cloned().chain([log]).collect();
    Ok(StepTestJob::resolve(&arguments("step", &words)?)?.plan(input, output))
}

/// What `thetahat tune` says of a model with these options.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn tuning_of(options: &[OsString], model: &Model) -> Result<Tuning, Failure> {
    let report = OsString::from("model");
    let words: Vec<OsString> = options.iter().cloned().chain([report]).collect();
    let arguments: TuneArguments = arguments("tune", &words)?;
    settings(&arguments, model, Path::new("model"))
}

/// What `thetahat control` says of a model with these options.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn controller_of(options: &[OsString], model: &Model) -> Result<Control, Failure> {
    let report = OsString::from("model");
    let words: Vec<OsString> = options.iter().cloned().chain([report]).collect();
    let arguments: ControlArguments = arguments("control", &words)?;
    designed(&control_plan(&arguments)?, model, Path::new("model"))
}

/// The signal that `thetahat design` makes with these options.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn signal_plan(options: &[OsString]) -> Result<SignalPlan, Failure> {
    Ok(DesignJob::resolve(&arguments("design", options)?)?.plan())
}

/// What `thetahat design --for` says of a model with these options.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn compare_signals(options: &[OsString], model: &Model) -> Result<ExperimentDesign, Failure> {
    // The name stands for the model in messages.
    let words: Vec<OsString> = options.iter().cloned().chain([OsString::from("--for=model")]).collect();
    let arguments: DesignArguments = arguments("design", &words)?;
    compared_signals(&arguments, &DesignJob::resolve(&arguments)?, model, Path::new("model"))
}

/// What `thetahat track` does with these options, in memory, for a log with these channels. `report` is where it starts
/// from.
///
/// # Errors
/// A [`Failure`] as the program would report it.
pub fn track(
    options: &[OsString],
    inputs: Vec<String>,
    outputs: Vec<String>,
    report: Option<&Report>,
) -> Result<Tracking, Failure> {
    // The name stands for the report in messages.
    let warm = report.map(|_| "--warm=warm");
    let words: Vec<OsString> =
        options.iter().cloned().chain(warm.into_iter().chain(["log"]).map(OsString::from)).collect();
    Tracking::new(&arguments("track", &words)?, inputs, outputs, report)
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
