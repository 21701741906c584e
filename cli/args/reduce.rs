//! The arguments of reduce.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
pub(crate) struct ReduceArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// States to keep; without it the Hankel singular values are shown, and an error bound for each number of states
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) order: Option<u32>,
    /// Write the report of the reduced model, or the table, to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
}
