//! The innovations of a model, from which its predictions and forecasts follow.
//!
//! ```text
//! x(t) = sum_j (B_j(q)/F_j(q)) u_j(t)     what the inputs do
//! w(t) = A(q) y(t) - x(t)                 what they do not explain
//! e(t) = (D(q)/C(q)) w(t)
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, sections 3.2 and 4.2). In the first r samples of a segment of which the
//! past is unknown, v = D w is set to zero, and with it e = v/C; r = max(na, nb + nk - 1) + nd, over the inputs without
//! F. F begins from rest, or with impulses: nf initial-condition responses of 1/F, the combination of which makes up
//! for any x before, inputs before being zero; or max(nf, nb + nk - 1) of them, which makes up for any such inputs too.
//! This is what estimates make of their first samples.

use std::ops::Range;

use thetahat_numerics::regression::{add_filtered, divide, sum_of_squares};

use super::initial_responses::{Column, UNDETERMINED, closest_of, impulse_response, until_negligible};
use super::{InitialCondition, NOTHING_LEFT, are_worth, check_inputs, history};
use crate::Error;
use crate::data::{Record, measured};
use crate::model::PolynomialModel;

/// The innovations of one segment.
#[derive(Debug, Clone)]
pub(crate) struct Innovations {
    /// The samples used: the segment, and before it those that it starts from.
    pub(crate) rows: Range<usize>,
    /// How many of the first of the rows have e = 0 for want of what was before.
    pub(super) presample: usize,
    /// The samples of the segment that count, if their output was measured.
    pub(crate) span: Range<usize>,
    /// Those that count: the span, but where outputs are missing.
    pub(crate) counted: Vec<Range<usize>>,
    /// What x starts from, and what that was found among.
    pub(super) impulses: Impulses,
    pub(super) basis: Basis,
    /// w, one value for each of `rows`; -x where the output is missing.
    pub(crate) disturbance: Vec<f64>,
    /// e, one value for each of `rows`; zero where it is not known.
    pub(crate) errors: Vec<f64>,
    /// How many errors are known, whether they count or not.
    known: usize,
}

impl Innovations {
    /// Errors that were found another way, one for each of `rows`.
    pub(crate) fn alone(rows: Range<usize>, counted: Vec<Range<usize>>, errors: Vec<f64>) -> Self {
        Self {
            presample: 0,
            span: rows.clone(),
            rows,
            known: counted.iter().map(Range::len).sum(),
            counted,
            impulses: Impulses { first: 0, weights: Vec::new() },
            basis: Basis::default(),
            disturbance: Vec::new(),
            errors,
        }
    }

    /// The errors that count.
    pub(crate) fn counted_errors(&self) -> impl Iterator<Item = &f64> + Clone {
        let first = self.rows.start;
        self.counted.iter().flat_map(move |rows| &self.errors[rows.start - first..rows.end - first])
    }
}

/// Impulses into 1/F from a sample of a segment on, for each input.
#[derive(Debug, Clone)]
pub(super) struct Impulses {
    pub(super) first: usize,
    pub(super) weights: Vec<Vec<f64>>,
}

impl Impulses {
    pub(super) fn none(model: &PolynomialModel) -> Self {
        Self { first: 0, weights: vec![Vec::new(); model.f.len()] }
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.weights.iter().all(Vec::is_empty)
    }
}

/// Which impulses are estimated for a segment.
#[derive(Debug, Clone, Default)]
pub(super) struct Basis {
    /// The first samples of the segment have no e.
    presample: usize,
    /// The sample that the first impulse is at, and how many there are for each input.
    pub(super) first: usize,
    pub(super) counts: Vec<usize>,
    /// Where no error is known.
    gaps: Vec<Range<usize>>,
}

/// The innovations of each segment that has samples with a prediction `horizon` steps ahead. Only these count: those
/// with a measured output to look from, for a start from anything but zero.
///
/// Where the inputs before the record are unknown and matter, their effect is estimated with the initial conditions if
/// that is worth its parameters, for all segments or none, by the rule of
/// [`Initial::Auto`](crate::estimate::Initial::Auto).
///
/// O(N (na + nb + nc + nd + nf)), and O(N n^2) more for n initial conditions, as far as their responses do not die
/// away.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the model's inputs; [`Error::Undetermined`] if an initial condition
/// cannot be told from the data.
pub(crate) fn innovations(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    start: InitialCondition,
) -> Result<Vec<Innovations>, Error> {
    of_record(model, record, horizon, start, true)
}

/// The same where only errors are needed: without the disturbances of models that need past outputs, as long as the
/// errors. Of the others predictions through missing outputs need them.
pub(super) fn errors_alone(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    start: InitialCondition,
) -> Result<Vec<Innovations>, Error> {
    of_record(model, record, horizon, start, !model.orders.needs_past_outputs())
}

fn of_record(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    start: InitialCondition,
    disturbances: bool,
) -> Result<Vec<Innovations>, Error> {
    check_inputs(model, record)?;
    let segments = record.segments.iter().zip(&record.past);
    let segments: Vec<_> = segments.map(|(segment, past)| (segment.clone(), *past)).collect();
    of_segments(model, record, &segments, horizon, start, disturbances)
}

/// The same of some segments, each with the number of measured samples before it.
pub(super) fn of_segments(
    model: &PolynomialModel,
    record: &Record<'_>,
    segments: &[(Range<usize>, usize)],
    horizon: usize,
    start: InitialCondition,
    disturbances: bool,
) -> Result<Vec<Innovations>, Error> {
    let all = |with_inputs: bool| -> Result<Vec<Innovations>, Error> {
        let each = segments.iter().filter_map(|(segment, past)| {
            let found =
                of_segment(model, record, segment, *past, horizon, (start, with_inputs), disturbances);
            found.transpose()
        });
        each.collect()
    };
    let found = all(false)?;
    let matters = |(_, past): &(Range<usize>, usize)| {
        let count = |with_inputs| unknowns(model, estimated(model, *past, with_inputs).1, with_inputs);
        count(true) > count(false)
    };
    if start != InitialCondition::Estimate || !segments.iter().any(matters) {
        return Ok(found);
    }
    let Ok(more) = all(true) else { return Ok(found) };
    let known = |found: &Innovations| sum_of_squares(found.errors.get(found.presample..).unwrap_or_default());
    let square = |found: &[Innovations]| found.iter().map(known).sum::<f64>();
    let unknown = |found: &[Innovations]| {
        found.iter().flat_map(|found| &found.impulses.weights).map(Vec::len).sum::<usize>()
    };
    let samples = found.iter().map(|found| found.known).sum::<usize>();
    let outputs = found.iter().flat_map(|found| measured(record.output, &found.span));
    let nothing = NOTHING_LEFT * outputs.map(|rows| sum_of_squares(&record.output[rows])).sum::<f64>();
    let extra = unknown(&more).saturating_sub(unknown(&found));
    let worth = extra > 0 && are_worth(samples, square(&found), square(&more), extra, nothing);
    Ok(if worth { more } else { found })
}

/// For a start from estimated initial conditions: how many samples of a segment have no e, and where impulses begin.
/// The segment begins with the past that the errors of its segment reach back to.
fn estimated(model: &PolynomialModel, past: usize, with_inputs: bool) -> (usize, usize) {
    let presample = past.min(model.orders.history()).max(model.orders.conditioned());
    (presample, if past > 0 || with_inputs { presample - model.orders.nd } else { 0 })
}

/// The innovations of one segment, if it has enough samples.
fn of_segment(
    model: &PolynomialModel,
    record: &Record<'_>,
    segment: &Range<usize>,
    past: usize,
    horizon: usize,
    (start, with_inputs): (InitialCondition, bool),
    disturbances: bool,
) -> Result<Option<Innovations>, Error> {
    let conditioned = model.orders.conditioned();
    let ahead = horizon.saturating_sub(1);
    let (first, presample, skipped) = match start {
        InitialCondition::Zero => (segment.start, 0, 0),
        InitialCondition::Drop => {
            (history(model, segment, past, ahead), conditioned, conditioned.saturating_add(ahead))
        }
        InitialCondition::Estimate => {
            let (presample, _) = estimated(model, past, with_inputs);
            let first = segment.start - past.min(model.orders.history());
            (first, presample, presample.saturating_add(ahead))
        }
    };
    let rows = first..segment.end;
    let span = first.saturating_add(skipped).clamp(segment.start, segment.end)..segment.end;
    let counted = measured_runs(model, record, &span);
    if counted.is_empty() {
        return Ok(None);
    }
    let after =
        measured_runs(model, record, &(first.saturating_add(presample).min(segment.end)..segment.end));
    let known = after.iter().map(Range::len).sum::<usize>();
    let mut impulses = Impulses::none(model);
    let mut basis = Basis { presample, first: 0, counts: vec![0; model.orders.inputs()], gaps: Vec::new() };
    let (mut disturbance, mut errors) = residuals(model, record, &rows, presample, &impulses, disturbances);
    if start == InitialCondition::Estimate {
        // Numbers that as many samples determine fit them, whatever they are.
        let (_, origin) = estimated(model, past, with_inputs);
        let with_inputs = with_inputs && known > unknowns(model, origin, true);
        let (_, origin) = estimated(model, past, with_inputs);
        let unknown = unknowns(model, origin, with_inputs);
        if known <= unknown {
            return Ok(None);
        }
        if unknown > 0 {
            // Where no error is known.
            let starts = std::iter::once(0).chain(after.iter().map(|run| run.end - first));
            let ends = after.iter().map(|run| run.start - first).chain([rows.len()]);
            let gaps: Vec<Range<usize>> = starts.zip(ends).map(|(start, end)| start..end).collect();
            let counts = (0..model.orders.inputs()).map(|input| count(model, input, origin, with_inputs));
            basis = Basis { presample, first: origin, counts: counts.collect(), gaps };
            impulses = best(model, &errors, &basis)?;
            (disturbance, errors) = residuals(model, record, &rows, presample, &impulses, disturbances);
        }
    }
    Ok(Some(Innovations { rows, presample, basis, span, counted, impulses, disturbance, errors, known }))
}

/// The runs of samples that have a measured output: one for models that need past outputs, as their segments miss none.
fn measured_runs(model: &PolynomialModel, record: &Record<'_>, rows: &Range<usize>) -> Vec<Range<usize>> {
    if model.orders.needs_past_outputs() && !rows.is_empty() {
        return vec![rows.clone()];
    }
    measured(record.output, rows)
}

/// x over segments of the inputs, zeros before them, all as long as one another.
pub(super) fn driven(
    model: &PolynomialModel,
    inputs: &[&[f64]],
    length: usize,
    impulses: &Impulses,
) -> Vec<f64> {
    let mut sum = vec![0.0; length];
    for ((b, u), (f, weights)) in model.b.iter().zip(inputs).zip(model.f.iter().zip(&impulses.weights)) {
        if f.len() == 1 {
            add_filtered(&mut sum, &(0..length), b, u, 0);
        } else {
            let mut own = vec![0.0; length];
            add_filtered(&mut own, &(0..length), b, u, 0);
            add(&mut own[impulses.first.min(length)..], weights);
            divide(f, &mut own);
            add(&mut sum, &own);
        }
    }
    sum
}

fn add(sum: &mut [f64], values: &[f64]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

/// w and e over some rows, zeros before them. Where the output is missing, w = -x and e = 0. Without `disturbances` a
/// model that needs past outputs has no w.
pub(super) fn residuals(
    model: &PolynomialModel,
    record: &Record<'_>,
    rows: &Range<usize>,
    presample: usize,
    impulses: &Impulses,
    disturbances: bool,
) -> (Vec<f64>, Vec<f64>) {
    let inputs: Vec<&[f64]> = record.inputs.iter().map(|u| &u[rows.clone()]).collect();
    let mut disturbance = driven(model, &inputs, rows.len(), impulses);
    disturbance.iter_mut().for_each(|value| *value = -*value);
    if model.orders.needs_past_outputs() {
        add_filtered(&mut disturbance, rows, &model.a, record.output, rows.start);
        let kept = if disturbances { disturbance.clone() } else { Vec::new() };
        return (kept, whitened(model, disturbance, presample));
    }
    let mut errors = vec![0.0; rows.len()];
    for (t, y) in record.output[rows.clone()].iter().enumerate().filter(|(_, y)| !y.is_nan()) {
        disturbance[t] += y;
        if t >= presample {
            errors[t] = disturbance[t];
        }
    }
    (disturbance, errors)
}

/// (1/C) of D w, of which the first samples are set to zero.
fn whitened(model: &PolynomialModel, disturbance: Vec<f64>, presample: usize) -> Vec<f64> {
    let samples = disturbance.len();
    let mut errors = if model.d.len() == 1 {
        disturbance
    } else {
        let mut errors = vec![0.0; samples];
        add_filtered(&mut errors, &(0..samples), &model.d, &disturbance, 0);
        errors
    };
    let (head, tail) = errors.split_at_mut(presample.min(samples));
    head.fill(0.0);
    divide(&model.c, tail);
    errors
}

/// How many impulses an input has: nf, or as many more as there are unknown inputs that x depends on from sample
/// `first` on.
fn count(model: &PolynomialModel, input: usize, first: usize, with_inputs: bool) -> usize {
    let orders = &model.orders;
    if with_inputs { orders.free_responses_and_inputs(input, first) } else { orders.free_responses(input) }
}

/// How many all inputs have.
fn unknowns(model: &PolynomialModel, first: usize, with_inputs: bool) -> usize {
    (0..model.orders.inputs()).map(|input| count(model, input, first, with_inputs)).sum()
}

/// The impulses that make the errors smallest, given those without impulses.
pub(super) fn best(model: &PolynomialModel, errors: &[f64], basis: &Basis) -> Result<Impulses, Error> {
    let (length, columns) = free_columns(model, errors.len(), basis);
    let mut weights = closest_of(&errors[..length], &columns)?.into_iter();
    let each = basis.counts.iter().map(|count| weights.by_ref().take(*count).collect());
    Ok(Impulses { first: basis.first, weights: each.collect() })
}

/// What unit impulses do to the errors of a segment, and how many samples of it say something of them.
pub(super) fn free_columns(model: &PolynomialModel, samples: usize, basis: &Basis) -> (usize, Vec<Column>) {
    let Basis { presample, first, counts, gaps } = basis;
    let (presample, first) = (*presample, *first);
    let orders = &model.orders;
    let order = orders.nc + orders.nd;
    let (unknown, most) = (counts.iter().sum::<usize>(), counts.iter().copied().max().unwrap_or(0));
    // As far as what any of them does has not died away, and there are more samples than impulses.
    let lasting = |f: &Vec<f64>| {
        let compute = |length| impulse_response(&[f, &model.c], length);
        until_negligible(samples, order + f.len(), compute).len() + f.len()
    };
    let lasting = model.f.iter().map(lasting).max().unwrap_or(0) + most;
    let length = (lasting + presample + orders.nd).max(unknown + presample + 1).min(samples);

    let gain: f64 = model.d.iter().map(|d| d.abs()).sum();
    let column = |response: &[f64], delay: usize| {
        let mut delayed = vec![0.0; (first + delay).min(length)];
        delayed.extend_from_slice(&response[..length - delayed.len()]);
        let size = |values: &[f64]| values.iter().fold(0.0_f64, |size, value| size.hypot(*value));
        let before = gain * size(&delayed);
        let mut values = whitened(model, delayed, presample);
        for gap in gaps {
            values[gap.start.min(length)..gap.end.min(length)].fill(0.0);
        }
        let rounding = UNDETERMINED * before.max(size(&values));
        Column { values, rounding }
    };
    let mut columns: Vec<Column> = Vec::new();
    for (f, count) in model.f.iter().zip(counts).filter(|(f, _)| f.len() > 1) {
        let response = impulse_response(&[f], length);
        columns.extend((0..*count).map(|delay| column(&response, delay)));
    }
    (length, columns)
}
