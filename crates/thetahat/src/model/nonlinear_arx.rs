//! Nonlinear ARX models: y(t) = g(phi(t)) + e(t).

mod functions;
mod map;
mod terms;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use functions::Functions;
pub(crate) use map::Evaluator;
pub use map::{Map, Membership};

use super::fitted::{only, only_variance};
use super::orders::lag_name;
use super::{Orders, Parameter, Signal, is_covariance};
use crate::Error;

/// A nonlinear ARX model with one output:
///
/// ```text
/// y(t) = s g(z(t)) + e(t),   z_i(t) = x_i(t - l_i)/s_i,   g(z) = sum_j theta_j f_j(z)
/// ```
///
/// where x_i is the output or an input as a deviation from its offset, l_i a lag, s_i the scale of that channel, s that of the output,
/// and f_j the functions of the [`Map`] (Ljung, System Identification, 2nd ed. 1999, section 5.4). Scales and offsets come from the rows
/// of the estimation, so that z has about the size of 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NonlinearArxModel {
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The inputs.
    pub inputs: Vec<Signal>,
    /// The output: a list of one in the document.
    #[serde(rename = "outputs", with = "only")]
    #[schemars(with = "[Signal; 1]")]
    pub output: Signal,
    /// z, in its order.
    pub regressors: Vec<Regressor>,
    /// s, in units of the output.
    pub output_scale: f64,
    /// The least and the largest output of the estimation rows, as deviations from the offset.
    pub output_range: [f64; 2],
    /// The functions f.
    pub map: Map,
    /// The variance of e: the sum of squared residuals over N - p. A matrix of one row in the document.
    #[serde(rename = "noise_covariance", with = "only_variance")]
    #[schemars(with = "[[f64; 1]; 1]")]
    pub noise_variance: f64,
    /// N - p, the degrees of freedom of `noise_variance`.
    pub degrees_of_freedom: Option<usize>,
    /// theta, one for each function, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of the parameters, row by row; none where no theory gives one.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// A lag of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Regressor {
    /// The channel: the output or an input.
    pub channel: String,
    /// How many samples before the output it is read.
    pub lag: usize,
    /// What it is divided by, in units of the channel.
    pub scale: f64,
    /// Its least and its largest value in the estimation rows, as deviations from the channel's offset.
    pub range: [f64; 2],
}

impl Regressor {
    /// Such as y(k-1), or u(k) without a lag.
    pub fn name(&self) -> String {
        lag_name(&self.channel, self.lag)
    }
}

impl NonlinearArxModel {
    /// Where each regressor is read: 0 for the output, 1, 2, … for the inputs.
    pub(crate) fn sources(&self) -> Vec<usize> {
        let place = |regressor: &Regressor| {
            self.inputs.iter().position(|input| input.name == regressor.channel).map_or(0, |input| input + 1)
        };
        self.regressors.iter().map(place).collect()
    }

    /// Its lags as the orders of an ARX model: na of the output, and nb of each input from nk on.
    ///
    /// # Errors
    /// [`Error::Report`] where regressors are not lags in a row, each channel with one scale, as those of every fit are.
    pub fn lag_orders(&self) -> Result<Orders, Error> {
        let sources = self.sources();
        let of = |source: usize| {
            let own = sources.iter().zip(&self.regressors).filter(move |(other, _)| **other == source);
            own.map(|(_, regressor)| (regressor.lag, regressor.scale)).collect::<Vec<(usize, f64)>>()
        };
        let channels: Vec<Vec<(usize, f64)>> = (0..=self.inputs.len()).map(of).collect();
        let firsts: Vec<usize> =
            channels.iter().map(|lags| lags.first().map_or(1, |(first, _)| *first)).collect();
        let in_a_row = |(lags, first): (&Vec<(usize, f64)>, &usize)| {
            lags.iter().enumerate().all(|(at, (lag, scale))| *lag == first + at && *scale == lags[0].1)
        };
        let of_output = channels[0].iter().all(|(_, scale)| *scale == self.output_scale) && firsts[0] == 1;
        if !sources.is_sorted() || !of_output || !channels.iter().zip(&firsts).all(in_a_row) {
            return Err(Error::report(
                "the regressors of the report are not lags in a row, each channel with one scale; they cannot be tracked",
            ));
        }
        let counts: Vec<usize> = channels.iter().map(Vec::len).collect();
        Orders::arx(counts[0], &counts[1..], &firsts[1..])
    }

    /// The longest lag of the output; 0 where none is read.
    pub(crate) fn output_lags(&self) -> usize {
        let own = self.regressors.iter().filter(|regressor| regressor.channel == self.output.name);
        own.map(|regressor| regressor.lag).max().unwrap_or(0)
    }

    /// The longest lag of any channel.
    pub(crate) fn lags(&self) -> usize {
        self.regressors.iter().map(|regressor| regressor.lag).max().unwrap_or(0)
    }

    /// Such as NARX polynomial of 8 terms.
    pub(crate) fn name(&self) -> String {
        self.map.name(self.parameters.len())
    }

    /// What only linear models do, asked of this one.
    pub(super) fn is_not_linear(&self, what: &str) -> Error {
        Error::argument(
            "model",
            format!(
                "{what} is of linear models, and this one is not: it predicts, simulates, validates and compares"
            ),
        )
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong =
            |what: String| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        let channels: Vec<&str> =
            self.inputs.iter().chain([&self.output]).map(|signal| signal.name.as_str()).collect();
        if self.regressors.is_empty() {
            return wrong("regressors has none".to_owned());
        }
        for (place, regressor) in self.regressors.iter().enumerate() {
            if !channels.contains(&regressor.channel.as_str()) {
                return wrong(format!("regressors[{place}].channel is none of its signals"));
            }
            if regressor.channel == self.output.name && regressor.lag == 0 {
                return wrong(format!("regressors[{place}] is the output itself"));
            }
            if !(regressor.scale.is_finite() && regressor.scale > 0.0) {
                return wrong(format!("regressors[{place}].scale is not a positive number"));
            }
            if regressor.lag > crate::model::LARGEST {
                return wrong(format!("regressors[{place}].lag is too long"));
            }
        }
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.sample_time) || !positive(self.output_scale) {
            return wrong("sample_time or output_scale is not a positive number".to_owned());
        }
        if let Err(what) = self.map.check(self.regressors.len()) {
            return wrong(format!("map.{what}"));
        }
        let count = self.map.parameters(self.regressors.len());
        if self.parameters.len() != count {
            return wrong(format!("parameters has {} entries for {count} functions", self.parameters.len()));
        }
        if self.parameters.iter().any(|parameter| !parameter.value.is_finite()) {
            return wrong("parameters has values that are no numbers".to_owned());
        }
        let square = |rows: &Vec<Vec<f64>>| rows.len() == count && rows.iter().all(|row| row.len() == count);
        if self.covariance.as_ref().is_some_and(|rows| !square(rows) || !is_covariance(rows)) {
            return wrong("covariance does not have a row and a column for each parameter".to_owned());
        }
        Ok(())
    }
}
