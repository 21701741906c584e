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
use crate::data::Log;
pub(super) use crate::tests::{congruential as signal, log};

/// What a program says along a log in double precision.
pub(super) fn said(program: &Program, model: &Model, log: &Log) -> Vec<Vec<f64>> {
    Vector::new(program, model, Precision::F64, (log, &[])).expect("a run").expected
}
