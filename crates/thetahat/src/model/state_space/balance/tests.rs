use std::f64::consts::PI;

use thetahat_core::nalgebra::Complex;

use super::*;
use crate::model::{Orders, PolynomialModel};
use crate::tests::matrix;

fn two_by_two() -> StateSpace {
    StateSpace {
        f: matrix(&[
            &[0.9, 0.3, 0.0, 0.0],
            &[-0.3, 0.7, 0.1, 0.0],
            &[0.0, 0.0, 0.5, -0.4],
            &[0.05, 0.0, 0.4, 0.5],
        ]),
        g: matrix(&[&[1.0, 0.0], &[0.5, -1.0], &[0.2, 0.7], &[0.0, 1.0]]),
        h: matrix(&[&[1.0, 0.0, 2.0, 0.0], &[0.0, 1.0, -1.0, 0.3]]),
        d: matrix(&[&[0.0, 0.3], &[0.1, 0.0]]),
        k: matrix(&[&[0.5, 0.1], &[0.1, 0.4], &[0.2, -0.1], &[0.0, 0.2]]),
        noise_covariance: matrix(&[&[0.5, 0.1], &[0.1, 0.2]]),
        sample_time: 1.0,
    }
}

/// From u and e, e in units of its deviation, to y.
fn response(model: &StateSpace, z: Complex<f64>) -> DMatrix<Complex<f64>> {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let n = model.f.nrows();
    let inside = (DMatrix::<Complex<f64>>::identity(n, n) * z - complex(&model.f)).try_inverse().unwrap();
    let root = root(&model.noise_covariance);
    let (m, l) = (model.g.ncols(), model.h.nrows());
    let mut found = DMatrix::zeros(l, m + l);
    let inputs = complex(&model.h) * &inside * complex(&model.g) + complex(&model.d);
    found.columns_mut(0, m).copy_from(&inputs);
    let noise = complex(&model.h) * inside * complex(&(&model.k * &root)) + complex(&root);
    found.columns_mut(m, l).copy_from(&noise);
    found
}

/// The largest singular value of the difference at many frequencies.
fn apart(one: &StateSpace, other: &StateSpace) -> f64 {
    let points = (0..=4000).map(|k| Complex::from_polar(1.0, PI * (f64::from(k) + 1e-3) / 4000.1));
    let size = |difference: DMatrix<Complex<f64>>| difference.svd(false, false).singular_values[0];
    points.map(|z| size(response(one, z) - response(other, z))).fold(0.0, f64::max)
}

#[test]
fn hankel_singular_values_are_those_of_scipy() {
    // scipy 1.17.1: roots of the eigenvalues of P Q, both by scipy.linalg.solve_discrete_lyapunov.
    let expected = [5.4352008786710435, 3.7470056566925134, 1.6649051461545135, 0.8955869441944786];
    let found = two_by_two().hankel_singular_values().unwrap();
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-13, "{found} {expected}");
    }
    // The same program with numpy's frequency responses: the error of truncation at 4001 frequencies.
    for (order, error) in [(1, 6.181581334648759), (2, 2.2222798694568264), (3, 1.3939685241731303)] {
        let reduced = two_by_two().reduced(order).unwrap();
        let found = apart(&two_by_two(), &reduced.model);
        assert!((found - error).abs() < 1e-4 * error, "{order}: {found}");
        assert!(found <= reduced.error_bound && found >= expected[order], "{order}: {found}");
    }
}

#[test]
fn both_gramians_are_the_hankel_singular_values() {
    let model = two_by_two();
    let found = model.balanced().unwrap();
    assert!(apart(&model, &found) < 1e-12);
    let values = model.hankel_singular_values().unwrap();
    let expected = DMatrix::from_diagonal(&values.into());
    let b = &found.k * root(&found.noise_covariance);
    let driven = &found.g * found.g.transpose() + &b * b.transpose();
    let moved = &found.f * &expected * found.f.transpose() + driven;
    assert!((moved - &expected).amax() < 1e-12);
    let seen = found.f.transpose() * &expected * &found.f + found.h.transpose() * &found.h;
    assert!((seen - &expected).amax() < 1e-12);
}

#[test]
fn states_that_are_not_needed_go_without_a_trace() {
    let model = two_by_two();
    // Two more states: one that nothing reaches, one that nothing sees; then other coordinates.
    let mut f = DMatrix::zeros(6, 6);
    f.view_mut((0, 0), (4, 4)).copy_from(&model.f);
    f[(0, 4)] = 0.4;
    f[(4, 4)] = 0.8;
    f[(5, 5)] = -0.7;
    f[(5, 1)] = 1.5;
    let mut g = model.g.clone().insert_rows(4, 2, 0.0);
    g[(5, 0)] = 2.0;
    let k = model.k.clone().insert_rows(4, 2, 0.0);
    let mut h = model.h.clone().insert_columns(4, 2, 0.0);
    h[(1, 4)] = 3.0;
    let change = DMatrix::from_fn(6, 6, |row, column| {
        let entry = ((3 * row + 5 * column) % 7) as f64 - 3.0;
        if row == column { 9.0 + entry } else { entry }
    });
    let inverse = change.clone().try_inverse().unwrap();
    let larger = StateSpace {
        f: &change * f * &inverse,
        g: &change * g,
        k: &change * k,
        h: h * inverse,
        ..model.clone()
    };
    let values = larger.hankel_singular_values().unwrap();
    assert!(values[3] > 0.8 && values[4] < 1e-12 && values.len() == 6, "{values:?}");
    let reduced = larger.balanced().unwrap();
    assert_eq!(reduced.f.nrows(), 4);
    assert!(apart(&reduced, &model) < 1e-10);
    assert_eq!(
        larger.reduced(5).unwrap_err().to_string(),
        "order: it is 5; the model needs 4 of its 6 states"
    );
}

#[test]
fn an_all_pass_has_equal_values() {
    // (1 - 0.8 z)(1 + 0.5 z)/((z - 0.8)(z + 0.5)), all of modulus 1 on the circle.
    let orders = Orders::arx(2, &[3], &[0]).unwrap();
    let parameters = [-0.3, -0.4, -0.4, -0.3, 1.0];
    let model = PolynomialModel::from_parameters(&orders, &parameters, None, 1.0, 1.0).unwrap();
    let mut space = model.state_space();
    space.k.fill(0.0);
    for value in space.hankel_singular_values().unwrap() {
        assert!((value - 1.0).abs() < 1e-13, "{value}");
    }
}

#[test]
fn small_values_keep_their_digits() {
    let poles: Vec<f64> = (0..6).map(|k| 0.5 + 0.08 * f64::from(k)).collect();
    let model = StateSpace {
        f: DMatrix::from_diagonal(&poles.clone().into()),
        g: DMatrix::from_element(6, 1, 1.0),
        h: DMatrix::from_element(1, 6, 1.0),
        d: matrix(&[&[0.0]]),
        k: DMatrix::zeros(6, 1),
        noise_covariance: matrix(&[&[1.0]]),
        sample_time: 1.0,
    };
    let values = model.hankel_singular_values().unwrap();
    // P = Q with P_ij = 1/(1 - p_i p_j), so that the values are the eigenvalues of P, and their product Cauchy's
    // determinant.
    let mut logarithm = 0.0;
    for (i, one) in poles.iter().enumerate() {
        logarithm -= (1.0 - one * one).ln();
        for other in &poles[..i] {
            logarithm += 2.0 * ((one - other) / (1.0 - one * other)).abs().ln();
        }
    }
    let trace: f64 = poles.iter().map(|pole| 1.0 / (1.0 - pole * pole)).sum();
    assert!((values.iter().sum::<f64>() - trace).abs() < 1e-13 * trace);
    let found: f64 = values.iter().map(|value| value.ln()).sum();
    assert!((found - logarithm).abs() < 1e-10, "{values:?} {found} {logarithm}");
    let reduced = model.reduced(3).unwrap();
    let error = apart(&model, &reduced.model);
    assert!(error <= reduced.error_bound && error >= values[3], "{error}");
}

#[test]
fn poles_that_do_not_decay_are_kept() {
    let stable = two_by_two();
    // A double integrator and an unstable pair beside it, all mixed.
    let mut f = DMatrix::zeros(8, 8);
    f.view_mut((0, 0), (4, 4)).copy_from(&stable.f);
    f.view_mut((4, 4), (2, 2)).copy_from(&matrix(&[&[1.0, 0.5], &[0.0, 1.0]]));
    f.view_mut((6, 6), (2, 2)).copy_from(&matrix(&[&[1.1, 0.4], &[-0.4, 1.1]]));
    let mut g = stable.g.clone().insert_rows(4, 4, 0.3);
    g[(5, 1)] = -0.4;
    let mut h = stable.h.clone().insert_columns(4, 4, 0.5);
    h[(0, 7)] = 0.1;
    // K places the poles of the predictor: a Kalman gain would; here that of the stable part is enough to test the
    // response to u.
    let k = stable.k.clone().insert_rows(4, 4, 0.0);
    let change = DMatrix::from_fn(8, 8, |row, column| {
        let entry = ((3 * row + 5 * column) % 11) as f64 - 5.0;
        if row == column { 15.0 + entry } else { entry }
    });
    let inverse = change.clone().try_inverse().unwrap();
    let whole = StateSpace {
        f: &change * f * &inverse,
        g: &change * g,
        k: &change * k,
        h: h * inverse,
        ..stable.clone()
    };
    let values = whole.hankel_singular_values().unwrap();
    assert_eq!(values[..4], [f64::INFINITY; 4]);
    for (found, expected) in values[4..].iter().zip(stable.hankel_singular_values().unwrap()) {
        assert!((found - expected).abs() < 1e-8, "{found} {expected}");
    }
    let error = whole.reduced(3).unwrap_err().to_string();
    assert!(
        error.contains("1.1 + 0.4i, 1.1 - 0.4i, 1") && error.ends_with("it must be 4 at least"),
        "{error}"
    );
    let balance = whole.balance().unwrap();
    assert_eq!(balance.needed(), 8);
    let Coordinates { left, right } = &balance.lasting;
    let kept = eigen::eigenvalues(&(left * &whole.f * right)).unwrap();
    assert!((kept[0] - Complex::new(1.1, 0.4)).modulus() < 1e-10, "{kept:?}");
    // What is left out is what is left out of the stable part.
    let expected = stable.reduced(2).unwrap();
    assert!((values[6..].iter().sum::<f64>() * 2.0 - expected.error_bound).abs() < 1e-7);
}

#[test]
fn an_unstable_predictor_becomes_the_stable_one_of_the_same_noise() {
    // C = 1 + 2.5 q^-1 + q^-2 = (1 + 2 q^-1)(1 + 0.5 q^-1): the same noise as that of 2 (1 + 0.5 q^-1)^2.
    let orders = Orders::armax(2, &[1], 2, &[1]).unwrap();
    let unstable = [-1.2, 0.52, 1.0, 2.5, 1.0];
    let space = |parameters: &[f64], variance| {
        PolynomialModel::from_parameters(&orders, parameters, None, variance, 1.0).unwrap().state_space()
    };
    let found = space(&unstable, 1.0).with_stable_predictor().unwrap();
    let expected = space(&[-1.2, 0.52, 1.0, 1.0, 0.25], 4.0);
    assert!((&found.k - &expected.k).amax() < 1e-13, "{}", found.k);
    assert!((&found.noise_covariance - &expected.noise_covariance).amax() < 1e-13);
    // Two outputs: the spectrum stays.
    let model = two_by_two();
    let wild = StateSpace { k: &model.k * 6.0, ..model };
    let found = wild.clone().with_stable_predictor().unwrap();
    assert!(wild != found);
    for frequency in [0.01, 0.4, 2.0] {
        let z = Complex::from_polar(1.0, frequency);
        let spectrum = |model: &StateSpace| {
            let noise = response(model, z).columns(2, 2).into_owned();
            &noise * noise.adjoint()
        };
        let (one, other) = (spectrum(&wild), spectrum(&found));
        assert!((&one - &other).norm() < 1e-11 * other.norm());
    }
    // Without noise there is nothing to whiten.
    let error = space(&unstable, 0.0).with_stable_predictor().unwrap_err().to_string();
    assert_eq!(error, "no gain gives a stable predictor; take another order");
}

#[test]
fn a_model_without_states_stays_as_it_is() {
    let orders = Orders::arx(0, &[1], &[0]).unwrap();
    let gain = PolynomialModel::from_parameters(&orders, &[2.0], None, 3.0, 0.5).unwrap().state_space();
    assert!(gain.hankel_singular_values().unwrap().is_empty());
    let reduced = gain.reduced(0).unwrap();
    assert_eq!((&reduced.model, reduced.error_bound), (&gain, 0.0));
    // All states left out: the gains at once are left.
    let static_part = two_by_two().reduced(0).unwrap();
    assert_eq!(static_part.model.f.nrows(), 0);
    assert!(apart(&two_by_two(), &static_part.model) <= static_part.error_bound);
}
