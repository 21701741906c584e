//! The arguments of export.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use thetahat::export::{Language, Precision, Purpose};

use super::{ClockArguments, LogArguments};

#[derive(Debug, Args)]
pub(crate) struct ExportArguments {
    /// The report that fit wrote, or for a controller the document of control (- for standard input)
    #[arg(value_name = "REPORT")]
    pub(crate) report: PathBuf,
    /// A log for a test vector: a CSV file, gzip-compressed or not, a Parquet or an Arrow file, or the log of a flight
    /// (- for standard input)
    #[arg(value_name = "LOG")]
    pub(crate) path: Option<PathBuf>,
    /// The language
    #[arg(long, value_enum, value_name = "LANGUAGE")]
    pub(crate) to: LanguageArgument,
    /// What to make of the model
    #[arg(long, value_enum, value_name = "WHAT")]
    pub(crate) what: PurposeArgument,
    /// The precision of all numbers
    #[arg(long, value_enum, value_name = "PRECISION", default_value = "f32")]
    pub(crate) precision: PrecisionArgument,
    /// The name of files, types and functions [default: the name of the report's file and the value of --what]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Rows of the test vector, 1-based and inclusive [default: all]
    #[arg(long, value_name = "A..B[,C..D]", value_delimiter = ',', requires = "path")]
    pub(crate) rows: Vec<String>,
    /// The folder to write to
    #[arg(short = 'o', long, value_name = "FOLDER", default_value = ".")]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) clock: ClockArguments,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum LanguageArgument {
    /// A module of Rust without a heap
    Rust,
    /// A header and a source of C99 without a heap
    C,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum PurposeArgument {
    /// Predicts the next output from earlier measurements
    Predictor,
    /// Runs freely, driven by the inputs alone
    Simulator,
    /// Estimates the state
    Observer,
    /// Estimates the parameters recursively, starting from the fit
    Recursive,
    /// Computes the input from set point and output
    Controller,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum PrecisionArgument {
    /// Single
    F32,
    /// Double
    F64,
}

impl From<LanguageArgument> for Language {
    fn from(argument: LanguageArgument) -> Self {
        match argument {
            LanguageArgument::Rust => Self::Rust,
            LanguageArgument::C => Self::C,
        }
    }
}

impl From<PurposeArgument> for Purpose {
    fn from(argument: PurposeArgument) -> Self {
        match argument {
            PurposeArgument::Predictor => Self::Predictor,
            PurposeArgument::Simulator => Self::Simulator,
            PurposeArgument::Observer => Self::Observer,
            PurposeArgument::Recursive => Self::Recursive,
            PurposeArgument::Controller => Self::Controller,
        }
    }
}

impl From<PrecisionArgument> for Precision {
    fn from(argument: PrecisionArgument) -> Self {
        match argument {
            PrecisionArgument::F32 => Self::F32,
            PrecisionArgument::F64 => Self::F64,
        }
    }
}

impl ExportArguments {
    /// What is asked for.
    pub(crate) fn plan(&self) -> thetahat::export::Plan {
        let purpose = Purpose::from(self.what);
        let stem = self.report.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let stem = stem.filter(|stem| stem != "-").unwrap_or_else(|| "model".to_owned());
        let name = self.name.clone().unwrap_or_else(|| format!("{}_{}", identifier(&stem), purpose.word()));
        thetahat::export::Plan { language: self.to.into(), purpose, precision: self.precision.into(), name }
    }
}

/// A name that languages take, made of that of a file: `Motor 2` as `motor_2`.
fn identifier(stem: &str) -> String {
    let letter =
        |letter: char| if letter.is_ascii_alphanumeric() { letter.to_ascii_lowercase() } else { '_' };
    let name: String = stem.chars().take(40).map(letter).collect();
    if name.starts_with(|letter: char| letter.is_ascii_lowercase()) { name } else { format!("model_{name}") }
}
