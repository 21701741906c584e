//! The arguments of model.

use std::path::PathBuf;

use clap::Args;
use thetahat::model::KnownOptions;

use super::{FormatArgument, OptionArguments};

#[derive(Debug, Args)]
pub(crate) struct ModelArguments {
    #[command(flatten)]
    pub(crate) options: OptionArguments<KnownOptions>,
    /// Write the JSON report to a file (- for standard output, instead of the table)
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) report: Option<PathBuf>,
    /// What to print: a table for people, or the JSON report
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,
}
