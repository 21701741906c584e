//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;
use serde::{Deserialize, Serialize};

use super::RstController;
use crate::error::check_length;
use crate::snapshot::vector;
use crate::{Dimension, Error, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension> {
    version: SnapshotVersion,
    #[serde(with = "vector")]
    r: OVector<T, N>,
    #[serde(with = "vector")]
    s: OVector<T, N>,
    #[serde(with = "vector")]
    observer: OVector<T, N>,
    gain: T,
    /// None where there is none.
    lowest: Option<T>,
    highest: Option<T>,
    #[serde(with = "vector")]
    state: OVector<T, N>,
    input: T,
}

impl<T: Real, N: Dimension> From<RstController<T, N>> for Snapshot<T, N> {
    fn from(controller: RstController<T, N>) -> Self {
        let RstController { r, s, observer, gain, lowest, highest, state, input } = controller;
        let limit = |value: T| value.is_finite().then_some(value);
        let (lowest, highest) = (limit(lowest), limit(highest));
        Snapshot { version: SnapshotVersion, r, s, observer, gain, lowest, highest, state, input }
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for RstController<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        let Snapshot { version: _, r, s, observer, gain, lowest, highest, state, input } = read;
        check_length("state", s.len(), state.len())?;
        if !(state.iter().all(T::is_finite) && input.is_finite()) {
            return Err(Error::NotFinite { argument: "state" });
        }
        let limits = lowest.unwrap_or(-T::INFINITY)..=highest.unwrap_or(T::INFINITY);
        let fresh = RstController::new(gain, r, s, observer)?.with_limits(limits)?;
        Ok(RstController { state, input, ..fresh })
    }
}
