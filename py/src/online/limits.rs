//! Limits of the parameters of a recursive estimator.

use std::ops::RangeInclusive;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use thetahat_core::{Action, Error, Innovation};

/// One range for each parameter, or none at all.
#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(from = "Vec<[Option<f64>; 2]>", into = "Vec<[Option<f64>; 2]>")]
pub(crate) struct Limits(Vec<RangeInclusive<f64>>);

impl Limits {
    /// The limits of so many parameters, as an argument.
    pub(crate) fn new(value: Option<&Bound<'_, PyAny>>, parameters: usize) -> PyResult<Self> {
        let Some(value) = value else { return Ok(Limits::default()) };
        let pairs: Option<Vec<Option<(f64, f64)>>> = value.extract().ok();
        match pairs.filter(|pairs| pairs.len() == parameters) {
            Some(pairs) => {
                let free = (f64::NEG_INFINITY, f64::INFINITY);
                let ranges = pairs.into_iter().map(|pair| pair.unwrap_or(free));
                Ok(Limits(ranges.map(|(lower, upper)| lower..=upper).collect()))
            }
            None => Err(PyValueError::new_err(format!(
                "limits: expected a pair (lower, upper) or None for each of {parameters} parameters"
            ))),
        }
    }

    /// As pairs; none if there are no limits.
    pub(crate) fn pairs(&self) -> Option<Vec<(f64, f64)>> {
        let pairs = || self.0.iter().map(|limit| (*limit.start(), *limit.end())).collect();
        (!self.0.is_empty()).then(pairs)
    }

    /// What became of a sample once `keep` has taken the parameters back to their limits.
    pub(crate) fn after(
        &self,
        mut innovation: Innovation<f64>,
        keep: impl FnOnce(&[RangeInclusive<f64>]) -> Result<bool, Error>,
    ) -> Result<Innovation<f64>, Error> {
        if !self.0.is_empty() && keep(&self.0)? {
            innovation.action = Action::Projected;
        }
        Ok(innovation)
    }

    /// The ranges; empty if there are none.
    pub(crate) fn ranges(&self) -> &[RangeInclusive<f64>] {
        &self.0
    }
}

/// JSON has no infinity.
impl From<Vec<[Option<f64>; 2]>> for Limits {
    fn from(ends: Vec<[Option<f64>; 2]>) -> Self {
        let range = |[lower, upper]: [Option<f64>; 2]| {
            lower.unwrap_or(f64::NEG_INFINITY)..=upper.unwrap_or(f64::INFINITY)
        };
        Limits(ends.into_iter().map(range).collect())
    }
}

impl From<Limits> for Vec<[Option<f64>; 2]> {
    fn from(Limits(ranges): Limits) -> Self {
        let end = |end: f64| end.is_finite().then_some(end);
        ranges.iter().map(|range| [end(*range.start()), end(*range.end())]).collect()
    }
}
