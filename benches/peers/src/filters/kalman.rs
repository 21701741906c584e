//! What a Kalman filter must offer here.

use std::fmt::Debug;

use crate::data::Model;

/// A Kalman filter without input: what all of them can do.
pub(crate) trait Kalman<T, const N: usize, const M: usize>: Sized {
    /// What the tables call it.
    const NAME: &'static str;

    /// What it may answer instead of going on.
    type Error: Debug;

    /// A filter at state 0 with the model's covariance.
    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error>;

    /// The time update.
    fn predict(&mut self) -> Result<(), Self::Error>;

    /// The measurement update.
    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error>;

    /// Both, in one call where the crate has it.
    fn step(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        self.predict()?;
        self.correct(measurement)
    }

    /// Measures by another matrix H from now on.
    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error>;

    /// The estimate.
    fn state(&self) -> [T; N];

    /// Its covariance, by rows, without further rounding.
    fn covariance(&self) -> [[f64; N]; N];
}

/// Rows in double precision from elements.
pub(crate) fn rows<T: Into<f64>, const N: usize>(element: impl Fn(usize, usize) -> T) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| element(i, j).into()))
}
