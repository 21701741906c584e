//! How documents are written.

use serde::Serialize;

use crate::{Error, text};

/// A document as JSON, indented, with a line break at its end. `what` is its name.
///
/// # Errors
/// [`Error::Report`] if it cannot be written.
pub(crate) fn written(what: &str, document: &impl Serialize) -> Result<String, Error> {
    let mut json = serde_json::to_string_pretty(document)
        .map_err(|error| Error::report(format!("the {what} cannot be written as JSON: {error}")))?;
    json.push('\n');
    Ok(text::escaped_json(json))
}
