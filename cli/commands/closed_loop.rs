//! What is written of a controller and its loop.

use std::path::Path;

use thetahat::Document;

use crate::args::{ClosedLoopArguments, FormatArgument};
use crate::failure::Failure;
use crate::messages::warn;
use crate::output;
use crate::wrap::{WIDTH, stdout_width};

/// Writes the document, the responses and the table, as far as they are asked for, and says the warnings.
pub(crate) fn write<D: Document>(
    arguments: &ClosedLoopArguments,
    found: &D,
    warnings: &[String],
    responses: impl FnOnce(&Path, &D) -> Result<(), Failure>,
    table: impl FnOnce(&D, usize) -> String,
) -> Result<(), Failure> {
    let json = found.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &arguments.document {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    if let Some(path) = &arguments.responses {
        responses(path, found)?;
    }
    for warning in warnings {
        warn(warning);
    }
    // What goes into a file does not depend on the terminal.
    let width = if arguments.out == Path::new("-") { stdout_width() } else { WIDTH };
    let text = match arguments.format {
        FormatArgument::Json => json,
        FormatArgument::Table => table(found, width),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}
