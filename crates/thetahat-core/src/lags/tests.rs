extern crate std;
use std::vec;
use std::vec::Vec;

use nalgebra::{Const, Vector2, Vector3};

use super::{ArxOrders, InputOrders, Lags};
use crate::noise::Noise;
use crate::{Dimension, Error, Real};

/// A sample that is missing one time in ten.
fn sample(noise: &mut Noise) -> f64 {
    let value = noise.next();
    if noise.next() < -0.8 { f64::NAN } else { value }
}

/// φ(k) by its definition, from the whole record: NaN before the start.
fn definition(orders: &ArxOrders<'_>, inputs: &[Vec<f64>], outputs: &[f64], k: usize) -> Vec<f64> {
    let at = |signal: &[f64], lag: usize| {
        let time = k.checked_sub(lag);
        time.and_then(|time| signal.get(time).copied()).unwrap_or(f64::NAN)
    };
    let mut regressor: Vec<f64> = (1..=orders.na).map(|lag| -at(outputs, lag)).collect();
    for (&InputOrders { nb, nk }, signal) in orders.inputs.iter().zip(inputs) {
        regressor.extend((nk..nk + nb).map(|lag| at(signal, lag)));
    }
    regressor
}

fn check<N: Dimension, D: Dimension>(orders: &ArxOrders<'_>) {
    let mut noise = Noise(1);
    let mut inputs: Vec<Vec<f64>> = vec![vec![]; orders.inputs.len()];
    let mut outputs = vec![];
    let mut lags = Lags::<f64, N, D>::new(orders).unwrap();
    let mut ready = 0;
    for k in 0..300 {
        if k == 150 {
            lags.gap();
            inputs.iter_mut().flatten().for_each(|u| *u = f64::NAN);
            outputs.fill(f64::NAN);
        }
        let now: Vec<f64> = inputs.iter().map(|_| sample(&mut noise)).collect();
        for (signal, &u) in inputs.iter_mut().zip(&now) {
            signal.push(u);
        }
        lags.push_inputs(&now).unwrap();

        let expected = definition(orders, &inputs, &outputs, k);
        match lags.regressor() {
            Some(regressor) => {
                ready += 1;
                assert_eq!(regressor.as_slice(), expected, "{orders:?} at {k}");
            }
            None => assert!(expected.iter().any(|s| s.is_nan()), "{orders:?} at {k}"),
        }

        // Bad samples in between change nothing.
        let infinite = vec![f64::NEG_INFINITY; now.len()];
        assert_eq!(lags.push_inputs(&infinite).is_ok(), now.is_empty());
        assert!(lags.push_inputs(&vec![0.0; now.len() + 1]).is_err());
        assert!(lags.push_output(f64::INFINITY).is_err());

        let y = sample(&mut noise);
        lags.push_output(y).unwrap();
        outputs.push(y);
    }
    assert!(ready > 50, "{orders:?} {ready}");
}

const DELAYS: [usize; 4] = [0, 1, 2, 7];

fn one(nb: usize, nk: usize) -> InputOrders {
    InputOrders { nb, nk }
}

#[test]
fn static_sizes_follow_the_definition() {
    for nk in DELAYS {
        let inputs = [one(2, nk)];
        let orders = |na| ArxOrders { na, inputs: &inputs, constant: false };
        check::<Const<2>, Const<7>>(&orders(0));
        check::<Const<4>, Const<7>>(&orders(2));
    }
    let two = [one(2, 1), one(1, 3)];
    check::<Const<6>, Const<4>>(&ArxOrders { na: 3, inputs: &two, constant: false });
    let three = [one(1, 0), one(0, 5), one(2, 1)];
    check::<Const<4>, Const<1>>(&ArxOrders { na: 1, inputs: &three, constant: false });
    // No stored samples at all.
    check::<Const<3>, Const<0>>(&ArxOrders { na: 1, inputs: &[one(2, 0)], constant: false });
    check::<Const<3>, Const<1>>(&ArxOrders { na: 3, inputs: &[], constant: false });
    check::<Const<0>, Const<1>>(&ArxOrders { na: 0, inputs: &[], constant: false });
}

#[cfg(feature = "alloc")]
#[test]
fn every_combination_of_orders_follows_the_definition() {
    use nalgebra::Dyn;

    for na in 0..4 {
        for nb in 0..4 {
            for nk in DELAYS {
                let first = one(nb, nk);
                check::<Dyn, Dyn>(&ArxOrders { na, inputs: &[first], constant: false });
                for second in [one(0, 1), one(1, 0), one(2, 3)] {
                    check::<Dyn, Dyn>(&ArxOrders { na, inputs: &[first, second], constant: false });
                }
            }
        }
    }
}

#[test]
fn a_missing_sample_matters_only_in_a_tap() {
    // y(k) depends on u(k-2) alone: u(1) is missed at k = 3 only.
    let mut lags: Lags<f32, Const<1>, Const<2>> =
        Lags::new(&ArxOrders { na: 0, inputs: &[one(1, 2), one(0, 1)], constant: false }).unwrap();
    let mut ready = vec![];
    for k in 0..6 {
        let u = if k == 1 { f32::NAN } else { 1.0 };
        lags.push_inputs(&[u, f32::NAN]).unwrap();
        ready.push(lags.regressor().is_some());
        lags.push_output(f32::NAN).unwrap();
    }
    assert_eq!(ready, [false, false, true, false, true, true]);
}

#[test]
fn bad_samples_are_named() {
    let mut lags: Lags<f64, Const<2>> =
        Lags::new(&ArxOrders { na: 1, inputs: &[one(1, 1)], constant: false }).unwrap();
    let length = |found| Error::Length { argument: "inputs", expected: 1, found };
    assert_eq!(lags.push_inputs(&[]), Err(length(0)));
    assert_eq!(lags.push_inputs(&[1.0, 2.0]), Err(length(2)));
    let infinite = |argument| Error::Infinite { argument };
    assert_eq!(lags.push_inputs(&[f64::INFINITY]), Err(infinite("inputs")));
    assert_eq!(lags.push_output(f64::NEG_INFINITY), Err(infinite("output")));
}

#[test]
fn an_infinite_input_leaves_every_line_as_it_was() {
    let mut lags: Lags<f64, Const<2>, Const<2>> =
        Lags::new(&ArxOrders { na: 0, inputs: &[one(1, 1), one(1, 1)], constant: false }).unwrap();
    lags.push_inputs(&[1.0, 2.0]).unwrap();
    assert!(lags.push_inputs(&[3.0, f64::INFINITY]).is_err());
    lags.push_inputs(&[4.0, 5.0]).unwrap();
    assert_eq!(lags.regressor(), Some(&Vector2::new(1.0, 2.0)));
}

#[test]
fn orders_that_do_not_fit_are_an_error() {
    fn error<N: Dimension, D: Dimension>(na: usize, inputs: &[InputOrders]) -> Option<Error> {
        Lags::<f32, N, D>::new(&ArxOrders { na, inputs, constant: false }).err()
    }
    let orders = |needed, available| Some(Error::Orders { needed, available });
    let delays = |needed, available| Some(Error::Delays { needed, available });
    type One = Const<1>;
    type Three = Const<3>;
    assert_eq!(error::<Three, One>(2, &[one(1, 1)]), None);
    assert_eq!(error::<Three, One>(2, &[one(2, 1)]), orders(4, 3));
    assert_eq!(error::<Three, One>(1, &[one(1, 1)]), orders(2, 3));
    assert_eq!(error::<Three, One>(1, &[one(2, 2)]), delays(2, 1));
    assert_eq!(error::<Three, One>(1, &[one(1, 1); 2]), delays(2, 1));
    // An input without coefficients stores nothing.
    assert_eq!(error::<Three, One>(2, &[one(0, 9), one(1, 1)]), None);
    let most = usize::MAX;
    assert_eq!(error::<Three, One>(1, &[one(most, 1)]), orders(most, 3));
    assert_eq!(error::<Three, One>(2, &[one(1, most)]), delays(most, 1));
}

#[cfg(feature = "alloc")]
#[test]
fn numbers_that_a_line_does_not_hold_are_an_error() {
    use nalgebra::Dyn;

    let error = |inputs: &[InputOrders]| {
        Lags::<f32, Dyn, Dyn>::new(&ArxOrders { na: 0, inputs, constant: false }).err()
    };
    let (most, available) = (65_535, 65_535);
    assert_eq!(error(&[one(1, most)]), None);
    assert_eq!(error(&[one(1, most + 1)]), Some(Error::Delays { needed: most + 1, available }));
    assert_eq!(error(&[one(most + 1, 1)]), Some(Error::Orders { needed: most + 1, available }));
    let mut many = vec![one(0, 0); most + 1];
    many.push(one(1, 1));
    let length = Error::Length { argument: "inputs", expected: most, found: most + 1 };
    assert_eq!(error(&many), Some(length));
}

#[test]
fn a_clone_predicts_by_taking_its_own_predictions_for_outputs() {
    // y(k) = 0.5 y(k-1) + u(k-1) + 0.25 u(k-2)
    fn step<T: Real>(lags: &mut Lags<T, Const<3>>, theta: &Vector3<T>, u: T) -> T {
        lags.push_inputs(&[u]).unwrap();
        let y = lags.regressor().unwrap().dot(theta);
        lags.push_output(y).unwrap();
        y
    }
    let theta = Vector3::new(-0.5, 1.0, 0.25);
    let mut lags: Lags<f64, Const<3>> =
        Lags::new(&ArxOrders { na: 1, inputs: &[one(2, 1)], constant: false }).unwrap();
    for _ in 0..2 {
        lags.push_inputs(&[0.0]).unwrap();
        lags.push_output(0.0).unwrap();
    }
    let mut ahead = lags.clone();
    let predicted = [1.0, 0.0, 0.0, 0.0].map(|u| step(&mut ahead, &theta, u));
    assert_eq!(predicted, [0.0, 1.0, 0.75, 0.375]);
    // The original has not moved.
    assert_eq!(step(&mut lags, &theta, 0.0), 0.0);
}
