//! Noises, inputs between samples, and starts that are parameters: the likelihood beside a dense Kalman filter that
//! shares nothing with it, and what a fit finds.

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::noise::Noise;

use super::models::{experiment, fitted, fitted_with, joined};
use crate::data::{Recording, Times};
use crate::estimate::equations::{Likelihood, LikelihoodObjective};
use crate::model::GreyBox;
use crate::report::{EquationsPlan, ValidationPlan, compare, validate};
use crate::respond::equations::Experiment;
use crate::tests::channel;

/// A room with a wall (Madsen and Holst 1995; RC network of two states), in hours, K, kW.
const ROOM: &str = "\
sample_time = 0.5

[states]
tw = { start = 'tw0', sd = 0.2 }
ti = { start = 20, sd = 0.1 }

[inputs]
outside = { channel = 'to', hold = 'linear' }
heating = 'q'

[parameters]
ro = { start = 15, sd = 5, unknown = true, min = 0 }
ri = { start = 1, sd = 1, unknown = true, min = 0 }
cw = { start = 0.3, sd = 0.1, unknown = true, min = 0 }
ci = { start = 0.1, sd = 0.1, unknown = true, min = 0 }
tw0 = { start = 18, sd = 3, unknown = true }

[derivative]
tw = '((ti - tw) / ri + (outside - tw) / ro) / cw'
ti = '((tw - ti) / ri + heating) / ci'

[outputs]
y = 'ti'

[noise]
process = { tw = { start = 0.1, unknown = true }, ti = 'process' }
measurement = { y = { start = 0.1, unknown = true, max = 2 } }
";

/// With the one noise that has no place among the parameters of its own.
fn room() -> GreyBox {
    let named = "process = { start = 0.03, sd = 0.03, unknown = true, min = 0 }\ntw0";
    GreyBox::from_toml(&ROOM.replacen("tw0 = ", &format!("{named} = "), 1)).unwrap()
}

const TRUTH: [f64; 8] = [20.0, 1.5, 0.25, 0.2, 0.15, 17.5, 0.15, 0.05];

/// The order of the unknown parameters: those of the table, then noises.
const ORDER: [&str; 8] = ["ro", "ri", "cw", "ci", "process", "tw0", "process.tw", "measurement.y"];

/// By its series for a 4096th, squared 12 times.
fn exponential(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let (small, mut sum) = (matrix / 4096.0, DMatrix::identity(n, n));
    let mut term = sum.clone();
    for k in 1..20 {
        term = &term * &small / f64::from(k);
        sum += &term;
    }
    (0..12).fold(sum, |power, _| &power * &power)
}

/// One step of h hours by the matrix exponential of [A B 0; 0 0 I; 0 0 0], and Q by that of [-A q; 0 A'] (Van Loan
/// 1978).
struct Dense {
    transition: DMatrix<f64>,
    now: DMatrix<f64>,
    change: DMatrix<f64>,
    noise: DMatrix<f64>,
}

impl Dense {
    fn new([ro, ri, cw, ci, process, _, wall, _]: [f64; 8], h: f64) -> Self {
        let a = DMatrix::from_row_slice(
            2,
            2,
            &[-(1.0 / ri + 1.0 / ro) / cw, 1.0 / ri / cw, 1.0 / ri / ci, -1.0 / ri / ci],
        );
        let b = DMatrix::from_row_slice(2, 2, &[1.0 / ro / cw, 0.0, 0.0, 1.0 / ci]);
        let mut block = DMatrix::zeros(6, 6);
        block.view_mut((0, 0), (2, 2)).copy_from(&(&a * h));
        block.view_mut((0, 2), (2, 2)).copy_from(&(&b * h));
        block.view_mut((2, 4), (2, 2)).fill_with_identity();
        let block = exponential(&block);
        let q = DMatrix::from_diagonal(&DVector::from_vec(vec![wall * wall, process * process])) / 0.5;
        let mut noise = DMatrix::zeros(4, 4);
        noise.view_mut((0, 0), (2, 2)).copy_from(&(-&a * h));
        noise.view_mut((0, 2), (2, 2)).copy_from(&(&q * h));
        noise.view_mut((2, 2), (2, 2)).copy_from(&(a.transpose() * h));
        let noise = exponential(&noise);
        Self {
            transition: block.view((0, 0), (2, 2)).into(),
            now: block.view((0, 2), (2, 2)).into(),
            change: block.view((0, 4), (2, 2)).into(),
            noise: noise.view((2, 2), (2, 2)).transpose() * noise.view((0, 2), (2, 2)),
        }
    }

    /// The next state on average: the heating is held, what is outside goes in a line.
    fn next(&self, x: &DVector<f64>, from: [f64; 2], to: [f64; 2]) -> DVector<f64> {
        let change = DVector::from_vec(vec![to[0] - from[0], 0.0]);
        &self.transition * x + &self.now * DVector::from_column_slice(&from) + &self.change * change
    }
}

/// A log of half-hours with its weather, and -ln of its likelihood by the dense filter.
fn weather(row: usize) -> [f64; 2] {
    let hours = row as f64 * 0.5;
    [5.0 + 4.0 * (hours * std::f64::consts::TAU / 24.0).sin(), f64::from(row % 29 < 14) * 1.1]
}

fn simulated(rows: usize, seed: u64) -> Recording {
    let (dense, mut random) = (Dense::new(TRUTH, 0.5), Noise(seed));
    let root = dense.noise.clone().cholesky().unwrap().l();
    let mut x = DVector::from_vec(vec![TRUTH[5] + 0.2 * random.normal(), 20.0 + 0.1 * random.normal()]);
    let mut y = Vec::new();
    for row in 0..rows {
        y.push(x[1] + TRUTH[7] * random.normal());
        let drawn = DVector::from_fn(2, |_, _| random.normal());
        x = dense.next(&x, weather(row), weather(row + 1)) + &root * drawn;
    }
    let of = |input: usize| (0..rows).map(move |row| weather(row)[input]).collect::<Vec<_>>();
    Recording {
        channels: vec![channel("to", of(0)), channel("q", of(1)), channel("y", y)],
        times: Times::Uniform(0.5),
    }
}

fn dense_value(parameters: [f64; 8], recording: &Recording) -> f64 {
    let dense = Dense::new(parameters, 0.5);
    let mut x = DVector::from_vec(vec![parameters[5], 20.0]);
    let mut p = DMatrix::from_diagonal(&DVector::from_vec(vec![0.04, 0.01]));
    let mut sum = 0.0;
    for (row, y) in recording.channels[2].values.iter().enumerate() {
        if row > 0 {
            x = dense.next(&x, weather(row - 1), weather(row));
            p = &dense.transition * p * dense.transition.transpose() + &dense.noise;
        }
        if y.is_nan() {
            continue;
        }
        let (error, variance) = (y - x[1], p[(1, 1)] + parameters[7] * parameters[7]);
        sum += error * error / variance + (std::f64::consts::TAU * variance).ln();
        let gain = p.column(1) / variance;
        x += &gain * error;
        p -= &gain * (&gain * variance).transpose();
    }
    sum / 2.0
}

fn variables(model: &GreyBox, values: &[f64]) -> Vec<f64> {
    model.parameters().iter().zip(values).map(|(unknown, value)| unknown.scale.variable(*value)).collect()
}

/// That the likelihood of logs is that of the dense filter, and its gradient that of differences.
fn assert_dense(recordings: &[Recording]) {
    let model = room();
    assert_eq!(model.unknown().collect::<Vec<_>>(), ORDER);
    let experiments: Vec<Experiment> =
        recordings.iter().map(|recording| experiment(&model, recording)).collect();
    let mut criterion = LikelihoodObjective::new(&model, &experiments);
    for factor in [1.0, 0.7, 1.6] {
        let parameters = TRUTH.map(|truth| truth * factor);
        let z = variables(&model, &parameters);
        let dense: f64 = recordings.iter().map(|recording| dense_value(parameters, recording)).sum();
        let value = criterion.evaluate(&z).unwrap();
        assert!((value - dense).abs() < 1e-9 * dense.abs().max(100.0), "{factor}: {value} {dense}");
        criterion.linearize(&z).unwrap();
        let gradient = criterion.slopes().gradient.clone();
        for (index, found) in gradient.iter().enumerate() {
            let mut at = |side: f64| {
                let mut moved = z.clone();
                moved[index] += side * 1e-5;
                criterion.evaluate(&moved).unwrap()
            };
            let slope = (at(1.0) - at(-1.0)) / 2e-5;
            assert!((found - slope).abs() < 1e-5 * (slope.abs() + 1.0), "{}: {found} {slope}", ORDER[index]);
        }
    }
}

#[test]
fn the_likelihood_is_that_of_a_dense_filter() {
    let mut recording = simulated(233, 4);
    recording.channels[2].values[50..57].fill(f64::NAN);
    assert_dense(&[recording]);
}

/// In most rows of these two logs nothing but the state goes on.
#[test]
fn the_likelihood_of_long_logs_is_that_of_a_dense_filter() {
    let mut recordings = [simulated(2500, 4), simulated(1200, 5)];
    recordings[0].channels[2].values[1200..1211].fill(f64::NAN);
    assert_dense(&recordings);
}

#[test]
fn a_fit_finds_noises_and_the_start_with_the_plant() {
    let model = room();
    let recording = simulated(2000, 11);
    let found = fitted(&model, std::slice::from_ref(&recording)).unwrap();
    for (index, truth) in TRUTH.iter().enumerate() {
        let (value, error) = found.parameter(index);
        assert!((value - truth).abs() < 3.5 * error, "{}: {value} ± {error}", ORDER[index]);
    }
    // No other point nearby is better, by the dense filter.
    let best: Vec<f64> = (0..8).map(|index| found.parameter(index).0).collect();
    let best: [f64; 8] = best.try_into().unwrap();
    let least = dense_value(best, &recording);
    assert!((found.outcome.log_likelihood + least).abs() < 1e-7 * least.abs());
    for index in 0..8 {
        for factor in [0.99, 1.01] {
            let mut moved = best;
            moved[index] *= factor;
            assert!(dense_value(moved, &recording) > least, "{} {factor}", ORDER[index]);
        }
    }
    // Outputs have the noise that was found.
    let own = found.parameter(7).0;
    assert!((found.model.noise_covariance[0][0] - own * own).abs() < 1e-12);
}

const NILE: &str = "\
sample_time = 1
[states]
level = { start = 1000, sd = 1e6 }
[next]
level = 'level'
[outputs]
y = 'level'
[noise]
process = { level = { start = 10, unknown = true } }
measurement = { y = { start = 10, unknown = true } }
";

/// Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed. 2012, section 2.2: the level starts
/// unknown, and the first year only says where.
#[test]
fn the_variances_of_the_nile_are_those_of_the_book() {
    let found = fitted(&GreyBox::from_toml(NILE).unwrap(), &[nile()]).unwrap();
    let variances = [found.parameter(0).0, found.parameter(1).0].map(|deviation| deviation * deviation);
    assert!((variances[0] - 1469.1).abs() < 0.5, "{variances:?}");
    assert!((variances[1] - 15098.5).abs() < 1.0, "{variances:?}");
    let first = -0.5 * (std::f64::consts::TAU * 1e12_f64).ln();
    assert!((found.outcome.log_likelihood - first + 632.54).abs() < 0.01, "{}", found.outcome.log_likelihood);
}

fn nile() -> Recording {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/public/nile.csv");
    let log = std::fs::read_to_string(path).unwrap();
    let y: Vec<f64> =
        log.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect();
    Recording { channels: vec![channel("y", y)], times: Times::Uniform(1.0) }
}

#[test]
fn the_ends_of_a_profile_are_where_the_likelihood_has_fallen() {
    let model = GreyBox::from_toml(NILE).unwrap();
    let plan = EquationsPlan { profile: true, ..EquationsPlan::default() };
    let found = fitted_with(&model, &[nile()], &plan).unwrap();
    let experiments = [experiment(&model, &nile())];
    let mut criterion = LikelihoodObjective::new(&model, &experiments);
    for (index, interval) in found.outcome.profile.iter().enumerate() {
        let (value, error) = found.parameter(index);
        let [low, high] = [interval.low.unwrap(), interval.high.unwrap()];
        assert!(low < value && value < high);
        // Of a standard deviation it is not symmetric, and reaches further up.
        assert!(high - value > value - low, "{} {value} {low} {high}", interval.name);
        assert!((high - low) / (2.0 * 1.96 * error) > 0.9 && (high - low) / (2.0 * 1.96 * error) < 1.6);
        for end in [low, high] {
            // The best other one, by bisection of a grid.
            let (mut least, mut from, mut to) = (f64::INFINITY, 1.0_f64.ln(), 400.0_f64.ln());
            for _ in 0..12 {
                let step = (to - from) / 20.0;
                let mut best = from;
                for place in 0..=20 {
                    let other = from + f64::from(place) * step;
                    let z = if index == 0 { [end.ln(), other] } else { [other, end.ln()] };
                    let cost = criterion.evaluate(&z).unwrap();
                    if cost < least {
                        (least, best) = (cost, other);
                    }
                }
                (from, to) = (best - step, best + step);
            }
            let fall = 2.0 * (found.outcome.log_likelihood + least);
            assert!((fall - 3.841459).abs() < 2e-3, "{} {end}: {fall}", interval.name);
        }
    }
}

/// The Nile has no flow of its own: a noise that the log shows no sign of.
#[test]
fn a_noise_that_is_not_there_vanishes_and_has_an_upper_end() {
    let text = NILE.replace("'level'\n[outputs]", "'0.5 * level'\n[outputs]").replace("sd = 1e6", "sd = 1");
    let model = GreyBox::from_toml(&text).unwrap();
    // Errors that follow one another with turned signs are the opposite of what such a noise does.
    let mut random = Noise(2);
    let (mut level, mut before) = (1000.0, 0.0);
    let y: Vec<f64> = (0..200)
        .map(|_| {
            let error = random.normal();
            let seen = level + 3.0 * (error - 0.4 * before);
            (level, before) = (0.5 * level, error);
            seen
        })
        .collect();
    let recording = Recording { channels: vec![channel("y", y)], times: Times::Uniform(1.0) };
    let plan = EquationsPlan { profile: true, ..EquationsPlan::default() };
    let found = fitted_with(&model, std::slice::from_ref(&recording), &plan).unwrap();
    let own = &found.model.parameters[0];
    assert_eq!((own.value, own.standard_error), (0.0, None));
    let profile = &found.outcome.profile[0];
    assert!(profile.low.is_none() && profile.high.unwrap() > 0.1 && profile.high.unwrap() < 3.0);
    let said: Vec<&String> = found
        .report
        .warnings
        .iter()
        .filter(|warning| warning.contains("no sign of 'process.level'"))
        .collect();
    assert_eq!(said.len(), 1, "{:?}", found.report.warnings);
    // What was found is a model like any other, without that noise.
    assert_eq!(found.model.with_values().unwrap().unknown().len(), 0);

    // And the further parameter says nothing.
    let without = text.replace("level = { start = 10, unknown = true } }", "level = 0 }");
    let small = fitted(&GreyBox::from_toml(&without).unwrap(), std::slice::from_ref(&recording)).unwrap();
    let log = joined(&[recording]).unwrap();
    let validated = [&small.report, &found.report]
        .map(|report| validate(report, None, &log, &[], &ValidationPlan::default()).unwrap());
    let ratios = compare(&validated).unwrap().likelihood_ratios;
    assert_eq!(ratios.len(), 1);
    assert_eq!((ratios[0].smaller, ratios[0].larger), (0, 1));
    assert_eq!(ratios[0].parameters, ["process.level"]);
    assert!(ratios[0].ratio < 1e-5 && ratios[0].p_value > 0.99);
}

/// Measurements that are as noisy as what they measure is large, and a noise that an input brings.
#[test]
fn noises_may_depend_on_states_and_inputs() {
    let text = "sample_time = 1
        [states]
        level = { start = 20, sd = 1 }
        [inputs]
        flow = 'u'
        [parameters]
        part = { start = 0.1, sd = 0.1, unknown = true, min = 0 }
        rough = { start = 0.2, sd = 0.2, unknown = true, min = 0 }
        [next]
        level = '0.95 * level + flow'
        [outputs]
        y = 'level'
        [noise]
        process = { level = 'rough * abs(flow)' }
        measurement = { y = 'part * level' }";
    let model = GreyBox::from_toml(text).unwrap();
    let mut random = Noise(5);
    let (mut level, mut u, mut y) = (20.0, Vec::new(), Vec::new());
    for row in 0..4000 {
        let flow = if row / 40 % 2 == 0 { 0.4 } else { 1.6 };
        u.push(flow);
        y.push(level + 0.03 * level * random.normal());
        level = 0.95 * level + flow + 0.5 * flow * random.normal();
    }
    let recording =
        Recording { channels: vec![channel("u", u), channel("y", y)], times: Times::Uniform(1.0) };
    let found = fitted(&model, &[recording]).unwrap();
    for (index, truth) in [0.03, 0.5].into_iter().enumerate() {
        let (value, error) = found.parameter(index);
        assert!((value - truth).abs() < 3.0 * error && error < 0.1 * truth, "{index}: {value} ± {error}");
    }
    assert!(found.report.warnings.is_empty(), "{:?}", found.report.warnings);
}

/// A delay of two samples and a third, in discrete and in continuous time, and with an input that goes in lines.
#[test]
fn delays_are_found_to_a_part_of_a_sample() {
    for (equations, hold, truth) in [
        ("[next]\nx = '0.8 * x + 0.2 * drive(t - delay)'", "zero", 0.7 / 3.0),
        ("[derivative]\nx = '(drive(t - delay) - x) / 0.4'", "zero", 0.7 / 3.0),
        ("[derivative]\nx = '(drive(t - delay) - x) / 0.4'", "linear", 0.2333),
    ] {
        let text = format!(
            "sample_time = 0.1
             [states]
             x = {{ start = 0, sd = 0.001 }}
             [inputs]
             drive = {{ channel = 'u', hold = '{hold}' }}
             [parameters]
             delay = {{ start = 0.05, sd = 0.1, unknown = true, min = 0, max = 1 }}
             {equations}
             [outputs]
             y = 'x'
             [noise]
             measurement = {{ y = 0.01 }}"
        );
        let model = GreyBox::from_toml(&text).unwrap();
        assert!((model.longest_delay().unwrap() - 0.05).abs() < 1e-15);
        let mut random = Noise(3);
        let mut held = 0.0;
        let u: Vec<f64> = (0..400)
            .map(|row| {
                if row % 7 == 0 {
                    held = if row < 5 { 0.0 } else { random.normal() };
                }
                held
            })
            .collect();
        // What drives the plant from one sample to the next, in 3000 parts.
        let at = |time: f64| -> f64 {
            let place = (time / 0.1).max(0.0);
            let (row, part) = ((place + 1e-9) as usize, place - (place + 1e-9).floor());
            let (here, next) = (u[row.min(399)], u[(row + 1).min(399)]);
            if hold == "linear" { here + (next - here) * part.clamp(0.0, 1.0) } else { here }
        };
        let (mut x, mut y) = (0.0, Vec::new());
        for row in 0..400 {
            y.push(x + 0.01 * random.normal());
            let parts = 300;
            let begin = row as f64 * 0.1;
            if equations.starts_with("[next]") {
                let mean: f64 =
                    (0..parts).map(|part| at(begin + (f64::from(part) + 0.5) * 0.1 / 300.0 - truth)).sum();
                x = 0.8 * x + 0.2 * mean / f64::from(parts);
            } else {
                let decay = (-0.1_f64 / 300.0 / 0.4).exp();
                for part in 0..parts {
                    x = decay * x + (1.0 - decay) * at(begin + (f64::from(part) + 0.5) * 0.1 / 300.0 - truth);
                }
            }
        }
        let recording = Recording {
            channels: vec![channel("u", u.clone()), channel("y", y)],
            times: Times::Uniform(0.1),
        };
        let found = fitted(&model, &[recording]).unwrap();
        let (value, error) = found.parameter(0);
        // A jump within a sample is taken as its mean, which costs what is below.
        assert!((value - truth).abs() < 3.0 * error + 0.002, "{equations} {hold}: {value} ± {error}");
        assert!(error < 0.003, "{error}");
    }
}
