//! The steps of a clock.

use thetahat_numerics::regression::sum;

use super::{Clock, named::NAMED};
use crate::Error;
use crate::data::{JITTER, Regular, Resample, Times, gap_above, shortest};

/// A clock and what is wrong with it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    pub(super) clock: Clock,
    /// Steps that do not go forward.
    pub(super) backward: usize,
    /// The 1-based row of the first of them.
    pub(super) first_backward: Option<usize>,
    /// Whether the time repeats there.
    pub(super) repeats: bool,
    /// The uniform clock that goes with it; none where there is one already.
    pub(super) regular: Option<Regular>,
    /// Where the clock has two rates, what a fit puts it on by itself.
    pub(super) rates: Option<Resample>,
}

impl Ticks {
    /// The steps as [`Log::with_time`](crate::data::Log::with_time) takes them: over 1.5 medians there is a gap;
    /// another step more than 10 % off the median makes the clock irregular. The median is that of the steps that go
    /// forward. O(N).
    ///
    /// # Errors
    /// [`Error::Argument`] for a sample time that is not positive; [`Error::Data`] for times that are not one for each
    /// row, not finite, or never advance.
    pub(super) fn new(times: &Times, rows: usize) -> Result<Self, Error> {
        let time = match times {
            Times::Uniform(step) if step.is_finite() && *step > 0.0 => {
                let clock = Clock {
                    sample_time: *step,
                    measured: false,
                    steps: (*step, *step),
                    jitter: 0.0,
                    gaps: 0,
                    gap_rows: Vec::new(),
                    irregular: false,
                };
                return Ok(Self::forward(clock));
            }
            Times::Uniform(step) => {
                let message = format!("{step} is not a positive number of seconds");
                return Err(Error::argument("sample time", message));
            }
            Times::Measured(time) => time,
        };
        let at = |row: usize, message: &str| Error::Data {
            channel: None,
            row: Some(row),
            message: message.to_owned(),
        };
        if time.len() != rows {
            return Err(Error::data(format!("there are {} time stamps for {rows} rows", time.len())));
        }
        if let Some(row) = time.iter().position(|time| !time.is_finite()) {
            return Err(at(row + 1, "the time is not a finite number"));
        }
        if rows < 2 {
            return Err(Error::data("one row has no time step; the log needs at least two"));
        }
        let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if let Some(row) = steps.iter().position(|step| !step.is_finite()) {
            return Err(at(row + 2, "the time step is not a finite number"));
        }
        let mut forward: Vec<f64> = steps.iter().copied().filter(|step| *step > 0.0).collect();
        let latest = time.iter().fold(0.0_f64, |latest, time| latest.max(time.abs()));
        let Some(median) = median(&mut forward) else {
            return Err(at(
                2,
                "the time never advances; name another column (`time`), or give `sample-time`",
            ));
        };
        let median = shortest(median, 2.0 * f64::EPSILON * latest);
        let gap = gap_above(time, median);
        let (gaps, regular): (Vec<f64>, Vec<f64>) = steps.iter().partition(|step| **step > gap);
        let off = |step: &&f64| (**step - median).abs() > JITTER * median;
        let count = regular.len().max(1) as f64;
        // In units of the median, so that no square leaves the range of numbers.
        let relative = || regular.iter().map(|step| step / median);
        let mean = sum(relative()) / count;
        let jitter = (sum(relative().map(|step| (step - mean).powi(2))) / count).sqrt();
        let backward = |step: &f64| *step <= 0.0;
        let clock = Clock {
            sample_time: median,
            measured: true,
            steps: steps.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &step| {
                (low.min(step), high.max(step))
            }),
            jitter,
            gaps: gaps.len(),
            gap_rows: (0..steps.len())
                .filter(|&row| steps[row] > gap)
                .map(|row| row + 2)
                .take(NAMED)
                .collect(),
            irregular: regular.iter().any(|step| off(&step)),
        };
        Ok(Self {
            backward: steps.iter().copied().filter(backward).count(),
            first_backward: steps.iter().position(backward).map(|position| position + 2),
            repeats: steps.iter().find(|step| backward(step)) == Some(&0.0),
            regular: Some(Regular::of(time, median)),
            rates: if clock.irregular && !steps.iter().any(backward) {
                Resample::for_two_rates(time)?
            } else {
                None
            },
            clock,
        })
    }

    /// A clock that runs forward and is uniform, but for gaps.
    fn forward(clock: Clock) -> Self {
        Self { clock, backward: 0, first_backward: None, repeats: false, regular: None, rates: None }
    }
}

impl Ticks {
    /// The steps inside of each of several experiments, which are uniform with this sample time. O(N).
    ///
    /// # Errors
    /// As for [`Ticks::new`].
    pub(super) fn joined<'a>(
        times: impl Iterator<Item = &'a [f64]>,
        sample_time: f64,
    ) -> Result<Self, Error> {
        let clock = Clock {
            sample_time,
            measured: true,
            steps: (f64::INFINITY, f64::NEG_INFINITY),
            jitter: 0.0,
            gaps: 0,
            gap_rows: Vec::new(),
            irregular: false,
        };
        let mut joined = Self::forward(clock);
        let (mut square, mut count) = (0.0, 0.0);
        let mut before = 0;
        for time in times {
            // One row has no step.
            if time.len() < 2 {
                before += time.len();
                continue;
            }
            let own = Self::new(&Times::Measured(time.to_vec()), time.len())?.clock;
            let (low, high) = joined.clock.steps;
            joined.clock.steps = (low.min(own.steps.0), high.max(own.steps.1));
            joined.clock.gaps += own.gaps;
            let named = joined.clock.gap_rows.len();
            let own_rows = own.gap_rows.iter().map(|row| before + row);
            joined.clock.gap_rows.extend(own_rows.take(NAMED - named));
            before += time.len();
            let steps = (time.len() - 1 - own.gaps) as f64;
            square += steps * own.jitter * own.jitter;
            count += steps;
        }
        if count > 0.0 {
            joined.clock.jitter = (square / count).sqrt();
        } else {
            joined.clock.steps = (sample_time, sample_time);
        }
        Ok(joined)
    }
}

/// The median; the mean of the middle two of an even number.
fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = if even { below.iter().copied().fold(f64::MIN, f64::max) } else { upper };
    Some(f64::midpoint(lower, upper))
}
