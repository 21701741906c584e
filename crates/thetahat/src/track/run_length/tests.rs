use thetahat_core::nalgebra::{Matrix2, Matrix3x2, SVector, Vector2, Vector3};
use thetahat_core::{
    Action, Chart, Covariance, Innovation, KalmanFilter, LinearObservation, LinearTransition,
};
use thetahat_numerics::noise::Noise;

use super::*;

#[test]
fn run_lengths_are_those_of_the_tables() {
    // Two-sided, reference value 1/2: Lucas and Crosier, Fast initial response for CUSUM quality-control schemes,
    // Technometrics 24, 1982: 168 and 465, which are half of the one-sided lengths.
    for (threshold, expected) in [(4.0, 168.0), (5.0, 465.0)] {
        let found = average_run_length(threshold, mean) / 2.0;
        assert!((found - expected).abs() < 0.5, "{threshold}: {found}");
    }
    // Siegmund, Sequential Analysis, 1985, section 2.6: b = h + 1.166, L = 2 (exp b - b - 1), good to some percent.
    for threshold in [3.0, 6.0, 9.0, 12.0] {
        let b: f64 = threshold + 1.166;
        let approximation = 2.0 * (b.exp() - b - 1.0);
        assert!((average_run_length(threshold, mean) / approximation - 1.0).abs() < 0.03, "{threshold}");
    }
}

#[test]
fn integrals_are_those_of_the_distributions() {
    let one = |w| variance(w, 1);
    for steps in [&mean as &dyn Fn(f64) -> Steps, &one, &|w| variance(w, 2), &|w| variance(w, 5)] {
        for w in [-0.3466, -0.2, 0.0, 0.7, 2.5] {
            let half = 1e-5;
            let slope = (steps(w + half).integral - steps(w - half).integral) / (2.0 * half);
            // Where the density is infinite the difference is only good to the square root of its width.
            assert!((slope - steps(w).distribution).abs() < if w < -0.3 { 5e-3 } else { 1e-8 }, "{w}");
        }
        assert!((steps(50.0).distribution - 1.0).abs() < 1e-15);
    }
    // P(z^2 < 1) = 0.6827 at w = (1/2 - ln 2)/2.
    assert!((one((0.5 - LN_2) / 2.0).distribution - 0.682_689_492_137).abs() < 1e-10);
}

#[test]
fn thresholds_make_the_intervals_they_are_for() {
    for steps in [&mean as &dyn Fn(f64) -> Steps, &|w| variance(w, 1), &|w| variance(w, 4)] {
        for interval in [20.0, 500.0, 4e4, 4e9] {
            let found = average_run_length(threshold(interval, steps), steps);
            assert!((found / interval - 1.0).abs() < 2.0 * PRECISION, "{interval}: {found}");
        }
    }
}

/// The number of alarms of each chart in this many Gaussian innovations.
fn alarms(detector: &mut ChangeDetector<f64>, samples: usize) -> [f64; 3] {
    let (mut noise, mut alarms) = (Noise(5), [0.0; 3]);
    for _ in 0..samples {
        let error = noise.normal();
        let innovation = Innovation::new(error, 1.0, error * error, Action::Updated);
        let alarm = detector.update(&innovation);
        alarms[0] += f64::from(u8::from(alarm.is_some_and(|alarm| alarm.chart == Chart::MeanUp)));
        alarms[1] += f64::from(u8::from(alarm.is_some_and(|alarm| alarm.chart == Chart::MeanDown)));
        alarms[2] += f64::from(u8::from(alarm.is_some_and(|alarm| alarm.chart == Chart::Variance)));
    }
    alarms
}

#[test]
fn false_alarms_come_as_often_as_asked() {
    let (interval, samples) = (500.0, 1_000_000);
    let found = alarms(&mut change_detector(interval, 1).unwrap(), samples);
    let expected = samples as f64 / interval;
    for (found, share) in found.into_iter().zip([0.25, 0.25, 0.5]) {
        let expected = share * expected;
        // Alarms are nearly a Poisson process: four standard deviations, and 3 % for charts that alarm together.
        assert!((found - expected).abs() < 4.0 * expected.sqrt() + 0.03 * expected, "{found} {expected}");
    }
}

/// The number of alarms that a detector gives of a filter with three sensors of a wandering position and its speed,
/// whose model is right but for the variances of two sensors, which are `factor` times as large. Each measurement is
/// missing in `missing` of 1000 samples.
fn alarms_of_a_filter(detector: &mut ChangeDetector<f64>, samples: usize, factor: f64, missing: u32) -> f64 {
    let diagonal = |entries: [f64; 3]| Covariance::from_diagonal(&entries.into()).unwrap();
    let noise = Covariance::from_diagonal(&Vector2::new(0.0, 0.04)).unwrap();
    let motion = LinearTransition::new(Matrix2::new(0.95, 0.1, 0.0, 0.9), noise).unwrap();
    let rows = Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 1.0, 1.0);
    let variances = [0.5, 0.1, 0.3];
    let sensors = LinearObservation::new(rows, diagonal(variances)).unwrap();
    let prior = Covariance::from_diagonal(&Vector2::new(1.0, 1.0)).unwrap();
    let mut filter = KalmanFilter::new(Vector2::zeros(), prior).unwrap();
    let (mut noise, mut alarms, none) = (Noise(8), 0.0, SVector::zeros());
    let mut state = Vector2::new(noise.normal(), noise.normal());
    for _ in 0..samples {
        let factors = [1.0, factor, factor];
        let error = Vector3::from_fn(|row, _| (variances[row] * factors[row]).sqrt() * noise.normal());
        let measured = (rows * state + error)
            .map(|y| if (noise.uniform() + 1.0) * 500.0 < f64::from(missing) { f64::NAN } else { y });
        let innovation = filter.correct(&sensors, &none, &measured).unwrap();
        alarms += f64::from(u8::from(detector.update_all(&innovation).is_some()));
        filter.predict(&motion, &none).unwrap();
        state = motion.state_matrix() * state + Vector2::new(0.0, 0.2 * noise.normal());
    }
    alarms
}

#[test]
fn false_alarms_of_a_filter_come_as_often_as_asked() {
    let (interval, samples) = (500.0, 300_000);
    let expected = samples as f64 / interval;
    let mut detector = change_detector(interval, 3).unwrap();
    assert_eq!(detector.threshold(Chart::MeanUp), f64::INFINITY);
    let found = alarms_of_a_filter(&mut detector, samples, 1.0, 0);
    // Four standard deviations of a Poisson process.
    assert!((found - expected).abs() < 4.0 * expected.sqrt(), "{found} {expected}");
    // With measurements missing the steps are those of fewer degrees of freedom.
    let found = alarms_of_a_filter(&mut detector, samples, 1.0, 200);
    assert!((found - expected).abs() < 0.3 * expected, "{found} {expected}");
    // Twice the variance of two sensors is found within some samples.
    let found = alarms_of_a_filter(&mut detector, 2_000, 2.0, 0);
    assert!(found > 100.0, "{found}");
}

#[test]
fn the_number_of_outputs_is_checked() {
    for outputs in [0, 1001] {
        assert!(matches!(change_detector(100.0, outputs), Err(Error::Argument { .. })));
    }
    // More outputs tell more of a change, and of chance.
    let threshold = |outputs| change_detector(1e4, outputs).unwrap().threshold(Chart::Variance);
    let thresholds = [2, 3, 10].map(threshold);
    assert!(
        thresholds.iter().all(|&threshold| threshold > 4.0 && threshold < 1e4_f64.ln()),
        "{thresholds:?}"
    );
    // Of a thousand outputs chance alone makes no step above 0 in 10⁴ samples.
    assert!(threshold(1000) > 0.0 && threshold(1000) < 1e-300);
}

#[test]
fn an_interval_that_makes_no_sense_is_refused() {
    for interval in [f64::NAN, 9.0, -1.0, f64::INFINITY, 2e9] {
        assert!(matches!(change_detector(interval, 1), Err(Error::Argument { .. })));
    }
    assert!(change_detector(10.0, 1).is_ok() && change_detector(1e9, 1).is_ok());
}

#[test]
fn toeplitz_systems_are_solved() {
    let mut noise = Noise(3);
    for rows in [1, 2, 7, 40] {
        let mut entries: Vec<f64> = (0..2 * rows - 1).map(|_| noise.uniform() / rows as f64).collect();
        entries[rows - 1] += 2.0;
        let right: Vec<[f64; 3]> = (0..rows).map(|_| [1.0, noise.uniform(), noise.uniform()]).collect();
        let found = toeplitz(&entries, &right);
        for (row, right) in right.iter().enumerate() {
            for (side, right) in right.iter().enumerate() {
                let product: f64 =
                    (0..rows).map(|column| entries[rows - 1 + column - row] * found[column][side]).sum();
                assert!((product - right).abs() < 1e-13, "{rows} {row} {side}: {product} {right}");
            }
        }
    }
}
