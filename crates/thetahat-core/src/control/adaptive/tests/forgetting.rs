//! Which forgetting is good for a tuner.

extern crate std;

use std::println;
use std::vec::Vec;

use super::plants::random;
use super::{ORDERS, Tuner, settings};
use crate::noise::Noise;
use crate::{Error, Forgetting};

/// Of the noise in the equation.
const DEVIATION: f64 = 0.005;
const PLANTS: usize = 100;

/// What is measured of a policy, of each of the plants: numbers of them.
#[derive(Debug, Default)]
struct Score {
    /// The output is within 0.1 of the set point at the ends of the last halves of a square wave.
    settled: usize,
    /// It leaves the set point by more than 0.5 in 5000 samples in which it is held.
    bursts: usize,
    /// Then the gain doubles, with a square wave: the output exceeds 4, and is within 0.1 of the set point 300 samples
    /// later.
    exceed: usize,
    back: usize,
    /// The median of the largest outputs.
    largest: f64,
}

fn square(k: usize) -> f64 {
    if (k / 150).is_multiple_of(2) { 1.0 } else { -1.0 }
}

fn score(forgetting: Forgetting<f32>) -> Result<Score, Error> {
    let (mut noise, mut largest, mut score) = (Noise(4000), Vec::new(), Score::default());
    for _ in 0..PLANTS {
        let (mut plant, _) = random(&mut noise);
        let mut tuner = Tuner::new(&ORDERS, &settings(), 1.0, 1.0, forgetting)?;
        let mut sample = |plant: &mut super::Simulated, set_point: f64| {
            let y = plant.output(DEVIATION * noise.normal());
            plant.input(tuner.control(set_point as f32, y as f32).into());
            y
        };
        let mut farthest = 0.0_f64;
        for k in 0..1500 {
            let distance = (sample(&mut plant, square(k)) - square(k)).abs();
            farthest = if k >= 900 && k % 150 >= 130 { farthest.max(distance) } else { farthest };
        }
        score.settled += usize::from(farthest < 0.1);
        let held = (0..6000).map(|_| (sample(&mut plant, 1.0) - 1.0).abs()).skip(1000);
        score.bursts += usize::from(held.fold(0.0, f64::max) > 0.5);
        plant.b.iter_mut().for_each(|coefficient| *coefficient *= 2.0);
        let (mut highest, mut farthest) = (0.0_f64, 0.0_f64);
        for k in 150..1050 {
            let y = sample(&mut plant, square(k));
            highest = highest.max(y.abs());
            let distance = (y - square(k)).abs();
            farthest = if k >= 450 && k % 150 >= 130 { farthest.max(distance) } else { farthest };
        }
        largest.push(highest);
        score.exceed += usize::from(highest > 4.0);
        score.back += usize::from(farthest < 0.1);
    }
    largest.sort_by(f64::total_cmp);
    score.largest = largest[PLANTS / 2];
    Ok(score)
}

/// The table in the documentation of the tuner.
#[test]
fn tuners_forget_as_is_recommended() -> Result<(), Error> {
    let mut latest = Score::default();
    println!("| policy | settled | while held | above 4 | back | largest |");
    for (name, forgetting) in [
        ("exponential, 0.98", Forgetting::Exponential { factor: 0.98 }),
        ("exponential, 0.99", Forgetting::Exponential { factor: 0.99 }),
        ("selective, 0.98", Forgetting::Selective { factor: 0.98 }),
        ("selective, 0.99", Forgetting::Selective { factor: 0.99 }),
        ("random walk, 1e-4", Forgetting::RandomWalk { variance: 1e-4 }),
    ] {
        latest = score(forgetting)?;
        let Score { settled, bursts, exceed, back, largest } = &latest;
        println!("| {name} | {settled} | {bursts} | {exceed} | {back} | {largest:.2} |");
    }
    let Score { settled, bursts, exceed, back, .. } = latest;
    assert!(settled >= 95 && bursts == 0 && exceed <= 7 && back >= 95, "{settled} {bursts} {exceed} {back}");
    Ok(())
}
