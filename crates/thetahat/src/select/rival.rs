//! Models of other kinds beside the polynomial models of a choice, on the same blocks.

use rayon::prelude::*;

use super::candidates::total;
use super::folds::Folds;
use super::held_out::{BLOCKS, Blocks, deviation};
use super::winners::FAR;
use super::{HeldOut, Selection};
use crate::Error;
use crate::data::Record;
use crate::respond::{Horizon, Response};

/// What models do on blocks that they were not fitted to: `fit` gives one for a record without a block, and whether it
/// is stable, `respond` the free run of a record; windows of so many samples have levels of their own. None where a
/// record without a block does not determine one.
pub(crate) fn on_blocks<M: Send>(
    record: &Record<'_>,
    window: Option<usize>,
    fit: impl Fn(&Record<'_>) -> Option<(bool, M)> + Sync,
    respond: impl Fn(&M, &Record<'_>) -> Result<Response, Error>,
) -> Option<HeldOut> {
    let deviation = deviation(record);
    let folds = Folds::new(record, BLOCKS);
    if deviation == 0.0 || (0..BLOCKS).any(|fold| total(&folds.test(fold)) == 0) {
        return None;
    }
    let refit = |block: usize| fit(&folds.training(block));
    let refits = (0..BLOCKS).into_par_iter().map(refit).collect::<Option<Vec<_>>>()?;
    let blocks = Blocks::new(record, &folds, deviation, window);
    let figures = blocks.figures(&refits, Horizon::FreeRun, |model, record, _| respond(model, record));
    figures.map(|(seen, _)| seen)
}

/// The mean of logarithms of the better of the polynomial model that was chosen and the one that simulates best; none
/// where the plant is unstable, or neither was evaluated.
fn best_of_polynomials(selection: &Selection) -> Option<f64> {
    let simulation = selection.winners.as_ref()?.simulation.held_out;
    let chosen = selection.chosen.held_out;
    if chosen.is_some_and(|seen| seen.unstable == seen.refits) {
        return None;
    }
    [simulation, chosen].iter().flatten().map(HeldOut::both).min_by(f64::total_cmp)
}

impl Selection {
    /// Whether a model of another kind may be compared with the polynomial models that were: a stable one was evaluated
    /// on blocks.
    pub(crate) fn has_rivals(&self) -> bool {
        best_of_polynomials(self).is_some()
    }

    /// Whether a model of another kind is better on blocks than all polynomial models.
    pub(crate) fn is_worse_than(&self, other: &HeldOut) -> bool {
        best_of_polynomials(self).is_some_and(|before| before > other.both())
    }

    /// Whether a model of another kind is far better on blocks than all polynomial models.
    pub(crate) fn is_far_worse_than(&self, other: &HeldOut) -> bool {
        best_of_polynomials(self).is_some_and(|before| before - other.both() > FAR)
    }
}
