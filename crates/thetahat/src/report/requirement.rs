use std::fmt;
use std::str::FromStr;

use super::{Coverage, Report, Validation};
use crate::Error;
use crate::figures::{chance, fixed, number};
use crate::respond::Horizon;
use crate::validate::{Fit, Residuals};

/// What there is to ask for.
const WORDS: &str = "white, independent, stable, fit>=P, fit@K>=P, coverage>=P (P in percent, K steps ahead), mean-error<=E, \
     largest-error<=E, mean-error@K<=E and largest-error@K<=E (E in units of the output); of one output with its name between brackets, \
     such as fit[y2]>=P";
/// The level of the intervals of which the coverage is asked.
const LEVEL: f64 = 0.95;

/// What a model must do on a log to be taken: of all its outputs, or of one.
///
/// ```
/// use thetahat::report::{Demand, Requirement};
///
/// let requirement: Requirement = "fit@5>=80".parse()?;
/// assert_eq!(requirement.demand, Demand::Fit { steps: Some(5), percent: 80.0 });
/// assert_eq!("fit[y2]>=70".parse::<Requirement>()?.output.as_deref(), Some("y2"));
/// assert!("fast".parse::<Requirement>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Requirement {
    /// What is asked.
    pub demand: Demand,
    /// The output it is asked of, written between brackets behind the first word, such as `fit[y2]@5>=80`; none: of
    /// each.
    pub output: Option<String>,
}

impl From<Demand> for Requirement {
    fn from(demand: Demand) -> Self {
        Self { demand, output: None }
    }
}

/// What is asked of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Demand {
    /// `white`: Ljung and Box's test does not reject white residuals.
    White,
    /// `independent`: no test says that residuals depend on a past input. The level is shared among the inputs
    /// (Bonferroni).
    Independent,
    /// `stable`: all poles lie inside the unit circle.
    Stable,
    /// `fit>=P`, `fit@K>=P`: at least so close.
    Fit {
        /// How many steps ahead; none: the free run, or one step for a model without inputs.
        steps: Option<usize>,
        /// 100 is perfect.
        percent: f64,
    },
    /// `mean-error<=E`, `mean-error@K<=E`: the mean of |e| is at most so large.
    MeanError {
        /// As for a fit.
        steps: Option<usize>,
        /// In units of the output.
        limit: f64,
    },
    /// `largest-error<=E`, `largest-error@K<=E`: no |e| is larger.
    LargestError {
        /// As for a fit.
        steps: Option<usize>,
        /// In units of the output.
        limit: f64,
    },
    /// `coverage>=P`: the 95 % intervals one step ahead hold at least P % of the measured outputs.
    Coverage {
        /// Of all samples.
        percent: f64,
    },
}

impl FromStr for Requirement {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        // A name may hold any sign: it ends with the last bracket.
        let Some((before, (name, behind))) =
            text.split_once('[').and_then(|(before, rest)| Some((before, rest.rsplit_once(']')?)))
        else {
            return Ok(Self { demand: text.parse()?, output: None });
        };
        let demand: Demand = format!("{before}{behind}").parse()?;
        if demand == Demand::Stable {
            return Err(Error::argument(
                "require",
                "a model is stable as a whole; ask for stable without an output",
            ));
        }
        Ok(Self { demand, output: Some(name.to_owned()) })
    }
}

impl FromStr for Demand {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = || {
            let shown: String = text.chars().take(60).collect();
            Error::argument("require", format!("'{shown}' is none of {WORDS}"))
        };
        let text = text.trim();
        if let Some((what, limit)) = text.split_once("<=") {
            let limit = limit.trim().parse().ok().filter(|limit: &f64| limit.is_finite() && *limit >= 0.0);
            let limit = limit.ok_or_else(wrong)?;
            let (what, steps) = match what.trim().split_once('@') {
                Some((what, steps)) => (what, Some(ahead(steps).ok_or_else(wrong)?)),
                None => (what.trim(), None),
            };
            return match what {
                "mean-error" => Ok(Self::MeanError { steps, limit }),
                "largest-error" => Ok(Self::LargestError { steps, limit }),
                _ => Err(wrong()),
            };
        }
        let Some((what, percent)) = text.split_once(">=") else {
            return match text {
                "white" => Ok(Self::White),
                "independent" => Ok(Self::Independent),
                "stable" => Ok(Self::Stable),
                _ => Err(wrong()),
            };
        };
        let percent: f64 = percent.trim().parse().map_err(|_| wrong())?;
        if !(percent.is_finite() && percent <= 100.0) {
            return Err(Error::argument(
                "require",
                format!("'{text}': no fit and no coverage is above 100 %; ask for less"),
            ));
        }
        match what.trim() {
            "fit" => Ok(Self::Fit { steps: None, percent }),
            "coverage" => Ok(Self::Coverage { percent }),
            what => {
                let steps = what.strip_prefix("fit@").and_then(ahead).ok_or_else(wrong)?;
                Ok(Self::Fit { steps: Some(steps), percent })
            }
        }
    }
}

/// A number of steps ahead.
fn ahead(text: &str) -> Option<usize> {
    text.parse().ok().filter(|steps| *steps > 0)
}

impl fmt::Display for Requirement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(output) = &self.output else { return self.demand.fmt(f) };
        let demand = self.demand.to_string();
        let end = demand.find(['@', '>', '<']).unwrap_or(demand.len());
        write!(f, "{}[{output}]{}", &demand[..end], &demand[end..])
    }
}

impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::White => f.write_str("white"),
            Self::Independent => f.write_str("independent"),
            Self::Stable => f.write_str("stable"),
            Self::Fit { steps: None, percent } => write!(f, "fit>={percent}"),
            Self::Fit { steps: Some(steps), percent } => write!(f, "fit@{steps}>={percent}"),
            Self::MeanError { steps: None, limit } => write!(f, "mean-error<={limit}"),
            Self::MeanError { steps: Some(steps), limit } => write!(f, "mean-error@{steps}<={limit}"),
            Self::LargestError { steps: None, limit } => write!(f, "largest-error<={limit}"),
            Self::LargestError { steps: Some(steps), limit } => write!(f, "largest-error@{steps}<={limit}"),
            Self::Coverage { percent } => write!(f, "coverage>={percent}"),
        }
    }
}

impl Requirement {
    /// How many steps ahead it looks, where it says so.
    pub fn steps(&self) -> Option<usize> {
        self.demand.steps()
    }

    /// Whether the requirement applies to this model.
    ///
    /// # Errors
    /// [`Error::Argument`] for white residuals of a model that says nothing of the noise, for independence of inputs
    /// that there are not, and for an output that the model does not have.
    pub fn check(&self, report: &Report) -> Result<(), Error> {
        let names = || report.model.outputs().iter().map(|output| output.name.as_str());
        if let Some(output) = &self.output
            && !names().any(|name| name == output)
        {
            let names: Vec<&str> = names().collect();
            return Err(Error::argument(
                "require",
                format!("{self}: the model has no output '{output}'; it has {}", names.join(", ")),
            ));
        }
        self.demand.check(report)
    }

    /// What is missing, in words with the figure; none where it is met. What cannot be told is not met. Tests reject
    /// below `alpha`.
    pub fn unmet(&self, validation: &Validation, alpha: f64) -> Option<String> {
        let Some(name) = &self.output else {
            return self.demand.missing(validation, alpha).map(|missing| format!("{self}: {missing}"));
        };
        let mut own = validation.clone();
        own.fit.retain(|fit| fit.output == *name);
        own.noise.retain(|noise| noise.output == *name);
        own.coverage.retain(|coverage| coverage.output == *name);
        own.residuals.retain(|residuals| residuals.output == *name);
        self.demand.missing(&own, alpha).map(|missing| format!("{self}: {missing}"))
    }
}

impl Demand {
    /// How many steps ahead it looks, where it says so.
    fn steps(&self) -> Option<usize> {
        match self {
            Self::Fit { steps, .. } | Self::MeanError { steps, .. } | Self::LargestError { steps, .. } => {
                *steps
            }
            _ => None,
        }
    }

    fn check(&self, report: &Report) -> Result<(), Error> {
        let refused = |message: &str| Err(Error::argument("require", message));
        let silent = if report.estimation.procedure.is_instrumental() {
            Some("a model fitted by instrumental variables".to_owned())
        } else {
            (!report.model.describes_noise()).then(|| report.model.name())
        };
        match (self, silent) {
            (Self::White, Some(model)) => refused(&format!(
                "white: {model} says nothing of the noise, and its residuals need not be white; ask for independent"
            )),
            (Self::Independent, _) if !report.model.is_driven() => {
                refused("independent: the model has no inputs; ask for white")
            }
            (Self::Stable, _) if report.model.stability().is_some() => Ok(()),
            (Self::Stable, _) => report.model.polynomials("stable: a pole").map(|_| ()),
            _ => Ok(()),
        }
    }

    /// What is missing, in words.
    fn missing(&self, validation: &Validation, alpha: f64) -> Option<String> {
        // One word for each output that lacks something.
        let several = validation.noise.len() > 1;
        let of = |output: &str| if several { format!("'{output}': ") } else { String::new() };
        let untested = || Some("the residuals could not be tested".to_owned());
        let tested_all = validation.residuals.len() >= validation.noise.len().max(1);
        let failed: Vec<String> = match *self {
            Self::White | Self::Independent if !tested_all => return untested(),
            Self::White => validation
                .residuals
                .iter()
                .filter_map(|residuals| match residuals.ljung_box.p_value {
                    Some(p) if p >= alpha => None,
                    Some(p) => Some(format!(
                        "{}the p-value of Ljung-Box is {}, below {alpha}",
                        of(&residuals.output),
                        chance(p)
                    )),
                    None => Some(format!("{}the residuals could not be tested", of(&residuals.output))),
                })
                .collect(),
            Self::Independent => {
                let each = || {
                    let of_output = |one: &'_ Residuals| (one.output.clone(), one.independence.clone());
                    validation.residuals.iter().map(of_output)
                };
                if each().any(|(_, tests)| tests.is_empty()) {
                    return untested();
                }
                each()
                    .flat_map(|(output, tests)| {
                        let level = alpha / tests.len() as f64;
                        let of = of(&output);
                        let failed = tests.into_iter().filter_map(move |test| match test.past.p_value {
                            Some(p) if p >= level => None,
                            Some(p) => {
                                Some(format!("{of}'{}' has p-value {}, below {level}", test.input, chance(p)))
                            }
                            None => Some(format!("{of}'{}' is constant, it could not be tested", test.input)),
                        });
                        failed.collect::<Vec<_>>()
                    })
                    .collect()
            }
            Self::Stable => {
                let outside = validation.stable != Some(true);
                outside.then(|| "the model has a pole outside".to_owned()).into_iter().collect()
            }
            Self::Fit { steps, percent } => {
                let (fits, horizon) = figures(validation, steps);
                let unmet = |fit: Option<&Fit>| match fit.and_then(|fit| fit.percent) {
                    Some(found) if found >= percent => None,
                    Some(found) => Some(format!("the fit is {} % ({horizon})", fixed(found, 3))),
                    None => Some(format!("there is no fit figure ({horizon})")),
                };
                of_fits(&fits, of, unmet)
            }
            Self::MeanError { steps, limit } => {
                let (fits, horizon) = figures(validation, steps);
                of_fits(&fits, of, |fit| {
                    above(limit, "mean |e|", fit.and_then(|fit| fit.mean_absolute_error), horizon)
                })
            }
            Self::LargestError { steps, limit } => {
                let (fits, horizon) = figures(validation, steps);
                of_fits(&fits, of, |fit| {
                    above(limit, "largest |e|", fit.and_then(|fit| fit.largest_error), horizon)
                })
            }
            Self::Coverage { percent } => {
                let asked = |one: &&Coverage| one.steps == 1 && one.level == LEVEL;
                let each: Vec<&Coverage> = validation.coverage.iter().filter(asked).collect();
                if each.is_empty() {
                    return Some("no interval could be told".to_owned());
                }
                each.iter()
                    .filter_map(|one| match one.actual.map(|actual| 100.0 * actual) {
                        Some(actual) if actual >= percent => None,
                        Some(actual) => Some(format!(
                            "{}the 95 % intervals one step ahead hold {} % of the outputs",
                            of(&one.output),
                            fixed(actual, 2)
                        )),
                        None => Some(format!("{}no interval could be told", of(&one.output))),
                    })
                    .collect()
            }
        };
        (!failed.is_empty()).then(|| failed.join(", "))
    }
}

/// What is missing of an error that has a limit.
fn above(limit: f64, what: &str, found: Option<f64>, horizon: Horizon) -> Option<String> {
    match found {
        Some(found) if found <= limit => None,
        Some(found) => Some(format!("the {what} is {} ({horizon})", number(found))),
        None => Some(format!("there is no {what} ({horizon})")),
    }
}

/// What is missing of each figure; where there is none, that.
fn of_fits(
    fits: &[&Fit],
    of: impl Fn(&str) -> String,
    unmet: impl Fn(Option<&Fit>) -> Option<String>,
) -> Vec<String> {
    if fits.is_empty() {
        return unmet(None).into_iter().collect();
    }
    let each = fits.iter().filter_map(|fit| Some(format!("{}{}", of(&fit.output), unmet(Some(fit))?)));
    each.collect()
}

/// The figures this many steps ahead, of each output; without a number of the free run, or one step ahead of a model
/// without inputs.
fn figures(validation: &Validation, steps: Option<usize>) -> (Vec<&Fit>, Horizon) {
    let horizon = match steps {
        None if validation.driven => Horizon::FreeRun,
        steps => Horizon::Steps { steps: steps.unwrap_or(1) },
    };
    (validation.fit.iter().filter(|fit| fit.horizon == horizon).collect(), horizon)
}
