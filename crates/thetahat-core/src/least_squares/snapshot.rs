//! What is written, and how it is checked when it is read back.

use nalgebra::{OMatrix, OVector};

use super::transpose;
use crate::snapshot::{number, snapshot, square, vector};
use crate::triangle::Sum;
use crate::{Dimension, Error, LeastSquares, Real};

snapshot! {
    Snapshot<T, N> of LeastSquares<T, N> where [T: Real, N: Dimension] {
        #[serde(with = "square")]
        factor_rows: OMatrix<Sum<T>, N, N>;
        #[serde(with = "vector")]
        rotated_output: OVector<Sum<T>, N>;
        #[serde(with = "number")]
        residual_norm: Sum<T>;
        rows: usize;
        uncompensated_rows: usize;
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for LeastSquares<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        let Snapshot { version: _, factor_rows, rotated_output, residual_norm, rows, uncompensated_rows } =
            read;
        let fits = |sum: &Sum<T>| sum.carry.abs() <= sum.value.abs();
        if !(factor_rows.iter().all(fits) && rotated_output.iter().all(fits) && fits(&residual_norm)) {
            return Err(Error::OutOfRange { argument: "carry", range: "no larger than its sum" });
        }
        if uncompensated_rows > rows {
            return Err(Error::OutOfRange { argument: "uncompensated_rows", range: "no more than all rows" });
        }
        let size = rotated_output.shape_generic().0;
        let (mut factor, mut output) = (size.square(T::zero()), size.vector(T::zero()));
        transpose(factor_rows.as_slice(), factor.as_mut_slice(), size.value(), |sum| sum.value);
        for (value, sum) in output.as_mut_slice().iter_mut().zip(rotated_output.as_slice()) {
            *value = sum.value;
        }
        let problem = LeastSquares::from_factor(&factor, &output, residual_norm.value, rows)?;
        Ok(LeastSquares { factor_rows, rotated_output, residual_norm, uncompensated_rows, ..problem })
    }
}
