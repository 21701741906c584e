//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;

use crate::snapshot::{number, snapshot, vector};
use crate::{Covariance, Dimension, Error, KalmanFilter, Real};

snapshot! {
    Snapshot<T, N> of KalmanFilter<T, N> where [T: Real, N: Dimension] {
        #[serde(with = "vector")]
        state: OVector<T, N>;
        covariance: Covariance<T, N>;
        #[serde(with = "number")]
        gate: T;
        release: u16;
        gated: u16;
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for KalmanFilter<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        let filter = KalmanFilter::new(read.state, read.covariance)?.with_gate(read.gate)?;
        Ok(KalmanFilter { release: read.release, gated: read.gated, ..filter })
    }
}
