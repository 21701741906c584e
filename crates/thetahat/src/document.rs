//! Documents: how they are written, read and described, and what they say in a line of a table.

mod row;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

pub use row::{Cell, Row};

use crate::{Error, text};

/// What writes documents: the program, and its version.
pub(crate) const GENERATOR: &str = concat!("thetahat ", env!("CARGO_PKG_VERSION"));

/// A JSON document of this program: a schema with a major version, in its field `schema`, and its fields.
///
/// ```
/// use thetahat::report::Validation;
/// use thetahat::Document;
///
/// assert_eq!(Validation::SCHEMA, "thetahat.validation/1");
/// assert!(Validation::json_schema()["properties"]["fit"].is_object());
/// let error = Validation::from_json(r#"{"schema": "thetahat.report/1"}"#).unwrap_err();
/// assert!(error.to_string().contains("'thetahat.report/1', this version reads 'thetahat.validation/1'"));
/// ```
pub trait Document: Serialize + DeserializeOwned + JsonSchema {
    /// What messages call it.
    const NAME: &'static str;
    /// The schema that this version writes, and reads with any minor version after it.
    const SCHEMA: &'static str;
    /// What to do where a text is none.
    const REMEDY: &'static str;

    /// What is wrong with the whole, where each field is right.
    ///
    /// # Errors
    /// [`Error::Report`].
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    /// What is said of a document of another schema.
    fn refusal(schema: &str) -> String {
        let (own, remedy) = (Self::SCHEMA, Self::REMEDY);
        format!("its schema is '{}', this version reads '{own}'; {remedy}", text::brief(schema, 40))
    }

    /// The document, indented, with a line break at its end.
    ///
    /// # Errors
    /// [`Error::Report`] if it cannot be written as JSON.
    fn to_json(&self) -> Result<String, Error>;

    /// Reads a document back. Fields that are not known are left out.
    ///
    /// # Errors
    /// [`Error::Report`] with line and column if it is not JSON or a field is missing; if it has another major schema;
    /// if its parts do not fit together.
    fn from_json(text: &str) -> Result<Self, Error>;

    /// The JSON Schema of the document.
    fn json_schema() -> serde_json::Value;
}

/// The methods of a [`Document`] that write, read and describe it. They stand in each `impl`, and not in the trait, so
/// that they are compiled once, with this crate: a provided method is compiled anew in every crate that calls it, and
/// with it all that serde and schemars make of the document's fields.
macro_rules! document_methods {
    () => {
        #[inline(never)]
        fn to_json(&self) -> Result<String, crate::Error> {
            crate::document::to_json(self)
        }

        #[inline(never)]
        fn from_json(text: &str) -> Result<Self, crate::Error> {
            crate::document::from_json(text)
        }

        #[inline(never)]
        fn json_schema() -> serde_json::Value {
            schemars::schema_for!(Self).to_value()
        }
    };
}
pub(crate) use document_methods;

pub(crate) fn to_json<D: Document>(document: &D) -> Result<String, Error> {
    let mut json = serde_json::to_string_pretty(document)
        .map_err(|error| Error::report(format!("the {} cannot be written as JSON: {error}", D::NAME)))?;
    json.push('\n');
    Ok(text::escaped_json(json))
}

pub(crate) fn from_json<D: Document>(text: &str) -> Result<D, Error> {
    let malformed = |error: serde_json::Error| {
        // Fields of a document are no options, which stand between backticks.
        let error = error.to_string().replace('`', "'");
        Error::report(format!("this is not a thetahat {}: {error}; {}", D::NAME, D::REMEDY))
    };
    let schema = schema(text).map_err(malformed)?;
    if schema != D::SCHEMA && !schema.starts_with(&format!("{}.", D::SCHEMA)) {
        return Err(Error::report(D::refusal(&schema)));
    }
    let document: D = serde_json::from_str(text).map_err(malformed)?;
    document.check()?;
    Ok(document)
}

fn schema(text: &str) -> serde_json::Result<String> {
    #[derive(Deserialize)]
    struct Head {
        schema: String,
    }
    serde_json::from_str::<Head>(text).map(|head| head.schema)
}

/// Whether a text is a document of this kind, of whatever version.
pub fn is_document<D: Document>(text: &str) -> bool {
    let kind = |schema: &str| schema.split('/').next().map(str::to_owned);
    schema(text).is_ok_and(|schema| kind(&schema) == kind(D::SCHEMA))
}
