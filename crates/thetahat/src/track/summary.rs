use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Tracker;
use crate::Document;
use crate::document::document_methods;
use crate::model::{Map, Orders, Parameter};

/// What trackers of one log have come to, side by side: the JSON document `thetahat.track/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrackSummary {
    /// `thetahat.track/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The rows, missing and malformed ones included.
    pub rows: u64,
    /// How often an unknown number of samples was missing between two rows.
    pub gaps: u64,
    /// The trackers, one for each way to forget.
    pub trackers: Vec<TrackerSummary>,
}

/// What a tracker has come to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrackerSummary {
    /// The output that it is of; none where there is but one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output: Option<String>,
    /// Of how many outputs the past is in its equation; none: of its own alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupled: Option<usize>,
    /// What it forgets, as [`Policy`](crate::track::Policy) is written.
    pub forgetting: String,
    /// The orders of its model, without the constant; of a nonlinear one its lags.
    pub orders: Orders,
    /// The functions of the lags, in the order of the parameters; none of a linear model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<Map>,
    /// What was taken from the channels: the inputs, then the output.
    pub offsets: Vec<f64>,
    /// The typical magnitudes of the channels, in the same order; none while they were not known.
    pub scales: Option<Vec<f64>>,
    /// The number of one-step predictions that the figures are of.
    pub samples: u64,
    /// The mean of their squared errors.
    pub mean_squared_error: Option<f64>,
    /// Their fit in percent.
    pub fit: Option<f64>,
    /// The mean of their normalised squares: 1 if the standard deviations are right.
    pub mean_nis: Option<f64>,
    /// Their Gaussian log-likelihood.
    pub log_likelihood: Option<f64>,
    /// How many alarms were given.
    pub alarms: u64,
    /// The variance of e.
    pub noise_variance: Option<f64>,
    /// The parameters; none before there is an estimate.
    pub parameters: Vec<Parameter>,
}

impl Tracker {
    /// What it has come to. How many alarms it gave, and what its output is called, is known to who counted and named
    /// them.
    pub fn summary(&self, alarms: u64) -> TrackerSummary {
        let coupled = self.coupled_outputs();
        let all =
            |inputs: &[f64], output: f64| inputs.iter().skip(coupled).copied().chain([output]).collect();
        let values = self.parameters().unwrap_or_default();
        let mut errors = vec![f64::NAN; self.names().len()];
        // There is one place for each.
        let _ = self.write_standard_errors(&mut errors);
        let parameters = self.names().iter().zip(values).zip(&errors);
        let score = self.score();
        TrackerSummary {
            output: None,
            coupled: (coupled > 0).then_some(coupled),
            forgetting: self.plan().forgetting.to_string(),
            orders: self.orders().clone(),
            map: self.map().cloned(),
            offsets: all(&self.offsets().inputs, self.offsets().output),
            scales: self.scales().map(|scales| all(&scales.inputs, scales.output)),
            samples: score.samples(),
            mean_squared_error: score.mean_squared_error(),
            fit: score.fit(),
            mean_nis: score.mean_nis(),
            log_likelihood: score.log_likelihood(),
            alarms,
            noise_variance: self.noise_variance(),
            parameters: parameters
                .map(|((name, &value), &error)| Parameter {
                    name: name.clone(),
                    value,
                    standard_error: error.is_finite().then_some(error),
                })
                .collect(),
        }
    }
}

impl TrackSummary {
    /// The document about these trackers.
    pub fn new(rows: u64, gaps: u64, trackers: Vec<TrackerSummary>) -> Self {
        let generator = format!("thetahat {}", env!("CARGO_PKG_VERSION"));
        Self { schema: Self::SCHEMA.to_owned(), generator, rows, gaps, trackers }
    }
}

impl Document for TrackSummary {
    const NAME: &'static str = "summary";
    const SCHEMA: &'static str = "thetahat.track/1";
    const REMEDY: &'static str = "give a file that track wrote";

    document_methods!();
}
