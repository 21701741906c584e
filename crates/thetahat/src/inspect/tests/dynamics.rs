//! Excitation, delay and feedback against definitions, and how often they are right.

use thetahat_numerics::regression::Lagged;

use super::*;
use crate::tests::channel;

#[test]
fn noise_and_no_drift_is_rest() {
    let u = [vec![0.0; 50], vec![1.0; 350]].concat();
    let x = divided(&[-0.95], &late(&u, 1));
    let noisy = sum_of(&x, 0.3, &normal(3, 400));
    assert_eq!(rest::rest(&[&u], &noisy, &whole(&u)), Some(50));
    let drifting = [(0..50).map(|row| 0.1 * f64::from(row) - 5.0).collect(), noisy[50..].to_vec()].concat();
    assert_eq!(rest::rest(&[&u], &drifting, &whole(&u)), None);
    // Noise that begins after a rest is no step.
    let moving = [vec![0.0; 50], normal(9, 150)].concat();
    assert_eq!(rest::rest(&[&moving], &noisy, &whole(&moving)), None);
}

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

fn correlation_of(input: &[f64], output: &[f64]) -> DelayEstimate {
    delay::correlation("u", &deviations(input), &deviations(output), &whole(input))
}

fn delay_of(input: &[f64], output: &[f64]) -> DelayEstimate {
    let mut found = [correlation_of(input, output)];
    delay::estimate(&mut found, &[deviations(input)], &deviations(output), &whole(input), &[false]).unwrap();
    let [found] = found;
    found
}

#[test]
fn the_delay_is_found() {
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
            assert!(
                found.confidence.unwrap() > 0.9 && found.correlation.len() == 51,
                "{name} {nk} {found:?}"
            );
            // N less the samples that the filters need.
            assert!((found.band * 1000.0_f64.sqrt() - 1.96).abs() < 0.05);
        }
    }
}

/// Of the delays with a confidence of 0.9 or more: the fraction that is right, and the fraction of all delays that they
/// are.
#[test]
fn a_sure_delay_is_right() {
    let (mut sure, mut right, mut all) = (0.0, 0.0, 0.0);
    for samples in [200, 1000] {
        for nk in 0..6 {
            for (kind, poles) in [&[-0.8][..], &[-0.95], &[-1.5, 0.7], &[-1.6, 0.63]].into_iter().enumerate()
            {
                for slow in [&[-0.9][..], &[-0.98], &[-1.8, 0.81]] {
                    let seed = 1000 * nk as u64 + 10 * kind as u64 + slow.len() as u64 + samples as u64;
                    let u = divided(slow, &normal(seed, samples));
                    let clean = divided(poles, &sum_of(&late(&u, nk), 0.5, &late(&u, nk + 1)));
                    let noise = divided(poles, &normal(seed + 500, samples));
                    let size = (sum_of_squares(&clean) / sum_of_squares(&noise)).sqrt();
                    let found = delay_of(&u, &sum_of(&clean, 0.1 * size, &noise));
                    all += 1.0;
                    if found.confidence.is_some_and(|confidence| confidence >= 0.9) {
                        sure += 1.0;
                        right += if found.nk == Some(nk) { 1.0 } else { 0.0 };
                    }
                }
            }
        }
    }
    assert!(right >= 0.85 * sure && sure >= 0.4 * all, "{right} right of {sure} sure of {all}");
}

#[test]
fn a_correlation_is_that_of_its_definition() {
    let (u, y) = (deviations(&normal(11, 100)), deviations(&normal(12, 100)));
    // White both: the filters do nothing. Two segments, which no product crosses.
    let segments = [0..60, 65..100];
    let found = delay::correlation("u", &u, &y, &segments);
    let inside = |x: &[f64]| segments.iter().flat_map(|s| x[s.clone()].to_vec()).map(|x| x * x).sum::<f64>();
    for (lag, r) in found.correlation.iter().enumerate() {
        let products = |s: &Range<usize>| (s.start + lag..s.end).map(|t| u[t - lag] * y[t]).sum::<f64>();
        let expected = segments.iter().map(products).sum::<f64>() / (inside(&u) * inside(&y)).sqrt();
        assert!((r - expected).abs() < 1e-14, "{lag}");
    }
    for (lag, r) in found.following.iter().enumerate().map(|(place, r)| (place + 1, r)) {
        let products = |s: &Range<usize>| (s.start + lag..s.end).map(|t| y[t - lag] * u[t]).sum::<f64>();
        let expected = segments.iter().map(products).sum::<f64>() / (inside(&u) * inside(&y)).sqrt();
        assert!((r - expected).abs() < 1e-14, "{lag}");
    }
    assert_eq!((found.correlation.len(), found.following.len()), (10, 9));
    assert!((found.band - 1.959_963_984_540_054 / 95.0_f64.sqrt()).abs() < 1e-15);
}

/// 95 % of the lags at which the input follows nothing are in the band, whatever the colours; a controller is not.
#[test]
fn what_follows_the_output_is_outside_of_the_band() {
    let (mut outside, mut all) = (0, 0);
    for seed in 0..40 {
        let u = divided(&[-0.9], &normal(seed, 1000));
        let y = sum_of(&late(&u, 2), 2.0, &divided(&[-1.6, 0.7], &normal(seed + 1000, 1000)));
        let found = correlation_of(&u, &y);
        outside += found.following.iter().filter(|r| r.abs() > found.band).count();
        all += found.following.len();
    }
    assert!(
        (0.03..0.07).contains(&(f64::from(u32::try_from(outside).unwrap()) / all as f64)),
        "{outside} of {all}"
    );
    let (r, e) = (normal(5, 1000), normal(6, 1000));
    let (mut u, mut y) = (vec![0.0; 1000], vec![0.0; 1000]);
    for t in 3..1000 {
        y[t] = 0.8 * y[t - 1] + 0.5 * u[t - 1] + e[t];
        u[t] = r[t] - 0.8 * y[t - 3];
    }
    let found = correlation_of(&u, &y);
    assert!(found.following[2] < -5.0 * found.band, "{:?}", found.following);
    assert!(found.following[..2].iter().all(|r| r.abs() < 2.0 * found.band), "{:?}", found.following);
}

/// The response of all inputs together, which a correlation of one with the output is not.
#[test]
fn the_impulse_responses_are_those_of_the_plant() {
    let (one, e) = (normal(7, 2000), normal(8, 2000));
    let other = sum_of(&late(&one, 1), 0.5, &normal(9, 2000));
    let y = sum_of(&sum_of(&late(&one, 2), -1.0, &late(&other, 4)), 0.1, &e);
    let scaled = |values: &[f64]| -> Vec<f64> { values.iter().map(|value| 30.0 + 7.0 * value).collect() };
    let channels = vec![channel("one", one), channel("other", scaled(&other)), channel("y", y)];
    let plan = InspectionPlan {
        inputs: vec!["one".into(), "other".into()],
        output: Some("y".into()),
        resample: None,
    };
    let recording = Recording { channels, times: Times::Uniform(1.0) };
    let found = documents::inspected(recording, &plan);
    for (input, (delay, gain)) in [(2, 1.0), (4, -1.0 / 7.0)].into_iter().enumerate() {
        let of = &found.delays[input];
        assert_eq!((of.impulse_response.len(), of.impulse_response_errors.len()), (51, 51));
        for (lag, value) in of.impulse_response.iter().enumerate() {
            let expected = if lag == delay { gain } else { 0.0 };
            assert!((value - expected).abs() < 0.02, "{input} {lag} {value}");
        }
        assert!((0.001..0.01).contains(&(of.impulse_response_errors[delay] / gain.abs())));
    }
}

#[test]
fn without_a_relation_there_is_no_delay() {
    let found = (0..60).filter(|&seed| {
        let u = divided(&[-0.9], &normal(seed, 300));
        let y = divided(&[-1.8, 0.82], &normal(seed + 1000, 300));
        delay_of(&u, &y).confidence.is_some_and(|confidence| confidence >= 0.9)
    });
    assert_eq!(found.count(), 0);
    for (u, y) in
        [(vec![1.0; 300], normal(1, 300)), (normal(1, 300), vec![1.0; 300]), (normal(1, 5), normal(2, 5))]
    {
        let found = delay_of(&u, &y);
        assert_eq!((found.nk, found.confidence), (None, None));
        assert!(found.correlation.iter().all(|r| r.is_finite()) && found.band.is_finite());
    }
}

fn feedback_of(input: &[f64], output: &[f64]) -> Option<crate::validate::feedback::Feedback> {
    feedback(&[input], output, &whole(input)).inputs[0]
}

fn is_suspected(input: &[f64], output: &[f64]) -> bool {
    feedback_of(input, output).is_some_and(|found| found.is_suspected())
}

/// y = 0.9 y(t-1) + 0.5 u(t-1) + e under u = gain (r - y), which sees y of the same row or of the one before.
fn loop_of(r: &[f64], seed: u64, gain: f64, past: usize, noise: f64) -> (Vec<f64>, Vec<f64>) {
    let e = normal(seed + 500, r.len());
    let (mut u, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for t in 0..r.len() {
        let before = |signal: &[f64]| signal.last().copied().unwrap_or(0.0);
        y.push(0.9 * before(&y) + 0.5 * before(&u) + noise * e[t]);
        u.push(gain * (r[t] - if t >= past { y[t - past] } else { 0.0 }));
    }
    (u, y)
}

#[test]
fn a_closed_loop_is_found() {
    for seed in 0..10 {
        for (gain, past, noise) in [(0.5, 0, 0.3), (0.5, 1, 0.3), (1.0, 0, 1.0), (0.2, 1, 0.3)] {
            let (u, y) = loop_of(&telegraph(seed, 1000, 0.3), seed, gain, past, noise);
            assert!(is_suspected(&u, &y), "seed {seed}, gain {gain}, past {past}, noise {noise}");
        }
        // Rare steps of the set-point are all that a sum of squares would see.
        let (u, y) = loop_of(&telegraph(seed, 1000, 0.02), seed, 0.5, 1, 0.05);
        assert!(is_suspected(&u, &y), "seed {seed}");
    }
}

#[test]
fn an_open_loop_is_not() {
    let slow = |seed: u64| divided(&[-0.9], &normal(seed, 600));
    let held = |seed: u64| telegraph(seed, 600, 0.05);
    let periodic = |seed: u64| -> Vec<f64> {
        let phases = normal(seed, 12);
        let at = |t: usize| {
            let wave =
                |(k, phase): (usize, &f64)| ((k + 1) as f64 * t as f64 * PI / 60.0 + 6.0 * phase).cos();
            phases.iter().enumerate().map(wave).sum::<f64>() / 12.0_f64.sqrt()
        };
        (0..600).map(at).collect()
    };
    let bent = |x: &[f64]| x.iter().map(|x| (1.5 * x).tanh()).collect::<Vec<f64>>();
    let (mut suspected, mut all) = (0, 0);
    for seed in 0..12 {
        for u in [normal(seed, 600), slow(seed), held(seed), periodic(seed)] {
            let linear = divided(&[-1.5, 0.7], &late(&u, 1));
            // At once, and the other way first, as a boost converter does.
            let inverse = sum_of(&linear, -0.5, &u);
            let cubes: Vec<f64> = u.iter().map(|u| u * u * u).collect();
            for y in [linear.clone(), inverse, bent(&linear), divided(&[-0.8], &late(&cubes, 1))] {
                let size = 0.01 * (sum_of_squares(&y) / 600.0).sqrt();
                all += 1;
                suspected += usize::from(is_suspected(&u, &sum_of(&y, size, &normal(seed + 900, 600))));
            }
        }
    }
    assert!(100 * suspected <= 2 * all, "{suspected} of {all}");
}

#[test]
fn the_test_is_that_of_plain_regressions() {
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    use thetahat_core::nalgebra::{DMatrix, DVector};

    /// Parameters and residuals, from normal equations.
    fn regression(rows: &[Vec<f64>], target: &[f64]) -> (DVector<f64>, Vec<f64>) {
        let x = DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
        let target = DVector::from_column_slice(target);
        let theta = (x.transpose() * &x).try_inverse().unwrap() * (x.transpose() * &target);
        let left = &target - &x * &theta;
        (theta, left.as_slice().to_vec())
    }

    let samples = 300;
    let e = normal(31, samples);
    let u = sum_of(&divided(&[-0.5], &normal(32, samples)), 0.1, &late(&e, 1));
    let y = sum_of(&e, 1.0, &divided(&[-0.5], &late(&u, 1)));
    let (u, y) = (deviations(&u), deviations(&y));
    let found = feedback_of(&u, &y).unwrap();

    let row =
        |t: usize| -> Vec<f64> { (1..=10).map(|k| y[t - k]).chain((0..=10).map(|k| u[t - k])).collect() };
    let (_, e) = regression(&(10..samples).map(row).collect::<Vec<_>>(), &y[10..]);
    // The mean of the rows that have innovations is taken off again.
    let mean = u[10..].iter().sum::<f64>() / 290.0;
    let u: Vec<f64> = u[10..].iter().map(|u| u - mean).collect();
    // One past value for 20 of 290 samples.
    let times = || 14..samples - 10;
    let past: Vec<Vec<f64>> = times().map(|t| (1..=14).map(|k| u[t - k]).collect()).collect();
    let left = |signal: Vec<f64>| regression(&past, &signal).1;
    let w = left(times().map(|t| u[t]).collect());
    let z: Vec<Vec<f64>> = (1..=5).map(|k| left(times().map(|t| e[t - k]).collect())).collect();
    // Pseudo-values.
    let (mut new, mut bounded) = (w, Vec::new());
    for _ in 0..4 {
        let mut sizes: Vec<f64> = new.iter().map(|w| w.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let bound = 2.0 * 1.482_602_218_505_602 * sizes[new.len() / 2];
        bounded = new.iter().map(|w| w.clamp(-bound, bound)).collect();
        let target = times().zip(&new).zip(&bounded).map(|((t, w), psi)| u[t] - w + psi).collect();
        let change = left(target);
        new = new.iter().zip(&bounded).zip(&change).map(|((w, psi), left)| w - psi + left).collect();
    }
    let bounded = left(bounded);
    let rows: Vec<Vec<f64>> = (0..bounded.len()).map(|t| z.iter().map(|z| z[t]).collect()).collect();
    let (d, rest) = regression(&rows, &bounded);
    let matrix = |weights: &dyn Fn(usize) -> f64, range: Range<usize>| {
        DMatrix::from_fn(5, 5, |i, j| {
            range.clone().map(|t| weights(t) * rows[t][i] * rows[t][j]).sum::<f64>()
        })
    };
    let count = bounded.len();
    let (g, m) = (matrix(&|_| 1.0, 0..count), matrix(&|t| rest[t] * rest[t], 0..count));
    let m = m * count as f64 / (count - 19) as f64;
    let statistic = (&g * &d).dot(&(m.try_inverse().unwrap() * (&g * &d)));
    let p_value = ChiSquared::new(5.0).unwrap().sf(statistic);
    assert!((found.p_value / p_value - 1.0).abs() < 1e-6, "{} {p_value}", found.p_value);
    let part = |part: usize| -> f64 {
        let inside = |t: &usize| t * 5 / count == part;
        let others: Vec<usize> = (0..count).filter(|t| !inside(t)).collect();
        let target: Vec<f64> = others.iter().map(|&t| bounded[t]).collect();
        let (d, _) = regression(&others.iter().map(|&t| rows[t].clone()).collect::<Vec<_>>(), &target);
        let gain = |t: usize| {
            let predicted: f64 = rows[t].iter().zip(d.iter()).map(|(z, d)| z * d).sum();
            bounded[t].powi(2) - (bounded[t] - predicted).powi(2)
        };
        (0..count).filter(inside).map(gain).sum()
    };
    let explained = (0..5).map(part).sum::<f64>() / bounded.iter().map(|psi| psi * psi).sum::<f64>();
    assert!((found.explained - explained).abs() < 1e-9, "{} {explained}", found.explained);
}

#[test]
fn where_feedback_cannot_be_said_there_is_none() {
    let u = normal(41, 300);
    // No noise; no samples; constants; an input that its past determines.
    assert_eq!(feedback_of(&u, &divided(&[-0.5], &late(&u, 1))), None);
    assert_eq!(feedback_of(&u[..20], &normal(42, 20)), None);
    assert_eq!(feedback_of(&[3.0; 300], &normal(42, 300)), None);
    assert_eq!(feedback_of(&u, &[3.0; 300]), None);
    assert_eq!(feedback_of(&sines(2, 300), &normal(42, 300)), None);
    // One that repeats itself, behind a plant that is not linear.
    let period = normal(43, 100).repeat(3);
    let cubes: Vec<f64> = late(&period, 1).iter().map(|u| u * u * u).collect();
    assert_eq!(feedback_of(&period, &sum_of(&cubes, 0.01, &normal(44, 300))), None);
    // A constant input beside a good one does not spoil it.
    let inputs = [vec![0.0; 300], deviations(&u)];
    let both = feedback(&inputs, &deviations(&normal(42, 300)), &one(0..300)).inputs;
    assert!(both[0].is_none() && both[1].is_some());
}
