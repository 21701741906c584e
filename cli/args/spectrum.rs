//! The arguments of spectrum.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{ClockArguments, LogArguments, Names};

#[derive(Debug, Args)]
pub(crate) struct SpectrumArguments {
    /// The logs: CSV files, gzip-compressed or not, Parquet or Arrow files, or logs of flights (- for standard input);
    /// several are several experiments with one plant
    #[arg(value_name = "LOG", required = true, num_args = 1..)]
    pub(crate) paths: Vec<PathBuf>,
    /// Rows to use, 1-based and inclusive; each range is a segment of its own [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',')]
    pub(crate) rows: Vec<String>,
    /// What is taken from each channel first: none, mean, linear, start:K
    #[arg(long, default_value = "mean", value_name = "WHAT")]
    pub(crate) detrend: String,

    /// Input columns; a name that holds a comma stands between double quotes, as in CSV [default: u, u1, u2, …]
    #[arg(short = 'u', long, value_name = "NAME[,NAME…]", help_heading = "Channels")]
    pub(crate) input: Vec<Names>,
    /// Output column [default: y]
    #[arg(short = 'y', long, value_name = "NAME", help_heading = "Channels")]
    pub(crate) output: Option<String>,

    /// How the response is estimated
    #[arg(long, value_enum, default_value = "lpm", help_heading = "Method")]
    pub(crate) method: SpectrumMethodArgument,
    /// Frequencies in radians per second: a band, or for lpm and spa a list [default: all that the log has]
    #[arg(
        long,
        value_name = "LOW..HIGH|W[,W…]",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "Method"
    )]
    pub(crate) frequencies: Vec<String>,
    /// For lpm and spa: how many frequencies of the band, each the same factor above the one before [default: 200]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000), help_heading = "Method")]
    pub(crate) points: Option<u32>,
    /// For lpm: lines of the transform on either side of a frequency [default: 12 for one input, 14 for two, …]
    #[arg(long, value_name = "LINES", help_heading = "Method")]
    pub(crate) half_width: Option<usize>,
    /// For spa: lags of the Hann window [default: as many as leave the response as it is when they are doubled]
    #[arg(long, value_name = "M", help_heading = "Method")]
    pub(crate) lags: Option<usize>,
    /// For welch: rows of a window [default: a power of two, about an eighth of the log]
    #[arg(long, value_name = "ROWS", help_heading = "Method")]
    pub(crate) window: Option<usize>,
    /// For welch: h1 where the noise is in the output, h2 where it is in the input [default: h1]
    #[arg(long, value_enum, help_heading = "Method")]
    pub(crate) estimator: Option<EstimatorOfSpectraArgument>,
    /// For sines: rows of a period [default: those after which the input repeats itself]
    #[arg(long, value_name = "ROWS", help_heading = "Method")]
    pub(crate) period: Option<usize>,
    /// For sines: periods to leave out at the beginning [default: those that differ from the later ones]
    #[arg(long, value_name = "PERIODS", help_heading = "Method")]
    pub(crate) discard: Option<usize>,

    /// What to write: a table for people, a CSV of all points, or the JSON document
    #[arg(long, value_enum, default_value = "table", help_heading = "Output")]
    pub(crate) format: ResponseFormatArgument,
    /// Write it to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output"
    )]
    pub(crate) out: PathBuf,
    /// Write a page with charts to a file too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SpectrumMethodArgument {
    /// Local polynomials for response and transient
    Lpm,
    /// Blackman and Tukey: transforms of windowed covariances
    Spa,
    /// Welch: averages over windows that overlap by half
    Welch,
    /// The ratio of the transforms, unsmoothed
    Etfe,
    /// Correlation over whole periods of a stepped or a multi-sine input
    Sines,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorOfSpectraArgument {
    H1,
    H2,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ResponseFormatArgument {
    Table,
    Csv,
    Json,
}
