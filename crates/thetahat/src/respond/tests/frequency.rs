//! Frequency responses against their definition, finite differences and sampled parameters.

use std::f64::consts::PI;

use thetahat_numerics::noise::Noise;

use super::general::models;
use crate::Error;
use crate::model::PolynomialModel;
use crate::respond::{FrequencyPoint, frequency_response, logarithmic_frequencies};

/// A covariance matrix of some parameters, well conditioned and not diagonal.
fn spread(count: usize, size: f64, noise: &mut Noise) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let factor: Vec<Vec<f64>> =
        (0..count).map(|_| noise.take(count).iter().map(|value| size * value).collect()).collect();
    let product = |i: usize, j: usize| factor[i].iter().zip(&factor[j]).map(|(a, b)| a * b).sum::<f64>();
    let covariance = (0..count).map(|i| (0..count).map(|j| product(i, j)).collect()).collect();
    (factor, covariance)
}

fn with_parameters(
    model: &PolynomialModel,
    parameters: &[f64],
    covariance: Option<&[Vec<f64>]>,
) -> PolynomialModel {
    PolynomialModel::from_parameters(&model.orders, parameters, covariance, 0.25, 0.1).unwrap()
}

fn parameters(model: &PolynomialModel) -> Vec<f64> {
    model.parameters.iter().map(|parameter| parameter.value).collect()
}

#[test]
fn responses_are_quotients_of_polynomials_on_the_unit_circle() {
    let frequencies = logarithmic_frequencies(0.01, 31.0, 40).unwrap();
    for model in models() {
        let model = with_parameters(&model, &parameters(&model), None);
        let responses = frequency_response(&model, &frequencies).unwrap();
        assert_eq!(responses.len(), model.b.len() + 1);
        assert!(responses.last().unwrap().input.is_none());
        for (k, frequency) in frequencies.iter().enumerate() {
            let at = |polynomial: &[f64]| {
                polynomial.iter().enumerate().fold((0.0, 0.0), |(re, im), (power, value)| {
                    let angle = -(power as f64) * frequency * 0.1;
                    (re + value * angle.cos(), im + value * angle.sin())
                })
            };
            let sources = model.b.iter().zip(&model.f).chain([(&model.c, &model.d)]);
            for ((above, below), response) in sources.zip(&responses) {
                let (above, below, a) = (at(above), at(below), at(&model.a));
                let point = response.points[k];
                let magnitude = above.0.hypot(above.1) / below.0.hypot(below.1) / a.0.hypot(a.1);
                let phase = above.1.atan2(above.0) - below.1.atan2(below.0) - a.1.atan2(a.0);
                if magnitude == 0.0 {
                    assert_eq!((point.re, point.im, point.magnitude.value), (0.0, 0.0, 0.0));
                    continue;
                }
                assert!((point.magnitude.value / magnitude - 1.0).abs() < 1e-11);
                assert!((point.re - magnitude * phase.cos()).abs() < 1e-11 * magnitude);
                assert!((point.im - magnitude * phase.sin()).abs() < 1e-11 * magnitude);
                let turns = (point.phase.value - phase) / (2.0 * PI);
                assert!((turns - turns.round()).abs() < 1e-11);
                assert!(point.covariance.is_none() && point.phase.standard_error.is_none());
            }
        }
    }
}

#[test]
fn phases_are_continuous_and_do_not_depend_on_the_grid() {
    let dense: Vec<f64> = (1..=20_000).map(|k| f64::from(k) * PI / 0.1 / 20_000.0).collect();
    for model in models() {
        let model = with_parameters(&model, &parameters(&model), None);
        let responses = frequency_response(&model, &dense[..19_999]).unwrap();
        for (source, response) in
            responses.iter().enumerate().filter(|(_, r)| r.points[0].magnitude.value > 0.0)
        {
            for pair in response.points.windows(2) {
                let step = (pair[1].phase.value - pair[0].phase.value).abs();
                assert!(step < 0.1, "{:?} {source} {step}", model.structure);
            }
            let alone = frequency_response(&model, &[dense[15_000]]).unwrap();
            assert_eq!(alone[source].points[0], response.points[15_000]);
        }
    }
    // At low frequencies: the sign of the gain, and a quarter turn for each integrator.
    let phase = |a: &[f64], b: &[f64]| {
        let model = super::model(a, &[(1, b)]);
        frequency_response(&model, &[1e-5]).unwrap()[0].points[0].phase.value
    };
    assert!(phase(&[1.0, -0.5], &[1.0]).abs() < 1e-4);
    assert!((phase(&[1.0, -0.5], &[-1.0]) - PI).abs() < 1e-4);
    // A zero outside the unit circle, and a pole.
    assert!((phase(&[1.0, -0.5], &[1.0, -3.0]) - PI).abs() < 1e-4);
    assert!((phase(&[1.0, -2.0], &[1.0, -3.0])).abs() < 1e-4);
    assert!((phase(&[1.0, -1.0], &[1.0]) + PI / 2.0).abs() < 1e-4);
    assert!((phase(&[1.0, -2.0, 1.0], &[1.0]) + PI).abs() < 1e-4);
}

#[test]
fn covariances_are_those_of_finite_differences() {
    let mut noise = Noise(1);
    let frequencies = [0.3, 3.0, 25.0];
    for model in models() {
        let values = parameters(&model);
        let (factor, covariance) = spread(values.len(), 0.01, &mut noise);
        let responses =
            frequency_response(&with_parameters(&model, &values, Some(&covariance)), &frequencies).unwrap();
        let moved = |k: usize, step: f64| {
            let mut moved = values.clone();
            moved[k] += step;
            frequency_response(&with_parameters(&model, &moved, None), &frequencies).unwrap()
        };
        let step = 1e-6;
        let sides: Vec<_> = (0..values.len()).map(|k| (moved(k, step), moved(k, -step))).collect();
        for (source, response) in responses.iter().enumerate() {
            for (k, point) in response.points.iter().enumerate() {
                let of = |figure: &dyn Fn(&FrequencyPoint) -> f64| {
                    let slope = |column: usize| {
                        sides
                            .iter()
                            .zip(&factor)
                            .map(|((up, down), row)| {
                                (figure(&up[source].points[k]) - figure(&down[source].points[k]))
                                    / (2.0 * step)
                                    * row[column]
                            })
                            .sum::<f64>()
                    };
                    (0..values.len()).map(slope).collect::<Vec<f64>>()
                };
                let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let (re, im) = (of(&|point| point.re), of(&|point| point.im));
                let expected = [[inner(&re, &re), inner(&re, &im)], [inner(&re, &im), inner(&im, &im)]];
                let size = expected[0][0] + expected[1][1];
                let found = point.covariance.unwrap();
                for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                    assert!((found - expected).abs() <= 1e-6 * size, "{:?} {source} {k}", model.structure);
                }
                if point.magnitude.value == 0.0 {
                    assert_eq!((point.magnitude.standard_error, point.phase.standard_error), (None, None));
                    continue;
                }
                let (magnitude, phase) = (of(&|point| point.magnitude.value), of(&|point| point.phase.value));
                let of_magnitude = point.magnitude.standard_error.unwrap();
                assert!((of_magnitude - inner(&magnitude, &magnitude).sqrt()).abs() <= 1e-6 * size.sqrt());
                let of_phase = point.phase.standard_error.unwrap();
                let scale = size.sqrt() / point.magnitude.value;
                assert!((of_phase - inner(&phase, &phase).sqrt()).abs() <= 1e-6 * scale);
            }
        }
    }
}

#[test]
fn standard_errors_are_the_spread_of_sampled_models() {
    let mut noise = Noise(2);
    let frequencies = [0.5, 5.0, 20.0];
    for model in models() {
        let values = parameters(&model);
        let (factor, covariance) = spread(values.len(), 1e-6, &mut noise);
        let center = frequency_response(&with_parameters(&model, &values, Some(&covariance)), &frequencies);
        let center = center.unwrap();
        let runs = 1000;
        let mut squares = vec![[[0.0_f64; 2]; 3]; center.len()];
        for _ in 0..runs {
            // Uniform in -sqrt(3) … sqrt(3): a variance of 1.
            let normal: Vec<f64> = noise.take(values.len()).iter().map(|e| e * 3.0_f64.sqrt()).collect();
            let moved: Vec<f64> = values
                .iter()
                .zip(&factor)
                .map(|(value, row)| value + row.iter().zip(&normal).map(|(a, b)| a * b).sum::<f64>())
                .collect();
            let sample = frequency_response(&with_parameters(&model, &moved, None), &frequencies).unwrap();
            for ((sample, center), squares) in sample.iter().zip(&center).zip(&mut squares) {
                for ((point, middle), squares) in sample.points.iter().zip(&center.points).zip(squares) {
                    squares[0] += (point.magnitude.value - middle.magnitude.value).powi(2);
                    squares[1] += (point.phase.value - middle.phase.value).powi(2);
                }
            }
        }
        for (squares, center) in squares.iter().zip(&center) {
            for (squares, point) in squares.iter().zip(&center.points) {
                let (Some(magnitude), Some(phase)) =
                    (point.magnitude.standard_error, point.phase.standard_error)
                else {
                    continue;
                };
                if magnitude == 0.0 {
                    // H = 1 of output error.
                    assert_eq!((squares, phase), (&[0.0; 2], 0.0));
                    continue;
                }
                let found = squares.map(|square| (square / f64::from(runs)).sqrt());
                // 1000 samples: 2.2 %, four times.
                assert!(
                    (found[0] / magnitude - 1.0).abs() < 0.09,
                    "{:?} {found:?} {point:?}",
                    model.structure
                );
                assert!((found[1] / phase - 1.0).abs() < 0.09, "{:?} {found:?} {point:?}", model.structure);
            }
        }
    }
}

#[test]
fn frequencies_that_are_none_are_refused() {
    let model = super::model(&[1.0, -1.0], &[(1, &[1.0])]);
    for wrong in [-0.1, f64::NAN, f64::INFINITY, PI * 1.000_001, 0.0] {
        let refused = frequency_response(&model, &[1.0, wrong]);
        assert!(matches!(refused, Err(Error::Argument { .. })), "{wrong}");
    }
    assert!(frequency_response(&model, &[PI]).is_ok());
    assert_eq!(frequency_response(&model, &[]).unwrap()[0].points, []);
    // A zero on the unit circle has no phase to be uncertain of.
    let notch = super::model(&[1.0], &[(0, &[1.0, 0.0, 1.0])]);
    let notch = PolynomialModel { covariance: Some(vec![vec![0.0; 3]; 3]), ..notch };
    let point = frequency_response(&notch, &[PI / 2.0]).unwrap()[0].points[0];
    assert_eq!((point.magnitude.value, point.phase.standard_error), (0.0, None));
    for (first, last, count) in [
        (0.0, 1.0, 3),
        (1.0, 1.0, 3),
        (2.0, 1.0, 3),
        (1.0, f64::NAN, 3),
        (1.0, f64::INFINITY, 3),
        (1.0, 2.0, 1),
    ] {
        assert!(logarithmic_frequencies(first, last, count).is_err());
    }
}
