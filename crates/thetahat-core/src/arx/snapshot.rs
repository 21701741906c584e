//! What is written, and how it is checked when it is read back.

use nalgebra::Const;
use serde::{Deserialize, Serialize};

use crate::{Dimension, Error, Lags, Real, RecursiveArx, RecursiveLeastSquares, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> {
    version: SnapshotVersion,
    lags: Lags<T, N, D>,
    estimator: RecursiveLeastSquares<T, N>,
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> From<RecursiveArx<T, N, D>>
    for Snapshot<T, N, D>
{
    fn from(arx: RecursiveArx<T, N, D>) -> Self {
        let RecursiveArx { lags, estimator } = arx;
        Snapshot { version: SnapshotVersion, lags, estimator }
    }
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> TryFrom<Snapshot<T, N, D>>
    for RecursiveArx<T, N, D>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, D>) -> Result<Self, Error> {
        let Snapshot { version: _, lags, estimator } = read;
        lags.check_counts(estimator.parameters().len(), 1, 0)?;
        Ok(RecursiveArx { lags, estimator })
    }
}
