//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;
use serde::{Deserialize, Serialize};

use crate::snapshot::{number, vector};
use crate::{Covariance, Dimension, Error, KalmanFilter, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension> {
    version: SnapshotVersion,
    #[serde(with = "vector")]
    state: OVector<T, N>,
    covariance: Covariance<T, N>,
    #[serde(with = "number")]
    gate: T,
    release: u16,
    gated: u16,
}

impl<T: Real, N: Dimension> From<KalmanFilter<T, N>> for Snapshot<T, N> {
    fn from(filter: KalmanFilter<T, N>) -> Self {
        let KalmanFilter { state, covariance, gate, release, gated, .. } = filter;
        Snapshot { version: SnapshotVersion, state, covariance, gate, release, gated }
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for KalmanFilter<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        let filter = KalmanFilter::new(read.state, read.covariance)?.with_gate(read.gate)?;
        Ok(KalmanFilter { release: read.release, gated: read.gated, ..filter })
    }
}
