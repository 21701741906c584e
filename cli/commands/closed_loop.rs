//! What is written of a controller and its loop.

use std::path::Path;

use thetahat::Document;
use thetahat::present::Layout;

use crate::args::{ClosedLoopArguments, FormatArgument};
use crate::failure::Failure;
use crate::messages::warn;
use crate::output;
use crate::wrap::layout_of;

/// Writes the document, the responses and the table, as far as they are asked for, and says the warnings.
pub(crate) fn write<D: Document>(
    arguments: &ClosedLoopArguments,
    found: &D,
    warnings: &[String],
    responses: impl FnOnce(&Path, &D) -> Result<(), Failure>,
    table: impl FnOnce(&D, Layout) -> String,
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
    let layout = layout_of(&arguments.out);
    let text = match arguments.format {
        FormatArgument::Json => json,
        FormatArgument::Table => table(found, layout),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}
