//! What is written, and how it is checked when it is read back.

use nalgebra::{Const, OMatrix};

use crate::error::check_length;
use crate::lags::is_infinite;
use crate::snapshot::{snapshot, square};
use crate::{Dimension, Error, Lags, OutputErrorMethod, Real, RecursiveLeastSquares, RecursiveOutputError};

snapshot! {
    Snapshot<T, N, D> of RecursiveOutputError<T, N, D>
    where [T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension] {
        lags: Lags<T, N, D>;
        estimator: RecursiveLeastSquares<T, N>;
        #[serde(with = "square")]
        past: OMatrix<T, N, N>;
        nf: usize;
        method: OutputErrorMethod;
    }
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> TryFrom<Snapshot<T, N, D>>
    for RecursiveOutputError<T, N, D>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, D>) -> Result<Self, Error> {
        let Snapshot { version: _, lags, estimator, past, nf, method } = read;
        let size = estimator.parameters().shape_generic().0;
        lags.check_counts(size.value(), 1, 0)?;
        check_length("nf", lags.output_coefficients(estimator.parameters().as_slice()).count() - 1, nf)?;
        check_length("past", size.value() * size.value(), past.len())?;
        // Missing measurements are NaN, gradients are not.
        let measured = if method == OutputErrorMethod::Instruments { nf } else { 0 };
        let mut entries = past.as_slice().iter().enumerate();
        if entries.any(|(index, entry)| is_infinite(entry) || index >= measured && !entry.is_finite()) {
            return Err(Error::NotFinite { argument: "past" });
        }
        let scratch = size.scratch::<T, 2, 0>();
        let model = RecursiveOutputError { lags, estimator, past, nf, method, scratch };
        model.check_stable(model.estimator.parameters())?;
        Ok(model)
    }
}
