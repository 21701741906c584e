#![no_std]
#![no_main]
//! A Kalman filter with two states and one measurement.

#[path = "../alone.rs"]
mod alone;

use core::convert::Infallible;

use thetahat_core::nalgebra::{Const, Matrix2, RowVector2, SVector, Vector1, Vector2};
use thetahat_core::{Covariance, Error, KalmanFilter, LinearObservation, LinearTransition};

use alone::{measurement, uses};

/// Position and velocity, ten samples a second.
fn estimate() -> Result<Infallible, Error> {
    let none = SVector::zeros();
    let noise: Covariance<f32, Const<2>> = Covariance::from_diagonal(&Vector2::new(0.001, 0.1))?;
    let motion = LinearTransition::new(Matrix2::new(1.0, 0.1, 0.0, 1.0), noise)?;
    let noise: Covariance<f32, Const<1>> = Covariance::from_diagonal(&Vector1::new(0.5))?;
    let sensor = LinearObservation::new(RowVector2::new(1.0, 0.0), noise)?;
    let prior = Covariance::from_diagonal(&Vector2::new(100.0, 100.0))?;
    let mut filter = KalmanFilter::new(Vector2::zeros(), prior)?;
    loop {
        filter.predict(&motion, &none)?;
        uses(filter.correct(&sensor, &none, &Vector1::new(measurement()))?);
        uses(filter.state());
    }
}
