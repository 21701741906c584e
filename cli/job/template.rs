//! What a template is told of a log.

use std::path::PathBuf;

use thetahat::data::Rows;
use thetahat::templates::Template;

use super::{LogJob, rows};
use crate::args::{Names, TemplateOptionArguments, TemplatesArguments};
use crate::failure::Failure;

/// Which column is which, and what is known.
#[derive(Debug, Clone, Default)]
pub(crate) struct TemplateOptions {
    /// Name of the template, name in the log.
    pub(crate) columns: Vec<(String, String)>,
    pub(crate) known: Vec<(String, f64)>,
}

impl TemplateOptions {
    pub(crate) fn resolve(arguments: &TemplateOptionArguments) -> Result<Self, Failure> {
        let pairs = |option: &str, lists: &[Names], form: &str| -> Result<Vec<(String, String)>, Failure> {
            let each =
                Names::all(lists).unwrap_or_default().into_iter().map(|text| match text.split_once('=') {
                    Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
                        Ok((name.trim().to_owned(), value.trim().to_owned()))
                    }
                    _ => Err(Failure::usage(format!("{option} {text}: write it as {form}"))),
                });
            each.collect()
        };
        let columns = pairs("--columns", &arguments.columns, "ROLE=COLUMN, such as current=I")?;
        let known = pairs("--known", &arguments.known, "NAME=VALUE, such as capacity=33.4")?;
        let known = known.into_iter().map(|(name, value)| match value.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok((name, number)),
            _ => Err(Failure::usage(format!("--known {name}={value}: '{value}' is no finite number"))),
        });
        Ok(Self { columns, known: known.collect::<Result<_, _>>()? })
    }
}

/// A list of templates, one of them, or its model of some logs.
#[derive(Debug)]
pub(crate) struct TemplatesJob {
    pub(crate) template: Option<&'static Template>,
    pub(crate) paths: Vec<PathBuf>,
    pub(crate) options: TemplateOptions,
    pub(crate) rows: Vec<Rows>,
    pub(crate) log: LogJob,
}

impl TemplatesJob {
    pub(crate) fn resolve(arguments: &TemplatesArguments) -> Result<Self, Failure> {
        let named = |name: &String| Template::named(name).map_err(|error| Failure::option(&error));
        Ok(Self {
            template: arguments.name.as_ref().map(named).transpose()?,
            paths: arguments.logs.clone(),
            options: TemplateOptions::resolve(&arguments.template)?,
            rows: rows("--estimate", &arguments.estimate)?,
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
        })
    }
}
