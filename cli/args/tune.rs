//! The arguments of tune.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::FormatArgument;

#[derive(Debug, Args)]
pub(crate) struct TuneArguments {
    /// The report that fit wrote of a process (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The input that the controller moves [default: the only one]
    #[arg(short = 'u', long, value_name = "NAME")]
    pub(crate) input: Option<String>,
    /// The time constant that the closed loop shall have, tau_c or lambda, in seconds [default: the dead time by SIMC, the longer of lag and
    /// dead time by lambda tuning]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) lambda: Option<f64>,
    /// Which controller [default: both]
    #[arg(long, value_enum, value_name = "pi|pid")]
    pub(crate) controller: Option<ControllerArgument>,
    /// What to print: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table")]
    pub(crate) format: FormatArgument,
    /// Write the JSON document to a file
    #[arg(long, value_name = "FILE")]
    pub(crate) document: Option<PathBuf>,
    /// Write the closed-loop responses to a CSV file
    #[arg(long, value_name = "FILE")]
    pub(crate) responses: Option<PathBuf>,
    /// Write a page with charts to a file: one file of HTML that needs nothing else (- for standard output)
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,
    /// Write the table, or the document, to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ControllerArgument {
    /// Proportional and integral
    Pi,
    /// With a derivative too
    Pid,
}
