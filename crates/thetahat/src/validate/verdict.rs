//! What tests of residuals say.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A test of a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Test {
    /// The lags tested.
    pub lags: usize,
    /// The statistic.
    pub statistic: f64,
    /// The degrees of freedom of its chi-square distribution where the hypothesis holds.
    pub degrees: f64,
    /// How often it is as large where the hypothesis holds; none where it is not defined (constant residuals).
    pub p_value: Option<f64>,
}

/// Anderson's test of whiteness: white residuals have about a fraction alpha of their correlations outside the band of
/// that level. The count of those is about binomial, and its mid-p-value decides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Anderson {
    /// How many lags are counted.
    pub lags: usize,
    /// One line for each alpha, in rising order.
    pub levels: Vec<AndersonLevel>,
    /// The smallest alpha of a fine scale (0.001, 0.002, …, 0.5) at which the fraction of lags outside is not below
    /// alpha; none if it is below at all of them. It orders models, and is no verdict: correct models stop early too.
    pub stops_at: Option<f64>,
}

/// Anderson's test at one level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AndersonLevel {
    /// The level.
    pub alpha: f64,
    /// Half the width of the band.
    pub band: f64,
    /// The lags outside of it; divided by all lags, the fraction that is expected to be alpha.
    pub outside: usize,
    /// Whether the count is consistent with white residuals: `p_value` is not below the level of the validation.
    pub white: bool,
    /// How often more are outside for white residuals, and half of how often as many are: the mid-p-value of the count,
    /// which is about binomial.
    pub p_value: f64,
}

/// Whether the residuals depend on an input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Independence {
    /// The input channel.
    pub input: String,
    /// The correlation of e(t) and u(t - k) at lags k = -M, …, M.
    pub correlation: Vec<f64>,
    /// Half the width of the 95 % band of each of them.
    pub band: Vec<f64>,
    /// Past inputs, k = 1 … M: where they are in the residuals, the model lacks dynamics or delay.
    pub past: Test,
    /// Future inputs, k = -M … -1: where they follow the residuals, there is feedback. Bonferroni's bound over the
    /// lags.
    pub feedback: Test,
    /// Whether feedback is suspected: past residuals predict the input beyond its own past, on rows left out too. A
    /// model that lacks dynamics, and an input that predicts itself, make `feedback` small without that.
    #[serde(default)]
    pub suspected: bool,
}
