//! What fits to measured frequency responses have in common.

use super::schema::{Data, Missing};
use crate::figures::short;
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

/// What a reader should know of the points, and of errors whose mean square in variances of the points is `mse`.
pub(super) fn warnings(response: &MeasuredResponse, mse: f64) -> Vec<String> {
    let mut warnings = Vec::new();
    if response.bands.honest == Some(false) {
        warnings.push(format!("the bands of the response are not honest: {}", response.bands.reason));
    }
    if mse > MISSED {
        warnings.push(format!(
            "the response is missed by {} times the standard deviations of its points: the structure is not the whole truth, or they are \
             too small",
            short((10.0 * mse.sqrt()).round() / 10.0)
        ));
    }
    warnings
}
