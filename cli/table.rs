//! Logs in tables, read into columns of numbers: text (CSV), Parquet, and Arrow IPC files and streams.
//!
//! [`Reader::open`] knows the format by the first bytes, reads as far as the first row and knows the columns' names;
//! [`Reader::read`] reads the columns that were selected. The file is never held in memory: a text passes through two blocks
//! of a mebibyte, the others batch by batch. [`Reader::open_live`] and [`Reader::stream`] give the rows one by one as they come.
//!
//! What is understood of texts: commas, semicolons or tabs, recognised by themselves; quotes as in RFC 4180; blank
//! lines and comments; decimal commas; gzip; UTF-16 with a byte-order mark and other encodings by name; times
//! as seconds, as ISO 8601 or in a given format.
//!
//! What is not done here: the order of the times is not checked, names may repeat, and runs of blanks do not
//! separate fields.

mod block;
#[cfg(feature = "columnar")]
mod columnar;
mod decimal;
mod dialect;
mod error;
mod formats;
mod layout;
mod lines;
mod mailbox;
mod names;
mod number;
mod reader;
mod record;
mod rows;
mod source;
mod stream;
#[cfg(test)]
mod tests;
mod time;

use crate::memory::Bound;

pub(crate) use error::{Error, ErrorKind};
pub(crate) use formats::{Reader, Stream};
pub(crate) use lines::Lines;
pub(crate) use mailbox::{Event, Waker};
pub(crate) use names::{list, names};

/// How a log is written, as far as it is not recognised by itself.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// The byte between two fields; recognised from the first rows if it is not given.
    pub(crate) delimiter: Option<u8>,
    /// Whether numbers are written with a decimal comma.
    pub(crate) decimal_comma: bool,
    /// Whether the first row names the columns. Without a header they are named `1`, `2`, and so on.
    pub(crate) header: bool,
    /// How many rows below the header are left out: units, for example.
    pub(crate) skip_rows: usize,
    /// The first character of a line that is a comment.
    pub(crate) comment: Option<u8>,
    /// Words that stand for a missing value, besides an empty field, `NaN`, `NA`, `N/A` and `null`. Case does
    /// not matter, and a number stands for all ways to write it.
    pub(crate) missing: Vec<String>,
    /// The encoding of the text, if it is neither UTF-8 nor marked as UTF-16.
    pub(crate) encoding: Option<&'static encoding_rs::Encoding>,
    /// How times are written, in the manner of strptime, if they are neither seconds nor ISO 8601.
    pub(crate) time_format: Option<String>,
    /// What memory there is for; times count as values, too.
    pub(crate) bound: Option<Bound>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            delimiter: None,
            decimal_comma: false,
            header: true,
            skip_rows: 0,
            comment: None,
            missing: Vec::new(),
            encoding: None,
            time_format: None,
            bound: None,
        }
    }
}

impl Options {
    /// Whether the options go together; if not, a message says which do not.
    pub(crate) fn check(&self) -> Result<(), String> {
        // These bytes are part of numbers, words, quotes and line ends.
        let unusable =
            |byte: u8| !byte.is_ascii() || byte.is_ascii_alphanumeric() || b"+-.\"\r\n\0".contains(&byte);
        let shown = |byte: u8| error::quoted(&[byte]);
        match (self.delimiter, self.comment) {
            (Some(delimiter), _) if unusable(delimiter) => Err(format!(
                "{} cannot be the delimiter; use a comma, a semicolon or a tab",
                shown(delimiter)
            )),
            (_, Some(comment)) if unusable(comment) || comment.is_ascii_whitespace() => {
                Err(format!("{} cannot start a comment; use # or %", shown(comment)))
            }
            (Some(delimiter), Some(comment)) if delimiter == comment => {
                Err(format!("{} cannot both delimit fields and start a comment", shown(comment)))
            }
            (Some(b','), _) if self.decimal_comma => {
                Err("a comma cannot be both the delimiter and the decimal comma; separate fields by ;"
                    .to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// Which columns to read, by their indices, each at most once.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub(crate) struct Selection {
    /// The columns of numbers, in the order in which they are wanted.
    pub(crate) columns: Vec<usize>,
    /// The column of times.
    pub(crate) time: Option<usize>,
}

impl Table {
    /// Appends the part of the same file that follows.
    pub(crate) fn extend(&mut self, part: Self) {
        for (column, more) in
            self.columns.iter_mut().chain(&mut self.time).zip(part.columns.iter().chain(&part.time))
        {
            column.extend_from_slice(more);
        }
        self.lines.extend(self.rows, &part.lines);
        self.rows += part.rows;
    }
}

/// The columns that were read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    /// The selected columns, in the selection's order; a missing value is NaN.
    pub(crate) columns: Vec<Vec<f64>>,
    /// The times in seconds: as they are if they are numbers, and since the first one if they are dates.
    pub(crate) time: Option<Vec<f64>>,
    /// The first time as it is written, if it is a date.
    pub(crate) start: Option<String>,
    /// The number of rows.
    pub(crate) rows: usize,
    /// The line on which each row is; nothing where there are no lines.
    pub(crate) lines: Lines,
    /// What the reader should know, in plain words.
    pub(crate) words: Vec<String>,
}
