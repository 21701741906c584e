use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::StateFilter;
use super::estimate::Values;
use crate::Error;

/// The schema that this version writes.
const SCHEMA: &str = "thetahat.filter/1";

/// What a [`StateFilter`] has come to: the JSON document `thetahat.filter/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FilterSummary {
    /// `thetahat.filter/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// `kalman`, `ekf` or `luenberger`.
    pub estimator: String,
    /// The rows.
    pub rows: usize,
    /// The elements of measurements that were there.
    pub measured: usize,
    /// The log-likelihood of all of them; none from an observer.
    pub log_likelihood: Option<f64>,
    /// How surprising the rows were; none where nothing was measured, and from an observer.
    pub nis: Option<NisSummary>,
    /// The states given all rows; from an observer as predicted for the last row.
    pub states: Vec<Estimated>,
    /// The unknown parameters given all rows.
    pub parameters: Vec<Estimated>,
}

/// How the normalised innovations squared lay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NisSummary {
    /// How many rows have one.
    pub rows: usize,
    /// Their mean: the number of outputs measured in a row, if the model is right.
    pub mean: f64,
    /// The part below the bounds that hold 95 %: 0.025 if the model is right.
    pub below: f64,
    /// The part above: 0.025 if the model is right.
    pub above: f64,
}

/// A number that was estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimated {
    /// Its name.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Its standard deviation; none from an observer.
    pub standard_deviation: Option<f64>,
    /// How a parameter is kept within its bounds, such as `mass = 0.1 + exp(z)`; none for one without, and for a state.
    pub change_of_variable: Option<String>,
}

impl StateFilter {
    /// What it has come to.
    pub fn summary(&self) -> FilterSummary {
        let (model, totals) = (self.model(), self.totals());
        let latest = self.latest();
        let states = latest.and_then(|latest| latest.filtered.or(Some(latest.predicted)));
        let nis = (totals.nis_rows > 0).then(|| NisSummary {
            rows: totals.nis_rows,
            mean: totals.mean_nis,
            below: totals.nis_below as f64 / totals.nis_rows as f64,
            above: totals.nis_above as f64 / totals.nis_rows as f64,
        });
        let changes = model.changes_of_variable().map(Some);
        FilterSummary {
            schema: SCHEMA.to_owned(),
            generator: format!("thetahat {}", env!("CARGO_PKG_VERSION")),
            estimator: self.estimator().to_owned(),
            rows: totals.rows,
            measured: totals.measured,
            log_likelihood: (!self.is_observer()).then_some(totals.log_likelihood),
            nis,
            states: estimated(model.states().iter().map(String::as_str), states, std::iter::repeat(None)),
            parameters: estimated(model.unknown(), latest.map(|latest| latest.parameters), changes),
        }
    }
}

/// Names with their values; nothing before the first row.
fn estimated<'a>(
    names: impl Iterator<Item = &'a str>,
    values: Option<Values<'_>>,
    changes: impl Iterator<Item = Option<String>>,
) -> Vec<Estimated> {
    let Some(Values { values, standard_deviations }) = values else { return Vec::new() };
    let named = names.zip(values).zip(changes).enumerate();
    named
        .map(|(index, ((name, &value), change_of_variable))| Estimated {
            name: name.to_owned(),
            value,
            standard_deviation: standard_deviations.and_then(|deviations| deviations.get(index)).copied(),
            change_of_variable,
        })
        .collect()
}

impl FilterSummary {
    /// The document, indented, with a line break at its end.
    ///
    /// # Errors
    /// [`Error::Report`] if it cannot be written as JSON.
    pub fn to_json(&self) -> Result<String, Error> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::report(format!("the summary cannot be written as JSON: {error}")))?;
        text.push('\n');
        Ok(text)
    }

    /// The JSON Schema of the document.
    pub fn json_schema() -> serde_json::Value {
        schemars::schema_for!(Self).to_value()
    }
}
