//! How often the intervals of processes hold, after one step and after many.

use std::ops::ControlFlow;

use thetahat::data::{Channel, Log};
use thetahat::estimate::Procedure;
use thetahat::model::{ContinuousStateSpace, Hold, ProcessStructure};
use thetahat::report::{ProcessPlan, fit_process};
use thetahat::thetahat_core::nalgebra::{DMatrix, DVector};

use super::{Random, runs};

const TRUTH: [f64; 3] = [2.0, 40.0, 6.3];
/// The two-sided 95 % quantile of the normal distribution.
const QUANTILE: f64 = 1.959964;

/// How often intervals hold each parameter of a first-order process with a dead time, in percent: those of any colour,
/// and those for white errors. Noise has this pole, and a standard deviation of 0.05, beside steps of 1.
fn held(pole: f64, steps: &[f64], runs: usize) -> [[f64; 3]; 2] {
    let [gain, tau, theta] = TRUTH;
    let mut counts = [[0_usize; 3]; 2];
    for seed in 0..runs as u64 {
        let mut random = Random::new(3 + 104_729 * seed);
        let e = random.normals(700);
        let size = 0.05 * (1.0 - pole * pole).sqrt();
        let mut v = 0.0;
        let noise: Vec<f64> = e
            .iter()
            .map(|e| {
                v = pole * v + size * e;
                v
            })
            .skip(200)
            .collect();
        let level = |t: f64| steps.iter().filter(|start| **start <= t).count() % 2;
        let response = |t: f64| -> f64 {
            let each = steps.iter().enumerate().map(|(index, start)| {
                let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
                sign * gain * (1.0 - (-(t - start - theta).max(0.0) / tau).exp())
            });
            each.sum()
        };
        let u: Vec<f64> = (0..500).map(|k| level(f64::from(k)) as f64).collect();
        let y: Vec<f64> = (0..500).zip(&noise).map(|(k, v)| 3.0 + response(f64::from(k)) + v).collect();
        let channel = |name: &str, values| Channel { name: name.into(), values };
        let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0).expect("the case is sound");
        let plan = ProcessPlan::new(&["u"], "y", "p1d".parse().expect("a structure"));
        let report =
            fit_process(&log, &[], &plan, &|_| ControlFlow::Continue(())).expect("the case is sound");
        let outcome = match &report.estimation.procedure {
            Procedure::FreeRun(outcome) => Some(outcome),
            _ => None,
        };
        let outcome = outcome.expect("the case is a process");
        for (index, parameter) in report.model.parameters().iter().enumerate() {
            let error = (parameter.value - TRUTH[index]).abs() / QUANTILE;
            let own = [parameter.standard_error, outcome.white_standard_errors[index]];
            for (counts, spread) in counts.iter_mut().zip(own) {
                counts[index] += usize::from(error <= spread.expect("there is one"));
            }
        }
    }
    counts.map(|counts| counts.map(|count| 100.0 * count as f64 / runs as f64))
}

#[test]
fn intervals_of_processes_hold_in_noise_of_any_colour() {
    let runs = runs(100);
    for (pole, least) in [(0.0, 88.0), (0.9, 75.0)] {
        for steps in [&[20.0][..], &[20.0, 180.0, 300.0, 380.0]] {
            let [coloured, white] = held(pole, steps, runs);
            eprintln!(
                "pole {pole}, {} steps: {coloured:.1?} %, if errors were white {white:.1?} %",
                steps.len()
            );
            for share in coloured {
                assert!(share >= least, "{share}");
            }
        }
    }
}

/// The system of Rao and Garnier, with resonances at 2 and 20 rad/s: (-6400 s + 1600)/(s^4 + 5 s^3 + 408 s^2 + 416 s +
/// 1600).
const RESONANT: [f64; 6] = [-6400.0, 1600.0, 5.0, 408.0, 416.0, 1600.0];

/// How often the intervals of its coefficients hold, in percent: an input of two levels that may change every seven
/// rows, and white noise of a tenth of the power of the output.
fn held_of_transfer_function(seconds: f64, rows: usize, runs: usize) -> [f64; 6] {
    let [b1, b0, a3, a2, a1, a0] = RESONANT;
    let continuous = ContinuousStateSpace {
        a: DMatrix::from_row_slice(
            4,
            4,
            &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -a0, -a1, -a2, -a3],
        ),
        b: DMatrix::from_column_slice(4, 1, &[0.0, 0.0, 0.0, 1.0]),
        c: DMatrix::from_row_slice(1, 4, &[b0, b1, 0.0, 0.0]),
        d: DMatrix::zeros(1, 1),
        k: DMatrix::zeros(4, 1),
        noise_intensity: DMatrix::zeros(1, 1),
    };
    let sampled = continuous.sampled(seconds, Hold::Zero).expect("the case is sound");
    let mut counts = [0_usize; 6];
    for seed in 0..runs as u64 {
        let mut random = Random::new(3 + 104_729 * seed);
        let signs = random.normals(rows.div_ceil(7));
        let u: Vec<f64> = (0..rows).map(|row| signs[row / 7].signum()).collect();
        let mut state = DVector::zeros(4);
        let clean: Vec<f64> = u
            .iter()
            .map(|u| {
                let seen = (&sampled.h * &state)[0];
                state = &sampled.f * &state + &sampled.g * *u;
                seen
            })
            .collect();
        let size = (0.1 * clean.iter().map(|y| y * y).sum::<f64>() / rows as f64).sqrt();
        let y = clean.iter().zip(random.normals(rows)).map(|(y, e)| y + size * e).collect();
        let channel = |name: &str, values| Channel { name: name.into(), values };
        let log = Log::new(vec![channel("u", u), channel("y", y)], seconds).expect("the case is sound");
        let structure = ProcessStructure::transfer_function(4, 1, false).expect("a structure");
        let plan = ProcessPlan { free_start: Some(true), ..ProcessPlan::new(&["u"], "y", structure) };
        let report =
            fit_process(&log, &[], &plan, &|_| ControlFlow::Continue(())).expect("the case is sound");
        for ((parameter, truth), count) in report.model.parameters().iter().zip(RESONANT).zip(&mut counts) {
            let spread = parameter.standard_error.expect("there is one");
            *count += usize::from((parameter.value - truth).abs() <= QUANTILE * spread);
        }
    }
    counts.map(|count| 100.0 * count as f64 / runs as f64)
}

#[test]
fn intervals_of_transfer_functions_hold() {
    let runs = runs(100);
    for (seconds, rows) in [(0.01, 7161), (0.05, 2000)] {
        let held = held_of_transfer_function(seconds, rows, runs);
        let mean = held.iter().sum::<f64>() / 6.0;
        eprintln!("transfer functions every {seconds} s: {held:.1?} %, mean {mean:.1} %");
        assert!(mean >= 88.0 && held.iter().all(|share| *share >= 84.0), "{held:?}");
    }
}
