//! What a filter has seen so far.

use serde::{Deserialize, Serialize};

use super::estimate::StateEstimate;
use crate::respond::NisCount;

/// What a filter has seen so far.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Totals {
    pub(super) rows: usize,
    /// The elements of measurements that were there.
    pub(super) measured: usize,
    /// The sum of the log-likelihoods; 0 from an observer.
    pub(super) log_likelihood: f64,
    pub(super) nis: NisCount,
    /// How many rows no state within the bounds of noise explains.
    #[serde(default)]
    pub(super) contradictions: usize,
}

impl Totals {
    /// One more row.
    pub(super) fn add(&mut self, row: &StateEstimate<'_>) {
        self.rows += 1;
        self.measured += row.measured;
        self.contradictions += usize::from(row.contradiction.is_some());
        self.log_likelihood += row.log_likelihood.unwrap_or(0.0);
        if let Some((nis, bounds)) = row.nis.zip(row.nis_bounds) {
            self.nis.add(nis, row.measured, bounds);
        }
    }
}
