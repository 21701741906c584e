//! A filter as plain numbers, to come back to it.

use super::KalmanFilter;
use crate::ud::copy;
use crate::{Dimension, Real};

/// How many numbers [`KalmanFilter::store`] writes.
pub(crate) const fn stored_numbers(states: usize) -> usize {
    states.saturating_mul(states.saturating_add(3)) / 2 + 1
}

impl<T: Real, N: Dimension> KalmanFilter<T, N> {
    /// Writes the state, the factors, column by column down to the diagonal, and what the gate has counted.
    pub(crate) fn store(&self, mut into: &mut [T]) {
        let size = self.state.len();
        copy(self.state.as_slice(), into.split_off_mut(..size).unwrap_or_default());
        for index in 0..size {
            let column = crate::triangle::column(self.covariance.as_slice(), size, index);
            copy(column, into.split_off_mut(..=index).unwrap_or_default());
        }
        if let Some(place) = into.first_mut() {
            *place = T::from_count(self.gated.into());
        }
    }

    /// Goes back to what [`store`](KalmanFilter::store) has written.
    pub(crate) fn load(&mut self, mut from: &[T]) {
        let size = self.state.len();
        copy(from.split_off(..size).unwrap_or_default(), self.state.as_mut_slice());
        for index in 0..size {
            let column = crate::triangle::column_mut(self.covariance.as_mut_slice(), size, index);
            copy(from.split_off(..=index).unwrap_or_default(), column);
        }
        let counted: Option<f64> = from.first().and_then(|&count| nalgebra::try_convert(count));
        self.gated = counted.unwrap_or(0.0) as u16;
    }
}
