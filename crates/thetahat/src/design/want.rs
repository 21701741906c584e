//! What somebody wants to know of a plant, and how well.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::model::PolynomialModel;

/// A figure of a model, and the standard error that it may have at most. Written `a1:0.01`, or `dc-gain:2%` for a
/// fraction of the figure's value.
///
/// ```
/// use thetahat::design::{Limit, Want};
///
/// let want: Want = "dc-gain:2%".parse()?;
/// assert_eq!((want.figure.as_str(), want.limit), ("dc-gain", Limit::Percent(2.0)));
/// assert_eq!("a1:0.01".parse::<Want>()?.limit, Limit::Absolute(0.01));
/// assert!("a1".parse::<Want>().is_err() && "a1:0".parse::<Want>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Want {
    /// The name of a parameter, such as `a1`; `dc-gain` or `time-constant`, with a number after it where there are
    /// several: of the input, or of the pole.
    pub figure: String,
    /// Its standard error at most.
    pub limit: Limit,
}

/// How large a standard error may be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// In units of the figure.
    Absolute(f64),
    /// In percent of its value.
    Percent(f64),
}

impl FromStr for Want {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = || {
            let shown: String = text.chars().take(60).collect();
            Error::argument(
                "want",
                format!("'{shown}': write a figure and its standard error, such as a1:0.01 or dc-gain:2%"),
            )
        };
        let (figure, limit) = text.trim().split_once(':').ok_or_else(wrong)?;
        let number =
            |text: &str| text.trim().parse().ok().filter(|limit: &f64| limit.is_finite() && *limit > 0.0);
        let limit = match limit.strip_suffix('%') {
            Some(percent) => number(percent).map(Limit::Percent),
            None => number(limit).map(Limit::Absolute),
        };
        let figure = Some(figure.trim()).filter(|figure| !figure.is_empty()).ok_or_else(wrong)?;
        Ok(Self { figure: figure.to_owned(), limit: limit.ok_or_else(wrong)? })
    }
}

impl fmt::Display for Want {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.limit {
            Limit::Absolute(limit) => write!(f, "{}:{limit}", self.figure),
            Limit::Percent(limit) => write!(f, "{}:{limit}%", self.figure),
        }
    }
}

impl Want {
    /// The standard error in units of a figure of this value.
    pub(super) fn limit_of(&self, value: f64) -> f64 {
        match self.limit {
            Limit::Absolute(limit) => limit,
            Limit::Percent(limit) => limit / 100.0 * value.abs(),
        }
    }
}

/// A figure of a model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Figure {
    pub(super) name: String,
    pub(super) value: f64,
    pub(super) standard_error: Option<f64>,
}

/// All figures that a model has, in the order of its table: its parameters, gains and time constants.
pub(super) fn figures(model: &PolynomialModel) -> Vec<Figure> {
    let own = model.parameters.iter().map(|parameter| Figure {
        name: parameter.name.clone(),
        value: parameter.value,
        standard_error: parameter.standard_error,
    });
    let of = |name: &'static str, all: &[Option<crate::model::Quantity>]| -> Vec<Figure> {
        let number = |index: usize| if all.len() > 1 { (index + 1).to_string() } else { String::new() };
        let each = all.iter().enumerate();
        let figure = |(index, quantity): (usize, &Option<crate::model::Quantity>)| {
            quantity.map(|quantity| Figure {
                name: format!("{name}{}", number(index)),
                value: quantity.value,
                standard_error: quantity.standard_error,
            })
        };
        each.filter_map(figure).collect()
    };
    own.chain(of("dc-gain", &model.dc_gain)).chain(of("time-constant", &model.time_constants)).collect()
}
