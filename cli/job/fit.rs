use std::path::{Path, PathBuf};

use thetahat::fit::FitDraft;
use thetahat::options::Options;
use thetahat::plan::{FitOptions, Fitted};
use thetahat::templates::Template;

use super::{LogJob, TemplateOptions};
use crate::args::{FitArguments, LogArguments, template_name};
use crate::failure::Failure;
use crate::memory::PerValue;

/// Where a model in equations comes from.
#[derive(Debug)]
pub(crate) enum Equations {
    /// A file.
    File(PathBuf),
    Template(&'static Template),
}

/// A model to fit.
#[derive(Debug)]
pub(crate) struct FitJob {
    /// The logs, at least one unless a response is there instead.
    pub(crate) paths: Vec<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    /// A model in equations.
    pub(crate) equations: Option<Equations>,
    /// What is known of its parameters, and which column is which.
    pub(crate) template: TemplateOptions,
    /// A frequency response: a document, or a table.
    pub(crate) response: Option<PathBuf>,
    /// How the table is written, if that was said.
    pub(crate) table: Option<thetahat_table::Options>,
    /// From which to which of its frequencies, in rad/s.
    pub(crate) band: Option<[f64; 2]>,
    /// Whether the logs are read part by part.
    pub(crate) in_pieces: bool,
    /// Whether the log is wanted afterwards.
    pub(crate) keeps_log: bool,
    pub(crate) options: FitOptions,
    fitted: Fitted,
}

impl FitJob {
    /// A log that is there already may have several outputs without their names. `plan` reads the options of a file.
    pub(crate) fn resolve(
        arguments: &FitArguments,
        plan: impl FnOnce(&Path) -> Result<FitOptions, Failure>,
    ) -> Result<Self, Failure> {
        let options = arguments.options.options()?;
        let options = match &arguments.plan {
            Some(path) => options.or(plan(path)?),
            None => options,
        };
        let fitted = match (&arguments.grey, &arguments.from) {
            (Some(_), _) => Fitted::Equations,
            (None, Some(_)) => Fitted::Response,
            (None, None) => Fitted::Log { several_outputs: false },
        };
        let files =
            arguments.logs.iter().chain(&arguments.grey).chain(&arguments.plan).chain(&arguments.from);
        if files.filter(|path| *path == Path::new("-")).count() > 1 {
            let what = match (&arguments.grey, &arguments.from) {
                (Some(_), Some(_)) => "the model and the response",
                (Some(_), None) => "the model and the logs",
                (None, Some(_)) => "the response and the plan",
                (None, None) => "the logs",
            };
            return Err(Failure::usage(format!("only one of {what} can come from standard input (-)")));
        }
        let template = TemplateOptions::resolve(&arguments.template)?;
        let equations = match arguments.grey.as_deref().map(|path| (path, template_name(path))) {
            None => {
                let columns_are_named = !template.columns.is_empty() && arguments.from.is_none();
                let given = [("--columns", columns_are_named), ("--known", !template.known.is_empty())];
                if let Some((option, _)) = given.iter().find(|(_, is_given)| *is_given) {
                    return Err(Failure::usage(format!("{option} goes with --grey, a model in equations")));
                }
                None
            }
            Some((path, None)) => {
                if !template.columns.is_empty() && arguments.from.is_none() {
                    let message = "--columns is for templates; a model in a text names its channels itself";
                    return Err(Failure::usage(message));
                }
                Some(Equations::File(path.to_owned()))
            }
            Some((_, Some(name))) => {
                let template = Template::named(name).map_err(|error| Failure::option(&error))?;
                if arguments.from.is_some() {
                    return Err(Failure::usage(
                        "--from: a template finds its start values in a log; write its model of one to a file (thetahat templates NAME \
                         LOG), and give that",
                    ));
                }
                if arguments.logs.is_empty() {
                    let (name, wants) = (template.name, template.wants());
                    return Err(Failure::usage(format!(
                        "name the logs to fit {name} to: it {wants}; thetahat templates {name} says more"
                    )));
                }
                Some(Equations::Template(template))
            }
        };
        if arguments.logs.is_empty() && arguments.from.is_none() && arguments.each.list.is_none() {
            return Err(Failure::usage("name the logs to fit the model to"));
        }
        let log = LogJob::resolve(&arguments.log, &arguments.clock)?;
        let is_table_described = arguments.from.is_some() && arguments.log != LogArguments::default();
        let mut job = Self {
            paths: arguments.logs.clone(),
            table: is_table_described.then(|| log.options.clone()),
            log,
            equations,
            template,
            response: arguments.from.clone(),
            band: arguments.frequencies.as_deref().map(band).transpose()?,
            in_pieces: arguments.stream,
            keeps_log: arguments.html.is_some(),
            options,
            fitted,
        };
        if !job.draft()?.is_one_step() || job.keeps_log {
            job.log.per_value = PerValue::Search;
        }
        Ok(job)
    }

    /// The fit before the log says what its channels are.
    pub(crate) fn draft(&self) -> Result<FitDraft, Failure> {
        FitDraft::new(&self.options, self.fitted).map_err(|error| Failure::option(&error))
    }
}

/// The two ends of a band.
fn band(text: &str) -> Result<[f64; 2], Failure> {
    let number =
        |text: &str| text.trim().parse::<f64>().ok().filter(|value| *value >= 0.0 && value.is_finite());
    let ends = text.split_once("..").and_then(|(low, high)| number(low).zip(number(high)));
    match ends {
        Some((low, high)) if low < high => Ok([low, high]),
        _ => Err(Failure::usage(format!(
            "--frequencies {text}: write a band as LOW..HIGH, in rad/s, such as 0.1..100"
        ))),
    }
}
