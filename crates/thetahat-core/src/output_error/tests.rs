extern crate std;
use std::println;
use std::vec;
use std::vec::Vec;

use nalgebra::{Const, SVector, Vector2};

use crate::arx::tests::{Plant, one};
use crate::noise::Noise;
use crate::{
    Action, ArxOrders, Error, Forgetting, OutputErrorMethod, Real, RecursiveArx, RecursiveOutputError,
};

const METHODS: [OutputErrorMethod; 2] = [OutputErrorMethod::PredictionError, OutputErrorMethod::Instruments];

const FIRST: ArxOrders<'_> = ArxOrders { na: 1, inputs: &[one(1, 1)], constant: false };

fn estimator<T: Real>(
    method: OutputErrorMethod,
    forgetting: Forgetting<T>,
) -> RecursiveOutputError<T, Const<2>> {
    RecursiveOutputError::new(&FIRST, method, T::one(), &[T::one()], forgetting).unwrap()
}

/// y and u of the plant of the table: x(k) = 0.9 x(k-1) + 0.08 u(k-1), sensor noise of half the deviation, with this
/// pole.
fn record(samples: usize, pole: f64, noise: &mut Noise) -> Vec<(f64, f64)> {
    let deviation = 0.5 * 0.08 / (1.0_f64 - 0.81).sqrt();
    let (mut x, mut v) = (0.0, noise.normal());
    let mut take = || {
        v = pole * v + (1.0 - pole * pole).sqrt() * noise.normal();
        let (y, u) = (x + deviation * v, noise.next().signum());
        x = 0.9 * x + 0.08 * u;
        (y, u)
    };
    (0..samples).map(|_| take()).collect()
}

/// The mean and the deviation.
fn statistics(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

#[test]
fn table() {
    // By noise: the errors of f_1 of ARX, and of both methods.
    let mut rows = [[(0.0, 0.0); 2]; 3];
    let (mut inside, mut counted) = (0, 0);
    for (column, pole) in [0.0, 0.5].into_iter().enumerate() {
        let mut errors = [const { Vec::new() }; 3];
        for seed in 0..200 {
            let mut arx: RecursiveArx<f64, Const<2>> =
                RecursiveArx::new(&FIRST, 1.0, &[1.0], Forgetting::None).unwrap();
            let mut models = METHODS.map(|method| estimator::<f64>(method, Forgetting::None));
            for (y, u) in record(5000, pole, &mut Noise(seed)) {
                arx.log_row(y, &[u]).unwrap();
                for model in &mut models {
                    model.log_row(y, &[u]).unwrap();
                }
            }
            errors[0].push(arx.estimator().parameters()[0] + 0.9);
            for (errors, model) in errors[1..].iter_mut().zip(&models) {
                errors.push(model.estimator().parameters()[0] + 0.9);
            }
            if pole == 0.0 {
                let found = models[0].estimator();
                let deviations = found.standard_errors().unwrap();
                let off = found.parameters() - Vector2::new(-0.9, 0.08);
                inside += off.iter().zip(&deviations).filter(|(off, by)| off.abs() < 1.96 * **by).count();
                counted += 2;
            }
            assert_eq!(models[1].estimator().standard_errors(), None);
        }
        for (row, errors) in rows.iter_mut().zip(&errors) {
            row[column] = statistics(errors);
        }
    }
    for (name, [white, coloured]) in ["ARX", "prediction error", "instruments"].iter().zip(rows) {
        let ((a, b), (c, d)) = (white, coloured);
        println!("{name}: {a:.4} | {b:.4} | {c:.4} | {d:.4}");
    }
    println!("{inside} of {counted} within 1.96 standard errors");
    assert!(rows[0][0].0 > 0.1 && rows[0][1].0 > 0.05, "ARX is biased: {rows:?}");
    for row in &rows[1..] {
        for (mean, deviation) in row {
            // Three standard errors of the mean of 200 runs, and what 5,000 samples leave of the start.
            assert!(mean.abs() < 3.0 * deviation / 200.0_f64.sqrt() + 0.002, "{rows:?}");
        }
    }
    assert!((0.92..0.98).contains(&(f64::from(inside as u32) / f64::from(counted))), "{inside} {counted}");
}

/// One that is frozen at these parameters.
fn frozen<const K: usize>(
    orders: &ArxOrders<'_>,
    method: OutputErrorMethod,
    parameters: SVector<f64, K>,
) -> RecursiveOutputError<f64, Const<K>, Const<4>> {
    let scales = vec![1.0; orders.inputs.len()];
    let mut model = RecursiveOutputError::new(orders, method, 1.0, &scales, Forgetting::None)
        .unwrap()
        .with_parameters(parameters)
        .unwrap();
    model.set_adaptation(false);
    model
}

const SECOND: ArxOrders<'_> = ArxOrders { na: 2, inputs: &[one(2, 1), one(1, 3)], constant: true };

/// The parameters of a random stable plant, with a constant.
fn random_parameters(noise: &mut Noise) -> SVector<f64, 6> {
    let plant = Plant::random(&SECOND, 0, noise).parameters();
    SVector::from_iterator(plant.into_iter().chain([noise.next()]))
}

#[test]
fn the_innovation_is_the_measurement_less_the_free_run_and_missing_ones_change_nothing_in_it() {
    let mut noise = Noise(1);
    for trial in 0..20 {
        let truth = random_parameters(&mut noise);
        for method in METHODS {
            let mut model = frozen(&SECOND, method, truth);
            let (mut x, mut u) = (Vec::new(), Vec::<[f64; 2]>::new());
            for k in 0..60_usize {
                u.push([noise.next(), noise.next()]);
                let at = |values: &[f64], lag: usize| k.checked_sub(lag).map(|time| values[time]);
                let of = |input: usize, lag: usize| k.checked_sub(lag).map(|time| u[time][input]);
                let free = (|| {
                    let past = -truth[0] * at(&x, 1)? - truth[1] * at(&x, 2)?;
                    let inputs = truth[2] * of(0, 1)? + truth[3] * of(0, 2)? + truth[4] * of(1, 3)?;
                    Some(past + inputs + truth[5])
                })();
                // The first measurements stand in.
                let y = if k > 5 && noise.next() < 0.0 { f64::NAN } else { 3.0 * noise.next() };
                let innovation = model.log_row(y, &u[k]).unwrap();
                match free {
                    Some(free) if y.is_finite() => {
                        assert!((innovation.error - (y - free)).abs() < 1e-12, "{trial} {k}");
                    }
                    Some(_) => assert_eq!(innovation.action, Action::Missing),
                    None => assert_eq!(innovation.action, Action::NotReady),
                }
                x.push(free.unwrap_or(y));
            }
            let mut ahead = [0.0; 2];
            model.predict(&[0.0; 4], &mut ahead).unwrap();
            assert!(ahead.iter().all(|ahead| ahead.is_finite()));
        }
    }
}

#[test]
fn the_gradient_is_that_of_the_models_output() {
    let mut noise = Noise(2);
    for _ in 0..10 {
        let truth = random_parameters(&mut noise);
        let method = OutputErrorMethod::PredictionError;
        let mut centre = frozen(&SECOND, method, truth);
        let step = 1e-6;
        let mut sides: Vec<_> = (0..6)
            .map(|index| {
                let mut shift = SVector::<f64, 6>::zeros();
                shift[index] = step;
                [frozen(&SECOND, method, truth + shift), frozen(&SECOND, method, truth - shift)]
            })
            .collect();
        for k in 0..50 {
            let (u, y) = ([noise.next(), noise.next()], noise.next());
            centre.log_row(y, &u).unwrap();
            for (index, sides) in sides.iter_mut().enumerate() {
                let [above, below] = sides.each_mut().map(|side| side.log_row(y, &u).unwrap().error);
                if k > 5 {
                    let slope = (below - above) / (2.0 * step);
                    assert!(
                        (slope - centre.past[(index, 0)]).abs() < 1e-6 * (1.0 + slope.abs()),
                        "{k} {index}"
                    );
                }
            }
        }
    }
}

#[test]
fn equal_noise_free_data_give_the_plant_with_both_methods() {
    for method in METHODS {
        let mut noise = Noise(3);
        let truth = random_parameters(&mut noise);
        let mut plant = frozen(&SECOND, method, truth);
        let mut model: RecursiveOutputError<f64, Const<6>, Const<4>> = RecursiveOutputError::new(
            &SECOND,
            method,
            3.0,
            &[1.0, 1.0],
            Forgetting::Exponential { factor: 0.99 },
        )
        .unwrap();
        for _ in 0..6000 {
            let u = [noise.next(), noise.next()];
            let mut x = [0.0];
            plant.predict(&[0.0; 2], &mut x).unwrap();
            // Like a controller: the output of what was applied before.
            let y = if x[0].is_finite() { x[0] } else { 0.0 };
            plant.log_row(y, &u).unwrap();
            model.log_row(y, &u).unwrap();
        }
        assert!((model.estimator().parameters() - truth).amax() < 1e-6, "{method:?} {truth}");
    }
}

#[test]
fn after_a_missing_input_measurements_stand_in() {
    for method in METHODS {
        let mut model = frozen(&FIRST, method, Vector2::new(-0.5, 1.0));
        let actions = [(1.0, 1.0), (1.5, f64::NAN), (7.0, 0.0), (9.0, 0.0), (4.5, 0.0), (0.0, 0.0)]
            .map(|(y, u)| (model.log_row(y, &[u]).unwrap().error, model.lags().regressor().cloned()));
        // x(1) = 0.5 + 1; x(2) is not known, so that y(2) = 7 stands in and x(3) = 3.5.
        assert_eq!(actions[1].0, 0.0);
        assert!(actions[2].0.is_nan());
        assert_eq!(actions[3].0, 9.0 - 3.5);
        assert_eq!(actions[4].0, 4.5 - 1.75);
    }
}

#[test]
fn instruments_wait_for_measurements_in_a_row() {
    let mut model = estimator::<f64>(OutputErrorMethod::Instruments, Forgetting::None);
    let mut actions = Vec::new();
    for y in [1.0, 1.0, f64::NAN, 1.0, 1.0] {
        actions.push(model.log_row(y, &[1.0]).unwrap().action);
    }
    use Action::{Missing, NotReady, Updated};
    assert_eq!(actions, [NotReady, Updated, Missing, NotReady, Updated]);
    model.gap();
    assert_eq!(model.log_row(1.0, &[1.0]).unwrap().action, NotReady);
}

#[test]
fn f_stays_stable_and_limits_hold() {
    for method in METHODS {
        let mut model = estimator::<f32>(method, Forgetting::Exponential { factor: 0.9 });
        let mut noise = Noise(4);
        let mut projected = 0;
        for k in 0..3000 {
            // A plant that is not stable for some time.
            let y = if k % 300 < 20 { 1.3_f64.powi(k % 300) } else { noise.next() };
            let innovation = model.log_row(y as f32, &[noise.next() as f32]).unwrap();
            projected += usize::from(innovation.action == Action::Projected);
            assert!(model.estimator().parameters()[0].abs() < 1.0);
            assert!(model.estimator().parameters().iter().all(|value| value.is_finite()));
            model.keep_within(&[-0.9..=0.9, 0.0..=f32::INFINITY]).unwrap();
            assert!(
                model.estimator().parameters()[0].abs() <= 0.9 && model.estimator().parameters()[1] >= 0.0
            );
        }
        assert!(projected > 0);
        // Where the limits leave no stable F, it stays.
        let before = model.estimator().parameters()[0];
        assert!(model.keep_within(&[1.5..=2.0, 0.0..=1.0]).unwrap());
        assert_eq!(model.estimator().parameters()[0], before);
    }
}

#[test]
fn what_is_wrong_is_said_and_changes_nothing() {
    for method in METHODS {
        let mut model = estimator::<f64>(method, Forgetting::None);
        for k in 0..5 {
            model.log_row(f64::from(k), &[f64::from(k % 2)]).unwrap();
        }
        let before = std::format!("{model:?}");
        assert_eq!(model.log_row(f64::INFINITY, &[1.0]).unwrap_err(), Error::Infinite { argument: "output" });
        assert_eq!(model.log_row(1.0, &[f64::INFINITY]).unwrap_err(), Error::Infinite { argument: "inputs" });
        assert_eq!(model.measured(1e200).unwrap_err(), Error::TooLarge { argument: "output" });
        let error = Error::Length { argument: "inputs", expected: 1, found: 2 };
        assert_eq!(model.applied(&[1.0, 2.0]).unwrap_err(), error);
        assert!(matches!(model.keep_within(&[0.0..=1.0]), Err(Error::Length { .. })));
        assert_eq!(std::format!("{model:?}"), before);
        let wrong = estimator::<f64>(method, Forgetting::None).with_parameters(Vector2::new(-1.0, 1.0));
        assert!(matches!(wrong, Err(Error::OutOfRange { argument: "parameters", .. })));
        let direct = ArxOrders { na: 1, inputs: &[one(1, 0)], constant: false };
        let mut direct: RecursiveOutputError<f64, Const<2>> =
            RecursiveOutputError::new(&direct, method, 1.0, &[1.0], Forgetting::None).unwrap();
        assert_eq!(direct.measured(1.0).unwrap_err(), Error::InputFirst { input: 0 });
    }
}

#[cfg(feature = "alloc")]
#[test]
fn run_time_sizes_give_the_same_bits() {
    use nalgebra::Dyn;

    for method in METHODS {
        let mut fixed = estimator::<f64>(method, Forgetting::default());
        let mut dynamic: RecursiveOutputError<f64, Dyn, Dyn> =
            RecursiveOutputError::new(&FIRST, method, 1.0, &[1.0], Forgetting::default()).unwrap();
        for (y, u) in record(100, 0.5, &mut Noise(7)) {
            let answers = (fixed.log_row(y, &[u]), dynamic.log_row(y, &[u]));
            assert_eq!(std::format!("{:?}", answers.0), std::format!("{:?}", answers.1));
            let found = (fixed.estimator().parameters(), dynamic.estimator().parameters());
            assert_eq!(found.0.as_slice(), found.1.as_slice());
        }
    }
}
