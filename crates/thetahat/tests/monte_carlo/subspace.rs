//! States of a plant in a loop, and the errors that are said of a model.

use thetahat::data::{Channel, JointRecord, Log};
use thetahat::estimate::{Constant, Refine, SubspaceOptions, Weighting, subspace};
use thetahat::model::{Model, Quantity};
use thetahat::report::{StateSpacePlan, fit_state_space};

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
        let mut random = Random::new(1 + seed);
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

/// Two lightly damped modes that two inputs drive and two outputs see, the second input at once.
const F: [[f64; 4]; 4] =
    [[0.8, 0.4, 0.0, 0.0], [-0.4, 0.8, 0.0, 0.0], [0.0, 0.0, 0.3, 0.6], [0.1, 0.0, -0.6, 0.3]];
const G: [[f64; 2]; 4] = [[1.0, 0.2], [-0.5, 0.7], [0.3, 1.0], [0.0, -0.8]];
const H: [[f64; 4]; 2] = [[1.0, 0.0, 0.5, 0.0], [0.0, 0.6, 0.0, 1.0]];
const D: [[f64; 2]; 2] = [[0.0, 0.0], [0.4, 0.0]];
const K: [[f64; 2]; 4] = [[0.3, 0.0], [0.1, 0.2], [0.0, 0.1], [-0.1, 0.3]];

fn product<const R: usize, const C: usize>(matrix: &[[f64; C]; R], vector: &[f64; C]) -> [f64; R] {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

fn next(x: &[f64; 4], u: &[f64; 2], e: &[f64; 2]) -> [f64; 4] {
    let parts = [product(&F, x), product(&G, u), product(&K, e)];
    std::array::from_fn(|state| parts.iter().map(|part| part[state]).sum())
}

fn seen(x: &[f64; 4], u: &[f64; 2]) -> [f64; 2] {
    let parts = [product(&H, x), product(&D, u)];
    std::array::from_fn(|output| parts.iter().map(|part| part[output]).sum())
}

/// N = 800 samples, with inputs and innovations of variance 1 and 0.25, from a state that is not at rest.
fn log(seed: u64) -> Log {
    let mut random = Random::new(1 + seed);
    let (mut channels, mut x) = ([const { Vec::new() }; 4], [0.0; 4]);
    for t in 0..900 {
        let [u, e] = [1.0, 0.5].map(|size| [size * random.normal(), size * random.normal()]);
        let y = seen(&x, &u);
        if t >= 100 {
            let values = [u[0], u[1], y[0] + e[0], y[1] + e[1]];
            channels.iter_mut().zip(values).for_each(|(channel, value)| channel.push(value));
        }
        x = next(&x, &u, &e);
    }
    let named = ["u1", "u2", "y1", "y2"].into_iter().zip(channels);
    let channels = named.map(|(name, values)| Channel { name: name.into(), values }).collect();
    Log::new(channels, 1.0).expect("the case is sound")
}

/// The first 20 samples of the step response of each output to each input, and its end.
fn steps() -> Vec<[f64; 21]> {
    let step = |output: usize, input: usize| {
        let u = std::array::from_fn(|place| f64::from(u8::from(place == input)));
        let states = std::iter::successors(Some([0.0; 4]), |x| Some(next(x, &u, &[0.0; 2])));
        let mut values = states.map(|x| seen(&x, &u)[output]);
        let mut response: [f64; 21] = std::array::from_fn(|_| values.next().unwrap_or(f64::NAN));
        response[20] = values.nth(2000).unwrap_or(f64::NAN);
        response
    };
    (0..4).map(|pair| step(pair / 2, pair % 2)).collect()
}

/// How often 95 % intervals of poles, static gains, step and frequency responses cover the truth, each kind in all
/// runs.
fn assert_covers(refine: Refine) {
    let runs = runs(20).min(100);
    let plan = StateSpacePlan {
        orders: Some(4..=4),
        subspace: SubspaceOptions { feedthrough: Some(true), ..SubspaceOptions::default() },
        constant: Constant::No,
        refine: Some(refine),
        ..StateSpacePlan::new(&["u1", "u2"], &["y1", "y2"])
    };
    // The eigenvalues of F by hand: its characteristic polynomial is (z^2 - 1.6 z + 0.8)(z^2 - 0.6 z + 0.45).
    let poles = [(0.8, 0.4), (0.3, 0.6)];
    let steps = steps();
    let frequencies = [0.1, 0.4, 0.5, 1.0, 2.0];
    let respond = |output: usize, input: usize, frequency: f64| {
        // H (q I - F)^-1 G + D as the sum of the impulse response.
        let u = std::array::from_fn(|place| f64::from(u8::from(place == input)));
        let direct = D[output][input];
        let mut x = product(&G, &u);
        (1..2000).fold([direct, 0.0], |[re, im], lag| {
            let value = product(&H, &x)[output];
            x = product(&F, &x);
            let (sine, cosine) = (frequency * f64::from(lag)).sin_cos();
            [re + value * cosine, im - value * sine]
        })
    };
    let truths: Vec<Vec<[f64; 2]>> = (0..4)
        .map(|pair| frequencies.iter().map(|frequency| respond(pair / 2, pair % 2, *frequency)).collect())
        .collect();
    let mut counts = [[0_usize; 2]; 4];
    for seed in 0..runs as u64 {
        let report = fit_state_space(&log(seed), &[], &plan).expect("the case is sound");
        let Model::StateSpace(model) = &report.model else { unreachable!("it was asked for") };
        let mut add = |kind: usize, error: f64, deviation: Option<f64>| {
            let deviation = deviation.expect("errors are known");
            counts[kind][0] += usize::from(error.abs() <= 1.959964 * deviation);
            counts[kind][1] += 1;
        };
        for (re, im) in poles {
            let distance = |re_found: f64, im_found: f64| (re_found - re).hypot(im_found - im);
            let found = model
                .poles
                .iter()
                .min_by(|a, b| distance(a.re, a.im).total_cmp(&distance(b.re, b.im)))
                .expect("there are four");
            let covariance = found.covariance;
            add(0, found.re - re, covariance.map(|rows| rows[0][0].sqrt()));
            add(0, found.im - im, covariance.map(|rows| rows[1][1].sqrt()));
        }
        let outputs = report.model.linear("responses").expect("it is linear");
        for (pair, (truth, frequencies_of)) in steps.iter().zip(&truths).enumerate() {
            let (output, input) = (pair / 2, pair % 2);
            let gain: Quantity = model.dc_gain[output][input].expect("it does not integrate");
            add(1, gain.value - truth[20], gain.standard_error);
            let found = outputs[output].step_response(input, Some(20)).expect("the case is sound");
            for (value, truth) in found.values.iter().zip(truth).skip(1) {
                add(2, value.value - truth, value.standard_error);
            }
            let found = outputs[output].frequency_response(&frequencies).expect("the case is sound");
            for (point, truth) in found[input].points.iter().zip(frequencies_of) {
                let covariance = point.covariance;
                add(3, point.re - truth[0], covariance.map(|rows| rows[0][0].sqrt()));
                add(3, point.im - truth[1], covariance.map(|rows| rows[1][1].sqrt()));
            }
        }
    }
    for (kind, [covered, all]) in
        ["poles", "static gains", "step responses", "frequency responses"].iter().zip(counts)
    {
        let fraction = covered as f64 / all as f64;
        eprintln!("{refine}: intervals of {kind} cover in {:.1} %", 100.0 * fraction);
        assert!(fraction >= 0.88, "{refine} {kind}: {fraction}");
        assert!(fraction <= 0.995, "{refine} {kind}: {fraction}");
    }
}

#[test]
fn intervals_of_refined_models_cover_the_truth() {
    assert_covers(Refine::Prediction);
}

#[test]
fn intervals_of_models_refined_for_the_free_run_cover_the_truth() {
    assert_covers(Refine::Simulation);
}
