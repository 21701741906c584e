//! The arguments of output that grows line by line: that of track and filter.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// Output that grows line by line.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct LineArguments {
    /// Write a line for each N-th row only; track always writes lines with alarms or gaps
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) every: u64,
    /// The format of a line
    #[arg(long, value_enum, default_value = "jsonl")]
    pub(crate) format: LineFormatArgument,
    /// Write to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
    /// End the run at a line that is no row of numbers; without this option it counts as a row of missing values
    #[arg(long)]
    pub(crate) strict: bool,
    /// Write the final results to a file, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) summary: Option<PathBuf>,
    /// Print no table at the end
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LineFormatArgument {
    /// JSON Lines: an object a line
    Jsonl,
    /// CSV: a row a line, below a header
    Csv,
}
