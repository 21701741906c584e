//! Noises of models in matrices, from logs.

use std::ops::ControlFlow;

use thetahat_numerics::optimize::{Progress, Search};

use super::{FLOW, NILE, filter};
use crate::Error;
use crate::estimate::NoiseStructure::{self, Diagonal, Full, Innovations, Scaled};
use crate::filter::{Estimator, NoiseEstimate, NoiseLog, StateFilter, StateModel};
use crate::tests::{assert_refused, congruential};

/// Two states, an input and two outputs.
const TURNING: &str = "\
sample_time = 0.5
states = ['a', 'b']
inputs = ['u']
outputs = ['y', 'z']
F = [[0.9, 0.4], [-0.3, 0.8]]
G = [[0], [1]]
H = [[1, 0], [0.5, 1]]
Q = [[1, 0.1], [0.1, 1]]
R = [[1, 0.1], [0.1, 1]]
P0 = [[1, 0.5], [0.5, 2]]
";

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn fit(text: &str, logs: &[NoiseLog<'_>], structure: NoiseStructure) -> Result<NoiseEstimate, Error> {
    let search = Search { tolerance: 1e-14, max_iterations: 500, ..Search::default() };
    StateModel::from_toml(text)?.fit_noise(logs, structure, &search, &go_on)
}

/// Inputs and outputs of so many rows that look like those of the model, some missing, and steps of one or two samples.
fn turning(rows: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let noise = congruential(7, 5 * rows);
    let (mut x, mut inputs, mut outputs, mut steps) = ([0.0, 0.0], Vec::new(), Vec::new(), Vec::new());
    for (row, e) in noise.chunks_exact(5).enumerate() {
        inputs.push(if row % 31 == 9 { f64::NAN } else { e[0] });
        outputs.push(if row % 17 == 3 { f64::NAN } else { x[0] + e[1] });
        outputs.push(if row % 13 == 4 { f64::NAN } else { 0.5 * x[0] + x[1] + 0.5 * e[2] });
        steps.push(if row % 11 == 5 { 1.0 } else { 0.5 });
        x = [0.9 * x[0] + 0.4 * x[1] + e[3], 0.8 * x[1] - 0.3 * x[0] + e[0] + 0.7 * e[4] + 0.3 * e[3]];
    }
    (inputs, outputs, steps)
}

/// The log-likelihood by the filter that goes row by row.
fn likelihood(model: StateModel, log: &NoiseLog<'_>) -> f64 {
    let (k, m) = (model.inputs().len(), model.outputs().len());
    let mut filter = StateFilter::new(model, Estimator::Kalman).unwrap();
    let rows = log.outputs.len() / m;
    for row in 0..rows {
        let step = log.steps.map(|steps| steps[row]);
        filter.step(step, &log.inputs[row * k..(row + 1) * k], &log.outputs[row * m..(row + 1) * m]).unwrap();
    }
    filter.summary().log_likelihood.unwrap()
}

#[test]
fn the_likelihood_is_that_of_the_filter_whatever_the_structure() {
    let (inputs, outputs, steps) = turning(400);
    let log = NoiseLog { steps: Some(&steps), inputs: &inputs, outputs: &outputs };
    let diagonal = TURNING.replace("0.1", "0");
    for (text, structure) in
        [(diagonal.as_str(), Diagonal), (TURNING, Full), (TURNING, Scaled), (TURNING, Innovations)]
    {
        let found = fit(text, &[log], structure).unwrap();
        let expected = likelihood(found.model.clone(), &log);
        assert!((found.log_likelihood - expected).abs() < 1e-9 * expected.abs(), "{structure:?}");
        let start = found.search.log_likelihoods[0];
        if structure != Innovations {
            let own = likelihood(StateModel::from_toml(text).unwrap(), &log);
            assert!((start - own).abs() < 1e-9 * own.abs(), "{structure:?}: {start} {own}");
        }
        assert!(start < found.log_likelihood && found.vanishing.is_empty());
        // Nothing near is more likely.
        let written = found.model.to_toml().unwrap();
        let again = likelihood(StateModel::from_toml(&written).unwrap(), &log);
        assert!((again - expected).abs() < 1e-9 * expected.abs());
        let two = fit(text, &[log, log], structure).unwrap();
        assert!((two.log_likelihood - 2.0 * expected).abs() < 1e-6 * expected.abs(), "{structure:?}");
        let shrunk = two.process_errors[(0, 0)] * 2.0_f64.sqrt() / found.process_errors[(0, 0)];
        assert!((shrunk - 1.0).abs() < 1e-3, "{structure:?}: {shrunk}");
    }
}

#[test]
fn no_noise_near_the_maximum_is_more_likely() {
    let (inputs, outputs, steps) = turning(300);
    let log = NoiseLog { steps: Some(&steps), inputs: &inputs, outputs: &outputs };
    let found = fit(TURNING, &[log], Full).unwrap();
    let text = |q: [f64; 3], r: [f64; 3]| {
        TURNING
            .replace(
                "Q = [[1, 0.1], [0.1, 1]]",
                &format!("Q = [[{0:?}, {1:?}], [{1:?}, {2:?}]]", q[0], q[1], q[2]),
            )
            .replace(
                "R = [[1, 0.1], [0.1, 1]]",
                &format!("R = [[{0:?}, {1:?}], [{1:?}, {2:?}]]", r[0], r[1], r[2]),
            )
    };
    let of =
        |matrix: &thetahat_core::nalgebra::DMatrix<f64>| [matrix[(0, 0)], matrix[(1, 0)], matrix[(1, 1)]];
    let (q, r) = (of(&found.process), of(&found.measurement));
    for index in 0..3 {
        for step in [-1e-3, 1e-3] {
            let (mut other_q, mut other_r) = (q, r);
            other_q[index] += step;
            other_r[index] += step;
            for text in [text(other_q, r), text(q, other_r)] {
                let other = likelihood(StateModel::from_toml(&text).unwrap(), &log);
                assert!(other < found.log_likelihood, "{index} {step}: {other}");
            }
        }
    }
}

#[test]
fn a_level_without_noise_is_told() {
    let outputs: Vec<f64> = congruential(3, 100).iter().map(|noise| 5.0 + noise).collect();
    let log = NoiseLog { steps: None, inputs: &[], outputs: &outputs };
    let found = fit(NILE, &[log], Diagonal).unwrap();
    assert_eq!(found.vanishing, ["Q[level]"]);
    assert_eq!(found.process[(0, 0)], 0.0);
    assert!(found.process_errors[(0, 0)].is_nan() && found.measurement_errors[(0, 0)] > 0.0);
    // What is known to be 0 is not named.
    let known = fit(&NILE.replace("1469.1", "0"), &[log], Diagonal).unwrap();
    assert!(known.vanishing.is_empty() && known.process_errors[(0, 0)] == 0.0);
    assert!((known.log_likelihood - found.log_likelihood).abs() < 1e-6);
}

#[test]
fn what_is_wrong_is_said() {
    let log = NoiseLog { steps: None, inputs: &[], outputs: &FLOW };
    let two = "Q = [[1, 0], [0, 1]]\nF = [[1, 1], [0, 1]]\nH = [[1, 0]]\nP0 = [[1, 0], [0, 1]]";
    let full = format!("sample_time = 1\noutputs = ['y']\nR = [[1]]\n{two}\n");
    assert_refused(
        fit(&full, &[log], Full),
        "3 numbers are unknown, but 1 outputs of 2 states tell no more than 2",
    );
    assert_refused(
        fit(&full.replace("Q = [[1, 0], [0, 1]]", "Q = [[1, 1], [1, 1]]"), &[log], Diagonal),
        "not diagonal",
    );
    assert_refused(fit(&format!("{NILE}S = [[10]]"), &[log], Diagonal), "S of the model is not 0");
    assert_refused(
        fit(&NILE.replace("1469.1", "0").replace("15099", "0"), &[log], Diagonal),
        "all variances",
    );
    assert_refused(
        fit(NILE, &[NoiseLog { outputs: &FLOW[..2], ..log }], Diagonal),
        "more than 2 measured values",
    );
    assert_refused(
        fit(NILE, &[NoiseLog { outputs: &[1.0, f64::INFINITY], ..log }], Diagonal),
        "infinite in row 2",
    );
    assert_refused(fit(NILE, &[NoiseLog { inputs: &[1.0], ..log }], Diagonal), "as many rows");
    let steps = [1.0, 1.3];
    let uneven = NoiseLog { steps: Some(&steps), inputs: &[], outputs: &FLOW[..2] };
    assert_refused(fit(NILE, &[uneven], Diagonal), "1.3");
    let equations = "sample_time = 1\n[states]\nx = { sd = 1 }\n[next]\nx = 'x'\n[outputs]\ny = 'x'\n\
                     [noise]\nmeasurement = { y = 1 }\n";
    assert_refused(fit(equations, &[log], Diagonal), "it is in equations");
    assert_eq!(StateModel::from_toml(equations).unwrap().to_toml(), None);
    let stop = |_: Progress| ControlFlow::Break(());
    let stopped = StateModel::from_toml(NILE).unwrap().fit_noise(&[log], Diagonal, &Search::default(), &stop);
    assert!(matches!(stopped, Err(Error::Interrupted)));
}

#[test]
fn a_model_is_written_as_it_is_read() {
    let all = format!("{TURNING}S = [[0.1, 0], [0, 0.2]]\nD = [[0], [2]]\nx0 = [1, 1e-30]\n");
    let bounded = NILE.replace("outputs = ['y']", "outputs = ['a \"b\\\\ c']")
        + "process_bound = [1]\nmeasurement_bound = [2]\ninitial_bound = [3]\n";
    for text in [all.as_str(), &bounded, NILE] {
        let written = StateModel::from_toml(text).unwrap().to_toml().unwrap();
        let again = StateModel::from_toml(&written).unwrap();
        assert_eq!(again.to_toml().as_deref(), Some(written.as_str()));
        let (mut one, mut other) = (filter(text, Estimator::Kalman), filter(&written, Estimator::Kalman));
        let (k, m) = (again.inputs().len(), again.outputs().len());
        for flow in FLOW {
            let (u, y) = (vec![flow; k], vec![flow; m]);
            let first = one.step(None, &u, &y).unwrap().predicted.values.to_vec();
            assert_eq!(first, other.step(None, &u, &y).unwrap().predicted.values);
        }
    }
}
