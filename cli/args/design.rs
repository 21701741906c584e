//! The arguments of design.

use std::path::PathBuf;

use clap::Args;
use thetahat::design::DesignOptions;

use super::{FormatArgument, OptionArguments};

#[derive(Debug, Args)]
pub(crate) struct DesignArguments {
    #[command(flatten)]
    pub(crate) options: OptionArguments<DesignOptions>,
    /// Compare signals for this model, a report that fit wrote (- for standard input): a table of the standard errors
    /// that each would give, instead of the signal
    #[arg(long = "for", value_name = "REPORT", help_heading = "Worth")]
    pub(crate) model: Option<PathBuf>,

    /// How to write the comparison: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", requires = "model", help_heading = "Output")]
    pub(crate) format: FormatArgument,
    /// Write the power spectral density of each channel to a file too: CSV
    #[arg(long, value_name = "FILE", conflicts_with = "model", help_heading = "Output")]
    pub(crate) spectrum: Option<PathBuf>,
    /// Write to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output"
    )]
    pub(crate) out: PathBuf,
}
