//! The arguments of tune.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::ClosedLoopArguments;

#[derive(Debug, Args)]
pub(crate) struct TuneArguments {
    /// The report that fit wrote of a process (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The input that the controller moves [default: the only one]
    #[arg(short = 'u', long, value_name = "NAME")]
    pub(crate) input: Option<String>,
    /// The wanted time constant of the closed loop, tau_c or lambda, in seconds [default: the dead time by SIMC,
    /// the longer of lag and dead time by lambda tuning]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) lambda: Option<f64>,
    /// Which controller [default: both]
    #[arg(long, value_enum, value_name = "pi|pid")]
    pub(crate) controller: Option<ControllerArgument>,
    /// Write a page with charts to a file: HTML that needs no other files (- for standard output)
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) outputs: ClosedLoopArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ControllerArgument {
    /// Proportional and integral
    Pi,
    /// With a derivative too
    Pid,
}
