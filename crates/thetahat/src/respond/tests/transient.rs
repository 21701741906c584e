//! Step and impulse responses against closed forms, identities and finite differences.

use thetahat_core::nalgebra::Complex;

use crate::model::{Orders, PolynomialModel};
use crate::respond::{frequency_response, impulse_response, step_response};

/// A model whose parameters have the identity as covariance matrix, or that of one parameter alone.
fn model(orders: &Orders, parameters: &[f64], alone: Option<usize>) -> PolynomialModel {
    let count = parameters.len();
    let entry = |row: usize, column: usize| {
        f64::from(row == column && alone.is_none_or(|parameter| parameter == row))
    };
    let rows: Vec<Vec<f64>> = (0..count).map(|row| (0..count).map(|c| entry(row, c)).collect()).collect();
    PolynomialModel::from_parameters(orders, parameters, Some(&rows), 1.0, 0.5).unwrap()
}

#[test]
fn of_first_order_it_is_the_closed_form() {
    let orders = Orders::arx(1, &[1], &[2]).unwrap();
    let (pole, gain) = (0.9_f64, 0.3_f64);
    let model = model(&orders, &[-pole, gain], None);
    let step = step_response(&model, 0, None).unwrap();
    // 0.5 % are left after ln 0.005 / ln 0.9 = 50.3 samples; three coefficients, and the sample at time 0.
    assert_eq!(step.values.len(), 51 + 3 + 1);
    for (t, found) in step.values.iter().enumerate() {
        assert!((step.time[t] - 0.5 * t as f64).abs() < 1e-12);
        let n = (t as f64 - 1.0).max(0.0);
        let rise = (1.0 - pole.powf(n)) / (1.0 - pole);
        // d/dpole of (1 - pole^n)/(1 - pole)
        let slope = (-n * pole.powf(n - 1.0) * (1.0 - pole) + 1.0 - pole.powf(n)) / (1.0 - pole).powi(2);
        let error = (rise * rise + (gain * slope).powi(2)).sqrt();
        assert!((found.value - gain * rise).abs() < 1e-12, "{t}");
        assert!((found.standard_error.unwrap() - error).abs() < 1e-10, "{t}");
    }
    // It ends at the static gain, with its uncertainty.
    let (end, gain) = (step.values.last().unwrap(), model.dc_gain[0].unwrap());
    assert!((end.value / gain.value - 1.0).abs() < 0.01);
    assert!((end.standard_error.unwrap() / gain.standard_error.unwrap() - 1.0).abs() < 0.05);
}

#[test]
fn an_impulse_of_first_order_decays_and_its_error_is_the_closed_form() {
    let orders = Orders::arx(1, &[1], &[2]).unwrap();
    let (pole, gain) = (0.9_f64, 0.3_f64);
    let model = model(&orders, &[-pole, gain], None);
    let impulse = impulse_response(&model, 0, None).unwrap();
    assert_eq!(impulse.time, step_response(&model, 0, None).unwrap().time);
    for (t, found) in impulse.values.iter().enumerate() {
        // g_t = gain pole^n, n = t - 2.
        let (value, error) = match t.checked_sub(2) {
            None => (0.0, 0.0),
            Some(n) => {
                let n = n as f64;
                let slope = if n > 0.0 { n * gain * pole.powf(n - 1.0) } else { 0.0 };
                (gain * pole.powf(n), pole.powf(n).hypot(slope))
            }
        };
        assert!((found.value - value).abs() < 1e-14, "{t}");
        assert!((found.standard_error.unwrap() - error).abs() < 1e-12, "{t}");
    }
}

#[test]
fn impulses_add_up_to_steps_and_transform_to_frequency_responses() {
    // All polynomials, and two inputs, the second without delay.
    let orders = Orders::new(1, &[2, 1], 1, 1, &[2, 1], &[3, 0]).unwrap();
    let model = model(&orders, &[-0.5, 1.0, 0.4, -0.7, 0.2, 0.1, -1.2, 0.5, -0.6], None);
    for input in 0..2 {
        let impulse = impulse_response(&model, input, Some(300)).unwrap();
        let step = step_response(&model, input, Some(300)).unwrap();
        let mut sum = 0.0;
        for (g, step) in impulse.values.iter().zip(&step.values) {
            sum += g.value;
            assert!((sum - step.value).abs() < 1e-12);
        }
        // After 300 samples the slowest mode, of modulus 0.71, is below rounding.
        for angle in [0.0, 0.3, 1.5, 3.0] {
            let turned = impulse.values.iter().enumerate().map(|(i, g)| {
                let (sine, cosine) = (i as f64 * angle).sin_cos();
                Complex::new(g.value * cosine, -g.value * sine)
            });
            let sum: Complex<f64> = turned.sum();
            let exact = frequency_response(&model, &[angle / 0.5]).unwrap()[input].points[0];
            assert!((sum.re - exact.re).abs() < 1e-12 && (sum.im - exact.im).abs() < 1e-12, "{angle}");
        }
    }
}

#[test]
fn derivatives_are_those_of_finite_differences() {
    // All polynomials, and two inputs, of which the first has no F.
    let orders = Orders::new(2, &[2, 3], 1, 1, &[0, 2], &[0, 2]).unwrap();
    let theta = [-0.7, 0.1, 1.0, 0.5, 0.3, -0.4, 0.2, 0.3, -0.2, -1.2, 0.5];
    assert_eq!(orders.parameters(), theta.len());
    let cases = (0..2).flat_map(|input| (0..theta.len()).map(move |parameter| (input, parameter)));
    for respond in [step_response, impulse_response] {
        for (input, parameter) in cases.clone() {
            let exact = respond(&model(&orders, &theta, Some(parameter)), input, Some(40)).unwrap();
            let moved = |by: f64| {
                let mut theta = theta;
                theta[parameter] += by;
                respond(&model(&orders, &theta, None), input, Some(40)).unwrap()
            };
            let (above, below) = (moved(1e-6), moved(-1e-6));
            for t in 0..40 {
                let slope = (above.values[t].value - below.values[t].value) / 2e-6;
                let found = exact.values[t].standard_error.unwrap();
                assert!(
                    (found - slope.abs()).abs() < 1e-7,
                    "input {input}, parameter {parameter}, {t}: {found} {slope}"
                );
            }
        }
    }
}

#[test]
fn it_ends_where_there_is_no_more_to_see() {
    let samples = |a: &[f64]| {
        let orders = Orders::arx(a.len(), &[1], &[1]).unwrap();
        let model = PolynomialModel::from_parameters(&orders, &[a, &[1.0]].concat(), None, 1.0, 1.0).unwrap();
        let step = step_response(&model, 0, None).unwrap();
        assert!(step.values.iter().all(|value| value.value.is_finite() && value.standard_error.is_none()));
        step.values.len()
    };
    // Unstable: ln 100 / ln 1.1 = 48.3, and B.
    assert_eq!(samples(&[-1.1]), 49 + 3);
    // An integrator alone, and one beside a pole at 0.9.
    assert_eq!(samples(&[-1.0]), 20);
    assert_eq!(samples(&[-1.9, 0.9]), 151 + 3);
    // So slow that its end is out of reach.
    assert_eq!(samples(&[-0.999_999_9]), 20_000);
    // Unstable beyond what numbers can hold.
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[-1e30, 1.0], None, 1.0, 1.0).unwrap();
    let step = step_response(&model, 0, Some(100)).unwrap();
    assert!(
        (10..=12).contains(&step.values.len()) && step.values.iter().all(|value| value.value.is_finite())
    );
}

#[test]
fn what_is_not_there_is_refused() {
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[-0.5, 1.0], None, 1.0, 1.0).unwrap();
    for respond in [step_response, impulse_response] {
        assert!(respond(&model, 1, None).is_err());
        assert!(respond(&model, 0, Some(0)).is_err());
    }
}
