//! The arguments of track.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use thetahat::track::TrackOptions;

use super::{LineArguments, LiveClockArguments, LogArguments, OptionArguments};

#[derive(Debug, Args)]
pub(crate) struct TrackArguments {
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,

    #[command(flatten)]
    pub(crate) options: OptionArguments<TrackOptions>,
    /// Start from a batch fit: the report's orders, parameters, covariance, noise and offsets
    #[arg(long, value_name = "REPORT", help_heading = "Adaptation")]
    pub(crate) warm: Option<PathBuf>,
    /// End at the first alarm, with exit code 7
    #[arg(long, requires = "alarm", help_heading = "Watch")]
    pub(crate) stop_on_alarm: bool,
    #[command(flatten)]
    pub(crate) lines: LineArguments,

    /// Keep the estimator's whole state in a file, and continue from it if the file exists
    #[arg(long, value_name = "FILE", help_heading = "State")]
    pub(crate) state: Option<PathBuf>,
    /// Write the state every N rows, at the latest after 10 s, and at the end
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..),
        requires = "state", help_heading = "State")]
    pub(crate) save_every: u64,
    /// Where the log begins when the run continues from a state
    #[arg(long, value_enum, default_value = "auto", requires = "state", help_heading = "State")]
    pub(crate) resume: ResumeArgument,

    #[command(flatten)]
    pub(crate) clock: LiveClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ResumeArgument {
    /// A file from its start; standard input from its start if its first row is the first one of the state, else now
    Auto,
    /// At its start: rows that the state has already used are skipped
    Start,
    /// At the present, in a live pipe: the rows in between are a gap
    Now,
}
