use std::f64::consts::{PI, TAU};

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::noise::Noise;

use super::*;
use crate::data::Log;
use crate::respond::FrequencyPoint;
use crate::tests::assert_refused;
use crate::{Document, Error};

mod coverage;
mod refusals;

/// White noise of variance 1.
fn noise(seed: u64, count: usize) -> Vec<f64> {
    Noise(seed << 32).take_normal(count)
}

/// A log with a sample time of half a second.
fn log(channels: &[(&str, &[f64])]) -> Log {
    crate::tests::log(channels, 0.5)
}

/// (b0 + b1 q^-1)/(1 + a1 q^-1 + a2 q^-2) from rest.
#[derive(Clone, Copy)]
struct Plant {
    b: [f64; 2],
    a: [f64; 2],
}

impl Plant {
    fn output(&self, u: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = Vec::with_capacity(u.len());
        for t in 0..u.len() {
            let past = |of: &[f64], lag: usize| if t < lag { 0.0 } else { of[t - lag] };
            let moved = self.b[0] * u[t] + self.b[1] * past(u, 1);
            y.push(moved - self.a[0] * past(&y, 1) - self.a[1] * past(&y, 2));
        }
        y
    }

    fn at(&self, angle: f64) -> Complex<f64> {
        let back = Complex::new(angle.cos(), -angle.sin());
        let one = Complex::new(1.0, 0.0);
        (one * self.b[0] + back * self.b[1]) / (one + back * self.a[0] + back * back * self.a[1])
    }
}

const SMOOTH: Plant = Plant { b: [0.0, 0.5], a: [-0.8, 0.0] };

fn value(point: &FrequencyPoint) -> Complex<f64> {
    Complex::new(point.re, point.im)
}

fn plan(method: Method) -> SpectrumPlan {
    SpectrumPlan { method, ..SpectrumPlan::new(&["u"], "y") }
}

const SINES: Method = Method::Sines { period: None, discard: None };
const WELCH: Method = Method::Welch { window: None, estimator: Estimator::H1 };

#[test]
fn spa_is_the_sum_that_defines_it() {
    let (u, y) = (noise(1, 300), noise(2, 300));
    let at = Frequencies::At(vec![0.2, 1.0, 5.0]);
    let plan = SpectrumPlan { frequencies: at, ..plan(Method::Spa { lags: Some(20) }) };
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &plan).unwrap();
    let centred = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / 300.0;
        x.iter().map(|x| x - mean).collect::<Vec<_>>()
    };
    let (u, y) = (centred(&u), centred(&y));
    let cross = |a: &[f64], b: &[f64], angle: f64| -> Complex<f64> {
        (-20_i32..=20)
            .map(|lag| {
                let pairs = (0..300_i32).filter(|t| (0..300).contains(&(t + lag)));
                let sum: f64 = pairs.map(|t| a[(t + lag) as usize] * b[t as usize]).sum();
                let (tau, window) = (f64::from(lag), 0.5 * (1.0 + (PI * f64::from(lag) / 20.0).cos()));
                Complex::new((angle * tau).cos(), -(angle * tau).sin()) * (window * sum / 300.0)
            })
            .sum()
    };
    for (point, noise) in found.responses[0].points.iter().zip(&found.noise) {
        let angle = 0.5 * point.frequency;
        let [uu, yy, yu] = [(&u, &u), (&y, &y), (&y, &u)].map(|(a, b)| cross(a, b, angle));
        let coherence = yu.norm_sqr() / (uu.re * yy.re);
        // Rounding of transforms of 320 samples near 1.
        assert!((value(point) - yu / uu).norm() < 1e-12);
        assert!((noise.coherence.unwrap() - coherence).abs() < 1e-12);
        assert!((noise.density.unwrap() - yy.re * (1.0 - coherence) * 0.5 / PI).abs() < 1e-12);
        // |G|^2 (1 - gamma^2)/(2 (n - 1) gamma^2)
        let averages = 300.0
            / (1.0
                + (1..20)
                    .map(|k| 2.0 * (0.5 * (1.0 + (PI * f64::from(k) / 20.0).cos())).powi(2))
                    .sum::<f64>());
        let variance = value(point).norm_sqr() * (1.0 - coherence) / (2.0 * (averages - 1.0) * coherence);
        assert!((point.covariance.unwrap()[0][0] / variance - 1.0).abs() < 1e-9);
    }
}

#[test]
fn welch_is_the_mean_over_windows() {
    let (u, y) = (noise(3, 100), noise(4, 100));
    let windowed = |x: &[f64], first: usize, k: usize| -> Complex<f64> {
        let mean = x.iter().sum::<f64>() / 100.0;
        let term = |t: usize| {
            let (h, angle) = ((PI * t as f64 / 32.0).sin().powi(2), TAU * (k * t) as f64 / 32.0);
            Complex::new(angle.cos(), -angle.sin()) * (h * (x[first + t] - mean))
        };
        (0..32).map(term).sum()
    };
    let all = log(&[("u", &u), ("y", &y)]);
    for estimator in [Estimator::H1, Estimator::H2] {
        let found = spectrum(&all, &[], &plan(Method::Welch { window: Some(32), estimator })).unwrap();
        assert_eq!(found.noise.len(), 15);
        for (point, k) in found.responses[0].points.iter().zip(1..) {
            assert!((point.frequency - TAU * k as f64 / 16.0).abs() < 1e-12);
            let (mut uu, mut yu, mut yy) = (0.0, Complex::new(0.0, 0.0), 0.0);
            for first in [0, 16, 32, 48, 64] {
                let (u, y) = (windowed(&u, first, k), windowed(&y, first, k));
                uu += u.norm_sqr();
                yy += y.norm_sqr();
                yu += y * u.conj();
            }
            let expected = match estimator {
                Estimator::H1 => yu / uu,
                Estimator::H2 => yy / yu.conj(),
            };
            assert!((value(point) / expected - 1.0).norm() < 1e-10);
        }
    }
}

#[test]
fn without_noise_etfe_of_a_periodic_input_is_the_plant() {
    let period = noise(5, 64);
    let u = period.repeat(20);
    // The last two periods: the transient is 0.8^1152 of what it was.
    let y = SMOOTH.output(&u);
    let (u, y) = (&u[1152..], &y[1152..]);
    let found = spectrum(&log(&[("u", u), ("y", y)]), &[], &plan(Method::Etfe)).unwrap();
    assert_eq!(found.responses[0].points.len(), 31);
    for point in &found.responses[0].points {
        assert!((value(point) - SMOOTH.at(0.5 * point.frequency)).norm() < 1e-11);
        assert!(point.covariance.is_none());
    }
    // Every other line has no power.
    assert!(
        found.warnings[0].starts_with("the input 'u' has no power at 32 of 63 frequencies"),
        "{:?}",
        found.warnings
    );
    assert_eq!(found.bands.honest, None);
}

#[test]
fn lpm_and_spa_find_several_plants_at_once() {
    let inputs: Vec<Vec<f64>> = (0..3).map(|seed| noise(6 + seed, 3000)).collect();
    let plants = [SMOOTH, Plant { b: [1.0, 0.4], a: [0.0, 0.0] }, Plant { b: [0.2, 0.0], a: [-1.2, 0.5] }];
    let mut y: Vec<f64> = noise(9, 3000).iter().map(|e| 0.05 * e).collect();
    for (plant, u) in plants.iter().zip(&inputs) {
        y.iter_mut().zip(plant.output(u)).for_each(|(y, own)| *y += own);
    }
    let log = log(&[("a", &inputs[0]), ("b", &inputs[1]), ("c", &inputs[2]), ("y", &y)]);
    let between = Frequencies::Between { low: 0.1, high: TAU, points: Some(40) };
    for method in [Method::default(), Method::Spa { lags: Some(60) }] {
        let plan =
            SpectrumPlan { method, frequencies: between.clone(), ..SpectrumPlan::new(&["a", "b", "c"], "y") };
        let found = spectrum(&log, &[], &plan).unwrap();
        for (plant, response) in plants.iter().zip(&found.responses) {
            assert_eq!(response.points.len(), 40);
            for point in &response.points {
                let error = (value(point) - plant.at(0.5 * point.frequency)).norm();
                // Of 120 points none is farther than this by chance, and what windows hide is a fiftieth.
                let bound = 4.5 * (2.0 * point.covariance.unwrap()[0][0]).sqrt() + 0.02;
                assert!(error < bound, "{method} {:?} {error} {bound}", response.input);
            }
        }
        assert!(found.noise.iter().all(|point| point.coherence.unwrap() > 0.9));
    }
}

#[test]
fn nothing_reaches_across_a_gap() {
    let u = noise(10, 4000);
    let mut y = SMOOTH.output(&u);
    y[1000..1100].fill(f64::NAN);
    y[2000..2010].fill(f64::NAN);
    let log = log(&[("u", &u), ("y", &y)]);
    for method in [Method::default(), Method::Spa { lags: Some(100) }, WELCH] {
        let found = spectrum(&log, &[], &plan(method)).unwrap();
        let rows: Vec<String> = found.rows.iter().map(ToString::to_string).collect();
        assert_eq!(rows, ["1..1000", "1101..2000", "2011..4000"]);
        // Without noise lpm has what the second degree leaves of the plant; the others have what windows leave.
        let tolerance = if method == Method::default() { 1e-2 } else { 0.2 };
        for point in &found.responses[0].points {
            let error = (value(point) - SMOOTH.at(0.5 * point.frequency)).norm();
            assert!(error < tolerance, "{method} {} {error}", point.frequency);
        }
    }
}

#[test]
fn stepped_sines_are_taken_apart() {
    // Rests, then three sines of 400 rows each, with periods of 50, 20 and 8 rows.
    let mut u = vec![0.0; 30];
    for period in [50, 20, 8] {
        u.extend((0..400).map(|t| 3.0 + (TAU * f64::from(t) / f64::from(period)).sin()));
    }
    let y = SMOOTH.output(&u);
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &plan(SINES)).unwrap();
    let points = &found.responses[0].points;
    assert_eq!(points.len(), 3, "{:?}", found.rows);
    for (point, period) in points.iter().zip([50.0, 20.0, 8.0]) {
        assert!((point.frequency - TAU / period / 0.5).abs() < 1e-12);
        // What is left of the transient is below the tolerance.
        assert!((value(point) - SMOOTH.at(TAU / period)).norm() < 1e-5, "{point:?}");
    }
}

#[test]
fn a_multisine_has_bands_from_the_spread_between_periods() {
    let lines = [1.0, 3.0, 7.0, 20.0];
    let u: Vec<f64> = (0..3000)
        .map(|t| lines.iter().map(|line| (TAU * line * f64::from(t) / 100.0 + line * line).sin()).sum())
        .collect();
    let y: Vec<f64> = SMOOTH.output(&u).iter().zip(noise(11, 3000)).map(|(y, e)| y + 0.1 * e).collect();
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &plan(SINES)).unwrap();
    assert_eq!(found.bands.honest, Some(true));
    let Method::Sines { period, discard } = found.method else { panic!("{:?}", found.method) };
    // The first period begins at rest.
    assert_eq!((period, discard), (Some(100), Some(1)));
    for ((point, noise), line) in found.responses[0].points.iter().zip(&found.noise).zip(lines) {
        let angle = TAU * line / 100.0;
        assert!((point.frequency - 2.0 * angle).abs() < 1e-12);
        let error = point.covariance.unwrap()[0][0].sqrt();
        // Noise of variance 0.01 in 2900 rows, against half an amplitude of 1.
        assert!((error / (0.1 * (2.0_f64 / 2900.0).sqrt()) - 1.0).abs() < 0.4);
        assert!((value(point) - SMOOTH.at(angle)).norm() < 4.0 * error);
        // A uniform density up to 2 pi rad/s.
        assert!((noise.density.unwrap() / (0.01 / TAU) - 1.0).abs() < 0.8);
    }
}

#[test]
fn each_input_has_its_own_sines() {
    let sine = |line: f64| (0..600).map(move |t| (TAU * line * f64::from(t) / 60.0).sin());
    let (a, b): (Vec<f64>, Vec<f64>) = (sine(2.0).collect(), sine(5.0).map(|u| 4.0 * u).collect());
    let y: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 0.5 * b).collect();
    let plan = SpectrumPlan { method: SINES, ..SpectrumPlan::new(&["a", "b"], "y") };
    let found = spectrum(&log(&[("a", &a), ("b", &b), ("y", &y)]), &[], &plan).unwrap();
    let of = |input: &str| found.from_input(input).unwrap().points.clone();
    assert_eq!((of("a").len(), of("b").len(), found.noise.len()), (1, 1, 2));
    assert!((of("a")[0].re - 2.0).abs() < 1e-12 && (of("b")[0].re + 0.5).abs() < 1e-12);
    let both: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + b).collect();
    assert_refused(
        spectrum(&log(&[("a", &a), ("b", &both), ("y", &y)]), &[], &plan),
        "the inputs 'a' and 'b' both have power",
    );
}

#[test]
fn the_noise_spectrum_integrates_to_its_variance() {
    let u = noise(12, 8000);
    let colour = Plant { b: [1.0, 0.5], a: [0.0, 0.0] };
    let v = colour.output(&noise(13, 8000));
    let y: Vec<f64> = SMOOTH.output(&u).iter().zip(&v).map(|(y, v)| y + v).collect();
    let variance = v.iter().map(|v| v * v).sum::<f64>() / 8000.0;
    for method in [WELCH, Method::Spa { lags: Some(64) }, Method::default()] {
        let frequencies = match method {
            Method::Welch { .. } => Frequencies::All,
            _ => Frequencies::At((1..=200).map(|k| f64::from(k) * TAU / 200.0).collect()),
        };
        let found =
            spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan { frequencies, ..plan(method) });
        let noise = found.unwrap().noise;
        let mean = noise.iter().filter_map(|point| point.density).sum::<f64>() / noise.len() as f64;
        // A chi-square of thousands of degrees, and the ends of the band.
        assert!((mean * TAU / variance - 1.0).abs() < 0.06, "{method} {}", mean * TAU / variance);
    }
}

#[test]
fn units_do_not_matter() {
    let u = noise(14, 500);
    let y = SMOOTH.output(&u);
    for method in [Method::default(), Method::Spa { lags: None }, WELCH, Method::Etfe] {
        let of = |scale: f64, by: f64| {
            let u: Vec<f64> = u.iter().map(|u| u * scale).collect();
            let y: Vec<f64> = y.iter().map(|y| y * by).collect();
            spectrum(&log(&[("u", &u), ("y", &y)]), &[], &plan(method)).unwrap()
        };
        // Powers of two: to the bit. Their squares would leave the range of numbers.
        let (plain, scaled) = (of(1.0, 1.0), of(2.0_f64.powi(700), 2.0_f64.powi(690)));
        let factor = 2.0_f64.powi(-10);
        for (one, other) in plain.responses[0].points.iter().zip(&scaled.responses[0].points) {
            assert_eq!((one.re * factor, one.im * factor), (other.re, other.im), "{method}");
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let u = noise(15, 20_000);
    let y = SMOOTH.output(&u);
    let log = log(&[("u", &u), ("y", &y)]);
    for method in [Method::default(), WELCH] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| spectrum(&log, &[], &plan(method)).unwrap().to_json().unwrap())
        };
        assert_eq!(on(1), on(3));
    }
}

#[test]
fn a_document_is_read_back() {
    let u = noise(16, 400);
    let y = SMOOTH.output(&u);
    let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan::new(&["u"], "y")).unwrap();
    assert_eq!(MeasuredResponse::from_json(&found.to_json().unwrap()).unwrap(), found);
    let damaged = MeasuredResponse { noise: found.noise[1..].to_vec(), ..found };
    let error = MeasuredResponse::from_json(&damaged.to_json().unwrap()).unwrap_err();
    assert!(
        matches!(&error, Error::Report { message } if message.contains("not at the frequencies")),
        "{error}"
    );
}

#[test]
fn the_lowest_and_the_highest_lines_are_as_good_as_others() {
    // A pole at 0.95: the response bends where the first lines lie, a twentieth of a radian from 0.
    let plant = Plant { b: [0.0, 0.05], a: [-0.95, 0.0] };
    let u = noise(3, 2000);
    let y: Vec<f64> = plant.output(&u).iter().zip(noise(4, 2000)).map(|(y, e)| y + 0.01 * e).collect();
    let lines = [1.0, 2.0, 5.0, 8.0, 990.0, 999.0].map(|line| line * TAU / 2000.0);
    let at = Frequencies::At(lines.iter().map(|angle| angle / 0.5).collect());
    let method = Method::Lpm { half_width: None };
    let found =
        spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan { frequencies: at, ..plan(method) });
    for (point, angle) in found.unwrap().responses[0].points.iter().zip(lines) {
        let (off, [[re, _], _]) = ((value(point) - plant.at(angle)).norm(), point.covariance.unwrap());
        assert!(off < 4.0 * re.sqrt(), "{angle}: {off} of {}", re.sqrt());
        // Of a gain of 1 there, and next to nothing at the highest.
        assert!(angle > 1.0 || off < 0.03, "{angle}: {off}");
    }
}

#[test]
fn power_that_leaks_is_none() {
    // One and a third cycles of a sine: at other frequencies there is what the ends of the record leave.
    let u: Vec<f64> = (0..400).map(|t| (TAU * 1.33 * f64::from(t) / 400.0).sin()).collect();
    let y: Vec<f64> = SMOOTH.output(&u).iter().zip(noise(5, 400)).map(|(y, e)| y + 0.02 * e).collect();
    let at = Frequencies::At(vec![1.0, 2.0, 5.0]);
    let method = Method::Lpm { half_width: None };
    let found =
        spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan { frequencies: at, ..plan(method) });
    let Err(Error::Undetermined { message, .. }) = found else { panic!("{found:?}") };
    assert!(message.contains("the input 'u' has no power at 3 of 3 frequencies"), "{message}");
}

#[test]
fn every_frequency_of_stepped_sines_that_were_designed_is_found() {
    use crate::design::{SignalKind, SignalPlan, TestSignal};
    for (points, length, band) in [(4, 4000, [0.02, 0.4]), (5, 20_000, [0.02, 0.4]), (8, 9000, [0.02, 0.5])] {
        let design = SignalPlan {
            points: Some(points),
            length,
            band: Some(band),
            ..SignalPlan::new(SignalKind::Sines)
        };
        let signal = TestSignal::new(&design).unwrap();
        let u = signal.values(length).swap_remove(0);
        let noise = noise(6, length);
        let y: Vec<f64> = SMOOTH.output(&u).iter().zip(&noise).map(|(y, e)| y + 0.02 * e).collect();
        let found = spectrum(&log(&[("u", &u), ("y", &y)]), &[], &plan(SINES)).unwrap();
        let own: Vec<f64> = found.responses[0].points.iter().map(|point| point.frequency).collect();
        // Half a second a sample, where the design has one.
        let expected: Vec<f64> = signal.frequencies().iter().map(|frequency| 2.0 * frequency).collect();
        assert_eq!(own.len(), points, "{own:?} of {expected:?}");
        assert!(
            own.iter().zip(&expected).all(|(own, of)| (own / of - 1.0).abs() < 1e-9),
            "{own:?} {expected:?}"
        );
    }
}
