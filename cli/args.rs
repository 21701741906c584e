//! The syntax of the command line, and nothing else. `job` says what it means.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  2  usage: the command line does not make sense
  3  bad data: the log or the report does not hold what was asked of it
  4  the data cannot determine the model
  5  input/output: a file cannot be read or written";

/// Identifies dynamic systems from logged data.
#[derive(Debug, Parser)]
#[command(name = "thetahat", version, about, after_help = EXIT_CODES, arg_required_else_help = true)]
#[command(help_template = "{about-with-newline}\n{usage-heading} {usage}\n\n{all-args}{after-help}\n")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fit a model to a log
    ///
    /// Fits A(q) y(t) = B(q) u(t - nk) + e(t) by least squares, prints a table and writes a JSON report.
    #[command(after_help = "\
Examples:
  thetahat fit log.csv --sample-time 0.08 --na 2 --nb 2 --nk 3 --report model.json
  thetahat fit log.csv --time t -u heater -y temperature --validate 501..1000 --na 2 --nb 2
  thetahat fit sunspots.csv -y count --na 2 --nb 0")]
    Fit(FitArguments),
    /// Predict a log some steps ahead with a fitted model
    ///
    /// Writes CSV: time or row, measured, predicted, in the log's own units. The fit figures go to standard error.
    #[command(after_help = "\
Example:
  thetahat predict model.json log.csv --horizon 5 > predicted.csv")]
    Predict(PredictArguments),
    /// Simulate a fitted model on a log's inputs (free run)
    ///
    /// Writes CSV: time or row, measured, predicted, in the log's own units. The fit figures go to standard error.
    /// Without the output column, the run starts from zero.
    #[command(after_help = "\
Example:
  thetahat simulate model.json log.csv --rows 501..1000 > simulated.csv")]
    Simulate(SimulateArguments),
    /// Fit a sample log of a DC motor, carried inside the program
    ///
    /// Writes the log and the report of its fit into a folder and prints the table.
    #[command(after_help = "\
Example:
  thetahat demo")]
    Demo(DemoArguments),
    /// Print the JSON Schema of reports
    #[command(after_help = "\
Example:
  thetahat schema > thetahat.report.schema.json")]
    Schema,
    /// Print shell completions
    #[command(after_help = "\
Example:
  thetahat completions bash > ~/.local/share/bash-completion/completions/thetahat")]
    Completions {
        /// The shell to complete in
        shell: clap_complete::Shell,
    },
    /// Print the manual page of thetahat, or of one verb
    #[command(after_help = "\
Example:
  thetahat man fit | man -l -")]
    Man {
        /// The verb
        verb: Option<String>,
    },
}

#[derive(Debug, Args)]
pub(crate) struct FitArguments {
    /// Input columns [default: u, u1, u2, …]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) input: Vec<String>,
    /// Output column [default: y]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Channels")]
    pub(crate) output: Option<String>,
    /// Rows to estimate on, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) estimate: Vec<String>,
    /// Rows to validate on
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', help_heading = "Channels")]
    pub(crate) validate: Vec<String>,
    /// What to take from each channel: none, mean, linear, or start:K (the mean of the first K rows)
    #[arg(long, default_value = "mean", value_name = "WHAT", help_heading = "Channels")]
    pub(crate) detrend: String,
    /// Set a channel's offset by hand
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) offset: Vec<String>,

    /// The model structure
    #[arg(long, value_enum, default_value = "arx", help_heading = "Model")]
    pub(crate) model: ModelArgument,
    /// Past outputs in the model: coefficients of A
    #[arg(long, value_name = "N", help_heading = "Model")]
    pub(crate) na: usize,
    /// Inputs in the model: coefficients of B, one value for each input or one for all; 0 gives AR
    #[arg(long, value_name = "N[,N…]", value_delimiter = ',', required = true, help_heading = "Model")]
    pub(crate) nb: Vec<usize>,
    /// Samples from input to first effect, one value for each input or one for all; 0: the input acts at once
    #[arg(long, value_name = "N[,N…]", value_delimiter = ',', default_value = "1", help_heading = "Model")]
    pub(crate) nk: Vec<usize>,
    /// Samples without a full regressor: left out, or completed with zeros
    #[arg(long, value_enum, default_value = "drop", help_heading = "Model")]
    pub(crate) initial: InitialArgument,

    /// Write the JSON report to a file (- for standard output, instead of the table)
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) report: Option<PathBuf>,
    /// What to print: a table for people, or the JSON report
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: FormatArgument,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct PredictArguments {
    /// Steps ahead; inf for a free run, like simulate
    #[arg(long, value_name = "K", default_value = "1", allow_hyphen_values = true)]
    pub(crate) horizon: String,
    /// What the prediction starts from [default: measured; with --horizon inf as for simulate]
    #[arg(long, value_enum)]
    pub(crate) initial: Option<StartArgument>,
    #[command(flatten)]
    pub(crate) respond: RespondArguments,
}

#[derive(Debug, Args)]
pub(crate) struct SimulateArguments {
    /// What the run starts from [default: estimated; zero if the log has no output]
    #[arg(long, value_enum)]
    pub(crate) initial: Option<StartArgument>,
    #[command(flatten)]
    pub(crate) respond: RespondArguments,
}

/// What predict and simulate share.
#[derive(Debug, Args)]
pub(crate) struct RespondArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// Rows to respond to, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',')]
    pub(crate) rows: Vec<String>,
    /// Offsets: the model's own, or none, mean, linear, start:K of the rows responded to
    #[arg(long, default_value = "model", value_name = "WHAT")]
    pub(crate) detrend: String,
    /// Write the CSV to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct DemoArguments {
    /// The folder to write to
    #[arg(default_value = "thetahat-demo")]
    pub(crate) folder: PathBuf,
}

/// Where a log is and how it is written.
#[derive(Debug, Args)]
pub(crate) struct LogArguments {
    /// The log: a CSV file, gzip-compressed or not (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) log: PathBuf,
    /// What separates fields: a character, or tab [default: recognised among comma, semicolon and tab]
    #[arg(long, value_name = "CHAR", help_heading = "Log format")]
    pub(crate) delimiter: Option<String>,
    /// Numbers have a decimal comma
    #[arg(long, help_heading = "Log format")]
    pub(crate) decimal_comma: bool,
    /// The first row is data; columns are called 1, 2, …
    #[arg(long, help_heading = "Log format")]
    pub(crate) no_header: bool,
    /// Leave out so many rows below the header, such as a row of units
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        help_heading = "Log format"
    )]
    pub(crate) skip_rows: usize,
    /// Lines that start with this character are comments
    #[arg(long, value_name = "CHAR", help_heading = "Log format")]
    pub(crate) comment: Option<String>,
    /// One more word that stands for a missing value, besides empty fields, NaN, NA, N/A and null
    #[arg(long, value_name = "TOKEN", allow_hyphen_values = true, help_heading = "Log format")]
    pub(crate) missing: Vec<String>,
    /// The text's encoding, such as latin1 [default: UTF-8, or what a byte-order mark says]
    #[arg(long, value_name = "NAME", help_heading = "Log format")]
    pub(crate) encoding: Option<String>,
}

/// The log's clock.
#[derive(Debug, Args)]
pub(crate) struct ClockArguments {
    /// The column of times: seconds, or ISO 8601 dates
    #[arg(long, value_name = "NAME", conflicts_with = "sample_time", help_heading = "Clock")]
    pub(crate) time: Option<String>,
    /// How times are written, in the manner of strptime, such as %d.%m.%Y %H:%M:%S
    #[arg(long, value_name = "FORMAT", requires = "time", help_heading = "Clock")]
    pub(crate) time_format: Option<String>,
    /// Seconds from one row to the next [default: 1, so that times count rows]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, help_heading = "Clock")]
    pub(crate) sample_time: Option<f64>,
    /// Make a log with an irregular clock uniform: a step in seconds, and how values between samples are read
    #[arg(
        long,
        value_name = "STEP:hold|linear",
        requires = "time",
        allow_hyphen_values = true,
        help_heading = "Clock"
    )]
    pub(crate) resample: Option<String>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum ModelArgument {
    /// A y = B u + e
    Arx,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum InitialArgument {
    Drop,
    Zero,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum StartArgument {
    /// Rest: zeros before the first sample
    Zero,
    /// Measured samples before the rows, or the first rows, which then do not count
    Measured,
    /// The initial condition that fits best
    Estimated,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArgument {
    Table,
    Json,
}
