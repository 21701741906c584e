use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Focus, Path, Select};
use crate::estimate::OrderScore;
use crate::model::{Orders, ProcessStructure, Structure};

/// Mean squares below this are rounding.
const NOTHING: f64 = 1e-12;

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The logarithm of a mean square.
pub(super) fn logarithm(square: f64) -> f64 {
    square.max(NOTHING).ln()
}

/// How a model was chosen among others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Selection {
    /// What made one better than another.
    pub select: Select,
    /// What the model is for.
    #[serde(default = "before")]
    pub focus: Focus,
    /// Which were tried; none: delay, structure and orders were left to the data.
    pub path: Option<Path>,
    /// What was done, in plain words, one sentence each.
    pub steps: Vec<String>,
    /// N, the samples that all models were compared on.
    pub samples: usize,
    /// How many models were compared.
    pub models: usize,
    /// The number of further models that were skipped, as this log cannot determine them.
    pub failed: usize,
    /// How many more were not fitted, as larger models with the same plant show that their MDL cannot be the least.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub hopeless: usize,
    /// The delay of each input, where it was left to the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub delays: Vec<Delay>,
    /// The polynomial model that was chosen.
    pub chosen: Candidate,
    /// The best of the others; none if there was one only.
    pub second: Option<Candidate>,
    /// The best models for prediction and for simulation, where both were searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub winners: Option<Best>,
    /// The least cost itself, where the smallest model close to it was chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<Candidate>,
    /// The best 50, the best first.
    pub best: Vec<Candidate>,
    /// The best of each number of parameters, the smallest first.
    pub of_size: Vec<Candidate>,
    /// Free runs on blocks were compared in windows of this many samples, each with a level of its own, as the noise
    /// drifts; none where it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level_window: Option<usize>,
    /// Whether the noise of the model integrates, 1 - q^-1 in D in the place of a root that is estimated, as MDL is
    /// less with it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub noise_integrates: bool,
    /// The processes in continuous time that were compared with `chosen`, where the log is a step test, the best first.
    /// That one is the model of the report, or `chosen` is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub processes: Vec<ProcessCandidate>,
    /// The model in state space that was compared with `chosen`, where one was. It is the model of the report where it
    /// is far better.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_space: Option<StateSpaceCandidate>,
}

/// A model in state space and what speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StateSpaceCandidate {
    /// n, that of the least MDL.
    pub order: usize,
    /// The free parameters of a canonical form.
    pub parameters: usize,
    /// What the order was chosen among.
    pub orders: Vec<OrderScore>,
    /// What it does on blocks that it was not fitted to; none where the rows without one do not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
}

/// A process in continuous time and what speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProcessCandidate {
    /// Its structure from each input.
    pub structure: ProcessStructure,
    /// p.
    pub parameters: usize,
    /// The mean of e^2 of its free run over the estimation rows, or over about 2000 of them.
    pub mse: f64,
    /// MDL of the same.
    pub mdl: Option<f64>,
    /// What it does on blocks that it was not fitted to, in the free run from the first row on; none where the rows
    /// without one do not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
}

/// A model and what speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Candidate {
    /// Which polynomials there are.
    pub structure: Structure,
    /// How long they are.
    pub orders: Orders,
    /// p.
    pub parameters: usize,
    /// The mean of e^2 over the common samples of the estimation rows.
    pub mse: f64,
    /// The mean of e^2 on samples that the model was not fitted to: with a validation part, or cross-validation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out_mse: Option<f64>,
    /// What it does on blocks that it was not fitted to, where that was evaluated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
    /// What it was chosen by, the smaller the better: a criterion, or `held_out_mse`. None where it is not defined.
    pub score: Option<f64>,
}

/// The best models for two purposes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Best {
    /// The stable model with the least criterion.
    pub prediction: Candidate,
    /// The stable model with the least error on samples that it was not fitted to, in free runs or as many steps ahead
    /// as the focus says.
    pub simulation: Candidate,
}

/// What choices were for before there was a focus.
fn before() -> Focus {
    Focus::Prediction
}

/// The delay of an input, as it was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Delay {
    /// The input channel.
    pub input: String,
    /// Samples from a change to its first effect; 1 where no effect is seen.
    pub nk: usize,
    /// How sure that is: the posterior probability of this delay among those that were compared. None where no effect
    /// is seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// The MDL of models with a delay of 1, 2, … samples; of 0 too where that was taken.
    pub mdl: Vec<DelayScore>,
}

/// What a delay costs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DelayScore {
    /// The delay.
    pub nk: usize,
    /// MDL of the model with that delay.
    pub mdl: f64,
}

/// How well a model does on samples that it was not fitted to: mean squares of errors, divided by the variance of the
/// output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldOut {
    /// On all blocks, each from the initial state that fits it best.
    pub blocks: f64,
    /// On the last block, simulated from the first row on with the initial state that fits the rows before the block;
    /// for a number of steps ahead the same as `blocks`.
    pub onward: f64,
    /// As `blocks`, without what instability costs.
    pub unpunished: f64,
    /// How many models without a block are unstable.
    pub unstable: usize,
    /// The models fitted, each without a block.
    pub refits: usize,
}

impl HeldOut {
    /// The mean of the logarithms of both mean squares, by which models are compared.
    pub(crate) fn both(&self) -> f64 {
        f64::midpoint(logarithm(self.blocks), logarithm(self.onward))
    }

    /// The fit that decides: 100 (1 - |e|/|y - mean(y)|), where the square of the ratio is the geometric mean of that
    /// on all blocks and that onward.
    pub fn percent(&self) -> f64 {
        100.0 * (1.0 - (0.5 * self.both()).exp())
    }
}
