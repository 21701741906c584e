//! What is written, and how it is checked when it is read back.

use crate::snapshot::snapshot;
use crate::{Dimension, Error, ExtendedKalmanFilter, KalmanFilter, Real};

snapshot! {
    Snapshot<T, N> of ExtendedKalmanFilter<T, N> where [T: Real, N: Dimension] {
        linear: KalmanFilter<T, N>;
        iterations: usize;
    }
}

impl<T: Real, N: Dimension> TryFrom<Snapshot<T, N>> for ExtendedKalmanFilter<T, N> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N>) -> Result<Self, Error> {
        ExtendedKalmanFilter::from(read.linear).with_iterations(read.iterations)
    }
}
