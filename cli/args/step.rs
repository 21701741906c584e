//! The arguments of step.

use std::path::PathBuf;

use clap::Args;

use super::{ClockArguments, FormatArgument, LogArguments};

#[derive(Debug, Args)]
pub(crate) struct StepArguments {
    /// The log of a step test (CSV, gzip-compressed or not, Parquet or Arrow), the report that fit wrote, or the JSON
    /// document of spectrum (- for standard input); a file that begins with { is a document
    #[arg(value_name = "FILE")]
    pub(crate) path: PathBuf,

    /// Of a report: how many samples, the one at time 0 included [default: until it has settled]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000), help_heading = "Model")]
    pub(crate) samples: Option<u32>,
    /// Of a report: the impulse response, as the verb impulse
    #[arg(long, help_heading = "Model")]
    pub(crate) impulse: bool,

    /// Of a log: rows to use, 1-based and inclusive; each range is a segment of its own [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Log")]
    pub(crate) rows: Vec<String>,
    /// Of a log, or of the document of spectrum: the input [default: u, or the only one]
    #[arg(short = 'u', long, value_name = "NAME", help_heading = "Log")]
    pub(crate) input: Option<String>,
    /// Of a log: the output column [default: y]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Log")]
    pub(crate) output: Option<String>,

    /// Of a log: what to write, a table for people or the JSON document [default: table]
    #[arg(long, value_enum, help_heading = "Output")]
    pub(crate) format: Option<FormatArgument>,
    /// Write it, or the CSV of a model, to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output"
    )]
    pub(crate) out: PathBuf,
    /// Of a log: write the JSON document to a file too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) report: Option<PathBuf>,
    /// Write a page with charts to a file too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}
