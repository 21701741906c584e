//! `thetahat templates`: plants that are ready, and their models of a log.

use std::fmt::Write;
use std::path::PathBuf;

use thetahat::Error;
use thetahat::data::{Log, Rows};
use thetahat::model::GreyBox;
use thetahat::report::EquationsPlan;
use thetahat::templates::{Columns, Template};

use crate::args::TemplatesArguments;
use crate::failure::Failure;
use crate::job::{LogJob, TemplateOptions, TemplatesJob};
use crate::log::{self, Clocks, Joined};
use crate::messages::{note, warn};
use crate::output;

pub(crate) fn templates(arguments: &TemplatesArguments) -> Result<(), Failure> {
    let job = TemplatesJob::resolve(arguments)?;
    let Some(template) = job.template else { return output::print(&list()) };
    if job.paths.is_empty() {
        return output::print(&template.summary());
    }
    let plan = EquationsPlan { estimate: job.rows.clone(), ..EquationsPlan::default() };
    let rows = |log: &Log| plan.fitted_rows(log.rows());
    let (model, joined) = of_logs(template, &job.paths, &job.log, &job.options, rows)?;
    joined.warnings.iter().for_each(|warning| warn(warning));
    output::print(model.text())
}

/// All of them, a line each.
fn list() -> String {
    let mut text = String::new();
    for template in Template::all() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:<11} {}", template.name, template.title);
    }
    text.push_str(
        "\nthetahat templates NAME says what one wants; thetahat fit --grey template:NAME LOG fits it\n",
    );
    text
}

/// Reads the columns of some logs that a template wants, and makes its model of the rows that are named.
pub(super) fn of_logs(
    template: &'static Template,
    paths: &[PathBuf],
    job: &LogJob,
    options: &TemplateOptions,
    rows: impl FnOnce(&Log) -> Result<Vec<Rows>, Error>,
) -> Result<(GreyBox, Joined), Failure> {
    let mut columns: Option<Columns> = None;
    let joined = log::joined(paths, job, Clocks { sample_time: None, any: true }, |path, header| {
        let own = template
            .columns_in(header, &options.columns)
            .map_err(|error| Failure::data(format!("{}: {error}", path.display())))?;
        if let Some(first) = columns.as_ref().filter(|first| **first != own) {
            let names: Vec<&str> = first.names().collect();
            let message =
                format!("other columns than the first log, which has {}; rename them", names.join(", "));
            return Err(Failure::data(format!("{}: {message}", path.display())));
        }
        if columns.is_none() && !job.quiet {
            let described = own.described(template);
            if !described.is_empty() {
                note(&format!("{}: {described}", path.display()));
            }
        }
        let names = own.names().map(str::to_owned).collect();
        columns = Some(own);
        Ok(names)
    })?;
    let columns = columns.ok_or_else(|| Failure::usage("name a log"))?;
    let model = rows(&joined.log)
        .and_then(|rows| template.model(&joined.log, &columns, &options.known, &rows))
        .map_err(log::failure(&joined.sources))?;
    Ok((model, joined))
}
