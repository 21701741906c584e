//! Programs beside the library.

mod controllers;
mod equations;
mod nonlinear;
mod polynomials;
mod processes;
mod states;

use super::program::Program;
use super::vector::Vector;
use super::*;
use crate::data::{Channel, Log};
pub(super) use crate::tests::congruential as signal;

pub(super) fn log(channels: &[(&str, Vec<f64>)], sample_time: f64) -> Log {
    let channel =
        |(name, values): &(&str, Vec<f64>)| Channel { name: (*name).into(), values: values.clone() };
    Log::new(channels.iter().map(channel).collect(), sample_time).expect("a log")
}

/// What a program says along a log in double precision.
pub(super) fn said(program: &Program, model: &Model, log: &Log) -> Vec<Vec<f64>> {
    Vector::new(program, model, Precision::F64, (log, &[])).expect("a run").expected
}
