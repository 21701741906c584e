//! What validations and comparisons store.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Document;
use crate::data::{Rows, Source};
use crate::document::document_methods;
use crate::estimate::Criteria;
use crate::model::{Orders, Structure};
use crate::spectrum::Agreement;
use crate::validate::{Fit, Nonlinearity, Residuals, Test};

/// How a stored model does on a log. The JSON document `thetahat.validation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Validation {
    /// `thetahat.validation/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The file name of the report, as it was given; none for a model that comes from no file.
    pub report: Option<String>,
    /// The logs, with the rows that each has among all of them.
    pub logs: Vec<Source>,
    /// The rows evaluated.
    pub rows: Vec<Rows>,
    /// Whether the model was fitted to them.
    pub in_sample: InSample,
    /// What the model is called, such as ARX(2, 2, 1).
    pub model: String,
    /// How many parameters it has.
    pub parameters: usize,
    /// Which polynomials it has; none for a model of another kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub structure: Option<Structure>,
    /// How long they are; none likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orders: Option<Orders>,
    /// Whether all poles lie inside the unit circle; none for a model without poles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stable: Option<bool>,
    /// Whether inputs act on the outputs, so that there is a free run.
    pub driven: bool,
    /// Whether the model says that its residuals are white: those of output error and by instrumental variables say
    /// nothing of the noise.
    pub white_expected: bool,
    /// 1 step ahead, some steps ahead, and the free run, each with its start; of each output.
    pub fit: Vec<Fit>,
    /// The errors of each output one step ahead beside those that the model expects.
    pub noise: Vec<NoiseLevel>,
    /// How often the measured outputs lie in the prediction intervals.
    pub coverage: Vec<Coverage>,
    /// The one-step residuals of each output; not of an output of which too few samples count. Models in equations
    /// expect errors of another size in each row: each of their residuals is divided by its standard deviation.
    pub residuals: Vec<Residuals>,
    /// Whether the residuals of several outputs are white together (Hosking 1980); none of one output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub portmanteau: Option<Test>,
    /// Whether the errors one step ahead hold squares of an input, for each output and each input whose square is not
    /// constant; not of models in equations.
    #[serde(default)]
    pub nonlinear: Vec<Nonlinearity>,
    /// How the model agrees with a measured frequency response, for each input that both have, where one was laid
    /// beside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub response: Vec<Agreement>,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// Whether a model was fitted to the rows of a validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum InSample {
    /// To none of them: another log, or other rows.
    No,
    /// To some.
    Partly,
    /// To all.
    Yes,
}

/// The errors one step ahead beside those that the model expects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseLevel {
    /// The output.
    pub output: String,
    /// The mean of e^2 on the log; none where no sample counts.
    pub mse: Option<f64>,
    /// The variance of e in the model; the mean of them where it expects another in each row.
    pub model: f64,
    /// The first over the second, or the mean of e^2 over the variance of the row: 1 where the log is like the one of
    /// the fit.
    pub ratio: Option<f64>,
}

/// How often the measured output lies in the prediction intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Coverage {
    /// The output.
    pub output: String,
    /// How many steps ahead.
    pub steps: usize,
    /// The fraction that should lie inside, such as 0.95.
    pub level: f64,
    /// The fraction that does; none where no sample counts.
    pub actual: Option<f64>,
    /// The samples that count.
    pub samples: usize,
}

/// Several models on one log, side by side. The JSON document `thetahat.comparison/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// `thetahat.comparison/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The models in the order they were given.
    pub models: Vec<Validation>,
    /// The information criteria of their fits, in the same order; none where they were not fitted to the same values of
    /// the same outputs, or the samples that count differ by more than one in twenty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub criteria: Option<Vec<Criteria>>,
    /// The likelihood ratios of models in equations of which one has all unknown parameters of the other, and more,
    /// fitted to the same values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub likelihood_ratios: Vec<LikelihoodRatio>,
}

/// Whether the further parameters of a model in equations say something: twice the difference of the logarithms of the
/// likelihoods is chi² of as many degrees of freedom if they do not (Wilks 1938).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LikelihoodRatio {
    /// The place of the model without them, from 0 on.
    pub smaller: usize,
    /// The place of the model with them.
    pub larger: usize,
    /// 2 (ln L of the larger - ln L of the smaller).
    pub ratio: f64,
    /// The further parameters.
    pub parameters: Vec<String>,
    /// The probability of as large a ratio if they say nothing. It is too large for a noise that the smaller model has
    /// at 0, at most by the factor 2.
    pub p_value: f64,
}

impl Document for Validation {
    const NAME: &'static str = "validation";
    const SCHEMA: &'static str = "thetahat.validation/1";
    const REMEDY: &'static str = "give a file that validate wrote";

    document_methods!();
}

impl Document for Comparison {
    const NAME: &'static str = "comparison";
    const SCHEMA: &'static str = "thetahat.comparison/1";
    const REMEDY: &'static str = "give a file that compare wrote";

    document_methods!();
}
