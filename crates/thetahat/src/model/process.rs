//! Processes: gain, lags, zero, integrator and dead time in continuous time.

mod chain;
mod linear;
mod structure;
#[cfg(test)]
pub(super) mod tests;

pub(super) use chain::MOST_STATES;
pub(crate) use chain::{Chain, Columns, State, Transition};
pub use structure::ProcessStructure;
pub(crate) use structure::{MOST_POLES, Parts};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::distribution::{student_factor, student_two_sided};

use super::fitted::{only, only_variance};
use super::{OffsetCovariance, Parameter, Signal};
use crate::Error;

/// A process in continuous time, with a [structure](ProcessStructure) from each input to the output:
///
/// ```text
/// y(t) = sum_j G_j(s) u_j(t) + e(t)
/// ```
///
/// y and u are deviations from the signals' offsets. Inputs are held from each row to the next one, and the response is
/// exact at the times of the rows, whatever the clock. Before the first row of a log the process has been at rest with
/// the input of that row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProcessModel {
    /// What it is from each input, such as `p1d`.
    pub structures: Vec<ProcessStructure>,
    /// The median time from one row to the next of the log that it was fitted to, in seconds: responses and frequency
    /// responses are those of an input that is held as long.
    pub sample_time: f64,
    /// The inputs.
    pub inputs: Vec<Signal>,
    /// The output: a list of one in the document.
    #[serde(rename = "outputs", with = "only")]
    #[schemars(with = "[Signal; 1]")]
    pub output: Signal,
    /// The parameters with their standard errors, those of one input after those of the other, in the order of
    /// `covariance`. With several inputs their names end with that of the input, such as `K[heater]`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of the parameters, row by row: errors may have any colour. None where it cannot be
    /// computed.
    pub covariance: Option<Vec<Vec<f64>>>,
    /// The same together with the offset of the output; none where that was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_covariance: Option<OffsetCovariance>,
    /// The variance of e: the sum of squared residuals over N - p. A matrix of one row in the document.
    #[serde(rename = "noise_covariance", with = "only_variance")]
    #[schemars(with = "[[f64; 1]; 1]")]
    pub noise_variance: f64,
    /// N - p; none where nothing is left of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<usize>,
    /// Whether logs begin in a state that explains the outputs best, instead of at rest.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub free_start: bool,
}

impl ProcessModel {
    /// The names of the parameters of such structures from inputs of these names.
    pub(crate) fn names(structures: &[ProcessStructure], inputs: &[String]) -> Vec<String> {
        let several = structures.len() > 1;
        let of = |(structure, input): (&ProcessStructure, &String)| {
            let named = |name: String| if several { format!("{name}[{input}]") } else { name };
            structure.names().into_iter().map(named).collect::<Vec<_>>()
        };
        structures.iter().zip(inputs).flat_map(of).collect()
    }

    /// The parameters of each input.
    pub fn of_inputs(&self) -> impl Iterator<Item = &[Parameter]> {
        let mut rest = self.parameters.as_slice();
        self.structures.iter().map(move |structure| {
            let (own, others) = rest.split_at(structure.parameters().min(rest.len()));
            rest = others;
            own
        })
    }

    /// The values of the parameters of each input, taken apart.
    pub(crate) fn parts(&self) -> Vec<Parts<f64>> {
        let each = self.structures.iter().zip(self.of_inputs());
        each.map(|(structure, own)| {
            structure.taken_apart(&own.iter().map(|parameter| parameter.value).collect::<Vec<_>>())
        })
        .collect()
    }

    /// What it is called, such as `process p1d`.
    pub fn name(&self) -> String {
        let words: Vec<String> = self.structures.iter().map(ToString::to_string).collect();
        format!("process {}", words.join(", "))
    }

    /// How much larger the standard deviation of Student's distribution is than its scale: see [`Self::quantile`].
    pub(crate) fn student_factor(&self) -> f64 {
        student_factor(self.degrees_of_freedom)
    }

    /// How many standard errors from an estimate an interval ends that has this probability.
    pub(crate) fn quantile(&self, level: f64) -> f64 {
        student_two_sided(1.0 - level, self.degrees_of_freedom)
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong =
            |what: &str| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        if self.inputs.is_empty() || self.inputs.len() != self.structures.len() {
            return wrong("structures and inputs are not as many");
        }
        let names: Vec<String> = self.inputs.iter().map(|input| input.name.clone()).collect();
        let expected = Self::names(&self.structures, &names);
        if expected.len() != self.parameters.len()
            || expected.iter().zip(&self.parameters).any(|(name, own)| *name != own.name)
        {
            return wrong("parameters are not those of the structures");
        }
        let mut names: Vec<&str> =
            names.iter().map(String::as_str).chain([self.output.name.as_str()]).collect();
        names.sort_unstable();
        if names.windows(2).any(|pair| pair[0] == pair[1]) {
            return wrong("inputs and output share a name");
        }
        if !(self.sample_time.is_finite() && self.sample_time > 0.0) {
            return wrong("sample_time is not positive");
        }
        let offsets = self.inputs.iter().chain([&self.output]).flat_map(|s| [s.offset.level, s.offset.slope]);
        if !offsets.chain(self.parameters.iter().map(|own| own.value)).all(f64::is_finite) {
            return wrong("a parameter or an offset is not finite");
        }
        for parts in self.parts() {
            if parts.shape.iter().any(|value| *value <= 0.0) || parts.dead_time < 0.0 {
                return wrong("parameters have a time constant that is not above 0, or a dead time below it");
            }
        }
        if !(self.noise_variance.is_finite() && self.noise_variance >= 0.0) {
            return wrong("noise_covariance is not a variance");
        }
        let square = |rows: &Vec<Vec<f64>>, count: usize| {
            rows.len() == count
                && rows.iter().all(|row| row.len() == count && row.iter().all(|value| value.is_finite()))
        };
        let count = self.parameters.len();
        if !self.covariance.as_ref().is_none_or(|rows| square(rows, count)) {
            return wrong("covariance does not have a row and a column for each parameter");
        }
        if let Some(open) = &self.offset_covariance
            && !square(&open.covariance, count + open.count())
        {
            return wrong(
                "offset_covariance does not have a row and a column for each parameter and the offset",
            );
        }
        Ok(())
    }
}
