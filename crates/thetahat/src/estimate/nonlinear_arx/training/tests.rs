//! Gradients of every map and horizon, and what training finds.

use super::objective::{Lost, RunErrors};
use super::*;
use crate::data::{Detrend, Log};
use crate::model::{Model, NonlinearArxModel};
use crate::report::{InputLags, NonlinearArxPlan, fit_nonlinear_arx};
use crate::tests::channel;
use std::ops::ControlFlow;

use thetahat_numerics::optimize::Objective;
use thetahat_numerics::random::Random;

/// A tank-like log: the output is held back the more the higher it is.
fn log(rows: usize) -> Log {
    let mut random = Random::of(7, 0);
    let (mut u, mut y) = (vec![0.0; rows], vec![0.0; rows]);
    for k in 0..rows {
        u[k] = if k % 9 == 0 { random.normal() } else { u[k - 1] };
        let last = if k > 0 { y[k - 1] } else { 0.0 };
        let drive = if k > 0 { u[k - 1] } else { 0.0 };
        y[k] = 0.8 * last + 0.4 * (1.5 * drive - 0.5 * last).tanh() + 0.02 * random.normal();
    }
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

/// A model whose signals, lags and scales training begins with: of two past outputs and two inputs.
fn head(log: &Log) -> NonlinearArxModel {
    let plan = NonlinearArxPlan {
        terms: Some(2),
        detrend: Detrend::None,
        input_lags: vec![InputLags { lags: 2, delay: 1 }],
        ..NonlinearArxPlan::new(&["u"], &["y"])
    };
    let report = fit_nonlinear_arx(log, &[], &plan).unwrap();
    let Model::NonlinearArx(model) = &report.model else { panic!("{:?}", report.model) };
    NonlinearArxModel::clone(model)
}

fn samples<'l>(log: &'l Log, head: &NonlinearArxModel) -> Samples<'l> {
    let rows = crate::data::Rows::new(1, log.rows()).unwrap();
    let record = log.record(&["u".to_owned()], "y", &[rows]).unwrap();
    let segments: Vec<_> = record.segments.into_iter().zip(record.past).collect();
    Samples::new(log, head.clone(), &segments, 0.0).unwrap()
}

fn maps(samples: &Samples<'_>) -> Vec<Map> {
    let networks = [Activation::Tanh, Activation::Logistic, Activation::Relu].map(Units::Network);
    let mut maps: Vec<Map> =
        networks.into_iter().chain([Units::Radial]).map(|units| units.draw(samples, 3, 1, 0)).collect();
    maps.push(Map::Polynomial { terms: vec![vec![], vec![0], vec![2], vec![0, 2], vec![1, 1, 3]] });
    maps
}

#[test]
fn gradients_are_differences_of_costs() {
    let log = log(160);
    let head = head(&log);
    let samples = samples(&log, &head);
    for map in maps(&samples) {
        let linear = map.parameters(4);
        let mut numbers: Vec<f64> = (0..linear).map(|j| 0.3 - 0.11 * j as f64).collect();
        // Away from the samples at which ramps bend.
        numbers.extend(map.shape().iter().map(|number| number + 0.03));
        for horizon in [Horizon::Steps { steps: 1 }, Horizon::Steps { steps: 7 }, Horizon::FreeRun] {
            let mut runs = RunErrors::new(&samples, &map, horizon, 0.7);
            runs.evaluate(&numbers).unwrap();
            runs.linearize().unwrap();
            let right = runs.right().to_vec();
            for (place, own) in right.iter().enumerate() {
                let mut moved = |step: f64| {
                    let mut numbers = numbers.clone();
                    numbers[place] += step;
                    runs.evaluate(&numbers).unwrap()
                };
                let step = 1e-5;
                // g is minus half the gradient.
                let difference = (moved(-step) - moved(step)) / (4.0 * step);
                let size = right.iter().fold(1.0_f64, |size, g| size.max(g.abs()));
                assert!(
                    (difference - own).abs() < 1e-6 * size,
                    "{map:?} {horizon} {place}: {difference} {own}"
                );
            }
        }
    }
}

#[test]
fn the_matrix_is_that_of_the_slopes() {
    // More samples than a block, and windows that end within blocks.
    let log = log(700);
    let head = head(&log);
    let samples = samples(&log, &head);
    let map = Units::Network(Activation::Tanh).draw(&samples, 2, 1, 0);
    let mut numbers = vec![0.1; map.parameters(4)];
    numbers.extend(map.shape());
    let size = numbers.len();
    let mut runs = RunErrors::new(&samples, &map, Horizon::Steps { steps: 50 }, 0.0);
    runs.evaluate(&numbers).unwrap();
    runs.linearize().unwrap();
    let matrix = runs.matrix().to_vec();
    // G of a cost that is nearly quadratic, by differences of g along the first parameter.
    let mut moved = |step: f64| {
        let mut numbers = numbers.clone();
        numbers[0] += step;
        runs.evaluate(&numbers).unwrap();
        runs.squares()
    };
    let step = 1e-3;
    let curvature = (moved(step) - 2.0 * moved(0.0) + moved(-step)) / (2.0 * step * step);
    assert!((matrix[0] / curvature - 1.0).abs() < 0.2, "{} {curvature}", matrix[0]);
    for i in 0..size {
        for j in 0..size {
            assert_eq!(matrix[i * size + j], matrix[j * size + i]);
        }
    }
}

#[test]
fn a_run_that_grows_without_bound_has_no_cost() {
    let log = log(300);
    let head = head(&log);
    let samples = samples(&log, &head);
    let map = Map::Polynomial { terms: vec![vec![0], vec![2]] };
    let mut runs = RunErrors::new(&samples, &map, Horizon::FreeRun, 0.0);
    assert_eq!(runs.evaluate(&[1.5, 1.0]), Err(Lost));
    assert_eq!(runs.evaluate(&[f64::NAN, 1.0]), Err(Lost));
    assert!(runs.evaluate(&[0.5, 1.0]).unwrap().is_finite());
}

#[test]
fn training_finds_the_plant_from_most_starts() {
    let log = log(600);
    let head = head(&log);
    let samples = samples(&log, &head);
    let options = Search { starts: 9, max_iterations: 200, ..Search::default() };
    let training = Training {
        horizon: Horizon::FreeRun,
        ridges: &[0.01],
        search: &options,
        monitor: &|_| ControlFlow::Continue(()),
    };
    let units = Units::Network(Activation::Tanh);
    let (chosen, solved, outcome) = samples.train(units, &[1], training, &Count::Given(1), None).unwrap();
    // Noise of 0.02, filtered by the plant.
    let rmse = chosen.steps[0].free_run.unwrap().rmse.unwrap();
    assert!(rmse < 0.06, "{rmse}");
    let least = outcome.starts.iter().flatten().fold(f64::INFINITY, |least, cost| least.min(*cost));
    assert_eq!(outcome.cost, least);
    let found = outcome.starts.iter().flatten().filter(|cost| **cost < 1.001 * least).count();
    assert!(found >= 5, "{:?}", outcome.starts);
    // Of 6 parameters and 5 numbers of the unit.
    let covariance = solved.model.covariance.unwrap();
    assert_eq!((solved.model.parameters.len(), covariance.len()), (6, 11));
    assert!(solved.model.parameters.iter().all(|parameter| parameter.standard_error.unwrap() > 0.0));
}
