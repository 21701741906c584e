use std::f64::consts::PI;
use std::ops::Range;

use thetahat_numerics::noise::Noise;
use thetahat_numerics::regression::{Presample, Taps, sum_of_squares};

use super::clock::Ticks;
use super::*;
use crate::Error;
use crate::data::{Interpolation, Log, Recording, Resample, Source, Times};
use crate::tests::channel;
use crate::validate::feedback::feedback;

mod channels;
mod documents;
mod dynamics;
mod pieces;

/// This many normal numbers, to the eye: sums of twelve uniform ones.
fn normal(seed: u64, count: usize) -> Vec<f64> {
    let mut noise = Noise(seed);
    (0..count).map(|_| (0..12).map(|_| noise.uniform()).sum::<f64>() / 2.0).collect()
}

/// A y = x, from rest.
fn divided(a: &[f64], x: &[f64]) -> Vec<f64> {
    let mut y: Vec<f64> = Vec::new();
    for (t, x) in x.iter().enumerate() {
        let past: f64 = a.iter().enumerate().filter(|(i, _)| *i < t).map(|(i, a)| a * y[t - 1 - i]).sum();
        y.push(x - past);
    }
    y
}

/// x, this many samples late.
fn late(x: &[f64], by: usize) -> Vec<f64> {
    [vec![0.0; by], x[..x.len() - by].to_vec()].concat()
}

fn sum_of(left: &[f64], factor: f64, right: &[f64]) -> Vec<f64> {
    left.iter().zip(right).map(|(left, right)| left + factor * right).collect()
}

/// Random telegraph signal: changes sign with this probability.
fn telegraph(seed: u64, count: usize, probability: f64) -> Vec<f64> {
    let mut noise = Noise(seed);
    let mut value = 1.0;
    (0..count)
        .map(|_| {
            if noise.uniform() < 2.0 * probability - 1.0 {
                value = -value;
            }
            value
        })
        .collect()
}

fn one(segment: Range<usize>) -> [Range<usize>; 1] {
    [segment]
}

fn whole(signal: &[f64]) -> [Range<usize>; 1] {
    one(0..signal.len())
}

fn deviations(signal: &[f64]) -> Vec<f64> {
    moments::deviations(signal, &whole(signal))
}

fn quality(values: Vec<f64>) -> ChannelQuality {
    channel::quality(&channel("x", values), None, &Times::Uniform(1.0)).0
}

fn recording(channels: &[(&str, &[f64])], times: Times) -> Recording {
    Recording { channels: channels.iter().map(|(name, values)| channel(name, values)).collect(), times }
}

fn source() -> Source {
    Source { file: "log.csv".into(), rows: "1..2".parse().unwrap(), time: None, start: None, resampled: None }
}

fn plan(inputs: &[&str], output: Option<&str>) -> InspectionPlan {
    InspectionPlan {
        inputs: inputs.iter().map(|name| (*name).to_owned()).collect(),
        output: output.map(str::to_owned),
        resample: None,
    }
}
