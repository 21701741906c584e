//! A model in equations as a fit stores it.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::GreyBox;
use crate::Error;
use crate::model::{Parameter, Signal};

/// A model in equations, with the values that a fit has found for its unknown parameters.
///
/// It describes signals as they are: the offsets of its channels are zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EquationsModel {
    /// The inputs, in the order of the text.
    pub inputs: Vec<Signal>,
    /// The outputs, in the order of the text.
    pub outputs: Vec<Signal>,
    /// The length of a sample, in seconds.
    pub sample_time: f64,
    /// The parameters that were fitted, with their standard errors, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of the parameters, row by row.
    pub covariance: Option<Vec<Vec<f64>>>,
    /// The covariance matrix of the noise of the measurements, row by row; on average over the estimation rows, where
    /// it is not the same in all.
    pub noise_covariance: Vec<Vec<f64>>,
    /// The states, in the order of the text.
    pub states: Vec<String>,
    /// The model as it was written, before the fit: TOML, as [`GreyBox`] reads it.
    pub equations: String,
    /// Those of its unknown parameters that were given values before the fit.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub known: BTreeMap<String, f64>,
}

impl EquationsModel {
    /// A model and what was found for its unknown parameters: values, and their covariance; and the variances of the
    /// noise of its outputs, on average.
    pub(crate) fn new(model: &GreyBox, values: &[f64], covariance: Vec<Vec<f64>>, variances: &[f64]) -> Self {
        let signals = |names: &[String]| -> Vec<Signal> {
            names.iter().map(|name| Signal { name: name.clone(), ..Signal::default() }).collect()
        };
        let parameters = model.unknown().zip(values).enumerate().map(|(index, (name, &value))| Parameter {
            name: name.to_owned(),
            value,
            // A noise that vanishes has none.
            standard_error: Some(covariance[index][index].sqrt()).filter(|error| *error > 0.0),
        });
        let row = |i: usize| (0..variances.len()).map(|j| if i == j { variances[i] } else { 0.0 }).collect();
        Self {
            inputs: signals(model.inputs()),
            outputs: signals(model.outputs()),
            sample_time: model.sample_time(),
            parameters: parameters.collect(),
            covariance: Some(covariance),
            noise_covariance: (0..variances.len()).map(row).collect(),
            states: model.states().to_vec(),
            equations: model.text().to_owned(),
            known: model.known.iter().cloned().collect(),
        }
    }

    /// The equations with the values that were found, for a filter: nothing of them is unknown.
    ///
    /// # Errors
    /// [`Error::Model`], [`Error::Argument`] and [`Error::Report`] if the text is no model any more, or has other
    /// parameters.
    pub fn with_values(&self) -> Result<GreyBox, Error> {
        let fitted = self.parameters.iter().map(|parameter| (parameter.name.as_str(), parameter.value));
        let model = self.unfitted()?.with_parameters(&fitted.collect::<Vec<_>>())?;
        let open: Vec<&str> = model.unknown().collect();
        if !open.is_empty() {
            return Err(Error::report(format!(
                "it has no value for: {}; fit the log again",
                open.join(", ")
            )));
        }
        Ok(model)
    }

    /// The equations as they were before the fit, and what was found for the unknown parameters after the change of
    /// variable.
    pub(crate) fn with_variables(&self) -> Result<(GreyBox, Vec<f64>), Error> {
        self.with_values()?;
        let model = self.unfitted()?;
        let value = |name: &str| {
            let found = self.parameters.iter().find(|parameter| parameter.name == name);
            found
                .map(|parameter| parameter.value)
                .ok_or_else(|| Error::report(format!("it has no value for '{name}'; fit the log again")))
        };
        let z = model.parameters().iter().map(|unknown| Ok(unknown.scale.variable(value(&unknown.name)?)));
        let z = z.collect::<Result<Vec<f64>, Error>>()?;
        Ok((model, z))
    }

    fn unfitted(&self) -> Result<GreyBox, Error> {
        let known: Vec<(&str, f64)> =
            self.known.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        GreyBox::from_toml(&self.equations)?.with_parameters(&known)
    }

    /// Checks a model that was read: that its parts fit together.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong =
            |what: &str| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        let model = self.with_values().map_err(|error| Error::report(format!("model.equations: {error}")))?;
        let names = |signals: &[Signal]| -> Vec<String> {
            signals.iter().map(|signal| signal.name.clone()).collect()
        };
        if names(&self.inputs) != model.inputs()
            || names(&self.outputs) != model.outputs()
            || self.states != model.states()
        {
            return wrong("inputs, outputs or states are not those of the equations");
        }
        if self.sample_time != model.sample_time() {
            return wrong("sample_time is not that of the equations");
        }
        let count = self.parameters.len();
        if count != self.unfitted()?.unknown().len() {
            return wrong("parameters are not the unknown ones of the equations");
        }
        let square = |rows: &Vec<Vec<f64>>, count: usize| {
            rows.len() == count
                && rows.iter().all(|row| row.len() == count && row.iter().all(|value| value.is_finite()))
        };
        if !self.covariance.as_ref().is_none_or(|rows| square(rows, count)) {
            return wrong("covariance does not have a row and a column for each parameter");
        }
        if !square(&self.noise_covariance, self.outputs.len()) {
            return wrong("noise_covariance does not have a row and a column for each output");
        }
        Ok(())
    }
}
