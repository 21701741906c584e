//! What fits to measured frequency responses have in common.

use std::f64::consts::PI;

use super::schema::{Data, Estimation, Missing};
use crate::Error;
use crate::data::Offset;
use crate::estimate::{Criteria, Procedure, ResponsePoints};
use crate::figures::short;
use crate::model::Signal;
use crate::respond::{FrequencyPoint, FrequencyResponse};
use crate::spectrum::MeasuredResponse;

/// Mean squares above this, in variances of the points, are worth a warning.
const MISSED: f64 = 2.0;

/// The points that can be fitted to: those with a size.
pub(super) fn fitted(response: &FrequencyResponse) -> impl Iterator<Item = &FrequencyPoint> + Clone {
    response.points.iter().filter(|point| point.magnitude.value > 0.0 && point.magnitude.value.is_finite())
}

/// The variance of a point's real part, which is that of its imaginary part too; none where it is not known.
pub(super) fn variance(point: &FrequencyPoint) -> Option<f64> {
    let [[re, _], [_, im]] = point.covariance?;
    Some((re + im) / 2.0).filter(|variance| *variance > 0.0)
}

/// The responses from inputs of these names, from all if there are none.
///
/// # Errors
/// [`Error::Argument`] for an input that the response does not have.
pub(super) fn from_inputs<'r>(
    response: &'r MeasuredResponse,
    names: &[String],
) -> Result<Vec<&'r FrequencyResponse>, Error> {
    if names.is_empty() {
        return Ok(response.responses.iter().collect());
    }
    let of = |name: &String| {
        response.from_input(name).ok_or_else(|| {
            let there: Vec<&str> = response.responses.iter().filter_map(|own| own.input.as_deref()).collect();
            let message = format!("the response has none called '{name}', but: {}", there.join(", "));
            Error::argument("input", message)
        })
    };
    names.iter().map(of).collect()
}

/// Refuses what was asked for though logs alone have it.
///
/// # Errors
/// [`Error::Argument`] for the first that was given.
pub(super) fn refuse(of_logs: &[(&str, bool)]) -> Result<(), Error> {
    match of_logs.iter().find(|(_, given)| *given) {
        Some((name, _)) => {
            Err(Error::argument(name, "a frequency response has no rows, levels or states; leave it out"))
        }
        None => Ok(()),
    }
}

/// Channels of these names; levels are not in a response.
pub(super) fn signals(names: &[String]) -> Vec<Signal> {
    names.iter().map(|name| Signal { name: name.clone(), offset: Offset::default() }).collect()
}

/// The figures of a fit of so many parameters, whose errors at so many values have this mean square.
pub(super) fn estimation(
    procedure: Procedure,
    (samples, mse): (usize, f64),
    parameters: usize,
    condition: Option<f64>,
) -> Estimation {
    Estimation {
        procedure,
        initial: None,
        level: None,
        slope: None,
        samples,
        mse,
        criteria: Criteria::new(mse, parameters, samples),
        condition,
    }
}

/// The points of the response from an input, and what each is multiplied by.
pub(super) fn points(own: &FrequencyResponse, response: &MeasuredResponse) -> ResponsePoints {
    let known = fitted(own).all(|point| variance(point).is_some());
    let weight = |point: &FrequencyPoint| match variance(point) {
        Some(variance) if known => 1.0 / variance.sqrt(),
        _ => 1.0 / point.magnitude.value,
    };
    ResponsePoints {
        frequencies: fitted(own).map(|point| point.frequency).collect(),
        values: fitted(own).map(|point| [point.re, point.im]).collect(),
        weights: fitted(own).map(weight).collect(),
        known,
        sample_time: response.sample_time,
        held: !response.continuous,
        correlation: response.correlation(),
    }
}

/// The variance of the noise: the mean of its density times the band.
pub(super) fn noise_variance(response: &MeasuredResponse) -> f64 {
    let known: Vec<f64> = response.noise.iter().filter_map(|point| point.density).collect();
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    let variance = mean * PI / response.sample_time;
    if variance.is_finite() { variance } else { 0.0 }
}

/// What a model of these channels was fitted to.
pub(super) fn data(response: &MeasuredResponse, channels: impl Iterator<Item = String>) -> Data {
    let rows = response.logs.last().map(|log| log.rows).or_else(|| response.rows.last().copied());
    Data {
        logs: response.logs.clone(),
        digests: Vec::new(),
        rows: rows.map_or(0, |rows| rows.last()),
        sample_time: response.sample_time,
        detrend: response.detrend.clone(),
        prefilter: None,
        estimation: response.rows.clone(),
        validation: Vec::new(),
        split: None,
        segments: response.rows.clone(),
        missing: channels.map(|channel| Missing { channel, rows: 0 }).collect(),
        time_gaps: 0,
    }
}

/// What a reader should know of the points, and of errors whose mean square is `mse`, in variances of the points if
/// these are known.
pub(super) fn warnings(response: &MeasuredResponse, mse: f64, known: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    if response.bands.honest == Some(false) {
        warnings.push(format!("the bands of the response are not honest: {}", response.bands.reason));
    }
    if known && mse > MISSED {
        warnings.push(format!(
            "the response is missed by {} times the standard deviations of its points: the structure is not the whole truth, or they are \
             too small",
            short((10.0 * mse.sqrt()).round() / 10.0)
        ));
    }
    warnings
}
