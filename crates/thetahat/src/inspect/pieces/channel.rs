//! The quality of one channel, in one pass.

use thetahat_numerics::regression::sum;

use super::counts::Counts;
use super::far::Distances;
use crate::data::{Finding, Rows};
use crate::inspect::named::{NAMED, name};
use crate::inspect::saturation::{NEAR, crowded};
use crate::inspect::{ChannelQuality, Saturation, moments, quantization};

/// Levels at a limit: it, those near it, and one more.
const LEVELS: usize = NEAR + 2;

/// What is known of the values so far.
#[derive(Debug)]
pub(super) struct ChannelTotals {
    pub(super) missing: usize,
    missing_rows: Vec<Rows>,
    repeated: usize,
    /// The run that may go on, and whether it is the first.
    run: Option<Run>,
    /// Whether there was one.
    begun: bool,
    longest_hold: usize,
    lowest: Vec<Level>,
    highest: Vec<Level>,
    spread: Spread,
    /// The different values, while they are not too many.
    values: Option<Counts>,
    most: usize,
    /// Whether those that were too many were rounded to a step.
    rounded: bool,
    distances: Distances,
}

#[derive(Debug, Clone, Copy)]
struct Run {
    value: f64,
    rows: usize,
    start: usize,
    first: bool,
    /// Whether the row before this one is of it.
    open: bool,
}

impl Run {
    fn named(&self) -> Rows {
        Rows::from_positions(&(self.start..self.start + self.rows))
    }
}

/// A value near a limit.
#[derive(Debug, Clone)]
struct Level {
    value: f64,
    rows: usize,
    /// In runs of several, but for the first and the last.
    held: usize,
    /// The first of these runs.
    runs: Vec<Rows>,
}

/// The times and values of rows, and their products about the means, in units of `scale`: see
/// `regression::lagged_moments`.
#[derive(Debug, Clone, Copy, Default)]
struct Spread {
    count: f64,
    scale: f64,
    time: f64,
    value: f64,
    times: f64,
    both: f64,
    values: f64,
}

impl Spread {
    fn new(time: &[f64], values: &[f64]) -> Self {
        let scale = moments::scale(values.iter().copied());
        let scaled: Vec<f64> = values.iter().map(|value| scale * value).collect();
        let (middle, level) = (moments::mean(time), moments::mean(&scaled));
        let pairs = || time.iter().map(|time| time - middle).zip(scaled.iter().map(|value| value - level));
        Self {
            count: values.len() as f64,
            scale,
            time: middle,
            value: level,
            times: sum(pairs().map(|(time, _)| time * time)),
            both: sum(pairs().map(|(time, value)| time * value)),
            values: sum(pairs().map(|(_, value)| value * value)),
        }
    }

    /// The same in units of another scale.
    fn in_units_of(self, scale: f64) -> Self {
        let factor = scale / self.scale;
        Self {
            scale,
            value: factor * self.value,
            both: factor * self.both,
            values: factor * factor * self.values,
            ..self
        }
    }

    fn merge(&mut self, other: &Self) {
        if self.count == 0.0 {
            *self = *other;
            return;
        }
        // That of the larger values.
        let scale = self.scale.min(other.scale);
        let (own, other) = (self.in_units_of(scale), other.in_units_of(scale));
        let count = own.count + other.count;
        let share = other.count / count;
        let (later, apart) = (other.time - own.time, other.value - own.value);
        let weight = own.count * share;
        *self = Self {
            count,
            scale,
            time: own.time + share * later,
            value: own.value + share * apart,
            times: own.times + other.times + weight * later * later,
            both: own.both + other.both + weight * later * apart,
            values: own.values + other.values + weight * apart * apart,
        };
    }
}

impl ChannelTotals {
    /// Of one channel of so many.
    pub(super) fn new(channels: usize) -> Self {
        // All of them together take some 50 MB at most, but for very many.
        let most = ((1 << 20) / channels.max(1)).clamp(1 << 12, 1 << 16);
        Self {
            missing: 0,
            missing_rows: Vec::new(),
            repeated: 0,
            run: None,
            begun: false,
            longest_hold: 0,
            lowest: Vec::new(),
            highest: Vec::new(),
            spread: Spread::default(),
            values: Some(Counts::new(usize::MAX)),
            most,
            rounded: false,
            distances: Distances::new(most / 4),
        }
    }

    /// Adds the next rows, the first of which has this position; `elapsed` gives the time of each.
    pub(super) fn add(&mut self, values: &[f64], first: usize, elapsed: impl Fn(usize) -> f64) {
        let (mut there, mut times) = (Vec::with_capacity(values.len()), Vec::with_capacity(values.len()));
        for (position, &value) in values.iter().enumerate() {
            if value.is_nan() {
                self.missing += 1;
                name(&mut self.missing_rows, first + position);
                if let Some(run) = &mut self.run {
                    run.open = false;
                }
                continue;
            }
            there.push(value);
            times.push(elapsed(position));
            if let Some(values) = &mut self.values {
                values.push(value);
            }
            self.distances.push(value, first + position);
            match &mut self.run {
                Some(run) if run.open && run.value == value => {
                    run.rows += 1;
                    self.repeated += 1;
                }
                run => {
                    let next =
                        Run { value, rows: 1, start: first + position, first: !self.begun, open: true };
                    self.begun = true;
                    if let Some(ended) = run.replace(next) {
                        self.end(ended, false);
                    }
                }
            }
        }
        if !there.is_empty() {
            self.spread.merge(&Spread::new(&times, &there));
        }
        if let Some(values) = &mut self.values {
            values.settle();
            if values.different() > self.most {
                // Where some values are not rounded to any step, more of them are not either.
                self.rounded = step(values).is_some();
                self.values = None;
            }
        }
    }

    /// A run is over.
    fn end(&mut self, run: Run, last: bool) {
        self.longest_hold = self.longest_hold.max(run.rows);
        let held = if run.first || last || run.rows < 2 { 0 } else { run.rows };
        count(&mut self.lowest, |level| level < run.value, &run, held);
        count(&mut self.highest, |level| level > run.value, &run, held);
    }

    /// The last rows that repeat one value.
    pub(super) fn tail(&self) -> usize {
        self.run.filter(|run| run.open).map_or(0, |run| run.rows)
    }

    /// The smallest and the largest value of the runs that are over.
    fn range(&self) -> Option<[f64; 2]> {
        Some([self.lowest.first()?.value, self.highest.first()?.value])
    }

    /// What there is to say of all rows, and what is left out. None follows.
    pub(super) fn finish(&mut self, channel: &str, role: Option<&str>) -> (ChannelQuality, Vec<Finding>) {
        if let Some(run) = self.run {
            self.end(run, true);
        }
        let mut words = Vec::new();
        let mut quality = ChannelQuality {
            missing: self.missing,
            missing_rows: std::mem::take(&mut self.missing_rows),
            repeated: self.repeated,
            longest_hold: self.longest_hold,
            ..ChannelQuality::without_values(channel, role)
        };
        let Some([minimum, maximum]) = self.range() else { return (quality, words) };
        (quality.minimum, quality.maximum) = (Some(minimum), Some(maximum));
        quality.saturation = self.saturation();
        quality.quantization = self.values.as_ref().and_then(step);
        if self.rounded {
            let seen = format!("channel '{channel}' has more than {} different values", self.most);
            let sentence = format!("{seen}: what it is rounded to is left out");
            words.push(Finding::left_out(sentence).of(channel));
        }
        let spread = &self.spread;
        quality.mean = Some((spread.value / spread.scale).clamp(minimum, maximum));
        quality.standard_deviation = Some((spread.values / spread.count).sqrt() / spread.scale);
        if minimum < maximum && spread.times > 0.0 && spread.values > 0.0 {
            let slope = spread.both / spread.times;
            quality.trend = Some(slope / spread.scale).filter(|slope| slope.is_finite());
            let share = (slope * spread.both / spread.values).min(1.0);
            quality.trend_share = quality.trend.map(|_| share);
        }
        let far = self.distances.finish();
        quality.outlier_count = far.rows.len();
        quality.outliers = far.rows.iter().take(NAMED).map(|row| row + 1).collect();
        if far.more {
            let seen = format!(
                "channel '{channel}' has more than {} values far from their neighbours",
                self.most / 4
            );
            let sentence = format!("{seen}: of these the farthest are counted");
            words.push(Finding::left_out(sentence).of(channel));
        }
        (quality, words)
    }

    fn saturation(&self) -> Option<Saturation> {
        let rows = |levels: &[Level]| {
            // Two limits, and some levels between them.
            let (limit, others) = levels.split_first().filter(|_| levels.len() == LEVELS)?;
            let most = others.iter().take(NEAR).map(|level| level.rows).max().unwrap_or(0);
            Some(crowded(limit.held, most))
        };
        let (low, high) = rows(&self.lowest).zip(rows(&self.highest))?;
        let runs = |levels: &[Level]| levels.first().map_or_else(Vec::new, |limit| limit.runs.clone());
        Saturation::of(low, high, || runs(&self.lowest), || runs(&self.highest))
    }
}

/// The step to which values are rounded.
fn step(values: &Counts) -> Option<f64> {
    let distinct: Vec<f64> = values.values().map(|(value, _)| value).collect();
    quantization::quantization(&distinct)
}

/// Counts a run among the levels nearest to a limit: one that is pushed out by nearer ones never comes back.
fn count(levels: &mut Vec<Level>, is_nearer: impl Fn(f64) -> bool, run: &Run, held: usize) {
    let position = levels.iter().take_while(|level| is_nearer(level.value)).count();
    match levels.get_mut(position) {
        Some(level) if level.value == run.value => {
            level.rows += run.rows;
            level.held += held;
            if held > 0 && level.runs.len() < NAMED {
                level.runs.push(run.named());
            }
        }
        _ if position < LEVELS => {
            let runs = if held > 0 { vec![run.named()] } else { Vec::new() };
            levels.insert(position, Level { value: run.value, rows: run.rows, held, runs });
            levels.truncate(LEVELS);
        }
        _ => {}
    }
}
