//! The arguments of fit.

use std::path::PathBuf;

use clap::Args;
use thetahat::plan::FitOptions;

use super::{
    ClockArguments, EachArguments, FormatArgument, LogArguments, OptionArguments, TemplateOptionArguments,
};

#[derive(Debug, Clone, Args)]
pub(crate) struct FitArguments {
    /// The logs: CSV files, gzip-compressed or not, Parquet or Arrow files, or logs of flights (- for standard input)
    #[arg(value_name = "LOG", required_unless_present_any = ["from", "list", "grey"])]
    pub(crate) logs: Vec<PathBuf>,
    /// Fit a process (--structure, --np), a model in state space (--model ss) or equations (--grey) to a frequency
    /// response instead of logs: the document that spectrum wrote (- for standard input), or a table of points in
    /// continuous time, such as an impedance spectrum with columns of frequency in Hz and real and imaginary part, or
    /// magnitude and phase (--columns)
    #[arg(
        long,
        value_name = "RESPONSE",
        conflicts_with_all = ["logs", "each", "html", "ClockArguments"]
    )]
    pub(crate) from: Option<PathBuf>,
    /// The frequencies of the response that are fitted to, in rad/s [default: all]
    #[arg(long, value_name = "LOW..HIGH", requires = "from", allow_hyphen_values = true)]
    pub(crate) frequencies: Option<String>,

    #[command(flatten)]
    pub(crate) options: OptionArguments<FitOptions>,
    /// Fit the unknown parameters of a model in equations (TOML, see filter) by the largest likelihood; channels go by
    /// name, the clock may be irregular. template:NAME is a plant that is ready, with start values from the log:
    /// thetahat templates lists them
    #[arg(long, value_name = "MODEL", help_heading = "Model")]
    pub(crate) grey: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) template: TemplateOptionArguments,
    /// Take the options from a plan in JSON, or from a report, whose fit is then repeated; options on the command line
    /// replace those of the plan
    #[arg(long, value_name = "FILE", help_heading = "Model")]
    pub(crate) plan: Option<PathBuf>,

    /// Write a page with charts to a file: HTML that needs no other files (- for standard output)
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "each")]
    pub(crate) html: Option<PathBuf>,
    /// Write the JSON report to a file (- for standard output, instead of the table)
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "each")]
    pub(crate) report: Option<PathBuf>,
    /// What to print: a table for people, or the JSON report
    #[arg(long, value_enum, default_value = "table", help_heading = "Output", conflicts_with = "each")]
    pub(crate) format: FormatArgument,
    /// Read the logs once, part by part, in memory that does not grow with their rows: the same parameters, of an ARX
    /// or AR model of given orders, an impulse response, a state-space model without --refine, or a nonlinear ARX model
    /// of products (--narx poly with --term, --terms or --select mdl). With several outputs orders may be ranges.
    /// Figures that need a second pass, those of free runs and of held-out rows, are left out
    #[arg(long, help_heading = "Output", conflicts_with_all = ["html", "grey", "from", "resample"])]
    pub(crate) stream: bool,
    #[command(flatten)]
    pub(crate) each: EachArguments,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}
