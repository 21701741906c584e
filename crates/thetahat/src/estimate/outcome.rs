//! How a search for the parameters of polynomials went.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::optimize::{Algorithm, Found, Objective, Search, Step, Stopped};

/// The result of the search from one set of initial parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StartOutcome {
    /// The method that gave the initial parameters, such as `steiglitz-mcbride`.
    pub name: String,
    /// The mean of e^2 at the initial parameters; none where it cannot be computed.
    pub cost: Option<f64>,
    /// The mean of e^2 at the end of the search from them, if there was one.
    pub reached: Option<f64>,
}

/// How a search went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchOutcome {
    /// How steps were chosen.
    pub algorithm: Algorithm,
    /// The relative decrease of the cost at which to stop.
    pub tolerance: f64,
    /// Iterations allowed.
    pub max_iterations: usize,
    /// The step length of steepest descent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Step>,
    /// The seed of random starts, if there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Iterations done, from the start that won.
    pub iterations: usize,
    /// The mean of e^2 at the start and after each iteration.
    pub costs: Vec<f64>,
    /// The norm of the gradient at the end, each of its entries taken as the cosine between e and a column of psi: 0 at
    /// a minimum, whatever the units.
    pub gradient_norm: f64,
    /// Why it stopped.
    pub stopped: Stopped,
    /// Whether only the stability of C and F held the search back from a lower cost.
    pub stability_bound: bool,
    /// Steps that were refused as they would have left the stable region.
    pub unstable_steps: usize,
    /// The initial conditions that were estimated.
    pub initial_conditions: usize,
    /// The number of samples, in segments spread over the log, that the starts were compared on before the search on
    /// all samples; none if all samples were used from the beginning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_samples: Option<usize>,
    /// The start that won.
    pub start: String,
    /// All starts, the best first.
    pub starts: Vec<StartOutcome>,
    /// The largest modulus of a pole that a start had outside the unit circle, before it was reflected into it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unstable_pole: Option<f64>,
    /// Whether this search was for the least errors of a free run, and the noise was found after it.
    #[serde(default)]
    pub plant_first: bool,
}

/// How the sequence of linear programs went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProgramsOutcome {
    /// The largest |e| at the start, that of least squares, and after each iteration.
    pub costs: Vec<f64>,
    /// By which part of itself a step lowers the largest |e| at most, to first order, if it moves the errors by up to
    /// their RMS: 0 at a minimum.
    pub promise: f64,
    /// Why it stopped.
    pub stopped: Stopped,
    /// The initial conditions that were estimated.
    pub initial_conditions: usize,
    /// The search for least squares, from whose end this one starts.
    pub least_squares: SearchOutcome,
}

/// How a search on the whole record went.
pub(super) fn search_outcome(
    options: &Search,
    found: &Found,
    predictor: &impl Objective,
    starts: Vec<StartOutcome>,
) -> SearchOutcome {
    SearchOutcome {
        algorithm: options.algorithm,
        tolerance: options.tolerance,
        max_iterations: options.max_iterations,
        step: (options.algorithm == Algorithm::Gradient).then_some(options.step),
        seed: (options.starts > 0).then_some(options.seed),
        iterations: found.costs.len() - 1,
        costs: found.costs.iter().map(|cost| cost / predictor.samples() as f64).collect(),
        gradient_norm: found.gradient_norm,
        stopped: found.stopped,
        stability_bound: found.stability_bound,
        unstable_steps: found.unstable_steps,
        initial_conditions: predictor.initial_conditions(),
        start_samples: None,
        start: starts.first().map(|start| start.name.clone()).unwrap_or_default(),
        starts,
        unstable_pole: None,
        plant_first: false,
    }
}
