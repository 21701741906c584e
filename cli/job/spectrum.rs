use std::path::{Path, PathBuf};

use thetahat::spectrum::{Estimator, Frequencies, Method, SpectrumPlan};

use super::{LogJob, parsed, rows};
use crate::args::{EstimatorOfSpectraArgument, Names, SpectrumArguments, SpectrumMethodArgument};
use crate::failure::Failure;

/// A response to estimate from logs.
#[derive(Debug)]
pub(crate) struct SpectrumJob {
    pub(crate) paths: Vec<PathBuf>,
    pub(crate) log: LogJob,
    /// Named inputs; none: those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// The named output; none: y.
    pub(crate) output: Option<String>,
    /// All but the channels.
    plan: SpectrumPlan,
}

impl SpectrumJob {
    pub(crate) fn resolve(arguments: &SpectrumArguments) -> Result<Self, Failure> {
        if arguments.paths.iter().filter(|path| path.as_path() == Path::new("-")).count() > 1 {
            return Err(Failure::usage("only one of the logs can come from standard input (-)"));
        }
        let job = Self {
            paths: arguments.paths.clone(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            inputs: Names::all(&arguments.input),
            output: arguments.output.clone(),
            plan: SpectrumPlan {
                rows: rows("--rows", &arguments.rows)?,
                detrend: parsed("--detrend", &arguments.detrend)?,
                method: method(arguments)?,
                frequencies: frequencies(arguments)?,
                ..SpectrumPlan::new(&[], "")
            },
        };
        // What needs no log is said before it is read.
        let names = job.inputs.clone().unwrap_or_else(|| vec![String::new()]);
        job.plan(names, job.output.clone().unwrap_or_else(|| "y".to_owned()))?;
        Ok(job)
    }

    /// The plan for a log with these channels.
    pub(crate) fn plan(&self, inputs: Vec<String>, output: String) -> Result<SpectrumPlan, Failure> {
        let plan = SpectrumPlan { inputs, output, ..self.plan.clone() };
        plan.check().map_err(|error| Failure::option(&error))?;
        Ok(plan)
    }
}

/// The method, with its own options and no others.
fn method(arguments: &SpectrumArguments) -> Result<Method, Failure> {
    use SpectrumMethodArgument::{Etfe, Lpm, Sines, Spa, Welch};
    let SpectrumArguments { half_width, lags, window, period, discard, .. } = *arguments;
    let given = [
        ("half-width", half_width.is_some(), Lpm, "lpm"),
        ("lags", lags.is_some(), Spa, "spa"),
        ("window", window.is_some(), Welch, "welch"),
        ("estimator", arguments.estimator.is_some(), Welch, "welch"),
        ("period", period.is_some(), Sines, "sines"),
        ("discard", discard.is_some(), Sines, "sines"),
    ];
    let foreign = given.iter().find(|(_, given, method, _)| *given && *method != arguments.method);
    if let Some((option, _, _, method)) = foreign {
        return Err(Failure::usage(format!(
            "--{option} is for --method {method}: leave it out, or take that method"
        )));
    }
    Ok(match arguments.method {
        Lpm => Method::Lpm { half_width },
        Spa => Method::Spa { lags },
        Welch => {
            let estimator = match arguments.estimator {
                Some(EstimatorOfSpectraArgument::H2) => Estimator::H2,
                _ => Estimator::H1,
            };
            Method::Welch { window, estimator }
        }
        Etfe => Method::Etfe,
        Sines => Method::Sines { period, discard },
    })
}

/// LOW..HIGH, or a list.
fn frequencies(arguments: &SpectrumArguments) -> Result<Frequencies, Failure> {
    let texts = &arguments.frequencies;
    let points = arguments.points.map(|points| points as usize);
    let wrong = || {
        Failure::usage(format!(
            "--frequencies {}: write a band as LOW..HIGH, or a list as W,W,…, in radians per second above 0",
            texts.join(",")
        ))
    };
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    match texts.as_slice() {
        [] if points.is_some() => {
            Err(Failure::usage("--points is for a band: give it with --frequencies LOW..HIGH"))
        }
        [] => Ok(Frequencies::All),
        [band] if band.contains("..") => {
            let (low, high) = band.split_once("..").ok_or_else(wrong)?;
            let (low, high) = number(low).zip(number(high)).ok_or_else(wrong)?;
            Ok(Frequencies::Between { low, high, points })
        }
        _ if points.is_some() => {
            Err(Failure::usage("--points is for a band: --frequencies names each frequency already"))
        }
        list => Ok(Frequencies::At(
            list.iter().map(|text| number(text).ok_or_else(wrong)).collect::<Result<_, _>>()?,
        )),
    }
}
