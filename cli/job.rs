//! What a command line means: everything resolved and checked that needs no data.

use std::path::PathBuf;
use std::str::FromStr;

use thetahat::{Detrend, Initial, Interpolation, Orders, Rows, Start};

use crate::args::{ClockArguments, FitArguments, InitialArgument, LogArguments, StartArgument};
use crate::failure::Failure;
use crate::table;

/// A log to read.
#[derive(Debug)]
pub(crate) struct LogJob {
    pub(crate) path: PathBuf,
    pub(crate) options: table::Options,
    pub(crate) clock: Clock,
}

/// Where a log's times come from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Clock {
    /// A column of times, and how to make them uniform if they are not.
    Column { name: String, resample: Option<(f64, Interpolation)> },
    /// A fixed sample time in seconds.
    Fixed(f64),
    /// Not given.
    Unknown,
}

/// A model to fit.
#[derive(Debug)]
pub(crate) struct FitJob {
    pub(crate) log: LogJob,
    /// Named inputs; none: those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// The named output; none: y.
    pub(crate) output: Option<String>,
    pub(crate) estimate: Vec<Rows>,
    pub(crate) validate: Vec<Rows>,
    pub(crate) detrend: Detrend,
    pub(crate) offsets: Vec<(String, f64)>,
    pub(crate) na: usize,
    pub(crate) nb: Vec<usize>,
    pub(crate) nk: Vec<usize>,
    pub(crate) initial: Initial,
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
        let options = table::Options {
            delimiter: log.delimiter.as_deref().map(|text| byte("--delimiter", text)).transpose()?,
            decimal_comma: log.decimal_comma,
            header: !log.no_header,
            skip_rows: log.skip_rows,
            comment: log.comment.as_deref().map(|text| byte("--comment", text)).transpose()?,
            missing: log.missing.clone(),
            encoding: encoding.transpose()?,
            time_format: clock.time_format.clone(),
        };
        options.check().map_err(Failure::usage)?;
        let positive = |argument: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(value);
            }
            Err(Failure::usage(format!("{argument} {value}: not a positive number of seconds")))
        };
        let clock = match (&clock.time, clock.sample_time) {
            (Some(name), _) => {
                let resample = clock.resample.as_deref().map(resampling).transpose()?;
                if let Some((step, _)) = resample {
                    positive("--resample", step)?;
                }
                Clock::Column { name: name.clone(), resample }
            }
            (None, Some(seconds)) => Clock::Fixed(positive("--sample-time", seconds)?),
            (None, None) => Clock::Unknown,
        };
        Ok(Self { path: log.log.clone(), options, clock })
    }
}

impl FitJob {
    pub(crate) fn resolve(arguments: &FitArguments) -> Result<Self, Failure> {
        let inputs = (!arguments.input.is_empty()).then(|| arguments.input.clone());
        let offsets = arguments.offset.iter().map(|text| {
            text.rsplit_once('=')
                .and_then(|(name, value)| Some((name.to_owned(), value.trim().parse::<f64>().ok()?)))
                .filter(|(_, value)| value.is_finite())
                .ok_or_else(|| {
                    Failure::usage(format!("--offset {text}: write it as NAME=VALUE, such as u=4.5"))
                })
        });
        let job = Self {
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            inputs,
            output: arguments.output.clone(),
            estimate: rows("--estimate", &arguments.estimate)?,
            validate: rows("--validate", &arguments.validate)?,
            detrend: parsed("--detrend", &arguments.detrend)?,
            offsets: offsets.collect::<Result<_, _>>()?,
            na: arguments.na,
            nb: arguments.nb.clone(),
            nk: arguments.nk.clone(),
            initial: match arguments.initial {
                InitialArgument::Drop => Initial::Drop,
                InitialArgument::Zero => Initial::Zero,
            },
        };
        for (position, (name, _)) in job.offsets.iter().enumerate() {
            if job.offsets[..position].iter().any(|(other, _)| other == name) {
                return Err(Failure::usage(format!("--offset: '{name}' has two; give one")));
            }
        }
        if let Some(inputs) = &job.inputs {
            job.orders(inputs.len())?;
        }
        if job.is_autoregression() && job.inputs.is_some() {
            return Err(Failure::usage(
                "--nb 0 makes a model without inputs; leave out --input, or give orders above 0",
            ));
        }
        Ok(job)
    }

    /// Whether the model has no inputs at all.
    pub(crate) fn is_autoregression(&self) -> bool {
        self.nb.iter().all(|&nb| nb == 0)
    }

    /// The orders for so many inputs: one value stands for all of them.
    pub(crate) fn orders(&self, inputs: usize) -> Result<Orders, Failure> {
        let each = |argument: &str, values: &[usize]| match values {
            [one] => Ok(vec![*one; inputs]),
            several if several.len() == inputs => Ok(several.to_vec()),
            several => Err(Failure::usage(format!(
                "{argument} has {} values for {inputs} inputs; give one for each, or one for all",
                several.len()
            ))),
        };
        let inputs = (each("--nb", &self.nb)?, each("--nk", &self.nk)?);
        Orders::arx(self.na, &inputs.0, &inputs.1).map_err(|error| Failure::usage(error.to_string()))
    }
}

impl From<StartArgument> for Start {
    fn from(start: StartArgument) -> Self {
        match start {
            StartArgument::Zero => Self::Zero,
            StartArgument::Measured => Self::Measured,
            StartArgument::Estimated => Self::Estimated,
        }
    }
}

/// Ranges of rows.
pub(crate) fn rows(argument: &str, texts: &[String]) -> Result<Vec<Rows>, Failure> {
    texts.iter().map(|text| parsed(argument, text)).collect()
}

/// An argument in the form that the library reads.
pub(crate) fn parsed<T: FromStr<Err = thetahat::Error>>(argument: &str, text: &str) -> Result<T, Failure> {
    text.parse().map_err(|error: thetahat::Error| match error {
        thetahat::Error::Argument { message, .. } => Failure::usage(format!("{argument}: {message}")),
        other => Failure::usage(format!("{argument}: {other}")),
    })
}

/// STEP:hold or STEP:linear.
fn resampling(text: &str) -> Result<(f64, Interpolation), Failure> {
    let wrong = || {
        Failure::usage(format!("--resample {text}: write it as STEP:hold or STEP:linear, such as 0.5:linear"))
    };
    let (step, how) = text.rsplit_once(':').ok_or_else(wrong)?;
    let interpolation = match how {
        "hold" => Interpolation::Hold,
        "linear" => Interpolation::Linear,
        _ => return Err(wrong()),
    };
    Ok((step.parse().map_err(|_| wrong())?, interpolation))
}

/// One ASCII character, or a name for it.
fn byte(argument: &str, text: &str) -> Result<u8, Failure> {
    match (text, text.as_bytes()) {
        ("tab" | "\\t", _) => Ok(b'\t'),
        ("comma", _) => Ok(b','),
        ("semicolon", _) => Ok(b';'),
        (_, [byte]) if byte.is_ascii() => Ok(*byte),
        _ => Err(Failure::usage(format!("{argument} {text}: give one ASCII character, or tab"))),
    }
}
