use thetahat_core::nalgebra::Complex;

use super::*;
use crate::data::Offset;
use crate::respond::process::{response_slopes, responses, run};

pub(crate) fn model(words: &[&str], values: &[f64]) -> ProcessModel {
    let structures: Vec<ProcessStructure> = words.iter().map(|word| word.parse().unwrap()).collect();
    let signal = |name: String| Signal { name, offset: Offset::default() };
    let inputs: Vec<Signal> = (1..=words.len()).map(|number| signal(format!("u{number}"))).collect();
    let names: Vec<String> = inputs.iter().map(|input| input.name.clone()).collect();
    let parameters = ProcessModel::names(&structures, &names).into_iter().zip(values);
    let parameters =
        parameters.map(|(name, &value)| Parameter { name, value, standard_error: Some(0.1) }).collect();
    let row = |i: usize| (0..values.len()).map(|j| if i == j { 0.01 } else { 0.0 }).collect();
    ProcessModel {
        structures,
        sample_time: 0.5,
        inputs,
        output: signal("y".to_owned()),
        parameters,
        covariance: Some((0..values.len()).map(row).collect()),
        offset_covariance: None,
        noise_variance: 0.04,
        degrees_of_freedom: Some(90),
        free_start: false,
    }
}

/// The response to a unit step at 0, at some times.
fn step(word: &str, values: &[f64], times: &[f64]) -> Vec<f64> {
    let structure: ProcessStructure = word.parse().unwrap();
    let parts = structure.taken_apart(values);
    let clock: Vec<f64> = [&[-1.0, 0.0], times].concat();
    let mut input = vec![1.0; clock.len()];
    input[0] = 0.0;
    let mut found = Vec::new();
    run(&structure, &parts.shape, parts.dead_time, (&clock, &input), |row, columns| {
        let said: f64 = parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum();
        if row > 1 {
            found.push(said);
        }
    });
    found
}

#[test]
fn step_responses_are_those_of_the_textbook() {
    let times = [0.1, 0.35, 1.0, 2.5, 2.75, 9.0, 40.0];
    let near = |found: Vec<f64>, expected: &dyn Fn(f64) -> f64| {
        for (value, t) in found.iter().zip(times) {
            assert!((value - expected(t)).abs() < 2e-14, "{t}: {value} {}", expected(t));
        }
    };
    near(step("p1", &[2.0, 3.0], &times), &|t| 2.0 * (1.0 - (-t / 3.0_f64).exp()));
    near(step("p1d", &[2.0, 3.0, 0.4], &times), &|t| 2.0 * (1.0 - (-(t - 0.4).max(0.0) / 3.0).exp()));
    // Equal time constants, of which a sum of exponentials has no digit left.
    near(step("p2", &[1.0, 2.0, 2.0], &times), &|t| 1.0 - (1.0 + t / 2.0) * (-t / 2.0_f64).exp());
    near(step("p3", &[1.0, 2.0, 2.0, 2.0], &times), &|t| {
        let x: f64 = t / 2.0;
        1.0 - (1.0 + x + x * x / 2.0) * (-x).exp()
    });
    near(step("p1z", &[1.0, 2.0, 0.5], &times), &|t| 1.0 - (1.0 - 0.25) * (-t / 2.0_f64).exp());
    near(step("p0i", &[0.7], &times), &|t| 0.7 * t);
    near(step("p1di", &[0.7, 2.0, 0.3], &times), &|t| {
        let s = (t - 0.3_f64).max(0.0);
        0.7 * (s - 2.0 * (1.0 - (-s / 2.0).exp()))
    });
    near(step("p2u", &[1.0, 3.0, 0.2], &times), &|t| {
        let (omega, zeta): (f64, f64) = (3.0, 0.2);
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        let sine = zeta * omega / damped * (damped * t).sin();
        1.0 - (-zeta * omega * t).exp() * ((damped * t).cos() + sine)
    });
    near(step("rc2", &[0.1, 1.0, 0.5, 2.0, 8.0], &times), &|t| {
        0.1 + 1.0 * (1.0 - (-t / 0.5_f64).exp()) + 2.0 * (1.0 - (-t / 8.0_f64).exp())
    });
}

#[test]
fn polynomials_respond_as_the_process_does_at_the_samples() {
    let cases: [(&str, &[f64]); 13] = [
        ("tf21d", &[-1.0, 3.0, 1.2, 4.0, 0.37]),
        ("tf22", &[0.3, -1.0, 3.0, 1.2, 4.0]),
        ("tf31i", &[1.0, 2.0, 1.5, 3.0]),
        ("p1d", &[2.0, 3.0, 1.2]),
        ("p1d", &[2.0, 3.0, 1.5]),
        ("p1", &[2.0, 3.0]),
        ("p2d", &[1.0, 4.0, 0.3, 0.2]),
        ("p3d", &[1.0, 4.0, 2.0, 0.3, 0.9]),
        ("p2du", &[1.0, 2.0, 0.2, 0.7]),
        ("p1dz", &[1.0, 2.0, -0.6, 0.7]),
        ("p1di", &[0.5, 2.0, 0.3]),
        ("p0di", &[0.5, 1.1]),
        ("rc2", &[0.1, 1.0, 0.5, 2.0, 8.0]),
    ];
    for (word, values) in cases {
        let model = model(&[word], values);
        let linear = model.linear().unwrap();
        let response = crate::respond::step_response(&linear, 0, Some(40)).unwrap();
        let times: Vec<f64> = (1..40).map(|k| 0.5 * f64::from(k)).collect();
        let own = step(word, values, &times);
        for (k, expected) in own.iter().enumerate() {
            let value = response.values[k + 1].value;
            assert!((value - expected).abs() < 1e-11, "{word} {k}: {value} {expected}");
        }
        // Errors by the polynomials against differences of the process's own response.
        let variance = |k: usize| -> f64 {
            let by = |place: usize| {
                let moved = |by: f64| {
                    let mut values = values.to_vec();
                    values[place] += by;
                    step(word, &values, &times)[k]
                };
                (moved(1e-6) - moved(-1e-6)) / 2e-6
            };
            (0..values.len()).map(|place| 0.01 * by(place).powi(2)).sum()
        };
        // Where the dead time is no whole number of samples: there the response has a corner.
        if word != "p1d" || values[2] == 1.2 {
            for k in [6, 20] {
                let error = response.values[k + 1].standard_error.unwrap();
                assert!((error / variance(k).sqrt() - 1.0).abs() < 1e-5, "{word} {k}: {error}");
            }
        }
    }
}

#[test]
fn words_are_read_and_written() {
    for word in [
        "p1", "p1d", "p2d", "p2du", "p3d", "p1dz", "p1di", "p0i", "p0di", "p3dziu", "rc1", "rc3", "tf10",
        "tf66d", "tf32di",
    ] {
        let structure: ProcessStructure = word.parse().unwrap();
        assert_eq!(structure.to_string(), word);
        assert_eq!(structure.names().len(), structure.parameters());
        let values: Vec<f64> = (0..structure.parameters()).map(|place| 1.5 + place as f64).collect();
        let parts = structure.taken_apart(&values);
        assert_eq!(structure.put_together(&parts), values);
        assert_eq!(parts.weights.len(), structure.columns());
        assert_eq!(serde_json::from_str::<ProcessStructure>(&format!("\"{word}\"")).unwrap(), structure);
    }
    for wrong in [
        "", "p", "p4", "p1x", "p1dd", "p1u", "p0", "p0d", "p0zi", "rc0", "rc2d", "q1", "p-1", "rc", "tf",
        "tf1", "tf12", "tf70", "tf00", "tf10i", "tf22i", "tf10dd", "tf10z",
    ] {
        let error = wrong.parse::<ProcessStructure>().unwrap_err();
        assert!(matches!(error, Error::Argument { ref argument, .. } if argument == "structure"), "{wrong}");
    }
}

#[test]
fn coefficients_have_powers_of_seconds_in_their_units() -> Result<(), Error> {
    let structure: ProcessStructure = "tf31di".parse()?;
    let units: Vec<&str> = structure.names().iter().map(|name| structure.unit(name)).collect();
    assert_eq!(units, ["y/u/s^2", "y/u/s^3", "1/s", "1/s^2", "s"]);
    assert_eq!(structure.equation(), "(b1 s + b0) e^(-theta s)/(s (s^2 + a1 s + a0))");
    Ok(())
}

#[test]
fn a_damaged_model_is_refused() {
    let good = model(&["p1d", "p2"], &[1.0, 2.0, 0.3, 2.0, 4.0, 1.0]);
    assert!(good.check().is_ok());
    assert_eq!(good.parameters[0].name, "K[u1]");
    let damages: [fn(&mut ProcessModel); 10] = [
        |model| model.structures.truncate(1),
        |model| model.parameters[0].name = "K".to_owned(),
        |model| model.parameters[1].value = 0.0,
        |model| model.parameters[2].value = -0.1,
        |model| model.parameters[3].value = f64::NAN,
        |model| model.output.name = "u1".to_owned(),
        |model| model.sample_time = 0.0,
        |model| model.noise_variance = -1.0,
        |model| model.covariance = Some(vec![]),
        |model| {
            let covariance = vec![vec![1.0; 6]; 6];
            model.offset_covariance = Some(OffsetCovariance { covariance, middle: None });
        },
    ];
    for damage in damages {
        let mut model = good.clone();
        damage(&mut model);
        assert!(matches!(model.check(), Err(Error::Report { .. })));
    }
}

#[test]
fn frequency_responses_are_those_of_the_polynomials_and_their_slopes_those_of_differences() {
    let cases: [(&str, &[f64]); 11] = [
        ("tf21d", &[-1.0, 3.0, 1.2, 4.0, 0.37]),
        ("tf41", &[-12.0, 20.0, 3.0, 28.0, 20.0, 30.0]),
        ("tf31i", &[1.0, 2.0, 1.5, 3.0]),
        ("p1d", &[2.0, 3.0, 1.2]),
        ("p2d", &[1.0, 4.0, 0.3, 0.2]),
        ("p3d", &[1.0, 4.0, 2.0, 0.3, 0.9]),
        ("p2du", &[1.0, 2.0, 0.2, 0.7]),
        ("p3dzu", &[1.0, 2.0, 0.2, 1.5, -0.4, 0.73]),
        ("p1dz", &[1.0, 2.0, -0.6, 0.7]),
        ("p1di", &[0.5, 2.0, 0.3]),
        ("rc2", &[0.1, 1.0, 0.5, 2.0, 8.0]),
    ];
    let frequencies = [0.03, 0.4, 2.0, 6.2];
    for (word, values) in cases {
        let structure: ProcessStructure = word.parse().unwrap();
        let response = |values: &[f64]| {
            let parts = structure.taken_apart(values);
            let mut found = Vec::new();
            responses(&structure, &parts.shape, parts.dead_time, (&frequencies, Some(0.5)), |_, re, im| {
                let sum =
                    |columns: &[f64]| parts.weights.iter().zip(columns).map(|(w, c)| w * c).sum::<f64>();
                found.push([sum(re), sum(im)]);
            });
            found
        };
        let own = response(values);
        let linear = model(&[word], values).linear().unwrap();
        let of_polynomials = crate::respond::frequency_response(&linear, &frequencies).unwrap();
        for (own, point) in own.iter().zip(&of_polynomials[0].points) {
            let apart = (own[0] - point.re).hypot(own[1] - point.im);
            assert!(apart < 1e-9 * point.magnitude.value.max(1e-3), "{word} {}: {apart}", point.frequency);
        }
        let parts = structure.taken_apart(values);
        let mut slopes = vec![0.0; values.len()];
        response_slopes(&structure, &parts, (&frequencies, Some(0.5)), |row, seen, by| {
            for side in 0..2 {
                let [shape @ .., dead_time] = by[side];
                structure.own_slopes(&parts, seen[side], shape, *dead_time, &mut slopes);
                for (place, slope) in slopes.iter().enumerate() {
                    let moved = |by: f64| {
                        let mut values = values.to_vec();
                        values[place] += by;
                        response(&values)[row][side]
                    };
                    let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    assert!((slope - difference).abs() < 1e-7, "{word} {place} {row}: {slope} {difference}");
                }
            }
        });
    }
}

#[test]
fn responses_to_sines_are_the_transfer_functions() {
    type Transfer = fn(Complex<f64>) -> Complex<f64>;
    let cases: [(&str, &[f64], Transfer); 5] = [
        ("p2d", &[3.0, 4.0, 2.0, 0.7], |s| (s * -0.7).exp() * 3.0 / ((s * 4.0 + 1.0) * (s * 2.0 + 1.0))),
        ("p1di", &[0.5, 2.0, 0.3], |s| (s * -0.3).exp() * 0.5 / (s * (s * 2.0 + 1.0))),
        ("p2uz", &[1.5, 2.0, 0.2, -0.4], |s| (s * -0.4 + 1.0) * 1.5 / (s * 0.2 + s * s / 4.0 + 1.0)),
        ("rc2", &[0.1, 1.0, 0.5, 2.0, 8.0], |s| (s * 0.5 + 1.0).inv() + (s * 8.0 + 1.0).inv() * 2.0 + 0.1),
        ("tf22", &[0.3, -1.0, 2.0, 0.4, 5.0], |s| (s * s * 0.3 - s + 2.0) / (s * s + s * 0.4 + 5.0)),
    ];
    let frequencies = [0.03, 0.4, 2.0, 60.0];
    for (word, values, transfer) in cases {
        let structure: ProcessStructure = word.parse().unwrap();
        let response = |values: &[f64]| {
            let parts = structure.taken_apart(values);
            let mut found = Vec::new();
            responses(&structure, &parts.shape, parts.dead_time, (&frequencies, None), |_, re, im| {
                let sum =
                    |columns: &[f64]| parts.weights.iter().zip(columns).map(|(w, c)| w * c).sum::<f64>();
                found.push([sum(re), sum(im)]);
            });
            found
        };
        for (own, frequency) in response(values).iter().zip(frequencies) {
            let expected = transfer(Complex::new(0.0, frequency));
            let apart = (own[0] - expected.re).hypot(own[1] - expected.im);
            assert!(apart < 1e-12 * expected.norm().max(1e-3), "{word} {frequency}: {apart}");
        }
        let parts = structure.taken_apart(values);
        let mut slopes = vec![0.0; values.len()];
        response_slopes(&structure, &parts, (&frequencies, None), |row, seen, by| {
            for side in 0..2 {
                let [shape @ .., dead_time] = by[side];
                structure.own_slopes(&parts, seen[side], shape, *dead_time, &mut slopes);
                for (place, slope) in slopes.iter().enumerate() {
                    let moved = |by: f64| {
                        let mut values = values.to_vec();
                        values[place] += by;
                        response(&values)[row][side]
                    };
                    let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    let size = difference.abs().max(1.0);
                    assert!(
                        (slope - difference).abs() < 1e-6 * size,
                        "{word} {place} {row}: {slope} {difference}"
                    );
                }
            }
        });
    }
}
