use thetahat_numerics::noise::Noise;

use super::*;
use crate::data::{Log, Record};
use crate::tests::channel;

/// y(t) = 1.2 y(t-1) - 0.4 y(t-2) + 0.5 u(t-1) + 0.3 + 0.01 t + 0.1 e(t).
fn signals(seed: u64, count: usize) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(seed);
    let u = noise.take(count);
    let mut y = vec![0.0; count];
    for t in 2..count {
        let drift = 0.3 + 0.01 * t as f64;
        y[t] = 1.2 * y[t - 1] - 0.4 * y[t - 2] + 0.5 * u[t - 1] + drift + 0.1 * noise.normal();
    }
    (u, y)
}

fn record<'a>(u: &'a [f64], y: &'a [f64]) -> Record<'a> {
    Record { segments: vec![0..90, 100..103, 120..200], past: vec![0; 3], ..Record::new(y, vec![u]).unwrap() }
}

#[test]
fn a_linear_model_says_exactly_what_a_constant_is_worth() {
    let (u, y) = signals(1, 200);
    let record = record(&u, &y);
    let ones = vec![vec![1.0; 200]];
    let all = [Orders::arx(2, &[3], &[0]), Orders::arx(0, &[2], &[4]), Orders::arx(4, &[1], &[1])];
    for orders in all.map(Result::unwrap) {
        for initial in [Initial::Drop, Initial::Zero] {
            let without = arx(&record, &orders, initial).unwrap();
            let with = arx(&record.with_inputs(&ones), &orders.with_constants(1), initial).unwrap();
            let samples = without.samples() as f64;
            let decrease = samples * (without.mse() - with.mse());
            let of = OfConstant::new(&record, &orders, &without).unwrap();
            let found = of.errors * of.errors / of.left;
            // What all parameters would be, and how certain, to the noise variance of either.
            let (rows, step) = of.joint(&without);
            let mut beside = beside(200);
            beside.ramp = None;
            let place = beside.places(&orders).start;
            let ratio = with.noise_variance() / without.noise_variance();
            let last = with.parameters()[place];
            assert!((step[step.len() - 1] - last).abs() < 1e-9 * last.abs(), "{orders}");
            for (k, (found, start)) in step.iter().zip(without.parameters()).enumerate() {
                assert!((start + found - with.parameters()[k]).abs() < 1e-9, "{orders} {k}");
                for (l, entry) in rows[k].iter().enumerate() {
                    let expected = with.covariance().unwrap()[k][l];
                    assert!(
                        (entry * ratio - expected).abs() < 1e-7 * with.noise_variance(),
                        "{orders} {k} {l}"
                    );
                }
            }
            assert!(
                (found - decrease).abs() < 1e-9 * samples * without.mse(),
                "{orders}: {found} {decrease}"
            );
        }
    }
}

/// An estimate with a constant and a trend, and what they are called.
fn with_line(orders: &Orders, beside: &Beside) -> Estimate {
    let (u, y) = signals(2, 200);
    let signals = beside.signals();
    arx(&record(&u, &y).with_inputs(&signals), &orders.with_constants(2), Initial::Drop).unwrap()
}

fn beside(count: usize) -> Beside {
    let channel = channel("y", vec![0.0; count]);
    let log = Log::new(vec![channel], 0.5).unwrap();
    Beside::new(&log, &[10..90, 100..180], true).unwrap()
}

#[test]
fn the_line_of_the_output_is_that_of_the_equation() {
    let orders = Orders::arx(2, &[1], &[1]).unwrap();
    let beside = beside(200);
    let all = with_line(&orders, &beside);
    let parameters = all.parameters().to_vec();
    let Fitted { estimate, offset, .. } = beside.apart(&orders, all).unwrap();
    assert_eq!(estimate.parameters(), &parameters[..3]);
    assert_eq!(estimate.covariance().map(<[_]>::len), Some(3));
    let (line, ramp) = (offset.unwrap().offset, beside.ramp.unwrap());
    let at = |row: usize| line.at(0.5 * row as f64);
    for (row, ramp) in ramp.iter().enumerate().skip(2) {
        let left = at(row) + parameters[0] * at(row - 1) + parameters[1] * at(row - 2);
        let right = parameters[3] + parameters[4] * ramp;
        assert!((left - right).abs() < 1e-12, "{row}: {left} {right}");
    }
}

#[test]
fn errors_of_level_and_slope_are_those_of_the_parameters() {
    let orders = Orders::arx(2, &[1], &[1]).unwrap();
    let beside = beside(200);
    let all = with_line(&orders, &beside);
    let covariance = all.covariance().unwrap().to_vec();
    let figures = |parameters: Vec<f64>| {
        let moved = Estimate { parameters, ..all.clone() };
        let found = beside.apart(&orders, moved).unwrap().offset.unwrap();
        [found.level, found.slope.unwrap()]
    };
    let shifted = |at: usize, by: f64| {
        let mut parameters = all.parameters().to_vec();
        parameters[at] += by;
        figures(parameters)
    };
    let found = figures(all.parameters().to_vec());
    for (which, figure) in found.iter().enumerate() {
        let step = 1e-6;
        let gradient: Vec<f64> = (0..covariance.len())
            .map(|at| (shifted(at, step)[which].value - shifted(at, -step)[which].value) / (2.0 * step))
            .collect();
        let row = |row: &Vec<f64>| row.iter().zip(&gradient).map(|(entry, g)| entry * g).sum::<f64>();
        let variance: f64 = covariance.iter().zip(&gradient).map(|(entries, g)| g * row(entries)).sum();
        let error = figure.standard_error.unwrap();
        assert!((error / variance.sqrt() - 1.0).abs() < 1e-6, "{which}: {error} {}", variance.sqrt());
    }
}
