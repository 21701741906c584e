//! What a command line means: everything resolved and checked that needs no data.

mod control;
mod filter;
mod fit;
mod inspect;
mod spectrum;
mod step;
mod template;
mod track;
mod validate;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use thetahat::data::{Interpolation, Resample, Rows};
use thetahat::respond::InitialCondition;
use thetahat::thetahat_core::nalgebra::Complex;
use thetahat_table::{Header, Unit};

use crate::args::{
    ClockArguments, LineArguments, LineFormatArgument, LiveClockArguments, LogArguments, StartArgument,
};
use crate::failure::Failure;
use crate::line_writer::Format;
use crate::memory::PerValue;

pub(crate) use control::control_plan;
pub(crate) use filter::FilterJob;
pub(crate) use fit::{Equations, FitJob};
pub(crate) use inspect::InspectJob;
pub(crate) use spectrum::SpectrumJob;
pub(crate) use step::StepTestJob;
pub(crate) use template::{TemplateOptions, TemplatesJob};
pub(crate) use track::TrackJob;
pub(crate) use validate::EvaluationJob;

/// How to read a log.
#[derive(Debug)]
pub(crate) struct LogJob {
    pub(crate) options: thetahat_table::Options,
    pub(crate) clock: Clock,
    /// What is to be done with it takes so much memory.
    pub(crate) per_value: PerValue,
    /// Whether to draw no progress.
    pub(crate) quiet: bool,
}

/// Where a log's times come from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Clock {
    /// A column of times, and how to make them uniform if they are not.
    Column { name: String, resample: Option<Resample> },
    /// A fixed sample time in seconds.
    Fixed(f64),
    /// Not given: that of the log, if it has one.
    Unknown { resample: Option<Resample> },
}

/// The one log of a verb that takes each by itself.
pub(crate) fn only<'p>(verb: &str, logs: &'p [PathBuf]) -> Result<&'p Path, Failure> {
    match logs {
        [log] => Ok(log),
        several => Err(Failure::usage(format!(
            "{verb} takes one log, and {} are named; --each --table FILE takes each by itself",
            several.len()
        ))),
    }
}

impl Clock {
    /// The column of times, if there is one.
    pub(crate) fn column(&self) -> Option<String> {
        match self {
            Self::Column { name, .. } => Some(name.clone()),
            Self::Fixed(_) | Self::Unknown { .. } => None,
        }
    }

    /// How to put the log on another clock.
    pub(crate) fn resample(&self) -> Option<Resample> {
        match self {
            Self::Column { resample, .. } | Self::Unknown { resample } => *resample,
            Self::Fixed(_) => None,
        }
    }
}

impl LogJob {
    pub(crate) fn resolve(log: &LogArguments, clock: &ClockArguments) -> Result<Self, Failure> {
        let encoding = log.encoding.as_deref().map(|label| {
            encoding_rs::Encoding::for_label(label.as_bytes()).ok_or_else(|| {
                Failure::usage(format!(
                    "--encoding {label}: no such encoding; try utf-8, latin1, windows-1252 or utf-16le"
                ))
            })
        });
        let options = thetahat_table::Options {
            delimiter: log.delimiter.as_deref().map(|text| byte("--delimiter", text)).transpose()?,
            decimal_comma: log.decimal_comma,
            header: match log.header_row {
                Some(line) => Header::Line(line),
                None if log.no_header => Header::None,
                None => Header::Recognised,
            },
            skip_rows: log.skip_rows,
            comment: log.comment.as_deref().map(|text| byte("--comment", text)).transpose()?,
            missing: log.missing.clone(),
            values: log.value.iter().map(|text| value(text)).collect::<Result<_, _>>()?,
            encoding: encoding.transpose()?,
            sheet: log.sheet.clone(),
            time_format: clock.time_format.clone(),
            time_unit: clock.time_unit.as_deref().map(unit).transpose()?,
            time_zone: clock.time_zone.clone(),
            bound: None,
        };
        options.check().map_err(Failure::usage)?;
        if clock.resample.is_some() && clock.sample_time.is_some() {
            return Err(Failure::usage(
                "--resample needs the column of times: give --time in place of --sample-time; without one, rows are evenly apart",
            ));
        }
        let seconds = |argument, value| positive(argument, value, "number of seconds");
        let resample = clock.resample.as_deref().map(resampling).transpose()?;
        if let Some(how) = &resample {
            seconds("--resample", how.step)?;
        }
        let clock = match (&clock.time, clock.sample_time) {
            (Some(name), _) => Clock::Column { name: name.clone(), resample },
            (None, Some(step)) => Clock::Fixed(seconds("--sample-time", step)?),
            (None, None) => Clock::Unknown { resample },
        };
        Ok(Self { options, clock, per_value: PerValue::Plain, quiet: false })
    }
}

impl LogJob {
    /// How to read a log as it comes, and the seconds between its rows if they were given.
    fn live(log: &LogArguments, clock: &LiveClockArguments) -> Result<(Self, Option<f64>), Failure> {
        let seconds = |value| positive("--sample-time", value, "number of seconds");
        let sample_time = clock.sample_time.map(seconds).transpose()?;
        let whole = ClockArguments {
            time: clock.time.clone(),
            time_format: clock.time_format.clone(),
            time_unit: clock.time_unit.clone(),
            time_zone: None,
            sample_time: sample_time.filter(|_| clock.time.is_none()),
            resample: None,
        };
        Ok((Self::resolve(log, &whole)?, sample_time))
    }
}

/// Output that grows line by line.
#[derive(Debug)]
pub(crate) struct LineJob {
    /// A line for each row of which the number is a multiple of this.
    pub(crate) every: u64,
    pub(crate) format: Format,
    pub(crate) out: PathBuf,
    /// Whether a malformed line ends the run.
    pub(crate) strict: bool,
    /// Whether to say nothing at the end.
    pub(crate) quiet: bool,
}

impl LineJob {
    fn resolve(arguments: &LineArguments) -> Self {
        Self {
            every: arguments.every,
            format: match arguments.format {
                LineFormatArgument::Jsonl => Format::JsonLines,
                LineFormatArgument::Csv => Format::Csv,
            },
            out: arguments.out.clone(),
            strict: arguments.strict,
            quiet: arguments.quiet,
        }
    }
}

impl StartArgument {
    /// The start, unless it is left to the model.
    pub(crate) fn given(self) -> Option<InitialCondition> {
        match self {
            Self::Auto => None,
            Self::Drop => Some(InitialCondition::Drop),
            Self::Zero => Some(InitialCondition::Zero),
            Self::Estimate => Some(InitialCondition::Estimate),
        }
    }
}

/// A number that must be positive.
fn positive(argument: &str, value: f64, what: &str) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Failure::usage(format!("{argument} {value}: not a positive {what}; give one above 0")))
}

/// Ranges of rows.
pub(crate) fn rows(argument: &str, texts: &[String]) -> Result<Vec<Rows>, Failure> {
    texts.iter().map(|text| parsed(argument, text)).collect()
}

/// An argument in the form that the library reads.
pub(crate) fn parsed<T: FromStr<Err = thetahat::Error>>(argument: &str, text: &str) -> Result<T, Failure> {
    text.parse().map_err(|error| refused(argument, &error))
}

/// What the library says of the value of an option.
fn refused(option: &str, error: &thetahat::Error) -> Failure {
    match error {
        thetahat::Error::Argument { message, .. } => Failure::usage(format!("{option}: {message}")),
        other => Failure::usage(format!("{option}: {other}")),
    }
}

/// STEP:hold or STEP:linear, and :unfiltered after it.
fn resampling(text: &str) -> Result<Resample, Failure> {
    let wrong = || {
        Failure::usage(format!(
            "--resample {text}: write it as STEP:hold, STEP:linear or STEP:auto, such as 0.5:linear; with :unfiltered after it without \
             a filter"
        ))
    };
    let (plain, anti_alias) = match text.strip_suffix(":unfiltered") {
        Some(plain) => (plain, false),
        None => (text, true),
    };
    let (step, how) = plain.rsplit_once(':').ok_or_else(wrong)?;
    let interpolation = match how {
        "hold" => Interpolation::Hold,
        "linear" => Interpolation::Linear,
        "auto" => Interpolation::Auto,
        _ => return Err(wrong()),
    };
    Ok(Resample { step: step.parse().map_err(|_| wrong())?, interpolation, anti_alias })
}

/// WORD=NUMBER.
fn value(text: &str) -> Result<(String, f64), Failure> {
    let parts =
        text.rsplit_once('=').and_then(|(word, number)| Some((word.trim(), number.trim().parse().ok()?)));
    match parts {
        Some((word, number)) if !word.is_empty() && f64::is_finite(number) => Ok((word.to_owned(), number)),
        _ => Err(Failure::usage(format!("--value {text}: write it as WORD=NUMBER, such as auto=1"))),
    }
}

/// A unit of times.
fn unit(text: &str) -> Result<Unit, Failure> {
    Unit::of(text).ok_or_else(|| {
        Failure::usage(format!("--time-unit {text}: no such unit; give one of ns, us, ms, s, min, h and d"))
    })
}

/// One ASCII character, or a name for it.
fn byte(argument: &str, text: &str) -> Result<u8, Failure> {
    match (text, text.as_bytes()) {
        ("tab" | "\\t", _) => Ok(b'\t'),
        ("comma", _) => Ok(b','),
        ("semicolon", _) => Ok(b';'),
        ("blanks", _) => Ok(b' '),
        (_, [byte]) if byte.is_ascii() => Ok(*byte),
        _ => Err(Failure::usage(format!("{argument} {text}: give one ASCII character, or tab"))),
    }
}

/// LOW..HIGH; the library says which numbers make sense.
fn range(option: &str, text: &str) -> Result<[f64; 2], Failure> {
    let ends = text
        .split_once("..")
        .and_then(|(low, high)| Some([low.trim().parse::<f64>().ok()?, high.trim().parse::<f64>().ok()?]));
    ends.ok_or_else(|| Failure::usage(format!("{option} {text}: write it as LOW..HIGH, such as 0.1..3")))
}

/// A real or complex number.
fn pole(option: &str, text: &str) -> Result<Complex<f64>, Failure> {
    let wrong = || Failure::usage(format!("{option} {text}: write a pole as 0.5 or as 0.4+0.3i"));
    let number: Complex<f64> = text.trim().parse().map_err(|_| wrong())?;
    if number.re.is_finite() && number.im.is_finite() { Ok(number) } else { Err(wrong()) }
}
