extern crate std;
use std::vec::Vec;

use nalgebra::{Vector1, Vector2, Vector3};

use super::{Alarm, ChangeDetector, Chart};
use crate::noise::Noise;
use crate::{Action, Error, Innovation, Real};

fn innovation<T: Real>(error: T, variance: T) -> Innovation<T> {
    Innovation { error, variance, nis: error * error / variance, action: Action::Updated }
}

#[test]
fn the_charts_are_their_equations() {
    let mut detector = ChangeDetector::new(f64::INFINITY, f64::INFINITY).unwrap();
    let (mut up, mut down, mut variance) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut noise = Noise(1);
    for _ in 0..1000 {
        let (z, deviation) = (noise.normal(), 2.0 + noise.next());
        assert_eq!(detector.update(&innovation(z * deviation, deviation * deviation)), None);
        up = (up + z - 0.5).max(0.0);
        down = (down - z - 0.5).max(0.0);
        variance = (variance + (z * z * (1.0 - 1.0 / 2.0) - 2_f64.ln()) / 2.0).max(0.0);
        // Rounding of a hundred additions.
        assert!((detector.statistic(Chart::MeanUp) - up).abs() < 1e-13);
        assert!((detector.statistic(Chart::MeanDown) - down).abs() < 1e-13);
        assert!((detector.statistic(Chart::Variance) - variance).abs() < 1e-13);
    }
}

#[test]
fn an_alarm_tells_the_chart_and_when_it_left_zero() {
    let mut detector = ChangeDetector::new(4.0, 100.0).unwrap();
    let mut feed = |z: f64| detector.update(&innovation(3.0 * z, 9.0));
    // Below the reference value nothing adds up.
    assert!((0..100).all(|_| feed(0.4).is_none()));
    assert!((0..4).all(|_| feed(1.5).is_none()));
    assert_eq!(feed(1.5), Some(Alarm { chart: Chart::MeanUp, statistic: 5.0, samples: 5 }));
    // It starts again from 0.
    assert!((0..4).all(|_| feed(1.5).is_none()));
    assert!(feed(1.5).is_some());
    assert!((0..4).all(|_| feed(-1.5).is_none()));
    assert_eq!(feed(-1.5), Some(Alarm { chart: Chart::MeanDown, statistic: 5.0, samples: 5 }));
}

#[test]
fn a_larger_variance_is_found_and_a_smaller_one_is_not() {
    let mut noise = Noise(2);
    let mut run = |deviation: f64| {
        let mut detector = ChangeDetector::new(f64::INFINITY, 8.0).unwrap();
        (0..1000).find(|_| detector.update(&innovation(deviation * noise.normal(), 1.0)).is_some())
    };
    assert!(run(2.0).is_some_and(|k| k < 40));
    assert_eq!(run(0.9), None);
}

#[test]
fn of_several_charts_the_furthest_is_named_and_all_start_again() {
    let mut detector = ChangeDetector::new(4.0, 2.0).unwrap();
    // g = 9.5 of 4, and (50 - ln 2)/2 = 24.65 of 2.
    let alarm = detector.update(&innovation(10.0, 1.0)).unwrap();
    assert_eq!((alarm.chart, alarm.samples), (Chart::Variance, 1));
    assert_eq!(
        [Chart::MeanUp, Chart::MeanDown, Chart::Variance].map(|chart| detector.statistic(chart)),
        [0.0; 3]
    );
}

#[test]
fn of_a_filter_with_one_output_it_is_the_same_to_the_bit() {
    let (mut one, mut other) =
        (ChangeDetector::new(4.0, 5.0).unwrap(), ChangeDetector::new(4.0, 5.0).unwrap());
    let (mut noise, mut alarms) = (Noise(6), 0);
    for k in 0..2000 {
        let error = if k % 50 == 0 { f64::NAN } else { 1.5 * noise.normal() };
        let Innovation { variance, nis, action, .. } = innovation(error, 1.3);
        let vector = Innovation { error: Vector1::new(error), variance: Vector1::new(variance), nis, action };
        let alarm = one.update(&innovation(error, 1.3));
        assert_eq!(other.update_all(&vector), alarm);
        assert_eq!(one, other);
        alarms += usize::from(alarm.is_some());
    }
    assert!(alarms > 20);
}

#[test]
fn of_several_outputs_it_takes_the_normalised_square() {
    let mut detector = ChangeDetector::new(1.0, f64::INFINITY).unwrap();
    let (mut noise, mut g) = (Noise(7), 0.0_f64);
    for k in 0..1000 {
        let z = Vector3::from_fn(|_, _| noise.normal());
        let measured = k % 4;
        let entry = |row: usize, value: f64| if row < measured { value } else { f64::NAN };
        let nis: f64 = (0..measured).map(|row| z[row] * z[row]).sum();
        let innovation = Innovation {
            error: Vector3::from_fn(|row, _| entry(row, 3.0 * z[row])),
            variance: Vector3::from_fn(|row, _| entry(row, 9.0)),
            nis,
            action: if k % 7 == 0 { Action::Gated } else { Action::Updated },
        };
        assert_eq!(detector.update_all(&innovation), None);
        // The log-likelihood ratio of Gaussian numbers with variances 2 and 1, one after another.
        let ratio = |z: f64| 0.5 * z * z - 0.5 * (z * z / 2.0) - 0.5 * 2.0_f64.ln();
        g = (g + (0..measured).map(|row| ratio(z[row])).sum::<f64>()).max(0.0);
        // Rounding of a hundred additions.
        assert!((detector.statistic(Chart::Variance) - g).abs() < 1e-12);
        assert_eq!(detector.statistic(Chart::MeanUp), 0.0);
    }
    let broken = Innovation {
        error: Vector2::repeat(1.0),
        variance: Vector2::repeat(1.0),
        nis: f64::INFINITY,
        action: Action::Updated,
    };
    let before = detector.clone();
    assert_eq!(detector.update_all(&broken), None);
    assert_eq!(detector, before);
}

#[test]
fn what_is_missing_or_not_known_changes_nothing() {
    let mut detector = ChangeDetector::new(4.0, 4.0).unwrap();
    detector.update(&innovation(1.5, 1.0));
    let before = detector.clone();
    for (error, variance) in [(f64::NAN, 1.0), (1.0, f64::NAN), (1.0, 0.0), (f64::INFINITY, 1.0), (1.0, -1.0)]
    {
        assert_eq!(detector.update(&innovation(error, variance)), None);
        assert_eq!(detector, before);
    }
    detector.reset();
    assert_eq!(detector, ChangeDetector::new(4.0, 4.0).unwrap());
}

/// What cannot be told from infinity by its square does not overflow a chart, on or off.
fn stays_finite<T: Real>() {
    for threshold in [T::from_count(4), T::INFINITY] {
        let mut detector = ChangeDetector::<T>::new(threshold, threshold).unwrap();
        for _ in 0..100 {
            detector.update(&innovation(T::LARGEST_ENTRY, T::MIN_POSITIVE));
            detector.update(&innovation(-T::LARGEST_ENTRY, T::MIN_POSITIVE));
        }
        let charts = [Chart::MeanUp, Chart::MeanDown, Chart::Variance];
        let statistics: Vec<T> = charts.iter().map(|&chart| detector.statistic(chart)).collect();
        assert!(statistics.iter().all(T::is_finite), "{statistics:?}");
    }
}

#[test]
fn the_largest_innovations_do_not_overflow() {
    stays_finite::<f32>();
    stays_finite::<f64>();
}

#[test]
fn thresholds_are_above_zero() {
    let wrong = |argument| Some(Error::OutOfRange { argument, range: "above 0" });
    assert_eq!(ChangeDetector::new(0.0_f32, 1.0).err(), wrong("mean_threshold"));
    assert_eq!(ChangeDetector::new(1.0, f64::NAN).err(), wrong("variance_threshold"));
    assert_eq!(ChangeDetector::new(4.0, 5.0).unwrap().threshold(Chart::MeanDown), 4.0);
    assert_eq!(ChangeDetector::new(4.0, 5.0).unwrap().threshold(Chart::Variance), 5.0);
}
