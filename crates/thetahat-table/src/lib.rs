//! Logs in tables, read into columns of numbers: text (CSV), spreadsheets, MATLAB files, Parquet, and Arrow IPC files
//! and streams; and logs of flights and robots, whose topics have clocks of their own: ULog (PX4), DataFlash
//! (ArduPilot) and WPILib data logs.
//!
//! [`Reader::open`] knows the format by the first bytes, reads as far as the first row and knows the columns' names;
//! [`Reader::read`] reads the columns that were selected. The file is never held in memory: a text passes through two
//! blocks of a mebibyte, the others batch by batch. [`Reader::read_parts`] gives a log in parts, [`Reader::open_live`]
//! and [`Reader::stream`] the rows one by one as they come.
//!
//! ```
//! use thetahat_table::{Options, Reader, Selection};
//!
//! let path = std::env::temp_dir().join(format!("thetahat-table-{}.csv", std::process::id()));
//! std::fs::write(&path, "t;u;y\n0;1,5;2\n1;;3\n")?;
//! // The delimiter and the decimal comma are recognised.
//! let reader = Reader::open(&path, &Options::default())?;
//! assert_eq!(reader.names(), ["t", "u", "y"]);
//!
//! let selection = Selection { columns: vec![1, 2], time: Some(0), date: None };
//! let table = reader.read(&selection, &mut |_bytes, _of| {})?;
//! assert_eq!(table.time, Some(vec![0.0, 1.0]));
//! assert_eq!(table.columns[1], [2.0, 3.0]);
//! assert!(table.columns[0][1].is_nan()); // a missing value
//! # std::fs::remove_file(&path)?;
//!
//! // Errors say where: file, line and column.
//! let error = Reader::open(std::path::Path::new("nowhere.csv"), &Options::default()).err();
//! assert!(error.is_some_and(|error| error.to_string().starts_with("nowhere.csv: cannot be opened")));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What is understood of texts, by itself: commas, semicolons, tabs or runs of blanks between fields; quotes as in RFC
//! 4180; lines that end with LF, CR LF or CR; blank lines, and lines above the names; units below them; comments;
//! decimal commas, groups of digits and percent signs; words for off and on, and for missing values; gzip; UTF-16 with
//! a byte-order mark. Other encodings by name; times as seconds, as ISO 8601 or in a given format.
//!
//! The columns of a log of topics are called `topic.field`, and [`Reader::topics`] lists them. Columns of one topic are
//! a table like any other; of columns of several topics each has its clock in [`Table::clocks`].
//!
//! Messages name a field of [`Options`] that would help between backticks, as a command line or a notebook would call
//! it: `decimal-comma`.
//!
//! What is not done here: the order of the times is not checked, and names may repeat. The crate knows nothing of
//! models, nor of terminals.

mod blanks;
mod block;
mod clock;
#[cfg(feature = "columnar")]
mod columnar;
mod decimal;
mod dialect;
mod error;
mod formats;
mod layout;
mod lines;
mod mailbox;
#[cfg(feature = "matlab")]
mod matlab;
mod memory;
mod names;
mod names_of_times;
mod number;
mod reader;
mod record;
mod rows;
mod shape;
mod source;
#[cfg(feature = "spreadsheets")]
mod spreadsheet;
mod stream;
#[cfg(test)]
mod tests;
mod time;
#[cfg(feature = "flight-logs")]
mod topics;
mod words;
mod zone;

pub use error::{Error, ErrorKind, remedy};
pub use formats::{Reader, Stream};
pub use lines::Lines;
pub use mailbox::{Event, Waker};
pub use memory::Bound;
pub use names::{list, names};
pub use time::{Calendar, Unit};

use std::ops::Range;

/// Where a log has the names of its columns.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Header {
    /// On the last line of words above the rows, or nowhere: then they are named `1`, `2`, and so on.
    #[default]
    Recognised,
    /// On this line, counted from one.
    Line(u64),
    /// Nowhere: the first line is a row.
    None,
}

/// How a log is written, as far as it is not recognised by itself.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The byte between two fields; recognised from the first rows if it is not given. A space stands for runs of
    /// blanks and tabs.
    pub delimiter: Option<u8>,
    /// Whether numbers are written with a decimal comma; recognised from the first rows if it is not given.
    pub decimal_comma: Option<bool>,
    /// Where the names of the columns are.
    pub header: Header,
    /// How many rows below the names are left out; units are recognised.
    pub skip_rows: usize,
    /// The first character of a line that is a comment.
    pub comment: Option<u8>,
    /// Words that stand for a missing value, besides an empty field, `NaN`, `NA`, `N/A` and `null`, and besides what
    /// historians and spreadsheets write, such as `Bad` and `#N/A`. Case does not matter, and a number stands for all
    /// ways to write it.
    pub missing: Vec<String>,
    /// Words that stand for numbers, besides pairs such as `off` and `on`.
    pub values: Vec<(String, f64)>,
    /// The sheet of a spreadsheet; the first that holds numbers, if it is not given.
    pub sheet: Option<String>,
    /// The encoding of the text, if it is neither UTF-8 nor marked as UTF-16.
    pub encoding: Option<&'static encoding_rs::Encoding>,
    /// How times are written, in the manner of strptime; recognised from the first rows if it is not given.
    pub time_format: Option<String>,
    /// The time zone of dates that have none of their own, such as Europe/Berlin.
    pub time_zone: Option<String>,
    /// The unit of times that are numbers; by their name and their size if it is not given, else seconds.
    pub time_unit: Option<Unit>,
    /// What memory there is for; times count as values, too.
    pub bound: Option<Bound>,
}

impl Options {
    /// Whether the options go together; if not, a message says which do not.
    pub fn check(&self) -> Result<(), String> {
        // These bytes are part of numbers, words, quotes and line ends.
        let unusable =
            |byte: u8| !byte.is_ascii() || byte.is_ascii_alphanumeric() || b"+-.\"\r\n\0".contains(&byte);
        let shown = |byte: u8| error::quoted(&[byte]);
        match (self.delimiter, self.comment) {
            (Some(delimiter), _) if unusable(delimiter) => Err(format!(
                "{} cannot be the delimiter; use a comma, a semicolon, a tab or a space",
                shown(delimiter)
            )),
            (_, Some(comment)) if unusable(comment) || comment.is_ascii_whitespace() => {
                Err(format!("{} cannot start a comment; use # or %", shown(comment)))
            }
            (Some(delimiter), Some(comment)) if delimiter == comment => {
                Err(format!("{} cannot both delimit fields and start a comment", shown(comment)))
            }
            (Some(b','), _) if self.decimal_comma == Some(true) => {
                Err("a comma cannot be both the delimiter and the decimal comma; separate fields by ;"
                    .to_owned())
            }
            _ => self.time_zone.as_deref().map_or(Ok(()), |name| zone::Zone::of(name).map(drop)),
        }
    }

    /// The option of texts that was given, if there is one.
    #[cfg(any(feature = "columnar", feature = "flight-logs", feature = "matlab"))]
    fn of_texts(&self) -> Option<&'static str> {
        let given = [
            ("`delimiter`", self.delimiter.is_some()),
            ("`decimal-comma`", self.decimal_comma.is_some()),
            ("`no-header`", self.header == Header::None),
            ("`header-row`", matches!(self.header, Header::Line(_))),
            ("`skip-rows`", self.skip_rows > 0),
            ("`comment`", self.comment.is_some()),
            ("`missing`", !self.missing.is_empty()),
            ("`value`", !self.values.is_empty()),
            ("`encoding`", self.encoding.is_some()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }
}

/// A topic of a log of which each topic has a clock of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// How many messages it has.
    pub rows: usize,
    /// Seconds from the first message to the last.
    pub duration: f64,
    /// Its columns, among all of the log.
    pub columns: Range<usize>,
}

/// The clock of the columns of a topic.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnClock {
    /// The topic's name.
    pub topic: String,
    /// The times in seconds, rising, of a clock that all topics of the log share.
    pub time: Vec<f64>,
    /// Which of the selected columns these are.
    pub columns: Vec<usize>,
}

/// Which columns to read, by their indices, each at most once.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Selection {
    /// The columns of numbers, in the order in which they are wanted.
    pub columns: Vec<usize>,
    /// The column of times.
    pub time: Option<usize>,
    /// The column of the days that these are times of, if it is another.
    pub date: Option<usize>,
}

/// The columns of a clock.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct ClockColumns {
    /// The column of times.
    pub time: usize,
    /// The column of the days that these are times of, if it is another.
    pub date: Option<usize>,
}

impl Table {
    /// Appends the part of the same file that follows.
    pub fn extend(&mut self, part: Self) {
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
pub struct Table {
    /// The selected columns, in the selection's order; a missing value is NaN.
    pub columns: Vec<Vec<f64>>,
    /// The times in seconds: as they are if they are numbers, and since the first one if they are dates, or numbers
    /// that count from 1970 or from another day.
    pub time: Option<Vec<f64>>,
    /// The first time in ISO 8601, if it is a date.
    pub start: Option<String>,
    /// What the times are besides seconds.
    pub calendar: Calendar,
    /// The clocks of columns of several topics, which are then not all as long, and `time` is none; nothing otherwise.
    pub clocks: Vec<OwnClock>,
    /// The number of rows; of columns of several topics that of the longest.
    pub rows: usize,
    /// The line on which each row is; nothing where there are no lines.
    pub lines: Lines,
    /// What the reader should know, in plain words.
    pub words: Vec<String>,
}
