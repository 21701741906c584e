extern crate std;
use std::vec::Vec;

use nalgebra::{Const, Vector1, Vector2};

use super::*;
use crate::{
    Action, ArmaxMethod, ArmaxOrders, ArxOrders, Forgetting, InputOrders, OutputErrorMethod, Polynomial,
    RecursiveArmax, RecursiveArx, RecursiveLeastSquares, RecursiveNarx, RecursiveOutputError,
    RecursiveVectorArx, Scaling,
};

const HUBER: Outliers<f64> = Outliers::Huber { threshold: 3.0 };
const GATE: Outliers<f64> = Outliers::Gate { nis: 25.0, release: 20 };
const ORDERS: ArxOrders<'static> =
    ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 1 }], constant: false };
const THETA: [f64; 4] = [-1.5, 0.7, 1.0, 0.5];
const FORGETTING: Forgetting<f64> = Forgetting::Exponential { factor: 0.99 };

/// Uniform in -0.5 … 0.5.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0) / f64::from(u32::MAX) - 0.5
    }
}

/// Runs a plant of second order; `noise_of` and `spike_of` give the noise of the equation and of the sensor of a
/// sample; `sample` takes y(k) and u(k).
fn run(samples: usize, spike_of: impl Fn(usize) -> f64, mut sample: impl FnMut(usize, f64, f64)) {
    let (mut noise, mut y, mut u) = (Noise(1), [0.0; 2], [0.0; 2]);
    for k in 0..samples {
        let now = 1.5 * y[0] - 0.7 * y[1] + u[0] + 0.5 * u[1] + 0.3 * noise.next();
        y = [now, y[0]];
        u = [if noise.next() > 0.0 { 1.0 } else { -1.0 }, u[0]];
        sample(k, now + spike_of(k), u[0]);
    }
}

fn every_hundredth(k: usize) -> f64 {
    if k % 100 == 99 { 300.0 } else { 0.0 }
}

fn farthest(parameters: &[f64]) -> f64 {
    parameters.iter().zip(THETA).map(|(theta, truth)| (theta - truth).abs()).fold(0.0, f64::max)
}

fn arx(outliers: Outliers<f64>) -> RecursiveArx<f64, Const<4>> {
    RecursiveArx::new(&ORDERS, 5.0, &[1.0], FORGETTING).unwrap().with_outliers(outliers).unwrap()
}

#[test]
fn spikes_do_not_spoil_a_recursive_arx_model() {
    for (outliers, action, most) in [
        (Outliers::Used, Action::Updated, f64::INFINITY),
        (HUBER, Action::Bounded, 0.1),
        (GATE, Action::Gated, 0.1),
    ] {
        let mut plant = arx(outliers);
        let mut worst = 0.0_f64;
        run(5000, every_hundredth, |k, y, u| {
            let innovation = plant.log_row(y, &[u]).unwrap();
            if k > 1000 {
                worst = worst.max(farthest(plant.estimator().parameters().as_slice()));
                if k % 100 == 99 {
                    assert_eq!(innovation.action, action, "{k} {outliers:?}");
                }
            }
        });
        assert!(worst < most, "{worst} {outliers:?}");
        // So it is without them.
        assert!(outliers != Outliers::Used || worst > 1.0, "{worst}");
        assert!(outliers == Outliers::Used || plant.estimator().noise_variance().unwrap() < 0.02);
    }
}

#[test]
fn where_there_are_none_nothing_changes_but_a_little_with_huber() {
    let (mut used, mut gated, mut bounded) = (arx(Outliers::Used), arx(GATE), arx(HUBER));
    run(
        3000,
        |_| 0.0,
        |_, y, u| {
            for plant in [&mut used, &mut gated, &mut bounded] {
                plant.log_row(y, &[u]).unwrap();
            }
        },
    );
    assert_eq!(used.estimator().parameters(), gated.estimator().parameters());
    assert!((used.estimator().parameters() - bounded.estimator().parameters()).amax() < 1e-2);
    assert_eq!(gated.estimator().outliers_in_a_row(), 0);
}

#[test]
fn a_plant_that_jumps_is_let_in() {
    let mut level: RecursiveLeastSquares<f64, Const<1>> =
        RecursiveLeastSquares::new(&Vector1::new(1.0), FORGETTING).unwrap().with_outliers(GATE).unwrap();
    let mut noise = Noise(3);
    let mut actions = Vec::new();
    for k in 0..1000 {
        let y = if k < 500 { 5.0 } else { 50.0 };
        actions.push(level.update(&Vector1::new(1.0), y + 0.2 * noise.next()).unwrap().action);
        assert!(level.outliers_in_a_row() <= 500);
    }
    assert!(actions[500..503].iter().all(|action| *action == Action::Gated), "{:?}", &actions[500..530]);
    assert!((level.parameters()[0] - 50.0).abs() < 1.0, "{}", level.parameters());
    // A gate that never lets go does so once the noise variance has learnt of them.
    level.set_outliers(Outliers::Gate { nis: 25.0, release: 0 }).unwrap();
    for _ in 0..500 {
        level.update(&Vector1::new(1.0), 5.0 + 0.2 * noise.next()).unwrap();
    }
    assert!((level.parameters()[0] - 5.0).abs() < 2.0, "{}", level.parameters());
}

#[test]
fn a_plant_without_noise_that_changes_is_followed() {
    for outliers in [HUBER, GATE, Outliers::Gate { nis: 25.0, release: 0 }] {
        let mut plant: RecursiveArx<f64, Const<2>> = RecursiveArx::new(
            &ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false },
            5.0,
            &[1.0],
            Forgetting::Exponential { factor: 0.95 },
        )
        .unwrap()
        .with_outliers(outliers)
        .unwrap();
        let (mut noise, mut y, mut u) = (Noise(1), 0.0, 0.0);
        for k in 0..1000 {
            y = 0.9 * y + if k < 500 { 0.1 } else { 0.3 } * u;
            u = noise.next();
            plant.log_row(y, &[u]).unwrap();
        }
        let b0 = plant.estimator().parameters()[1];
        assert!((b0 - 0.3).abs() < 1e-3, "{outliers:?}: {b0}");
    }
}

#[test]
fn while_it_is_frozen_lines_take_what_was_measured() {
    let (mut plant, mut used) = (arx(HUBER), arx(Outliers::Used));
    run(
        1001,
        |k| if k >= 999 { 300.0 } else { 0.0 },
        |k, y, u| {
            plant.log_row(y, &[u]).unwrap();
            used.log_row(y, &[u]).unwrap();
            plant.set_adaptation(k < 999);
        },
    );
    // The spike of 999 was cleaned; that of 1000 came while the estimator was frozen.
    assert_eq!(plant.estimator().outliers_in_a_row(), 1);
    let newest = |plant: &RecursiveArx<f64, Const<4>>| plant.lags().regressor().unwrap()[0];
    assert_eq!(newest(&plant), newest(&used));
}

#[test]
fn with_instruments_there_is_no_rule() {
    let mut plant: RecursiveOutputError<f64, Const<4>> =
        RecursiveOutputError::new(&ORDERS, OutputErrorMethod::Instruments, 5.0, &[1.0], FORGETTING).unwrap();
    assert!(matches!(plant.set_outliers(HUBER), Err(Error::OutOfRange { argument: "outliers", .. })));
    plant.set_outliers(Outliers::Used).unwrap();
}

#[test]
fn other_estimators_have_it_too() {
    let orders = ArmaxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 1 }], nc: 1, constant: false };
    for outliers in [HUBER, GATE] {
        let mut armax: RecursiveArmax<f64, Const<5>> =
            RecursiveArmax::new(&orders, ArmaxMethod::PredictionError, 5.0, &[1.0], 0.1, FORGETTING)
                .unwrap()
                .with_outliers(outliers)
                .unwrap();
        let mut vector: RecursiveVectorArx<f64, Const<4>, Const<1>> =
            RecursiveVectorArx::new(&ORDERS, &Vector1::new(5.0), &[1.0], FORGETTING)
                .unwrap()
                .with_outliers(outliers)
                .unwrap();
        let basis = Polynomial { factors: &[0, 1, 2, 3], ends: &[1, 2, 3, 4] };
        let unit = Scaling { offset: 0.0, scale: 1.0 };
        let mut narx: RecursiveNarx<f64, _, Const<4>, Const<4>> =
            RecursiveNarx::new(basis, &ORDERS, unit, &[unit], FORGETTING)
                .unwrap()
                .with_outliers(outliers)
                .unwrap();
        let mut output_error: RecursiveOutputError<f64, Const<4>> =
            RecursiveOutputError::new(&ORDERS, OutputErrorMethod::PredictionError, 5.0, &[1.0], FORGETTING)
                .unwrap()
                .with_outliers(outliers)
                .unwrap();
        run(5000, every_hundredth, |_, y, u| {
            armax.log_row(y, &[u]).unwrap();
            vector.log_row(&Vector1::new(y), &[u]).unwrap();
            narx.log_row(y, &[u]).unwrap();
            output_error.log_row(y, &[u]).unwrap();
        });
        for (name, parameters) in [
            ("armax", armax.estimator().parameters().as_slice()),
            ("vector", vector.estimator().parameters().as_slice()),
            ("output error", output_error.estimator().parameters().as_slice()),
        ] {
            assert!(farthest(parameters) < 0.2, "{name} {outliers:?} {parameters:?}");
        }
        // Here y(k-1) has the other sign.
        let [a1, a2, b0, b1] = (*narx.estimator().parameters()).into();
        assert!(farthest(&[-a1, -a2, b0, b1]) < 0.2, "narx {outliers:?} {}", narx.estimator().parameters());
    }
}

#[test]
fn thresholds_below_one_are_refused_and_change_nothing() {
    let mut line: RecursiveLeastSquares<f32, Const<2>> =
        RecursiveLeastSquares::new(&Vector2::new(1.0, 1.0), Forgetting::None).unwrap();
    for outliers in [
        Outliers::Huber { threshold: 0.5 },
        Outliers::Huber { threshold: f32::NAN },
        Outliers::Gate { nis: f32::INFINITY, release: 0 },
        Outliers::Gate { nis: -9.0, release: 0 },
    ] {
        assert!(matches!(line.set_outliers(outliers), Err(Error::OutOfRange { .. })));
        assert_eq!(line.outliers(), Outliers::Used);
    }
}

/// Of 100 runs of ARX(1, 1) with Gaussian noise and forgetting by 0.99: the error of b_0 in its deviations without a
/// rule, by its mean square; without outliers, with one sample in 100 a spike of 30 deviations, and after b_0 changes
/// from 1 to 2, how many samples it takes until half of that is learnt.
fn figures(outliers: Outliers<f64>) -> [f64; 3] {
    let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    let mut sums = [0.0; 3];
    for seed in 0..100 {
        let mut noise = Noise(seed * 7919 + 1);
        for (column, sum) in sums.iter_mut().enumerate() {
            let mut plant: RecursiveArx<f64, Const<2>> =
                RecursiveArx::new(&orders, 5.0, &[1.0], FORGETTING).unwrap().with_outliers(outliers).unwrap();
            let (mut y, mut u, mut until) = (0.0, 0.0, None);
            for k in 0..1500 {
                let changed = column == 2 && k >= 1000;
                let gaussian = 0.2 * (0..12).map(|_| noise.next()).sum::<f64>();
                y = 0.8 * y + if changed { 2.0 } else { 1.0 } * u + gaussian;
                u = if noise.next() > 0.0 { 1.0 } else { -1.0 };
                let spike = if column == 1 && k % 100 == 50 { 6.0 } else { 0.0 };
                plant.log_row(y + spike, &[u]).unwrap();
                let b0 = plant.estimator().parameters()[1];
                if changed && b0 > 1.5 {
                    until = until.or(Some(f64::from(k - 999)));
                } else if column < 2 && k >= 500 {
                    *sum += (b0 - 1.0).powi(2) / 1000.0;
                }
            }
            *sum += until.unwrap_or(if column == 2 { f64::INFINITY } else { 0.0 });
        }
    }
    [(sums[0] / 100.0).sqrt(), (sums[1] / 100.0).sqrt(), sums[2] / 100.0]
}

#[test]
fn table() {
    let text = include_str!("../outliers.rs");
    let rows = [
        ("`Used`", Outliers::Used),
        ("`Huber`, 3", HUBER),
        ("`Gate`, 25, 20", GATE),
        ("`Gate`, 16, 5", Outliers::Gate { nis: 16.0, release: 5 }),
    ];
    let mut known = true;
    for (name, outliers) in rows {
        let [clean, spikes, samples] = figures(outliers);
        let row = std::format!("| {name} | {clean:.4} | {spikes:.4} | {samples:.1} |");
        std::println!("{row}");
        known &= text.contains(&row);
    }
    assert!(known, "not what the documentation says");
}
