extern crate std;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use nalgebra::{Const, SVector, Vector4};

use crate::arx::tests::{Plant, inputs_at, one, stable_polynomial};
use crate::lags::is_large;
use crate::noise::Noise;
use crate::stability::{is_stable, move_stably};
use crate::{
    Action, ArmaxMethod, ArmaxOrders, ArxOrders, Covariance, Error, Forgetting, InputOrders, RecursiveArmax,
    RecursiveArx,
};

const METHODS: [ArmaxMethod; 2] = [ArmaxMethod::ExtendedLeastSquares, ArmaxMethod::PredictionError];
const FORGETTING: Forgetting<f64> = Forgetting::Exponential { factor: 0.99 };

fn debug<T: std::fmt::Debug>(value: &T) -> String {
    format!("{value:?}")
}

#[test]
fn stability_is_that_of_the_zeros() {
    let mut noise = Noise(1);
    let (mut stable, mut unstable) = (0, 0);
    for trial in 0..2000 {
        // Real zeros and pairs, some of them outside.
        let range = if trial % 2 == 0 { 0.495 } else { 0.6 };
        let (mut polynomial, mut largest) = (vec![1.0], 0.0_f64);
        let mut multiply = |first: f64, second: f64, radius: f64| {
            let product = |k: usize| {
                let at =
                    |lag: usize| k.checked_sub(lag).and_then(|k| polynomial.get(k)).copied().unwrap_or(0.0);
                at(0) + first * at(1) + second * at(2)
            };
            polynomial = (0..polynomial.len() + 1 + usize::from(second != 0.0)).map(product).collect();
            largest = largest.max(radius);
        };
        for _ in 0..trial % 4 {
            let radius = (1.0 + noise.next()) * range;
            multiply(radius * noise.next().signum(), 0.0, radius);
        }
        for _ in 0..(trial / 4) % 3 {
            let radius = (1.0 + noise.next()) * range;
            multiply(2.0 * radius * noise.next(), radius * radius, radius);
        }
        if (0.998..1.0).contains(&largest) {
            continue;
        }
        let mut c = polynomial[1..].to_vec();
        assert_eq!(is_stable(&mut c), largest < 1.0, "{polynomial:?} {largest}");
        *if largest < 1.0 { &mut stable } else { &mut unstable } += 1;
    }
    assert!(stable > 500 && unstable > 200, "{stable} {unstable}");
    assert!(is_stable::<f64>(&mut []));
    assert!(!is_stable(&mut [0.0, f64::NAN]));
    assert!(!is_stable(&mut [f64::INFINITY]));
}

#[test]
fn a_step_is_halved_until_c_is_stable() {
    let mut parameters = [5.0, 0.5];
    // 0.5 + 1.6/4 < 1
    assert!(move_stably(&mut parameters, &[10.0, 1.0], 1.6, 1..2, &mut [0.0]));
    assert_eq!(parameters, [9.0, 0.9]);
    assert!(!move_stably(&mut parameters, &[10.0, -1.0], 0.1, 1..2, &mut [0.0]));
    assert_eq!(parameters, [10.0, 0.8]);
    // Nothing helps.
    assert!(move_stably(&mut parameters, &[10.0, 1e6], 1.0, 1..2, &mut [0.0]));
    assert_eq!(parameters, [10.0, 0.8]);
}

#[test]
fn without_residuals_it_is_arx() {
    let orders = ArxOrders { na: 2, inputs: &[one(1, 1), one(1, 2)], constant: false };
    let mut arx: RecursiveArx<f64, Const<4>, Const<3>> =
        RecursiveArx::new(&orders, 2.0, &[1.0, 10.0], FORGETTING).unwrap();
    let same = ArmaxOrders { na: 2, inputs: orders.inputs, nc: 0, constant: false };
    let mut armax = METHODS.map(|method| {
        RecursiveArmax::<f64, Const<4>, Const<3>>::new(&same, method, 2.0, &[1.0, 10.0], 1.0, FORGETTING)
            .unwrap()
    });
    let mut noise = Noise(2);
    for k in 0..500 {
        let mut sample = || if noise.next() < -0.95 { f64::NAN } else { noise.next() };
        let (u, y) = ([sample(), sample()], sample());
        let expected = debug(&arx.log_row(y, &u));
        let (mut ahead, mut other) = ([0.0; 5], [0.0; 5]);
        arx.predict(&[0.5; 10], &mut ahead).unwrap();
        for armax in &mut armax {
            assert_eq!(debug(&armax.log_row(y, &u)), expected);
            assert_eq!(debug(armax.estimator()), debug(arx.estimator()));
            armax.predict(&[0.5; 10], &mut other).unwrap();
            assert_eq!(debug(&other), debug(&ahead), "{k}");
            assert!(armax.c().eq([1.0]));
        }
    }
}

/// A frozen estimator with these parameters.
fn frozen<const K: usize, const L: usize>(
    orders: &ArmaxOrders<'_>,
    method: ArmaxMethod,
    parameters: SVector<f64, K>,
) -> RecursiveArmax<f64, Const<K>, Const<L>> {
    let scales = vec![1.0; orders.inputs.len()];
    let mut armax = RecursiveArmax::new(orders, method, 1.0, &scales, 1.0, FORGETTING)
        .unwrap()
        .with_parameters(parameters)
        .unwrap();
    armax.set_adaptation(false);
    armax
}

#[test]
fn the_gradient_is_that_of_the_prediction() {
    let orders = ArmaxOrders { na: 2, inputs: &[one(1, 1)], nc: 2, constant: false };
    let plant = ArxOrders { na: 2, inputs: orders.inputs, constant: false };
    for seed in 0..10 {
        let mut noise = Noise(seed);
        let truth = Plant::random(&plant, 2, &mut noise);
        let (inputs, outputs) = truth.record(300, 1.0, &mut noise);
        let model = SVector::<f64, 5>::from_row_slice(&Plant::random(&plant, 2, &mut noise).parameters());
        let method = ArmaxMethod::PredictionError;
        let mut centre = frozen::<5, 1>(&orders, method, model);
        let step = 1e-6;
        let mut sides = (0..5)
            .map(|index| {
                let mut shift = SVector::<f64, 5>::zeros();
                shift[index] = step;
                [
                    frozen::<5, 1>(&orders, method, model + shift),
                    frozen::<5, 1>(&orders, method, model - shift),
                ]
            })
            .collect::<Vec<_>>();
        for (k, &y) in outputs.iter().enumerate() {
            let u = inputs_at(&inputs, k);
            centre.log_row(y, &u).unwrap();
            for (index, sides) in sides.iter_mut().enumerate() {
                let [above, below] = sides.each_mut().map(|side| side.log_row(y, &u).unwrap().error);
                // dŷ/dθ = -de/dθ. The first residuals are counted as 0 by all.
                let slope = (below - above) / (2.0 * step);
                if k > 2 {
                    assert!(
                        (slope - centre.gradients[(index, 0)]).abs() < 1e-6 * (1.0 + slope.abs()),
                        "{seed} {k}"
                    );
                }
            }
        }
    }
}

/// Random stable plants: with the true parameters, what is left is the noise, and predictions use it.
fn follow<const K: usize, const L: usize>(orders: &ArmaxOrders<'_>, seed: u64) {
    let mut noise = Noise(seed);
    let plant = Plant::random(
        &ArxOrders { na: orders.na, inputs: orders.inputs, constant: false },
        orders.nc,
        &mut noise,
    );
    let parameters = SVector::<f64, K>::from_row_slice(&plant.parameters());
    let steps = 300;
    let inputs: Vec<Vec<f64>> =
        orders.inputs.iter().map(|_| (0..steps).map(|_| noise.next()).collect()).collect();
    let mut e: Vec<f64> = (0..steps).map(|_| noise.next()).collect();
    e[280..].fill(0.0);
    let mut outputs = vec![];
    for k in 0..steps {
        outputs.push(plant.output(k, &outputs, &inputs, &e));
    }
    for method in METHODS {
        let mut armax = frozen::<K, L>(orders, method, parameters);
        for k in 0..280 {
            let innovation = armax.log_row(outputs[k], &inputs_at(&inputs, k)).unwrap();
            if k > 250 {
                // The start has been forgotten.
                assert!((innovation.error - e[k]).abs() < 1e-8, "{orders:?} {seed} {k}");
                assert_eq!(innovation.action, Action::Frozen);
            }
        }
        let mut ahead = [0.0; 20];
        let future: Vec<f64> = (280..300).flat_map(|k| inputs_at(&inputs, k)).collect();
        armax.predict(&future, &mut ahead).unwrap();
        for (predicted, expected) in ahead.iter().zip(&outputs[280..]) {
            assert!((predicted - expected).abs() < 1e-7, "{orders:?} {seed}");
        }
        assert!(armax.a().eq([1.0].into_iter().chain(plant.a.iter().copied())));
        assert!(armax.c().eq([1.0].into_iter().chain(plant.c.iter().copied())));
        for (index, (b, nk)) in plant.b.iter().enumerate() {
            let zeros = if b.is_empty() { 0 } else { *nk };
            let expected = [vec![0.0; zeros], b.clone()].concat();
            assert!(armax.b(index).unwrap().eq(expected));
        }
        assert!(armax.b(plant.b.len()).is_none());
    }
}

#[test]
fn true_parameters_leave_the_noise_and_predict_with_it() {
    for seed in 0..20 {
        follow::<4, 1>(&ArmaxOrders { na: 2, inputs: &[], nc: 2, constant: false }, seed);
        follow::<4, 1>(&ArmaxOrders { na: 1, inputs: &[one(1, 1)], nc: 2, constant: false }, seed);
        follow::<6, 4>(&ArmaxOrders { na: 2, inputs: &[one(2, 1), one(1, 3)], nc: 1, constant: false }, seed);
        follow::<5, 2>(
            &ArmaxOrders { na: 1, inputs: &[one(0, 7), one(1, 0), one(1, 2)], nc: 2, constant: false },
            seed,
        );
        follow::<3, 1>(&ArmaxOrders { na: 0, inputs: &[one(1, 1)], nc: 2, constant: false }, seed);
    }
}

#[test]
fn random_stable_plants_are_identified() {
    const ORDERS: ArmaxOrders =
        ArmaxOrders { na: 2, inputs: &[InputOrders { nb: 1, nk: 1 }], nc: 1, constant: false };
    for seed in 0..12 {
        let mut noise = Noise(seed);
        let mut plant =
            Plant::random(&ArxOrders { na: 2, inputs: ORDERS.inputs, constant: false }, 0, &mut noise);
        // |c| < 1: 1/C - 1/2 is positive real, so that both methods converge.
        plant.c = stable_polynomial(1, 0.9, &mut noise);
        plant.b[0].0[0] = 1.0;
        let (inputs, outputs) = plant.record(6000, 0.5, &mut noise);
        for method in METHODS {
            let forgetting = Forgetting::Exponential { factor: 0.999 };
            let mut armax: RecursiveArmax<f64, Const<4>> =
                RecursiveArmax::new(&ORDERS, method, 2.0, &[1.0], 0.3, forgetting).unwrap();
            for (k, &y) in outputs.iter().enumerate() {
                armax.log_row(y, &inputs_at(&inputs, k)).unwrap();
            }
            // Eight standard errors, as they are estimated, or so.
            let away = armax.estimator().parameters() - Vector4::from_row_slice(&plant.parameters());
            let errors = armax.estimator().parameter_covariance().unwrap().variances().map(f64::sqrt);
            assert!(away.component_div(&errors).amax() < 8.0, "{method:?} {seed}: {away} {errors}");
            assert!(errors.amax() < 0.06);
            let noise = armax.estimator().noise_variance().unwrap();
            assert!((noise * 12.0 - 1.0).abs() < 0.15, "{method:?} {seed}: {noise}");
        }
    }
}

#[test]
fn extended_least_squares_stays_away_where_prediction_error_arrives() {
    // The counterexample of Ljung, Söderström and Gustavsson 1975; Ljung and Söderström 1983, example 5.11.
    let orders = ArmaxOrders { na: 2, inputs: &[], nc: 2, constant: false };
    let truth = Vector4::new(0.9, 0.95, 1.5, 0.75);
    let furthest = |method| {
        let forgetting = Forgetting::Exponential { factor: 0.999 };
        let mut armax: RecursiveArmax<f64, Const<4>> =
            RecursiveArmax::new(&orders, method, 5.0, &[], 1.0, forgetting).unwrap();
        let (mut noise, mut y, mut e, mut sum) = (Noise(3), [0.0; 2], [0.0; 2], 0.0);
        for k in 0..40_000 {
            let now = 3.0_f64.sqrt() * noise.next();
            let output = -0.9 * y[0] - 0.95 * y[1] + now + 1.5 * e[0] + 0.75 * e[1];
            (y, e) = ([output, y[0]], [now, e[0]]);
            armax.log_row(output, &[]).unwrap();
            if k >= 20_000 {
                sum += (armax.estimator().parameters() - truth).norm_squared() / 20_000.0;
            }
        }
        sum.sqrt()
    };
    let extended = furthest(ArmaxMethod::ExtendedLeastSquares);
    let prediction = furthest(ArmaxMethod::PredictionError);
    assert!(extended > 0.15, "{extended}");
    // The standard errors of so long a memory add up to 0.03.
    assert!(prediction < 0.04, "{prediction}");
}

#[test]
fn c_stays_stable_in_single_precision() {
    // A zero on the unit circle, and one just inside: the estimate is pushed out again and again.
    let orders = ArmaxOrders { na: 1, inputs: &[one(1, 1)], nc: 2, constant: false };
    for method in METHODS {
        let mut armax: RecursiveArmax<f32, Const<4>> =
            RecursiveArmax::new(&orders, method, 2.0, &[1.0], 0.5, Forgetting::Exponential { factor: 0.95 })
                .unwrap();
        let (mut noise, mut y, mut u, mut e, mut projected) = (Noise(4), 0.0, 0.0, [0.0; 2], 0);
        for k in 0..50_000 {
            let now = noise.next();
            y = 0.9 * y + u + now - 0.05 * e[0] - 0.95 * e[1];
            (u, e) = (if k % 11 < 5 { 1.0 } else { -1.0 }, [now, e[0]]);
            // Sometimes an outlier, sometimes silence.
            let output = if k % 997 == 0 { 1e4 } else { y };
            projected +=
                usize::from(armax.log_row(output as f32, &[u as f32]).unwrap().action == Action::Projected);
            let mut c: Vec<f32> = armax.c().skip(1).collect();
            assert!(is_stable(&mut c), "{k}");
            assert!(armax.residual.is_finite() && armax.gradients.iter().all(|entry| entry.is_finite()));
            assert!(armax.estimator().parameters().iter().all(|parameter| parameter.is_finite()));
        }
        assert!(projected > 10, "{method:?} {projected}");
    }
}

#[test]
fn missing_samples_and_gaps_are_survived() {
    let orders = ArmaxOrders { na: 2, inputs: &[one(1, 1)], nc: 1, constant: false };
    let plant = Plant { a: vec![-1.5, 0.7], b: vec![(vec![1.0], 1)], c: vec![0.6] };
    let (inputs, outputs) = plant.record(20_000, 0.5, &mut Noise(5));
    for method in METHODS {
        let forgetting = Forgetting::Exponential { factor: 0.999 };
        let mut armax: RecursiveArmax<f64, Const<4>> =
            RecursiveArmax::new(&orders, method, 3.0, &[1.0], 0.3, forgetting).unwrap();
        for (k, &y) in outputs.iter().enumerate() {
            let output = if k % 50 == 20 { f64::NAN } else { y };
            if k % 1000 == 500 {
                armax.gap();
            }
            let action = armax.log_row(output, &inputs_at(&inputs, k)).unwrap().action;
            let since_gap = (k + 500) % 1000;
            let expected = match k % 50 {
                _ if k < 2 || k >= 500 && since_gap < 2 => Action::NotReady,
                20 => Action::Missing,
                21 | 22 => Action::NotReady,
                _ => action,
            };
            assert_eq!(action, expected, "{k}");
            assert!(
                expected != action
                    || matches!(action, Action::NotReady | Action::Missing)
                    || armax.residual != 0.0
            );
        }
        let away = armax.estimator().parameters() - Vector4::new(-1.5, 0.7, 1.0, 0.6);
        // One sample in ten follows a hole and has a poor residual.
        assert!(away.amax() < 0.08, "{method:?} {away}");
    }
}

#[test]
fn a_refused_sample_changes_nothing() {
    let orders = ArmaxOrders { na: 1, inputs: &[one(1, 1), one(1, 0)], nc: 1, constant: false };
    for method in METHODS {
        let mut armax: RecursiveArmax<f32, Const<4>> =
            RecursiveArmax::new(&orders, method, 1.0, &[1.0, 1.0], 0.5, Forgetting::default()).unwrap();
        let mut noise = Noise(6);
        for _ in 0..100 {
            let before = debug(&armax);
            let length = |argument, expected, found| Err(Error::Length { argument, expected, found });
            assert_eq!(armax.log_row(1.0, &[1.0]).map(|_| ()), length("inputs", 2, 1));
            assert_eq!(
                armax.log_row(1.0, &[1.0, f32::INFINITY]),
                Err(Error::Infinite { argument: "inputs" })
            );
            assert_eq!(
                armax.log_row(f32::INFINITY, &[1.0, 1.0]),
                Err(Error::Infinite { argument: "output" })
            );
            assert_eq!(armax.log_row(1.0, &[1.0, 1e14]), Err(Error::TooLarge { argument: "inputs" }));
            assert_eq!(armax.log_row(1.0, &[1e20, 1.0]), Err(Error::TooLarge { argument: "inputs" }));
            assert_eq!(armax.log_row(-1e14, &[1.0, 1.0]), Err(Error::TooLarge { argument: "output" }));
            assert_eq!(armax.predict(&[0.0; 3], &mut [0.0; 2]), length("future_inputs", 4, 3));
            assert_eq!(debug(&armax), before);
            let mut sample = || noise.next() as f32;
            armax.log_row(sample(), &[sample(), sample()]).unwrap();
        }
    }
}

#[test]
fn no_sample_that_is_accepted_holds_time() {
    let orders = ArmaxOrders { na: 1, inputs: &[one(2, 1)], nc: 2, constant: false };
    for method in METHODS {
        for scale in [1.0, 1e-9_f32] {
            for (large_inputs, large_outputs) in [(3e13, 0.0), (0.0, 3e13), (3e13, -3e13)] {
                let mut armax: RecursiveArmax<f32, Const<5>> =
                    RecursiveArmax::new(&orders, method, 1.0, &[scale], 0.5, Forgetting::default()).unwrap();
                let mut noise = Noise(9);
                for k in 0..200 {
                    let burst = k % 40 > 35;
                    let (u, y) = (scale * noise.next() as f32, noise.next() as f32);
                    let (u, y) = if burst { (u + large_inputs, y + large_outputs) } else { (u, y) };
                    // Always accepted, so that time never stands still.
                    armax.log_row(y, &[u]).unwrap();
                    let finite = |entries: &[f32]| entries.iter().all(|entry| entry.is_finite());
                    assert!(finite(armax.estimator().parameters().as_slice()));
                    assert!(finite(armax.gradients.as_slice()) && finite(&[armax.residual]));
                    assert!(!is_large(armax.residual, 5));
                }
            }
        }
    }
    let mut armax: RecursiveArmax<f32, Const<5>> =
        RecursiveArmax::new(&orders, METHODS[0], 1.0, &[1.0], 0.5, Forgetting::default()).unwrap();
    for k in 0..20 {
        armax.log_row((k % 5) as f32, &[(k % 3) as f32]).unwrap();
    }
    let mut armax = armax.with_parameters([0.0, 1e8, 0.0, 0.0, 0.0].into()).unwrap();
    let actions = [3e13, 1.0, 1.0, 1.0].map(|u| armax.log_row(0.5, &[u]).unwrap().action);
    assert_eq!(actions[1], Action::NotReady);

    // An innovation that is accepted, but a residual that is too large for a tap.
    let mut armax = armax.with_parameters([0.0, 1.0, 0.0, 0.0, 0.0].into()).unwrap();
    armax.set_adaptation(false);
    armax.log_row(0.5, &[-3e13]).unwrap();
    let innovation = armax.log_row(3e13, &[1.0]).unwrap();
    assert_eq!((innovation.action, innovation.error), (Action::Frozen, 6e13));
    assert_eq!(armax.residual, 0.0);
}

#[test]
fn options_are_checked_and_reach_the_estimator() {
    let orders = ArmaxOrders { na: 1, inputs: &[one(1, 1)], nc: 2, constant: false };
    let new = || {
        let method = ArmaxMethod::PredictionError;
        RecursiveArmax::<f64, Const<4>>::new(&orders, method, 1.0, &[2.0], 0.5, FORGETTING)
    };
    let variances = new().unwrap().estimator().covariance().variances();
    assert_eq!(variances, Vector4::new(100.0, 25.0, 400.0, 400.0));
    let stable = new().unwrap().with_parameters(Vector4::new(3.0, 1.0, 0.1, 0.9)).unwrap();
    assert_eq!(stable.c().collect::<Vec<_>>(), [1.0, 0.1, 0.9]);
    let range = "such that C(q) is stable";
    let unstable = new().unwrap().with_parameters(Vector4::new(0.0, 1.0, 0.1, 1.1)).map(|_| ());
    assert_eq!(unstable, Err(Error::OutOfRange { argument: "parameters", range }));
    let covariance = Covariance::from_diagonal(&Vector4::repeat(2.0)).unwrap();
    let armax = new().unwrap().with_covariance(covariance.clone()).unwrap();
    assert_eq!(armax.estimator().covariance(), &covariance);
    assert!(new().unwrap().with_dead_zone(f64::NAN).is_err());

    let wrong =
        RecursiveArmax::<f64, Const<3>>::new(&orders, METHODS[0], 1.0, &[1.0], 1.0, FORGETTING).map(|_| ());
    assert_eq!(wrong, Err(Error::Orders { needed: 4, available: 3 }));
    let wrong =
        RecursiveArmax::<f64, Const<4>>::new(&orders, METHODS[0], 1.0, &[], 1.0, FORGETTING).map(|_| ());
    assert_eq!(wrong, Err(Error::Length { argument: "input_scales", expected: 1, found: 0 }));
    let wrong =
        RecursiveArmax::<f64, Const<4>>::new(&orders, METHODS[0], 1.0, &[1.0], 0.0, FORGETTING).map(|_| ());
    assert!(matches!(wrong, Err(Error::OutOfRange { argument: "scales", .. })));
}

#[test]
fn limits_leave_c_stable() {
    // C near the stability boundary, and limits that pull at what correlates with it.
    let orders = ArmaxOrders { na: 1, inputs: &[one(1, 1)], nc: 2, constant: false };
    let limits = [-0.5..=0.0, 1.2..=f64::INFINITY];
    for method in METHODS {
        let forgetting = Forgetting::Exponential { factor: 0.95 };
        let mut armax: RecursiveArmax<f64, Const<4>> =
            RecursiveArmax::new(&orders, method, 2.0, &[1.0], 0.5, forgetting).unwrap();
        let (mut noise, mut y, mut u, mut e, mut moved) = (Noise(14), 0.0, 0.0, [0.0; 2], 0);
        for k in 0..5000 {
            let now = noise.next();
            y = 0.9 * y + u + now - 0.05 * e[0] - 0.95 * e[1];
            e = [now, e[0]];
            armax.measured(y).unwrap();
            moved += usize::from(armax.keep_within(&limits).unwrap());
            u = if k % 11 < 5 { 1.0 } else { -1.0 };
            armax.applied(&[u]).unwrap();
            let parameters = armax.estimator().parameters();
            assert!(limits.iter().zip(parameters.iter()).all(|(limit, theta)| limit.contains(theta)));
            assert!(is_stable(&mut armax.c().skip(1).collect::<Vec<_>>()), "{k}");
        }
        assert!(moved > 2000, "{moved}");
        let all = [limits[0].clone(), limits[1].clone(), -1.0..=1.0, -1.0..=1.0];
        let length = Error::Length { argument: "limits", expected: 2, found: 4 };
        assert_eq!(armax.keep_within(&all).unwrap_err(), length);
    }
    assert!(RecursiveArmax::<f32, Const<4>>::fits(&orders));
    assert!(!RecursiveArmax::<f32, Const<3>>::fits(&orders));
}

#[cfg(feature = "alloc")]
#[test]
fn run_time_sizes_give_the_same_bits() {
    use nalgebra::Dyn;

    let orders = ArmaxOrders { na: 2, inputs: &[one(1, 1), one(1, 2)], nc: 2, constant: false };
    for method in METHODS {
        let mut fixed: RecursiveArmax<f64, Const<6>, Const<3>> =
            RecursiveArmax::new(&orders, method, 1.0, &[1.0, 1.0], 1.0, FORGETTING).unwrap();
        let mut free: RecursiveArmax<f64, Dyn, Dyn> =
            RecursiveArmax::new(&orders, method, 1.0, &[1.0, 1.0], 1.0, FORGETTING).unwrap();
        let mut noise = Noise(7);
        for _ in 0..300 {
            let mut sample = || if noise.next() < -0.98 { f64::NAN } else { noise.next() };
            let (u, y) = ([sample(), sample()], sample());
            assert_eq!(debug(&fixed.log_row(y, &u)), debug(&free.log_row(y, &u)));
        }
        assert_eq!(fixed.estimator().parameters().as_slice(), free.estimator().parameters().as_slice());
        let (mut ahead, mut other) = ([0.0; 5], [0.0; 5]);
        fixed.predict(&[0.5; 10], &mut ahead).unwrap();
        free.predict(&[0.5; 10], &mut other).unwrap();
        assert_eq!(debug(&ahead), debug(&other));
    }
}

#[test]
fn a_clone_goes_on_as_the_original() {
    let orders = ArmaxOrders { na: 2, inputs: &[one(1, 1)], nc: 1, constant: false };
    for method in METHODS {
        let mut original: RecursiveArmax<f32, Const<4>> =
            RecursiveArmax::new(&orders, method, 1.0, &[1.0], 1.0, Forgetting::default()).unwrap();
        let mut noise = Noise(8);
        let mut sample = || noise.next() as f32;
        for _ in 0..100 {
            original.log_row(sample(), &[sample()]).unwrap();
        }
        let mut copy = original.clone();
        for _ in 0..100 {
            let (u, y) = ([sample()], sample());
            assert_eq!(debug(&original.log_row(y, &u)), debug(&copy.log_row(y, &u)));
        }
        assert_eq!(debug(&original), debug(&copy));
    }
}
