//! Responses against their definitions, sample by sample. Here those of ARX models, in `general` those of all others.

mod deviations;
mod draws;
mod forecast;
mod frequency;
mod general;
mod transient;

use std::ops::Range;

use thetahat_numerics::noise::Noise;

use super::{InitialCondition, Response, predict, simulate};
use crate::data::Record;
use crate::model::{
    Orders, PolynomialModel,
    polynomial::{inverse_series, product},
};

/// A(q) y(t) = sum_j B_j(q) u_j(t); `b` holds nk and the coefficients of each input.
fn model(a: &[f64], b: &[(usize, &[f64])]) -> PolynomialModel {
    let nb: Vec<usize> = b.iter().map(|(_, b)| b.len()).collect();
    let nk: Vec<usize> = b.iter().map(|(nk, _)| *nk).collect();
    let orders = Orders::arx(a.len() - 1, &nb, &nk).unwrap();
    let parameters: Vec<f64> = a[1..].iter().chain(b.iter().flat_map(|(_, b)| b.iter())).copied().collect();
    PolynomialModel::from_parameters(&orders, &parameters, None, 0.0, 1.0).unwrap()
}

/// A with these real roots.
fn with_poles(poles: &[f64]) -> Vec<f64> {
    poles.iter().fold(vec![1.0], |a, pole| product(&a, &[1.0, -pole]))
}

/// Runs the difference equation over `rows`, its definition; before `start` all signals are zero.
fn run(model: &PolynomialModel, start: usize, rows: Range<usize>, inputs: &[&[f64]], y: &mut [f64]) {
    for t in rows {
        let driven: f64 = model
            .b
            .iter()
            .zip(inputs)
            .flat_map(|(b, u)| (0..b.len().min(t + 1 - start)).map(|lag| b[lag] * u[t - lag]))
            .sum();
        let past = 1..model.a.len().min(t + 1 - start);
        y[t] = driven - past.map(|lag| model.a[lag] * y[t - lag]).sum::<f64>();
    }
}

/// The output of the model to `inputs` from rest.
fn output(model: &PolynomialModel, inputs: &[&[f64]]) -> Vec<f64> {
    let mut y = vec![0.0; inputs[0].len()];
    run(model, 0, 0..y.len(), inputs, &mut y);
    y
}

/// The largest difference over the samples that count, as a fraction of the largest expected value.
fn difference(response: &Response, expected: &[f64]) -> f64 {
    let counted = || response.counted.iter().cloned().flatten();
    let largest = counted().fold(0.0_f64, |largest, t| largest.max(expected[t].abs()));
    // A NaN does not count as small.
    let worst = counted().map(|t| (response.values[t] - expected[t]).abs());
    worst.fold(0.0_f64, |worst, now| if now <= worst { worst } else { now }) / largest
}

fn models() -> Vec<PolynomialModel> {
    vec![
        model(&with_poles(&[0.9, -0.5]), &[(1, &[1.0, 0.3])]),
        model(&with_poles(&[0.7]), &[(3, &[0.5, -0.2, 0.1, 0.7]), (0, &[1.0])]),
        model(&[1.0], &[(2, &[1.0, 2.0, 3.0])]),
        model(&[1.0, -0.8, 0.0, 0.0], &[(1, &[1.0])]),
        model(&[1.0, -1.6, 0.95], &[(1, &[0.0, 1.0]), (7, &[-1.0, 0.4])]),
        model(&with_poles(&[0.9999, 0.5]), &[(1, &[0.01])]),
        model(&with_poles(&[1.0, 0.9]), &[(1, &[0.1, 0.2])]),
        model(&with_poles(&[1.02, 0.3]), &[(2, &[1.0])]),
        model(&with_poles(&[0.9; 5]), &[(1, &[1.0])]),
    ]
}

/// This many signals of `length` samples.
fn signals(count: usize, length: usize, noise: &mut Noise) -> Vec<Vec<f64>> {
    (0..count).map(|_| noise.take(length)).collect()
}

fn views(signals: &[Vec<f64>]) -> Vec<&[f64]> {
    signals.iter().map(Vec::as_slice).collect()
}

/// Segments of all lengths, and how many samples before each may be used.
fn cut<'a>(output: &'a [f64], inputs: &'a [Vec<f64>]) -> Record<'a> {
    let segments = vec![0..1, 3..60, 61..69, 70..140];
    Record { output, inputs: views(inputs), segments, past: vec![0, 2, 0, 7] }
}

#[test]
fn a_prediction_is_the_difference_equation_run_from_measured_samples() {
    let mut noise = Noise(1);
    for model in models() {
        let (u, y) = (signals(model.b.len(), 150, &mut noise), noise.take(150));
        let record = cut(&y, &u);
        for horizon in [1, 2, 5, 40, 1000] {
            for start in [InitialCondition::Zero, InitialCondition::Drop] {
                let skipped = if start == InitialCondition::Zero {
                    0
                } else {
                    model.orders.maximum_lag() + horizon - 1
                };
                let mut expected = vec![f64::NAN; 150];
                let mut counted = Vec::new();
                for (segment, past) in record.segments.iter().zip(&record.past) {
                    let begin =
                        if start == InitialCondition::Zero { segment.start } else { segment.start - past };
                    let rows = segment.start.max(begin + skipped)..segment.end;
                    if rows.is_empty() {
                        continue;
                    }
                    counted.push(rows.clone());
                    for t in rows {
                        let mut known = y.clone();
                        let first = (t + 1).saturating_sub(horizon).max(begin);
                        run(&model, begin, first..t + 1, &record.inputs, &mut known);
                        expected[t] = known[t];
                    }
                }
                let response = predict(&model, &record, horizon, start).unwrap();
                assert_eq!(response.counted, counted);
                assert!(
                    counted.is_empty() || difference(&response, &expected) < 1e-11,
                    "{model:?} {horizon}"
                );
            }
        }
    }
}

#[test]
fn no_horizon_is_too_far() {
    let model = model(&with_poles(&[0.9]), &[(1, &[1.0])]);
    let u = [1.0, 2.0, 3.0];
    let record = Record::new(&u, vec![&u]).unwrap();
    let far = predict(&model, &record, usize::MAX, InitialCondition::Zero).unwrap();
    assert_eq!(far, predict(&model, &record, 3, InitialCondition::Zero).unwrap());
    let run = simulate(&model, &record, InitialCondition::Zero).unwrap();
    assert!(difference(&far, &run.values) < 1e-15);
    assert_eq!(predict(&model, &record, usize::MAX, InitialCondition::Drop).unwrap().counted, []);
    assert!(predict(&model, &record, 0, InitialCondition::Zero).is_err());
}

#[test]
fn a_free_run_is_the_difference_equation() {
    let mut noise = Noise(2);
    for model in models() {
        let (u, y) = (signals(model.b.len(), 150, &mut noise), noise.take(150));
        let record = cut(&y, &u);
        for start in [InitialCondition::Zero, InitialCondition::Drop] {
            let mut expected = vec![f64::NAN; 150];
            let mut counted = Vec::new();
            for (segment, past) in record.segments.iter().zip(&record.past) {
                let (begin, known) = match start {
                    InitialCondition::Zero => (segment.start, 0),
                    _ => (segment.start - past, model.orders.maximum_lag()),
                };
                let rows = segment.start.max(begin + known)..segment.end;
                if rows.is_empty() {
                    continue;
                }
                let mut known = y.clone();
                run(&model, begin, rows.clone(), &record.inputs, &mut known);
                expected[rows.clone()].copy_from_slice(&known[rows.clone()]);
                counted.push(rows);
            }
            let response = simulate(&model, &record, start).unwrap();
            assert_eq!(response.counted, counted);
            assert!(difference(&response, &expected) < 1e-11, "{model:?} {start:?}");
        }
    }
}

#[test]
fn an_estimated_start_makes_up_for_any_past() {
    let mut noise = Noise(3);
    for model in models() {
        let u = signals(model.b.len(), 500, &mut noise);
        let y = output(&model, &views(&u));
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: vec![50..120, 130..150, 200..500],
            past: vec![0; 3],
        };
        let response = simulate(&model, &record, InitialCondition::Estimate).unwrap();
        assert_eq!(response.counted, record.segments);
        assert!(difference(&response, &y) < 1e-10, "{model:?} {}", difference(&response, &y));
    }
}

#[test]
fn growing_and_silent_starts_are_estimated() {
    let mut noise = Noise(5);
    let u = signals(1, 1000, &mut noise);
    // The delays of a growing response differ by rounding only, and still the output comes back.
    for poles in [&[1.05][..], &[1.01, 1.01], &[1.0; 3], &[0.9999; 3]] {
        let model = model(&with_poles(poles), &[(3, &[1.0, 0.5])]);
        let y = output(&model, &views(&u));
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: std::iter::once(60..1000).collect(),
            past: vec![0],
        };
        let response = simulate(&model, &record, InitialCondition::Estimate).unwrap();
        assert!(difference(&response, &y) < 1e-9, "{poles:?} {:e}", difference(&response, &y));
        // From rest there is nothing to estimate.
        let record = Record::new(&y, views(&u)).unwrap();
        let response = simulate(&model, &record, InitialCondition::Estimate).unwrap();
        assert!(difference(&response, &y) < 1e-9, "{poles:?}");
    }
}

#[test]
fn an_estimated_start_is_the_best_there_is() {
    let mut noise = Noise(4);
    for model in models() {
        let u = signals(model.b.len(), 300, &mut noise);
        let y: Vec<f64> = output(&model, &views(&u)).iter().map(|y| y + noise.uniform()).collect();
        let record = Record {
            output: &y,
            inputs: views(&u),
            segments: std::iter::once(40..240).collect(),
            past: vec![0],
        };
        let values = &simulate(&model, &record, InitialCondition::Estimate).unwrap().values[40..240];
        let errors: Vec<f64> = y[40..240].iter().zip(values).map(|(y, x)| y - x).collect();
        let size = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        // The errors are orthogonal to every initial-condition response: moving along one only makes them larger.
        let free = inverse_series(&model.a, 200);
        for delay in 0..model.orders.maximum_lag() {
            let slope: f64 = errors[delay..].iter().zip(&free).map(|(e, h)| e * h).sum();
            assert!(slope.abs() < 1e-8 * size(&errors) * size(&free), "{model:?} {delay}");
        }
    }
}

#[test]
fn what_overflows_is_an_error_or_infinite_and_never_a_panic() {
    let u = vec![1.0; 3000];
    for pole in [2.0, -2.0, 1e200] {
        let model = model(&with_poles(&[pole]), &[(1, &[1.0])]);
        let record = Record::new(&u, vec![&u]).unwrap();
        assert!(simulate(&model, &record, InitialCondition::Estimate).is_err());
        for start in [InitialCondition::Zero, InitialCondition::Drop] {
            assert_eq!(simulate(&model, &record, start).unwrap().values.len(), 3000);
            assert_eq!(predict(&model, &record, 2900, start).unwrap().values.len(), 3000);
        }
    }
}
