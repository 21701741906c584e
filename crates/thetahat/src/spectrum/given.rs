//! Responses whose points were measured elsewhere: by an analyser, or as an impedance.

use std::f64::consts::PI;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::distribution::two_sided;

use super::plan::Method;
use super::response::{BandQuality, MeasuredResponse, NoisePoint};
use crate::data::{Rows, Source};
use crate::document::GENERATOR;
use crate::respond::{FrequencyPoint, FrequencyResponse};
use crate::{Document, Error};

/// A point of a frequency response that was measured elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenPoint {
    /// Radians per second.
    pub frequency: f64,
    /// Real part, in units of the output per unit of the input.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
    /// The standard deviation of the real part, which is that of the imaginary part too; none where it is not known.
    pub standard_deviation: Option<f64>,
}

impl MeasuredResponse {
    /// The response of points that were measured elsewhere, in any order. `held` is for how many seconds the input was
    /// held; none where it was a sine in continuous time, as an analyser or an impedance meter makes it. O(N ln N).
    ///
    /// # Errors
    /// [`Error::Argument`] without a point above frequency 0, and for a point, counted from one, that is not finite,
    /// has a frequency below 0 or, of an input that is held, above pi/`held`, or has a standard deviation that is not
    /// above 0 or that others do not have; for a time that is not above 0; for two channels of one name.
    ///
    /// ```
    /// use thetahat::spectrum::{GivenPoint, MeasuredResponse};
    ///
    /// // The impedance of 2 ohm in series with 10 ohm beside 1 F.
    /// let point = |frequency: f64| {
    ///     let below = 1.0 + (10.0 * frequency).powi(2);
    ///     GivenPoint { frequency, re: 2.0 + 10.0 / below, im: -100.0 * frequency / below, standard_deviation: Some(0.01) }
    /// };
    /// let points: Vec<GivenPoint> = (-6..4).map(|power| point(2.0_f64.powi(power))).collect();
    /// let response = MeasuredResponse::given("current", "voltage", &points, None)?;
    /// assert!(response.continuous && response.responses[0].points.len() == 10);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn given(input: &str, output: &str, points: &[GivenPoint], held: Option<f64>) -> Result<Self, Error> {
        if input == output {
            return Err(Error::argument("output", format!("'{input}' is the input already; name another")));
        }
        if let Some(time) = held.filter(|time| !(*time > 0.0 && time.is_finite())) {
            return Err(Error::argument(
                "held",
                format!("{time} s is no time that an input is held; give one above 0"),
            ));
        }
        let known = points.first().is_some_and(|point| point.standard_deviation.is_some());
        for (place, point) in points.iter().enumerate() {
            let wrong = |what: String| Err(Error::argument("points", format!("point {}: {what}", place + 1)));
            let GivenPoint { frequency, re, im, standard_deviation } = *point;
            if !(frequency >= 0.0 && frequency.is_finite()) {
                return wrong(format!("a frequency of {frequency} rad/s is not 0 or more and finite"));
            }
            if let Some(time) = held.filter(|time| frequency > PI / time * (1.0 + 1e-9)) {
                return wrong(format!(
                    "{frequency} rad/s is more than an input that is held for {time} s can have, pi/{time} rad/s"
                ));
            }
            if !(re.is_finite() && im.is_finite()) {
                return wrong(format!("{re} + {im}i is not finite; leave it out"));
            }
            if standard_deviation.is_some() != known {
                return wrong("give a standard deviation of all points or of none".to_owned());
            }
            if let Some(deviation) = standard_deviation.filter(|own| !(*own > 0.0 && own.is_finite())) {
                return wrong(format!("a standard deviation of {deviation} is not above 0 and finite"));
            }
        }
        let highest = points.iter().map(|point| point.frequency).fold(0.0, f64::max);
        if highest == 0.0 {
            return Err(Error::argument("points", "there is none above frequency 0; give some"));
        }
        let mut points = points.to_vec();
        points.sort_by(|one, other| one.frequency.total_cmp(&other.frequency));
        let mut phase = 0.0;
        let points = points.iter().map(|point| {
            let covariance = point.standard_deviation.map(|own| [[own * own, 0.0], [0.0, own * own]]);
            let own =
                FrequencyPoint::new(point.frequency, Complex::new(point.re, point.im), covariance, phase);
            phase = if own.phase.value.is_finite() { own.phase.value } else { phase };
            own.with_intervals(two_sided(0.05))
        });
        let points: Vec<FrequencyPoint> = points.collect();
        let noise = |point: &FrequencyPoint| NoisePoint {
            frequency: point.frequency,
            density: None,
            coherence: None,
        };
        let why = if known { "the points came with their errors" } else { "the points came without errors" };
        Ok(Self {
            schema: Self::SCHEMA.to_owned(),
            generator: GENERATOR.to_owned(),
            logs: Vec::new(),
            rows: vec![Rows::new(1, points.len())?],
            sample_time: held.unwrap_or(PI / highest),
            continuous: held.is_none(),
            detrend: "none".to_owned(),
            method: Method::Given,
            output: output.to_owned(),
            noise: points.iter().map(noise).collect(),
            responses: vec![FrequencyResponse { input: Some(input.to_owned()), points }],
            bands: BandQuality { honest: None, outside: None, reason: why.to_owned() },
            warnings: Vec::new(),
        })
    }

    /// The points from one frequency to another, in rad/s, of all inputs.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is none above frequency 0.
    pub fn within(self, low: f64, high: f64) -> Result<Self, Error> {
        let inside = |frequency: f64| frequency >= low && frequency <= high;
        let Self { mut responses, mut noise, .. } = self;
        responses.iter_mut().for_each(|own| own.points.retain(|point| inside(point.frequency)));
        noise.retain(|point| inside(point.frequency));
        if !noise.iter().any(|point| point.frequency > 0.0) {
            let message = format!("the response has no point between {low} and {high} rad/s");
            return Err(Error::argument("frequencies", message));
        }
        Ok(Self { responses, noise, ..self })
    }

    /// The same with the name of the file that it was read from.
    pub fn of_file(self, file: &str) -> Self {
        let rows = self.rows.first().copied();
        let source = |rows| Source { file: file.to_owned(), rows, time: None, start: None, resampled: None };
        Self { logs: rows.map(source).into_iter().collect(), ..self }
    }
}
