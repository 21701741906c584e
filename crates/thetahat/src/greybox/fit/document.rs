use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Document, Error, GreyBox, NisSummary, Source, Stopped, Test, text};

/// What a fit of a model in equations found. The JSON document `thetahat.greybox/1`.
///
/// Readers ignore fields that they do not know, and refuse another schema. The same input gives the same bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GreyReport {
    /// `thetahat.greybox/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// What the model was fitted to, in this order.
    pub logs: Vec<Source>,
    /// The number of rows of all logs.
    pub rows: usize,
    /// The model as it was written, before the fit.
    pub model: String,
    /// Those of its unknown parameters that were given values before the fit.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub known: BTreeMap<String, f64>,
    /// The parameters that were unknown.
    pub parameters: Vec<GreyParameter>,
    /// The covariance of these parameters, row by row, as the standard errors have it.
    pub covariance: Vec<Vec<f64>>,
    /// The sum over all readings of -1/2 (ln 2 pi S + e^2/S).
    pub log_likelihood: f64,
    /// How many values of outputs were measured.
    pub readings: usize,
    /// How surprising the rows were, counted by row: the mean is above what is expected if the noises of the log are larger
    /// than those of the model. None where nothing was measured.
    pub nis: Option<NisSummary>,
    /// What the covariance of the parameters was multiplied by: max(1, nis.mean/nis.expected).
    pub covariance_factor: f64,
    /// How well each output is predicted.
    pub outputs: Vec<GreyOutput>,
    /// Where the free runs start.
    pub states: Vec<GreyState>,
    /// How the search went.
    pub search: GreySearch,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// A parameter that was fitted, in its own unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GreyParameter {
    /// Its name in the model.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// The standard error if the noises of the model are those of the log: not multiplied by the covariance factor.
    pub nominal_standard_error: f64,
    /// Where the search started.
    pub start: f64,
    /// The lower bound, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// The upper bound, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// How it is kept within its bounds, such as `mass = 0.1 + exp(z)`, z being the variable that the search moved; none for
    /// one without.
    pub change_of_variable: Option<String>,
}

/// How well an output is predicted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GreyOutput {
    /// The channel.
    pub channel: String,
    /// The rows with a value.
    pub readings: usize,
    /// The rows without one.
    pub missing: usize,
    /// Predicted by the filter from all rows before; the first row of a log from the prior.
    pub one_step: Option<GreyFit>,
    /// Driven by the inputs alone from the start that explains the outputs best; none where this grows out of range.
    pub free_run: Option<GreyFit>,
    /// Whether the innovations, each divided by its standard deviation, are white: the test of Ljung and Box over rows.
    pub whiteness: Option<Test>,
}

/// How close predictions come to what was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GreyFit {
    /// 100 (1 - |y - y^|/|y - mean(y)|): 100 is perfect, 0 is as good as the mean; none for a constant output.
    pub percent: Option<f64>,
    /// The root of the mean squared error, in the unit of the output.
    pub rmse: f64,
}

/// Where a state starts in the free runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GreyState {
    /// Its name in the model.
    pub name: String,
    /// Its value at the first row of each log; none where the free run grows out of range.
    pub starts: Vec<Option<f64>>,
}

/// How a search went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GreySearch {
    /// Iterations allowed.
    pub max_iterations: usize,
    /// Iterations done.
    pub iterations: usize,
    /// It stops when a step would raise the log-likelihood by no more than this fraction of half the readings, or of half the
    /// sum of e^2/S where that is larger.
    pub tolerance: f64,
    /// Why it stopped.
    pub stopped: Stopped,
    /// The log-likelihood at the start and behind each iteration.
    pub log_likelihoods: Vec<f64>,
}

impl GreyReport {
    /// The model with the values that were found, for a filter: nothing of it is unknown.
    ///
    /// # Errors
    /// [`Error::Model`], [`Error::Argument`] and [`Error::Report`] if the text is no model any more, or has other parameters.
    pub fn fitted_model(&self) -> Result<GreyBox, Error> {
        let model = GreyBox::from_toml(&self.model)?;
        let known = self.known.iter().map(|(name, value)| (name.as_str(), *value));
        let fitted = self.parameters.iter().map(|parameter| (parameter.name.as_str(), parameter.value));
        let model = model.with_parameters(&known.chain(fitted).collect::<Vec<_>>())?;
        let open: Vec<&str> = model.unknown().collect();
        if !open.is_empty() {
            return Err(Error::report(format!(
                "it has no value for: {}; fit the log again",
                open.join(", ")
            )));
        }
        Ok(model)
    }
}

impl Document for GreyReport {
    const NAME: &'static str = "report on a model in equations";
    const SCHEMA: &'static str = "thetahat.greybox/1";
    const REMEDY: &'static str = "give a file that fit --grey wrote";

    fn refusal(schema: &str) -> String {
        let (schema, own) = (text::brief(schema, 40), Self::SCHEMA);
        format!(
            "its schema is '{schema}', this version reads models in equations as '{own}'; fit the log again"
        )
    }
}
