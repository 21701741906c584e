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

/// numerator/denominator applied to a signal from rest.
fn filtered(numerator: &[f64], denominator: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut response: Vec<f64> = Vec::with_capacity(signal.len());
    for t in 0..signal.len() {
        let driven: f64 = (0..numerator.len().min(t + 1)).map(|i| numerator[i] * signal[t - i]).sum();
        let past: f64 = (1..denominator.len().min(t + 1)).map(|i| denominator[i] * response[t - i]).sum();
        response.push(driven - past);
    }
    response
}

fn sum(a: &[f64], b: &[f64], weight: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + weight * b).collect()
}

fn range(first: usize, last: usize) -> OrderRange {
    OrderRange::new(first, last).unwrap()
}

fn record<'a>(y: &'a [f64], u: &[&'a [f64]], segments: &[Range<usize>]) -> Record<'a> {
    Record { output: y, inputs: u.to_vec(), segments: segments.to_vec(), past: vec![0; segments.len()] }
}

/// A choice with settings.
fn chosen(
    record: &Record<'_>,
    validation: Option<&Record<'_>>,
    choice: &Choice,
    select: Select,
    initial: Initial,
) -> Result<SelectedModel, Error> {
    let inputs: Vec<String> = (1..=record.inputs.len()).map(|number| format!("u{number}")).collect();
    let search = Search::default();
    let task = Task {
        estimation: record,
        validation,
        inputs: &inputs,
        select,
        focus: Focus::Auto,
        initial,
        may_drift: true,
        search: &search,
        deadline: Deadline::default(),
        monitor: &|_| ControlFlow::Continue(()),
    };
    choose(&task, choice)
}

/// A choice by MDL for some purpose.
/// Without a look for drifts.
fn focused(record: &Record<'_>, choice: &Choice, focus: Focus) -> Result<SelectedModel, Error> {
    let inputs: Vec<String> = (1..=record.inputs.len()).map(|number| format!("u{number}")).collect();
    let search = Search::default();
    let task = Task {
        estimation: record,
        validation: None,
        inputs: &inputs,
        select: Select::MDL,
        focus,
        initial: Initial::Auto,
        may_drift: false,
        search: &search,
        deadline: Deadline::default(),
        monitor: &|_| ControlFlow::Continue(()),
    };
    choose(&task, choice)
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}
