use thetahat_core::nalgebra::ComplexField;

use super::*;
use crate::model::{Orders, PolynomialModel};

/// The largest difference of two lists of the same length, in order, as a fraction of the value if that is above 1.
fn apart(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
    let pairs = found.iter().zip(expected);
    pairs.map(|(one, other)| (one - other).modulus() / other.modulus().max(1.0)).fold(0.0, f64::max)
}

fn complex(values: &[(f64, f64)]) -> Vec<Complex<f64>> {
    values.iter().map(|(re, im)| Complex::new(*re, *im)).collect()
}

fn two_by_two() -> StateSpace {
    StateSpace {
        f: DMatrix::from_row_slice(3, 3, &[0.5, 0.2, 0.0, -0.3, 0.6, 0.1, 0.1, 0.0, 0.8]),
        g: DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.5, -1.0, 0.2, 0.7]),
        h: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 2.0, 0.0, 1.0, -1.0]),
        d: DMatrix::from_row_slice(2, 2, &[0.0, 0.3, 0.001, 0.0]),
        k: DMatrix::zeros(3, 2),
        noise_covariance: DMatrix::identity(2, 2),
        sample_time: 1.0,
    }
}

#[test]
fn channels_are_those_of_scipy() {
    // scipy 1.17.1: scipy.signal.ss2zpk(F, G[:, [i]], H[[o]], D[[o]][:, [i]]).
    let model = two_by_two();
    let (middle, wave) = (0.5421907452681753, 0.2481684523550721);
    let poles = complex(&[(0.815618509463651, 0.0), (middle, wave), (middle, -wave)]);
    let expected = [
        (0, 0, complex(&[(0.55, 0.13228756555322993), (0.55, -0.13228756555322993)]), 1.4),
        (
            0,
            1,
            complex(&[
                (-4.016002723581594, 0.0),
                (0.6246680284574646, 0.2590885205139561),
                (0.6246680284574646, -0.2590885205139561),
            ]),
            0.3,
        ),
        (
            1,
            0,
            complex(&[(-300.7933728179224, 0.0), (1.9985070320965412, 0.0), (0.6948657858270146, 0.0)]),
            0.001,
        ),
        (1, 1, complex(&[(0.6911064028335405, 0.0), (0.567717126578224, 0.0)]), -1.7),
    ];
    for (output, input, zeros, gain) in expected {
        let found = model.transfer(output, input).unwrap();
        assert!(apart(&found.poles, &poles) < 1e-13, "{output} {input}");
        // scipy's own zeros, of a polynomial, have fewer digits.
        assert!(apart(&found.zeros, &zeros) < 1e-11, "{output} {input} {:?}", found.zeros);
        assert!((found.gain - gain).abs() < 1e-14 * gain.abs().max(1.0), "{output} {input} {}", found.gain);
    }
}

#[test]
fn it_is_the_response_of_the_state_space() {
    let model = two_by_two();
    for (output, input) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let transfer = model.transfer(output, input).unwrap();
        for z in complex(&[(1.0, 0.0), (0.3, 0.9), (-1.0, 0.0), (40.0, -3.0)]) {
            let resolvent = DMatrix::identity(3, 3) * z - model.f.map(|value| Complex::new(value, 0.0));
            let state =
                resolvent.lu().solve(&model.g.column(input).map(|value| Complex::new(value, 0.0))).unwrap();
            let expected = (model.h.row(output).map(|value| Complex::new(value, 0.0)) * state)[0]
                + model.d[(output, input)];
            let apart = (transfer.at(z) - expected).modulus() / expected.modulus();
            assert!(apart < 1e-12, "{output} {input} {z}: {apart}");
        }
    }
}

/// A model of two inputs, of which the first has nk delays and zeros at 0 too.
fn box_jenkins() -> PolynomialModel {
    let orders = Orders::new(1, &[2, 1], 1, 1, &[4, 2], &[3, 0]).unwrap();
    let parameters = [-0.9, 1.0, -0.4, 2.0, 0.5, -0.7, -1.0, 0.41, -0.02, -0.03, -1.2, 0.72];
    PolynomialModel::from_parameters(&orders, &parameters, None, 1.0, 1.0).unwrap()
}

#[test]
fn polynomials_keep_their_roots() {
    let model = box_jenkins();
    let space = model.state_space();
    for input in 0..2 {
        let found = space.transfer(0, input).unwrap();
        let nk = [3, 0][input];
        let b = &model.b[input][nk..];
        let denominator = crate::model::polynomial::product(&model.a, &model.f[input]);
        let mut poles = crate::model::polynomial::roots(&denominator).unwrap();
        let mut zeros = crate::model::polynomial::roots(b).unwrap();
        // b_0 z^-nk + … over z^-n … is z^(n - nk - nb + 1) (b_0 z^(nb-1) + …): roots at 0 above or below.
        let shift = denominator.len() as isize - 1 - (nk + b.len() - 1) as isize;
        let at_zero = vec![Complex::new(0.0, 0.0); shift.unsigned_abs()];
        if shift > 0 {
            zeros.extend(at_zero)
        } else {
            poles.extend(at_zero)
        }
        assert!(apart(&found.poles, &poles) < 1e-12, "{:?} {poles:?}", found.poles);
        assert!(apart(&found.zeros, &zeros) < 1e-12, "{:?} {zeros:?}", found.zeros);
        assert_eq!(found.delay(), nk);
        assert!((found.gain - b[0]).abs() < 1e-13);
    }
}

#[test]
fn a_finite_impulse_response_has_its_poles_at_zero() {
    let orders = Orders::arx(0, &[3], &[2]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[2.0, -3.0, 1.0], None, 1.0, 1.0).unwrap();
    let found = model.state_space().transfer(0, 0).unwrap();
    // 2 z^-2 - 3 z^-3 + z^-4 = (2 z^2 - 3 z + 1) / z^4.
    assert_eq!(found.poles, vec![Complex::new(0.0, 0.0); 4]);
    assert!(apart(&found.zeros, &complex(&[(1.0, 0.0), (0.5, 0.0)])) < 1e-14);
    assert_eq!((found.delay(), (found.gain - 2.0).abs() < 1e-14), (2, true));
}

#[test]
fn other_coordinates_and_units_change_nothing() {
    let space = box_jenkins().state_space();
    let size = space.f.nrows();
    let expected = space.transfer(0, 0).unwrap();
    let change = DMatrix::from_fn(size, size, |row, column| {
        let entry = ((3 * row + 5 * column) % 7) as f64 - 3.0;
        if row == column { 9.0 + entry } else { entry }
    });
    let inverse = change.clone().try_inverse().unwrap();
    let turned = StateSpace {
        f: &change * &space.f * &inverse,
        g: &change * &space.g,
        h: &space.h * &inverse,
        ..space.clone()
    };
    let found = turned.transfer(0, 0).unwrap();
    assert!(apart(&found.poles, &expected.poles) < 1e-10, "{:?}", found.poles);
    assert!(apart(&found.zeros, &expected.zeros) < 1e-10, "{:?}", found.zeros);
    let units = DMatrix::from_fn(
        size,
        size,
        |row, column| {
            if row == column { 1e4_f64.powi(row as i32 % 3) } else { 0.0 }
        },
    );
    let inverse = units.clone().try_inverse().unwrap();
    let scaled =
        StateSpace { f: &units * &space.f * &inverse, g: &units * &space.g, h: &space.h * &inverse, ..space };
    let found = scaled.transfer(0, 0).unwrap();
    assert!(apart(&found.poles, &expected.poles) < 1e-12, "{:?}", found.poles);
    assert!(apart(&found.zeros, &expected.zeros) < 1e-12, "{:?}", found.zeros);
}

#[test]
fn an_input_that_does_nothing_has_no_transfer() {
    let orders = Orders::arx(1, &[1, 0], &[1, 1]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[-0.5, 2.0], None, 1.0, 1.0).unwrap();
    let found = model.state_space().transfer(0, 1).unwrap();
    assert_eq!(found, ZerosPolesGain { zeros: vec![], poles: vec![], gain: 0.0 });
    // A gain alone.
    let orders = Orders::arx(0, &[1], &[0]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[2.0], None, 1.0, 1.0).unwrap();
    let found = model.state_space().transfer(0, 0).unwrap();
    assert_eq!(found, ZerosPolesGain { zeros: vec![], poles: vec![], gain: 2.0 });
}

#[test]
fn channels_that_are_not_there_are_refused() {
    let model = two_by_two();
    assert_eq!(
        model.transfer(2, 0).unwrap_err().to_string(),
        "output: it is 2; the model has 2, counted from 0"
    );
    assert!(model.transfer(0, 2).unwrap_err().to_string().starts_with("input: it is 2"));
    let odd = StateSpace { g: DMatrix::zeros(2, 2), ..two_by_two() };
    assert_eq!(
        odd.poles().unwrap_err().to_string(),
        "model: G is 2 x 2, not 3 x 2: F has 3 rows, and D is 2 x 2"
    );
    let endless = StateSpace { d: DMatrix::from_element(2, 2, f64::INFINITY), ..two_by_two() };
    assert_eq!(endless.poles().unwrap_err().to_string(), "model: D has an entry that is not a finite number");
}
