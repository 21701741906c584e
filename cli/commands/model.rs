//! `thetahat model`: a model whose numbers are known.

use std::path::Path;

use thetahat::Document;
use thetahat::present::tables;
use thetahat::report::Report;

use crate::args::{FormatArgument, ModelArguments};
use crate::failure::Failure;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn model(arguments: &ModelArguments) -> Result<(), Failure> {
    let model = arguments.options.options()?.model().map_err(|error| Failure::option(&error))?;
    let report = Report::of_known(model);
    let json = report.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &arguments.report {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    match arguments.format {
        _ if arguments.report.as_deref() == Some(Path::new("-")) => Ok(()),
        FormatArgument::Json => output::print(&json),
        FormatArgument::Table => output::print(&tables::report(&report, stdout_layout())),
    }
}
