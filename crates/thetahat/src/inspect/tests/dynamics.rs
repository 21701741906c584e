//! Excitation, delay and feedback against definitions, and how often they are right.

use super::*;

#[test]
fn noise_and_no_drift_is_rest() {
    let u = [vec![0.0; 50], vec![1.0; 350]].concat();
    let x = divided(&[-0.95], &late(&u, 1));
    let noisy = sum_of(&x, 0.3, &normal(3, 400));
    assert_eq!(rest::rest(&[&u], &noisy, &whole(&u)), Some(50));
    let drifting = [(0..50).map(|row| 0.1 * f64::from(row) - 5.0).collect(), noisy[50..].to_vec()].concat();
    assert_eq!(rest::rest(&[&u], &drifting, &whole(&u)), None);
}
use crate::regression::Lagged;

fn order(values: &[f64]) -> usize {
    excitation::excitation("u", values, &whole(values), 1.0).order
}

fn sines(count: usize, samples: usize) -> Vec<f64> {
    let at = |t: usize| {
        (0..count).map(|k| ((0.2 + 2.8 * k as f64 / count as f64) * t as f64 + k as f64).sin()).sum()
    };
    (0..samples).map(at).collect()
}

#[test]
fn a_sum_of_sinusoids_excites_twice_their_number() {
    for count in [1, 2, 3, 7, 20] {
        let values = sines(count, 500);
        assert_eq!(order(&values), 2 * count);
        // The mean does not count, nor does the size.
        assert_eq!(order(&values.iter().map(|x| 50.0 + x).collect::<Vec<_>>()), 2 * count);
        assert_eq!(order(&values.iter().map(|x| 1e300 * x).collect::<Vec<_>>()), 2 * count);
    }
    // Three digits of a measurement.
    let rounded: Vec<f64> = sines(1, 500).iter().map(|x| (1e3 * x).round() / 1e3).collect();
    assert_eq!(order(&rounded), 2);
}

#[test]
fn noise_excites_all_and_a_constant_nothing() {
    for values in [normal(1, 500), telegraph(2, 2000, 0.3), divided(&[-0.99], &normal(3, 1000))] {
        assert_eq!(order(&values), 50);
    }
    assert_eq!(order(&[0.1; 300]), 0);
    // A step is seen once.
    assert_eq!(order(&[vec![0.0; 100], vec![1.0; 100]].concat()), 1);
    // A period of eight different values.
    assert_eq!(order(&(0..400).map(|t| f64::from(t * t * t % 8 + t % 8)).collect::<Vec<_>>()), 7);
}

#[test]
fn a_short_or_broken_record_has_a_lower_highest_order() {
    let values = normal(4, 600);
    let of = |segments: &[Range<usize>]| {
        let found = excitation::excitation("u", &values, segments, 1.0);
        (found.order, found.highest)
    };
    assert_eq!(of(&one(0..100)), (25, 25));
    let broken: Vec<Range<usize>> = (0..30).map(|part| 20 * part..20 * part + 19).collect();
    assert_eq!(of(&broken), (10, 10));
    assert_eq!(of(&one(0..3)), (0, 0));
    assert_eq!(of(&[]), (0, 0));
    let broken = sines(1, 600);
    let segments: Vec<Range<usize>> = (0..30).map(|part| 20 * part..20 * part + 19).collect();
    assert_eq!(excitation::excitation("u", &broken, &segments, 1.0).order, 2);
}

#[test]
fn an_input_is_the_same_but_for_scale_and_offset() {
    let (u, other) = (normal(9, 200), normal(10, 200));
    let same = |left: &[f64], right: &[f64]| excitation::are_the_same(left, right, &whole(left));
    assert!(same(&u, &u) && same(&u, &u.iter().map(|x| 7.0 - 3.0 * x).collect::<Vec<_>>()));
    assert!(!same(&u, &other) && !same(&u, &sum_of(&u, 1e-6, &other)) && !same(&u, &late(&u, 1)));
    assert!(!same(&u, &[7.0; 200]) && !same(&[7.0; 200], &u) && !same(&[7.0; 200], &[7.0; 200]));
}

#[test]
fn changes_are_counted_inside_segments() {
    let values = [0.0, 1.0, 1.0, 2.0, 5.0, 5.0];
    let found = excitation::excitation("u", &values, &[0..3, 3..6], 1.0);
    assert_eq!(found.changes, 0.5);
}

/// The trapezoidal rule.
fn integral(spectrum: &[SpectrumPoint]) -> f64 {
    let area = |pair: &[SpectrumPoint]| {
        (pair[1].frequency - pair[0].frequency) * 0.5 * (pair[0].density + pair[1].density)
    };
    spectrum.windows(2).map(area).sum()
}

#[test]
fn the_spectrum_is_that_of_its_definition() {
    let values = normal(5, 90);
    let (segments, step) = ([0..40, 42..90], 0.25);
    let found = spectrum::spectrum(&values, &segments, 3.0, step);
    // Windows of 16 that overlap by half: four and five.
    let starts: Vec<usize> = (0..=24).step_by(8).chain((42..=74).step_by(8)).collect();
    let hann = |t: usize| 0.5 - 0.5 * (2.0 * PI * t as f64 / 16.0).cos();
    let weight: f64 = (0..16).map(|t| hann(t).powi(2)).sum();
    assert_eq!(found.len(), 9);
    let mut square = 0.0;
    for (k, point) in found.iter().enumerate() {
        assert!((point.frequency - 2.0 * PI * k as f64 / (16.0 * step)).abs() < 1e-12);
        let mut power = 0.0;
        for start in &starts {
            let (mut re, mut im) = (0.0, 0.0);
            for t in 0..16 {
                let (sin, cos) = (2.0 * PI * (k * t) as f64 / 16.0).sin_cos();
                re += hann(t) * values[start + t] * cos;
                im += hann(t) * values[start + t] * sin;
            }
            power += re * re + im * im;
        }
        let expected = 9.0 * step / PI * power / weight / starts.len() as f64;
        assert!((point.density - expected).abs() < 1e-12 * expected.max(1.0), "{k}");
    }
    // Parseval: the integral is the variance of the windowed samples.
    for start in &starts {
        square += (0..16).map(|t| (hann(t) * values[start + t]).powi(2)).sum::<f64>();
    }
    let variance = 9.0 * square / weight / starts.len() as f64;
    assert!((integral(&found) / variance - 1.0).abs() < 1e-12);
}

#[test]
fn the_spectrum_integrates_to_the_variance() {
    let values: Vec<f64> = divided(&[-0.8], &normal(6, 20_000)).iter().map(|x| 100.0 + 5.0 * x).collect();
    let found = excitation::excitation("u", &values, &whole(&values), 0.01);
    let deviation = quality(values).standard_deviation.unwrap();
    assert_eq!(found.spectrum.len(), 513);
    assert!((found.spectrum[512].frequency - PI / 0.01).abs() < 1e-9);
    // Of 20,000 samples the windows see the middle once more than the ends.
    assert!((integral(&found.spectrum) / deviation.powi(2) - 1.0).abs() < 0.02);
    // A first-order process: sigma^2 T/pi / |1 - 0.8 exp(-iwT)|^2, here at w = 0.
    let low: f64 = found.spectrum[1..9].iter().map(|point| point.density).sum::<f64>() / 8.0;
    assert!((low / (25.0 * 0.01 / PI / 0.04) - 1.0).abs() < 0.3, "{low}");
    // Squares beyond the range of numbers.
    let huge: Vec<f64> = normal(6, 100).iter().map(|x| 1e300 * x).collect();
    let found = excitation::excitation("u", &huge, &whole(&huge), 1.0);
    assert!(found.spectrum.is_empty() && found.order == 25);
}

#[test]
fn an_autoregression_is_least_squares() {
    let signal = deviations(&divided(&[-1.5, 0.7], &normal(7, 800)));
    let monic = whitening::autoregression(&signal, &[0..300, 310..800]);
    assert_eq!(monic.len(), 3);
    assert!((monic[1] + 1.5).abs() < 0.1 && (monic[2] - 0.7).abs() < 0.1);
    // The same samples for all orders: those with 30 before them.
    let segments = [28..300, 338..800];
    let taps = vec![Taps { signal: 0, first: 1, count: 2, sign: -1.0 }];
    let solved = Lagged::new(&[&signal], taps, &segments, Presample::Drop).solve().unwrap();
    assert!((monic[1] - solved.parameters[0]).abs() < 1e-12);
    assert!((monic[2] - solved.parameters[1]).abs() < 1e-12);
    let filtered = whitening::filtered(&monic, &signal, &[0..300, 310..800]);
    assert_eq!(filtered[..2], [0.0, 0.0]);
    assert_eq!((filtered[305], filtered[311]), (0.0, 0.0));
    for t in [2, 299, 312, 799] {
        let expected = signal[t] + monic[1] * signal[t - 1] + monic[2] * signal[t - 2];
        assert!((filtered[t] - expected).abs() < 1e-15);
    }
    assert_eq!(whitening::autoregression(&deviations(&normal(8, 500)), &one(0..500)), [1.0]);
    // Two sinusoids, and their mean, leave nothing behind order 5.
    assert!(whitening::autoregression(&deviations(&sines(2, 500)), &one(0..500)).len() <= 6);
}

fn delay_of(input: &[f64], output: &[f64]) -> DelayEstimate {
    delay::delay("u", &deviations(input), &deviations(output), &whole(input))
}

#[test]
fn the_delay_is_the_first_lag_with_an_effect() {
    // N = 1000, noise of 10 %.
    for (seed, nk) in [(1, 0), (2, 1), (3, 4), (4, 9)] {
        for (name, u) in [
            ("white", normal(seed, 1000)),
            ("binary", telegraph(seed, 1000, 0.2)),
            ("slow", divided(&[-0.9], &normal(seed, 1000))),
        ] {
            let clean = divided(&[-1.5, 0.7], &sum_of(&late(&u, nk), 0.5, &late(&u, nk + 1)));
            let noise = divided(&[-1.5, 0.7], &normal(seed + 100, 1000));
            let size = (sum_of_squares(&clean) / sum_of_squares(&noise)).sqrt();
            let found = delay_of(&u, &sum_of(&clean, 0.1 * size, &noise));
            assert_eq!(found.nk, Some(nk), "{name}");
            assert!(found.confidence.unwrap() > 0.99 && found.correlation.len() == 51);
            // N less the samples that the filters need.
            assert!((found.band * 1000.0_f64.sqrt() - 1.96).abs() < 0.05);
        }
    }
}

#[test]
fn a_correlation_is_that_of_its_definition() {
    let (u, y) = (deviations(&normal(11, 100)), deviations(&normal(12, 100)));
    // White both: the filters do nothing. Two stretches, which no product crosses.
    let segments = [0..60, 65..100];
    let found = delay::delay("u", &u, &y, &segments);
    let inside = |x: &[f64]| segments.iter().flat_map(|s| x[s.clone()].to_vec()).map(|x| x * x).sum::<f64>();
    for (lag, r) in found.correlation.iter().enumerate() {
        let products = |s: &Range<usize>| (s.start + lag..s.end).map(|t| u[t - lag] * y[t]).sum::<f64>();
        let expected = segments.iter().map(products).sum::<f64>() / (inside(&u) * inside(&y)).sqrt();
        assert!((r - expected).abs() < 1e-14, "{lag}");
    }
    assert_eq!(found.correlation.len(), 10);
    assert!((found.band - 1.959_963_984_540_054 / 95.0_f64.sqrt()).abs() < 1e-15);
}

#[test]
fn without_a_relation_there_is_no_delay() {
    // One of a hundred records has one by chance.
    let found = (0..60).filter(|&seed| {
        let u = divided(&[-0.9], &normal(seed, 300));
        let y = divided(&[-1.8, 0.82], &normal(seed + 1000, 300));
        delay_of(&u, &y).nk.is_some()
    });
    assert!(found.count() <= 3);
    for (u, y) in [
        (vec![1.0; 300], normal(1, 300)),
        (normal(1, 300), vec![1.0; 300]),
        // What its past determines cannot be found again.
        (sines(2, 300), late(&sines(2, 300), 3)),
        (normal(1, 5), normal(2, 5)),
    ] {
        let found = delay_of(&u, &y);
        assert_eq!((found.nk, found.confidence), (None, None));
        assert!(found.correlation.iter().all(|r| r.is_finite()) && found.band.is_finite());
    }
}

#[test]
fn the_confidence_is_that_of_the_most_of_all_lags() {
    let u = normal(21, 400);
    let found = delay_of(&u, &sum_of(&normal(22, 400), 0.25, &late(&u, 2)));
    assert_eq!(found.nk, Some(2));
    let z = found.correlation[2].abs() * 400.0_f64.sqrt();
    // The normal tail by integration; 41 lags.
    let steps = 200_000;
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * PI).sqrt();
    let tail: f64 = (0..steps)
        .map(|k| density(z + 8.0 * (f64::from(k) + 0.5) / f64::from(steps)) * 8.0 / f64::from(steps))
        .sum();
    assert!((found.confidence.unwrap() - (1.0 - 41.0 * 2.0 * tail)).abs() < 1e-8);
}

fn p_value(input: &[f64], output: &[f64]) -> Option<f64> {
    feedback::feedback(&[deviations(input)], &deviations(output), &whole(input))[0]
}

/// y = 0.9 y(t-1) + 0.5 u(t-1) + e under u = gain (r - y), which sees y of the same row or of the one before.
fn loop_of(seed: u64, samples: usize, gain: f64, past: usize, noise: f64) -> (Vec<f64>, Vec<f64>) {
    let (r, e) = (telegraph(seed, samples, 0.3), normal(seed + 500, samples));
    let (mut u, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for t in 0..samples {
        let before = |signal: &[f64]| signal.last().copied().unwrap_or(0.0);
        y.push(0.9 * before(&y) + 0.5 * before(&u) + noise * e[t]);
        u.push(gain * (r[t] - if t >= past { y[t - past] } else { 0.0 }));
    }
    (u, y)
}

#[test]
fn a_closed_loop_is_found() {
    for seed in 0..10 {
        for (gain, past, noise) in [(0.5, 0, 0.3), (0.5, 0, 0.1), (0.5, 1, 0.3), (1.0, 0, 1.0), (0.2, 1, 0.3)]
        {
            let (u, y) = loop_of(seed, 1000, gain, past, noise);
            assert!(p_value(&u, &y).unwrap() < 0.01, "seed {seed}, gain {gain}, past {past}, noise {noise}");
        }
    }
}

#[test]
fn an_open_loop_is_not() {
    // One of a hundred is found by chance; half of the p-values are below 0.5. Also where the input acts at once, and the
    // noise is slow: the b of the model are then differences of the impulse response.
    for direct in [0.0, 1.0] {
        let p_values: Vec<f64> = (0..70)
            .map(|seed| {
                let u = normal(seed, 400);
                let drive = sum_of(&late(&u, 1), direct, &u);
                let slow = divided(&[-0.99], &normal(seed + 900, 400));
                p_value(&u, &sum_of(&divided(&[-0.8], &drive), 0.5, &slow)).unwrap()
            })
            .collect();
        assert!(p_values.iter().filter(|p| **p < 0.01).count() <= 3, "{direct}");
        assert!(p_values.iter().filter(|p| **p < 0.5).count() <= 48, "{direct}");
    }
}

#[test]
fn the_tests_are_those_of_plain_regressions() {
    use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};
    use thetahat_core::nalgebra::{DMatrix, DVector};

    /// Parameters, their standard errors, and residuals, from normal equations.
    fn regression(rows: &[Vec<f64>], target: &[f64]) -> (DVector<f64>, DVector<f64>, DVector<f64>) {
        let x = DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
        let inverse = (x.transpose() * &x).try_inverse().unwrap();
        let target = DVector::from_column_slice(target);
        let theta = &inverse * (x.transpose() * &target);
        let left = target - &x * &theta;
        let variance = left.norm_squared() / (rows.len() - rows[0].len()) as f64;
        (theta, inverse.diagonal().map(|entry| (variance * entry).sqrt()), left)
    }

    let samples = 300;
    for effect in [0.0, 1.0, -1.0] {
        let (e, w) = (normal(31, samples), divided(&[-0.5], &normal(32, samples)));
        let u = sum_of(&w, 0.1, &late(&e, 1));
        let y = sum_of(&e, effect, &divided(&[-0.5], &late(&u, 1)));
        let (u, y) = (deviations(&u), deviations(&y));
        let found = feedback::feedback(std::slice::from_ref(&u), &y, &whole(&u))[0].unwrap();

        let row =
            |t: usize| -> Vec<f64> { (1..=10).map(|k| y[t - k]).chain((0..=10).map(|k| u[t - k])).collect() };
        let times = 10..samples;
        let (theta, error, e) = regression(&times.map(row).collect::<Vec<_>>(), &y[10..]);
        let now = Normal::standard().cdf(theta[10] / error[10] * effect);

        let own = |t: usize| (1..=10).map(|k| u[t - k]).collect::<Vec<f64>>();
        let both = |t: usize| [own(t), (1..=5).map(|k| e[t - 10 - k]).collect()].concat();
        let times = 20..samples;
        let (_, _, restricted) = regression(&times.clone().map(own).collect::<Vec<_>>(), &u[20..]);
        let (_, _, full) = regression(&times.map(both).collect::<Vec<_>>(), &u[20..]);
        let (restricted, full) = (restricted.norm_squared(), full.norm_squared());
        let free = (samples - 20 - 15) as f64;
        let past = FisherSnedecor::new(5.0, free).unwrap().sf((restricted - full) / 5.0 / (full / free));

        // A plant without effect has no sign.
        let least = past.min(now);
        let expected = if effect == 0.0 { past } else { 1.0 - (1.0 - least) * (1.0 - least) };
        assert!((found / expected - 1.0).abs() < 1e-9, "{effect}: {found} {expected}");
    }
}

#[test]
fn where_feedback_cannot_be_said_there_is_none() {
    let u = normal(41, 300);
    // No noise; no samples; constants; an input that its past determines.
    assert_eq!(p_value(&u, &divided(&[-0.5], &late(&u, 1))), None);
    assert_eq!(p_value(&u[..20], &normal(42, 20)), None);
    assert_eq!(p_value(&[3.0; 300], &normal(42, 300)), None);
    assert_eq!(p_value(&u, &[3.0; 300]), None);
    assert_eq!(p_value(&sines(2, 300), &normal(42, 300)), None);
    // A constant input beside a good one does not spoil it.
    let inputs = [vec![0.0; 300], deviations(&u)];
    let both = feedback::feedback(&inputs, &deviations(&normal(42, 300)), &one(0..300));
    assert!(both[0].is_none() && both[1].is_some());
}
