//! The choice between the best for prediction and the best for simulation.
//!
//! The model with the least MDL predicts well one step ahead. Where the plant is not among the models, another may
//! simulate far better: errors one step ahead hardly show slow dynamics (Ljung, System Identification, 2nd ed. 1999,
//! section 8.5). Errors of free runs alone choose badly too: they have few degrees of freedom. So there is a gate:
//!
//! 1. P has the least criterion among stable models. S has the least error where it was not fitted to (see `held_out`):
//!    the mean of two logarithms, of the mean square on blocks and of that onward from the first row. Where C ended on
//!    the unit circle, a search has stopped for want of room, at a point that rounding decides: such a model is no S.
//! 2. S is taken where that mean is lower by more than [`FAR`] than with P, or by more than [`GATE`], both logarithms
//!    by half of it, and the mean square on the blocks by more than [`STANDARD_ERRORS`] of its difference's; else P.
//!    (On blocks alone a slow mode that only their initial states excite takes up what is noise.)
//! 3. An unstable model that has a lower criterion than P is taken where all its refits are unstable too and their
//!    errors beat those of the choice by [`CLEARLY`] in the logarithm of the mean square: then the plant is unstable.

use super::candidates::Compared;
use super::held_out::standard_errors;
use super::selection::logarithm;
use super::{Focus, HeldOut};

/// By how much the logarithm of a mean square must fall, whatever its error.
pub(super) const FAR: f64 = 0.3;
/// By how much where the fall is certain.
pub(super) const GATE: f64 = 0.1;
const STANDARD_ERRORS: f64 = 2.0;
const CLEARLY: f64 = 0.1;
/// A model that simulates has no time constant of more than this many times the samples.
const SLOWEST: f64 = 2.0;

/// Which models are the best for what, as positions in a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Winners {
    /// P.
    pub(super) prediction: usize,
    /// S.
    pub(super) simulation: usize,
    pub(super) chosen: usize,
}

/// The modulus of the slowest pole of a model that simulates.
pub(super) fn slowest(samples: usize) -> f64 {
    (-1.0 / (SLOWEST * samples as f64)).exp()
}

/// The winners among models in the order of their criterion; none where no model is stable, or none was evaluated.
///
/// What has no figures on blocks, as the data without one do not determine it, may predict; it is not compared.
pub(super) fn winners(focus: Focus, models: &[&Compared], samples: usize) -> Option<Winners> {
    let held_out = |k: usize| models[k].scored.held_out.as_ref();
    let stable = |k: &usize| models[*k].radius < 1.0;
    let fast = |k: &usize| models[*k].radius <= slowest(samples);
    let prediction = (0..models.len()).find(stable)?;
    let both = |k: usize| held_out(k).map(HeldOut::both);
    let inside = |k: &usize| !models[*k].has_ended_on_circle();
    let figures = (0..models.len()).filter(fast).filter(inside).filter_map(|k| Some((both(k)?, k)));
    let least = figures.min_by(|(one, _), (other, _)| one.total_cmp(other));
    let simulation = least.map_or(prediction, |(_, k)| k);
    let fall = both(prediction).zip(both(simulation)).map_or(0.0, |(one, other)| one - other);
    let each_falls = held_out(prediction).zip(held_out(simulation)).is_some_and(|(one, other)| {
        let falls = |square: fn(&HeldOut) -> f64| logarithm(square(one)) - logarithm(square(other));
        falls(|seen| seen.blocks).min(falls(|seen| seen.onward)) > 0.5 * GATE
    });
    let parts = models[prediction].parts.as_ref().zip(models[simulation].parts.as_ref());
    let certain = || parts.is_some_and(|(one, other)| standard_errors(one, other) > STANDARD_ERRORS);
    let clear = fall > FAR || (fall > GATE && each_falls && certain());
    let chosen = match focus {
        Focus::Auto if clear => simulation,
        Focus::Auto | Focus::Prediction => prediction,
        Focus::Simulation | Focus::Steps(_) => simulation,
    };
    let raw = |k: usize| held_out(k).map_or(f64::INFINITY, |seen| logarithm(seen.unpunished));
    let unstable = models[0].radius >= 1.0
        && held_out(0).is_some_and(|seen| seen.unstable == seen.refits)
        && raw(chosen) - raw(0) > CLEARLY;
    Some(Winners { prediction, simulation, chosen: if unstable { 0 } else { chosen } })
}
