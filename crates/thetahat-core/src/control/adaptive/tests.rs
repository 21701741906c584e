extern crate std;

mod faults;
mod forgetting;
mod motor;
mod noise;
mod plants;
mod refusals;
mod trust;

use std::vec;
use std::vec::Vec;

use nalgebra::Const;

use super::{IndirectSelfTuner, ResponseWanted, TunerOrders, TunerSettings};
use crate::{Error, Forgetting};

/// A plant of second order with its noise, stepped in double precision.
#[derive(Clone, Debug)]
struct Simulated {
    a: [f64; 3],
    /// From the power 1 on.
    b: Vec<f64>,
    outputs: [f64; 2],
    inputs: Vec<f64>,
}

impl Simulated {
    fn new(a: [f64; 3], b: &[f64]) -> Self {
        Simulated { a, b: b.to_vec(), outputs: [0.0; 2], inputs: vec![0.0; b.len()] }
    }

    fn output(&mut self, noise: f64) -> f64 {
        let driven: f64 = self.b.iter().zip(&self.inputs).map(|(b, u)| b * u).sum();
        let y = -self.a[1] * self.outputs[0] - self.a[2] * self.outputs[1] + driven + noise;
        self.outputs = [y, self.outputs[0]];
        y
    }

    fn input(&mut self, input: f64) {
        self.inputs.rotate_right(1);
        self.inputs[0] = input;
    }

    /// The same signals, another plant.
    fn becomes(&mut self, other: &Simulated) {
        self.a = other.a;
        self.b.clone_from(&other.b);
        self.inputs.resize(other.b.len(), 0.0);
    }
}

/// A plant of second order with up to three samples of dead time.
const ORDERS: TunerOrders = TunerOrders { na: 2, nb: 5, nc: 0, constant: true, integrator: true };
type Tuner = IndirectSelfTuner<f32, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>>;

const WANTED: ResponseWanted<f32> = ResponseWanted { frequency: 0.3, damping: 0.8, observer: 0.3 };

fn tuner(settings: &TunerSettings<f32>, factor: f32) -> Result<Tuner, Error> {
    Tuner::new(&ORDERS, settings, 1.0, 1.0, Forgetting::Exponential { factor })
}

fn settings() -> TunerSettings<f32> {
    TunerSettings::new(WANTED, -10.0..=10.0, 1.0)
}
