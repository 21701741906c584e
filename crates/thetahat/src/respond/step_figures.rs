//! What a response to a step looks like.

/// The settled band, of the end.
const BAND: f64 = 0.02;

/// Figures of the response to a step, in the unit of time of its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepFigures {
    /// From 10 % to 90 % of the end; none where it does not get there.
    pub(crate) rise_time: Option<f64>,
    /// The part of the end by which it goes beyond it.
    pub(crate) overshoot: f64,
    /// After which it stays within 2 % of the end; none where it does not.
    pub(crate) settling_time: Option<f64>,
}

impl StepFigures {
    /// Of samples that are so far apart, and where they end, which is not 0.
    pub(crate) fn of(response: &[f64], end: f64, apart: f64) -> Self {
        let part = |value: &f64| value / end;
        let first =
            |level: f64| response.iter().position(|value| part(value) >= level).map(|at| at as f64 * apart);
        let outside = response.iter().rposition(|value| (part(value) - 1.0).abs() > BAND);
        let settled = outside.map_or(0, |last| last + 1);
        Self {
            rise_time: first(0.1).zip(first(0.9)).map(|(early, late)| late - early),
            overshoot: response.iter().map(part).fold(1.0, f64::max) - 1.0,
            settling_time: (settled < response.len()).then_some(settled as f64 * apart),
        }
    }
}
