#![no_std]
#![no_main]
//! A recursive ARX estimator with two coefficients each of A and B.

#[path = "../alone.rs"]
mod alone;

use core::convert::Infallible;

use thetahat_core::nalgebra::Const;
use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, RecursiveArx};

use alone::{measurement, uses};

fn estimate() -> Result<Infallible, Error> {
    let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 1 }], constant: false };
    let mut plant: RecursiveArx<f32, Const<4>> =
        RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::Exponential { factor: 0.99 })?;
    loop {
        uses(plant.measured(measurement())?);
        uses(plant.estimator().parameters());
        plant.applied(&[measurement()])?;
    }
}
