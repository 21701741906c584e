//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;

use super::RstController;
use crate::error::check_length;
use crate::snapshot::{snapshot, vector};
use crate::{Dimension, Error, Real};

snapshot! {
    Snapshot<T, N> of RstController<T, N> where [T: Real, N: Dimension] {
        #[serde(with = "vector")]
        r: OVector<T, N>;
        #[serde(with = "vector")]
        s: OVector<T, N>;
        #[serde(with = "vector")]
        observer: OVector<T, N>;
        gain: T;
        /// None where there is none.
        lowest: Option<T> => lowest, limit;
        highest: Option<T> => highest, limit;
        #[serde(with = "vector")]
        state: OVector<T, N>;
        input: T;
    }
}

/// A limit, if there is one.
fn limit<T: Real>(limit: &T) -> Option<T> {
    limit.is_finite().then_some(*limit)
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
