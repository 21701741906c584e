use thetahat_core::nalgebra::Complex;

/// How a state is estimated.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Estimator {
    /// The Kalman filter, for a model that is linear in its state and has no unknown parameters.
    Kalman,
    /// The extended Kalman filter: for any model. Unknown parameters are estimated with the state. With a linear model it is
    /// the Kalman filter.
    Extended,
    /// The Luenberger observer, for a model without unknown parameters: see
    /// [`LuenbergerObserver`](thetahat_core::LuenbergerObserver).
    Luenberger(ObserverGain),
}

/// The gain of an observer.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum ObserverGain {
    /// The poles that the error of the estimate is to have in the z plane: one for each state, inside the unit circle, complex
    /// ones beside their conjugates.
    ///
    /// For a model in equations they are placed again in each row, at the estimate. Several outputs are weighed by the inverse
    /// of the standard deviation of their noise, or equally if one of them has none.
    Poles(Vec<Complex<f64>>),
    /// The gain L, row by row: a row for each state, a column for each output.
    Matrix(Vec<Vec<f64>>),
}
