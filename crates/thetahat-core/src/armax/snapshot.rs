//! What is written, and how it is checked when it is read back.

use nalgebra::{Const, OMatrix};

use crate::error::{check_entries, check_finite};
use crate::snapshot::{snapshot, square};
use crate::{ArmaxMethod, Dimension, Error, Lags, Real, RecursiveArmax, RecursiveLeastSquares};

snapshot! {
    Snapshot<T, N, D> of RecursiveArmax<T, N, D>
    where [T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension] {
        lags: Lags<T, N, D>;
        estimator: RecursiveLeastSquares<T, N>;
        #[serde(with = "square")]
        gradients: OMatrix<T, N, N>;
        residual: T;
        nc: usize;
        method: ArmaxMethod;
    }
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> TryFrom<Snapshot<T, N, D>>
    for RecursiveArmax<T, N, D>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, D>) -> Result<Self, Error> {
        let Snapshot { version: _, lags, estimator, gradients, residual, nc, method } = read;
        let size = estimator.parameters().shape_generic().0;
        lags.check_counts(size.value(), 1, nc)?;
        check_entries("gradients", gradients.as_slice(), size.value() * size.value())?;
        check_finite("residual", &[residual])?;
        let scratch = size.scratch::<T, 2, 0>();
        let armax = RecursiveArmax { lags, estimator, gradients, residual, nc, method, scratch };
        armax.check_stable(armax.estimator.parameters())?;
        Ok(armax)
    }
}
