//! Whether a model agrees with a measured response.

use std::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::response::MeasuredResponse;
use crate::Error;
use crate::model::LinearModel;
use crate::respond::{FrequencyPoint, FrequencyResponse};

/// How many points of a measured response a model agrees with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Agreement {
    /// The input channel.
    pub input: String,
    /// The points that have a covariance.
    pub points: usize,
    /// Those of them at which the model lies outside of the 95 % region; by chance 5 %.
    pub outside: usize,
    /// The relative difference |G_model - G|/|G|, root mean square over all points.
    pub relative_difference: f64,
}

impl MeasuredResponse {
    /// Compares a model with the points of each input that both have. With d the difference of the two in real and
    /// imaginary part, S the covariance of the measured one and P that of the model, a point lies outside where
    ///
    /// ```text
    /// d' (S + P)^-1 d > 5.99 (t/1.96)^2
    /// ```
    ///
    /// with t the 95 % point of Student's distribution for the measured one ([`FrequencyPoint::excludes`]). Both see
    /// the same noise where the model was fitted to this log: fewer lie outside then. Where the bands are not honest,
    /// more do.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model has another sample time, or a pole at one of the frequencies; if only one of
    /// the two is in continuous time.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log, Record};
    /// use thetahat::estimate::{Initial, arx};
    /// use thetahat::model::{LinearModel, Orders, Signal};
    /// use thetahat::spectrum::{SpectrumPlan, spectrum};
    ///
    /// let (mut u, mut y, mut random) = (vec![0.0], vec![0.0], 1_u32);
    /// let mut next = || {
    ///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    ///     f64::from(random >> 16) / 32_768.0 - 1.0
    /// };
    /// u.extend((1..2000).map(|_| next()));
    /// for t in 1..2000 {
    ///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.1 * next());
    /// }
    /// let orders = Orders::arx(1, &[1], &[1])?;
    /// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
    /// let name = |name: &str| Signal { name: name.into(), ..Signal::default() };
    /// let model = estimate.to_model(&orders, 1.0, vec![name("u")], name("y"))?;
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
    /// let agreement = &spectrum(&log, &[], &SpectrumPlan::new(&["u"], "y"))?.agreement(&LinearModel::Polynomial(&model))?[0];
    /// assert!(agreement.outside < agreement.points / 5);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn agreement(&self, model: &LinearModel<'_>) -> Result<Vec<Agreement>, Error> {
        let of_input = |of_model: &FrequencyResponse| {
            let measured = self.from_input(of_model.input.as_deref()?)?;
            let pairs = || measured.points.iter().zip(&of_model.points);
            let known: Vec<bool> = pairs().filter_map(|(measured, model)| measured.excludes(model)).collect();
            let squares = |(measured, model): (&FrequencyPoint, &FrequencyPoint)| {
                let difference = (measured.re - model.re).hypot(measured.im - model.im);
                (difference / measured.magnitude.value).powi(2)
            };
            Some(Agreement {
                input: of_model.input.clone()?,
                points: known.len(),
                outside: known.iter().filter(|outside| **outside).count(),
                relative_difference: (pairs().map(squares).sum::<f64>()
                    / measured.points.len().max(1) as f64)
                    .sqrt(),
            })
        };
        Ok(self.overlaid(model)?.iter().filter_map(of_input).collect())
    }

    /// The response of a model from each of the inputs that both have, at the frequencies of the points measured from
    /// it. Of its phases those nearest to the measured ones.
    ///
    /// # Errors
    /// As for [`agreement`](Self::agreement).
    pub fn overlaid(&self, model: &LinearModel<'_>) -> Result<Vec<FrequencyResponse>, Error> {
        let is_continuous = matches!(model, LinearModel::Continuous(..));
        if self.continuous && !is_continuous {
            return Err(Error::argument(
                "model",
                "it is of samples, and the response of sines in continuous time: convert it to continuous time first",
            ));
        }
        if is_continuous && !self.continuous {
            return Err(Error::argument(
                "model",
                format!(
                    "it is in continuous time, and the response is of samples every {} s: convert it to these first",
                    self.sample_time
                ),
            ));
        }
        if !self.continuous && (model.sample_time() / self.sample_time - 1.0).abs() > 0.01 {
            return Err(Error::argument(
                "model",
                format!(
                    "its sample time is {} s, that of the response {} s: only responses of one clock can be compared",
                    model.sample_time(),
                    self.sample_time
                ),
            ));
        }
        let highest = if self.continuous { f64::INFINITY } else { PI / model.sample_time() };
        let mut all = Vec::new();
        for measured in &self.responses {
            let frequencies: Vec<f64> =
                measured.points.iter().map(|point| point.frequency.min(highest)).collect();
            let of_model = model.frequency_response(&frequencies)?;
            let Some(mut own) =
                of_model.into_iter().find(|of| of.input.is_some() && of.input == measured.input)
            else {
                continue;
            };
            for (point, measured) in own.points.iter_mut().zip(&measured.points) {
                point.phase.value += TAU * ((measured.phase.value - point.phase.value) / TAU).round();
            }
            all.push(own);
        }
        Ok(all)
    }
}
