//! The functions that a choice evaluated, and the errors of its models.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::optimize::{Algorithm, Stopped};
use thetahat_numerics::regression::ChosenTerm;

use super::candidates::Candidates;
use crate::Error;
use crate::data::{Log, Rows};
use crate::model::NonlinearArxModel;
use crate::respond::nonlinear_arx::{NonlinearArxOnLog, within};
use crate::respond::{Horizon, InitialCondition, OnLog};

/// A choice prefers models whose free run stays within this many times the range of the estimation rows, and of those
/// it runs over, about its middle.
const RANGE: f64 = 1.1;

/// How the maps of a nonlinear ARX model were chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapsOutcome {
    /// How that of each output was.
    pub maps: Vec<TermsOutcome>,
}

/// How the functions of a map were chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TermsOutcome {
    /// The functions to choose from.
    pub candidates: usize,
    /// What said how many to take, or which of those tried: `given`, the word of an information criterion, `validation`
    /// (the free run on the validation rows) or `cv` (that on five blocks, each by a model of the others).
    pub selected_by: String,
    /// What was added to the squares of the functions, in samples; none: nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ridge: Option<f64>,
    /// How many steps of the path the model has; of nearest neighbours, which step it is.
    pub taken: usize,
    /// The functions in the order of their choice, those that were not taken too; of local models the splits, of
    /// nearest neighbours the numbers that were tried, and of trained maps the maps that were.
    pub path: Vec<TermStep>,
    /// How the numbers were found, where more was to be found than one solution says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingOutcome>,
}

impl TermsOutcome {
    /// The step that the model ends with.
    pub fn last(&self) -> Option<&TermStep> {
        self.path.get(self.taken.checked_sub(1)?)
    }
}

/// How the numbers of a map were found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrainingOutcome {
    /// How far the runs went of which the errors were made small.
    pub horizon: Horizon,
    /// How steps were chosen.
    pub algorithm: Algorithm,
    /// The relative decrease of the cost at which to stop.
    pub tolerance: f64,
    /// The seed of random starts.
    pub seed: u64,
    /// The cost, in squares of the scaled output: squared errors and the ridge.
    pub cost: f64,
    /// The norm of the gradient at the end, as the cosine between errors and slopes.
    pub gradient_norm: f64,
    /// Iterations of the last search, for the longest runs.
    pub iterations: usize,
    /// Why it stopped.
    pub stopped: Stopped,
    /// The cost that each start reached, in their order; none where its run grew without bound.
    pub starts: Vec<Option<f64>>,
}

/// A step of the choice: the model with this term, or split, and those before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TermStep {
    /// The function that is added, such as u(k-1)^2; the split of a box, such as split(u(k-1), 0.5); a number of
    /// neighbours; or a map that was tried, such as 2 tanh units.
    pub term: String,
    /// The parameters of the model; of nearest neighbours, samples for each that is asked.
    pub parameters: usize,
    /// Its error reduction ratio: the share of the sum of squared outputs that it explains beside those before; of
    /// nearest neighbours, the share that they explain.
    pub error_reduction: f64,
    /// Functions that can no longer be told from sums of those chosen.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aliases: Vec<String>,
    /// The root mean square of the errors one step ahead on the estimation rows, in units of the output; of nearest
    /// neighbours, on five blocks of these rows, each by the samples of the others.
    pub rmse: f64,
    /// The free run on the estimation rows; none of a step after which functions that are always there are still to
    /// come.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_run: Option<RunFigures>,
    /// The free run on the rows that the choice evaluated models on, where there are some; one step ahead where there
    /// are no inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<RunFigures>,
}

/// What a run of a model misses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunFigures {
    /// The root mean square error, in units of the output; none where the run leaves the range of numbers.
    pub rmse: Option<f64>,
    /// The largest absolute error; none likewise.
    pub largest_error: Option<f64>,
    /// 100 (1 - |y - y^|/|y - mean y|): the fit, in percent; none likewise, or where the output is constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub percent: Option<f64>,
    /// Whether the run stays within 1.1 times the range of the output in the estimation rows and in those of the run,
    /// about its middle.
    pub in_range: bool,
}

impl TermStep {
    /// The step to so many parameters that chooses a candidate, with the mean square of what it leaves.
    pub(super) fn of(
        candidates: &Candidates,
        regressors: &[String],
        chosen: &ChosenTerm,
        parameters: usize,
        mean_square: f64,
    ) -> Self {
        let name = |place: &usize| candidates.name(*place, regressors);
        Self {
            term: name(&chosen.place),
            parameters,
            error_reduction: chosen.reduction,
            aliases: chosen.aliases.iter().map(name).collect(),
            rmse: mean_square.max(0.0).sqrt(),
            free_run: None,
            held_out: None,
        }
    }
}

impl RunFigures {
    pub(super) fn of(model: &NonlinearArxModel, log: &Log, rows: &[Rows]) -> Result<Self, Error> {
        run(model, log, rows).map(Sums::figures)
    }

    /// Smaller is better: those out of range come last, and those without a figure after them. To stay in range is no
    /// merit of a run that is no better than the mean of the output.
    pub(crate) fn rank(self) -> (bool, f64) {
        let is_useless = self.percent.is_some_and(|percent| percent <= 0.0);
        (!self.in_range || is_useless, self.rmse.unwrap_or(f64::INFINITY))
    }
}

/// What a model misses on some rows of a log: in its free run, or one step ahead where nothing drives it. A run strays
/// that leaves the range of the estimation rows and of what was measured in these: a model that follows an output to
/// where it has not been is no worse.
pub(super) fn run(model: &NonlinearArxModel, log: &Log, rows: &[Rows]) -> Result<Sums, Error> {
    let on_log = NonlinearArxOnLog::new(model, log, rows)?;
    let horizon = if on_log.is_driven() { Horizon::FreeRun } else { Horizon::Steps { steps: 1 } };
    let mut sums = Sums::default();
    for response in on_log.respond(horizon, InitialCondition::Drop)? {
        let measured = on_log.measured(0);
        let counted = || response.counted.iter().cloned().flatten();
        let range = model.maps.first().map_or([0.0; 2], |map| map.range);
        let range = counted().fold(range, |[low, high], t| [low.min(measured[t]), high.max(measured[t])]);
        let [low, high] = within(range, RANGE);
        for t in counted() {
            let (said, error) = (response.values[t], (measured[t] - response.values[t]).abs());
            sums.count += 1;
            sums.squares += error * error;
            sums.level += measured[t];
            sums.energy += measured[t] * measured[t];
            // One that is not a number stays one.
            sums.largest = if error > sums.largest || error.is_nan() { error } else { sums.largest };
            sums.strays |= !(low..=high).contains(&said);
        }
    }
    Ok(sums)
}

/// What figures are made of.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    count: usize,
    squares: f64,
    /// The sum of the output, and of its squares: it is a deviation from its mean over the estimation rows.
    level: f64,
    energy: f64,
    largest: f64,
    strays: bool,
}

impl Sums {
    pub(super) fn add(&mut self, other: Self) {
        self.count += other.count;
        self.squares += other.squares;
        self.level += other.level;
        self.energy += other.energy;
        let largest = other.largest;
        self.largest = if largest > self.largest || largest.is_nan() { largest } else { self.largest };
        self.strays |= other.strays;
    }

    pub(super) fn figures(self) -> RunFigures {
        let known = |value: f64| Some(value).filter(|value| self.count > 0 && value.is_finite());
        let spread = self.energy - self.level * self.level / self.count as f64;
        RunFigures {
            percent: known(100.0 * (1.0 - (self.squares / spread).sqrt())).filter(|_| spread > 0.0),
            rmse: known((self.squares / self.count as f64).sqrt()),
            largest_error: known(self.largest),
            in_range: self.count > 0 && !self.strays,
        }
    }
}
