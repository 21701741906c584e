//! Transfer functions of linear equations.

use thetahat_core::nalgebra::Complex;

use crate::model::equations::{Drive, Work};
use crate::model::{EquationsModel, GreyBox};

/// Three states, two inputs of which one acts at once, two outputs, and two unknown parameters of which one has a
/// bound.
const TEXT: &str = "\
sample_time = 0.1
[states]
a = { start = 1, sd = 1 }
b = { start = -2, sd = 1 }
c = { start = 0, sd = 1 }
[inputs]
u = 'u'
v = 'v'
[parameters]
k = { start = 2, sd = 1, unknown = true, min = 0 }
m = { start = -0.3, sd = 1, unknown = true }
[derivative]
a = 'b - k * a + 0.5 * v'
b = 'm * a - 2 * b + u'
c = 'k * a - c - 0.2 * v + 1'
[outputs]
y = 'c + m * v'
z = 'a - b + 3'
[noise]
measurement = { y = 0.1, z = 0.2 }
";

fn stored(values: [f64; 2]) -> EquationsModel {
    let model = GreyBox::from_toml(TEXT).unwrap();
    let noise = model.measurement_variances_at_start();
    EquationsModel::new(&model, &values, vec![vec![0.04, 0.01], vec![0.01, 0.09]], &noise)
}

#[test]
fn polynomials_answer_as_the_equations_do() {
    let found = stored([1.7, -0.4]);
    let (model, z) = found.with_variables().unwrap();
    assert!(model.superposes() && !model.is_linear());
    for (output, linear) in found.linear("this test").unwrap().iter().enumerate() {
        assert_eq!(linear.orders.nk, [1, usize::from(output == 1)]);
        assert_eq!((linear.inputs.len(), linear.a.len()), (2, 4));
        assert!((linear.noise_variance - [0.01, 0.04][output]).abs() < 1e-15);
        // Two runs that differ in their inputs alone: what stands there without inputs is not theirs.
        let run = |scale: f64| {
            let (mut x, mut next) = (model.started().0, vec![0.0; 3]);
            let (mut y, mut work) = (vec![0.0; 2], Work::new());
            let each = (0..40).map(|t| {
                let u = [scale * f64::from(t % 7), scale * f64::from(t * t % 5)];
                model.observe(&x, &z, Drive::held(&u), 0.0, &mut y, &mut [0.0; 6], &mut work);
                model.advance(&x, &z, Drive::held(&u), 0.0, 0.1, &mut next, &mut [0.0; 9], &mut work);
                x.copy_from_slice(&next);
                y[output]
            });
            each.collect::<Vec<f64>>()
        };
        let expected: Vec<f64> = run(1.0).iter().zip(run(0.0)).map(|(y, without)| y - without).collect();
        let mut y = vec![0.0; 40];
        for t in 0..40 {
            for lag in 0..4_usize {
                if lag > t {
                    continue;
                }
                let then = (t - lag) as u32;
                let u = [f64::from(then % 7), f64::from(then * then % 5)];
                for (b, u) in linear.b.iter().zip(u) {
                    y[t] += b[lag] * u;
                }
                y[t] -= if lag > 0 { linear.a[lag] * y[t - lag] } else { 0.0 };
            }
            assert!((y[t] - expected[t]).abs() < 1e-11, "{output} {t} {} {}", y[t], expected[t]);
        }
    }
}

#[test]
fn their_covariance_is_that_of_the_parameters() {
    let at = [1.7, -0.4];
    let linear = |values: [f64; 2]| -> Vec<f64> {
        let found = stored(values).linear("this test").unwrap();
        found[0].parameters.iter().map(|parameter| parameter.value).collect()
    };
    let slopes: Vec<Vec<f64>> = [0, 1]
        .map(|index| {
            let moved = |side: f64| {
                let mut values = at;
                values[index] += side * 1e-5;
                linear(values)
            };
            moved(1.0).iter().zip(moved(-1.0)).map(|(high, low)| (high - low) / 2e-5).collect()
        })
        .to_vec();
    let covariance = stored(at).linear("this test").unwrap()[0].covariance.clone().unwrap();
    for (i, row) in covariance.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let [s, t] = [&slopes[0], &slopes[1]];
            let expected = 0.04 * s[i] * s[j] + 0.01 * (s[i] * t[j] + t[i] * s[j]) + 0.09 * t[i] * t[j];
            assert!((entry - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{i} {j} {entry} {expected}");
        }
    }
}

/// Of [`TEXT`], with `u` some time ago as well, or in lines.
fn changed(from: &str, to: &str) -> Result<EquationsModel, crate::Error> {
    assert!(TEXT.contains(from));
    let model = GreyBox::from_toml(&TEXT.replace(from, to))?;
    let noise = model.measurement_variances_at_start();
    let covariance = vec![vec![0.04, 0.01], vec![0.01, 0.09]];
    Ok(EquationsModel::new(&model, &[1.7, -0.4], covariance, &noise))
}

#[test]
fn inputs_that_act_later_or_go_in_lines_have_polynomials_of_their_response() {
    for (from, to) in [
        ("+ u'", "+ u + 0.7 * u(t - 0.23 * k)'"),
        ("+ u'", "+ u(t - 0.3)'"),
        ("m * v'", "m * v(t - 0.25)'"),
        ("v = 'v'", "v = { channel = 'v', hold = 'linear' }"),
    ] {
        let found = changed(from, to).unwrap();
        let (model, z) = found.with_variables().unwrap();
        let system = model.linearized(&z, Some(0.1), &mut Work::new());
        for (output, linear) in found.linear("this test").unwrap().iter().enumerate() {
            for omega in [0.0, 0.4, 3.0, 30.0] {
                let expected = crate::respond::equations::response(&system, output, 2, omega, Some(0.1));
                for (input, expected) in expected.iter().enumerate() {
                    let z = Complex::new(0.0, -omega * 0.1).exp();
                    let sum = |coefficients: &[f64]| {
                        let terms = coefficients.iter().enumerate();
                        terms.map(|(lag, &value)| z.powi(lag as i32) * value).sum::<Complex<f64>>()
                    };
                    let own = sum(&linear.b[input]) / sum(&linear.a);
                    let distance = (own - Complex::new(expected.re, expected.im)).norm();
                    assert!(distance < 1e-12, "{to} {output} {input} {omega}: {distance:e}");
                }
            }
        }
    }
}

#[test]
fn delays_that_polynomials_do_not_have_are_refused() {
    let refused = |from: &str, to: &str, words: &str| {
        let message = changed(from, to).unwrap().linear("this test").unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    refused("+ u'", "+ u(t - 100.5)'", "'u' acts 1005 samples later, and 1000 is the most of polynomials");
    let text =
        TEXT.replace("+ u'", "+ u(t - 0.2)'").replace("u = 'u'", "u = { channel = 'u', hold = 'linear' }");
    let model = GreyBox::from_toml(&text).unwrap();
    let noise = model.measurement_variances_at_start();
    let found = EquationsModel::new(&model, &[1.7, -0.4], vec![vec![0.1, 0.0], vec![0.0, 0.1]], &noise);
    let message = found.linear("this test").unwrap_err().to_string();
    assert!(message.contains("go in lines or act later, and 'u' does both"), "{message}");
}

#[test]
fn equations_that_do_not_add_up_are_refused() {
    let linear = |from: &str, to: &str| changed(from, to).unwrap().linear("this test").is_ok();
    // What the time adds is none of the inputs' matter.
    assert!(linear("+ u'", "+ 2 * u'") && linear("+ u'", "+ u + sin(t)'"));
    for bent in ["+ u^2'", "+ u * a'", "+ max(u, 0)'", "+ sin(b)'", "+ u * t'"] {
        assert!(!linear("+ u'", bent), "{bent}");
    }
    assert!(!linear("c + m * v", "c * v"));
}
