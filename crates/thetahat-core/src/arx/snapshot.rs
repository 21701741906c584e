//! What is written, and how it is checked when it is read back.

use nalgebra::Const;

use crate::snapshot::snapshot;
use crate::{Dimension, Error, Lags, Real, RecursiveArx, RecursiveLeastSquares};

snapshot! {
    Snapshot<T, N, D> of RecursiveArx<T, N, D>
    where [T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension] {
        lags: Lags<T, N, D>;
        estimator: RecursiveLeastSquares<T, N>;
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
