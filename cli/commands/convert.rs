//! `thetahat convert`: a model at another sample time, or in continuous time.

use std::path::Path;

use thetahat::model::{Hold, TimeBase};
use thetahat::present::tables;
use thetahat::{Document, Error};

use super::stored;
use crate::args::{ConvertArguments, FormatArgument};
use crate::failure::Failure;
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn convert(arguments: &ConvertArguments) -> Result<(), Failure> {
    let to: TimeBase = arguments.to.parse().map_err(|error| Failure::option(&error))?;
    let hold = arguments.hold.as_deref().map(str::parse::<Hold>).transpose();
    let hold = hold.map_err(|error| Failure::option(&error))?;
    let path = &arguments.report;
    let shown = path.display();
    let converted = stored::report(path)?.converted(to, hold).map_err(|error| match error {
        // What is wrong is in the file, not in the options.
        Error::Argument { ref argument, .. } if argument == "model" => {
            Failure::data(format!("{shown}: {error}"))
        }
        error => Failure::about(&error, |_| shown.to_string()),
    })?;
    let json = converted.to_json().map_err(|error| Failure::data(error.to_string()))?;
    converted.warnings.iter().for_each(|warning| warn(warning));
    if let Some(path) = &arguments.out {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    match arguments.format {
        _ if arguments.out.as_deref() == Some(Path::new("-")) => Ok(()),
        FormatArgument::Json => output::print(&json),
        FormatArgument::Table => output::print(&tables::converted(&converted, stdout_layout())),
    }
}
