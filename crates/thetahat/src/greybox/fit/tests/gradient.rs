use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, ExtendedKalmanFilter, Observation, Transition};

use super::models::Pendulum;
use crate::greybox::dynamics::Dynamics;
use crate::greybox::fit::criterion::Criterion;

/// With missing values: single ones, and whole rows.
fn holed(mut recording: crate::Recording) -> crate::Recording {
    for channel in recording.channels.iter_mut().skip(1) {
        let length = channel.values.len();
        channel.values[length / 2..length / 2 + 7].fill(f64::NAN);
    }
    recording.channels[1].values[13] = f64::NAN;
    recording
}

#[test]
fn gradient_and_value_agree() {
    for (outputs, parameters) in [(1, 3), (2, 5), (1, 4)] {
        let model = Pendulum::new(outputs, parameters);
        let experiments = [1, 2].map(|seed| model.experiment(&holed(model.log(150, seed, 1.0))));
        let mut criterion = Criterion::new(&model, &experiments);
        let z: Vec<f64> = model.truth().iter().map(|truth| 1.1 * truth + 0.05).collect();
        criterion.linearize(&z).unwrap();
        let (gradient, information) = (criterion.gradient.clone(), criterion.information.clone());
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

/// The same model for the filter of thetahat-core.
struct Reference<'a>(&'a Pendulum, Vec<f64>);

impl Transition<f64, Dyn, Dyn> for Reference<'_> {
    fn next(&self, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
        let mut next = DVector::zeros(2);
        let slices = (x.as_slice(), u.as_slice());
        self.0.advance(
            slices.0,
            &self.1,
            slices.1,
            0.0,
            0.05,
            next.as_mut_slice(),
            &mut [0.0; 4],
            &mut vec![],
        );
        next
    }
    fn jacobian(&self, x: &DVector<f64>, u: &DVector<f64>) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(2, 2);
        let slices = (x.as_slice(), u.as_slice());
        self.0.advance(
            slices.0,
            &self.1,
            slices.1,
            0.0,
            0.05,
            &mut [0.0; 2],
            matrix.as_mut_slice(),
            &mut vec![],
        );
        matrix
    }
    fn noise(&self, _: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
        Covariance::from_diagonal(&DVector::from_iterator(2, self.0.process_variances(0.05))).unwrap()
    }
}

impl Observation<f64, Dyn, Dyn, Dyn> for Reference<'_> {
    fn output(&self, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
        let m = self.0.outputs();
        let mut y = DVector::zeros(m);
        self.0.observe(
            x.as_slice(),
            &self.1,
            u.as_slice(),
            0.0,
            y.as_mut_slice(),
            &mut vec![0.0; 2 * m],
            &mut vec![],
        );
        y
    }
    fn jacobian(&self, x: &DVector<f64>, u: &DVector<f64>) -> DMatrix<f64> {
        let m = self.0.outputs();
        let mut matrix = DMatrix::zeros(m, 2);
        self.0.observe(
            x.as_slice(),
            &self.1,
            u.as_slice(),
            0.0,
            &mut vec![0.0; m],
            matrix.as_mut_slice(),
            &mut vec![],
        );
        matrix
    }
    fn noise(&self, _: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
        Covariance::from_diagonal(&DVector::from_column_slice(&self.0.measurement)).unwrap()
    }
}

#[test]
fn value_is_the_likelihood_of_the_filter() {
    for outputs in [1, 2] {
        let model = Pendulum::new(outputs, 5);
        let experiment = model.experiment(&holed(model.log(400, 3, 1.0)));
        let experiments = [experiment];
        let z = [-0.4, 1.8, 1.4, 0.12, 0.25];
        let value = Criterion::new(&model, &experiments).evaluate(&z).unwrap();

        let reference = Reference(&model, z.to_vec());
        let variances =
            DVector::from_iterator(2, model.deviations.iter().map(|deviation| deviation * deviation));
        let prior = Covariance::from_diagonal(&variances).unwrap();
        let mut filter = ExtendedKalmanFilter::new(DVector::from_column_slice(&model.start), prior).unwrap();
        let mut sum = 0.0;
        for row in 0..experiments[0].rows() {
            let input = |row| DVector::from_column_slice(experiments[0].input(row));
            if row > 0 {
                filter.predict(&reference, &input(row - 1)).unwrap();
            }
            let measured = DVector::from_column_slice(experiments[0].output(row));
            sum += filter.correct(&reference, &input(row), &measured).unwrap().log_likelihood();
        }
        assert!((value + sum).abs() < 1e-9 * value.abs(), "{value} {sum}");
    }
}

#[test]
fn a_known_start_and_no_noise_inside_are_output_error() {
    let model = Pendulum { deviations: [0.0; 2], process: 0.0, ..Pendulum::new(2, 3) };
    let experiments = [model.experiment(&holed(model.log(200, 9, 1.0)))];
    let z = [-0.4, 1.8, 1.4];
    let (mut state, mut work) = (model.start.to_vec(), Vec::new());
    let mut sum = 0.0;
    for row in 0..experiments[0].rows() {
        if row > 0 {
            let (input, mut next) = (experiments[0].input(row - 1), [0.0; 2]);
            model.advance(&state, &z, input, 0.0, 0.05, &mut next, &mut [0.0; 4], &mut work);
            state = next.to_vec();
        }
        let mut outputs = [0.0; 2];
        model.observe(&state, &z, experiments[0].input(row), 0.0, &mut outputs, &mut [0.0; 4], &mut work);
        for (index, measured) in experiments[0].output(row).iter().enumerate().filter(|(_, y)| !y.is_nan()) {
            let variance = model.measurement[index];
            sum += (measured - outputs[index]).powi(2) / variance + (std::f64::consts::TAU * variance).ln();
        }
    }
    let mut criterion = Criterion::new(&model, &experiments);
    let value = criterion.evaluate(&z).unwrap();
    assert!((value - sum / 2.0).abs() < 1e-12 * value.abs(), "{value} {}", sum / 2.0);
    // And it has a gradient.
    criterion.linearize(&z).unwrap();
    let gradient = criterion.gradient.clone();
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
