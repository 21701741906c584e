use std::collections::HashSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Document;
use crate::data::{Finding, Rows, Source};
use crate::document::document_methods;
use crate::validate::feedback;

/// The checks of a log before a fit. The JSON document `thetahat.inspection/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Inspection {
    /// `thetahat.inspection/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// Where the log came from.
    pub log: Source,
    /// The number of rows.
    pub rows: usize,
    /// How many experiments they are.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub experiments: usize,
    /// The clock.
    pub clock: Clock,
    /// One entry for each channel.
    pub channels: Vec<ChannelQuality>,
    /// One entry for each input.
    pub excitation: Vec<Excitation>,
    /// One entry for each input.
    pub delays: Vec<DelayEstimate>,
    /// One entry for each input.
    pub feedback: Vec<Feedback>,
    /// How many rows a step test is at rest before its first step: no input changes, and the output hardly does. None
    /// for other logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<usize>,
    /// The command that would fit a model to it; none without an output.
    pub command: Option<String>,
    /// What a careful reader should know, in the order in which it is best read.
    pub findings: Vec<Finding>,
}

fn one() -> usize {
    1
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_one(count: &usize) -> bool {
    *count == 1
}

/// The clock of a log; of several experiments all of theirs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Clock {
    /// The median step, in seconds.
    pub sample_time: f64,
    /// Whether the log has times of its own.
    pub measured: bool,
    /// The shortest and the longest step.
    pub steps: (f64, f64),
    /// The standard deviation of the steps that are no gaps, over the median.
    pub jitter: f64,
    /// Steps longer than 1.5 medians.
    pub gaps: usize,
    /// The first rows (20 at most) after a gap.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gap_rows: Vec<usize>,
    /// Whether the log has to be resampled before a fit.
    pub irregular: bool,
}

/// The quality of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChannelQuality {
    /// The channel's name.
    pub name: String,
    /// `input`, `output` or none.
    pub role: Option<String>,
    /// Rows without a value.
    pub missing: usize,
    /// The first of them (20 ranges at most).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing_rows: Vec<Rows>,
    /// The smallest value; none if there is no value. The same holds for the others.
    pub minimum: Option<f64>,
    /// The largest value.
    pub maximum: Option<f64>,
    /// The mean.
    pub mean: Option<f64>,
    /// The standard deviation about the mean.
    pub standard_deviation: Option<f64>,
    /// The slope of the best straight line, per second.
    pub trend: Option<f64>,
    /// The fraction of the variance that the line explains.
    pub trend_share: Option<f64>,
    /// Rows that repeat the value before them.
    pub repeated: usize,
    /// The longest run of equal values, in rows.
    pub longest_hold: usize,
    /// Its rows, where it is no habit of the channel to stand still: a sensor that is stuck.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stuck: Option<Rows>,
    /// The step of which all values are multiples, away from an offset, to rounding; none if there is none.
    pub quantization: Option<f64>,
    /// Segments at the largest or the smallest value.
    pub saturation: Option<Saturation>,
    /// The first rows (1-based, 20 at most) of values far from their neighbours.
    pub outliers: Vec<usize>,
    /// How many such values there are.
    pub outlier_count: usize,
}

/// How often a channel rests at its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Saturation {
    /// Rows at the smallest value, in runs of several.
    pub low: usize,
    /// Rows at the largest value, in runs of several.
    pub high: usize,
    /// The first runs (20 at most) at the smallest value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub low_rows: Vec<Rows>,
    /// The first runs (20 at most) at the largest value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub high_rows: Vec<Rows>,
}

impl Saturation {
    /// So many rows at the limits, and the runs that they are; none where there are no such rows.
    pub(super) fn of(
        low: usize,
        high: usize,
        low_rows: impl FnOnce() -> Vec<Rows>,
        high_rows: impl FnOnce() -> Vec<Rows>,
    ) -> Option<Self> {
        (low + high > 0).then(|| Self {
            low,
            high,
            low_rows: if low > 0 { low_rows() } else { Vec::new() },
            high_rows: if high > 0 { high_rows() } else { Vec::new() },
        })
    }
}

/// How rich an input is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Excitation {
    /// The input channel.
    pub input: String,
    /// The order of persistence of excitation: this many parameters it can tell apart. No more than `highest`.
    pub order: usize,
    /// The highest order tried.
    pub highest: usize,
    /// The fraction of samples at which it changes.
    pub changes: f64,
    /// Its power spectral density, the mean removed.
    pub spectrum: Vec<SpectrumPoint>,
    /// The first input before it that it equals, but for scale and offset: no fit can tell the two apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub same_as: Option<String>,
}

/// One point of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpectrumPoint {
    /// Radians per second.
    pub frequency: f64,
    /// Units of the channel squared, per radian per second.
    pub density: f64,
}

/// The delay from an input, as a fit without orders estimates it, and what pictures of it and of feedback show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DelayEstimate {
    /// The input channel.
    pub input: String,
    /// Samples from a change of the input to its first effect; none if no effect is seen, or there are too few rows.
    pub nk: Option<usize>,
    /// How sure that is: the posterior probability of this delay among 0, 1, …, by the MDL of long ARX models.
    pub confidence: Option<f64>,
    /// The correlation of the output with the input before it, both prewhitened, at lags 0, 1, …
    pub correlation: Vec<f64>,
    /// The correlation of the input with the output before it at lags 1, 2, …: none for an input that does not follow
    /// the output.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub following: Vec<f64>,
    /// Half the width of the 95 % band of both.
    pub band: f64,
    /// The impulse response at lags 0, 1, … in units of the output for one of the input: that of all inputs together by
    /// regularised least squares with the kernel DC (Chen, Ohlsson and Ljung 2012), over the first 20,000 rows. Empty
    /// where there are too few rows, or more than 200 values of all inputs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub impulse_response: Vec<f64>,
    /// Its standard errors, for white noise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub impulse_response_errors: Vec<f64>,
}

impl DelayEstimate {
    /// Of an input of which nothing is known.
    pub(super) fn unknown(input: &str) -> Self {
        Self {
            input: input.to_owned(),
            nk: None,
            confidence: None,
            correlation: Vec::new(),
            following: Vec::new(),
            band: 0.0,
            impulse_response: Vec::new(),
            impulse_response_errors: Vec::new(),
        }
    }

    /// Puts the impulse response into other units, if it stays in the range of numbers.
    pub(super) fn scale(&mut self, factor: f64) {
        let all = || self.impulse_response.iter().chain(&self.impulse_response_errors);
        if !factor.is_normal() || all().any(|value| !(factor * value).is_finite()) {
            self.impulse_response.clear();
            self.impulse_response_errors.clear();
        }
        self.impulse_response.iter_mut().for_each(|value| *value *= factor);
        self.impulse_response_errors.iter_mut().for_each(|value| *value *= factor);
    }
}

/// Whether an input follows the output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Feedback {
    /// The input channel.
    pub input: String,
    /// How often past errors of the output help as much to predict an input that does not follow it; none where it
    /// cannot be said.
    pub p_value: Option<f64>,
    /// The fraction of what is new in the input that they predict on rows left out; negative where they mislead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explained: Option<f64>,
    /// Whether feedback is suspected: the p-value is below 1 %, and they explain more than 0.5 %.
    pub found: bool,
    /// Whether there is feedback beyond doubt: a fit that chooses the orders then leaves out what is biased by it.
    #[serde(default)]
    pub certain: bool,
}

impl Feedback {
    pub(super) fn new(input: &str, found: Option<feedback::Feedback>) -> Self {
        Self {
            input: input.to_owned(),
            p_value: found.map(|found| found.p_value),
            explained: found.map(|found| found.explained),
            found: found.is_some_and(|found| found.is_suspected()),
            certain: found.is_some_and(|found| found.is_certain()),
        }
    }
}

fn only<T: Clone>(all: &[T], wanted: impl Fn(&T) -> bool) -> Vec<T> {
    all.iter().filter(|one| wanted(one)).cloned().collect()
}

impl ChannelQuality {
    /// That of a channel without any value.
    pub(super) fn without_values(name: &str, role: Option<&str>) -> Self {
        Self {
            name: name.to_owned(),
            role: role.map(str::to_owned),
            missing: 0,
            missing_rows: Vec::new(),
            minimum: None,
            maximum: None,
            mean: None,
            standard_deviation: None,
            trend: None,
            trend_share: None,
            repeated: 0,
            longest_hold: 0,
            stuck: None,
            quantization: None,
            saturation: None,
            outliers: Vec::new(),
            outlier_count: 0,
        }
    }

    /// How many things may be wrong with it.
    fn faults(&self) -> usize {
        let constant = self.minimum == self.maximum;
        let faults = [constant, self.missing > 0, self.outlier_count > 0, self.saturation.is_some()];
        faults.into_iter().filter(|fault| *fault).count()
    }
}

/// An input that changes so few times is a step test.
pub(super) const FEW_CHANGES: f64 = 5.0;
/// Below this confidence a delay is worth a warning.
pub(super) const UNSURE: f64 = 0.5;

impl Inspection {
    /// The findings in plain words, each in a sentence.
    pub fn warnings(&self) -> Vec<String> {
        self.findings.iter().map(ToString::to_string).collect()
    }

    /// How many times an input changes.
    pub(super) fn changes(&self, input: &str) -> f64 {
        let pairs = self.log.rows.len().saturating_sub(1) as f64;
        self.excitation.iter().find(|of| of.input == input).map_or(0.0, |of| of.changes * pairs)
    }

    /// Takes back an uncertain delay of an input that changes a few times: one response is no sample of delays.
    pub(super) fn doubt_steps(&mut self) {
        let few: Vec<String> = self.excitation.iter().map(|of| of.input.clone()).collect();
        let few: Vec<String> = few.into_iter().filter(|input| self.changes(input) <= FEW_CHANGES).collect();
        for delay in self.delays.iter_mut().filter(|of| few.contains(&of.input)) {
            if delay.confidence.is_some_and(|confidence| confidence < UNSURE) {
                (delay.nk, delay.confidence) = (None, None);
            }
        }
    }

    /// Gives inputs that are the same as another one its delay.
    pub(super) fn share_delays(&mut self) {
        for of in &self.excitation {
            let Some(first) = &of.same_as else { continue };
            let of_first = self.delays.iter().find(|delay| delay.input == *first).cloned();
            let own = self.delays.iter_mut().find(|delay| delay.input == of.input);
            if let (Some(first), Some(own)) = (of_first, own) {
                (own.nk, own.confidence) = (first.nk, first.confidence);
            }
        }
    }

    /// The same about the channels that matter most, `most` at most, in the order of the log: the output comes before
    /// the inputs, these before the others, and among them those first with the most to say of. Findings are cut to as
    /// many. A log of up to twice as many channels, or findings, keeps all of them. O(M log M) for M channels.
    pub fn brief(&self, most: usize) -> Self {
        let role = |channel: &ChannelQuality| match channel.role.as_deref() {
            Some("output") => 2,
            Some(_) => 1,
            None => 0,
        };
        let shown = |all: usize| if all > 2 * most { most } else { all };
        let mut positions: Vec<usize> = (0..self.channels.len()).collect();
        let rank = |&at: &usize| (role(&self.channels[at]), self.channels[at].faults());
        // Equal ones stay in the order of the log.
        positions.sort_by_key(|at| std::cmp::Reverse(rank(at)));
        positions.truncate(shown(self.channels.len()));
        positions.sort_unstable();
        let names: HashSet<&str> = positions.iter().map(|&at| self.channels[at].name.as_str()).collect();
        Self {
            schema: self.schema.clone(),
            generator: self.generator.clone(),
            log: self.log.clone(),
            rows: self.rows,
            experiments: self.experiments,
            clock: self.clock.clone(),
            channels: positions.iter().map(|&at| self.channels[at].clone()).collect(),
            excitation: only(&self.excitation, |of| names.contains(of.input.as_str())),
            delays: only(&self.delays, |of| names.contains(of.input.as_str())),
            feedback: only(&self.feedback, |of| names.contains(of.input.as_str())),
            rest: self.rest,
            command: self.command.clone(),
            findings: self.findings[..shown(self.findings.len())].to_vec(),
        }
    }
}

impl Document for Inspection {
    const NAME: &'static str = "inspection";
    const SCHEMA: &'static str = "thetahat.inspection/1";
    const REMEDY: &'static str = "give a file that inspect wrote";

    document_methods!();
}
