//! What a loop does.

use std::f64::consts::PI;

use thetahat_core::RstController;
use thetahat_core::nalgebra::{Complex, Dyn};
use thetahat_numerics::regression::{add_filtered, divide};

use super::document::Loop;
use super::plant::{Plant, trimmed};
use crate::Error;
use crate::model::Root;
use crate::model::polynomial::{is_stable, product, roots};
use crate::respond::StepFigures;

/// The number of frequencies at which L is evaluated.
const FREQUENCIES: usize = 4000;
/// A coefficient of the loop below this part of the largest is rounding.
const ROUNDING: f64 = 1e-12;
/// What is left of the slowest mode where responses end, and the fewest and the most samples of them.
const LEFT: f64 = 1e-3;
const SAMPLES: std::ops::RangeInclusive<f64> = 30.0..=2000.0;
/// Samples of the impulse responses that variances are summed from, at most.
const LONGEST: f64 = 1e5;

/// R and S whole, and what they make of a plant.
pub(super) struct Closed {
    pub(super) r: Vec<f64>,
    pub(super) s: Vec<f64>,
    /// A R.
    open: Vec<f64>,
    /// B S.
    back: Vec<f64>,
    /// A R + B S.
    poles: Vec<f64>,
}

impl Closed {
    pub(super) fn new(controller: &RstController<f64, Dyn>, plant: &Plant) -> Self {
        let r: Vec<f64> = std::iter::once(1.0).chain(controller.r().iter().copied()).collect();
        let s = controller.s().as_slice().to_vec();
        let (open, back) = (product(&plant.a, &r), product(&plant.b, &s));
        let poles = sum(&open, &back);
        Self { r, s, open, back, poles }
    }

    pub(super) fn is_stable(&self) -> bool {
        is_stable(&self.poles, &mut Vec::new())
    }

    /// L at frequencies in rad a sample from near 0 on, closer to one another there.
    fn open_loop(&self) -> impl Iterator<Item = Complex<f64>> + '_ {
        (0..FREQUENCIES).map(|place| {
            let part = (place as f64 + 0.5) / FREQUENCIES as f64;
            let turn = Complex::from_polar(1.0, -PI * part * part);
            at(&self.back, turn) / at(&self.open, turn)
        })
    }

    /// The largest of 1/|1 + L| and of |L/(1 + L)|.
    pub(super) fn peaks(&self) -> (f64, f64) {
        self.open_loop().fold((0.0, 0.0), |(sensitivity, complementary), l| {
            let rest = (1.0 + l).norm();
            (f64::max(sensitivity, 1.0 / rest), f64::max(complementary, l.norm() / rest))
        })
    }

    /// The gain margin, where the phase passes -180 degrees with |L| below 1, and the phase margin in degrees,
    /// where |L| falls through 1.
    fn margins(&self) -> (Option<f64>, Option<f64>) {
        let (mut gain, mut phase): (Option<f64>, Option<f64>) = (None, None);
        let least = |kept: Option<f64>, found: f64| Some(kept.map_or(found, |kept| kept.min(found)));
        let all: Vec<Complex<f64>> = self.open_loop().collect();
        for pair in all.windows(2) {
            let (first, second) = (pair[0], pair[1]);
            if (first.im > 0.0) != (second.im > 0.0) {
                let share = first.im / (first.im - second.im);
                let crossing = first.re + share * (second.re - first.re);
                if crossing < 0.0 && crossing > -1.0 {
                    gain = least(gain, -1.0 / crossing);
                }
            }
            let (before, after) = (first.norm(), second.norm());
            if (before > 1.0) != (after > 1.0) {
                let share = (before - 1.0) / (before - after);
                let crossing = first + (second - first) * share;
                phase = least(phase, (180.0 - crossing.arg().to_degrees().abs()).abs());
            }
        }
        // At half the sampling L is real.
        if let Some(last) = all.last().filter(|last| last.re < 0.0 && last.re > -1.0) {
            gain = least(gain, -1.0 / last.re);
        }
        (gain, phase)
    }
}

/// The loop of a controller and a plant.
pub(super) fn closed_loop(
    controller: &RstController<f64, Dyn>,
    plant: &Plant,
    sample_time: f64,
) -> Result<Loop, Error> {
    let closed = Closed::new(controller, plant);
    let undetermined = || {
        Error::undetermined(
            Vec::new(),
            "the poles of the loop cannot be found: its coefficients are too large",
        )
    };
    // What was placed at 0 is there but for rounding.
    let largest = closed.poles.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let placed = closed.poles.iter().map(|value| if value.abs() < ROUNDING * largest { 0.0 } else { *value });
    let poles = roots(&trimmed(placed.collect())).ok_or_else(undetermined)?;
    let slowest = poles.first().map_or(0.0, |pole| pole.norm());
    let stable = closed.is_stable();
    let lasting = if stable && slowest > 0.0 { LEFT.ln() / slowest.ln() } else { f64::INFINITY };
    let samples = lasting.ceil().clamp(*SAMPLES.start(), *SAMPLES.end()) as usize;
    let observer: Vec<f64> = std::iter::once(1.0).chain(controller.observer().iter().copied()).collect();
    let forward: Vec<f64> = observer.iter().map(|value| value * controller.gain()).collect();
    let step = vec![1.0; samples];
    let respond = |numerator: &[f64], signal: &[f64]| filtered(numerator, &closed.poles, signal);
    let setpoint_response = respond(&product(&plant.b, &forward), &step);
    let controller_output = respond(&product(&plant.a, &forward), &step);
    let load_response = respond(&product(&plant.b, &closed.r), &step);
    let total = |polynomial: &[f64]| polynomial.iter().sum::<f64>();
    let static_gain = total(&plant.b) * total(&forward) / total(&closed.poles);
    let deviation = |numerator: &[f64]| {
        let variance = plant.noise_variance.filter(|_| stable)?;
        let mut impulse = vec![0.0; (2.0 * lasting).clamp(100.0, LONGEST) as usize];
        impulse[0] = 1.0;
        let mut response = respond(&product(&plant.c, numerator), &impulse);
        divide(&plant.d, &mut response);
        Some((variance * response.iter().map(|value| value * value).sum::<f64>()).sqrt())
    };
    let output_deviation = deviation(&closed.r);
    let input_deviation = deviation(&closed.s);
    let (peak_sensitivity, peak_complementary_sensitivity) = closed.peaks();
    let (gain_margin, phase_margin) = closed.margins();
    let ends = stable && static_gain.is_finite() && static_gain != 0.0;
    let figures = ends.then(|| StepFigures::of(&setpoint_response, static_gain, sample_time));
    let root =
        |pole: &Complex<f64>| Root { polynomial: "loop".into(), re: pole.re, im: pole.im, covariance: None };
    Ok(Loop {
        poles: poles.iter().map(root).collect(),
        stable,
        peak_sensitivity,
        peak_complementary_sensitivity,
        gain_margin,
        phase_margin,
        static_gain,
        rise_time: figures.and_then(|figures| figures.rise_time),
        overshoot: figures.map(|figures| figures.overshoot),
        settling_time: figures.and_then(|figures| figures.settling_time),
        output_deviation,
        input_deviation,
        time: (0..samples).map(|sample| sample as f64 * sample_time).collect(),
        setpoint_response,
        controller_output,
        load_response,
    })
}

/// numerator/denominator applied to a signal, the denominator monic.
fn filtered(numerator: &[f64], denominator: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut found = vec![0.0; signal.len()];
    add_filtered(&mut found, &(0..signal.len()), numerator, signal, 0);
    divide(denominator, &mut found);
    found
}

fn sum(first: &[f64], second: &[f64]) -> Vec<f64> {
    let at = |values: &[f64], place: usize| values.get(place).copied().unwrap_or(0.0);
    (0..first.len().max(second.len())).map(|place| at(first, place) + at(second, place)).collect()
}

/// A polynomial at a number, by Horner.
fn at(coefficients: &[f64], turn: Complex<f64>) -> Complex<f64> {
    coefficients.iter().rev().fold(Complex::new(0.0, 0.0), |sum, coefficient| sum * turn + coefficient)
}
