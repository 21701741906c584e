//! The document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::{Rows, Source};
use crate::document::document_methods;
use crate::model::{Parameter, ProcessStructure, Quantity};
use crate::{Document, Error};

/// What a step test shows: each step, what is read off its response, and the mean over the steps. The JSON document
/// `thetahat.step/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepTest {
    /// `thetahat.step/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// Where the logs came from.
    pub logs: Vec<Source>,
    /// The input channel.
    pub input: String,
    /// The output channel.
    pub output: String,
    /// The steps in the order of time; none where it was read off a frequency response.
    pub steps: Vec<Step>,
    /// Each figure by each method over the steps that have it.
    pub summary: Vec<StepSummary>,
    /// The process of least squared errors over all rows; its figures are in `summary` too. None
    /// where it cannot be had, and of a frequency response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process: Option<FittedProcess>,
    /// Which of the figures to trust, and why, in plain words.
    pub advice: Vec<String>,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// One step of the input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Step {
    /// The row of the first value after the step, counted from 1 through all logs.
    pub row: usize,
    /// Its time: seconds from the first row.
    pub time: f64,
    /// The level of the input before.
    pub from: f64,
    /// The level of the input after.
    pub to: f64,
    /// The rows that hold the level before.
    pub before: Rows,
    /// The rows from the step to the next one.
    pub after: Rows,
    /// Why its response is not evaluated, in plain words; none if it is.
    pub refused: Option<String>,
    /// Its response, if it is evaluated.
    pub response: Option<StepResponse>,
}

/// The response to one step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepResponse {
    /// The output before the step: the mean over the rows at rest.
    pub initial: Quantity,
    /// The output in the final steady state: the mean over `regime_rows`.
    pub regime: Quantity,
    /// The rows that count as the final steady state.
    pub regime_rows: Rows,
    /// The standard deviation of the noise, in units of the output.
    pub noise: f64,
    /// How many rows of this noise tell as much as one of white noise: 1 for white noise.
    pub correlation: f64,
    /// Which picture fits.
    pub shape: Shape,
    /// The root mean square by which the response leaves that of a first order with the dead time and the time constant
    /// of the weighted average, the noise taken off, as a fraction of the step. None where there is overshoot.
    pub misfit: Option<f64>,
    /// What is read off it, by each method.
    pub estimates: Vec<StepEstimate>,
}

/// What a response looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// It begins with its largest slope and follows 1 - exp(-(t - theta)/tau).
    FirstOrder,
    /// It does not overshoot, and does not follow a first order either: an S.
    Overdamped,
    /// It overshoots.
    Underdamped,
}

/// One figure by one method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepEstimate {
    /// The figure.
    pub figure: StepFigure,
    /// How it was found.
    pub method: StepMethod,
    /// Its value, with its standard error to first order in the noise of the log.
    pub value: Quantity,
    /// Whether it is the one to trust among those of this figure.
    pub trusted: bool,
}

/// One figure by one method, over all steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepSummary {
    /// The figure.
    pub figure: StepFigure,
    /// How it was found.
    pub method: StepMethod,
    /// How many steps have it.
    pub steps: usize,
    /// The mean over them. Its standard error is the larger of what the spread between steps and what the noise in each
    /// says.
    pub value: Quantity,
    /// The standard deviation between steps; none for one step.
    pub spread: Option<f64>,
    /// In how many of the steps it is the one to trust among those of its figure.
    pub trusted: usize,
}

/// A process with the least squared errors over all rows, steps that are left out among them: what
/// [`fit_process`](crate::report::fit_process) finds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FittedProcess {
    /// Its structure: by the shape that most of the responses have.
    pub structure: ProcessStructure,
    /// The parameters, with standard errors for errors of any colour.
    pub parameters: Vec<Parameter>,
    /// The output where the input is as in the first row.
    pub level: Quantity,
    /// The root mean square of what it leaves, in units of the output.
    pub rmse: f64,
}

impl FittedProcess {
    /// What of it is among the figures of steps, of so many of them.
    pub(super) fn summary(&self, steps: usize) -> impl Iterator<Item = StepSummary> {
        self.parameters.iter().filter_map(move |parameter| {
            let figure = match parameter.name.as_str() {
                "K" => StepFigure::Gain,
                "theta" => StepFigure::DeadTime,
                "tau" => StepFigure::TimeConstant,
                "zeta" => StepFigure::Damping,
                "omega" => StepFigure::NaturalFrequency,
                _ => return None,
            };
            let value = Quantity::new(parameter.value, parameter.standard_error);
            Some(StepSummary {
                figure,
                method: StepMethod::LeastSquares,
                steps,
                value,
                spread: None,
                trusted: 0,
            })
        })
    }
}

/// A figure of a step response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StepFigure {
    /// Change of the output over that of the input, in units of the output per unit of the input.
    Gain,
    /// Seconds until the response begins.
    DeadTime,
    /// Seconds.
    TimeConstant,
    /// Seconds from 10 % to 90 % of the change.
    RiseTime,
    /// Seconds after which the output stays within 2 % of the change around its final steady state.
    SettlingTime,
    /// How far the first peak is above the final steady state, as a fraction of the change.
    Overshoot,
    /// Seconds to the first peak.
    PeakTime,
    /// Seconds between the first two peaks.
    Period,
    /// The damping ratio of a second order.
    Damping,
    /// The undamped natural frequency of a second order, in radians per second.
    NaturalFrequency,
}

/// How a figure is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StepMethod {
    /// The levels before the step and in the final steady state.
    Regime,
    /// Where the response leaves the band of the noise.
    NoiseBand,
    /// The tangent of the largest slope: at the start of a first order, at the inflection of an S.
    Tangent,
    /// Where 63.2 % of the change are reached.
    Level,
    /// Where two levels are reached: 28.3 % and 63.2 %, or half of the change and the first peak.
    TwoPoints,
    /// The mean of (t - theta)/(-ln(1 - s)) in the transient.
    PlainAverage,
    /// The same, each weighted by the inverse of its variance, (t - theta)^2 exp(-2 (t - theta)/tau).
    WeightedAverage,
    /// Where levels are reached and left.
    Crossings,
    /// A parabola over the first peak.
    Peak,
    /// The first two peaks, each by a parabola.
    TwoPeaks,
    /// The frequency at which the phase is -45 degrees.
    Phase,
    /// The process of least squared errors over all rows.
    LeastSquares,
}

impl StepFigure {
    /// Its name, as tables have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gain => "gain",
            Self::DeadTime => "dead time",
            Self::TimeConstant => "time constant",
            Self::RiseTime => "rise time",
            Self::SettlingTime => "settling time",
            Self::Overshoot => "overshoot",
            Self::PeakTime => "peak time",
            Self::Period => "period",
            Self::Damping => "damping",
            Self::NaturalFrequency => "natural frequency",
        }
    }

    /// Its unit; empty for a gain, which is in those of the log, and for ratios.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gain | Self::Overshoot | Self::Damping => "",
            Self::NaturalFrequency => "rad/s",
            _ => "s",
        }
    }
}

impl StepMethod {
    /// What it is for a figure, in a few words.
    pub fn title(self, figure: StepFigure) -> &'static str {
        match (self, figure) {
            (Self::Regime, _) => "levels before and after",
            (Self::NoiseBand, _) => "leaves the noise",
            (Self::Tangent, _) => "steepest tangent",
            (Self::Level, _) => "63.2 % of the change",
            (Self::TwoPoints, _) => "two points",
            (Self::PlainAverage, _) => "mean of t-bar",
            (Self::WeightedAverage, _) => "weighted t-bar",
            (Self::Crossings, StepFigure::SettlingTime) => "stays within 2 %",
            (Self::Crossings, _) => "10 % to 90 %",
            (Self::Peak, StepFigure::Overshoot | StepFigure::PeakTime) => "parabola over the peak",
            (Self::Peak, _) => "first peak",
            (Self::TwoPeaks, StepFigure::Damping) => "logarithmic decrement",
            (Self::TwoPeaks, _) => "two peaks",
            (Self::Phase, _) => "phase of -45 degrees",
            (Self::LeastSquares, _) => "least squares, all rows",
        }
    }
}

impl Shape {
    /// What it is, in a few words.
    pub fn title(self) -> &'static str {
        match self {
            Self::FirstOrder => "first order",
            Self::Overdamped => "S-shaped, no first order",
            Self::Underdamped => "overshoots",
        }
    }
}

impl StepResponse {
    /// The estimate of a figure by a method, if there is one.
    pub fn estimate(&self, figure: StepFigure, method: StepMethod) -> Option<&StepEstimate> {
        self.estimates.iter().find(|estimate| (estimate.figure, estimate.method) == (figure, method))
    }

    /// The estimate of a figure to trust, if there is one.
    pub fn trusted(&self, figure: StepFigure) -> Option<&StepEstimate> {
        self.estimates.iter().find(|estimate| estimate.figure == figure && estimate.trusted)
    }
}

impl StepTest {
    /// A figure by a method over all steps, if one has it.
    pub fn summary(&self, figure: StepFigure, method: StepMethod) -> Option<&StepSummary> {
        self.summary.iter().find(|summary| (summary.figure, summary.method) == (figure, method))
    }
}

impl Document for StepTest {
    const NAME: &'static str = "step test";
    const SCHEMA: &'static str = "thetahat.step/1";
    const REMEDY: &'static str = "give a file that step wrote of a log";

    document_methods!();

    fn check(&self) -> Result<(), Error> {
        let both = |step: &Step| step.response.is_some() != step.refused.is_some();
        match self.steps.iter().position(|step| !both(step)) {
            Some(at) => Err(Error::report(format!(
                "step {} has neither a response nor a reason why it has none; {}",
                at + 1,
                Self::REMEDY
            ))),
            None => Ok(()),
        }
    }
}
