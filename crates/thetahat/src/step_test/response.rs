//! A response from 0 before the step to 1 in the final steady state, and what is read off its levels.

use super::influence::{Influence, Local};
use super::noise::Noise;

/// Half of the rows around a level, as a fraction of the rise time, through which a parabola finds where it is reached.
const AROUND: f64 = 0.12;
/// By which factors it is widened until the response rises there by this many standard errors.
const WIDER: [f64; 4] = [1.0, 1.5, 2.2, 3.3];
const RISES: f64 = 3.0;
/// Windows are no narrower than this many steps of the clock to either side.
const NARROWEST: f64 = 1.6;
/// The band of the noise, in standard deviations, and how many rows in a row are outside of it once the response has
/// begun.
const BAND: f64 = 3.0;
const OUTSIDE: usize = 3;
/// What counts as settled, and the standard error with which that can be seen.
const SETTLED: f64 = 0.02;
const SEEN: f64 = 0.004;
/// The widest window for it to either side, as a fraction of the rise time.
const WIDEST: f64 = 0.25;

/// The response to a step.
#[derive(Debug)]
pub(super) struct Response<'a> {
    /// Seconds since the step, rising from 0.
    pub(super) time: &'a [f64],
    /// (y - before)/(regime - before).
    pub(super) values: Vec<f64>,
    /// Of the noise in these units.
    pub(super) noise: &'a Noise,
    /// By what the noise has to be divided: the change of the output.
    pub(super) change: f64,
    /// The variance of the level before and of that in the final steady state, in units of the noise.
    pub(super) levels: [f64; 2],
}

impl Response<'_> {
    /// The standard error of a figure: from the noise of its rows, and from the levels, by which ds/dbefore = -(1 -
    /// s)/change and ds/dregime = -s/change.
    pub(super) fn spread(&self, figure: &Influence) -> f64 {
        let weights = &figure.weights;
        let regime: f64 = weights.iter().zip(&self.values).map(|(weight, s)| weight * s).sum();
        let before = weights.iter().sum::<f64>() - regime;
        let [first, second] = self.levels;
        let variance = self.noise.variance(weights) + before * before * first + regime * regime * second;
        variance.sqrt() / self.change.abs()
    }

    /// The standard deviation of the noise of one row.
    pub(super) fn deviation(&self) -> f64 {
        self.noise.deviation() / self.change.abs()
    }

    /// The usual step of the clock over the rows of the transient.
    fn step(&self, until: f64) -> f64 {
        let rows = self.time.partition_point(|time| *time <= until).max(2).min(self.time.len());
        self.time[rows - 1] / (rows - 1) as f64
    }

    /// The first time at which a mean over some rows is above one half, and how many rows that is: the scale of the
    /// response.
    pub(super) fn half_time(&self) -> Option<(f64, usize)> {
        let mut run = 0;
        let first = self.values.iter().position(|s| {
            run = if *s > 0.5 { run + 1 } else { 0 };
            run == OUTSIDE.min(self.values.len() / 4).max(1)
        })?;
        Some((self.time[first], first + 1))
    }

    /// Means over 2 k + 1 rows, fewer at the ends.
    pub(super) fn smoothed(&self, k: usize) -> Vec<f64> {
        let mut sums = vec![0.0];
        for s in &self.values {
            sums.push(sums[sums.len() - 1] + s);
        }
        let count = self.values.len();
        (0..count)
            .map(|row| {
                let k = k.min(row).min(count - 1 - row);
                (sums[row + k + 1] - sums[row - k]) / (2 * k + 1) as f64
            })
            .collect()
    }

    /// How long it is below a level before `end`: where it is reached, if that happens once; noise moves it to either
    /// side alike.
    pub(super) fn time_below(&self, level: f64, end: f64) -> f64 {
        let rows = self.time.windows(2).zip(&self.values).take_while(|(pair, _)| pair[0] < end);
        rows.filter(|(_, s)| **s < level).map(|(pair, _)| pair[1] - pair[0]).sum()
    }

    /// Where a level is reached before `end`: on the parabola through the rows around it, as many as show that it
    /// rises, and no farther away than `most`.
    pub(super) fn crossing(&self, level: f64, end: f64, rise: f64, most: f64) -> Option<Influence> {
        let rough = self.time_below(level, end);
        WIDER.into_iter().find_map(|wider| {
            let half = (wider * AROUND * rise).min(most).max(NARROWEST * self.step(end));
            let local = Local::fit(self.time, &self.values, rough, half)?;
            let [a, b, c] = local.coefficients;
            let root = b * b - 4.0 * c * (a - level);
            // The root on the rising side, in the form that does not cancel.
            let x = 2.0 * (level - a) / (b + root.max(0.0).sqrt());
            let slope = b + 2.0 * c * x;
            let rises = slope > RISES * self.spread(&local.figure(slope, [0.0, 1.0, 0.0]));
            if !(root >= 0.0 && rises && slope > 0.0 && x.abs() <= 1.5) {
                return None;
            }
            let by = -half / slope;
            Some(local.figure(rough + half * x, [by, by * x, by * x * x]))
        })
    }

    /// The last row before the response leaves the band of the noise for good, and the spread of that: late by the time
    /// that it takes to the band.
    pub(super) fn leaves_noise(&self, rise: f64) -> Option<(f64, f64)> {
        let band = (BAND * self.deviation()).max(1e-9);
        let mut run = 0;
        let first = self.values.iter().position(|s| {
            run = if *s > band { run + 1 } else { 0 };
            run == OUTSIDE
        })?;
        let at = (first + 1 - OUTSIDE).saturating_sub(1);
        let step = self.time[at + 1] - self.time[at];
        // The slope at the start of a first order, and rows that are evenly likely within a step of the clock.
        let noisy = self.deviation() * rise / 9_f64.ln();
        Some((self.time[at], (step * step / 12.0 + noisy * noisy).sqrt()))
    }

    /// After which time it stays within 2 % of the final steady state, by means over as few rows as show that; none if
    /// noise hides it.
    pub(super) fn settles(&self, rise: f64) -> Option<Influence> {
        let step = self.step(self.time[self.time.len() - 1]);
        let most = (WIDEST * rise / step) as usize;
        let wide = |k: usize| self.noise.of_mean(2 * k + 1).sqrt() / self.change.abs() <= SEEN;
        // As wide as half of that even without noise, where rows are many: ripples of the means are no return.
        let k = (most / 4..=most).find(|k| wide(*k))?;
        let smoothed = self.smoothed(k);
        let outside = |s: &f64| (s - 1.0).abs() > SETTLED;
        // Those at the end are over fewer rows.
        let whole = smoothed.len().saturating_sub(k);
        let last = smoothed[..whole].iter().rposition(outside)?;
        let next = smoothed.get(last + 1)?;
        let edge = 1.0 + SETTLED.copysign(smoothed[last] - 1.0);
        let slope = (next - smoothed[last]) / (self.time[last + 1] - self.time[last]);
        let value = self.time[last] + (edge - smoothed[last]) / slope;
        let mut figure = Influence::known(value, self.time.len());
        let rows = last.saturating_sub(k)..(last + k + 1).min(self.time.len());
        // The slope over all of the window: that between two rows is of the noise.
        let (first, end) = (smoothed[rows.start], smoothed[rows.end - 1]);
        let across = (end - first) / (self.time[rows.end - 1] - self.time[rows.start]);
        let across = if across == 0.0 || across.signum() != slope.signum() { slope } else { across };
        let weight = -1.0 / (across * rows.len() as f64);
        figure.weights[rows].fill(weight);
        Some(figure)
    }
}
