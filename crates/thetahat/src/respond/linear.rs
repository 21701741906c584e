//! Responses of an output of a linear model, whatever its kind.

use super::{FrequencyResponse, TransientResponse};
use super::{continuous, frequency_response, impulse_response, state_space, step_response};
use crate::Error;
use crate::model::LinearModel;

impl LinearModel<'_> {
    /// The responses to sines of `frequencies` in radians per second: from each input, then from the noise if the model
    /// [says it](LinearModel::has_noise). See [`frequency_response`].
    ///
    /// # Errors
    /// As for [`frequency_response`].
    pub fn frequency_response(&self, frequencies: &[f64]) -> Result<Vec<FrequencyResponse>, Error> {
        let mut found = match self {
            Self::Polynomial(model) => frequency_response(model, frequencies)?,
            Self::Transfer(model) => frequency_response(model, frequencies)?,
            Self::StateSpace(model, output) => state_space::frequency_response(model, *output, frequencies)?,
            Self::Continuous(model, output) => continuous::frequency_response(model, *output, frequencies)?,
        };
        found.retain(|response| response.input.is_some() || self.has_noise());
        Ok(found)
    }

    /// The response to a unit step of an input, counted from 0. See [`step_response`]. In continuous time it is exact
    /// at the samples.
    ///
    /// # Errors
    /// As for [`step_response`].
    pub fn step_response(&self, input: usize, samples: Option<usize>) -> Result<TransientResponse, Error> {
        match self {
            Self::Polynomial(model) => step_response(model, input, samples),
            Self::Transfer(model) => step_response(model, input, samples),
            Self::StateSpace(model, output) => {
                state_space::transient(model, (*output, input), samples, |_| 1.0)
            }
            Self::Continuous(model, output) => continuous::step_response(model, (*output, input), samples),
        }
    }

    /// The response to an impulse of an input, counted from 0. See [`impulse_response`]. In continuous time the impulse
    /// has area 1 and no duration.
    ///
    /// # Errors
    /// As for [`impulse_response`]; [`Error::Argument`] in continuous time where the input acts at once, as the
    /// response is then infinite.
    pub fn impulse_response(&self, input: usize, samples: Option<usize>) -> Result<TransientResponse, Error> {
        match self {
            Self::Polynomial(model) => impulse_response(model, input, samples),
            Self::Transfer(model) => impulse_response(model, input, samples),
            Self::StateSpace(model, output) => {
                state_space::transient(model, (*output, input), samples, |t| f64::from(u8::from(t == 0)))
            }
            Self::Continuous(model, output) => continuous::impulse_response(model, (*output, input), samples),
        }
    }

    /// The modulus nearest to 1 of its poles, as a distance from there; 1 without any.
    #[cfg(feature = "present")]
    pub(crate) fn slowest(&self) -> f64 {
        let roots = match self {
            Self::Polynomial(model) => [&model.poles[..], &model.noise_poles].concat(),
            Self::Transfer(model) => [&model.poles[..], &model.noise_poles].concat(),
            Self::StateSpace(model, _) => model.poles.clone(),
            Self::Continuous(model, _) => model.poles.clone(),
        };
        if let Self::Continuous(model, _) = self {
            let rates = model.poles.iter().map(|pole| (model.sample_time * pole.re).abs());
            return rates.filter(|rate| *rate > 0.0).fold(1.0, f64::min);
        }
        let distances = roots.iter().map(|root| (1.0 - root.re.hypot(root.im)).abs());
        distances.filter(|distance| *distance > 0.0).fold(1.0, f64::min)
    }
}
