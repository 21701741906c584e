//! Simulates the sample log of `thetahat demo`: a DC motor driven by a random voltage.
//!
//! ```text
//! L di/dt = u - R i - K w          armature current i [A], voltage u [V]
//! J dw/dt = K i - b w - load       speed w [rad/s], load torque [N m]
//! ```
//!
//! The voltage switches between 2 V and 8 V at random, the load is a small random torque that holds for a sample, and
//! the speed is measured every 10 ms with noise. Write the log anew with `cargo run --example dc_motor >
//! cli/demo/dc_motor.csv`.

use std::fmt::Write;

const RESISTANCE: f64 = 1.5;
const INDUCTANCE: f64 = 0.03;
const TORQUE_CONSTANT: f64 = 0.05;
const INERTIA: f64 = 2e-4;
const FRICTION: f64 = 1e-4;

const SAMPLE_TIME: f64 = 0.01;
const SAMPLES: usize = 1000;
/// Runge-Kutta steps between two samples.
const STEPS: usize = 20;

/// Uniform numbers in [0, 1): xorshift (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Nearly normal, with mean 0 and variance 1: the sum of twelve uniform numbers.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// The derivatives of current and speed.
fn motor([current, speed]: [f64; 2], voltage: f64, load: f64) -> [f64; 2] {
    [
        (voltage - RESISTANCE * current - TORQUE_CONSTANT * speed) / INDUCTANCE,
        (TORQUE_CONSTANT * current - FRICTION * speed - load) / INERTIA,
    ]
}

/// One step of the classical Runge-Kutta method.
fn step(state: [f64; 2], voltage: f64, load: f64, time: f64) -> [f64; 2] {
    let along = |slope: [f64; 2], time: f64| [state[0] + time * slope[0], state[1] + time * slope[1]];
    let k1 = motor(state, voltage, load);
    let k2 = motor(along(k1, time / 2.0), voltage, load);
    let k3 = motor(along(k2, time / 2.0), voltage, load);
    let k4 = motor(along(k3, time), voltage, load);
    std::array::from_fn(|i| state[i] + time / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// The log as CSV: time [s], voltage [V], speed [rad/s].
fn log() -> String {
    let mut random = Random(20_240_229);
    let (mut state, mut voltage) = ([0.0; 2], 5.0);
    let mut csv = String::from("t,u,y\n");
    for k in 0..SAMPLES {
        if random.uniform() < 0.1 {
            voltage = if voltage == 2.0 { 8.0 } else { 2.0 };
        }
        let speed = state[1] + 0.15 * random.normal();
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{:.2},{voltage},{speed:.3}", k as f64 * SAMPLE_TIME);
        let load = 1e-2 * random.normal();
        for _ in 0..STEPS {
            state = step(state, voltage, load, SAMPLE_TIME / STEPS as f64);
        }
    }
    csv
}

fn main() {
    print!("{}", log());
}

#[test]
fn the_log_beside_this_program_is_what_it_writes() {
    assert!(include_str!("dc_motor.csv") == log());
}
