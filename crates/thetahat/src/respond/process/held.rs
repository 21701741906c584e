//! The response of a process to held inputs, at the times of the rows.
//!
//! The state moves from row to row with the input of the row before. A dead time theta looks at it theta seconds
//! earlier, between two rows: y(t) = w'c(t - theta). So
//!
//! ```text
//! dy(t)/dtheta = -w' d/dt c(t - theta)
//! ```
//!
//! which no clock rounds. Derivatives by the shape of the lags are computed in dual numbers.

use std::ops::Range;

use thetahat_core::{Dual, Number};

use crate::Error;
use crate::data::{Log, Rows, inside};
use crate::model::{Chain, Columns, MOST_POLES, Parts, ProcessStructure, State, Transition};

/// Derivatives that are computed together: as many as lags have shapes, or as transfer functions have.
const LAGS: usize = 3;
pub(super) const LANE: usize = MOST_POLES;
/// A pause is a gap of the clock of more than so many usual steps.
const PAUSE: f64 = 10.0;
/// And of more than so many of the steps beside it.
const ALONE: f64 = 3.0;
/// Steps of a clock that differ by so many roundings of its time are the same.
const ROUNDINGS: f64 = 8.0;

/// The inputs of a log on its own clock, from its first row on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HeldLog {
    /// Its rows among those of all logs, up to the last that counts.
    pub(crate) rows: Range<usize>,
    /// Which of them count, in the same numbers.
    pub(crate) counted: Vec<Range<usize>>,
    /// Whether it begins after a pause of the clock, in which nobody knows what its inputs were: its state is then its
    /// own.
    pub(crate) after_pause: bool,
    /// Where its first row stands on the clock of all of them, in seconds.
    pub(crate) begins: f64,
    /// Seconds since its first row.
    pub(crate) times: Vec<f64>,
    /// For each input a value for each row. A missing one holds the value before it; the first ones have the first that
    /// is known.
    pub(crate) inputs: Vec<Vec<f64>>,
    /// How many values of inputs are missing.
    pub(crate) held: usize,
}

/// Each of the joined logs that has some of the rows, in pieces without a long pause of the clock. Through a short one
/// inputs hold.
///
/// # Errors
/// [`Error::Data`] for a channel that is not there, or an input that has no value at all.
pub(crate) fn held_logs(log: &Log, inputs: &[&str], rows: &[Rows]) -> Result<Vec<HeldLog>, Error> {
    let of_part = |(part, after_pause): (Range<usize>, bool)| {
        let asked = inside(rows, &part);
        let end = part.start + asked.last()?.end;
        let counted = asked.into_iter().map(|rows| rows.start + part.start..rows.end + part.start).collect();
        let held = HeldLog::new(log, inputs, part.start..end, counted);
        Some(held.map(|held| HeldLog { after_pause, ..held }))
    };
    log.logs().flat_map(|own| between_pauses(log, own)).filter_map(of_part).collect()
}

/// The rows of a log between its long pauses, and whether they follow one.
fn between_pauses(log: &Log, own: Range<usize>) -> Vec<(Range<usize>, bool)> {
    // Several long steps of a length are another rate.
    let is_alone = |row: usize| {
        let near =
            [row.checked_sub(1).filter(|row| *row > own.start), Some(row + 1).filter(|row| *row < own.end)];
        let longest = near.into_iter().flatten().map(|row| log.step_to(row)).fold(0.0, f64::max);
        log.step_to(row) > ALONE * longest
    };
    let is_long = |row: &usize| log.step_to(*row) > PAUSE * log.sample_time() && is_alone(*row);
    let inside = log.segment_starts().iter().copied().filter(|row| own.contains(row) && *row > own.start);
    let pauses: Vec<usize> = inside.filter(is_long).collect();
    let ends = pauses.iter().copied().chain([own.end]);
    let firsts = std::iter::once((own.start, false)).chain(pauses.iter().map(|row| (*row, true)));
    firsts.zip(ends).map(|((first, after), end)| (first..end, after)).collect()
}

impl HeldLog {
    fn new(
        log: &Log,
        inputs: &[&str],
        rows: Range<usize>,
        counted: Vec<Range<usize>>,
    ) -> Result<Self, Error> {
        let times = match log.time() {
            Some(time) => time[rows.clone()].iter().map(|seconds| seconds - time[rows.start]).collect(),
            None => (0..rows.len()).map(|row| row as f64 * log.sample_time()).collect(),
        };
        let mut missing = 0;
        let mut held = Vec::with_capacity(inputs.len());
        for name in inputs {
            let values = &log.channel(name)?.values[rows.clone()];
            let Some(first) = values.iter().copied().find(|value| !value.is_nan()) else {
                let message = format!("input '{name}' has no value in rows {}..{}", rows.start + 1, rows.end);
                return Err(Error::in_channel(name, None, message));
            };
            let mut last = first;
            let hold = |value: &f64| {
                missing += usize::from(value.is_nan());
                last = if value.is_nan() { last } else { *value };
                last
            };
            held.push(values.iter().map(hold).collect());
        }
        let begins = log.elapsed(rows.start);
        Ok(Self { rows, counted, after_pause: false, begins, times, inputs: held, held: missing })
    }
}

/// The last transitions, as clocks repeat their steps.
struct Steps<'c, S> {
    chain: &'c Chain<S>,
    whole: Option<(f64, Transition<S>)>,
    part: Option<(f64, Transition<S>)>,
}

impl<'c, S: Number<f64>> Steps<'c, S> {
    fn take<'k>(
        chain: &'c Chain<S>,
        kept: &'k mut Option<(f64, Transition<S>)>,
        step: f64,
        time: f64,
    ) -> &'k Transition<S> {
        let near = |own: f64| (own - step).abs() <= ROUNDINGS * f64::EPSILON * time.abs();
        if !kept.as_ref().is_some_and(|(own, _)| near(*own)) {
            *kept = None;
        }
        let (_, transition) = kept.get_or_insert_with(|| (step, chain.transition(step.into())));
        transition
    }
}

/// Calls `take` for each row with the state at its time less the dead time, and with the input there.
fn walk<S: Number<f64>>(
    chain: &Chain<S>,
    dead_time: f64,
    times: &[f64],
    input: &[f64],
    mut take: impl FnMut(usize, &State<S>, f64),
) {
    let mut steps = Steps { chain, whole: None, part: None };
    let (Some(&start), Some(&first)) = (times.first(), input.first()) else { return };
    let mut state = chain.at_rest(first, 0.0);
    let mut at = 0;
    for (row, time) in times.iter().enumerate() {
        let seen = time - dead_time;
        while times.get(at + 1).is_some_and(|next| *next <= seen) {
            let step = times[at + 1] - times[at];
            state = Steps::take(steps.chain, &mut steps.whole, step, times[at + 1]).apply(&state, input[at]);
            at += 1;
        }
        let since = seen - times[at];
        if seen < start {
            take(row, &chain.at_rest(first, seen - start), first);
        } else if since == 0.0 {
            take(row, &state, input[at]);
        } else {
            let part = Steps::take(steps.chain, &mut steps.part, since, *time);
            take(row, &part.apply(&state, input[at]), input[at]);
        }
    }
}

/// Adds the response of processes that were at rest before the first row of each log to what stands in its rows.
pub(crate) fn at_rest(
    structures: &[ProcessStructure],
    parts: &[Parts<f64>],
    held: &[HeldLog],
    response: &mut [f64],
) {
    for log in held {
        let own = &mut response[log.rows.clone()];
        for ((structure, parts), input) in structures.iter().zip(parts).zip(&log.inputs) {
            run(structure, &parts.shape, parts.dead_time, (&log.times, input), |row, columns| {
                let said: f64 =
                    parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum();
                own[row] += said;
            });
        }
    }
}

/// Calls `take` with the columns in each row.
pub(crate) fn run(
    structure: &ProcessStructure,
    shape: &[f64],
    dead_time: f64,
    (times, input): (&[f64], &[f64]),
    mut take: impl FnMut(usize, &Columns<f64>),
) {
    let chain = structure.chain(shape);
    walk(&chain, dead_time, times, input, |row, state, u| take(row, &chain.columns(state, u)));
}

/// Calls `take` with the columns in each row, and with the slopes of their sum by the shape and by the dead time.
pub(crate) fn sensitivities(
    structure: &ProcessStructure,
    parts: &Parts<f64>,
    signals: (&[f64], &[f64]),
    take: impl FnMut(usize, &Columns<f64>, &[f64], f64),
) {
    if parts.shape.len() <= LAGS {
        sensitivities_in::<LAGS>(structure, parts, signals, take);
    } else {
        sensitivities_in::<LANE>(structure, parts, signals, take);
    }
}

fn sensitivities_in<const SHAPE: usize>(
    structure: &ProcessStructure,
    parts: &Parts<f64>,
    (times, input): (&[f64], &[f64]),
    mut take: impl FnMut(usize, &Columns<f64>, &[f64], f64),
) {
    let mut values = [0.0; SHAPE];
    values.iter_mut().zip(&parts.shape).for_each(|(value, own)| *value = *own);
    let variables = Dual::<f64, SHAPE>::variables(values);
    let chain = structure.chain(&variables[..parts.shape.len().min(SHAPE)]);
    let timed = structure.has_dead_time();
    walk(&chain, parts.dead_time, times, input, |row, state, u| {
        let columns = chain.columns(state, u);
        let mut slopes = [0.0; SHAPE];
        for (weight, column) in parts.weights.iter().zip(&columns) {
            slopes.iter_mut().zip(column.derivatives).for_each(|(slope, own)| *slope += weight * own);
        }
        let by_dead_time = if timed {
            let rates = chain.rates(state, u);
            -parts.weights.iter().zip(rates).map(|(weight, rate)| weight * rate.value).sum::<f64>()
        } else {
            0.0
        };
        take(row, &columns.map(|column| column.value), &slopes, by_dead_time);
    });
}

/// The responses to a first state of each lag, one after the other, without an input: what a log that does not begin at
/// rest has of them.
pub(crate) fn modes(structure: &ProcessStructure, shape: &[f64], times: &[f64]) -> Vec<Vec<f64>> {
    let chain = structure.chain(shape);
    let of_state = |state: usize| {
        let (mut first, mut found) = (vec![0.0; chain.states()], Vec::with_capacity(times.len()));
        first[state] = 1.0;
        walk_free(&chain, &first, times, |_, value| found.push(value));
        found
    };
    (0..chain.states()).map(of_state).collect()
}

/// Calls `take` for each row with what is seen of a first state without an input.
fn walk_free<S: Number<f64>>(chain: &Chain<S>, first: &[f64], times: &[f64], mut take: impl FnMut(usize, S)) {
    let (mut kept, Some(mut last)) = (None, times.first().copied()) else { return };
    let mut state = chain.at_rest(0.0, 0.0);
    state.iter_mut().zip(first).for_each(|(state, value)| *state = (*value).into());
    for (row, time) in times.iter().enumerate() {
        if *time > last {
            state = Steps::take(chain, &mut kept, time - last, *time).apply(&state, 0.0);
            last = *time;
        }
        take(row, chain.end(&state));
    }
}

/// Calls `take` for each row with the slopes by the shape of what a first state without an input does.
pub(crate) fn free_sensitivities(
    structure: &ProcessStructure,
    shape: &[f64],
    first: &[f64],
    times: &[f64],
    take: impl FnMut(usize, &[f64]),
) {
    if shape.len() <= LAGS {
        free_sensitivities_in::<LAGS>(structure, shape, first, times, take);
    } else {
        free_sensitivities_in::<LANE>(structure, shape, first, times, take);
    }
}

fn free_sensitivities_in<const SHAPE: usize>(
    structure: &ProcessStructure,
    shape: &[f64],
    first: &[f64],
    times: &[f64],
    mut take: impl FnMut(usize, &[f64]),
) {
    let mut values = [0.0; SHAPE];
    values.iter_mut().zip(shape).for_each(|(value, own)| *value = *own);
    let variables = Dual::<f64, SHAPE>::variables(values);
    let chain = structure.chain(&variables[..shape.len().min(SHAPE)]);
    walk_free(&chain, first, times, |row, value| take(row, &value.derivatives));
}
