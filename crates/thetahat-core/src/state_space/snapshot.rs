//! What is written, and how it is checked when it is read back.

use nalgebra::OMatrix;

use super::check_shape;
use crate::snapshot::{matrix, snapshot, square};
use crate::{Covariance, Dimension, Error, LinearObservation, LinearTransition, Real};

snapshot! {
    Transition<T, N, U> of LinearTransition<T, N, U>
    where [T: Real, N: Dimension + Dimension<U>, U: Dimension] {
        #[serde(with = "square")]
        state_matrix: OMatrix<T, N, N>;
        #[serde(with = "matrix")]
        input_matrix: OMatrix<T, N, U>;
        noise: Covariance<T, N>;
    }
}

impl<T: Real, N: Dimension + Dimension<U>, U: Dimension> TryFrom<Transition<T, N, U>>
    for LinearTransition<T, N, U>
{
    type Error = Error;

    fn try_from(read: Transition<T, N, U>) -> Result<Self, Error> {
        LinearTransition::checked(read.state_matrix, read.input_matrix, read.noise)
    }
}

snapshot! {
    Observation<T, N, M, U> of LinearObservation<T, N, M, U>
    where [T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<U> + Dimension<N>, U: Dimension] {
        #[serde(with = "matrix")]
        output_rows: OMatrix<T, N, M>;
        #[serde(with = "matrix")]
        input_matrix: OMatrix<T, M, U>;
        noise: Covariance<T, M>;
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>
    TryFrom<Observation<T, N, M, U>> for LinearObservation<T, N, M, U>
{
    type Error = Error;

    fn try_from(read: Observation<T, N, M, U>) -> Result<Self, Error> {
        let Observation { version: _, output_rows, input_matrix, noise } = read;
        check_shape("output_rows", &output_rows, output_rows.shape_generic().0, noise.size())?;
        check_shape("input_matrix", &input_matrix, noise.size(), input_matrix.shape_generic().1)?;
        Ok(LinearObservation { output_rows, input_matrix, noise })
    }
}
