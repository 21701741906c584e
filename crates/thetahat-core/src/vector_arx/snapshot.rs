//! What is written, and how it is checked when it is read back.

use serde::{Deserialize, Serialize};

use crate::{Dimension, Error, Lags, Real, RecursiveLeastSquares, RecursiveVectorArx, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension + Dimension<M>, M: Dimension, D: Dimension> {
    version: SnapshotVersion,
    lags: Lags<T, N, D>,
    estimator: RecursiveLeastSquares<T, N, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension, D: Dimension> From<RecursiveVectorArx<T, N, M, D>>
    for Snapshot<T, N, M, D>
{
    fn from(arx: RecursiveVectorArx<T, N, M, D>) -> Self {
        let RecursiveVectorArx { lags, estimator } = arx;
        Snapshot { version: SnapshotVersion, lags, estimator }
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension, D: Dimension> TryFrom<Snapshot<T, N, M, D>>
    for RecursiveVectorArx<T, N, M, D>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, M, D>) -> Result<Self, Error> {
        let Snapshot { version: _, lags, estimator } = read;
        let (parameters, outputs) = estimator.parameters().shape();
        lags.check_counts(parameters, outputs, 0)?;
        Ok(RecursiveVectorArx { lags, estimator })
    }
}
