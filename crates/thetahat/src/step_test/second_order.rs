//! A response that overshoots.

use std::f64::consts::{PI, TAU};

use super::document::{StepFigure, StepMethod};
use super::first_order::dead_time;
use super::influence::{Influence, Local};
use super::response::Response;

/// Half of the rows of a parabola over a peak, as a fraction of the time from half of the change to the first peak:
/// about a quarter of the half period.
const OVER: f64 = 0.4;
/// A peak is one if it is this many standard errors from the final steady state, and this fraction of the change.
const ABOVE: f64 = 4.0;
const LEAST: f64 = 0.005;
/// The second peak lies in this part of a period around where it should.
const BESIDE: f64 = 0.3;
/// Halvings of the interval in which a root is.
const HALVINGS: usize = 50;

/// A peak: how far it is above the final steady state, and when.
#[derive(Debug)]
pub(super) struct Peak {
    pub(super) above: Influence,
    pub(super) time: Influence,
    /// Half of the rows it was taken from, in seconds.
    half: f64,
}

/// The first peak, if the response overshoots.
pub(super) fn first_peak(response: &Response<'_>) -> Option<Peak> {
    let (middle, rows) = response.half_time()?;
    let begins = response.time.partition_point(|t| *t < middle);
    highest(response, rows / 4, begins, response.time.len(), |at| OVER * (at - middle))
}

/// The highest of the means over 2 k + 1 rows within some rows, by a parabola over the rows around it.
fn highest(
    response: &Response<'_>,
    k: usize,
    first: usize,
    end: usize,
    half: impl Fn(f64) -> f64,
) -> Option<Peak> {
    let smoothed = response.smoothed(k);
    let rows = first..end.min(smoothed.len());
    let row = rows.max_by(|a, b| smoothed[*a].total_cmp(&smoothed[*b]))?;
    let rough = response.time[row];
    let step = rough / row.max(1) as f64;
    let half = half(rough).max(2.5 * step);
    let local = Local::fit(response.time, &response.values, rough, half)?;
    let [a, b, c] = local.coefficients;
    let x = -b / (2.0 * c);
    if !(c < 0.0 && x.abs() <= 1.0) {
        return None;
    }
    let above = local.figure(a + b * x + c * x * x - 1.0, [1.0, x, x * x]);
    let time = local.figure(rough + half * x, [0.0, -half / (2.0 * c), half * b / (2.0 * c * c)]);
    (above.value > (ABOVE * response.spread(&above)).max(LEAST)).then_some(Peak { above, time, half })
}

/// Damping and frequency of a second order 1/(1 + 2 zeta s/omega + s^2/omega^2) with a dead time. With OS the
/// overshoot, t_p the time of the first peak, T the time from it to the second one and d = ln(OS_1/OS_2):
///
/// ```text
/// zeta = -ln OS/sqrt(pi^2 + ln^2 OS)    or   d/sqrt(4 pi^2 + d^2)
/// omega = pi/((t_p - theta) sqrt(1 - zeta^2))   or   2 pi/(T sqrt(1 - zeta^2))
/// ```
///
/// (Ogata, Modern Control Engineering, 5th ed. 2010, section 5.3.) The dead time follows from where half of the change
/// is reached: at the fraction r(zeta) of the time from theta to t_p.
pub(super) fn second_order(
    response: &Response<'_>,
    peak: &Peak,
    half: &Influence,
) -> Vec<(StepFigure, StepMethod, Influence)> {
    use StepFigure::{Damping, DeadTime, NaturalFrequency, Overshoot, PeakTime, Period};
    let overshoot = peak.above.value;
    let log = overshoot.ln();
    let length = (PI * PI + log * log).sqrt();
    let damping = peak.above.mapped(-log / length, -PI * PI / (overshoot * length.powi(3)));
    let r = half_time(damping.value);
    let begins_of = |time: &Influence| Influence::combined(1.0 / (1.0 - r), half, -r / (1.0 - r), time);
    // The peak is steeper before than after: by its third derivative the parabola over half to either side is late by a
    // omega_d half^2/5, with a = zeta/sqrt(1 - zeta^2).
    let skew = damping.value / (1.0 - damping.value * damping.value).sqrt();
    let angular = PI / (peak.time.value - begins_of(&peak.time).value.max(0.0));
    let late = skew * angular * peak.half * peak.half / 5.0;
    let time = Influence { value: peak.time.value - late, ..peak.time.clone() };
    let [begins, reported] = dead_time(response, begins_of(&time));
    let from_start = Influence::combined(1.0, &time, -1.0, &begins);
    let mut figures = vec![
        (Overshoot, StepMethod::Peak, peak.above.clone()),
        (PeakTime, StepMethod::Peak, time),
        (DeadTime, StepMethod::TwoPoints, reported),
        (Damping, StepMethod::Peak, damping.clone()),
        (NaturalFrequency, StepMethod::Peak, frequency(PI, &from_start, &damping)),
    ];
    // A period is twice the time to the peak.
    let about = 2.0 * from_start.value;
    let row = |part: f64| response.time.partition_point(|t| *t < peak.time.value + part * about);
    let k = row(0.05).saturating_sub(row(0.0)) / 2;
    let second = highest(response, k, row(1.0 - BESIDE), row(1.0 + BESIDE), |_| peak.half);
    if let Some(second) = second.filter(|second| second.above.value < overshoot) {
        let period = Influence::combined(1.0, &second.time, -1.0, &peak.time);
        let decrement =
            Influence::combined(1.0 / overshoot, &peak.above, -1.0 / second.above.value, &second.above);
        let d = (overshoot / second.above.value).ln();
        let length = (TAU * TAU + d * d).sqrt();
        let damping = decrement.mapped(d / length, TAU * TAU / length.powi(3));
        let natural = frequency(TAU, &period, &damping);
        figures.extend([
            (Period, StepMethod::TwoPeaks, period),
            (Damping, StepMethod::TwoPeaks, damping),
            (NaturalFrequency, StepMethod::TwoPeaks, natural),
        ]);
    }
    figures
}

/// angle/(time sqrt(1 - zeta^2)).
fn frequency(angle: f64, time: &Influence, damping: &Influence) -> Influence {
    let rest = 1.0 - damping.value * damping.value;
    let value = angle / (time.value * rest.sqrt());
    let moved = Influence::combined(-value / time.value, time, value * damping.value / rest, damping);
    Influence { value, ..moved }
}

/// Where a second order reaches half of its change, as a fraction of the time to its peak: by halving, as it rises all
/// that time.
fn half_time(damping: f64) -> f64 {
    let slope = damping / (1.0 - damping * damping).sqrt();
    let at = |angle: f64| 1.0 - (-slope * angle).exp() * (angle.cos() + slope * angle.sin());
    let (mut low, mut high) = (0.0, PI);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if at(middle) < 0.5 { low = middle } else { high = middle }
    }
    0.5 * (low + high) / PI
}
