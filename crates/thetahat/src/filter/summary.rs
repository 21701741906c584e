use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::StateFilter;
use super::estimate::StateValues;
use super::row::Certainty;
use crate::Document;
use crate::document::document_methods;
use crate::respond::NisSummary;

/// What a [`StateFilter`] has come to: the JSON document `thetahat.filter/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FilterSummary {
    /// `thetahat.filter/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// `kalman`, `ekf`, `iekf`, `ukf`, `bounded` or `luenberger`, as it was asked for.
    pub estimator: String,
    /// The rows.
    pub rows: usize,
    /// The elements of measurements that were there.
    pub measured: usize,
    /// The log-likelihood of all of them; none from an observer, and where noise is bounded.
    pub log_likelihood: Option<f64>,
    /// The normalised innovation squared, counted by row; none where nothing was measured, and from an observer.
    pub nis: Option<NisSummary>,
    /// The rows that no state within the bounds of noise explains, where these are what is known of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contradictions: Option<usize>,
    /// The states given all rows; from an observer as predicted for the last row.
    pub states: Vec<EstimatedNumber>,
    /// The unknown parameters given all rows.
    pub parameters: Vec<EstimatedNumber>,
}

/// A number that was estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EstimatedNumber {
    /// Its name.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Its standard deviation; none from an observer, and where noise is bounded.
    pub standard_deviation: Option<f64>,
    /// How far at most it is from the estimate, where noise is bounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// How a parameter is kept within its bounds, such as `mass = 0.1 + exp(z)`; none for one without, and for a state.
    pub change_of_variable: Option<String>,
}

impl StateFilter {
    /// What it has come to.
    pub fn summary(&self) -> FilterSummary {
        let (model, totals) = (self.model(), self.totals());
        let latest = self.latest();
        let states = latest.and_then(|latest| latest.filtered.or(Some(latest.predicted)));
        FilterSummary {
            schema: FilterSummary::SCHEMA.to_owned(),
            generator: format!("thetahat {}", env!("CARGO_PKG_VERSION")),
            estimator: self.estimator().to_owned(),
            rows: totals.rows,
            measured: totals.measured,
            log_likelihood: self.is_gaussian().then_some(totals.log_likelihood),
            nis: totals.nis.summary(),
            contradictions: (self.engine.certainty() == Certainty::Bounds).then_some(totals.contradictions),
            states: estimated(model.states().iter().map(String::as_str), states, std::iter::repeat(None)),
            parameters: estimated(
                model.unknown(),
                latest.map(|latest| latest.parameters),
                model.changes_of_variable(),
            ),
        }
    }
}

/// Names with their values; nothing before the first row.
fn estimated<'a>(
    names: impl Iterator<Item = &'a str>,
    values: Option<StateValues<'_>>,
    changes: impl Iterator<Item = Option<String>>,
) -> Vec<EstimatedNumber> {
    let Some(StateValues { values, standard_deviations, bounds }) = values else { return Vec::new() };
    let named = names.zip(values).zip(changes).enumerate();
    named
        .map(|(index, ((name, &value), change_of_variable))| EstimatedNumber {
            name: name.to_owned(),
            value,
            standard_deviation: standard_deviations.and_then(|deviations| deviations.get(index)).copied(),
            bound: bounds.and_then(|bounds| bounds.get(index)).copied(),
            change_of_variable,
        })
        .collect()
}

impl Document for FilterSummary {
    const NAME: &'static str = "summary";
    const SCHEMA: &'static str = "thetahat.filter/1";
    const REMEDY: &'static str = "give a file that filter wrote";

    document_methods!();
}
