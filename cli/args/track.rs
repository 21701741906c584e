//! The arguments of track.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use thetahat::track::Policy;

use super::{LineArguments, LiveClockArguments, LogArguments, Names};

#[derive(Debug, Args)]
pub(crate) struct TrackArguments {
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …; those
    /// of --warm]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output columns; with --model arx more than one, an equation for each [default: y; those of --warm]
    #[arg(short = 'y', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) output: Vec<Names>,
    /// Subtract this from a channel [default: 0; the offsets of --warm]
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) offset: Vec<String>,
    /// The typical magnitude of a channel; a factor of 3 does not matter [default: the largest of the first rows, from
    /// which then nothing is predicted]
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Channels")]
    pub(crate) scale: Vec<String>,

    /// The model structure [default: arx; that of --warm]
    #[arg(long, value_enum, help_heading = "Model")]
    pub(crate) model: Option<TrackModelArgument>,
    /// Coefficients of A: past outputs
    #[arg(long, value_name = "N", help_heading = "Model")]
    pub(crate) na: Option<usize>,
    /// Which past outputs an output depends on, where there are several: full, those of all; none, its own [default:
    /// full]
    #[arg(long, value_name = "full|none", conflicts_with = "narx", help_heading = "Model")]
    pub(crate) couple: Option<String>,
    /// Coefficients of B: inputs; one value for each input or one for all, 0 for a model without inputs
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nb: Vec<usize>,
    /// Coefficients of C: past disturbances
    #[arg(long, value_name = "N", help_heading = "Model")]
    pub(crate) nc: Option<usize>,
    /// Samples from input to first effect, one value for each input or one for all [default: 1]
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', help_heading = "Model")]
    pub(crate) nk: Vec<usize>,
    /// Track y(k) = g(past outputs and inputs) + e(k) instead: all products of lags up to a degree (poly). Functions
    /// that a fit has chosen come from its report, with --warm
    #[arg(
        long,
        value_enum,
        value_name = "MAP",
        conflicts_with_all = ["model", "na", "nb", "nc", "constant", "method"],
        help_heading = "Model"
    )]
    pub(crate) narx: Option<TrackMapArgument>,
    /// Past outputs that g reads: y(k-1), …, y(k-N) [default: 2]
    #[arg(long, value_name = "N", requires = "narx", help_heading = "Model")]
    pub(crate) ny: Option<usize>,
    /// Values of each input that g reads, from --nk on; one number for each input or one for all, 0 for a model without
    /// inputs [default: 2]
    #[arg(long, value_name = "N[,…]", value_delimiter = ',', requires = "narx", help_heading = "Model")]
    pub(crate) nu: Vec<usize>,
    /// Factors of a product at most [default: 2]
    #[arg(long, value_name = "D", requires = "narx", help_heading = "Model")]
    pub(crate) degree: Option<usize>,
    /// Estimate a constant too, for channels of which the offsets are not known; without --offset the first value of
    /// each is taken off
    #[arg(long, help_heading = "Model")]
    pub(crate) constant: bool,

    /// How to estimate [default: rls; with C rpem]
    #[arg(long, value_enum, help_heading = "Adaptation")]
    pub(crate) method: Option<TrackMethodArgument>,
    #[arg(
        long,
        help = policies(),
        value_name = "HOW[,HOW…]",
        value_delimiter = ',',
        default_value = "exponential:0.99",
        help_heading = "Adaptation"
    )]
    pub(crate) forgetting: Vec<String>,
    /// How to start: standard (from a wide prior), exact (without prior, once the samples determine the parameters), or
    /// mixed[:SAMPLES] (standard, then blended into exact)
    #[arg(long, value_name = "HOW", help_heading = "Adaptation")]
    pub(crate) start: Option<String>,
    /// Start from a batch fit: the report's orders, parameters, covariance, noise and offsets
    #[arg(
        long,
        value_name = "REPORT",
        conflicts_with_all = ["model", "na", "nb", "nc", "nk", "narx"],
        help_heading = "Adaptation"
    )]
    pub(crate) warm: Option<PathBuf>,
    /// Do not adapt where the innovation is smaller than this, in units of the output
    #[arg(long, value_name = "WIDTH", allow_hyphen_values = true, help_heading = "Adaptation")]
    pub(crate) dead_zone: Option<f64>,
    /// What becomes of rows whose innovations are far larger than the noise makes them: used; huber:THRESHOLD (one of
    /// more than THRESHOLD standard deviations corrects as one of so many); gate:NIS:RELEASE (above NIS, the square of
    /// that, it corrects nothing; after RELEASE in a row the next ones do). huber is huber:3, gate is gate:25:20
    /// [default: used]
    #[arg(long, value_name = "HOW", help_heading = "Adaptation")]
    pub(crate) outliers: Option<String>,

    /// Add to each row a forecast of the output this many rows later, inputs held at their last value
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = "Watch")]
    pub(crate) horizon: Option<u32>,
    /// Watch the innovations for changes of their mean and variance (CUSUM), with this many samples between two false
    /// alarms on average
    #[arg(long, value_name = "SAMPLES", allow_hyphen_values = true, help_heading = "Watch")]
    pub(crate) alarm: Option<f64>,
    /// End at the first alarm, with exit code 7
    #[arg(long, requires = "alarm", help_heading = "Watch")]
    pub(crate) stop_on_alarm: bool,
    #[command(flatten)]
    pub(crate) lines: LineArguments,

    /// Keep the estimator's whole state in a file, and go on from it if it is there
    #[arg(long, value_name = "FILE", help_heading = "State")]
    pub(crate) state: Option<PathBuf>,
    /// Write the state every N rows, besides at the end, and within 10 s where rows are slow to come
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..),
        requires = "state", help_heading = "State")]
    pub(crate) save_every: u64,
    /// Where the log stands when the state is taken up again
    #[arg(long, value_enum, default_value = "auto", requires = "state", help_heading = "State")]
    pub(crate) resume: ResumeArgument,

    #[command(flatten)]
    pub(crate) clock: LiveClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

/// The help of --forgetting.
fn policies() -> String {
    let written: Vec<String> = Policy::all_written().collect();
    format!(
        "What is forgotten, several side by side: FACTOR for exponential:FACTOR, or {}",
        written.join(", ")
    )
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrackMapArgument {
    /// Products of regressors up to a degree
    Poly,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrackModelArgument {
    /// A y = B u + e
    Arx,
    /// A y = B u + C e
    Armax,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrackMethodArgument {
    /// Recursive least squares (arx)
    Rls,
    /// Extended least squares (armax): quick, and not always right
    Els,
    /// Recursive prediction error method (armax)
    Rpem,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ResumeArgument {
    /// A file from its start; standard input from its start if its first row is the first one of the state, else now
    Auto,
    /// From the start: rows that the state has absorbed are skipped
    Start,
    /// A live pipe that has moved on: what came in between is a gap
    Now,
}
