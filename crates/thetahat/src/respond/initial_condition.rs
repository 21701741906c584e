use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::data::Record;
use crate::model::PolynomialModel;

/// What a response starts from, in the words of [`Initial`](crate::estimate::Initial) for fits.
///
/// In the first r = max(na, nb + nk - 1 of the inputs without F) + nd samples of a segment, A, B and D reach back to
/// samples that are not there. Unless these are taken as zero, e is, and the r samples do not count. What
/// [`Initial`](crate::estimate::Initial) says of them holds here too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum InitialCondition {
    /// Rest: all samples before the first of a segment are zero, and all of the segment count.
    Zero,
    /// Nothing but measured samples: those directly before the segment where the log has them, else the segment's first
    /// ones. The first r of all these do not count. They are all that ARX models need. C and F begin there from rest:
    /// samples before the segment warm them up, and without such samples their first outputs are wrong where they were
    /// not at rest.
    Drop,
    /// The initial condition that fits best in the least-squares sense: to the segment's output in a free run, of which
    /// all samples count; to the one-step errors otherwise. The inputs that were measured directly before the segment
    /// are used, and for predictions the outputs, as far as errors reach back to them: max(na, nb + nk - 1) + nd
    /// samples. Where there are fewer, the first r of all these do not count in predictions.
    Estimate,
}

/// A record must have as many inputs as the model.
pub(super) fn check_inputs(model: &PolynomialModel, record: &Record<'_>) -> Result<(), Error> {
    let (expected, found) = (model.b.len(), record.inputs.len());
    if found == expected {
        return Ok(());
    }
    Err(Error::argument("inputs", format!("the model has {expected} inputs, the record {found}")))
}

/// Where to look from for a start from measured samples, so that a response `ahead` steps ahead begins with the
/// segment.
pub(super) fn history(model: &PolynomialModel, segment: &Range<usize>, past: usize, ahead: usize) -> usize {
    let forgets = model.c.len() == 1 && model.f.iter().all(|f| f.len() == 1);
    let wanted = if forgets { model.orders.conditioned() + ahead } else { usize::MAX };
    segment.start - past.min(wanted)
}

/// A sum of squared errors below this fraction of the output's is rounding.
pub(crate) const NOTHING_LEFT: f64 = 1e-28;

/// Whether `more` initial conditions are worth it that lower the sum of squared errors over this many samples: N
/// ln(V_without/V_with) > n ln N. The same rule for estimates and for what is made of them. `nothing` is a sum that is
/// rounding.
pub(crate) fn are_worth(samples: usize, without: f64, with: f64, more: usize, nothing: f64) -> bool {
    let samples = samples as f64;
    without > nothing && samples * (without / with).ln() > more as f64 * samples.ln()
}
