//! Options as data: tables of what they are called, what they do, and what they may be.
//!
//! A struct of a table holds the options that were given. It is written to JSON and read back. An option
//! has one of five [`Form`]s, its values are texts, numbers or words. A command line, its help, the types and the
//! documentation of Python, JSON Schemas and refusals are made of the table.

mod kind;
mod table;
mod value;

pub use kind::Kind;
pub use table::{OptionRow, Options};
pub use value::{ColumnName, Ends, Form, NamedValue, Word};

pub(crate) use table::options;
pub(crate) use value::{OptionText, OptionValue, none_of, texts, words};
