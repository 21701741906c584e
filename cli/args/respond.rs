//! The arguments of predict and simulate, and of impulse and bode.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{ClockArguments, LogArguments};

#[derive(Debug, Args)]
pub(crate) struct PredictArguments {
    /// Steps ahead; inf for a free run, like simulate
    #[arg(long, value_name = "K", default_value = "1", allow_hyphen_values = true)]
    pub(crate) horizon: String,
    /// The initial condition of each segment
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) initial: StartArgument,
    #[command(flatten)]
    pub(crate) respond: RespondArguments,
}

#[derive(Debug, Args)]
pub(crate) struct SimulateArguments {
    /// Keep what is fed back within 1.1 times the range of the estimation rows, and count how often (nonlinear ARX
    /// models)
    #[arg(long, conflicts_with = "draws")]
    pub(crate) clamp: bool,
    /// Draw this many runs with random noise and with parameters drawn from their covariance
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) draws: Option<u32>,
    /// The seed of the draws [default: 0]
    #[arg(long, value_name = "S", requires = "draws")]
    pub(crate) seed: Option<u64>,
    /// Write the drawn runs themselves to a file: CSV with a row for each row of the log, and a column for each draw
    #[arg(long, value_name = "FILE", requires = "draws")]
    pub(crate) draws_file: Option<PathBuf>,
    /// The initial condition of each segment
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) initial: StartArgument,
    #[command(flatten)]
    pub(crate) respond: RespondArguments,
}

#[derive(Debug, Args)]
pub(crate) struct BodeArguments {
    /// The report that fit wrote (- for standard input); with --over several
    #[arg(value_name = "REPORT", required = true, num_args = 1..)]
    pub(crate) reports: Vec<PathBuf>,
    /// Compare the models with a measured response at its frequencies: the JSON document of spectrum, or a table of
    /// points in continuous time, as fit takes it with --from
    #[arg(long, value_name = "FILE", conflicts_with_all = ["frequencies", "points"])]
    pub(crate) over: Option<PathBuf>,
    /// With --over: write a page with charts to a file too
    #[arg(long, value_name = "FILE", requires = "over")]
    pub(crate) html: Option<PathBuf>,
    /// Frequencies in radians per second [default: from a thousandth of half the sampling frequency to half of it]
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) frequencies: Option<String>,
    /// How many frequencies, each the same factor above the one before
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub(crate) points: u32,
    /// Write the CSV to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct TransientArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// How many samples, the one at time 0 included [default: until it has settled]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) samples: Option<u32>,
    /// Write the CSV to a file instead of standard output
    #[arg(short = 'o', long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub(crate) out: PathBuf,
    /// Write a page with charts to a file too
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,
}

/// What predict and simulate share.
#[derive(Debug, Args)]
pub(crate) struct RespondArguments {
    /// The report that fit wrote (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,
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

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum StartArgument {
    /// drop for models that need only a few past samples, else estimate; zero where the log has no output
    Auto,
    /// Measured samples before the rows; without them the first rows, which then do not count
    Drop,
    /// Zeros before the first sample
    Zero,
    /// The initial condition that fits best
    Estimate,
}
