//! The arguments of convert.

use std::path::PathBuf;

use clap::Args;

use super::FormatArgument;

#[derive(Debug, Args)]
pub(crate) struct ConvertArguments {
    /// The report that fit, reduce or convert wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The target: continuous for continuous time, or a sample time in seconds
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub(crate) to: String,
    /// What inputs do between samples: zoh (they keep their values), foh (they follow straight lines) or tustin (the
    /// bilinear transformation) [default: that of a model in continuous time, else zoh]
    #[arg(long, value_name = "HOLD")]
    pub(crate) hold: Option<String>,
    /// What to print: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,
    /// Write the report to a file (- for standard output, instead of the table)
    #[arg(short = 'o', long, value_name = "FILE", help_heading = "Output")]
    pub(crate) out: Option<PathBuf>,
}
