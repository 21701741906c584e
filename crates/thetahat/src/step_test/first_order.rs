//! Dead time and time constant of a response without overshoot.

use super::document::{Shape, StepFigure, StepMethod};
use super::influence::{Influence, Local};
use super::response::Response;

/// Where 1 - exp(-x) is 28.3 % and 63.2 %: at x = 1/3 and 1.
const EARLY: f64 = 0.283_468_689_426_210_74;
const LATE: f64 = 0.632_120_558_828_557_7;
/// Rows around the first of them, as a fraction of the time to it from 10 %: up to where the response begins.
const NEAR: f64 = 1.4;
/// Where the tangent at the start is taken over, in time constants.
const TANGENT: f64 = 0.7;
/// Among how many places the inflection is looked for.
const SCANNED: u32 = 80;
/// The transient of averages, in time constants: less at its end where noise is large, as the logarithm needs 1 - s
/// above it.
const BEGINS: f64 = 0.2;
const ENDS: f64 = 3.0;
const ABOVE_NOISE: f64 = 2.5;
/// The transient over which a misfit is taken, in time constants, and from which fraction of the step on a first order
/// does not fit.
const COMPARED: f64 = 4.0;
const MISFIT: f64 = 0.02;
/// A dead time that is not as many standard errors above 0 counts as none, and less than this fraction of a step of the
/// clock is none.
const ABOVE_ZERO: f64 = 2.0;
const RESOLUTION: f64 = 0.05;
/// The weights of an average settle in this many rounds.
const ROUNDS: usize = 4;

/// What was read off.
#[derive(Debug)]
pub(super) struct Read {
    pub(super) shape: Shape,
    pub(super) misfit: f64,
    pub(super) figures: Vec<(StepFigure, StepMethod, Influence)>,
}

/// Levels that are reached.
#[derive(Debug)]
pub(super) struct Crossings {
    /// About the time from 10 % to 90 %.
    pub(super) scale: f64,
    /// The same from parabolas, where noise lets both levels be seen.
    pub(super) rise: Option<Influence>,
    pub(super) early: Influence,
    pub(super) late: Influence,
}

/// Where 10 %, 28.3 %, 63.2 % and 90 % are reached before `end`.
pub(super) fn crossings(response: &Response<'_>, end: f64) -> Option<Crossings> {
    let rough = |level| response.time_below(level, end);
    let (first, second, last) = (rough(0.1), rough(EARLY), rough(0.9));
    let scale = last - first;
    let at = |level, most| response.crossing(level, end, scale, most);
    // Not beyond where the response begins, nor beyond where it has passed.
    let early = NEAR * (second - first);
    let low = at(0.1, 0.5 * (second - first));
    let high = at(0.9, scale.min(end - last));
    Some(Crossings {
        scale,
        rise: low.zip(high).map(|(low, high)| Influence::combined(1.0, &high, -1.0, &low)),
        early: at(EARLY, early)?,
        late: at(LATE, scale.min(end - rough(LATE)))?,
    })
}

/// A dead time as other figures take it: none where it cannot be told from that; and as it is reported, with its
/// spread.
pub(super) fn dead_time(response: &Response<'_>, found: Influence) -> [Influence; 2] {
    let resolution = response.time.get(1).map_or(0.0, |step| RESOLUTION * step);
    if found.value > (ABOVE_ZERO * response.spread(&found)).max(resolution) {
        return [found.clone(), found];
    }
    [Influence::known(0.0, response.time.len()), Influence { value: 0.0, ..found }]
}

/// Dead time and time constants. With x = (t - theta)/tau:
///
/// ```text
/// two points   tau = 1.5 (t_63.2 - t_28.3), theta = 1.5 t_28.3 - 0.5 t_63.2   (Smith 1972)
/// level        tau = t_63.2 - theta
/// tangent      tau = 1/max ds/dt
/// t-bar        tau_i = (t_i - theta)/(-ln(1 - s_i)),   var tau_i ~ exp(2 x)/x^2
/// ```
///
/// None if it does not rise as such a response does. O(N).
pub(super) fn first_order(response: &Response<'_>, crossings: &Crossings) -> Option<Read> {
    let Crossings { early, late, .. } = crossings;
    let two_points = Influence::combined(1.5, late, -1.5, early);
    let [begins, reported] = dead_time(response, Influence::combined(1.5, early, -0.5, late));
    let level = Influence::combined(1.0, late, -1.0, &begins);
    if !(level.value > 0.0 && two_points.value > 0.0) {
        return None;
    }
    let weighted = average(response, &begins, &level, true)?;
    let plain = average(response, &begins, &level, false)?;
    let misfit = misfit(response, begins.value, weighted.value);
    let shape = if misfit > MISFIT { Shape::Overdamped } else { Shape::FirstOrder };
    use StepFigure::{DeadTime, TimeConstant};
    let mut figures = vec![(DeadTime, StepMethod::TwoPoints, reported)];
    if let Some((start, slope)) = tangent(response, begins.value, level.value, shape) {
        figures.push((DeadTime, StepMethod::Tangent, start));
        figures.push((TimeConstant, StepMethod::Tangent, slope));
    }
    figures.extend([
        (TimeConstant, StepMethod::Level, level),
        (TimeConstant, StepMethod::TwoPoints, two_points),
        (TimeConstant, StepMethod::PlainAverage, plain),
        (TimeConstant, StepMethod::WeightedAverage, weighted),
    ]);
    Some(Read { shape, misfit, figures })
}

/// The mean of tau_i over the transient, each weighted by the inverse of its variance or not.
fn average(
    response: &Response<'_>,
    begins: &Influence,
    scale: &Influence,
    weighted: bool,
) -> Option<Influence> {
    let (theta, window) = (begins.value, scale.value);
    let ends = ENDS.min(-(ABOVE_NOISE * response.deviation()).ln()).max(1.0);
    let rows = || {
        let rows = response.time.iter().zip(&response.values).enumerate();
        rows.map(|(row, (t, s))| (row, t - theta, *s))
            .filter(|(_, t, s)| (BEGINS * window..=ends * window).contains(t) && *s > 0.0 && *s < 1.0)
    };
    let mut tau = window;
    for _ in 0..ROUNDS {
        let (mut sum, mut whole) = (0.0, 0.0);
        for (_, t, s) in rows() {
            let weight = if weighted { (t / tau).powi(2) * (-2.0 * t / tau).exp() } else { 1.0 };
            sum += weight * t / -(1.0 - s).ln();
            whole += weight;
        }
        tau = sum / whole;
        if !(tau.is_finite() && tau > 0.0) {
            return None;
        }
    }
    let mut figure = Influence::known(tau, response.time.len());
    let (mut whole, mut by_theta) = (0.0, 0.0);
    for (row, t, _) in rows() {
        // At the response of the average: at that of the noise the derivatives would be biased.
        let x = t / tau;
        let weight = if weighted { x * x * (-2.0 * x).exp() } else { 1.0 };
        figure.weights[row] = -weight * tau * x.exp() / x;
        by_theta -= weight / x;
        whole += weight;
    }
    figure.weights.iter_mut().for_each(|weight| *weight /= whole);
    let moved = Influence::combined(1.0, &figure, by_theta / whole, begins);
    Some(Influence { value: tau, ..moved })
}

/// The root mean square by which the response leaves a first order, that of the noise taken off.
fn misfit(response: &Response<'_>, theta: f64, tau: f64) -> f64 {
    let rows = response.time.iter().zip(&response.values).take_while(|(t, _)| **t <= theta + COMPARED * tau);
    let (mut square, mut count) = (0.0, 0);
    for (t, s) in rows {
        square += (s - (1.0 - (-(t - theta).max(0.0) / tau).exp())).powi(2);
        count += 1;
    }
    let noise = response.deviation().powi(2);
    let rows = f64::from(count.max(1));
    // The mean square of noise is larger by so much one time in forty.
    let chance = noise * (1.0 + 2.0 * (2.0 * response.noise.correlation().max(1.0) / rows).sqrt());
    (square / rows - chance).max(0.0).sqrt()
}

/// Where the tangent of the largest slope leaves 0, and the time that it takes from there to 1. A first order has its
/// largest slope at the start, an S at its inflection.
fn tangent(response: &Response<'_>, theta: f64, tau: f64, shape: Shape) -> Option<(Influence, Influence)> {
    let half = 0.5 * TANGENT * tau;
    let at = |centre: f64| Local::fit(response.time, &response.values, centre, half);
    let (centre, x) = match shape {
        Shape::FirstOrder => (theta + half, -1.0),
        Shape::Overdamped | Shape::Underdamped => {
            let centres = (0..SCANNED).map(|k| f64::from(k) / f64::from(SCANNED) * 2.0 * (theta + tau));
            let slopes = centres.filter_map(|centre| Some((centre, at(centre)?.coefficients[1])));
            (slopes.max_by(|(_, a), (_, b)| a.total_cmp(b))?.0, 0.0)
        }
    };
    let local = at(centre)?;
    let [a, b, c] = local.coefficients;
    let slope = (b + 2.0 * c * x) / half;
    if slope.is_nan() || slope <= 0.0 {
        return None;
    }
    let value = a + b * x + c * x * x;
    let constant = local.figure(1.0 / slope, [0.0, -1.0, -2.0 * x].map(|by| by / (half * slope * slope)));
    let start = local.figure(
        centre + half * x - value / slope,
        [
            -1.0 / slope,
            -x / slope + value / (half * slope * slope),
            -x * x / slope + 2.0 * x * value / (half * slope * slope),
        ],
    );
    Some((start, constant))
}
