//! How often the intervals of processes hold, after one step and after many.

use std::ops::ControlFlow;

use thetahat::data::{Channel, Log};
use thetahat::estimate::Procedure;
use thetahat::report::{ProcessPlan, fit_process};

use super::{Random, runs};

const TRUTH: [f64; 3] = [2.0, 40.0, 6.3];
/// Half of 95 % of the normal distribution.
const QUANTILE: f64 = 1.959964;

/// How often intervals hold each parameter of a first-order process with a dead time, in percent: those of any colour, and those for
/// white errors. Noise has this pole, and a standard deviation of 0.05, beside steps of 1.
fn held(pole: f64, steps: &[f64], runs: usize) -> [[f64; 3]; 2] {
    let [gain, tau, theta] = TRUTH;
    let mut counts = [[0_usize; 3]; 2];
    for seed in 0..runs as u64 {
        let mut random = Random(3 + 104_729 * seed);
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
