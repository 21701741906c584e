//! The steps of a clock: their median, whether they are even, and from which one on they are a gap.

use super::regular::{Regular, shortest};
use crate::Error;
use crate::figures::short;

/// A step longer than this many medians starts a new segment.
pub(crate) const GAP: f64 = 1.5;
/// Where this part of the steps is longer, they are none: the log is one of two rates. Then a gap is longer than 1.5 of
/// the step that all but a few have.
const TWO_RATES: f64 = 1.0 / 3.0;
/// And these are so many at least.
const LONG_STEPS: f64 = 5.0;
const FEW: f64 = 0.05;
/// Steps may differ from their median by this fraction.
pub(crate) const JITTER: f64 = 0.1;

/// The first step that is neither the median nor one to a row before which the clock has a gap, or another log begins.
pub(super) fn irregularity(time: &[f64], median: f64, starts: &[usize]) -> Option<Error> {
    let off = |(position, step): &(usize, f64)| {
        (step - median).abs() > JITTER * median && starts.binary_search(&(position + 1)).is_err()
    };
    let (position, step) = steps(time).enumerate().find(off)?;
    Some(Error::Data {
        channel: None,
        row: Some(position + 2),
        message: format!(
            "the time step is {} s where the median is {} s: more than {} % off, so the log is not uniform; {}",
            short(step),
            short(median),
            100.0 * JITTER,
            Regular::of(time, median)
        ),
    })
}

/// The seconds from each row to the next.
pub(super) fn steps(time: &[f64]) -> impl Iterator<Item = f64> {
    time.windows(2).map(|pair| pair[1] - pair[0])
}

/// From how many seconds on a step of a clock is a gap, by the median step.
pub(crate) fn gap_above(time: &[f64], median: f64) -> f64 {
    let limit = GAP * median;
    let (long, all) = (steps(time).filter(|step| *step > limit).count(), time.len().saturating_sub(1));
    gap_of(limit, long as f64, all as f64, || {
        let mut steps: Vec<f64> = steps(time).collect();
        let few = (FEW * all as f64) as usize;
        let (_, step, _) = steps.select_nth_unstable_by(all - 1 - few, f64::total_cmp);
        *step
    })
}

/// The same by the number of steps above the limit for one rate, and by the step that all but a few have.
pub(crate) fn gap_of(limit: f64, long: f64, steps: f64, most: impl FnOnce() -> f64) -> f64 {
    if long >= LONG_STEPS && long >= TWO_RATES * steps { GAP * most() } else { limit }
}

/// Whether each time is finite and later than the one before. In blocks, so that the comparisons are made several at a
/// time.
pub(super) fn runs_forward(time: &[f64]) -> bool {
    const BLOCK: usize = 1024;
    let ends = [time.first(), time.last()];
    ends.iter().flatten().all(|time| time.is_finite())
        && time.len().checked_sub(1).is_none_or(|steps| {
            (0..steps).step_by(BLOCK).all(|start| {
                let pairs = &time[start..(start + BLOCK).min(steps) + 1];
                pairs[1..].iter().zip(pairs).fold(true, |all, (after, before)| all & (after > before))
            })
        })
}

/// The median time step of a clock that runs forward.
pub(super) fn median_step(time: &[f64], rows: usize) -> Result<f64, Error> {
    let at = |row: usize, message: String| Error::Data { channel: None, row: Some(row), message };
    if time.len() != rows {
        return Err(Error::data(format!("there are {} time stamps for {rows} rows", time.len())));
    }
    if !runs_forward(time) {
        if let Some(row) = time.iter().position(|time| !time.is_finite()) {
            return Err(at(row + 1, "the time is not a finite number".to_owned()));
        }
        if let Some(position) = steps(time).position(|step| step <= 0.0) {
            let (before, after) = (time[position], time[position + 1]);
            let verb = if after == before { "repeats" } else { "goes back" };
            return Err(at(
                position + 2,
                format!(
                    "time {verb} (from {before} s to {after} s); sort the log by time and remove repeated rows"
                ),
            ));
        }
    }
    let mut steps: Vec<f64> = steps(time).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return Err(Error::data("one row has no time step; the log needs at least two"));
    }
    let even = steps.len().is_multiple_of(2);
    let (below, &mut upper, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    // The median of an even number of steps is the mean of the middle two.
    let lower = if even { below.iter().copied().fold(f64::MIN, f64::max) } else { upper };
    let latest = time.iter().fold(0.0_f64, |latest, time| latest.max(time.abs()));
    Ok(shortest(f64::midpoint(lower, upper), 2.0 * f64::EPSILON * latest))
}
