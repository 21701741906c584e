extern crate std;
use std::format;
use std::vec::Vec;

use nalgebra::{Const, SMatrix, SVector};

use crate::noise::Noise;
use crate::nonlinear_arx::tests::{BASIS, INPUTS, ORDERS, OUTPUT};
use crate::{
    Action, ArxOrders, Basis, Error, Forgetting, InputOrders, Polynomial, Radial, RecursiveNarx, RlsStart,
    Scaling,
};

type Estimator = RecursiveNarx<f64, Polynomial<'static>, Const<5>, Const<6>>;

fn estimator(forgetting: Forgetting<f64>) -> Estimator {
    RecursiveNarx::new(BASIS, &ORDERS, OUTPUT, &INPUTS, forgetting).unwrap()
}

const THETA: [f64; 6] = [0.1, 0.5, 0.4, -0.2, -0.1, 0.15];

/// Rows of a plant with these parameters: y(k), u(k).
fn rows(count: usize, noise: f64) -> Vec<(f64, [f64; 2])> {
    let (mut random, mut rows) = (Noise(3), Vec::new());
    let (mut y, mut u) = ([0.0; 2], [0.0; 2]);
    for _ in 0..count {
        let now = [random.next(), random.next()];
        let z = [y[0], y[1], u[0], now[1], u[1]];
        let next = BASIS.value(&THETA, &z) + noise * random.next();
        rows.push((OUTPUT.undo(next), [INPUTS[0].undo(now[0]), INPUTS[1].undo(now[1])]));
        (y, u) = ([next, y[0]], now);
    }
    rows
}

#[test]
fn without_forgetting_it_is_ridge_regression() {
    let rows = rows(400, 0.1);
    let mut recursive = estimator(Forgetting::None);
    // (Φ'Φ + I/100) θ = Φ'y: the prior is P = 100.
    let (mut gram, mut cross) = (SMatrix::<f64, 6, 6>::identity() * 0.01, SVector::<f64, 6>::zeros());
    let z = |value: f64, scaling: Scaling<f64>| (value - scaling.offset) / scaling.scale;
    for (k, (y, u)) in rows.iter().enumerate() {
        let innovation = recursive.log_row(*y, u).unwrap();
        if k < 2 {
            assert_eq!(innovation.action, Action::NotReady);
            continue;
        }
        let own = [
            z(rows[k - 1].0, OUTPUT),
            z(rows[k - 2].0, OUTPUT),
            z(rows[k - 1].1[0], INPUTS[0]),
            z(u[1], INPUTS[1]),
            z(rows[k - 1].1[1], INPUTS[1]),
        ];
        let mut phi = SVector::<f64, 6>::zeros();
        BASIS.evaluate(&own, phi.as_mut_slice());
        gram += phi * phi.transpose();
        cross += phi * z(*y, OUTPUT);
    }
    let batch = gram.cholesky().unwrap().solve(&cross);
    let difference = (recursive.estimator().parameters() - batch).amax();
    assert!(difference < 1e-12, "{difference:e}");
    let noise = recursive.noise_variance().unwrap();
    assert!((noise / (OUTPUT.scale * OUTPUT.scale * 0.01 / 3.0) - 1.0).abs() < 0.2, "{noise}");
}

#[test]
fn measured_and_applied_are_a_row() {
    let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 1 }], constant: false };
    let basis = Polynomial { factors: &[0, 2, 1, 3, 3], ends: &[0, 1, 2, 3, 5] };
    let make = || {
        RecursiveNarx::<f64, _, Const<4>, Const<5>>::new(
            basis,
            &orders,
            OUTPUT,
            &INPUTS[..1],
            Forgetting::Exponential { factor: 0.98 },
        )
        .unwrap()
    };
    let (mut rows_in, mut calls) = (make(), make());
    for (k, (y, u)) in rows(60, 0.1).iter().enumerate() {
        let (y, u) = (if k % 17 == 5 { f64::NAN } else { *y }, [if k % 13 == 4 { f64::NAN } else { u[0] }]);
        let one = rows_in.log_row(y, &u).unwrap();
        let other = calls.measured(y).unwrap();
        calls.applied(&u).unwrap();
        assert_eq!(format!("{one:?}"), format!("{other:?}"));
        // Two inputs in a row: the output between them is missing.
        if k == 30 {
            calls.applied(&[1.5]).unwrap();
            let _ = rows_in.log_row(f64::NAN, &[1.5]).unwrap();
        }
    }
    assert_eq!(format!("{rows_in:?}"), format!("{calls:?}"));
    let (mut later, mut now) = ([0.0; 3], [0.0; 3]);
    rows_in.predict(&[1.0, 2.0, 0.5], &mut later).unwrap();
    calls.predict(&[1.0, 2.0, 0.5], &mut now).unwrap();
    assert_eq!(later, now);
    assert!(later.iter().all(|y| y.is_finite()));
}

#[test]
fn innovations_are_in_units_of_the_output() {
    let mut plant = estimator(Forgetting::None).with_parameters(THETA.into()).unwrap();
    plant.set_adaptation(false);
    let rows = rows(50, 0.0);
    for (y, u) in &rows {
        let mut ahead = [0.0];
        plant.predict(u, &mut ahead).unwrap();
        // One off by 0.3 units.
        let innovation = plant.log_row(*y + 0.3, u).unwrap();
        if innovation.action != Action::NotReady {
            assert!((innovation.error - (y + 0.3 - ahead[0])).abs() < 1e-12);
        }
        plant.gap();
        assert_eq!(plant.log_row(*y, u).unwrap().action, Action::NotReady);
        plant.log_row(*y, u).unwrap();
    }
}

#[test]
fn single_precision_and_radial_functions_find_the_plant_too() {
    let mut random = Noise(8);
    let centres: Vec<f32> =
        (0..5).flat_map(|i| (0..5).map(move |j| [i, j])).flatten().map(|i| i as f32 - 2.0).collect();
    let basis = Radial { regressors: 2, centres: &centres, inverse_squares: &[0.25; 25], linear: true };
    let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    let unit = Scaling { offset: 0.0_f32, scale: 1.0 };
    let mut plant: RecursiveNarx<f32, _, Const<2>, Const<28>> =
        RecursiveNarx::new(basis, &orders, unit, &[unit], Forgetting::None)
            .unwrap()
            .with_start(RlsStart::Standard)
            .unwrap();
    let mut theta = [0.0; 28];
    (theta[1], theta[2 + 1 + 11], theta[2 + 1 + 13]) = (0.5, -0.8, 1.0);
    let (mut y, mut u, mut worst) = (0.0_f32, 0.0_f32, 0.0_f32);
    for k in 0..4000 {
        y = basis.value(&theta, &[y, u]);
        let innovation = plant.measured(y).unwrap();
        if k > 3000 {
            worst = worst.max(innovation.error.abs());
        }
        u = 2.0 * random.next() as f32;
        plant.applied(&[u]).unwrap();
    }
    assert!(worst < 5e-3, "{worst}");
}

#[test]
fn sizes_are_checked() {
    let error =
        RecursiveNarx::<f64, _, Const<5>, Const<7>>::new(BASIS, &ORDERS, OUTPUT, &INPUTS, Forgetting::None);
    assert_eq!(error.map(|_| ()).unwrap_err(), Error::Length { argument: "basis", expected: 7, found: 6 });
}

#[test]
fn what_overflows_leaves_again() {
    // Products of ten: their squares leave single precision long before the samples do.
    let basis = Polynomial { factors: &[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1], ends: &[10, 11] };
    let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    let unit = Scaling { offset: 0.0_f32, scale: 1.0 };
    let mut plant: RecursiveNarx<f32, _, Const<2>, Const<2>> =
        RecursiveNarx::new(basis, &orders, unit, &[unit], Forgetting::Exponential { factor: 0.98 }).unwrap();
    let mut actions = Vec::new();
    for k in 0..20 {
        actions.push(plant.log_row(if k == 10 { 1e9 } else { 0.5 }, &[1.0]).unwrap().action);
    }
    assert_eq!(actions[11], Action::NotReady);
    // Of two parameters, constant samples tell of one direction only.
    assert_eq!(actions[13], Action::Capped);
    assert!(plant.estimator().parameters().iter().all(|theta| theta.is_finite()));
}
