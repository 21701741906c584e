//! The innovations of a model, from which its predictions and forecasts follow.
//!
//! ```text
//! x(t) = sum_j (B_j(q)/F_j(q)) u_j(t)     what the inputs do
//! w(t) = A(q) y(t) - x(t)                 what they do not explain
//! e(t) = (D(q)/C(q)) w(t)
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, sections 3.2 and 4.2). In the first r samples of a stretch of which
//! the past is unknown, v = D w is set to zero, and with it e = v/C; r = max(na, nb + nk - 1) + nd, over the inputs
//! without F. F begins from rest, or with impulses at the first samples: nf free responses of 1/F, the combination of which
//! makes up for any x before, inputs before being zero. This is what estimates make of their first samples.

use std::ops::Range;

use super::free_response::{Column, closest_of, impulse_response, until_negligible};
use super::{Start, check_inputs, history};
use crate::data::Record;
use crate::regression::{add_filtered, divide};
use crate::{Error, Model};

/// An initial condition of which D and C leave less than this fraction is not seen: what is left of it is rounding.
const UNSEEN: f64 = 1e-11;

/// The innovations of one segment.
#[derive(Debug)]
pub(crate) struct Innovations {
    /// The samples looked at: the segment, and before it those that it starts from.
    pub(crate) rows: Range<usize>,
    /// The samples of the segment that count.
    pub(crate) counted: Range<usize>,
    /// How many of the first of them have e = 0 for want of what was before.
    pub(super) silent: usize,
    /// What x starts from.
    pub(super) impulses: Impulses,
    /// w, one value for each of `rows`.
    pub(crate) disturbance: Vec<f64>,
    /// e, one value for each of `rows`; zero where it is not known.
    pub(crate) errors: Vec<f64>,
}

/// Impulses into 1/F at the first samples of a stretch, for each input.
#[derive(Debug)]
pub(super) struct Impulses(pub(super) Vec<Vec<f64>>);

impl Impulses {
    pub(super) fn none(model: &Model) -> Self {
        Self(vec![Vec::new(); model.f.len()])
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(Vec::is_empty)
    }
}

/// The innovations of each segment that has samples with a prediction `horizon` steps ahead. Only these count: those with
/// a measured output to look from, for a start from anything but zero.
///
/// O(N (na + nb + nc + nd + nf)), and O(N n^2) more for n initial conditions, as far as their responses do not die away.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the model's inputs; [`Error::Undetermined`] if an initial condition
/// cannot be told from the data.
pub(crate) fn innovations(
    model: &Model,
    record: &Record<'_>,
    horizon: usize,
    start: Start,
) -> Result<Vec<Innovations>, Error> {
    check_inputs(model, record)?;
    let each = record.segments.iter().zip(&record.past);
    each.filter_map(|(segment, past)| of_segment(model, record, segment, *past, horizon, start).transpose())
        .collect()
}

/// The innovations of one segment, if it has enough samples.
pub(super) fn of_segment(
    model: &Model,
    record: &Record<'_>,
    segment: &Range<usize>,
    past: usize,
    horizon: usize,
    start: Start,
) -> Result<Option<Innovations>, Error> {
    let conditioned = model.orders.conditioned();
    let ahead = horizon.saturating_sub(1);
    let (first, silent, skipped) = match start {
        Start::Zero => (segment.start, 0, 0),
        Start::Drop => (history(model, segment, past, ahead), conditioned, conditioned.saturating_add(ahead)),
        Start::Estimate => (segment.start, conditioned, conditioned.saturating_add(ahead)),
    };
    let rows = first..segment.end;
    let counted = first.saturating_add(skipped).clamp(segment.start, segment.end)..segment.end;
    if counted.is_empty() {
        return Ok(None);
    }
    let mut impulses = Impulses::none(model);
    let (mut disturbance, mut errors) = residuals(model, record, &rows, silent, &impulses);
    if start == Start::Estimate {
        let unknown = unknowns(model);
        // Numbers that as many samples determine fit them, whatever they are.
        if rows.len() - silent <= unknown {
            return Ok(None);
        }
        if unknown > 0 {
            impulses = best(model, &errors, silent)?;
            (disturbance, errors) = residuals(model, record, &rows, silent, &impulses);
        }
    }
    Ok(Some(Innovations { rows, counted, silent, impulses, disturbance, errors }))
}

/// x over stretches of the inputs, zeros before them, all as long as one another.
pub(super) fn driven(model: &Model, inputs: &[&[f64]], length: usize, impulses: &Impulses) -> Vec<f64> {
    let mut sum = vec![0.0; length];
    for ((b, u), (f, impulses)) in model.b.iter().zip(inputs).zip(model.f.iter().zip(&impulses.0)) {
        if f.len() == 1 {
            add_filtered(&mut sum, &(0..length), b, u, 0);
        } else {
            let mut own = vec![0.0; length];
            add_filtered(&mut own, &(0..length), b, u, 0);
            add(&mut own, impulses);
            divide(f, &mut own);
            add(&mut sum, &own);
        }
    }
    sum
}

fn add(sum: &mut [f64], values: &[f64]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

/// w and e over some rows, zeros before them.
pub(super) fn residuals(
    model: &Model,
    record: &Record<'_>,
    rows: &Range<usize>,
    silent: usize,
    impulses: &Impulses,
) -> (Vec<f64>, Vec<f64>) {
    let inputs: Vec<&[f64]> = record.inputs.iter().map(|u| &u[rows.clone()]).collect();
    let mut disturbance = driven(model, &inputs, rows.len(), impulses);
    disturbance.iter_mut().for_each(|value| *value = -*value);
    add_filtered(&mut disturbance, rows, &model.a, record.output, rows.start);
    let errors = whitened(model, &disturbance, silent);
    (disturbance, errors)
}

/// (1/C) of D w, of which the first samples are set to zero.
fn whitened(model: &Model, disturbance: &[f64], silent: usize) -> Vec<f64> {
    let mut errors = if model.d.len() == 1 {
        disturbance.to_vec()
    } else {
        let mut errors = vec![0.0; disturbance.len()];
        add_filtered(&mut errors, &(0..disturbance.len()), &model.d, disturbance, 0);
        errors
    };
    let (head, tail) = errors.split_at_mut(silent.min(disturbance.len()));
    head.fill(0.0);
    divide(&model.c, tail);
    errors
}

/// How many impulses there are: nf for each input.
fn unknowns(model: &Model) -> usize {
    (0..model.orders.inputs()).map(|input| model.orders.free_responses(input)).sum()
}

/// The impulses that make the errors smallest, given those without impulses.
pub(super) fn best(model: &Model, errors: &[f64], silent: usize) -> Result<Impulses, Error> {
    let orders = &model.orders;
    let (length, columns) = free_columns(model, errors.len(), silent);
    let mut weights = closest_of(&errors[..length], &columns)?.into_iter();
    let each =
        (0..orders.inputs()).map(|input| weights.by_ref().take(orders.free_responses(input)).collect());
    Ok(Impulses(each.collect()))
}

/// What unit impulses do to the errors of a stretch, and how many samples of it say something of them.
pub(super) fn free_columns(model: &Model, samples: usize, silent: usize) -> (usize, Vec<Column>) {
    let orders = &model.orders;
    let order = orders.nc + orders.nd;
    // As far as what any of them does has not died away, and there are more samples than impulses.
    let lasting = |f: &Vec<f64>| {
        let compute = |length| impulse_response(&[f, &model.c], length);
        until_negligible(samples, order + f.len(), compute).len() + f.len()
    };
    let lasting = model.f.iter().map(lasting).max().unwrap_or(0);
    let length = (lasting + silent + orders.nd).max(unknowns(model) + silent + 1).min(samples);

    let gain: f64 = model.d.iter().map(|d| d.abs()).sum();
    let column = |response: &[f64], delay: usize| {
        let mut delayed = vec![0.0; delay.min(length)];
        delayed.extend_from_slice(&response[..length - delayed.len()]);
        let values = whitened(model, &delayed, silent);
        let size = |values: &[f64]| values.iter().fold(0.0_f64, |size, value| size.hypot(*value));
        let rounding = UNSEEN * (gain * size(&delayed)).max(size(&values));
        Column { values, rounding }
    };
    let mut columns: Vec<Column> = Vec::new();
    for (input, f) in model.f.iter().enumerate().filter(|(_, f)| f.len() > 1) {
        let response = impulse_response(&[f], length);
        columns.extend((0..orders.free_responses(input)).map(|delay| column(&response, delay)));
    }
    (length, columns)
}
