use thetahat_numerics::noise::Noise;

use super::*;
use crate::estimate::{Method, estimate, estimate_of_channels};
use crate::model::PolynomialModel;
use crate::respond::{InitialCondition, simulate};
use crate::tests::assert_refused;

fn method(plant_first: bool) -> Method {
    Method::PredictionError(Search { plant_first, tolerance: 1e-12, ..Search::default() })
}

/// y = q^-1 0.5/(1 - 0.8 q^-1) u + 0.3 v, v an autoregression.
fn log(samples: usize, pole: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(seed);
    let u = noise.take(samples);
    let (mut x, mut v, mut y) = (0.0, 0.0, Vec::new());
    for t in 0..samples {
        if t > 0 {
            x = 0.8 * x + 0.5 * u[t - 1];
        }
        v = pole * v + noise.normal();
        y.push(x + 0.3 * v);
    }
    (u, y)
}

#[test]
fn the_plant_is_that_of_output_error_and_the_noise_that_of_what_it_leaves() {
    let (u, y) = log(600, 0.7, 3);
    let record = Record::new(&y, vec![&u]).unwrap();
    let plant = Orders::oe(&[1], &[1], &[1]).unwrap();
    let (oe, bj) = (plant.clone(), Orders::bj(&[1], 1, 1, &[1], &[1]).unwrap());
    let first = estimate(&record, &oe, &method(false), Initial::Zero).unwrap();
    let both = estimate(&record, &bj, &method(true), Initial::Zero).unwrap();
    // b1, c1, d1, f1.
    let [b, c, d, f] = both.parameters() else { panic!("four parameters") };
    assert_eq!([*b, *f], first.parameters());
    let (v, segments) = free_run_errors(&record, &plant, &first).unwrap();
    let past = vec![0; segments.len()];
    let noise = Record { output: &v, inputs: Vec::new(), segments, past };
    let arma =
        estimate(&noise, &Orders::armax(1, &[], 1, &[]).unwrap(), &method(false), Initial::Auto).unwrap();
    assert_eq!([*d, *c], arma.parameters());
    assert!((d + 0.7).abs() < 0.1 && c.abs() < 0.15);
    assert_eq!((both.samples(), both.mse()), (arma.samples(), arma.mse()));
    let (of_plant, of_noise, all) =
        (first.covariance().unwrap(), arma.covariance().unwrap(), both.covariance().unwrap());
    assert_eq!([all[0][0], all[0][3], all[3][3]], [of_plant[0][0], of_plant[0][1], of_plant[1][1]]);
    assert_eq!([all[1][1], all[1][2], all[2][2]], [of_noise[1][1], of_noise[1][0], of_noise[0][0]]);
    assert_eq!([all[0][1], all[0][2], all[3][1]], [0.0; 3]);
}

#[test]
fn a_of_arx_and_armax_is_the_denominator_that_simulates() {
    let (u, y) = log(800, 0.0, 5);
    let record = Record::new(&y, vec![&u]).unwrap();
    let oe = Orders::oe(&[1], &[1], &[1]).unwrap();
    let first = estimate(&record, &oe, &method(false), Initial::Auto).unwrap();
    for orders in [Orders::arx(1, &[1], &[1]).unwrap(), Orders::armax(1, &[1], 1, &[1]).unwrap()] {
        let found = estimate(&record, &orders, &method(true), Initial::Auto).unwrap();
        let plain = estimate(&record, &orders, &method(false), Initial::Auto).unwrap();
        assert_eq!(&found.parameters()[..2], &[first.parameters()[1], first.parameters()[0]]);
        // One step ahead nothing is better than what was fitted for it.
        assert!(found.mse() >= plain.mse() * (1.0 - 1e-3), "{} {}", found.mse(), plain.mse());
        let errors = |t: usize| y[t] + found.parameters()[0] * y[t - 1] - found.parameters()[1] * u[t - 1];
        if orders.nc == 0 {
            // The initial condition of the free run is part of v, and dies away.
            let own = (100..800).map(|t| errors(t).powi(2)).sum::<f64>() / 700.0;
            assert!((own / found.mse() - 1.0).abs() < 0.1, "{own} {}", found.mse());
        }
        assert_eq!(
            (found.initial(), found.covariance().unwrap().len()),
            (Initial::Drop, orders.parameters())
        );
    }
    // White errors of the output are a root of C at that of A.
    let armax = Orders::armax(1, &[1], 1, &[1]).unwrap();
    let found = estimate(&record, &armax, &method(true), Initial::Auto).unwrap();
    assert!((found.parameters()[2] + 0.8).abs() < 0.1, "{:?}", found.parameters());
}

#[test]
fn a_constant_beside_a_is_that_of_the_level() {
    let (u, mut y) = log(800, 0.0, 7);
    y.iter_mut().for_each(|y| *y += 3.0);
    let ones = vec![1.0; 800];
    let record = Record::new(&y, vec![&u, &ones]).unwrap();
    let orders = Orders::arx(1, &[1, 1], &[1, 0]).unwrap();
    let names = ["u".to_owned()];
    let fit = |record: &Record<'_>, orders: &Orders, first: bool| {
        let monitor: Monitor<'_> = &|_| std::ops::ControlFlow::Continue(());
        estimate_of_channels(record, &names, orders, &method(first), Initial::Auto, monitor).unwrap()
    };
    let found = fit(&record, &orders, true);
    let [a, _, constant] = found.parameters() else { panic!("three parameters") };
    assert!((constant / (1.0 + a) - 3.0).abs() < 0.05, "{constant} {a}");
    // To first order: var(k/A(1)) is that of the level beside B/F.
    let level = fit(&record, &Orders::oe(&[1, 1], &[1, 0], &[1, 0]).unwrap(), false);
    let known = level.covariance().unwrap()[1][1];
    let gain = 1.0 + a;
    let gradient = [-constant / gain / gain, 0.0, 1.0 / gain];
    let all = found.covariance().unwrap();
    let own: f64 = (0..3).flat_map(|i| (0..3).map(move |j| gradient[i] * all[i][j] * gradient[j])).sum();
    assert!((own / known - 1.0).abs() < 1e-9, "{own} {known}");
}

/// The plant is found in noise that the model does not describe, where errors one step ahead mislead.
#[test]
fn noise_of_another_colour_does_not_move_the_plant() {
    let (mut plain, mut first) = (0.0, 0.0);
    for seed in 20..28 {
        let (u, y) = log(2000, 0.95, seed);
        let record = Record::new(&y, vec![&u]).unwrap();
        let arx = Orders::arx(1, &[1], &[1]).unwrap();
        let error = |plant_first| {
            let found = estimate(&record, &arx, &method(plant_first), Initial::Auto).unwrap();
            (found.parameters()[0] + 0.8).powi(2)
        };
        plain += error(false);
        first += error(true);
    }
    assert!(first < 0.3 * plain, "{first} {plain}");
}

#[test]
fn an_autoregression_is_as_long_as_the_noise() {
    for (pole, order) in [(0.0, 0), (0.8, 1)] {
        let (u, y) = log(1500, pole, 31);
        let record = Record::new(&y, vec![&u]).unwrap();
        let oe = Orders::oe(&[1], &[1], &[1]).unwrap();
        let first = estimate(&record, &oe, &method(false), Initial::Auto).unwrap();
        assert_eq!(noise_order(&record, &oe, &first).unwrap(), order);
    }
}

#[test]
fn what_has_no_free_run_is_refused() {
    let (u, y) = log(200, 0.0, 9);
    let one = Record::new(&y, vec![&u]).unwrap();
    let none = Record::new(&y, vec![]).unwrap();
    let pem = Orders::new(1, &[1], 0, 0, &[1], &[1]).unwrap();
    for (record, orders, words) in
        [(&none, Orders::arx(1, &[], &[]).unwrap(), "without inputs"), (&one, pem, "leave out A")]
    {
        assert_refused(estimate(record, &orders, &method(true), Initial::Auto), words);
    }
}

/// y = (0.5 q^-1 u1 + (1 - 0.4 q^-1) q^-2 u2)/(1 - 1.5 q^-1 + 0.7 q^-2) + 0.3 v, v an autoregression.
fn two_inputs(samples: usize, pole: f64, seed: u64) -> ([Vec<f64>; 2], Vec<f64>) {
    let mut noise = Noise(seed);
    let inputs = [noise.take(samples), noise.take(samples)];
    let (mut x, mut v) = (vec![0.0; samples], 0.0);
    let at = |signal: &[f64], t: usize, lag: usize| if t < lag { 0.0 } else { signal[t - lag] };
    let mut y = Vec::new();
    for t in 0..samples {
        let driven = 0.5 * at(&inputs[0], t, 1) + at(&inputs[1], t, 2) - 0.4 * at(&inputs[1], t, 3);
        x[t] = 1.5 * at(&x, t, 1) - 0.7 * at(&x, t, 2) + driven;
        v = pole * v + noise.normal();
        y.push(x[t] + 0.3 * v);
    }
    (inputs, y)
}

#[test]
fn several_inputs_share_the_denominator_that_simulates() {
    let truth = [-1.5, 0.7, 0.5, 1.0, -0.4];
    let ([u1, u2], y) = two_inputs(1500, 0.9, 41);
    let record = Record::new(&y, vec![&u1, &u2]).unwrap();
    let orders = Orders::armax(2, &[1, 2], 2, &[1, 2]).unwrap();
    let found = estimate(&record, &orders, &method(true), Initial::Auto).unwrap();
    let deviations: Vec<f64> = (0..7).map(|k| found.covariance().unwrap()[k][k].sqrt()).collect();
    for ((value, truth), deviation) in found.parameters().iter().zip(truth).zip(&deviations) {
        assert!((value - truth).abs() < 3.5 * deviation, "{value} {truth} {deviation}");
    }
    // A stationary point of the free run's errors: a change of any parameter raises them.
    let cost = |parameters: &[f64]| {
        let model = PolynomialModel::from_parameters(&orders, parameters, None, 1.0, 1.0).unwrap();
        let run = simulate(&model, &record, InitialCondition::Estimate).unwrap();
        (0..y.len()).map(|t| (y[t] - run.values[t]).powi(2)).sum::<f64>()
    };
    if found.initial() == Initial::Drop {
        let least = cost(found.parameters());
        for k in 0..5 {
            for side in [-0.5, 0.5] {
                let mut moved = found.parameters().to_vec();
                moved[k] += side * deviations[k];
                assert!(cost(&moved) > least * (1.0 - 1e-3), "{k}");
            }
        }
    }
}

#[test]
fn one_input_alone_has_the_same_plant_either_way() {
    let (u, y) = log(600, 0.7, 43);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::arx(1, &[2], &[1]).unwrap();
    let oe = plant(&orders, 1).unwrap();
    let Method::PredictionError(search) = method(false) else { unreachable!() };
    let monitor: Monitor<'_> = &|_| std::ops::ControlFlow::Continue(());
    for initial in [Initial::Zero, Initial::Estimate] {
        let alone = prediction_error(&record, &oe, initial, &search, monitor).unwrap();
        let (shared, (errors, _)) = shared::plant(&record, &orders, &oe, initial, &search, monitor).unwrap();
        // b1, b2, f1 and a1, b1, b2.
        let place = [1, 2, 0];
        for (k, &at) in place.iter().enumerate() {
            assert!((alone.parameters()[k] - shared.parameters()[at]).abs() < 1e-5);
            for (l, &other) in place.iter().enumerate() {
                let (one, two) = (alone.covariance().unwrap()[k][l], shared.covariance().unwrap()[at][other]);
                assert!((one - two).abs() < 1e-5 * (one.abs() + two.abs()), "{one} {two}");
            }
        }
        assert!((sum_of_squares(&errors) / 600.0 / alone.mse() - 1.0).abs() < 1e-9);
        assert_eq!(
            (shared.samples(), shared.procedure().initial_conditions()),
            (alone.samples(), alone.procedure().initial_conditions())
        );
    }
}
