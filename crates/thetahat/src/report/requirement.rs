use std::fmt;
use std::str::FromStr;

use super::{Report, Validation};
use crate::figures::{chance, fixed};
use crate::validate::Horizon;
use crate::{Error, Procedure, Structure};

/// What there is to ask for.
const WORDS: &str =
    "white, independent, stable, fit>=P, fit@K>=P and coverage>=P (P in percent, K steps ahead)";
/// The level of the intervals of which the coverage is asked.
const LEVEL: f64 = 0.95;

/// What a model must do on a log to be taken.
///
/// ```
/// use thetahat::Requirement;
///
/// let requirement: Requirement = "fit@5>=80".parse()?;
/// assert_eq!(requirement, Requirement::Fit { steps: Some(5), percent: 80.0 });
/// assert!("fast".parse::<Requirement>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Requirement {
    /// `white`: Ljung and Box's test does not reject white residuals.
    White,
    /// `independent`: no test says that residuals depend on a past input. The level is shared among the inputs (Bonferroni).
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
    /// `coverage>=P`: the 95 % intervals one step ahead hold at least so many of the measured outputs.
    Coverage {
        /// Of all samples.
        percent: f64,
    },
}

impl FromStr for Requirement {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = || {
            let shown: String = text.chars().take(60).collect();
            Error::argument("require", format!("'{shown}' is none of {WORDS}"))
        };
        let text = text.trim();
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
                let steps = what.strip_prefix("fit@").and_then(|steps| steps.parse().ok());
                let steps = steps.filter(|steps| *steps > 0).ok_or_else(wrong)?;
                Ok(Self::Fit { steps: Some(steps), percent })
            }
        }
    }
}

impl fmt::Display for Requirement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::White => f.write_str("white"),
            Self::Independent => f.write_str("independent"),
            Self::Stable => f.write_str("stable"),
            Self::Fit { steps: None, percent } => write!(f, "fit>={percent}"),
            Self::Fit { steps: Some(steps), percent } => write!(f, "fit@{steps}>={percent}"),
            Self::Coverage { percent } => write!(f, "coverage>={percent}"),
        }
    }
}

impl Requirement {
    /// Whether it can be asked of a model at all.
    ///
    /// # Errors
    /// [`Error::Argument`] for white residuals of a model that says nothing of the noise, and for independence of
    /// inputs that there are not.
    pub fn check(&self, report: &Report) -> Result<(), Error> {
        let refused = |message: &str| Err(Error::argument("require", message));
        let kind = match report.estimation.procedure {
            Procedure::InstrumentalVariables { .. } | Procedure::RefinedInstrumentalVariables { .. } => {
                Some("fitted by instrumental variables")
            }
            _ if report.model.structure == Structure::Oe => Some("of output error"),
            _ => None,
        };
        match (self, kind) {
            (Self::White, Some(kind)) => refused(&format!(
                "white: a model {kind} says nothing of the noise, and its residuals need not be white; ask for \
                 independent"
            )),
            (Self::Independent, _) if report.model.orders.nb.iter().all(|&nb| nb == 0) => {
                refused("independent: the model has no inputs; ask for white")
            }
            _ => Ok(()),
        }
    }

    /// What is missing, in words with the figure; none where it is met. What cannot be told is not met. Tests reject below
    /// `alpha`.
    pub fn unmet(&self, validation: &Validation, alpha: f64) -> Option<String> {
        let residuals = validation.residuals.as_ref();
        let untested = || format!("{self}: the residuals could not be tested");
        match *self {
            Self::White => match residuals.map(|residuals| residuals.ljung_box.p_value) {
                Some(Some(p)) if p >= alpha => None,
                Some(Some(p)) => {
                    Some(format!("{self}: the p-value of Ljung-Box is {}, below {alpha}", chance(p)))
                }
                _ => Some(untested()),
            },
            Self::Independent => {
                let Some(residuals) = residuals else { return Some(untested()) };
                let each = &residuals.independence;
                let level = alpha / each.len().max(1) as f64;
                let failed: Vec<String> = each
                    .iter()
                    .filter_map(|test| match test.past.p_value {
                        Some(p) if p >= level => None,
                        Some(p) => Some(format!("'{}' has p-value {}, below {level}", test.input, chance(p))),
                        None => Some(format!("'{}' is constant, it could not be tested", test.input)),
                    })
                    .collect();
                match (each.is_empty(), failed.is_empty()) {
                    (true, _) => Some(untested()),
                    (false, true) => None,
                    (false, false) => Some(format!("{self}: {}", failed.join(", "))),
                }
            }
            Self::Stable => (!validation.stable).then(|| format!("{self}: the model has a pole outside")),
            Self::Fit { steps, percent } => {
                let driven = validation.orders.nb.iter().any(|&nb| nb > 0);
                let horizon = match steps {
                    None if driven => Horizon::FreeRun,
                    steps => Horizon::Steps { steps: steps.unwrap_or(1) },
                };
                let fit = validation.fit.iter().find(|fit| fit.horizon == horizon);
                match fit.and_then(|fit| fit.percent) {
                    Some(found) if found >= percent => None,
                    Some(found) => Some(format!("{self}: the fit is {} % ({horizon})", fixed(found, 3))),
                    None => Some(format!("{self}: there is no fit figure ({horizon})")),
                }
            }
            Self::Coverage { percent } => {
                let one = validation.coverage.iter().find(|one| one.steps == 1 && one.level == LEVEL);
                match one.and_then(|one| one.actual).map(|actual| 100.0 * actual) {
                    Some(actual) if actual >= percent => None,
                    Some(actual) => Some(format!(
                        "{self}: the 95 % intervals one step ahead hold {} % of the outputs",
                        fixed(actual, 2)
                    )),
                    None => Some(format!("{self}: no interval could be told")),
                }
            }
        }
    }
}
