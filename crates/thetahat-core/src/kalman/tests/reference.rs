//! Values from elsewhere, and exact ones.

extern crate std;
use std::fs;
use std::vec::Vec;

use nalgebra::{Const, Matrix2, RowVector2, SMatrix, SVector, Vector1, Vector2};

use super::{Filter, NONE, filter, observation, transition};
use crate::noise::Noise;
use crate::textbook::Textbook;
use crate::{KalmanFilter, Real};

const LEVEL_VARIANCE: f64 = 1469.1;
const OBSERVATION_VARIANCE: f64 = 15099.0;

/// A local level on some data: the filtered level and variance after each, and the log-likelihood.
fn local_level(data: &[f64]) -> (Vec<(f64, f64)>, f64) {
    let one = Vector1::new(1.0);
    let level = transition(&one, &Vector1::new(LEVEL_VARIANCE));
    let sensor = observation(&one, &Vector1::new(OBSERVATION_VARIANCE));
    let mut filter: Filter<1> = filter(&Vector1::zeros(), &Vector1::new(1e7));
    let mut log_likelihood = 0.0;
    let step = |(k, &y): (usize, &f64)| {
        if k > 0 {
            filter.predict(&level, &NONE).unwrap();
        }
        log_likelihood += filter.correct(&sensor, &NONE, &Vector1::new(y)).unwrap().log_likelihood();
        (filter.state()[0], filter.covariance().variances()[0])
    };
    let filtered = data.iter().enumerate().map(step).collect();
    (filtered, log_likelihood)
}

#[test]
fn the_local_level_of_the_nile() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/public/nile.csv");
    let text = fs::read_to_string(path).unwrap();
    let second = |line: &str| -> Option<f64> { line.split(',').nth(1)?.trim().parse().ok() };
    let data: Vec<f64> = text.lines().skip(1).filter_map(second).collect();
    assert_eq!(data.len(), 100);
    let (filtered, log_likelihood) = local_level(&data);
    for (k, level, variance) in
        [(1, 1118.311462, 15076.236391), (2, 1140.108439, 7894.557531), (100, 798.370293, 4032.157942)]
    {
        let found = filtered[k - 1];
        assert!((found.0 - level).abs() < 1e-6 && (found.1 - variance).abs() < 1e-6, "{k}: {found:?}");
    }
    assert!((log_likelihood - -641.585578).abs() < 1e-6, "{log_likelihood}");
}

#[test]
fn a_local_level_is_that_of_the_textbook() {
    let mut noise = Noise(1);
    let mut level = 1000.0;
    let data: Vec<f64> = (0..100)
        .map(|_| {
            level += 66.0 * noise.next();
            level + 212.0 * noise.next()
        })
        .collect();
    let (filtered, log_likelihood) = local_level(&data);
    let mut textbook = Textbook { x: Vector1::new(0.0), p: Vector1::new(1e7) };
    let (one, mut sum) = (Vector1::new(1.0), 0.0);
    for (k, (&y, found)) in data.iter().zip(&filtered).enumerate() {
        if k > 0 {
            textbook.predict(&one, &Vector1::zeros(), &Vector1::new(LEVEL_VARIANCE));
        }
        sum += textbook.correct(&one, &Vector1::new(OBSERVATION_VARIANCE), &Vector1::new(y)).1;
        assert!((found.0 - textbook.x[0]).abs() < 1e-9 && (found.1 - textbook.p[0]).abs() < 1e-8, "{k}");
    }
    assert!((log_likelihood - sum).abs() < 1e-9);
}

/// Potter's case: two accurate measurements in almost the same direction.
fn potter<T: Real>() -> KalmanFilter<T, Const<2>> {
    let epsilon = 0.5_f64.powi(13);
    let mut filter = filter(&Vector2::zeros(), &(Matrix2::identity() / (epsilon * epsilon)));
    for row in [RowVector2::new(1.0, epsilon), RowVector2::new(1.0, 1.0)] {
        let sensor = observation::<T, 2, 1>(&row, &Vector1::new(1.0));
        filter.correct(&sensor, &SVector::zeros(), &Vector1::zeros()).unwrap();
    }
    filter
}

#[test]
fn potters_case_in_single_precision() {
    let exact = Matrix2::new(1.00024417, -1.00036624, -1.00036624, 2.00048830);
    assert!((potter::<f64>().covariance().matrix() - exact).amax() < 1e-8);
    let single = potter::<f32>().covariance().matrix().map(f64::from);
    assert!((single - exact).amax() < 1e-6, "{single}");

    // The plain update P - K H P, in the same precision, is no covariance any more.
    let epsilon = 0.5_f32.powi(13);
    let mut plain = Matrix2::<f32>::identity() / (epsilon * epsilon);
    for row in [RowVector2::new(1.0, epsilon), RowVector2::new(1.0, 1.0)] {
        let gain = plain * row.transpose() / ((row * plain * row.transpose())[0] + 1.0);
        plain -= gain * row * plain;
    }
    assert!(plain.determinant() <= 0.0 || plain[(0, 0)] <= 0.0, "{plain}");
}

#[test]
fn the_log_likelihood_is_that_of_all_measurements_together() {
    // x(k+1) = F x + w, y = H x + v: four samples of two elements are eight Gaussian numbers, of known covariance.
    let mut noise = Noise(2);
    let (f, h) = (crate::textbook::stable::<2>(&mut noise, 0.9), crate::textbook::random::<2, 2>(&mut noise));
    let random = crate::textbook::random_covariance::<2>;
    let (p, q, r) = (random(&mut noise), random(&mut noise), random(&mut noise));

    let mut joint = SMatrix::<f64, 8, 8>::zeros();
    let mut variance = p;
    for k in 0..4 {
        let mut cross = variance;
        for later in k..4 {
            let mut block = h * cross * h.transpose();
            joint.fixed_view_mut::<2, 2>(2 * later, 2 * k).copy_from(&block);
            if later == k {
                block += r;
                joint.fixed_view_mut::<2, 2>(2 * k, 2 * k).copy_from(&block);
            } else {
                joint.fixed_view_mut::<2, 2>(2 * k, 2 * later).copy_from(&block.transpose());
            }
            cross = f * cross;
        }
        variance = f * variance * f.transpose() + q;
    }
    let data: SVector<f64, 8> = crate::textbook::random(&mut noise);
    let inverse = crate::textbook::inverse(&joint);
    let exponent = (data.transpose() * inverse * data)[0];
    let determinant = crate::textbook::determinant(&joint);
    let expected = -0.5 * (8.0 * core::f64::consts::TAU.ln() + determinant.ln() + exponent);

    let (model, sensor) = (transition(&f, &q), observation(&h, &r));
    let mut filter: Filter<2> = filter(&Vector2::zeros(), &p);
    let (mut log_likelihood, mut nis) = (0.0, 0.0);
    for k in 0..4 {
        if k > 0 {
            filter.predict(&model, &NONE).unwrap();
        }
        let innovation = filter.correct(&sensor, &NONE, &Vector2::new(data[2 * k], data[2 * k + 1])).unwrap();
        log_likelihood += innovation.log_likelihood();
        nis += innovation.nis;
    }
    assert!((log_likelihood - expected).abs() < 1e-12, "{log_likelihood} {expected}");
    assert!((nis - exponent).abs() < 1e-12);
}
