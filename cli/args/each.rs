//! The arguments of verbs that take many logs, each by itself.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Many logs")]
pub(crate) struct EachArguments {
    /// Take each LOG by itself, on all cores: --table gets a row for each, and a log that fails gets a row with the
    /// reason. LOG may be a pattern between quotes, such as 'logs/*.csv' or 'logs/**/*.csv'
    #[arg(long, requires = "table")]
    pub(crate) each: bool,
    /// Take the logs or patterns that a file names too, one a line (- for standard input)
    #[arg(long, value_name = "FILE", requires = "each")]
    pub(crate) list: Option<PathBuf>,
    /// Write the table as CSV to a file (- for standard output)
    #[arg(long, value_name = "FILE", requires = "each")]
    pub(crate) table: Option<PathBuf>,
    /// Write the JSON document of each log into a folder, which is created. A later run with the same options takes the
    /// documents of unchanged logs from there, so that it continues a run that was interrupted
    #[arg(long, value_name = "FOLDER", requires = "each")]
    pub(crate) reports: Option<PathBuf>,
    /// How many threads to use; the results do not depend on it [default: the number of cores]
    #[arg(long, value_name = "N", requires = "each", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
}
