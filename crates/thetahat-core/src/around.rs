//! What filters have in common that are a Kalman filter of a model that they make linear.

#[cfg(feature = "alloc")]
use nalgebra::{OMatrix, OVector};

#[cfg(feature = "alloc")]
use crate::{Covariance, Dimension, Error, Innovation, Observation, Real, Transition};

/// A filter that tells a [`Smoother`](crate::Smoother) how it made models linear.
///
/// The trait is public because `Smoother` names it, and out of reach because its module is private: that seals it.
#[cfg(feature = "alloc")]
pub trait Linearising<T: Real, N: Dimension>: Clone {
    /// x̂.
    fn estimate(&self) -> &OVector<T, N>;
    /// P.
    fn uncertainty(&self) -> &Covariance<T, N>;
    /// The time update; returns F.
    fn predict_told<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<OMatrix<T, N, N>, Error>;
    /// The measurement update. `record` is told of each element that is used, whitened: in which iteration, of which
    /// only the last one counts, h, P h, h'P h + r and y - h'x̂ before the update by this element.
    fn correct_told<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
        record: impl FnMut(usize, &[T], &[T], T, T),
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>;
}

/// The state, the covariance and the gate of a filter that has them in its field `linear`.
macro_rules! around_kalman_filter {
    ($filter:ident) => {
        #[cfg(feature = "alloc")]
        impl<T: Real, N: Dimension> crate::around::Linearising<T, N> for $filter<T, N> {
            fn estimate(&self) -> &OVector<T, N> {
                self.state()
            }

            fn uncertainty(&self) -> &Covariance<T, N> {
                self.covariance()
            }

            fn predict_told<U: Dimension>(
                &mut self,
                transition: &impl Transition<T, N, U>,
                input: &OVector<T, U>,
            ) -> Result<OMatrix<T, N, N>, Error> {
                self.predict_recorded(transition, input)
            }

            fn correct_told<M: Dimension + Dimension<N>, U: Dimension>(
                &mut self,
                observation: &impl Observation<T, N, M, U>,
                input: &OVector<T, U>,
                measurement: &OVector<T, M>,
                record: impl FnMut(usize, &[T], &[T], T, T),
            ) -> Result<Innovation<T, OVector<T, M>>, Error>
            where
                N: Dimension<M>,
            {
                self.correct_recorded(observation, input, measurement, record)
            }
        }

        impl<T: Real, N: Dimension> $filter<T, N> {
            /// The same with a gate: see [`KalmanFilter::with_gate`].
            ///
            /// Errors: [`Error::OutOfRange`] if it is not above 0.
            pub fn with_gate(mut self, gate: T) -> Result<Self, Error> {
                self.set_gate(gate)?;
                Ok(self)
            }

            /// The same with a gate that lets go: see [`KalmanFilter::with_release`].
            pub fn with_release(mut self, count: u16) -> Self {
                self.set_release(count);
                self
            }

            /// The estimate of the state, x̂.
            pub fn state(&self) -> &OVector<T, N> {
                self.linear.state()
            }

            /// The covariance of its error, P, as far as the linear model knows it.
            pub fn covariance(&self) -> &Covariance<T, N> {
                self.linear.covariance()
            }

            /// Puts the state where it is known to be: see [`KalmanFilter::set_state`], whose errors it has.
            pub fn set_state(&mut self, state: OVector<T, N>) -> Result<(), Error> {
                self.linear.set_state(state)
            }

            /// Sets P: see [`KalmanFilter::set_covariance`], whose errors it has.
            pub fn set_covariance(&mut self, covariance: Covariance<T, N>) -> Result<(), Error> {
                self.linear.set_covariance(covariance)
            }

            /// Takes P for larger by a factor: see [`KalmanFilter::widen`], whose errors it has.
            pub fn widen(&mut self, factor: T) -> Result<(), Error> {
                self.linear.widen(factor)
            }

            /// Takes P for larger by a sum: see [`KalmanFilter::widen_by`], whose errors it has.
            pub fn widen_by(&mut self, covariance: &Covariance<T, N>) -> Result<(), Error> {
                self.linear.widen_by(covariance)
            }

            /// Sets the gate: see [`KalmanFilter::with_gate`], whose errors it has.
            pub fn set_gate(&mut self, gate: T) -> Result<(), Error> {
                self.linear.set_gate(gate)
            }

            /// Sets when the gate lets go: see [`KalmanFilter::with_release`].
            pub fn set_release(&mut self, count: u16) {
                self.linear.set_release(count);
            }

            /// After how many measurements in a row the gate lets go; 0 if never.
            pub fn release(&self) -> u16 {
                self.linear.release()
            }

            /// How many of the latest measurements were above the gate: see [`KalmanFilter::gated_in_a_row`].
            pub fn gated_in_a_row(&self) -> u16 {
                self.linear.gated_in_a_row()
            }

            /// The gate on the normalised innovation squared: infinite if there is none.
            pub fn gate(&self) -> T {
                self.linear.gate()
            }
        }
    };
}

pub(crate) use around_kalman_filter;
