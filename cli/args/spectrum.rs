//! The arguments of spectrum.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use thetahat::spectrum::SpectrumOptions;

use super::{ClockArguments, LogArguments, OptionArguments};

#[derive(Debug, Args)]
pub(crate) struct SpectrumArguments {
    /// The logs: CSV files, gzip-compressed or not, Parquet or Arrow files, or logs of flights (- for standard input);
    /// several are several experiments with one plant
    #[arg(value_name = "LOG", required = true, num_args = 1..)]
    pub(crate) paths: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) options: OptionArguments<SpectrumOptions>,

    /// What to write: a table for people, a CSV of all points, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: ResponseFormatArgument,
    /// Write it to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output"
    )]
    pub(crate) out: PathBuf,
    /// Write a page with charts to a file too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ResponseFormatArgument {
    Table,
    Csv,
    Json,
}
