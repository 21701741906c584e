//! Logs on another clock: values read between samples, and decimation with an anti-alias filter.
//!
//! A signal that is sampled every T seconds says nothing of frequencies above 1/(2 T): what is there appears as lower
//! frequencies (Shannon 1949). So a log that goes to a step T at least twice the recorded one T0 is low-pass filtered
//! first,
//!
//! ```text
//! x'(t) = sum_m h(m) x(t + m) / sum_m h(m),   h(m) = 2 f T0 sinc(2 f T0 m) w(m/(M + 1)),   |m| <= M
//! w(z) = I0(beta sqrt(1 - z^2)) / I0(beta)
//! ```
//!
//! a windowed sinc with Kaiser's window (Kaiser 1974; Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed.
//! 2010, section 7.6). It passes frequencies up to 0.8/(2 T) and is 60 dB down from 1/(2 T) on: f = 0.9/(2 T), beta =
//! 0.1102 (60 - 8.7) and 2 M = (60 - 7.95)/(2.285 dw), dw = 0.2 pi T0/T being the width between the two. It has no
//! phase. All channels are filtered alike, so that y = G u stays true of what is left: a linear filter commutes with G.
//!
//! Both sums go over the rows that are there: in which all channels have a value (Knutsson and Westin, Normalized and
//! differential convolution, 1993), and none of them after a gap of the clock. At the end of a log they have about half
//! of the weight; a row for which they have less than two fifths is missing.

mod one_clock;

use std::f64::consts::PI;
use std::ops::Range;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::regression::product;

use super::log::check;
use super::regular::coarser;
use super::steps::{gap_above, median_step, steps};
use super::{Channel, GAP, Interpolation, JITTER, Log};
use crate::Error;
use crate::figures::short;

/// Rows that resampling may give: beyond them a step was mistyped.
const MOST_ROWS: f64 = 1e8;
/// A step from this many recorded ones on is filtered for.
const DECIMATES: f64 = 2.0;
/// A log of two rates is not put on a clock that is slower than the faster rate by more than this factor.
const SLOWER: f64 = 4.0;
/// Where the pass band ends and the stop band begins, in units of half the new sampling frequency.
const PASS: f64 = 0.8;
const STOP: f64 = 1.0;
/// Of the stop band, in dB.
const ATTENUATION: f64 = 60.0;
/// A row with less than this part of the filter's weight is missing.
const LEAST_WEIGHT: f64 = 0.4;

/// How to put a log on another clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resample {
    /// Seconds between the new rows.
    pub step: f64,
    /// How values between samples are read.
    pub interpolation: Interpolation,
    /// Whether to filter what the new clock cannot show, where the step is at least twice that of a uniform clock.
    pub anti_alias: bool,
}

/// The low-pass filter that a log went through before it was read at a longer step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AntiAlias {
    /// Where the gain is a half, in Hz. The pass band ends at 8/9 of it, the stop band (-60 dB) begins at 10/9 of it.
    pub cutoff: f64,
    /// Recorded samples that a filtered one is made of: one and as many before as after it.
    pub taps: usize,
}

/// How a log was put on another clock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Resampling {
    /// Seconds between the new rows.
    pub step: f64,
    /// How values between samples were read.
    pub interpolation: Interpolation,
    /// The number of rows before.
    pub rows: usize,
    /// The filter that took out what the new clock cannot show; none where it does not apply, or was not wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anti_alias: Option<AntiAlias>,
}

impl Resampling {
    /// What becomes of a log with these times.
    ///
    /// # Errors
    /// As for [`Resample::filter_for`].
    pub fn new(how: &Resample, time: &[f64]) -> Result<Self, Error> {
        let Resample { step, interpolation, .. } = *how;
        Ok(Self { step, interpolation, rows: time.len(), anti_alias: how.filter_for(time)? })
    }
}

impl Resample {
    /// With an anti-alias filter where it applies.
    pub fn new(step: f64, interpolation: Interpolation) -> Self {
        Self { step, interpolation, anti_alias: true }
    }

    /// What puts a log of two rates on a uniform clock: the faster of them, or one up to four times slower where there
    /// would be more than ten rows for each recorded one; each channel is read its own way. None for a log of one rate,
    /// and where none is slow enough.
    ///
    /// # Errors
    /// [`Error::Data`] if the times are not finite or do not rise.
    ///
    /// ```
    /// use thetahat::data::Resample;
    ///
    /// // Every second after a step, then every ten.
    /// let time: Vec<f64> = (0..60).map(f64::from).chain((6..66).map(|k| 10.0 * f64::from(k))).collect();
    /// assert_eq!(Resample::for_two_rates(&time)?.map(|how| how.step), Some(1.0));
    /// assert_eq!(Resample::for_two_rates(&time[..60])?, None);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn for_two_rates(time: &[f64]) -> Result<Option<Self>, Error> {
        let median = median_step(time, time.len())?;
        if gap_above(time, median) <= GAP * median {
            return Ok(None);
        }
        let mut all: Vec<f64> = steps(time).collect();
        let step = coarser(time, &mut all).filter(|step| *step <= SLOWER * median);
        Ok(step.map(|step| Self { step, interpolation: Interpolation::Auto, anti_alias: false }))
    }

    /// The filter for a log with these times; none where it does not apply: for a step below twice the recorded one,
    /// and for an irregular clock.
    ///
    /// # Errors
    /// [`Error::Data`] if the times are not finite or do not rise.
    pub fn filter_for(&self, time: &[f64]) -> Result<Option<AntiAlias>, Error> {
        let recorded = median_step(time, time.len())?;
        let off = |step: f64| step <= GAP * recorded && (step - recorded).abs() > JITTER * recorded;
        let ratio = self.step / recorded;
        // Rounding of decimal steps is no reason.
        if !self.anti_alias || ratio < DECIMATES * (1.0 - 1e-9) || steps(time).any(off) {
            return Ok(None);
        }
        let nyquist = 0.5 / self.step;
        let width = PI * (STOP - PASS) / ratio;
        let half = ((ATTENUATION - 7.95) / (2.285 * width) / 2.0).ceil();
        Ok(Some(AntiAlias { cutoff: 0.5 * (PASS + STOP) * nyquist, taps: (2.0 * half + 1.0) as usize }))
    }
}

impl AntiAlias {
    /// h(-M) … h(M) for a recorded step of this many seconds, of sum 1: of a filter that is longer than a log of so
    /// many rows, what they can meet.
    fn weights(&self, recorded: f64, rows: usize) -> Vec<f64> {
        let half = (self.taps / 2) as f64;
        let beta = 0.1102 * (ATTENUATION - 8.7);
        let weight = |tap: usize| {
            let m = tap as f64 - half;
            let angle = 2.0 * PI * self.cutoff * recorded * m;
            let sinc = if m == 0.0 { 1.0 } else { angle.sin() / angle };
            sinc * bessel(beta * (1.0 - (m / (half + 1.0)).powi(2)).sqrt())
        };
        let sum: f64 = (0..self.taps).map(weight).sum();
        let met = (self.taps / 2).min(rows);
        let mut weights: Vec<f64> = (self.taps / 2 - met..self.taps / 2 + met + 1).map(weight).collect();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        weights
    }
}

/// The modified Bessel function I0, by its series.
fn bessel(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > f64::EPSILON * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// A log of which filtered values are asked for.
struct Filtered<'a> {
    weights: &'a [f64],
    /// Which rows have a value in every channel, and how many before each have not.
    usable: Vec<bool>,
    missing: Vec<usize>,
    /// Rows without a gap of the clock between them.
    segments: Vec<Range<usize>>,
}

impl<'a> Filtered<'a> {
    fn new(channels: &[Channel], time: &[f64], recorded: f64, weights: &'a [f64]) -> Self {
        let usable: Vec<bool> =
            (0..time.len()).map(|row| !channels.iter().any(|channel| channel.values[row].is_nan())).collect();
        let missing = std::iter::once(0).chain(usable.iter().scan(0, |count, usable| {
            *count += usize::from(!usable);
            Some(*count)
        }));
        let gaps = steps(time).enumerate().filter(|(_, step)| *step > GAP * recorded);
        let starts: Vec<usize> = std::iter::once(0).chain(gaps.map(|(row, _)| row + 1)).collect();
        let ends = starts[1..].iter().copied().chain([time.len()]);
        Self {
            weights,
            missing: missing.collect(),
            segments: starts.iter().zip(ends).map(|(start, end)| *start..end).collect(),
            usable,
        }
    }

    /// The segment of a row.
    fn segment(&self, row: usize) -> Range<usize> {
        let after = self.segments.partition_point(|segment| segment.start <= row);
        self.segments[after - 1].clone()
    }

    /// The filtered value of a row.
    fn at(&self, values: &[f64], row: usize) -> f64 {
        let half = self.weights.len() / 2;
        let segment = self.segment(row);
        let rows = row.saturating_sub(half).max(segment.start)..(row + half + 1).min(segment.end);
        let weights = &self.weights[rows.start + half - row..rows.end + half - row];
        let (sum, weight) = if self.missing[rows.end] == self.missing[rows.start] {
            (product(weights, &values[rows.clone()]), weights.iter().sum())
        } else {
            let there = rows.zip(weights).filter(|(row, _)| self.usable[*row]);
            there.fold((0.0, 0.0), |(sum, all), (row, weight)| (sum + weight * values[row], all + weight))
        };
        if weight >= LEAST_WEIGHT { sum / weight } else { f64::NAN }
    }
}

impl Log {
    /// The log on a uniform clock: as it is, or one of two rates resampled as [`Resample::for_two_rates`] says, which
    /// is given with it.
    ///
    /// # Errors
    /// [`Error::Data`] with the first row whose step is another, for a log that is irregular otherwise.
    pub fn on_one_rate(self) -> Result<(Self, Option<Resample>), Error> {
        let Err(irregular) = self.check_uniform() else { return Ok((self, None)) };
        let time = self.time().unwrap_or_default();
        match Resample::for_two_rates(time)? {
            Some(how) => Ok((Self::resampled(self.channels().to_vec(), time, &how)?, Some(how))),
            None => Err(irregular),
        }
    }

    /// A uniform log read off one with another clock, every `how.step` seconds from its first sample on.
    ///
    /// Without an anti-alias filter ([`Resample::filter_for`] says whether there is one) a value is missing where a
    /// sample that it is read off is missing, and every interval between two samples is bridged, however long. With it
    /// the filtered signals are read instead: a value is missing where too few samples are near, and in a gap of the
    /// clock.
    ///
    /// Cost: O(1) for each new value; with a filter 36 multiply-adds for each recorded one.
    ///
    /// # Errors
    /// As for [`Log::with_time`], but for uniformity; [`Error::Argument`] for a step that is not positive or
    /// gives more than 10^8 rows, or a single one.
    ///
    /// ```
    /// use thetahat::data::{Channel, Interpolation, Log, Resample};
    ///
    /// // A slow sine, and a fast one that looks slow every 10 ms: 99 Hz would become 1 Hz.
    /// let time: Vec<f64> = (0..2000).map(|k| f64::from(k) * 1e-3).collect();
    /// let sine = |t: f64, hertz: f64| (std::f64::consts::TAU * hertz * t).sin();
    /// let y = time.iter().map(|&t| sine(t, 3.0) + sine(t, 99.0)).collect();
    /// let how = Resample::new(0.01, Interpolation::Hold);
    /// let log = Log::resampled(vec![Channel { name: "y".into(), values: y }], &time, &how)?;
    /// for (&t, &y) in log.time().into_iter().flatten().zip(&log.channels()[0].values).skip(20).take(160) {
    ///     assert!((y - sine(t, 3.0)).abs() < 2e-3);
    /// }
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn resampled(channels: Vec<Channel>, time: &[f64], how: &Resample) -> Result<Self, Error> {
        let rows = check(&channels)?;
        median_step(time, rows)?;
        let (Some(first), Some(last)) = (time.first(), time.last()) else {
            return Err(Error::data("the log has no rows"));
        };
        let grid = Grid::new(*first, *last, how.step, rows)?;
        let channels = grid.read(channels, time, how)?;
        Ok(Self::on_clock(channels, grid.instants, how.step))
    }
}

/// The instants of a uniform clock at which logs are read.
struct Grid {
    instants: Vec<f64>,
    /// Samples on the grid are not missed by rounding: of decimal steps, and of large times (seconds since 1970 have
    /// seven decimals).
    rounding: f64,
}

impl Grid {
    /// Every `step` seconds, of a log with so many rows.
    fn new(first: f64, last: f64, step: f64, rows: usize) -> Result<Self, Error> {
        if !(step.is_finite() && step > 0.0) {
            return Err(Error::argument("resample", format!("{step} is not a positive number of seconds")));
        }
        let rounding = 5e-7 * step + 2.0 * f64::EPSILON * first.abs().max(last.abs());
        let count = ((last - first + rounding) / step).floor() + 1.0;
        if count > MOST_ROWS {
            return Err(Error::argument(
                "resample",
                format!("a step of {step} s would give {} rows; take a longer one", short(count)),
            ));
        }
        if count < 2.0 && rows > 1 {
            let whole = short(last - first);
            let message =
                format!("a step of {step} s leaves one row of a log of {whole} s; take a shorter one");
            return Err(Error::argument("resample", message));
        }
        Ok(Self { instants: (0..count as usize).map(|k| first + k as f64 * step).collect(), rounding })
    }

    /// The values of channels at these instants, of which the first is not before the first of their times.
    fn read(&self, channels: Vec<Channel>, time: &[f64], how: &Resample) -> Result<Vec<Channel>, Error> {
        let Self { instants, rounding } = self;
        let rows = check(&channels)?;
        let recorded = median_step(time, rows)?;
        let interpolation = how.interpolation;
        // The last sample at or before each instant.
        let places: Vec<usize> = instants
            .iter()
            .scan(0, |left, &instant| {
                while time.get(*left + 1).is_some_and(|&next| next <= instant + rounding) {
                    *left += 1;
                }
                Some(*left)
            })
            .collect();
        let read = || instants.iter().copied().zip(places.iter().copied());
        let filter = how.filter_for(time)?;
        let weights = filter.map(|filter| filter.weights(recorded, rows));
        let filtered = weights.as_ref().map(|weights| Filtered::new(&channels, time, recorded, weights));
        let gap = match interpolation {
            Interpolation::Auto => gap_above(time, recorded),
            Interpolation::Hold | Interpolation::Linear => f64::INFINITY,
        };
        let in_gap = |instant: f64, left: usize| {
            instant - time[left] > *rounding && time.get(left + 1).is_some_and(|next| next - time[left] > gap)
        };
        let values = |channel: &Channel| -> Vec<f64> {
            let own = &channel.values;
            let interpolation = interpolation.of(own);
            let Some(filtered) = &filtered else {
                let value = |(instant, left)| match in_gap(instant, left) {
                    true => f64::NAN,
                    false => interpolation.read(time, own, left, instant),
                };
                return read().map(value).collect();
            };
            let value = |(instant, left): (f64, usize)| {
                let late = instant - time[left] > *rounding;
                if late && instant - time[left] > GAP * recorded {
                    return f64::NAN;
                }
                let value = filtered.at(own, left);
                if interpolation == Interpolation::Hold || !late || left + 1 >= filtered.segment(left).end {
                    return value;
                }
                let fraction = (instant - time[left]) / (time[left + 1] - time[left]);
                value + fraction * (filtered.at(own, left + 1) - value)
            };
            read().map(value).collect()
        };
        let values: Vec<Vec<f64>> = channels.par_iter().map(values).collect();
        let channels = channels.into_iter().zip(values);
        Ok(channels.map(|(channel, values)| Channel { name: channel.name, values }).collect())
    }
}

#[cfg(test)]
mod tests;
