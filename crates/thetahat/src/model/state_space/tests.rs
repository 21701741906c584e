use thetahat_core::nalgebra::{Complex, ComplexField};

use super::*;
use crate::model::{
    Orders,
    polynomial::{inverse_series, product},
};

const ONE: &[f64] = &[1.0];
const FAST: &[f64] = &[1.0, -0.2, -0.15];
const WAVE: &[f64] = &[1.0, -1.6, 0.95];

/// A y = sum_j B_j/F_j u_j + C/D e with var e = 0.25; an input is nk, the coefficients of B after it, and F.
fn model(a: &[f64], inputs: &[(usize, &[f64], &[f64])], c: &[f64], d: &[f64]) -> PolynomialModel {
    let nb: Vec<usize> = inputs.iter().map(|(_, b, _)| b.len()).collect();
    let nf: Vec<usize> = inputs.iter().map(|(_, _, f)| f.len() - 1).collect();
    let nk: Vec<usize> = inputs.iter().map(|(nk, _, _)| *nk).collect();
    let orders = Orders::new(a.len() - 1, &nb, c.len() - 1, d.len() - 1, &nf, &nk).unwrap();
    let mut parameters = a[1..].to_vec();
    inputs.iter().for_each(|(_, b, _)| parameters.extend_from_slice(b));
    parameters.extend(c[1..].iter().chain(&d[1..]));
    inputs.iter().for_each(|(_, _, f)| parameters.extend_from_slice(&f[1..]));
    PolynomialModel::from_parameters(&orders, &parameters, None, 0.25, 0.5).unwrap()
}

/// Models of all structures with the number of states that they need.
fn models() -> Vec<(PolynomialModel, usize)> {
    let integrator: &[f64] = &[1.0, -1.5, 0.5];
    vec![
        // AR, ARMA and a moving average.
        (model(WAVE, &[], ONE, ONE), 2),
        (model(FAST, &[], &[1.0, 0.4, -0.3, 0.2], ONE), 3),
        (model(ONE, &[], &[1.0, -0.9], ONE), 1),
        // ARX: A decides, then B and its delay, then nothing but a gain.
        (model(WAVE, &[(1, &[1.0, 0.5], ONE)], ONE, ONE), 2),
        (model(FAST, &[(0, &[0.3, 0.2, 0.1], ONE)], ONE, ONE), 2),
        (model(FAST, &[(3, &[0.3, 0.2], ONE)], ONE, ONE), 4),
        (model(WAVE, &[(2, &[1.0], ONE), (0, &[0.7, 0.1, 0.4, -0.2], ONE)], ONE, ONE), 3),
        (model(ONE, &[(0, &[2.0], ONE)], ONE, ONE), 0),
        (model(ONE, &[(1, &[2.0, 1.0], ONE), (0, &[3.0], ONE)], ONE, ONE), 2),
        // ARMAX.
        (model(FAST, &[(0, &[1.0], ONE)], &[1.0, -0.7, 0.1, 0.3], ONE), 3),
        (model(integrator, &[(1, &[1.0], ONE), (2, &[0.5], ONE)], &[1.0, -0.7], ONE), 2),
        // Output error.
        (model(ONE, &[(3, &[0.3, 0.5, 1.0], WAVE)], ONE, ONE), 5),
        (model(ONE, &[(0, &[0.3], WAVE), (1, &[1.0], FAST), (2, &[0.4, 0.2], ONE)], ONE, ONE), 7),
        // Box and Jenkins.
        (model(ONE, &[(2, &[0.7], WAVE), (0, &[1.0, 0.5], FAST)], &[1.0, -0.5], &[1.0, -0.9]), 5),
        (model(ONE, &[(1, &[0.7], FAST)], &[1.0, -0.5, 0.2], &[1.0, -0.9]), 4),
        (model(ONE, &[(0, &[0.7], FAST)], &[1.0, -0.5, 0.2], ONE), 4),
        // ARARX, and all of it.
        (model(WAVE, &[(1, &[0.7, 0.1], ONE)], ONE, &[1.0, 0.3]), 3),
        (
            model(
                &[1.0, -0.8],
                &[(0, &[0.7], WAVE), (2, &[1.0], ONE), (1, &[0.2], FAST)],
                &[1.0, 0.4],
                &[1.0, 0.6, 0.2],
            ),
            8,
        ),
        (model(WAVE, &[(0, &[0.7, 0.2], FAST)], &[1.0, 0.4, 0.1, 0.2], ONE), 5),
        // Inputs without B.
        (model(WAVE, &[(3, &[], ONE), (1, &[1.0], ONE)], ONE, ONE), 2),
        (model(ONE, &[(1, &[1.0], FAST), (9, &[], ONE)], ONE, &[1.0, 0.5]), 3),
    ]
}

/// N/P as a series.
fn quotient(numerator: &[f64], denominator: &[f64], length: usize) -> Vec<f64> {
    let mut series = product(numerator, &inverse_series(denominator, length));
    series.resize(length, 0.0);
    series
}

/// Direct, H gain, H F gain, H F^2 gain, …
fn impulse_response(space: &StateSpace, gain: DMatrix<f64>, direct: f64, length: usize) -> Vec<f64> {
    let mut state = gain;
    let mut response = vec![direct];
    while response.len() < length {
        response.push((&space.h * &state)[(0, 0)]);
        state = &space.f * state;
    }
    response
}

/// The largest difference as a fraction of the largest expected value, which is at least 1.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(1.0_f64, |largest, value| largest.max(value.abs()));
    let apart = found.iter().zip(expected).map(|(found, expected)| (found - expected).abs());
    apart.fold(0.0, f64::max) / largest
}

#[test]
fn its_impulse_responses_are_those_of_the_difference_equation() {
    for (model, states) in models() {
        let space = model.state_space();
        let inputs = model.b.len();
        assert_eq!(space.f.shape(), (states, states), "{:?}", model.orders);
        assert_eq!((space.g.shape(), space.h.shape()), ((states, inputs), (1, states)));
        assert_eq!((space.d.shape(), space.k.shape()), ((1, inputs), (states, 1)));
        assert_eq!((space.noise_covariance[(0, 0)], space.sample_time), (0.25, 0.5));
        for (input, (b, f)) in model.b.iter().zip(&model.f).enumerate() {
            let gain = space.g.columns(input, 1).into_owned();
            let found = impulse_response(&space, gain, space.d[(0, input)], 40);
            let expected = quotient(b, &product(&model.a, f), 40);
            assert!(difference(&found, &expected) < 1e-13, "{:?}", model.orders);
        }
        let found = impulse_response(&space, space.k.clone(), 1.0, 40);
        let expected = quotient(&model.c, &product(&model.a, &model.d), 40);
        assert!(difference(&found, &expected) < 1e-13, "{:?}", model.orders);
    }
}

/// The coefficients of z^-n det(z I - F), by Faddeev and Leverrier.
fn characteristic(f: &DMatrix<f64>) -> Vec<f64> {
    let size = f.nrows();
    let mut polynomial = vec![1.0];
    let mut power = DMatrix::zeros(size, size);
    for k in 1..=size {
        power = f * power + DMatrix::identity(size, size) * polynomial[k - 1];
        polynomial.push(-(f * &power).trace() / k as f64);
    }
    polynomial
}

#[test]
fn its_characteristic_polynomial_is_the_product_of_the_denominators() {
    for (model, states) in models() {
        let denominators = model.f.iter().chain([&model.d]);
        let mut expected = denominators.fold(model.a.clone(), |all, next| product(&all, next));
        expected.resize(states + 1, 0.0);
        let found = characteristic(&model.state_space().f);
        assert!(difference(&found, &expected) < 1e-13, "{:?}", model.orders);
    }
}

#[test]
fn its_eigenvalues_are_the_poles() {
    let model = model(WAVE, &[(1, &[0.7], FAST)], ONE, &[1.0, -0.9]);
    let poles = model.poles.iter().chain(&model.noise_poles);
    let poles: Vec<Complex<f64>> = poles.map(|pole| Complex::new(pole.re, pole.im)).collect();
    let found = model.state_space().f.complex_eigenvalues();
    assert_eq!(found.len(), poles.len());
    for pole in poles {
        assert!(found.iter().any(|found| (found - pole).modulus() < 1e-12), "{pole}");
    }
}

#[test]
fn an_input_without_b_does_nothing() {
    let space = model(ONE, &[(1, &[1.0], FAST), (9, &[], ONE)], ONE, ONE).state_space();
    assert!(space.g.column(1).iter().chain(space.d.column(1).iter()).all(|value| *value == 0.0));
    assert_eq!(space.f.nrows(), 2);
}
