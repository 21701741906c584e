//! What is written, and how it is checked when it is read back.

use nalgebra::OMatrix;
use serde::{Deserialize, Serialize};

use super::check_shape;
use crate::snapshot::{matrix, square};
use crate::{Covariance, Dimension, Error, LinearObservation, LinearTransition, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Transition<T: Real, N: Dimension + Dimension<U>, U: Dimension> {
    version: SnapshotVersion,
    #[serde(with = "square")]
    state_matrix: OMatrix<T, N, N>,
    #[serde(with = "matrix")]
    input_matrix: OMatrix<T, N, U>,
    noise: Covariance<T, N>,
}

impl<T: Real, N: Dimension + Dimension<U>, U: Dimension> From<LinearTransition<T, N, U>>
    for Transition<T, N, U>
{
    fn from(model: LinearTransition<T, N, U>) -> Self {
        let LinearTransition { state_matrix, input_matrix, noise, .. } = model;
        Transition { version: SnapshotVersion, state_matrix, input_matrix, noise }
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

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Observation<
    T: Real,
    N: Dimension + Dimension<M>,
    M: Dimension + Dimension<U> + Dimension<N>,
    U: Dimension,
> {
    version: SnapshotVersion,
    #[serde(with = "matrix")]
    output_rows: OMatrix<T, N, M>,
    #[serde(with = "matrix")]
    input_matrix: OMatrix<T, M, U>,
    noise: Covariance<T, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>
    From<LinearObservation<T, N, M, U>> for Observation<T, N, M, U>
{
    fn from(model: LinearObservation<T, N, M, U>) -> Self {
        let LinearObservation { output_rows, input_matrix, noise } = model;
        Observation { version: SnapshotVersion, output_rows, input_matrix, noise }
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
