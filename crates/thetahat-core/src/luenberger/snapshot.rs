//! What is written, and how it is checked when it is read back.

use nalgebra::{OMatrix, OVector};

use crate::snapshot::{matrix, snapshot, vector};
use crate::{Dimension, Error, LuenbergerObserver, Real};

snapshot! {
    Snapshot<T, N, M> of LuenbergerObserver<T, N, M>
    where [T: Real, N: Dimension + Dimension<M>, M: Dimension] {
        #[serde(with = "vector")]
        state: OVector<T, N>;
        #[serde(with = "matrix")]
        gain: OMatrix<T, N, M>;
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
