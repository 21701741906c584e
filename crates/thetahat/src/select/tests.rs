//! Choices against loops over single fits, and against truths that made the data.

mod automatic;
mod focus;
mod grid;
mod held_out_mse;
mod linear;
mod searched;

use std::ops::{ControlFlow, Range};

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::{Deadline, Monitor, Search};

use super::*;
use crate::Error;
use crate::data::Record;
use crate::estimate::Initial;
use crate::model::{Orders, Structure};
use crate::tests::filtered;

fn sum(a: &[f64], b: &[f64], weight: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + weight * b).collect()
}

fn range(first: usize, last: usize) -> OrderRange {
    OrderRange::new(first, last).unwrap()
}

/// Of ARX models.
fn arx_grid(na: OrderRange, nb: &[OrderRange], nk: &[OrderRange]) -> Grid {
    let nf = vec![0.into(); nb.len().min(1)];
    Grid { na, nb: nb.to_vec(), nk: nk.to_vec(), nc: 0.into(), nd: 0.into(), nf, path: Path::All }
}

fn record<'a>(y: &'a [f64], u: &[&'a [f64]], segments: &[Range<usize>]) -> Record<'a> {
    Record { output: y, inputs: u.to_vec(), segments: segments.to_vec(), past: vec![0; segments.len()] }
}

/// A choice by MDL, for whatever the model is good for.
fn task<'a>(record: &'a Record<'a>, inputs: &'a [String], search: &'a Search) -> Task<'a> {
    Task {
        estimation: record,
        validation: None,
        inputs,
        select: Select::MDL,
        focus: Focus::Auto,
        initial: Initial::Auto,
        may_drift: true,
        search,
        deadline: Deadline::default(),
        monitor: &|_| ControlFlow::Continue(()),
    }
}

/// The names of the inputs.
fn names(record: &Record<'_>) -> Vec<String> {
    (1..=record.inputs.len()).map(|number| format!("u{number}")).collect()
}

/// A choice with settings.
fn chosen(
    record: &Record<'_>,
    validation: Option<&Record<'_>>,
    choice: &Choice,
    select: Select,
    initial: Initial,
) -> Result<SelectedModel, Error> {
    let (inputs, search) = (names(record), Search::default());
    choose(&Task { validation, select, initial, ..task(record, &inputs, &search) }, choice)
}

/// A choice by MDL for some purpose, without a look for drifts.
fn focused(record: &Record<'_>, choice: &Choice, focus: Focus) -> Result<SelectedModel, Error> {
    let (inputs, search) = (names(record), Search::default());
    choose(&Task { focus, may_drift: false, ..task(record, &inputs, &search) }, choice)
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}
