//! What a loop does.
//!
//! The process moves exactly between the steps of a fine clock of which the dead time is a whole number; the controller
//! acts at each. The derivative acts on the measured output, filtered by 1/(1 + Td s/10).

use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI};

use thetahat_core::nalgebra::{Complex, DMatrix};

use super::document::ClosedLoop;
use super::lags::{Lags, lags};
use crate::model::ProcessStructure;
use crate::respond::StepFigures;

/// The filter of the derivative is so many times faster than Td.
const FILTER: f64 = 10.0;
/// Steps of the clock in each of the times that matter, and at most.
const FINE: f64 = 50.0;
const MOST_STEPS: f64 = 200_000.0;
/// Points that are kept of a response.
const KEPT: usize = 500;
/// Frequencies of the sensitivity.
const FREQUENCIES: usize = 4000;
/// The two-sided 95 % quantile of the normal distribution.
const QUANTILE: f64 = 1.959964;

/// The loop of a process with these parameters, of this covariance, and a controller Kc, Ti, Td.
pub(super) fn closed_loop(
    (structure, values): (&ProcessStructure, &[f64]),
    spread: Option<&[Vec<f64>]>,
    controller: [f64; 3],
    closed_loop_time: f64,
) -> ClosedLoop {
    let process = lags(structure, values);
    let margins = Margins::of(&process, controller);
    let worst = spread.map(|spread| {
        directions(values, spread)
            .into_iter()
            .map(|moved| Margins::of(&lags(structure, &moved), controller))
            .fold(margins.peak, |worst, own| if own.stable() { worst.max(own.peak) } else { f64::INFINITY })
    });
    let setpoint = Simulation::of(structure, values, controller, closed_loop_time, true);
    let load = Simulation::of(structure, values, controller, closed_loop_time, false);
    let output = &setpoint.output;
    let step = setpoint.step;
    let stable = margins.stable() && output.iter().all(|value| value.is_finite());
    let figures = StepFigures::of(output, 1.0, step);
    let absolute: f64 = load.output.iter().map(|value| value.abs() * step).sum();
    let apart = output.len().div_ceil(KEPT).max(1);
    let kept = |values: &[f64]| -> Vec<f64> { values.iter().copied().step_by(apart).collect() };
    ClosedLoop {
        stable,
        rise_time: figures.rise_time,
        overshoot: stable.then_some(figures.overshoot),
        settling_time: figures.settling_time.filter(|_| stable),
        peak_sensitivity: margins.peak,
        gain_margin: margins.gain,
        phase_margin: margins.phase.map(f64::to_degrees),
        load_absolute_error: stable.then_some(absolute),
        // A document has no infinity: what may be unstable has no number.
        worst_peak_sensitivity: worst.filter(|worst| worst.is_finite()),
        time: (0..output.len()).step_by(apart).map(|at| at as f64 * step).collect(),
        setpoint_response: kept(output),
        controller_output: kept(&setpoint.moved),
        load_response: kept(&load.output),
    }
}

/// The parameters at both ends of their 95 % intervals, and in the directions in which they are certain together.
fn directions(values: &[f64], spread: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let size = values.len();
    let matrix = DMatrix::from_fn(size, size, |i, j| spread[i][j]);
    let mut moves: Vec<Vec<f64>> = (0..size)
        .map(|place| (0..size).map(|i| if i == place { spread[i][i].sqrt() } else { 0.0 }).collect())
        .collect();
    // On the scale of the standard errors, as units differ.
    let scale: Vec<f64> = (0..size).map(|i| spread[i][i].sqrt()).collect();
    let scaled = DMatrix::from_fn(size, size, |i, j| {
        let product = scale[i] * scale[j];
        if product > 0.0 { matrix[(i, j)] / product } else { 0.0 }
    });
    let own = scaled.symmetric_eigen();
    for (vector, value) in own.eigenvectors.column_iter().zip(&own.eigenvalues) {
        moves.push(
            vector.iter().zip(&scale).map(|(entry, scale)| entry * scale * value.max(0.0).sqrt()).collect(),
        );
    }
    let moved = |step: &Vec<f64>, sign: f64| -> Vec<f64> {
        let each = values.iter().zip(step);
        // Gains keep their sign, times stay positive.
        each.map(|(value, step)| value + (sign * QUANTILE * step).clamp(-0.99 * value.abs(), f64::INFINITY))
            .collect()
    };
    moves.iter().flat_map(|step| [moved(step, 1.0), moved(step, -1.0)]).collect()
}

/// How far a loop is from instability.
struct Margins {
    peak: f64,
    gain: Option<f64>,
    /// In rad.
    phase: Option<f64>,
}

impl Margins {
    fn of(process: &Lags, [kc, ti, td]: [f64; 3]) -> Self {
        let times =
            || process.taus.iter().chain([&process.dead_time, &ti, &td]).copied().filter(|time| *time > 0.0);
        let (short, long) = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
        let (low, high) = (1e-3 / long, 1e3 / short);
        let ratio = (high / low).ln() / (FREQUENCIES - 1) as f64;
        let mut found = Self { peak: 1.0, gain: None, phase: None };
        let mut last: Option<(f64, f64)> = None;
        for number in 0..FREQUENCIES {
            let omega = low * (ratio * number as f64).exp();
            let derivative = Complex::new(0.0, omega * td) / Complex::new(1.0, omega * td / FILTER);
            let controller = (Complex::new(1.0, -1.0 / (omega * ti)) + derivative) * kc;
            // The phase as a sum has no jumps.
            let mut size = (controller * process.gain).norm();
            let mut phase = (controller / kc).arg() - omega * process.dead_time;
            for tau in &process.taus {
                size /= 1.0_f64.hypot(omega * tau);
                phase -= (omega * tau).atan();
            }
            if process.integrates {
                size /= omega;
                phase -= FRAC_PI_2;
            }
            let open = Complex::from_polar(size, phase);
            found.peak = found.peak.max(1.0 / (open + 1.0).norm());
            if let Some((size_before, phase_before)) = last {
                if size_before >= 1.0 && size < 1.0 {
                    let part = size_before.ln() / (size_before / size).ln();
                    found.phase = Some(PI + phase_before + part * (phase - phase_before));
                }
                if found.gain.is_none() && phase_before > -PI && phase <= -PI {
                    let part = (phase_before + PI) / (phase_before - phase);
                    found.gain = Some((-(size_before.ln() + part * (size / size_before).ln())).exp());
                }
            }
            last = Some((size, phase));
        }
        found
    }

    fn stable(&self) -> bool {
        self.gain.is_none_or(|gain| gain > 1.0) && self.phase.is_none_or(|phase| phase > 0.0)
    }
}

/// A loop in time.
struct Simulation {
    step: f64,
    output: Vec<f64>,
    moved: Vec<f64>,
}

impl Simulation {
    /// After a step of the set point, or of the load, by 1.
    fn of(
        structure: &ProcessStructure,
        values: &[f64],
        [kc, ti, td]: [f64; 3],
        closed_loop_time: f64,
        of_setpoint: bool,
    ) -> Self {
        let parts = structure.taken_apart(values);
        let theta = parts.dead_time;
        let length = (12.0 * (closed_loop_time + theta)).max(6.0 * ti);
        let filter = td / FILTER;
        let times = [closed_loop_time, theta, ti, 2.0 * filter];
        let short = times.into_iter().filter(|time| *time > 0.0).fold(f64::INFINITY, f64::min);
        let wanted = (short / FINE).max(length / MOST_STEPS);
        // The dead time is a whole number of steps, none if it is less than half of one: it must not make them shorter
        // and shorter.
        let delay = if theta < 0.5 * wanted { 0.0 } else { (theta / wanted).ceil() };
        let step = if delay > 0.0 { theta / delay } else { wanted };
        let chain = structure.chain(&parts.shape);
        let transition = chain.transition(step);
        let weight = parts.weights.first().copied().unwrap_or(0.0);
        let mut state = chain.at_rest(0.0, 0.0);
        let mut waiting: VecDeque<f64> = std::iter::repeat_n(0.0, delay as usize).collect();
        let setpoint = if of_setpoint { 1.0 } else { 0.0 };
        let (mut integral, mut slow, mut before) = (0.0, 0.0, None);
        let decay = if filter > 0.0 { 1.0 - (-step / filter).exp() } else { 1.0 };
        // Times near the end of the range have no ratio.
        let count = (length / step).ceil().min(2.0 * MOST_STEPS) as usize + 1;
        let (mut output, mut moved) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for _ in 0..count {
            let y = weight * chain.columns(&state, 0.0)[0];
            let error = setpoint - y;
            integral += step / ti * f64::midpoint(error, before.unwrap_or(error));
            before = Some(error);
            let derivative = if filter > 0.0 { td * (y - slow) / filter } else { 0.0 };
            slow += decay * (y - slow);
            let u = kc * (error + integral - derivative);
            output.push(y);
            moved.push(u);
            waiting.push_back(u + if of_setpoint { 0.0 } else { 1.0 });
            let acting = waiting.pop_front().unwrap_or(0.0);
            state = transition.apply(&state, acting);
        }
        Self { step, output, moved }
    }
}
