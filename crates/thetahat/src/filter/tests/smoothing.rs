use thetahat_core::nalgebra::{DMatrix, DVector};

use super::{FLOW, NILE, filter};
use crate::filter::Estimator;
use crate::model::equations::tests::CART;
use crate::tests::assert_refused;

#[test]
fn the_last_state_is_the_filtered_one() {
    let mut filter = filter(NILE, Estimator::Kalman).recording();
    for flow in FLOW {
        filter.step(None, &[], &[flow]).unwrap();
    }
    let smoothed = filter.smooth().unwrap();
    let last = filter.step(None, &[], &[f64::NAN]).unwrap();
    let (state, parameters) = smoothed.row(FLOW.len()).unwrap();
    assert_eq!((smoothed.rows(), parameters.values.len()), (FLOW.len(), 0));
    assert_eq!((smoothed.row(0), smoothed.row(FLOW.len() + 1)), (None, None));
    assert_eq!(smoothed.row(usize::MAX), None);
    assert!((state.values[0] - last.predicted.values[0]).abs() < 1e-10);
    // All others are more certain than the last one.
    let deviation = |row: usize| smoothed.row(row).unwrap().0.standard_deviations.unwrap()[0];
    assert!((2..FLOW.len()).all(|row| deviation(row) < deviation(FLOW.len())));
}

#[test]
fn it_is_the_posterior_mean_of_all_states() {
    // x(k+1) = 0.8 x(k) + w(k), y(k) = x(k) + v(k), and (w, v) correlated; against dense Gaussian conditioning.
    let text = "sample_time = 1\noutputs = ['y']\nF = [[0.8]]\nH = [[1]]\nQ = [[2]]\nR = [[1.5]]\nS = [[0.9]]\nP0 = [[3]]";
    let outputs = [1.0, -0.5, f64::NAN, 2.0, 3.0, f64::NAN, f64::NAN, 1.0];
    let steps = [0, 1, 2, 1, 1, 3, 1, 1];
    let mut filter = filter(text, Estimator::Kalman).recording();
    for (output, step) in outputs.iter().zip(steps) {
        filter.step(Some(f64::from(step)), &[], &[*output]).unwrap();
    }
    let smoothed = filter.smooth().unwrap();

    // All samples, of which each row is one. Unknowns: x(0), then w(k) and v(k) of each sample.
    let rows: Vec<usize> = steps
        .iter()
        .scan(0, |at, step| {
            *at += *step as usize;
            Some(*at)
        })
        .collect();
    let samples = rows[rows.len() - 1] + 1;
    let size = 1 + 2 * samples;
    let mut prior = DMatrix::zeros(size, size);
    prior[(0, 0)] = 3.0;
    let mut states = DMatrix::zeros(samples, size);
    states[(0, 0)] = 1.0;
    for k in 0..samples {
        let (w, v) = (1 + 2 * k, 2 + 2 * k);
        (prior[(w, w)], prior[(v, v)], prior[(w, v)], prior[(v, w)]) = (2.0, 1.5, 0.9, 0.9);
        if k > 0 {
            let moved = states.row(k - 1) * 0.8;
            states.set_row(k, &moved);
            states[(k, w - 2)] += 1.0;
        }
    }
    let measured: Vec<usize> = (0..rows.len()).filter(|&row| !outputs[row].is_nan()).collect();
    let mut seen = DMatrix::zeros(measured.len(), size);
    for (place, &row) in measured.iter().enumerate() {
        seen.set_row(place, &states.row(rows[row]));
        seen[(place, 2 + 2 * rows[row])] += 1.0;
    }
    let y = DVector::from_iterator(measured.len(), measured.iter().map(|&row| outputs[row]));
    let cross = &states * &prior * seen.transpose();
    let inverse = (&seen * &prior * seen.transpose()).try_inverse().unwrap();
    let mean = &cross * &inverse * y;
    let covariance = &states * &prior * states.transpose() - &cross * inverse * cross.transpose();
    for (row, &sample) in rows.iter().enumerate() {
        let state = smoothed.row(row + 1).unwrap().0;
        assert!((state.values[0] - mean[sample]).abs() < 1e-12, "{row}");
        let deviation = covariance[(sample, sample)].sqrt();
        assert!((state.standard_deviations.unwrap()[0] - deviation).abs() < 1e-12, "{row}");
    }
}

#[test]
fn constant_parameters_are_the_same_in_all_rows() {
    let mut filter = filter(CART, Estimator::Extended).recording();
    let mut last = (0.0, 0.0);
    for k in 0..150 {
        let position = 0.02 * f64::from(k * k % 31);
        let estimate = filter.step(None, &[1.0], &[position]).unwrap();
        last = (estimate.parameters.values[0], estimate.parameters.standard_deviations.unwrap()[0]);
    }
    let smoothed = filter.smooth().unwrap();
    for row in 1..=150 {
        let (_, mass) = smoothed.row(row).unwrap();
        // Digits are lost where the filtered variance is much larger than the smoothed one.
        assert!((mass.values[0] - last.0).abs() < 1e-8 * last.0, "{row}");
        assert!((mass.standard_deviations.unwrap()[0] - last.1).abs() < 1e-8 * last.1, "{row}");
    }
}

#[test]
fn it_needs_all_rows() {
    let mut plain = filter(NILE, Estimator::Kalman);
    plain.step(None, &[], &[1.0]).unwrap();
    assert_refused(plain.smooth(), "not recorded from the first one on");
    let late = plain.recording();
    assert_refused(late.smooth(), "not recorded from the first one on");
    assert_eq!(filter(NILE, Estimator::Kalman).recording().smooth().unwrap().rows(), 0);
}
