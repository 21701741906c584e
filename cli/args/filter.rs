//! The arguments of filter.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{LineArguments, LiveClockArguments, LogArguments};

#[derive(Debug, Args)]
pub(crate) struct FilterArguments {
    /// The model: a report of fit, or a TOML file with matrices or equations (- for standard input)
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,
    /// The log: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight (- for standard
    /// input)
    #[arg(value_name = "LOG")]
    pub(crate) path: PathBuf,

    /// How to estimate [default: kalman for a linear model, else ekf]
    #[arg(long, value_enum, help_heading = "Estimator")]
    pub(crate) estimator: Option<EstimatorArgument>,
    /// Where the model of a report starts [default: unknown]
    #[arg(long, value_enum, value_name = "START", help_heading = "Estimator")]
    pub(crate) initial: Option<FilterStartArgument>,
    /// Standard deviation of white noise in what is measured, in units of each output, beside the noise of the report
    /// (nonlinear ARX) [default: 0]
    #[arg(
        long,
        value_name = "SD[,SD…]",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "Estimator"
    )]
    pub(crate) measurement_noise: Vec<f64>,
    /// Bounds of noises as so many standard deviations, for a model that says no bounds (bounded)
    #[arg(long, value_name = "K", allow_hyphen_values = true, help_heading = "Estimator")]
    pub(crate) deviations: Option<f64>,
    /// Write the model, one in matrices, with the noises of which the log is most likely, instead of lines; they begin
    /// at those of the model
    #[arg(
        long,
        value_enum,
        value_name = "STRUCTURE",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "diagonal",
        conflicts_with_all = [
            "estimator",
            "initial",
            "measurement_noise",
            "smooth",
            "summary",
            "every",
            "format",
            "deviations",
            "poles",
            "gain",
        ],
        help_heading = "Noises"
    )]
    pub(crate) fit_noise: Option<NoiseArgument>,
    /// The poles of the error of the observer in the z plane, such as 0.4+0.3i,0.4-0.3i
    #[arg(
        long,
        value_name = "POLE[,POLE…]",
        value_delimiter = ',',
        allow_hyphen_values = true,
        conflicts_with = "gain",
        help_heading = "Estimator"
    )]
    pub(crate) poles: Vec<String>,
    /// The gain of the observer: a row for each state, a column for each output, such as 0.5,0;0.1,0.2
    #[arg(long, value_name = "ROW[;ROW…]", allow_hyphen_values = true, help_heading = "Estimator")]
    pub(crate) gain: Option<String>,
    /// Rows to go through, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B", help_heading = "Channels")]
    pub(crate) rows: Option<String>,
    /// Add the smoothed states, estimated from the whole log. Lines are then written at the end of the log only, and
    /// none after Ctrl-C
    #[arg(long, help_heading = "Output")]
    pub(crate) smooth: bool,

    #[command(flatten)]
    pub(crate) lines: LineArguments,
    #[command(flatten)]
    pub(crate) clock: LiveClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum NoiseArgument {
    /// The variances of Q and R
    Diagonal,
    /// All entries of Q and R
    Full,
    /// Two factors, of the Q and R of the model
    Scaled,
    /// R and K of w = K v
    Innovations,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FilterStartArgument {
    /// At rest: the channels are at their offsets
    Zero,
    /// Unknown: it is estimated from the first rows
    Unknown,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorArgument {
    /// The Kalman filter (linear models)
    Kalman,
    /// The extended Kalman filter; unknown parameters are estimated with the state
    Ekf,
    /// The extended Kalman filter with iterated corrections, for accurate measurements of what bends
    Iekf,
    /// The unscented Kalman filter: as ekf, and its deviations know how the model bends
    Ukf,
    /// A set in which the state is for certain while noises keep their bounds (linear models)
    Bounded,
    /// The Luenberger observer, with --poles or --gain
    Luenberger,
}
