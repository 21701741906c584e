//! Tests of residuals against their definitions.

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::distribution::{outside as events, two_sided};
use thetahat_numerics::noise::Noise;

use super::moments::{Moments, Traces, columns, pseudo_inverse};
use super::residuals::Untestable;
use super::whiteness::{Autocorrelation, anderson, anderson_lags, ljung_box};
use super::*;
use crate::Error;
use crate::data::Record;
use crate::estimate::{Initial, NullDistribution, arx, autoregression};
use crate::model::{Orders, PolynomialModel, Signal};
use crate::respond::{InitialCondition, Innovations, Regressors, Tested, innovations};

/// y(t) = 1.2 y(t-1) - 0.5 y(t-2) + u(t-1) + 0.4 u(t-2) + e(t).
const A: [f64; 2] = [-1.2, 0.5];
const B: [f64; 2] = [1.0, 0.4];

fn experiment(samples: usize, size: f64) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(3);
    let (u, e) = (noise.take(samples), noise.take(samples));
    let mut y = vec![0.0; 2];
    for t in 2..samples {
        y.push(B[0] * u[t - 1] + B[1] * u[t - 2] - A[0] * y[t - 1] - A[1] * y[t - 2] + size * e[t]);
    }
    (u, y)
}

fn named(model: PolynomialModel) -> PolynomialModel {
    let signal = |name: &str| Signal { name: name.to_owned(), ..Signal::default() };
    let inputs = (0..model.inputs.len()).map(|input| signal(["u", "v"][input])).collect();
    PolynomialModel { inputs, output: signal("y"), ..model }
}

fn orders() -> Orders {
    Orders::arx(2, &[2], &[1]).unwrap()
}

/// The true model without uncertainty.
fn truth() -> PolynomialModel {
    let parameters = [A, B].concat();
    named(PolynomialModel::from_parameters(&orders(), &parameters, None, 0.01, 1.0).unwrap())
}

fn tested(
    model: &PolynomialModel,
    record: &Record<'_>,
    null: NullDistribution,
) -> Result<Residuals, Untestable> {
    let found = innovations(model, record, 1, InitialCondition::Drop).unwrap();
    let tested = Tested::of_polynomials(model, record.clone(), &found);
    Residuals::of(&tested, null, 25, &[0.05, 0.2], 0.05)
}

fn traces<'a>(
    model: &PolynomialModel,
    record: &Record<'a>,
    found: &[Innovations],
    noise_free: bool,
) -> Traces<'a> {
    Traces::new(record, found, model.regressors(record, found, noise_free))
}

fn close(found: f64, expected: f64, tolerance: f64) -> bool {
    (found - expected).abs() <= tolerance * expected.abs().max(1.0)
}

#[test]
fn correlations_are_those_of_pairs_inside_segments() {
    let error = Noise(1).take(90);
    // Two of them touch: no pair reaches from one into the other.
    let counted: [Range<usize>; 4] = [2..30, 30..45, 50..53, 60..90];
    let segments: Vec<&[Range<usize>]> = counted.iter().map(std::slice::from_ref).collect();
    let found = Autocorrelation::new(&error, &segments, 12);
    let square: f64 = counted.iter().cloned().flatten().map(|t| error[t] * error[t]).sum();
    assert_eq!(found.samples, 76);
    assert!(close(found.square, square, 1e-14));
    for lag in 1..=12 {
        let pairs = || {
            let each = counted.iter().flat_map(|rows| rows.start + lag.min(rows.len())..rows.end);
            each.filter(|t| counted.iter().any(|rows| rows.contains(t) && rows.contains(&(t - lag))))
        };
        let sum: f64 = pairs().map(|t| error[t] * error[t - lag]).sum();
        assert_eq!(found.pairs[lag - 1], pairs().count());
        assert!(close(found.values[lag - 1], sum / square, 1e-14), "{lag}");
    }
}

#[test]
fn without_parameters_the_test_is_that_of_ljung_and_box() {
    let error = Noise(5).take(200);
    let counted = [0..120, 130..200];
    let found = Autocorrelation::new(&error, &[&counted], 10);
    let test = ljung_box(&found, &DVector::zeros(10), &DMatrix::identity(10, 10)).unwrap();
    let each = (0..10).map(|k| found.values[k].powi(2) / found.pairs[k] as f64);
    let expected = 190.0 * 192.0 * each.sum::<f64>();
    assert!(close(test.statistic, expected, 1e-12), "{} {expected}", test.statistic);
    assert_eq!((test.lags, test.degrees), (10, 10.0));
    // In a direction of which nothing is left there is no degree of freedom.
    let mut covariance = DMatrix::identity(10, 10);
    covariance[(3, 3)] = 0.04;
    let less = ljung_box(&found, &DVector::zeros(10), &covariance).unwrap();
    let taken = 190.0 * 192.0 * found.values[3].powi(2) / found.pairs[3] as f64;
    assert_eq!(less.degrees, 9.0);
    assert!(close(less.statistic, expected - taken, 1e-12));
    // What is known of more variance counts less.
    covariance[(3, 3)] = 4.0;
    let scaled = ljung_box(&found, &DVector::zeros(10), &covariance).unwrap();
    let weight = 190.0 / found.pairs[3] as f64;
    let variance = 1.0 + 3.0 * weight;
    assert!(close(scaled.statistic, expected - taken + taken / variance, 1e-12));
}

#[test]
fn anderson_counts_lags_outside_their_bands() {
    let correlation = Autocorrelation {
        samples: 100,
        square: 1.0,
        // sqrt(N) N/N_k r_k = 3, 2, 1, 0.5.
        values: vec![0.3 * 0.99, -0.2 * 0.98, 0.1 * 0.97, 0.05 * 0.96],
        pairs: vec![99, 98, 97, 96],
    };
    let found = anderson(&correlation, &DMatrix::identity(4, 4), 4, &[0.001, 0.05, 0.32, 0.7], 0.05);
    let outside: Vec<usize> = found.levels.iter().map(|level| level.outside).collect();
    // Bands at 3.29, 1.96, 0.99, 0.39 standard deviations.
    assert_eq!(outside, [0, 2, 3, 4]);
    let white: Vec<bool> = found.levels.iter().map(|level| level.white).collect();
    // Two of four at 0.05 are significant; three of four at 0.32 are not.
    assert_eq!(white, [true, false, true, true]);
    // 3 standard deviations are outside from alpha = 0.0027 on.
    assert_eq!((found.lags, found.stops_at), (4, Some(0.003)));
    assert!(close(found.levels[1].band, 0.1959964, 1e-6));
    // More than two of four at 0.05, and half of two; each is outside a little more often, as sums of fewer pairs are.
    let p = [99.0, 98.0, 97.0, 96.0].map(|pairs: f64| events(two_sided(0.05) * (pairs / 100.0).sqrt()).0);
    let p = p.iter().sum::<f64>() / 4.0;
    assert!((0.051..0.054).contains(&p));
    let expected = 1.0 - (1.0 - p).powi(4) - 4.0 * p * (1.0 - p).powi(3) - 3.0 * (p * (1.0 - p)).powi(2);
    assert!(close(found.levels[1].p_value, expected, 1e-12));
    // Four times the variance, half as far outside.
    let found = anderson(&correlation, &(DMatrix::identity(4, 4) * 4.0), 4, &[0.05], 0.05);
    assert_eq!((found.levels[0].outside, found.stops_at), (0, Some(0.134)));
    // One of four at 0.01 is significant at 0.05, not at 0.01.
    let one = Autocorrelation { values: vec![0.3, 0.0, 0.0, 0.0], ..correlation.clone() };
    for (level, white) in [(0.05, false), (0.01, true)] {
        let found = anderson(&one, &DMatrix::identity(4, 4), 4, &[0.01], level);
        assert_eq!((found.levels[0].outside, found.levels[0].white), (1, white));
        // Where the fraction outside is not below alpha any more does not depend on the level.
        assert_eq!(found.stops_at, Some(0.003));
    }
    let white = Autocorrelation { values: vec![1e-9; 4], ..correlation };
    assert_eq!(anderson(&white, &DMatrix::identity(4, 4), 4, &[], 0.05).stops_at, None);
    assert_eq!((anderson_lags(10, 25), anderson_lags(300, 25), anderson_lags(10_000, 25)), (1, 15, 25));
}

/// Orders of every kind, with stable parameters.
fn models() -> Vec<PolynomialModel> {
    let model = |orders: Result<Orders, Error>, parameters: &[f64]| {
        named(PolynomialModel::from_parameters(&orders.unwrap(), parameters, None, 1.0, 1.0).unwrap())
    };
    vec![
        model(Orders::arx(2, &[2], &[1]), &[-1.2, 0.5, 1.0, 0.4]),
        model(Orders::armax(1, &[2], 2, &[0]), &[-0.7, 1.0, -0.4, 0.5, 0.3]),
        model(
            Orders::bj(&[1, 2], 1, 2, &[2, 1], &[1, 3]),
            &[1.0, 0.5, -0.2, 0.6, -0.9, 0.4, -1.1, 0.4, -0.8],
        ),
        model(Orders::new(1, &[1], 1, 1, &[1], &[2]), &[-0.5, 1.0, 0.3, 0.6, -0.7]),
        model(Orders::new(2, &[], 1, 0, &[], &[]), &[-1.3, 0.6, 0.5]),
    ]
}

#[test]
fn psi_is_the_derivative_of_the_errors() {
    let mut noise = Noise(7);
    let (y, u, v) = (noise.take(80), noise.take(80), noise.take(80));
    for model in models() {
        let inputs = [&u[..], &v[..]][..model.inputs.len()].to_vec();
        let record = Record { output: &y, inputs, segments: vec![0..35, 40..80], past: vec![0, 0] };
        let errors = |model: &PolynomialModel| {
            let mut errors = vec![0.0; 80];
            for found in innovations(model, &record, 1, InitialCondition::Zero).unwrap() {
                errors[found.rows].copy_from_slice(&found.errors);
            }
            errors
        };
        let values: Vec<f64> = model.parameters.iter().map(|parameter| parameter.value).collect();
        let found = innovations(&model, &record, 1, InitialCondition::Zero).unwrap();
        let traces = traces(&model, &record, &found, false);
        let psi = columns(&traces.psi);
        let moments = Moments::new(&traces, &traces.psi);
        assert_eq!(psi.len(), values.len());
        let step = 1e-5;
        let derivative = |index: usize| {
            let moved = |by: f64| {
                let mut values = values.clone();
                values[index] += by;
                errors(&PolynomialModel::from_parameters(&model.orders, &values, None, 1.0, 1.0).unwrap())
            };
            let (low, high) = (moved(-step), moved(step));
            low.iter().zip(high).map(|(low, high)| (low - high) / (2.0 * step)).collect::<Vec<f64>>()
        };
        let rows = || (0..35).chain(40..80);
        let centered = |values: &[f64]| {
            let mean = rows().map(|t| values[t]).sum::<f64>() / 75.0;
            values.iter().map(|value| value - mean).collect::<Vec<f64>>()
        };
        let e = centered(&errors(&model));
        for (index, column) in psi.iter().enumerate() {
            // The signal is centered before it is shifted: the difference is a constant, which e does not see but
            // at the ends.
            let expected = derivative(index);
            let signal = traces.signal(column.signal);
            let offset = expected[34] - column.sign * signal[34 - column.lag];
            for (start, end) in [(0, 35), (40, 80)] {
                for t in start + column.lag..end {
                    let value = column.sign * signal[t - column.lag] + offset;
                    assert!((value - expected[t]).abs() < 1e-7, "{:?} {index} {t}", model.structure);
                }
            }
            // And the sums of products are those of the shifted signals, zero before a segment.
            let at = |t: usize, start: usize| {
                if t < start + column.lag { 0.0 } else { column.sign * signal[t - column.lag] }
            };
            let sum: f64 = (0..35).map(|t| at(t, 0) * e[t]).chain((40..80).map(|t| at(t, 40) * e[t])).sum();
            assert!(close(moments.with_error(&psi)[index], sum, 1e-12), "{:?} {index}", model.structure);
        }
    }
}

#[test]
fn instruments_are_free_of_noise() {
    let (u, y) = experiment(300, 0.3);
    let record = Record::new(&y, vec![&u]).unwrap();
    let found = innovations(&truth(), &record, 1, InitialCondition::Drop).unwrap();
    let traces = traces(&truth(), &record, &found, true);
    let (_, clean) = experiment(300, 0.0);
    let signal = traces.signal(traces.psi[0].signal);
    let offset = clean[299] - signal[299];
    // The first samples of the experiment are not those of a plant at rest, which dies away.
    assert!((80..300).all(|t| (signal[t] + offset - clean[t]).abs() < 1e-9));
}

#[test]
fn past_errors_are_in_psi_as_the_model_has_it() {
    // From sums over many samples of simulated noise.
    let samples = 100_000;
    let orders = Orders::new(2, &[1], 1, 1, &[0], &[1]).unwrap();
    let parameters = [-1.2, 0.5, 1.0, 0.4, -0.6];
    let model = named(PolynomialModel::from_parameters(&orders, &parameters, None, 1.0, 1.0).unwrap());
    let mut noise = Noise(9);
    let (u, e) = (noise.take(samples), noise.take(samples));
    let (mut v, mut y) = (vec![0.0; 2], vec![0.0; 2]);
    for t in 2..samples {
        v.push(0.6 * v[t - 1] + e[t] + 0.4 * e[t - 1]);
        y.push(1.2 * y[t - 1] - 0.5 * y[t - 2] + u[t - 1] + v[t]);
    }
    let record = Record::new(&y, vec![&u]).unwrap();
    let found = innovations(&model, &record, 1, InitialCondition::Zero).unwrap();
    let traces = traces(&model, &record, &found, false);
    let error = thetahat_numerics::regression::Taps { signal: Traces::ERROR, first: 1, count: 6, sign: 1.0 };
    let taps = [&traces.psi[..], &[error]].concat();
    let moments = Moments::new(&traces, &taps);
    let square: f64 = traces.signal(Traces::ERROR).iter().map(|e| e * e).sum();
    let sums = moments.matrix(&columns(&[error]), &columns(&traces.psi)) / square;
    let expected = model.past_errors(6);
    // Ten standard deviations of the sums, or so.
    assert!((&sums - &expected).amax() < 0.03, "{sums} {expected}");
    // a1: -1/A, with a delay of one; b: nothing; c: 1/C; d: -1/D.
    assert_eq!(expected[(0, 0)], -1.0);
    assert!(close(expected[(1, 0)], -1.2, 1e-15) && expected[(0, 1)] == 0.0 && expected[(1, 1)] == -1.0);
    assert!(expected.column(2).iter().all(|value| *value == 0.0));
    assert!(close(expected[(1, 3)], -0.4, 1e-15) && close(expected[(1, 4)], -0.6, 1e-15));
    // An unstable A has no such response.
    let mut unstable = model;
    unstable.a = vec![1.0, -2.0, 0.5];
    assert!(unstable.past_errors(3).columns(0, 2).iter().all(|value| *value == 0.0));
}

/// sum u(t - k) e(t), means taken off, u zero before the first sample.
fn cross(u: &[f64], e: &[f64], lag: isize) -> f64 {
    let at = |t: isize| usize::try_from(t).ok().and_then(|t| u.get(t)).copied().unwrap_or(0.0);
    e.iter().zip(0_isize..).map(|(e, t)| e * at(t - lag)).sum()
}

#[test]
fn independence_of_a_known_model_is_the_quadratic_form_of_its_definition() {
    let samples = 300;
    let (u, y) = experiment(samples, 0.3);
    let record = Record { past: vec![2], ..Record::new(&y, vec![&u]).unwrap() };
    let record = Record { segments: std::iter::once(2..samples).collect(), ..record };
    let found = tested(&truth(), &record, NullDistribution::Known).unwrap();
    assert_eq!((found.samples, found.fitted), (298, 0));
    let test = &found.independence[0];
    assert_eq!((test.input.as_str(), test.past.lags, test.past.degrees), ("u", 25, 25.0));

    let e: Vec<f64> = (2..samples)
        .map(|t| y[t] + A[0] * y[t - 1] + A[1] * y[t - 2] - B[0] * u[t - 1] - B[1] * u[t - 2])
        .collect();
    let n = 298.0;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (e_mean, u_mean) = (mean(&e), mean(&u[2..]));
    let e: Vec<f64> = [0.0, 0.0].into_iter().chain(e.iter().map(|e| e - e_mean)).collect();
    let u: Vec<f64> = u.iter().map(|u| u - u_mean).collect();
    let square: f64 = e.iter().map(|e| e * e).sum();
    let power: f64 = u[2..].iter().map(|u| u * u).sum();
    for (position, lag) in (-25..=25).enumerate() {
        let expected = cross(&u, &e, lag) / (square * power).sqrt();
        assert!(close(test.correlation[position], expected, 1e-12), "{lag}");
    }
    // White residuals: P is the variance of e times sum u(t - i) u(t - j).
    let colour = autoregression(&e, std::slice::from_ref(&(2..samples)), 0);
    assert_eq!(colour.monic, [1.0]);
    let at = |t: usize, lag: usize| if t < lag { 0.0 } else { u[t - lag] };
    let p = DMatrix::from_fn(25, 25, |i, j| {
        colour.variance * (2..samples).map(|t| at(t, i + 1) * at(t, j + 1)).sum::<f64>()
    });
    let s = DVector::from_fn(25, |k, _| cross(&u, &e, k as isize + 1));
    let expected = s.dot(&(p.clone().try_inverse().unwrap() * &s));
    assert!(close(test.past.statistic, expected, 1e-9), "{} {expected}", test.past.statistic);
    let band = 1.959964 * p[(3, 3)].sqrt() / (square * power).sqrt();
    assert!(close(test.band[26 + 3], band, 1e-6));
    // The farthest of the future ones, with M times its chance.
    let largest = (1..=25).map(|lag| cross(&u, &e, -lag).abs()).fold(0.0, f64::max);
    assert!(close(test.feedback.statistic, largest * largest / p[(0, 0)], 1e-9));
}

#[test]
fn coloured_residuals_have_the_variance_of_their_colour() {
    // e = w/(1 - 0.8 q^-1): the covariance of e(t) and e(s) is variance 0.8^|t - s|.
    let samples = 400;
    let mut noise = Noise(11);
    let mut u = vec![0.0];
    let mut e = vec![0.0];
    for t in 1..samples {
        u.push(0.7 * u[t - 1] + noise.uniform());
        e.push(0.8 * e[t - 1] + noise.uniform());
    }
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let model = named(PolynomialModel::from_parameters(&orders, &[1.0, -0.5], None, 1.0, 1.0).unwrap());
    let mut x = vec![0.0];
    (1..samples).for_each(|t| x.push(0.5 * x[t - 1] + u[t - 1]));
    let y: Vec<f64> = x.iter().zip(&e).map(|(x, e)| x + e).collect();
    let record = Record::new(&y, vec![&u]).unwrap();
    let innovations = innovations(&model, &record, 1, InitialCondition::Zero).unwrap();
    let tested = Tested::of_polynomials(&model, record.clone(), &innovations);
    let found = Residuals::of(&tested, NullDistribution::Known, 25, &[], 0.05).unwrap();
    let mean = e.iter().sum::<f64>() / samples as f64;
    let e: Vec<f64> = e.iter().map(|e| e - mean).collect();
    let all = 0..samples;
    let colour = autoregression(&e, std::slice::from_ref(&all), 0);
    assert_eq!(colour.monic.len(), 2);
    let a = -colour.monic[1];
    let mean = u.iter().sum::<f64>() / samples as f64;
    let u: Vec<f64> = u.iter().map(|u| u - mean).collect();
    let shifted: Vec<f64> = (0..samples).map(|t| if t < 5 { 0.0 } else { u[t - 5] }).collect();
    let covariance = |t: usize, s: usize| colour.variance / (1.0 - a * a) * a.powi(t.abs_diff(s) as i32);
    let variance: f64 = (0..samples)
        .map(|t| (0..samples).map(|s| shifted[t] * shifted[s] * covariance(t, s)).sum::<f64>())
        .sum();
    let size = (e.iter().map(|e| e * e).sum::<f64>() * u.iter().map(|u| u * u).sum::<f64>()).sqrt();
    let band = 1.959964 * variance.sqrt() / size;
    let test = &found.independence[0];
    assert!(close(test.band[25 + 5], band, 0.01), "{} {band}", test.band[25 + 5]);
    assert!(band > 1.5 * 1.96 / (samples as f64).sqrt());
    assert!(found.ljung_box.p_value.unwrap() < 1e-6 && test.past.p_value.unwrap() > 0.01);
}

#[test]
fn what_the_fit_took_has_no_degrees_of_freedom() {
    let (u, y) = experiment(400, 0.3);
    let record = Record::new(&y, vec![&u]).unwrap();
    let estimate = arx(&record, &orders(), Initial::Drop).unwrap();
    let model = named(estimate.to_model(&orders(), 1.0, vec![Signal::default()], Signal::default()).unwrap());
    let found = tested(&model, &record, NullDistribution::Fitted).unwrap();
    assert_eq!((found.samples, found.fitted), (398, 4));
    let test = &found.independence[0];
    // u(t - 1) and u(t - 2) are columns of psi: e is orthogonal to them, and so almost to what the other two have of u.
    let zero = |lag: usize| test.correlation[25 + lag].abs();
    assert!(zero(1) < 1e-3 && zero(2) < 1e-3, "{} {}", zero(1), zero(2));
    assert!((21.0..=23.0).contains(&test.past.degrees), "{}", test.past.degrees);
    // The parameters are taken as the truth, uncertain by their covariance, on other samples.
    let fresh = tested(&model, &record, NullDistribution::Known).unwrap();
    assert_eq!((fresh.fitted, fresh.independence[0].past.degrees, fresh.ljung_box.degrees), (0, 25.0, 25.0));
    let certain = PolynomialModel { covariance: None, ..model.clone() };
    let certain = tested(&certain, &record, NullDistribution::Known).unwrap();
    assert!(fresh.independence[0].past.statistic < certain.independence[0].past.statistic);
    assert!(fresh.ljung_box.statistic < certain.ljung_box.statistic);

    // A series: two of the first directions are gone.
    let orders = Orders::arx(2, &[], &[]).unwrap();
    let noise = Record::new(&y, vec![]).unwrap();
    let estimate = arx(&noise, &orders, Initial::Drop).unwrap();
    let model = estimate.to_model(&orders, 1.0, vec![], Signal::default()).unwrap();
    let found = tested(&model, &noise, NullDistribution::Fitted).unwrap();
    assert_eq!((found.ljung_box.degrees, found.independence.len()), (23.0, 0));
    // Two standard errors beside the least sum of squares, a known model is rejected by about four more; here that is
    // taken off.
    let parameters = [
        model.parameters[0].value + 2.0 * model.parameters[0].standard_error.unwrap(),
        model.parameters[1].value,
    ];
    let moved =
        PolynomialModel::from_parameters(&orders, &parameters, None, model.noise_variance, 1.0).unwrap();
    let beside = tested(&moved, &noise, NullDistribution::Fitted).unwrap().ljung_box.statistic;
    assert!((beside - found.ljung_box.statistic).abs() < 1.0, "{beside}");
}

#[test]
fn on_other_samples_the_errors_of_the_parameters_come_on_top() {
    let samples = 200;
    let (u, y) = experiment(samples, 0.3);
    let spread = DMatrix::from_fn(4, 4, |i, j| if i == j { 0.004 * (i + 1) as f64 } else { 0.001 });
    let rows = spread.row_iter().map(|row| row.iter().copied().collect()).collect();
    let model = PolynomialModel { covariance: Some(rows), ..truth() };
    let record = Record { past: vec![2], ..Record::new(&y, vec![&u]).unwrap() };
    let record = Record { segments: std::iter::once(2..samples).collect(), ..record };
    let found = tested(&model, &record, NullDistribution::Known).unwrap();

    let (n, lags) = (198.0, 19);
    let centered = |values: &[f64]| {
        let mean = values[2..].iter().sum::<f64>() / n;
        values.iter().map(|value| value - mean).collect::<Vec<f64>>()
    };
    let error = |t: usize| y[t] + A[0] * y[t - 1] + A[1] * y[t - 2] - B[0] * u[t - 1] - B[1] * u[t - 2];
    let mut e = centered(&[0.0, 0.0].into_iter().chain((2..samples).map(error)).collect::<Vec<f64>>());
    e[..2].fill(0.0);
    let (u, y) = (centered(&u), centered(&y));
    let square: f64 = e.iter().map(|e| e * e).sum();
    let psi = |t: usize| [-y[t - 1], -y[t - 2], u[t - 1], u[t - 2]];
    let at = |values: &[f64], t: usize, lag: usize| if t < lag { 0.0 } else { values[t - lag] };
    let sums = |of: &dyn Fn(usize) -> f64| (2..samples).map(of).sum::<f64>();
    let x = DMatrix::from_fn(lags, 4, |k, i| sums(&|t| psi(t)[i] * at(&e, t, k + 1)) / square);
    let pairs = |k: usize| n - 1.0 - k as f64;
    let added = &x * &spread * x.transpose() * n;
    let c = DMatrix::from_fn(lags, lags, |k, l| {
        f64::from(u8::from(k == l)) + added[(k, l)] * n / (pairs(k) * pairs(l)).sqrt()
    });
    let r = DVector::from_fn(lags, |k, _| {
        sums(&|t| e[t] * at(&e, t, k + 1)) / square * ((n + 2.0) / pairs(k)).sqrt()
    });
    let expected = n * r.dot(&(c.try_inverse().unwrap() * &r));
    assert_eq!((found.ljung_box.lags, found.ljung_box.degrees), (lags, 19.0));
    assert!(close(found.ljung_box.statistic, expected, 1e-9), "{} {expected}", found.ljung_box.statistic);
    // Anderson's bands are as much wider.
    let wide = |k: usize| {
        n.sqrt() * (sums(&|t| e[t] * at(&e, t, k + 1)) / square * n / pairs(k)).abs()
            / (1.0 + added[(k, k)]).sqrt()
    };
    let outside = (0..9).filter(|&k| wide(k) > two_sided(0.2)).count();
    assert_eq!((found.anderson.lags, found.anderson.levels[1].outside), (9, outside));
}

#[test]
fn a_wrong_delay_is_seen_at_its_lag() {
    let (u, y) = experiment(400, 0.1);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::arx(2, &[2], &[3]).unwrap();
    let estimate = arx(&record, &orders, Initial::Drop).unwrap();
    let model = named(estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default()).unwrap());
    let found = tested(&model, &record, NullDistribution::Fitted).unwrap();
    let test = &found.independence[0];
    assert!(test.past.p_value.unwrap() < 1e-9);
    let past = &test.correlation[26..];
    assert!(past.iter().all(|value| value.abs() <= past[0].abs()) && past[0] > 2.0 * test.band[26]);
    assert!(test.feedback.p_value.unwrap() > 0.05);
}

#[test]
fn an_input_that_is_not_rich_has_few_directions() {
    let mut noise = Noise(13);
    let u: Vec<f64> = (0..500).map(|t| (0.3 * f64::from(t)).sin()).collect();
    let y = noise.take(500);
    let orders = Orders::arx(0, &[1], &[1]).unwrap();
    let model = named(PolynomialModel::from_parameters(&orders, &[0.0], None, 1.0, 1.0).unwrap());
    let test = |u: &[f64]| {
        tested(&model, &Record::new(&y, vec![u]).unwrap(), NullDistribution::Known).unwrap().independence
    };
    // A sinusoid has two, and a few at the ends.
    assert!((2.0..=5.0).contains(&test(&u)[0].past.degrees), "{}", test(&u)[0].past.degrees);
    // A constant has none.
    let constant = test(&[3.7; 500]);
    assert_eq!((constant[0].past.degrees, constant[0].past.p_value), (0.0, None));
    assert_eq!((constant[0].feedback.p_value, constant[0].band[3]), (None, 0.0));
}

#[test]
fn offsets_are_no_matter_of_dynamics() {
    let (u, y) = experiment(300, 0.3);
    let plain = tested(&truth(), &Record::new(&y, vec![&u]).unwrap(), NullDistribution::Known).unwrap();
    let moved: Vec<f64> = y.iter().map(|y| y + 2.0).collect();
    let found = tested(&truth(), &Record::new(&moved, vec![&u]).unwrap(), NullDistribution::Known).unwrap();
    assert!(close(found.ljung_box.statistic, plain.ljung_box.statistic, 1e-9));
    assert!(close(found.independence[0].past.statistic, plain.independence[0].past.statistic, 1e-9));
}

#[test]
fn residuals_that_cannot_be_tested_say_why() {
    let (u, y) = experiment(200, 0.3);
    let with = |y: &[f64]| {
        let found = tested(&truth(), &Record::new(y, vec![&u[..y.len()]]).unwrap(), NullDistribution::Fitted);
        found.map(|_| ()).map_err(|why| why.to_string())
    };
    assert_eq!(with(&y[..16]), Ok(()));
    assert!(with(&y[..15]).unwrap_err().contains("13 samples count, and tests need 14"));
    let (_, clean) = experiment(200, 0.0);
    assert!(with(&clean).unwrap_err().contains("all but rounding"));
    let huge: Vec<f64> = y.iter().map(|y| 1e200 * y).collect();
    assert!(with(&huge).unwrap_err().contains("range of numbers"));
    assert!(with(&[0.0; 200]).is_ok());
    let alone = Orders::arx(1, &[], &[]).unwrap();
    let model = PolynomialModel::from_parameters(&alone, &[-0.5], None, 1.0, 1.0).unwrap();
    let silent = [0.0; 50];
    let found = tested(&model, &Record::new(&silent, vec![]).unwrap(), NullDistribution::Known);
    assert_eq!(found.map(|_| ()), Err(Untestable::Nothing));
}

#[test]
fn short_logs_have_fewer_lags() {
    let (u, y) = experiment(400, 0.3);
    let of = |segments: Vec<Range<usize>>| {
        let past = vec![0; segments.len()];
        let record = Record { segments, past, ..Record::new(&y, vec![&u]).unwrap() };
        let found = tested(&truth(), &record, NullDistribution::Known).unwrap();
        (found.ljung_box.lags, found.anderson.lags, found.independence[0].past.lags)
    };
    assert_eq!(of(std::iter::once(0..400).collect()), (25, 19, 25));
    // Of an input ten more than the plant has parameters, after its delay.
    assert_eq!(of(std::iter::once(0..82).collect()), (8, 4, 15));
    // Of segments of eight samples that count, three quarters have a partner six steps before: no more lags.
    assert_eq!(of((0..40).map(|k| 10 * k..10 * k + 10).collect()), (6, 6, 6));
}

#[test]
fn dependent_columns_have_an_inverse_among_others() {
    let matrix = DMatrix::from_row_slice(3, 3, &[4.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1e-6]);
    let inverse = pseudo_inverse(&matrix).unwrap();
    assert!((&matrix * &inverse * &matrix - &matrix).amax() < 1e-12);
    assert!(close(inverse[(2, 2)], 1e6, 1e-9));
    assert!(pseudo_inverse(&DMatrix::from_element(2, 2, f64::NAN)).is_none());
    assert_eq!(pseudo_inverse(&DMatrix::zeros(2, 2)).unwrap().amax(), 0.0);
}
