//! A process as the rules take it.

use crate::model::ProcessStructure;

/// A process as the rules take it: an integrator perhaps, then real lags, the longest first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lags {
    pub(super) gain: f64,
    pub(super) taus: Vec<f64>,
    pub(super) dead_time: f64,
    pub(super) integrates: bool,
}

/// The process of its parameters.
pub(super) fn lags(structure: &ProcessStructure, values: &[f64]) -> Lags {
    let parts = structure.taken_apart(values);
    let mut taus = parts.shape;
    taus.sort_by(|left, right| right.total_cmp(left));
    let gain = parts.weights.first().copied().unwrap_or(0.0);
    Lags { gain, taus, dead_time: parts.dead_time, integrates: structure.integrates() }
}

impl Lags {
    /// The half rule: with so many lags left, half of the first that is left out goes to the one before it, half to the
    /// dead time, and so do all further ones.
    pub(super) fn reduced(&self, kept: usize) -> Lags {
        let mut taus: Vec<f64> = self.taus.iter().copied().take(kept).collect();
        let mut dead_time = self.dead_time;
        for (number, tau) in self.taus.iter().skip(kept).enumerate() {
            if number == 0 {
                dead_time += tau / 2.0;
                if let Some(last) = taus.last_mut() {
                    *last += tau / 2.0;
                }
            } else {
                dead_time += tau;
            }
        }
        Lags { taus, dead_time, ..self.clone() }
    }
}
