//! What is written, and how it is checked when it is read back.

use serde::{Deserialize, Serialize};

use crate::{Dimension, Error, ExtendedKalmanFilter, KalmanFilter, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension> {
    version: SnapshotVersion,
    linear: KalmanFilter<T, N>,
    iterations: usize,
}

impl<T: Real, N: Dimension> From<ExtendedKalmanFilter<T, N>> for Snapshot<T, N> {
    fn from(filter: ExtendedKalmanFilter<T, N>) -> Self {
        let ExtendedKalmanFilter { linear, iterations } = filter;
        Snapshot { version: SnapshotVersion, linear, iterations }
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for ExtendedKalmanFilter<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        ExtendedKalmanFilter::from(read.linear).with_iterations(read.iterations)
    }
}
