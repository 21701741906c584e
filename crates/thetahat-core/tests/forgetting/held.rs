//! Inputs that are held: directions of the parameters that are not excited for a long time. What the standard errors
//! say of them is true, whatever is forgotten meanwhile.
//!
//! `make soak` runs it at full length: 200 runs of 10^6 samples.

use std::fmt::Debug;

use thetahat_core::Real;
use thetahat_core::nalgebra::{SVector, convert};

use super::{Forgetting, Noise, Run, Subject};

/// What becomes of the input of an ARX plant that was excited for 1000 samples.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Input {
    /// It stays where it is.
    Held,
    /// It steps once in 10,000 samples.
    Steps,
    /// It is that of a proportional controller with a constant set point: u(k) is a function of y(k).
    Loop,
    /// The same with a plant without noise.
    NoiseFreeLoop,
}

/// Shares of the 95 % intervals that hold the truth, and the largest error in standard errors.
struct Found {
    covered: [f64; 4],
    largest: f64,
}

fn number(name: &str, otherwise: usize) -> usize {
    std::env::var(name).map_or(otherwise, |text| text.parse().expect("a number"))
}

fn run<T: Real>(forgetting: Forgetting<T>, input: Input) -> Found {
    let (runs, samples) = (number("HELD_RUNS", 10), number("HELD_SAMPLES", 40_000));
    let deviation = if input == Input::NoiseFreeLoop { 0.0 } else { 0.1 };
    let theta = SVector::<f64, 4>::new(-1.5, 0.7, 1.0, 0.5);
    let (mut covered, mut looked, mut largest) = ([0_u64; 4], 0_u64, 0.0_f64);
    for seed in 0..runs {
        let mut noise = Noise::new(5000 + seed as u64);
        let mut run: Run<T, 4> = Subject::new(forgetting).estimator();
        let (mut phi, mut held) = (SVector::<f64, 4>::zeros(), 1.0);
        for k in 0..samples {
            let y = phi.dot(&theta) + deviation * noise.normal();
            run.update(&phi, y);
            if k < 1000 {
                held = if noise.bits() >> 63 == 0 { 1.0 } else { -1.0 };
            } else if input == Input::Steps && k.is_multiple_of(10_000) {
                held = -held;
            }
            let in_loop = matches!(input, Input::Loop | Input::NoiseFreeLoop);
            phi = [-y, phi[0], if in_loop { 0.1 * (held - y) } else { held }, phi[2]].into();
            // Every 97th sample, and all of the hundred from a step on.
            if k >= 1000 && (k.is_multiple_of(97) || k % 10_000 < 100) {
                looked += 1;
                let off = run.off(&theta);
                largest = largest.max(off.amax());
                for (covered, off) in covered.iter_mut().zip(&off) {
                    *covered += u64::from(off.abs() < 1.96);
                }
            }
        }
    }
    Found { covered: covered.map(|count| count as f64 / looked as f64), largest }
}

/// At least 90 % of the intervals hold the truth, and no parameter is off by more than ten of its standard errors.
fn holds<T: Real>(forgetting: Forgetting<T>, inputs: &[Input]) {
    for &input in inputs {
        let Found { covered, largest } = run(forgetting, input);
        println!("{input:?}, {forgetting:?}: {covered:.3?}, {largest:.1}");
        let all = covered.iter().all(|share| (0.9..=1.0).contains(share));
        assert!(all && largest <= 10.0, "{input:?}, {forgetting:?}: {covered:?}, {largest}");
    }
}

const ALL: [Input; 4] = [Input::Held, Input::Steps, Input::Loop, Input::NoiseFreeLoop];

fn exponential_holds<T: Real>() {
    for factor in [0.9, 0.95, 0.99] {
        holds::<T>(Forgetting::Exponential { factor: convert(factor) }, &ALL);
    }
}

#[test]
fn exponential_forgetting_is_honest_where_nothing_is_excited() {
    exponential_holds::<f64>();
}

#[test]
fn exponential_forgetting_is_honest_where_nothing_is_excited_in_single_precision() {
    exponential_holds::<f32>();
}

#[test]
fn selective_forgetting_is_honest_where_nothing_is_excited() {
    for factor in [0.9, 0.95, 0.99] {
        holds::<f64>(Forgetting::Selective { factor }, &ALL);
        holds::<f32>(Forgetting::Selective { factor: factor as f32 }, &ALL);
    }
}

#[test]
fn variable_forgetting_is_honest_where_nothing_is_excited() {
    for factor in [0.9, 0.95, 0.99] {
        // With the noise that it is told of.
        let forgetting = Forgetting::Variable { factor, minimum: factor - 0.05, noise_variance: 0.01 };
        holds::<f64>(forgetting, &ALL[..3]);
    }
}
