//! The arguments of design.

use std::path::PathBuf;

use clap::Args;

use super::FormatArgument;

#[derive(Debug, Args)]
pub(crate) struct DesignArguments {
    /// The signal: prbs, rbs, multisine, chirp, white, sines or steps; after a colon for how many samples each value of
    /// prbs, rbs, white or steps is held, such as prbs:4. With --for several [default: prbs, with --for all]
    #[arg(
        short = 's',
        long,
        value_name = "SIGNAL[,SIGNAL…]",
        value_delimiter = ',',
        help_heading = "Signal"
    )]
    pub(crate) signal: Vec<String>,
    /// How many samples [default: 1023, a period of a PRBS; with --for the length whose errors are told]
    #[arg(short = 'n', long, value_name = "N", help_heading = "Signal")]
    pub(crate) length: Option<usize>,
    /// The lowest and the highest value, in units of the input
    #[arg(
        long,
        value_name = "LOW..HIGH",
        default_value = "-1..1",
        allow_hyphen_values = true,
        help_heading = "Signal"
    )]
    pub(crate) range: String,
    /// A power budget: give the deviations from the middle of the range this root mean square, instead of its width
    #[arg(long, value_name = "R", allow_hyphen_values = true, help_heading = "Signal")]
    pub(crate) rms: Option<f64>,
    /// The lowest and the highest frequency of multisine, chirp and sines, in radians per second [default: all]
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true, help_heading = "Signal")]
    pub(crate) band: Option<String>,
    /// How many frequencies, each the same factor above the one before: of multisine [default: every line of the
    /// period] and sines [default: 10]
    #[arg(long, value_name = "K", help_heading = "Signal")]
    pub(crate) points: Option<usize>,
    /// Repeat the signal after this many samples [default: of prbs the longest that fits, of multisine 4096 at most,
    /// else the length]
    #[arg(long, value_name = "P", help_heading = "Signal")]
    pub(crate) period: Option<usize>,
    /// How many signals without correlation [default: 1, with --for one for each input of the model]
    #[arg(long, value_name = "M", help_heading = "Signal")]
    pub(crate) channels: Option<usize>,
    /// Seconds from one sample to the next [default: 1, with --for that of the model]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, help_heading = "Signal")]
    pub(crate) sample_time: Option<f64>,
    /// Which random signal, or where a PRBS begins
    #[arg(long, value_name = "S", default_value_t = 0, help_heading = "Signal")]
    pub(crate) seed: u64,

    /// Compare signals for this model, a report that fit wrote (- for standard input): a table of the standard errors
    /// that each would give, instead of the signal
    #[arg(long = "for", value_name = "REPORT", help_heading = "Worth")]
    pub(crate) model: Option<PathBuf>,
    /// Say how many samples it takes until these figures have these standard errors: a parameter, dc-gain or
    /// time-constant (dc-gain2 is that of the second input), absolute or in percent of its value
    #[arg(
        long,
        value_name = "FIGURE:ERROR[,…]",
        value_delimiter = ',',
        requires = "model",
        help_heading = "Worth"
    )]
    pub(crate) want: Vec<String>,

    /// How to write the comparison: a table for people, or the JSON document
    #[arg(long, value_enum, default_value = "table", requires = "model", help_heading = "Output")]
    pub(crate) format: FormatArgument,
    /// Write the power spectral density of each channel to a file too: CSV
    #[arg(long, value_name = "FILE", conflicts_with = "model", help_heading = "Output")]
    pub(crate) spectrum: Option<PathBuf>,
    /// Write to a file instead of standard output
    #[arg(
        short = 'o',
        long,
        value_name = "FILE",
        default_value = "-",
        hide_default_value = true,
        help_heading = "Output"
    )]
    pub(crate) out: PathBuf,
}
