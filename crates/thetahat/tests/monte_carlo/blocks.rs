//! Models in blocks: whether the intervals of systems and curves cover the truth.

use std::ops::ControlFlow;

use thetahat::data::{Channel, Log};
use thetahat::estimate::{BlockStructure, CurveForm};
use thetahat::report::{BlocksPlan, EquationsPlan, fit_blocks};

use crate::runs;
use crate::simulated::{BEFORE, Random, filtered};

/// A pump at five speeds, and a plant of two poles with a gain of 1 at rest.
const SPEEDS: [f64; 5] = [-2.0, -1.0, 0.0, 1.0, 2.0];
const PUMPED: [f64; 5] = [-0.5, -0.4, 0.3, 1.5, 1.9];
const A: [f64; 3] = [1.0, -1.4, 0.48];
const B: [f64; 3] = [0.0, 0.05, 0.03];

fn log(seed: u64) -> Log {
    let mut random = Random::new(seed);
    // Each speed as often as the others, so that the knots are the speeds.
    let mut places = Vec::new();
    while places.len() < BEFORE + 1500 {
        let mut left = vec![0, 1, 2, 3, 4];
        while !left.is_empty() {
            let place = left.swap_remove((left.len() as f64 * random.uniform()) as usize);
            places.extend([place; 4]);
        }
    }
    let pumped: Vec<f64> = places.iter().map(|place| PUMPED[*place]).collect();
    let seen = filtered(&B, &A, &pumped).into_iter().map(|y| y + 0.05 * random.normal());
    let seen: Vec<f64> = seen.collect();
    let channel = |name: &str, values: Vec<f64>| Channel { name: name.into(), values };
    let speeds = places[BEFORE..].iter().map(|place| SPEEDS[*place]).collect();
    Log::new(vec![channel("u", speeds), channel("y", seen[BEFORE..].to_vec())], 1.0)
        .expect("the case is sound")
}

#[test]
fn intervals_of_systems_and_curves_cover_the_truth() {
    let runs = runs(40);
    let plan = BlocksPlan {
        inputs: vec!["u".into()],
        output: "y".into(),
        structure: BlockStructure::Hammerstein,
        orders: Some((2, 2)),
        delays: Some(vec![1]),
        curve: Some(CurveForm::Lines(Some(5))),
        fit: EquationsPlan::default(),
    };
    let names = ["f1", "f2", "b1", "w_1", "w_2", "w_3", "w_4", "w_5"];
    let truth = [&A[1..], &B[1..2], &PUMPED].concat();
    let mut covered = vec![0_usize; names.len()];
    for seed in 0..runs as u64 {
        let found = fit_blocks(&log(700 + seed), &[], &plan, &|_| ControlFlow::Continue(()))
            .expect("the case is sound");
        for ((name, truth), covered) in names.iter().zip(&truth).zip(&mut covered) {
            let own = found.model.parameters().iter().find(|own| own.name == *name).expect("it is there");
            let error = own.standard_error.expect("it has one");
            *covered += usize::from((own.value - truth).abs() < 1.959964 * error);
        }
    }
    for (name, covered) in names.iter().zip(covered) {
        let share = covered as f64 / runs as f64;
        eprintln!("{name}: {:.1} %", 100.0 * share);
        // Three standard deviations of a share of 95 %.
        assert!(
            (share - 0.95).abs() < 3.0 * (0.95 * 0.05 / runs as f64).sqrt() + 0.5 / runs as f64,
            "{name}: {share}"
        );
    }
}
