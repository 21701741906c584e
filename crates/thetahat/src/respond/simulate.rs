use std::ops::Range;

use super::{Response, Start, add_filtered, check_inputs, from_measured};
use crate::data::Record;
use crate::model::polynomial::inverse_series;
use crate::regression::{Initial, Lagged, Taps, Unsolved};
use crate::{Error, Model};

/// A free response has died away when it is below this fraction of its largest value.
const NEGLIGIBLE: f64 = 1e-20;

/// The free run of a model: A(q) x(t) = sum_j B_j(q) u_j(t), driven by the inputs alone.
///
/// [`Start::Zero`] takes zeros before each segment; [`Start::Measured`] takes measured outputs and inputs, as many as the model
/// reaches back. [`Start::Estimated`] adds the free response c_0 h(t) + … + c_{n-1} h(t - n + 1), h being the
/// impulse response of 1/A and n = max(na, nb + nk - 1), with the c of least squares: everything that unknown samples
/// before the segment can do. Segments too short for a start are left out.
///
/// Signals are deviations from the model's offsets. The output of the record is not read for [`Start::Zero`].
/// Cost: O(N (na + nb)), and O(N n) more where h does not die away.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the model's inputs; [`Error::Undetermined`] if an initial condition
/// cannot be told from the data, as for a model so unstable that h overflows.
pub fn simulate(model: &Model, record: &Record<'_>, start: Start) -> Result<Response, Error> {
    check_inputs(model, record)?;
    let reach = model.orders.reach();
    let mut response = Response::empty(record.output.len());
    let longest = record.segments.iter().map(Range::len).max().unwrap_or(0);
    let free = if start == Start::Estimated { free_response(&model.a, longest, reach) } else { Vec::new() };
    for (segment, past) in record.segments.iter().zip(&record.past) {
        let (history, counted) = match start {
            Start::Zero => (segment.start, segment.clone()),
            Start::Measured => from_measured(segment, *past, reach),
            // An initial condition of n numbers needs more than n samples to be estimated from.
            Start::Estimated if segment.len() <= reach => continue,
            Start::Estimated => (segment.start, segment.clone()),
        };
        if counted.is_empty() {
            continue;
        }
        let values = &mut response.values[counted.clone()];
        values.fill(0.0);
        for (b, u) in model.b.iter().zip(&record.inputs) {
            add_filtered(values, &counted, b, u, history);
        }
        let before = if start == Start::Measured { &record.output[history..counted.start] } else { &[] };
        feed_back(&model.a, before, values);
        if start == Start::Estimated {
            add_free_response(&free, reach, &record.output[segment.clone()], values)?;
        }
        response.counted.push(counted);
    }
    Ok(response)
}

/// x(t) = w(t) - a1 x(t-1) - … in place: `values` holds w and becomes x; `before` holds the x before its first, if known.
fn feed_back(a: &[f64], before: &[f64], values: &mut [f64]) {
    let past: Vec<f64> = a[1..].iter().rev().copied().collect();
    let order = past.len();
    let start = order.min(values.len());
    for t in 0..start {
        let earlier = values[..t].iter().rev().chain(before.iter().rev());
        let sum: f64 = a[1..].iter().zip(earlier).map(|(a, x)| a * x).sum();
        values[t] -= sum;
    }
    for t in start..values.len() {
        let (earlier, now) = values.split_at_mut(t);
        let sum: f64 = past.iter().zip(&earlier[t - order..]).map(|(a, x)| a * x).sum();
        now[0] -= sum;
    }
}

/// The impulse response of 1/A until it has died away, at most `length` samples.
fn free_response(a: &[f64], length: usize, reach: usize) -> Vec<f64> {
    let mut response = Vec::new();
    let mut largest: f64 = 0.0;
    // In growing pieces: the series is cheap, but not for a million samples of nothing.
    let mut piece = 256.max(4 * reach);
    loop {
        let known = response.len();
        response = inverse_series(a, piece.min(length));
        largest = response[known..].iter().fold(largest, |largest, h| largest.max(h.abs()));
        if !largest.is_finite() {
            return response;
        }
        let quiet = response.iter().rev().take_while(|h| h.abs() <= NEGLIGIBLE * largest).count();
        if quiet > a.len() {
            response.truncate(response.len() - quiet);
            return response;
        }
        if response.len() >= length {
            return response;
        }
        piece *= 4;
    }
}

/// Adds the combination of shifted free responses that brings `values` closest to `output`.
fn add_free_response(free: &[f64], count: usize, output: &[f64], values: &mut [f64]) -> Result<(), Error> {
    if count == 0 {
        return Ok(());
    }
    // Behind the last free response there is nothing to fit.
    let length = output.len().min(free.len() + count);
    let target: Vec<f64> = output.iter().zip(&*values).take(length).map(|(y, x)| y - x).collect();
    let mut basis = free[..free.len().min(length)].to_vec();
    basis.resize(length, 0.0);
    let whole = 0..length;
    let unknown = || {
        Error::undetermined(
            Vec::new(),
            "the initial condition of a free run cannot be told from the data; start it from zero or from \
             measured samples",
        )
    };
    if !basis.iter().chain(&target).all(|value| value.is_finite()) {
        return Err(unknown());
    }
    if target.iter().all(|value| *value == 0.0) {
        return Ok(());
    }
    // Delays of a growing response differ by rounding only. Any of them serves: those that add nothing are left out.
    let mut delays: Vec<usize> = (0..count).collect();
    let mut weights = vec![0.0; count];
    loop {
        let taps = delays
            .chunk_by(|a, b| a + 1 == *b)
            .map(|run| Taps { signal: 1, first: run[0], count: run.len(), sign: 1.0 })
            .collect();
        let regression =
            Lagged::new(&[&target, &basis], taps, std::slice::from_ref(&whole), Initial::Zero).solve();
        match regression {
            Ok(solved) => {
                for (delay, weight) in delays.iter().zip(solved.parameters.iter()) {
                    weights[*delay] = *weight;
                }
                break;
            }
            Err(Unsolved::Deficient(columns)) if columns.len() < delays.len() => {
                for column in columns.iter().rev() {
                    delays.remove(*column);
                }
            }
            Err(_) => return Err(unknown()),
        }
    }
    add_filtered(&mut values[..length], &whole, &weights, &basis, 0);
    Ok(())
}
