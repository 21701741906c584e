use std::f64::consts::TAU;

use thetahat_numerics::noise::Noise;

use super::*;
use crate::tests::channel;

const RECORDED: f64 = 1e-3;
const STEP: f64 = 0.01;

fn times(count: u32) -> Vec<f64> {
    (0..count).map(|k| f64::from(k) * RECORDED).collect()
}

/// The values of one channel every `STEP`.
fn decimated(time: &[f64], values: Vec<f64>) -> Vec<f64> {
    let how = Resample::new(STEP, Interpolation::Hold);
    Log::resampled(vec![channel("y", values)], time, &how).unwrap().channels()[0].values.clone()
}

#[test]
fn what_the_new_clock_shows_stays_and_the_rest_goes() {
    let time = times(4000);
    // Half the new sampling frequency is 50 Hz.
    for (hertz, gain) in [
        (0.0, 1.0),
        (1.0, 1.0),
        (20.0, 1.0),
        (39.0, 1.0),
        (45.0, 0.5),
        (51.0, 0.0),
        (99.0, 0.0),
        (480.0, 0.0),
    ] {
        let wave = |t: f64| (TAU * hertz * t + 1.0).cos();
        let found = decimated(&time, time.iter().map(|&t| wave(t)).collect());
        assert_eq!(found.len(), 400);
        // In the middle, where the whole filter has samples: no phase, and 60 dB.
        for (k, value) in found.iter().enumerate().take(380).skip(20) {
            let expected = gain * wave(k as f64 * STEP);
            assert!((value - expected).abs() < 1.5e-3, "{hertz} Hz, {k}: {value} {expected}");
        }
    }
}

#[test]
fn a_filter_is_there_for_a_clock_that_is_uniform_and_a_step_of_two_or_more() {
    let filter = |step, time: &[f64]| Resample::new(step, Interpolation::Linear).filter_for(time).unwrap();
    let mut time = times(100);
    assert_eq!(filter(0.0019, &time), None);
    let found = filter(2.0 * RECORDED, &time).unwrap();
    assert_eq!((found.cutoff, found.taps), (0.9 * 250.0, 75));
    assert_eq!(
        Resample { anti_alias: false, ..Resample::new(STEP, Interpolation::Hold) }.filter_for(&time),
        Ok(None)
    );
    // A gap is no matter, a shifted row is.
    time[50..].iter_mut().for_each(|time| *time += 3.0);
    assert!(filter(STEP, &time).is_some());
    time[20] += 0.3 * RECORDED;
    assert_eq!(filter(STEP, &time), None);
}

#[test]
fn nothing_reaches_across_a_gap_and_what_is_missing_has_no_weight() {
    let mut time = times(2000);
    time[1000..].iter_mut().for_each(|time| *time += 0.5);
    // A step from 1 to 5 in the gap, and a line in u.
    let y: Vec<f64> = (0..2000).map(|k| if k < 1000 { 1.0 } else { 5.0 }).collect();
    let found = decimated(&time, y.clone());
    assert_eq!(found.len(), 250);
    for (k, value) in found.iter().enumerate() {
        match k {
            // The last row holds for a step.
            ..101 => assert!((value - 1.0).abs() < 1e-12, "{k}"),
            101..150 => assert!(value.is_nan(), "{k}"),
            _ => assert!((value - 5.0).abs() < 1e-12, "{k}"),
        }
    }
    // Of single missing rows the others make up; a hole as long as a step leaves a hole.
    let time = times(2000);
    let mut noise = Noise(3);
    let y: Vec<f64> = (0..2000)
        .map(|k| if (496..505).contains(&k) || noise.uniform() > 0.8 { f64::NAN } else { 7.0 })
        .collect();
    assert!(y.iter().filter(|value| value.is_nan()).count() > 150);
    let found = decimated(&time, y.clone());
    let missing: Vec<usize> = (0..200).filter(|k| found[*k].is_nan()).collect();
    assert_eq!(missing, [50]);
    assert!(found.iter().filter(|value| !value.is_nan()).all(|value| (value - 7.0).abs() < 1e-12));
    // A row that misses y counts in no channel: all are filtered alike.
    let u: Vec<f64> = (0..2000).map(|k| f64::from(k % 37)).collect();
    let masked = u.iter().zip(&y).map(|(u, y)| if y.is_nan() { f64::NAN } else { *u }).collect();
    let how = Resample::new(STEP, Interpolation::Hold);
    let both = Log::resampled(vec![channel("u", u), channel("y", y)], &time, &how).unwrap();
    let alone = decimated(&time, masked);
    let same = both.channels()[0].values.iter().zip(&alone).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
    assert!(same);
}

#[test]
fn between_two_samples_filtered_values_are_read_as_others_are() {
    let time = times(1000);
    let line: Vec<f64> = time.iter().map(|t| 2.0 * t).collect();
    for (interpolation, late) in [(Interpolation::Linear, 0.0), (Interpolation::Hold, 0.5 * RECORDED)] {
        let how = Resample::new(2.5 * RECORDED, interpolation);
        let log = Log::resampled(vec![channel("y", line.clone())], &time, &how).unwrap();
        // A line stays one where the filter has all of its samples.
        for k in 40..360 {
            let instant = k as f64 * 2.5 * RECORDED - if k % 2 == 1 { late } else { 0.0 };
            assert!((log.channels()[0].values[k] - 2.0 * instant).abs() < 1e-12, "{k}");
        }
    }
}

#[test]
fn without_a_filter_values_are_those_of_the_rows() {
    let time = times(1000);
    let values = Noise(1).take(1000);
    let how = Resample { anti_alias: false, ..Resample::new(STEP, Interpolation::Hold) };
    let log = Log::resampled(vec![channel("y", values.clone())], &time, &how).unwrap();
    let every: Vec<f64> = values.iter().step_by(10).copied().collect();
    assert_eq!(log.channels()[0].values, every);
}

#[test]
fn bessel_is_bessel() {
    // Abramowitz and Stegun, Handbook of Mathematical Functions, table 9.8 (I0 from exp(-x) I0).
    for (x, expected) in [(0.0, 1.0), (1.0, 1.266_065_877_752_008), (5.0, 27.239_871_823_604_44)] {
        assert!((bessel(x) / expected - 1.0).abs() < 1e-14);
    }
}
