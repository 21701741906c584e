//! The document.

use std::collections::HashSet;
use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plan::Method;
use crate::data::{Rows, Source};
use crate::document::document_methods;
use crate::respond::{Correlation, FrequencyResponse};
use crate::{Document, Error};

/// The frequency response from each input to the output, estimated from a log without a model, or measured elsewhere
/// ([`given`](Self::given)). The JSON document `thetahat.response/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeasuredResponse {
    /// `thetahat.response/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// Where the logs came from.
    pub logs: Vec<Source>,
    /// The segments of rows that were used, counted through all logs.
    pub rows: Vec<Rows>,
    /// Seconds from one row to the next, during which the input is held; of sines in continuous time half the period of
    /// the highest frequency.
    pub sample_time: f64,
    /// Whether it is the response to sines in continuous time, as an analyser or an impedance meter measures it, and
    /// not to inputs that are held from row to row.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub continuous: bool,
    /// What was taken from each channel first: `none`, `mean`, `linear` or `start:K`.
    pub detrend: String,
    /// How it was estimated.
    pub method: Method,
    /// The output channel.
    pub output: String,
    /// The response from each input, at the frequencies of `noise`; by `sines` at those of the input. Intervals of
    /// magnitude and phase are those of Student's distribution, each for itself; real and imaginary part are
    /// independent and have the same variance.
    pub responses: Vec<FrequencyResponse>,
    /// What the inputs do not explain of the output.
    pub noise: Vec<NoisePoint>,
    /// Whether the intervals hold what they say.
    pub bands: BandQuality,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// What the inputs do not explain of the output at one frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoisePoint {
    /// Radians per second.
    pub frequency: f64,
    /// The one-sided power spectral density of the noise in units of the output squared per radian per second: its
    /// integral up to half the sampling frequency is the variance. None where the method does not tell.
    pub density: Option<f64>,
    /// The multiple coherence: the fraction of the output's power at this frequency that the inputs explain, 0 to 1.
    pub coherence: Option<f64>,
}

/// Whether the 95 % intervals of a measured response hold what they say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BandQuality {
    /// Whether they do; none where it is not known, or where there are no intervals.
    pub honest: Option<bool>,
    /// The fraction of the points that leave their 95 % region when the resolution is doubled; by chance it is 0.05.
    /// None for methods that have no resolution to double.
    pub outside: Option<f64>,
    /// Why, in plain words.
    pub reason: String,
}

impl MeasuredResponse {
    /// How the errors of its points are correlated.
    pub(crate) fn correlation(&self) -> Correlation {
        let rows = self.rows.iter().map(Rows::len).max().unwrap_or(0) as f64;
        let seconds = |rows: usize| rows as f64 * self.sample_time;
        match self.method {
            Method::Lpm { half_width: Some(lines) } => {
                Correlation::Parabolas(lines as f64 * TAU / (rows * self.sample_time))
            }
            Method::Spa { lags: Some(lags) } => Correlation::Lags(seconds(lags)),
            Method::Welch { window: Some(window), .. } => Correlation::Windows(seconds(window)),
            // Documents have the sizes; lines of their own are independent.
            Method::Lpm { .. } | Method::Spa { .. } | Method::Welch { .. } => Correlation::None,
            Method::Etfe | Method::Sines { .. } | Method::Given => Correlation::None,
        }
    }

    /// The response from an input, if it is one.
    pub fn from_input(&self, input: &str) -> Option<&FrequencyResponse> {
        self.responses.iter().find(|response| response.input.as_deref() == Some(input))
    }
}

impl Document for MeasuredResponse {
    const NAME: &'static str = "response";
    const SCHEMA: &'static str = "thetahat.response/1";
    const REMEDY: &'static str = "give a file that spectrum wrote";

    document_methods!();

    fn check(&self) -> Result<(), Error> {
        let wrong = |what: &str| Err(Error::report(format!("{what}; {}", Self::REMEDY)));
        let frequencies: HashSet<u64> = self.noise.iter().map(|point| point.frequency.to_bits()).collect();
        let known = |frequency: f64| frequencies.contains(&frequency.to_bits());
        let fits = |response: &FrequencyResponse| {
            response.input.is_some() && response.points.iter().all(|point| known(point.frequency))
        };
        if self.responses.is_empty() || !self.responses.iter().all(fits) {
            return wrong("its responses are not at the frequencies of its noise");
        }
        if !(self.sample_time > 0.0 && self.sample_time.is_finite()) {
            return wrong("its sample time is not positive");
        }
        Ok(())
    }
}
