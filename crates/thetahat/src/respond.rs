//! What a model says: driven by its inputs alone, or by what was measured, and what it is to each frequency.

mod draws;
pub(crate) mod equations;
mod forecast;
mod free_response;
mod frequency;
mod horizon;
mod innovations;
mod kinds;
mod nis;
pub(crate) mod nonlinear_arx;
mod on_log;
mod predict;
mod sensitivities;
mod simulate;
#[cfg(test)]
mod tests;
mod transient;

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::Record;
use crate::{Error, PolynomialModel};

pub use draws::{Drawn, Draws, draw};
pub use forecast::{Forecast, forecast};
pub use frequency::{FrequencyPoint, FrequencyResponse, frequency_response, logarithmic_frequencies};
pub use horizon::Horizon;
pub(crate) use innovations::{Innovations, innovations};
pub(crate) use nis::NisCount;
pub use nis::NisSummary;
pub(crate) use on_log::{OnLog, PolynomialOnLog, Tested, record_for};
pub(crate) use predict::check_steps;
pub use predict::{predict, prediction_deviation};
pub use sensitivities::prediction_deviations;
pub use simulate::simulate;
pub use transient::{TransientResponse, impulse_response, step_response};

/// What a response starts from, in the words of [`Initial`](crate::Initial) for fits.
///
/// In the first r = max(na, nb + nk - 1 of the inputs without F) + nd samples of a stretch, A, B and D reach back to
/// samples that are not there. Unless these are taken as zero, e is, and the r samples do not count. What [`Initial`](crate::Initial)
/// says of them holds here too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Start {
    /// Rest: all samples before the first of a segment are zero, and all of the segment count.
    Zero,
    /// Nothing but measured samples: those directly before the segment where the log has them, else the segment's first
    /// ones. The first r of all these do not count. They are all that ARX models need. C and F begin there from rest: samples
    /// before the segment warm them up, and without such samples their first outputs are wrong where they were not at
    /// rest.
    Drop,
    /// The initial condition that fits best in the least-squares sense: to the segment's output in a free run, of which all
    /// samples count; to the one-step errors otherwise. The inputs that were measured directly before the segment are used, and for
    /// predictions the outputs, as far as errors reach back to them: max(na, nb + nk - 1) + nd samples. Where there are
    /// fewer, the first r of all these do not count in predictions.
    Estimate,
}

/// A record must have as many inputs as the model.
fn check_inputs(model: &PolynomialModel, record: &Record<'_>) -> Result<(), Error> {
    let (expected, found) = (model.b.len(), record.inputs.len());
    if found == expected {
        return Ok(());
    }
    Err(Error::argument("inputs", format!("the model has {expected} inputs, the record {found}")))
}

/// Where to look from for a start from measured samples, so that a response `ahead` steps ahead begins with the segment.
fn history(model: &PolynomialModel, segment: &Range<usize>, past: usize, ahead: usize) -> usize {
    let forgets = model.c.len() == 1 && model.f.iter().all(|f| f.len() == 1);
    let wanted = if forgets { model.orders.conditioned() + ahead } else { usize::MAX };
    segment.start - past.min(wanted)
}

/// A sum of squared errors below this fraction of the output's is rounding.
pub(crate) const NOTHING_LEFT: f64 = 1e-28;

/// Whether `more` initial conditions are worth it that lower the sum of squared errors over so many samples:
/// N ln(V_without/V_with) > n ln N. The same rule for estimates and for what is made of them. `nothing` is a sum that is rounding.
pub(crate) fn are_worth(samples: usize, without: f64, with: f64, more: usize, nothing: f64) -> bool {
    let samples = samples as f64;
    without > nothing && samples * (without / with).ln() > more as f64 * samples.ln()
}

/// A response to a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// One value for each sample, in deviations like the record; NaN where there is none.
    pub values: Vec<f64>,
    /// The samples that the response covers and that have a measured output, as 0-based ranges.
    pub counted: Vec<Range<usize>>,
}

impl Response {
    fn empty(samples: usize) -> Self {
        Self { values: vec![f64::NAN; samples], counted: Vec::new() }
    }
}
