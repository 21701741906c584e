use thetahat_core::nalgebra::DMatrix;

use super::models::{TRUTH, experiment, holed, log, pendulum, pendulum_text};
use crate::estimate::equations::{Likelihood, LikelihoodObjective};
use crate::filter::{Estimator, StateFilter, StateModel};
use crate::model::GreyBox;
use crate::model::equations::{Drive, Work};

#[test]
fn gradient_and_value_agree() {
    for (outputs, parameters) in [(1, 3), (2, 5), (1, 4)] {
        let model = pendulum(outputs, parameters);
        let truth = &TRUTH[..parameters];
        let experiments = [1, 2].map(|seed| experiment(&model, &holed(log(&model, truth, 150, seed, 1.0))));
        let mut criterion = LikelihoodObjective::new(&model, &experiments);
        let z: Vec<f64> = truth.iter().map(|truth| 1.1 * truth + 0.05).collect();
        criterion.linearize(&z).unwrap();
        let (gradient, information) =
            (criterion.slopes().gradient.clone(), criterion.slopes().information.clone());
        for index in 0..parameters {
            let width = 1e-6;
            let mut at = |side: f64| {
                let mut z = z.clone();
                z[index] += side * width;
                criterion.evaluate(&z).unwrap()
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * width);
            // The difference has eps V/width = 1e-8 of rounding, and its own error.
            let size = information[index * parameters + index].sqrt();
            assert!(
                (gradient[index] - slope).abs() < 1e-6 * (slope.abs() + size),
                "{index} {} {slope}",
                gradient[index]
            );
        }
        assert!(DMatrix::from_row_slice(parameters, parameters, &information).cholesky().is_some());
    }
}

/// The updates of this module's predictor, and those of the extended Kalman filter of thetahat-core.
#[test]
fn value_is_the_likelihood_of_the_filter() {
    for outputs in [1, 2] {
        let model = pendulum(outputs, 5);
        let recording = holed(log(&model, &TRUTH, 400, 3, 1.0));
        let experiment = experiment(&model, &recording);
        let z = [-0.4, 1.8, 1.4, 0.12, 0.25];
        let value = LikelihoodObjective::new(&model, std::slice::from_ref(&experiment)).evaluate(&z).unwrap();

        let named: Vec<(&str, f64)> = model.unknown().zip(z).collect();
        let known = StateModel::from(model.with_parameters(&named).unwrap());
        let mut filter = StateFilter::new(known, Estimator::Extended).unwrap();
        for row in 0..experiment.rows() {
            filter.step(None, experiment.input(row), experiment.output(row)).unwrap();
        }
        let sum = filter.summary().log_likelihood.unwrap();
        assert!((value + sum).abs() < 1e-9 * value.abs(), "{value} {sum}");
    }
}

#[test]
fn a_known_start_and_no_noise_inside_are_output_error() {
    let text = pendulum_text(0.0, 2, 3).replace("sd = 0.3", "sd = 0").replace("sd = 0.2", "sd = 0");
    let model = GreyBox::from_toml(&text).unwrap();
    assert_eq!(model.started().1, [0.0; 2]);
    let experiments = [experiment(&model, &holed(log(&model, &TRUTH[..3], 200, 9, 1.0)))];
    let z = [-0.4, 1.8, 1.4];
    let (mut state, mut work) = (model.started().0, Work::new());
    let mut sum = 0.0;
    for row in 0..experiments[0].rows() {
        if row > 0 {
            let (input, mut next) = (experiments[0].input(row - 1), [0.0; 2]);
            model.advance(&state, &z, Drive::held(input), 0.0, 0.05, &mut next, &mut [0.0; 4], &mut work);
            state = next.to_vec();
        }
        let mut outputs = [0.0; 2];
        model.observe(
            &state,
            &z,
            Drive::held(experiments[0].input(row)),
            0.0,
            &mut outputs,
            &mut [0.0; 4],
            &mut work,
        );
        for (index, measured) in experiments[0].output(row).iter().enumerate().filter(|(_, y)| !y.is_nan()) {
            let variance = model.measurement_variances_at_start()[index];
            sum += (measured - outputs[index]).powi(2) / variance + (std::f64::consts::TAU * variance).ln();
        }
    }
    let mut criterion = LikelihoodObjective::new(&model, &experiments);
    let value = criterion.evaluate(&z).unwrap();
    assert!((value - sum / 2.0).abs() < 1e-12 * value.abs(), "{value} {}", sum / 2.0);
    // And it has a gradient.
    criterion.linearize(&z).unwrap();
    let gradient = criterion.slopes().gradient.clone();
    for index in 0..3 {
        let mut at = |width: f64| {
            let mut z = z;
            z[index] += width;
            criterion.evaluate(&z).unwrap()
        };
        let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
        assert!((gradient[index] - slope).abs() < 1e-6 * slope.abs(), "{} {slope}", gradient[index]);
    }
}
