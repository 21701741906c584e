//! What is written, and how it is checked when it is read back.

use nalgebra::OMatrix;
use serde::{Deserialize, Serialize};

use crate::snapshot::square;
use crate::{Covariance, Dimension, Error, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension> {
    version: SnapshotVersion,
    /// What lies below the diagonal is 0.
    #[serde(with = "square")]
    factor: OMatrix<T, N, N>,
}

impl<T: Real, N: Dimension> From<Covariance<T, N>> for Snapshot<T, N> {
    fn from(covariance: Covariance<T, N>) -> Self {
        Snapshot { version: SnapshotVersion, factor: covariance.factor() }
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for Covariance<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        Covariance::from_factor(read.factor)
    }
}
