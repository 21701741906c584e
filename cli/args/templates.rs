//! The arguments of templates, and those of a fit of one.

use std::path::PathBuf;

use clap::Args;

use super::{ClockArguments, LogArguments, Names};

/// What a template is told of a log.
#[derive(Debug, Clone, Args)]
pub(crate) struct TemplateOptionArguments {
    /// Which column is which, of a template: ROLE=COLUMN, such as current=I_batt,voltage=U; or of a table that --from
    /// reads, with the roles hz, rad/s, re, im, -im, magnitude, db, phase (degrees) and sd [default: by their names]
    #[arg(long, value_name = "ROLE=COLUMN", help_heading = "Model")]
    pub(crate) columns: Vec<Names>,
    /// What is known of parameters, and of the numbers that a template takes as known: NAME=VALUE, such as
    /// capacity=33.4
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Model")]
    pub(crate) known: Vec<Names>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct TemplatesArguments {
    /// The template
    pub(crate) name: Option<String>,
    /// Logs that start values are found from (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) template: TemplateOptionArguments,
    /// The rows that are fitted to, such as 1..500, from which start values are found [default: all]
    #[arg(long, value_name = "ROWS", help_heading = "Model")]
    pub(crate) estimate: Vec<String>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}
