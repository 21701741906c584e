//! What is written of a controller and its loop.

use std::path::PathBuf;

use clap::Args;

use super::FormatArgument;

#[derive(Debug, Args)]
pub(crate) struct ClosedLoopArguments {
    /// What to print: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table")]
    pub(crate) format: FormatArgument,
    /// Write the JSON document to a file
    #[arg(long, value_name = "FILE")]
    pub(crate) document: Option<PathBuf>,
    /// Write the closed-loop responses to a CSV file
    #[arg(long, value_name = "FILE")]
    pub(crate) responses: Option<PathBuf>,
    /// Write the table, or the document, to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
}

impl ClosedLoopArguments {
    /// The files that it writes.
    pub(crate) fn written(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.out].into_iter().chain(&self.document).chain(&self.responses)
    }
}
