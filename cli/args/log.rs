//! The arguments that say how a log is read: its channels, format and clock.

use std::str::FromStr;

use clap::Args;

/// The clock of a log that is read as it comes.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Clock")]
pub(crate) struct LiveClockArguments {
    /// The column of times: seconds, ISO 8601 dates, or the timestamps and durations of a Parquet or Arrow file
    #[arg(long, value_name = "NAME")]
    pub(crate) time: Option<String>,
    /// How times are written, in the manner of strptime, such as %d.%m.%Y %H:%M:%S
    #[arg(long, value_name = "FORMAT", requires = "time")]
    pub(crate) time_format: Option<String>,
    /// The unit of times that are numbers: ns, us, ms, s, min, h or d [default: by the name and the size of the times,
    /// else s]
    #[arg(long, value_name = "UNIT", requires = "time")]
    pub(crate) time_unit: Option<String>,
    /// Seconds from one row to the next [default: that of the model; for track with --time, the first step]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) sample_time: Option<f64>,
}

/// A list of names, written as the header of a CSV with commas is.
#[derive(Debug, Clone)]
pub(crate) struct Names(Vec<String>);

impl FromStr for Names {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        thetahat_table::names(text).map(Self)
    }
}

impl Names {
    /// The names of all lists; none if there is no list.
    pub(crate) fn all(lists: &[Self]) -> Option<Vec<String>> {
        (!lists.is_empty()).then(|| lists.iter().flat_map(|Self(names)| names).cloned().collect())
    }
}

/// How a log is written.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub(crate) struct LogArguments {
    /// What separates fields: a character, tab, or blanks for runs of them [default: recognised among comma, semicolon,
    /// tab and blanks]
    #[arg(long, value_name = "CHAR", help_heading = "Log format")]
    pub(crate) delimiter: Option<String>,
    /// Numbers have a decimal comma, or =no, a point [default: recognised by the first rows]
    #[arg(
        long,
        value_name = "yes|no",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "yes",
        value_parser = clap::builder::BoolishValueParser::new(),
        help_heading = "Log format"
    )]
    pub(crate) decimal_comma: Option<bool>,
    /// The line with the names of the columns; lines above it are ignored [default: the last line of words above the
    /// rows]
    #[arg(long, value_name = "LINE", conflicts_with = "no_header", help_heading = "Log format")]
    pub(crate) header_row: Option<u64>,
    /// The first row is data; columns are called 1, 2, …
    #[arg(long, help_heading = "Log format")]
    pub(crate) no_header: bool,
    /// Leave out this many rows below the names; units are recognised
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        help_heading = "Log format"
    )]
    pub(crate) skip_rows: usize,
    /// Lines that start with this character are comments
    #[arg(long, value_name = "CHAR", help_heading = "Log format")]
    pub(crate) comment: Option<String>,
    /// A further word for a missing value, besides empty fields, NaN, NA, N/A, null, and the words of historians and
    /// spreadsheets
    #[arg(long, value_name = "TOKEN", allow_hyphen_values = true, help_heading = "Log format")]
    pub(crate) missing: Vec<String>,
    /// A word that stands for a number, such as auto=1, besides words for off and on
    #[arg(long, value_name = "WORD=NUMBER", allow_hyphen_values = true, help_heading = "Log format")]
    pub(crate) value: Vec<String>,
    /// The sheet of a spreadsheet [default: the first that holds numbers]
    #[arg(long, value_name = "NAME", help_heading = "Log format")]
    pub(crate) sheet: Option<String>,
    /// The text's encoding, such as latin1 [default: UTF-8, or what a byte-order mark says]
    #[arg(long, value_name = "NAME", help_heading = "Log format")]
    pub(crate) encoding: Option<String>,
}

/// The log's clock.
#[derive(Debug, Clone, Args)]
pub(crate) struct ClockArguments {
    /// The column of times: numbers, dates, or the timestamps and durations of a Parquet or Arrow file; two columns, of
    /// dates and of times of day, as DATE,TIME [default: the one column that is a clock by its name and its values]
    #[arg(long, value_name = "NAME", conflicts_with = "sample_time", help_heading = "Clock")]
    pub(crate) time: Option<String>,
    /// How times are written, in the manner of strptime, such as %d.%m.%Y %H:%M:%S [default: recognised]
    #[arg(long, value_name = "FORMAT", conflicts_with = "sample_time", help_heading = "Clock")]
    pub(crate) time_format: Option<String>,
    /// The unit of times that are numbers: ns, us, ms, s, min, h or d [default: by the name and the size of the times,
    /// else s]
    #[arg(long, value_name = "UNIT", conflicts_with = "sample_time", help_heading = "Clock")]
    pub(crate) time_unit: Option<String>,
    /// The time zone of dates without one, such as Europe/Berlin, for logs across a change to or from summer time
    #[arg(long, value_name = "ZONE", conflicts_with = "sample_time", help_heading = "Clock")]
    pub(crate) time_zone: Option<String>,
    /// Seconds from one row to the next [default: by the clock; without one 1, so that times count rows]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, help_heading = "Clock")]
    pub(crate) sample_time: Option<f64>,
    /// Put a log on another clock: a step in seconds, and how values between samples are read; auto holds channels that
    /// move in steps. A step of two recorded ones or more is filtered against aliasing first, unless :unfiltered is
    /// added or the clock is irregular
    #[arg(
        long,
        value_name = "STEP:hold|linear|auto[:unfiltered]",
        allow_hyphen_values = true,
        help_heading = "Clock"
    )]
    pub(crate) resample: Option<String>,
}
