//! What is written, and how it is checked when it is read back.

use crate::snapshot::snapshot;
use crate::{Dimension, Error, Lags, Real, RecursiveLeastSquares, RecursiveVectorArx};

snapshot! {
    Snapshot<T, N, M, D> of RecursiveVectorArx<T, N, M, D>
    where [T: Real, N: Dimension + Dimension<M>, M: Dimension, D: Dimension] {
        lags: Lags<T, N, D>;
        estimator: RecursiveLeastSquares<T, N, M>;
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
