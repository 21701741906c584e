//! The arguments of validate and compare.

use std::path::PathBuf;

use clap::Args;
use thetahat::report::ValidationOptions;

use super::{ClockArguments, EachArguments, FormatArgument, LogArguments, OptionArguments};

#[derive(Debug, Clone, Args)]
pub(crate) struct ValidateArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG", required_unless_present = "list")]
    pub(crate) logs: Vec<PathBuf>,
    /// The requirements of the model: white, independent, stable, fit>=P (percent, free run), fit@K>=P (K steps ahead),
    /// mean-error<=E and largest-error<=E (of |e| in units of the output, free run), mean-error@K<=E,
    /// largest-error@K<=E, coverage>=P (of the 95 % intervals); exit code 6 if it does not
    #[arg(long, value_name = "WHAT[,WHAT…]", value_delimiter = ',', help_heading = "Tests")]
    pub(crate) require: Vec<String>,
    #[command(flatten)]
    pub(crate) each: EachArguments,
    #[command(flatten)]
    pub(crate) evaluation: EvaluationArguments,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct CompareArguments {
    /// The reports that fit wrote (- for standard input)
    #[arg(value_name = "REPORT", required = true, num_args = 1..)]
    pub(crate) reports: Vec<PathBuf>,
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG", required = true)]
    pub(crate) path: PathBuf,
    /// Also compare the models with a measured frequency response, the JSON document of spectrum: the number of its
    /// points that each model misses
    #[arg(long, value_name = "RESPONSE")]
    pub(crate) over: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) evaluation: EvaluationArguments,
}

/// What validate and compare share.
#[derive(Debug, Clone, Args)]
pub(crate) struct EvaluationArguments {
    #[command(flatten)]
    pub(crate) options: OptionArguments<ValidationOptions>,
    /// What to print: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,
    /// Write the JSON document to a file (- for standard output, instead of the table)
    #[arg(short = 'o', long, value_name = "FILE", help_heading = "Output")]
    pub(crate) out: Option<PathBuf>,
    /// Write a page with charts to a file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}
