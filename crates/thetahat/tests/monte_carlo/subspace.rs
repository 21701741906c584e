//! States of a plant in a loop.

use thetahat::data::JointRecord;
use thetahat::estimate::{SubspaceOptions, Weighting, subspace};

use super::runs;
use super::simulated::Random;

/// Lags of the impulse response that are compared.
const LAGS: usize = 100;

/// H G, H F G, …, of one input and one output; `f` multiplies by F.
fn response(f: impl Fn(&[f64]) -> Vec<f64>, g: Vec<f64>, h: &[f64]) -> Vec<f64> {
    let states = std::iter::successors(Some(g), |state| Some(f(state)));
    states.take(LAGS).map(|state| state.iter().zip(h).map(|(x, h)| x * h).sum()).collect()
}

/// The median, over some runs, of the relative error of the impulse response, of
///
/// ```text
/// y(t) = 1.5 y(t-1) - 0.7 y(t-2) + u(t-1) + 0.5 u(t-2) + e(t) + 0.9 e(t-1) + 0.5 e(t-2),   u(t) = r(t) - 0.3 y(t)
/// ```
///
/// from N = 1000 samples, with r and e of variance 1.
fn median_error(weighting: Weighting) -> f64 {
    let runs = runs(30).min(100);
    let step = |x: &[f64]| vec![1.5 * x[0] + x[1], -0.7 * x[0]];
    let truth = response(step, vec![1.0, 0.5], &[1.0, 0.0]);
    let norm = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    let options = SubspaceOptions { weighting, feedthrough: Some(false), ..SubspaceOptions::default() };
    let error = |seed: u64| {
        let mut random = Random(1 + seed);
        let (mut u, mut y, mut x) = (Vec::new(), Vec::new(), [0.0, 0.0]);
        for _ in 0..1000 {
            let (e, r) = (random.normal(), random.normal());
            let output = x[0] + e;
            let input = r - 0.3 * output;
            x = [1.5 * x[0] + x[1] + input + 2.4 * e, -0.7 * x[0] + 0.5 * input - 0.2 * e];
            u.push(input);
            y.push(output);
        }
        let record = JointRecord::new(vec![&u], vec![&y]).expect("the case is sound");
        let found = subspace(&record, &options).expect("the case is sound");
        let model = found.state_space(2, 1.0).expect("the case is sound");
        let step = |x: &[f64]| {
            (0..2).map(|row| (0..2).map(|column| model.f[(row, column)] * x[column]).sum()).collect()
        };
        let estimate = response(step, model.g.as_slice().to_vec(), model.h.as_slice());
        let difference: Vec<f64> = estimate.iter().zip(&truth).map(|(a, b)| a - b).collect();
        norm(&difference) / norm(&truth)
    };
    let mut errors: Vec<f64> = (0..runs as u64).map(error).collect();
    errors.sort_by(f64::total_cmp);
    errors[runs / 2]
}

#[test]
fn ssarx_is_better_than_n4sid_where_inputs_are_fed_back() {
    let [ssarx, moesp, n4sid, cva] = Weighting::ALL.map(median_error);
    eprintln!("relative error in a loop: SSARX {ssarx:.3}, MOESP {moesp:.3}, N4SID {n4sid:.3}, CVA {cva:.3}");
    assert!(ssarx <= 0.75 * n4sid, "{ssarx} {n4sid}");
}
