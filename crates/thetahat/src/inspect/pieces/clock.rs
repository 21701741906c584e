//! The steps of a clock, in one pass.

use super::counts::Counts;
use crate::Error;
use crate::data::{GAP, JITTER, Regular, gap_of, shortest};
use crate::inspect::Clock;
use crate::inspect::clock::Ticks;
use crate::inspect::named::NAMED;

/// So many steps that may be gaps are kept.
const MOST_LONG: usize = 1 << 12;
/// This many different steps are told apart exactly.
const MOST: usize = 1 << 16;

/// The steps so far.
#[derive(Debug)]
pub(super) struct Steps {
    steps: Counts,
    first: f64,
    last: f64,
    rows: usize,
    largest: f64,
    range: (f64, f64),
    backward: usize,
    /// The median step of the first part.
    usual: f64,
    /// The first steps that may be gaps: the row after each from 1, and its length.
    long: Vec<(usize, f64)>,
    /// The first step that does not go forward: its row from 1, and whether the time repeats.
    first_backward: Option<(usize, bool)>,
}

impl Steps {
    /// # Errors
    /// [`Error::Data`] for a time that is not finite, with its row.
    pub(super) fn new(time: &[f64]) -> Result<Self, Error> {
        let first = time.first().copied().unwrap_or(0.0);
        let mut steps = Self {
            steps: Counts::new(MOST),
            first,
            last: first,
            rows: 0,
            largest: 0.0,
            range: (f64::INFINITY, f64::NEG_INFINITY),
            backward: 0,
            usual: f64::INFINITY,
            long: Vec::new(),
            first_backward: None,
        };
        steps.add(time)?;
        // A first part that never advances shows no gap.
        let all = steps.rows;
        steps.usual = steps.median().map_or(f64::INFINITY, |(median, _)| median);
        for (row, pair) in time.windows(2).enumerate() {
            steps.rows = row + 2;
            steps.keep_long(pair[1] - pair[0]);
        }
        steps.rows = all;
        Ok(steps)
    }

    /// Adds the next times.
    ///
    /// # Errors
    /// [`Error::Data`] for a time or a step that is not finite, with its row among these; nothing is added then.
    pub(super) fn add(&mut self, time: &[f64]) -> Result<(), Error> {
        let at = |row: usize, what: &str| Error::Data {
            channel: None,
            row: Some(row + 1),
            message: format!("the time {what} not a finite number"),
        };
        if let Some(row) = time.iter().position(|time| !time.is_finite()) {
            return Err(at(row, "is"));
        }
        let mut before = self.last;
        for (row, &time) in time.iter().enumerate() {
            if !(time - before).is_finite() {
                return Err(at(row, "step is"));
            }
            before = time;
        }
        for &time in time {
            let step = time - self.last;
            self.last = time;
            self.rows += 1;
            self.largest = self.largest.max(time.abs());
            if self.rows == 1 {
                continue;
            }
            self.steps.push(step);
            self.range = (self.range.0.min(step), self.range.1.max(step));
            self.keep_long(step);
            if step <= 0.0 {
                self.backward += 1;
                self.first_backward.get_or_insert((self.rows, step == 0.0));
            }
        }
        Ok(())
    }

    /// Keeps the step to the row at hand, if it may be a gap.
    fn keep_long(&mut self, step: f64) {
        if step > GAP * self.usual && self.long.len() < MOST_LONG {
            self.long.push((self.rows, step));
        }
    }

    /// The time of the first row.
    pub(super) fn first(&self) -> f64 {
        self.first
    }

    /// Whether all steps go forward.
    pub(super) fn run_forward(&self) -> bool {
        self.backward == 0
    }

    /// The median of the steps that go forward, and whether it is exact.
    ///
    /// # Errors
    /// [`Error::Data`] if there is none.
    pub(super) fn median(&mut self) -> Result<(f64, bool), Error> {
        self.steps.settle();
        let forward = self.steps.count() - self.backward as u64;
        let at = |position: u64| self.steps.at(self.backward as u64 + position);
        let middle = forward / 2;
        let lower = if forward.is_multiple_of(2) { middle.saturating_sub(1) } else { middle };
        let pair = at(lower).zip(at(middle)).filter(|_| forward > 0);
        let (lower, upper) = pair.ok_or_else(|| Error::Data {
            channel: None,
            row: None,
            message: "the time never advances; name another column (`time`), or give `sample-time`"
                .to_owned(),
        })?;
        let median = shortest(f64::midpoint(lower, upper), 2.0 * f64::EPSILON * self.largest);
        Ok((median, self.steps.is_exact()))
    }

    /// What there is to say of them, as [`Ticks::new`] does, and whether the median is exact.
    ///
    /// # Errors
    /// As for [`median`](Self::median).
    pub(super) fn finish(&mut self) -> Result<(Ticks, bool), Error> {
        let (median, exact) = self.median()?;
        let above = |limit: f64| {
            self.steps.values().filter(|(step, _)| *step > limit).map(|(_, times)| times).sum::<u64>()
        };
        let all = self.steps.count();
        // The same rule as of a log that is held in memory.
        let few = all / 20;
        let most = || self.steps.at(all.saturating_sub(1 + few)).unwrap_or(median);
        let gap = gap_of(GAP * median, above(GAP * median) as f64, all as f64, most);
        let (mut count, mut gaps, mut total) = (0.0, 0, 0.0);
        let mut irregular = false;
        for (step, times) in self.steps.values() {
            if step > gap {
                gaps += times as usize;
            } else {
                count += times as f64;
                total += times as f64 * (step / median);
                irregular |= (step - median).abs() > JITTER * median;
            }
        }
        let mean = total / count.max(1.0);
        let regular = self.steps.values().filter(|(step, _)| *step <= gap);
        let square: f64 = regular.map(|(step, times)| times as f64 * (step / median - mean).powi(2)).sum();
        let long = self.long.iter().filter(|(_, step)| *step > gap);
        let clock = Clock {
            sample_time: median,
            measured: true,
            steps: self.range,
            jitter: (square / count.max(1.0)).sqrt(),
            gaps,
            gap_rows: long.map(|(row, _)| *row).take(NAMED).collect(),
            irregular,
        };
        let ticks = Ticks {
            clock,
            backward: self.backward,
            first_backward: self.first_backward.map(|(row, _)| row),
            repeats: self.first_backward.is_some_and(|(_, repeats)| repeats),
            regular: Some(Regular::new(self.last - self.first, self.rows, median)),
            rates: None,
        };
        Ok((ticks, exact))
    }
}
