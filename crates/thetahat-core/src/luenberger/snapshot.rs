//! What is written, and how it is checked when it is read back.

use nalgebra::{OMatrix, OVector};
use serde::{Deserialize, Serialize};

use crate::snapshot::{matrix, vector};
use crate::{Dimension, Error, LuenbergerObserver, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension + Dimension<M>, M: Dimension> {
    version: SnapshotVersion,
    #[serde(with = "vector")]
    state: OVector<T, N>,
    #[serde(with = "matrix")]
    gain: OMatrix<T, N, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> From<LuenbergerObserver<T, N, M>>
    for Snapshot<T, N, M>
{
    fn from(observer: LuenbergerObserver<T, N, M>) -> Self {
        let LuenbergerObserver { state, gain } = observer;
        Snapshot { version: SnapshotVersion, state, gain }
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> TryFrom<Snapshot<T, N, M>>
    for LuenbergerObserver<T, N, M>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, M>) -> Result<Self, Error> {
        let Snapshot { version: _, state, gain } = read;
        LuenbergerObserver::checked(state, gain)
    }
}
