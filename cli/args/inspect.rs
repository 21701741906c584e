//! The arguments of inspect.

use std::path::PathBuf;

use clap::Args;

use super::{ClockArguments, EachArguments, FormatArgument, LogArguments, Names};

#[derive(Debug, Clone, Args)]
pub(crate) struct InspectArguments {
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG", required_unless_present = "list")]
    pub(crate) logs: Vec<PathBuf>,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …, if they
    /// are there]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output column [default: y, if it is there]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Channels")]
    pub(crate) output: Option<String>,

    /// What to write: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output", conflicts_with = "each")]
    pub(crate) format: FormatArgument,
    /// Write it to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output",
        conflicts_with = "each"
    )]
    pub(crate) out: PathBuf,
    /// Write a page with charts to a file too
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "each")]
    pub(crate) html: Option<PathBuf>,
    /// Read the log once, part by part, in memory that does not grow with its rows. Figures that need the whole log at
    /// once are left out, or computed from the first rows; the warnings name them
    #[arg(long, help_heading = "Output", conflicts_with_all = ["html", "resample"])]
    pub(crate) stream: bool,
    #[command(flatten)]
    pub(crate) each: EachArguments,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}
