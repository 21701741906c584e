//! The options of a validation, and the plan that they make.

use super::ValidationPlan;
use crate::Error;
use crate::data::{Detrend, Rows};
use crate::options::{OptionText, options};

const LOG: &str = "";
const TESTS: &str = "Tests";

/// Where a validation takes the offsets from: the model, or the rows that are evaluated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Offsets {
    /// The model's own.
    Model,
    /// Those of the rows.
    OfRows(Detrend),
}

impl OptionText for Offsets {
    const PYTHON: &'static str = "Union[Literal[\"model\", \"none\", \"mean\", \"linear\"], str]";

    fn of(text: &str) -> Result<Self, String> {
        match text {
            "model" => Ok(Self::Model),
            other => Detrend::of(other).map(Self::OfRows),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Model => "model".to_owned(),
            Self::OfRows(detrend) => detrend.to_string(),
        }
    }
}

options! {
    /// How a model is validated on a log, as it was given.
    ///
    /// ```
    /// use thetahat::report::{ValidationOptions, ValidationPlan};
    ///
    /// let options: ValidationOptions = serde_json::from_str(r#"{"horizon": [1, 10], "detrend": "mean"}"#)?;
    /// let plan = ValidationPlan::of(&options, &[20])?;
    /// assert_eq!(plan.horizons, [1, 10, 20]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ValidationOptions of "a validation" {
        /// Rows to validate on, 1-based and inclusive
        rows: Vec<Rows>, "A..B[,C..D]", "all", LOG;
        /// Offsets: the model's own, or none, mean, linear, start:K of the rows evaluated
        detrend: Option<Offsets>, "WHAT", "model", LOG;
        /// Prediction horizons besides 1, in steps
        horizon: Vec<usize>, "K[,K…]", "5", LOG;
        /// Lags of the tests of residuals; short logs have fewer
        lags: Option<usize>, "L", "25", TESTS;
        /// Significance level
        alpha: Option<f64>, "LEVEL", "0.05", TESTS;
        /// The levels of the bands of Anderson's test, which counts the correlations outside
        alphas: Vec<f64>, "LEVEL[,LEVEL…]", "0.01,0.02,0.05,0.1,0.2", TESTS;
    }
}

impl ValidationPlan {
    /// What options ask for, and horizons that something else asks for, such as a [`Requirement`].
    ///
    /// [`Requirement`]: crate::report::Requirement
    ///
    /// # Errors
    /// As for [`check`](Self::check).
    pub fn of(options: &ValidationOptions, further: &[usize]) -> Result<Self, Error> {
        let usual = Self::default();
        let mut horizons = if options.horizon.is_empty() { usual.horizons } else { options.horizon.clone() };
        horizons.extend(further);
        let plan = Self {
            rows: options.rows.clone(),
            detrend: match options.detrend {
                None | Some(Offsets::Model) => None,
                Some(Offsets::OfRows(detrend)) => Some(detrend),
            },
            horizons,
            lags: options.lags.unwrap_or(usual.lags),
            alpha: options.alpha.unwrap_or(usual.alpha),
            alphas: if options.alphas.is_empty() { usual.alphas } else { options.alphas.clone() },
        };
        plan.check()?;
        Ok(plan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Options;

    #[test]
    fn the_defaults_are_those_of_the_table() -> Result<(), Error> {
        let mut written = ValidationOptions::default();
        for option in ValidationOptions::TABLE.iter().filter(|option| option.field != "rows") {
            written.set(option.field, &option.default.into())?;
        }
        assert_eq!(ValidationPlan::of(&written, &[])?, ValidationPlan::default());
        Ok(())
    }
}
