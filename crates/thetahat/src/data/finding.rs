use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Rows;

/// What was found in a log that a careful reader should know: what was seen, where, and what it means or what to do.
///
/// As a sentence it is `seen: advice`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// What kind of thing it is.
    pub kind: FindingKind,
    /// The channels that it is about; none where it is the whole log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<String>,
    /// The rows where it is seen, the first 20 ranges of them; none where it is all rows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<Rows>,
    /// The evidence, with its figures.
    pub seen: String,
    /// What it means, or what to do about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
}

/// What kind of thing was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// How the log was read, or what of it was not.
    Reading,
    /// What the inspection does not say, and why.
    LeftOut,
    /// The time repeats or goes back.
    TimeGoesBack,
    /// The clock has two rates.
    TwoRates,
    /// The steps of the clock differ.
    IrregularClock,
    /// Steps of the clock that are much longer than the others.
    Gaps,
    /// The figures are those of a resampled log.
    Resampled,
    /// There are too few rows.
    FewRows,
    /// A channel without a value.
    NoValues,
    /// Rows without a value.
    Missing,
    /// A channel that has one value only.
    Constant,
    /// Values far from their neighbours.
    Outliers,
    /// A sensor that stands still.
    Stuck,
    /// A channel that rests at its limit.
    Saturation,
    /// A channel that is rounded coarsely.
    Coarse,
    /// The log ends in rows in which nothing changes.
    Padding,
    /// An input that excites nothing.
    NoExcitation,
    /// An input that changes a few times only.
    FewChanges,
    /// An input that determines a few parameters only.
    LowExcitation,
    /// An input that is a sum of a few sinusoids.
    FewSinusoids,
    /// Two inputs that are the same but for scale and offset.
    SameInputs,
    /// An output that follows a straight line.
    Trend,
    /// A step test that begins at rest.
    Rest,
    /// A log that does not begin at rest.
    InMotion,
    /// An output that follows the sum of an input.
    Integration,
    /// An output whose level wanders, and no input makes it.
    Drift,
    /// An output that answers nonlinearly.
    Nonlinear,
    /// No channel is the output.
    NoOutput,
    /// No channel is an input.
    NoInput,
    /// An input without a visible effect.
    NoEffect,
    /// An input that follows the output.
    Feedback,
    /// An unstable plant, which something holds.
    Unstable,
    /// A delay that the log does not tell for sure.
    UncertainDelay,
    /// An output that follows an input within the same row.
    SameRow,
}

impl Finding {
    pub(crate) fn new(kind: FindingKind, seen: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { advice: Some(advice.into()), ..Self::note(kind, seen) }
    }

    fn note(kind: FindingKind, seen: impl Into<String>) -> Self {
        Self { kind, channels: Vec::new(), rows: Vec::new(), seen: seen.into(), advice: None }
    }

    /// What was found while the log was read, in a sentence.
    pub fn reading(sentence: impl Into<String>) -> Self {
        Self::note(FindingKind::Reading, sentence)
    }

    /// What the inspection does not say, in a sentence.
    pub(crate) fn left_out(sentence: impl Into<String>) -> Self {
        Self::note(FindingKind::LeftOut, sentence)
    }

    /// Of this channel, too.
    pub(crate) fn of(mut self, channel: &str) -> Self {
        self.channels.push(channel.to_owned());
        self
    }

    /// In these rows.
    pub(crate) fn at(mut self, rows: Vec<Rows>) -> Self {
        self.rows = rows;
        self
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.advice {
            Some(advice) => write!(f, "{}: {advice}", self.seen),
            None => f.write_str(&self.seen),
        }
    }
}

/// What a fit did by itself because of what it found in the log. Who says otherwise has it otherwise.
///
/// As a sentence it is `because: did (instead says otherwise)`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Decision {
    /// What was found.
    pub kind: FindingKind,
    /// The channels that it is about; none where it is the whole log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<String>,
    /// The evidence, with its figures.
    pub because: String,
    /// What was done.
    pub did: String,
    /// The option that says otherwise.
    pub instead: String,
}

impl fmt::Display for Decision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} ({} says otherwise)", self.because, self.did, self.instead)
    }
}
