#![no_std]
#![no_main]
//! Recursive least squares with four parameters.

#[path = "../alone.rs"]
mod alone;

use core::convert::Infallible;

use thetahat_core::nalgebra::{Const, Vector4};
use thetahat_core::{Error, Forgetting, RecursiveLeastSquares};

use alone::{measurement, uses};

fn estimate() -> Result<Infallible, Error> {
    let mut estimator: RecursiveLeastSquares<f32, Const<4>> =
        RecursiveLeastSquares::new(&Vector4::repeat(1.0), Forgetting::Exponential { factor: 0.99 })?;
    loop {
        let regressor = Vector4::new(measurement(), measurement(), measurement(), measurement());
        uses(estimator.update(&regressor, measurement())?);
        uses(estimator.parameters());
    }
}
