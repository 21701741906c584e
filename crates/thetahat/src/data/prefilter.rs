//! A band of frequencies in which errors count.
//!
//! Inputs and output go through the same causal filter L(q) before the fit, so that y = G u + v becomes L y = G (L u) +
//! L v: the model still describes the signals as they are, and the fit makes the sum of the squares of L e small
//! (Ljung, System Identification, 2nd ed. 1999, section 14.4). It weighs the errors in the frequency domain by |L|^2.
//!
//! L is a Butterworth filter (Butterworth 1930) of order n = 4 at each end of the band: with the poles
//!
//! ```text
//! p_k = exp(i pi (2 k + n + 1)/(2 n)),   k = 0 … n - 1
//! low-pass   s = w_h p            high-pass   s = w_l/p
//! band-pass  s = (p B +- sqrt(p^2 B^2 - 4 w_l w_h))/2,   B = w_h - w_l
//! ```
//!
//! taken to discrete time by the bilinear transformation z = (1 + s T/2)/(1 - s T/2) with the ends where they belong,
//! w = (2/T) tan(pi f T) (Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed. 2010, section 7.2), in
//! sections of second order. At the ends of the band the gain is 1/sqrt(2).

use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, ComplexField};

use super::{Log, Record, Rows};
use crate::Error;

/// n.
const ORDER: usize = 4;
/// What is left of the slowest mode of L where its transient counts as over.
const LEFT: f64 = 0.01;
/// Of a segment no larger part than this is left out for it.
const LARGEST_PART: f64 = 0.25;

/// The band of frequencies in Hz in which errors count; either end may be open.
///
/// ```
/// use thetahat::data::Prefilter;
///
/// let band: Prefilter = "0.1..5".parse()?;
/// assert_eq!((band.low, band.high), (Some(0.1), Some(5.0)));
/// assert!("5..0.1".parse::<Prefilter>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Prefilter {
    /// Lower frequencies are weakened; none: they are not.
    pub low: Option<f64>,
    /// Higher frequencies are weakened; none: they are not.
    pub high: Option<f64>,
}

impl FromStr for Prefilter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = || {
            let shown: String = text.chars().take(40).collect();
            Error::argument(
                "prefilter",
                format!(
                    "'{shown}' is no band; write LOW..HIGH in Hz, one end of which may be left out, such as 0.1..5 or ..5"
                ),
            )
        };
        let end = |text: &str| match text.trim() {
            "" => Ok(None),
            text => text.parse().ok().filter(|f: &f64| f.is_finite() && *f > 0.0).map(Some).ok_or_else(wrong),
        };
        let (low, high) = text.split_once("..").ok_or_else(wrong)?;
        let band = Self { low: end(low)?, high: end(high)? };
        let ordered = band.low.zip(band.high).is_none_or(|(low, high)| low < high);
        if ordered && (band.low.is_some() || band.high.is_some()) { Ok(band) } else { Err(wrong()) }
    }
}

impl fmt::Display for Prefilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |end: Option<f64>| end.map_or_else(String::new, |end| end.to_string());
        write!(f, "{}..{}", end(self.low), end(self.high))
    }
}

/// L for a sample time.
struct Filter {
    sections: Vec<Biquad>,
    /// How many samples its transient lasts.
    settling: usize,
}

/// (b0 + b1 q^-1 + b2 q^-2)/(1 + a1 q^-1 + a2 q^-2).
#[derive(Debug, Clone, Copy)]
struct Biquad {
    b: [f64; 3],
    a: [f64; 2],
}

impl Biquad {
    /// The gain at z on the unit circle.
    fn gain(&self, z: Complex<f64>) -> f64 {
        let turn = z.conj();
        let above = turn * (turn * self.b[2] + self.b[1]) + self.b[0];
        let below = turn * (turn * self.a[1] + self.a[0]) + 1.0;
        above.modulus() / below.modulus()
    }

    /// Filters in place, as if the first value had been there forever before.
    fn apply(&self, values: &mut [f64]) {
        let Self { b: [b0, b1, b2], a: [a1, a2] } = *self;
        let first = values.first().copied().unwrap_or(0.0);
        let settled = first * (b0 + b1 + b2) / (1.0 + a1 + a2);
        let mut states = [settled - b0 * first, b2 * first - a2 * settled];
        for value in values {
            let x = *value;
            let y = b0 * x + states[0];
            states = [b1 * x - a1 * y + states[1], b2 * x - a2 * y];
            *value = y;
        }
    }
}

impl Prefilter {
    /// The filter for a sample time in seconds.
    ///
    /// # Errors
    /// [`Error::Argument`] for an end that is not below half the sampling frequency.
    fn filter(&self, sample_time: f64) -> Result<Filter, Error> {
        let nyquist = 0.5 / sample_time;
        if let Some(end) = [self.low, self.high].into_iter().flatten().find(|end| *end >= nyquist) {
            return Err(Error::argument(
                "prefilter",
                format!(
                    "{end} Hz is not below {nyquist} Hz, half the sampling frequency; lower it, or leave it open"
                ),
            ));
        }
        let warped = |f: f64| 2.0 / sample_time * (PI * f * sample_time).tan();
        // One of each pair of conjugates.
        let prototype = (0..ORDER / 2).map(|k| {
            let (sine, cosine) = (PI * (2 * k + ORDER + 1) as f64 / (2 * ORDER) as f64).sin_cos();
            Complex::new(cosine, sine)
        });
        let one = Complex::new(1.0, 0.0);
        // The poles, the zeros as a numerator, and where the gain is 1.
        let (poles, b, at): (Vec<Complex<f64>>, [f64; 3], f64) = match (self.low, self.high) {
            (None, None) => (Vec::new(), [1.0, 0.0, 0.0], 0.0),
            (None, Some(high)) => (prototype.map(|p| p * warped(high)).collect(), [1.0, 2.0, 1.0], 0.0),
            (Some(low), None) => (prototype.map(|p| one / p * warped(low)).collect(), [1.0, -2.0, 1.0], PI),
            (Some(low), Some(high)) => {
                let (low, high) = (warped(low), warped(high));
                let poles = prototype.flat_map(|p| {
                    let half = p * (high - low) / 2.0;
                    let root = (half * half - low * high).sqrt();
                    [half + root, half - root]
                });
                let centre = 2.0 * ((low * high).sqrt() * sample_time / 2.0).atan();
                (poles.collect(), [1.0, 0.0, -1.0], centre)
            }
        };
        let reference = Complex::new(at.cos(), at.sin());
        let mut slowest = 0.0_f64;
        let sections = poles.into_iter().map(|s| {
            let half = s * (sample_time / 2.0);
            let z = (one + half) / (one - half);
            slowest = slowest.max(z.modulus());
            let mut section = Biquad { b, a: [-2.0 * z.re, z.modulus_squared()] };
            let gain = section.gain(reference);
            section.b.iter_mut().for_each(|b| *b /= gain);
            section
        });
        let sections = sections.collect();
        let settling = (LEFT.ln() / slowest.ln()).ceil().max(0.0);
        // A conversion that saturates.
        Ok(Filter { sections, settling: settling as usize })
    }
}

/// The signals of a log in a band.
pub(crate) struct Prefiltered {
    log: Log,
    inputs: Vec<String>,
    output: String,
    settling: usize,
}

impl Prefiltered {
    /// Filters the inputs and the output of a log alike, from the first row on of each segment in which all of them
    /// have a value and the clock has no gap, as if its values had been there forever before.
    ///
    /// # Errors
    /// [`Error::Argument`] for an end of the band that is not below half the sampling frequency; [`Error::Data`] for a
    /// channel that is not there.
    pub(crate) fn new(band: &Prefilter, log: &Log, inputs: &[String], output: &str) -> Result<Self, Error> {
        let Filter { sections, settling } = band.filter(log.sample_time())?;
        let names: Vec<&str> = inputs.iter().map(String::as_str).chain([output]).collect();
        let all = Rows::new(1, log.rows())?;
        let segments = log.segments(&names, &[all])?;
        let filtered = log.part(&names, all)?.changed(|values| {
            for segment in &segments {
                let own = &mut values[segment.clone()];
                sections.iter().for_each(|section| section.apply(own));
            }
        });
        Ok(Self { log: filtered, inputs: inputs.to_vec(), output: output.to_owned(), settling })
    }

    /// The signals over some rows, without the beginning of each segment: the rows in which more than 1 % of the
    /// slowest mode of the filter is there, but not more than a quarter of the segment.
    ///
    /// # Errors
    /// As for [`Log::record`].
    pub(crate) fn record(&self, rows: &[Rows]) -> Result<Record<'_>, Error> {
        let mut record = self.log.record(&self.inputs, &self.output, rows)?;
        let (mut segments, mut past) = (Vec::new(), Vec::new());
        for (segment, before) in record.segments.iter().zip(&record.past) {
            let first = segment.start - before;
            let start = segment.start.max(first + self.settling.min(longest(first, segment.end)));
            if start < segment.end {
                segments.push(start..segment.end);
                past.push(start - first);
            }
        }
        (record.segments, record.past) = (segments, past);
        Ok(record)
    }

    /// The same without what stands before its segments.
    ///
    /// # Errors
    /// As for [`Log::record`].
    pub(crate) fn record_alone(&self, rows: &[Rows]) -> Result<Record<'_>, Error> {
        let record = self.record(rows)?;
        Ok(Record { past: vec![0; record.segments.len()], ..record })
    }

    /// A warning where the transient of the filter is longer than what is left out for it, in some of these rows.
    ///
    /// # Errors
    /// As for [`Log::record`].
    pub(crate) fn warning(&self, rows: &[Rows]) -> Result<Option<String>, Error> {
        let record = self.log.record(&self.inputs, &self.output, rows)?;
        let mut segments = record.segments.iter().zip(&record.past);
        let short =
            segments.any(|(segment, before)| self.settling > longest(segment.start - before, segment.end));
        Ok(short.then(|| {
            format!(
                "the prefilter settles in {} rows, and not more than a quarter of a segment is left out for that: it is \
                 still settling in some of the rows; raise the lower end of the band, or leave it open",
                self.settling
            )
        }))
    }
}

/// At most this many samples of a segment are left out.
fn longest(first: usize, end: usize) -> usize {
    (LARGEST_PART * (end - first) as f64) as usize
}

#[cfg(test)]
mod tests;
