//! The ratio of the transforms.

use std::f64::consts::TAU;

use thetahat_numerics::fourier::PairTransform;

use super::estimate::{Bands, EMPTY, Empty, Estimate, Line, LineEstimate};
use super::plan::Method;
use super::signals::Signals;
use crate::Error;

/// The empirical transfer function estimate (Ljung 1999, section 6.3), at the lines of the longest segment:
///
/// ```text
/// G(2 pi k/N) = Y_k/U_k,   0 < k < N/2
/// ```
///
/// Its variance does not fall with N and is not known. O(N log N).
///
/// # Errors
/// [`Error::Data`] for fewer than three rows in a segment.
pub(super) fn etfe(signals: &Signals, band: (f64, f64)) -> Result<Estimate, Error> {
    let length = signals.longest();
    let segment = signals.segments.iter().find(|segment| segment.len() == length);
    let Some(segment) = segment.filter(|segment| segment.len() > 2) else {
        return Err(Error::data(format!(
            "the longest segment without a gap has {length} rows; etfe needs 3 at least"
        )));
    };
    let [u, y] = [0, 1].map(|channel| &signals.channels[channel][segment.clone()]);
    let mut transform = PairTransform::new(length);
    let found = transform.of(u.iter().copied().zip(y.iter().copied()));
    let lines = 1..length.div_ceil(2);
    let largest = lines.clone().map(|k| found.at(k).0.norm_sqr()).fold(0.0, f64::max);
    let line = |k: usize| {
        let (u, y) = found.at(k);
        let ratio = LineEstimate {
            first: 0,
            responses: vec![y / u],
            variances: None,
            degrees: 0,
            noise: None,
            coherence: None,
        };
        let found = if u.norm_sqr() > EMPTY * largest { Ok(ratio) } else { Err(Empty::Input(0)) };
        Line { angle: TAU * k as f64 / length as f64, found }
    };
    let lines = lines.map(line).filter(|line| (band.0..=band.1).contains(&line.angle)).collect();
    let words = match signals.segments.len() {
        1 => Vec::new(),
        segments => vec![format!(
            "etfe uses the longest of {segments} segments only, {length} of {} rows; welch, spa and lpm use all of them",
            signals.samples()
        )],
    };
    let bands = Bands::None("one line of a transform has no spread to tell");
    Ok(Estimate { method: Method::Etfe, lines, bands, words })
}
