//! What is written, and how it is checked when it is read back.

use serde::{Deserialize, Serialize};

use crate::{Covariance, Dimension, GainSchedule, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension> {
    version: SnapshotVersion,
    covariance: Covariance<T, N>,
}

impl<T: Real, N: Dimension> From<GainSchedule<T, N>> for Snapshot<T, N> {
    fn from(schedule: GainSchedule<T, N>) -> Self {
        Snapshot { version: SnapshotVersion, covariance: schedule.covariance().clone() }
    }
}

impl<T: Real, N: Dimension> From<Snapshot<T, N>> for GainSchedule<T, N> {
    fn from(read: Snapshot<T, N>) -> Self {
        GainSchedule::new(read.covariance)
    }
}
