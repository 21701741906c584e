//! What is written, and how it is checked when it is read back.

use crate::snapshot::{number, snapshot};
use crate::{Dimension, Error, KalmanFilter, Real, UnscentedKalmanFilter};

snapshot! {
    Snapshot<T, N> of UnscentedKalmanFilter<T, N> where [T: Real, N: Dimension] {
        linear: KalmanFilter<T, N>;
        #[serde(with = "number")]
        spread: T;
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for UnscentedKalmanFilter<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        UnscentedKalmanFilter::from(read.linear).with_spread(read.spread)
    }
}
