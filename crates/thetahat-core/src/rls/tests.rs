extern crate std;

mod endurance;
mod interface;
mod limits;

use std::format;
use std::string::String;
use std::vec::Vec;

use nalgebra::{Const, Matrix2, SMatrix, SVector, Vector1, Vector2, Vector3, Vector4};

use crate::noise::Noise;
use crate::{
    Action, Covariance, Dimension, Error, Forgetting, KalmanFilter, LeastSquares, LinearObservation,
    LinearTransition, Real, RecursiveLeastSquares, RlsStart, ud,
};

type Estimator<T, const K: usize> = RecursiveLeastSquares<T, Const<K>>;

const POLICIES: [Forgetting<f64>; 5] = [
    Forgetting::None,
    Forgetting::Exponential { factor: 0.97 },
    Forgetting::Selective { factor: 0.97 },
    Forgetting::RandomWalk { variance: 0.01 },
    Forgetting::Variable { factor: 0.97, minimum: 0.9, noise_variance: 0.01 },
];

/// The same policy with its numbers in `T`.
fn convert<T: Real>(policy: Forgetting<f64>) -> Forgetting<T> {
    let number = nalgebra::convert::<f64, T>;
    match policy {
        Forgetting::None => Forgetting::None,
        Forgetting::Exponential { factor } => Forgetting::Exponential { factor: number(factor) },
        Forgetting::Selective { factor } => Forgetting::Selective { factor: number(factor) },
        Forgetting::RandomWalk { variance } => Forgetting::RandomWalk { variance: number(variance) },
        Forgetting::Variable { factor, minimum, noise_variance } => Forgetting::Variable {
            factor: number(factor),
            minimum: number(minimum),
            noise_variance: number(noise_variance),
        },
    }
}

fn estimator<T: Real, const K: usize>(forgetting: Forgetting<T>) -> Estimator<T, K> {
    RecursiveLeastSquares::new(&SVector::repeat(T::one()), forgetting).unwrap()
}

fn random<const K: usize>(noise: &mut Noise) -> SVector<f64, K> {
    SVector::from_fn(|_, _| noise.next())
}

/// Samples of y = φ'θ + e.
fn samples<const K: usize>(
    seed: u64,
    theta: &SVector<f64, K>,
    noise_size: f64,
    count: usize,
) -> Vec<(SVector<f64, K>, f64)> {
    let mut noise = Noise(seed);
    let sample = |_| {
        let phi: SVector<f64, K> = random(&mut noise);
        (phi, phi.dot(theta) + noise_size * noise.next())
    };
    (0..count).map(sample).collect()
}

/// Weighted least squares over samples and a prior, by the batch solver: θ̂ and (Φ'WΦ)⁻¹.
fn batch<const K: usize>(
    samples: &[(SVector<f64, K>, f64)],
    weight: impl Fn(usize) -> f64,
    prior: Option<(&SVector<f64, K>, f64)>,
) -> (SVector<f64, K>, SMatrix<f64, K, K>) {
    let mut problem = LeastSquares::<f64, Const<K>>::new();
    for (index, &(phi, y)) in samples.iter().enumerate() {
        let root = weight(index).sqrt();
        problem.add(&(phi * root), y * root).unwrap();
    }
    if let Some((variances, weight)) = prior {
        for index in 0..K {
            let mut row = SVector::zeros();
            row[index] = (weight / variances[index]).sqrt();
            problem.add(&row, 0.0).unwrap();
        }
    }
    let factor = problem.factor();
    (*problem.solve().unwrap().parameters(), factor.tr_mul(&factor).try_inverse().unwrap())
}

fn close<const R: usize, const C: usize>(
    a: &SMatrix<f64, R, C>,
    b: &SMatrix<f64, R, C>,
    tolerance: f64,
) -> bool {
    (a - b).amax() <= tolerance * (1.0 + b.amax())
}

fn debug<T: std::fmt::Debug>(value: &T) -> String {
    format!("{value:?}")
}

#[test]
fn without_forgetting_it_is_least_squares_with_the_prior() {
    for seed in 0..10 {
        let mut noise = Noise(seed);
        let scales = SVector::<f64, 5>::new(1.0, 10.0, 0.1, 1.0, 3.0);
        let theta: SVector<f64, 5> = random(&mut noise);
        let data = samples(seed, &theta, 0.3, 40);
        let mut estimator = RecursiveLeastSquares::new(&scales, Forgetting::None).unwrap();
        for (index, (phi, y)) in data.iter().enumerate() {
            assert_eq!(estimator.update(phi, *y).unwrap().action, Action::Updated);
            let prior = scales.map(|scale| 100.0 / (scale * scale));
            let (expected, covariance) = batch(&data[..=index], |_| 1.0, Some((&prior, 1.0)));
            assert!(close(estimator.parameters(), &expected, 1e-10));
            assert!(close(&estimator.covariance().matrix(), &covariance, 1e-10));
        }
    }
}

#[test]
fn with_forgetting_it_is_weighted_least_squares() {
    let factor = 0.9_f64;
    let theta = Vector4::new(1.0, -2.0, 0.5, 3.0);
    let data = samples(1, &theta, 0.3, 60);
    let prior = SVector::repeat(2.0);
    // A prior well below the bound, so that nothing is held in between.
    let mut estimator = estimator(Forgetting::Exponential { factor })
        .with_covariance(Covariance::from_diagonal(&prior).unwrap())
        .unwrap();
    for (index, (phi, y)) in data.iter().enumerate() {
        assert_eq!(estimator.update(phi, *y).unwrap().action, Action::Updated);
        let age = |k: usize| factor.powi((index - k) as i32);
        let (expected, covariance) = batch(&data[..=index], age, Some((&prior, factor * age(0))));
        assert!(close(estimator.parameters(), &expected, 1e-11));
        assert!(close(&estimator.covariance().matrix(), &covariance, 1e-11));
    }
}

#[test]
fn it_is_a_kalman_filter_of_a_state_that_stays_or_walks() {
    const K: usize = 3;
    let none = SVector::<f64, 0>::zeros();
    for variance in [0.0, 0.02] {
        let policy = if variance > 0.0 { Forgetting::RandomWalk { variance } } else { Forgetting::None };
        let mut estimator = estimator::<f64, K>(policy);
        let prior = Covariance::from_diagonal(&SVector::repeat(100.0)).unwrap();
        let mut filter = KalmanFilter::<f64, Const<K>>::new(SVector::zeros(), prior).unwrap();
        for (k, (phi, y)) in samples(2, &Vector3::new(1.0, 2.0, -3.0), 0.1, 300).into_iter().enumerate() {
            let innovation = estimator.update(&phi, y).unwrap();
            let unit = Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(1.0)).unwrap();
            let observation = LinearObservation::new(phi.transpose(), unit).unwrap();
            let expected = filter.correct(&observation, &none, &Vector1::new(y)).unwrap();
            assert!((innovation.error - expected.error[0]).abs() < 1e-12);
            if innovation.variance.is_finite() {
                let ratio = innovation.error * innovation.error / innovation.variance;
                assert!((ratio - innovation.nis).abs() <= 1e-12 * ratio);
            }
            // In turn, each parameter gets the growth of all K samples.
            let mut growth = SVector::<f64, K>::zeros();
            growth[k % K] = K as f64 * variance;
            if filter.covariance().variances()[k % K] + growth[k % K] > 100.0 {
                // The cap acts here; the filter has none.
                assert_eq!(innovation.action, Action::Capped);
                continue;
            }
            let noise = Covariance::from_diagonal(&growth).unwrap();
            let transition = LinearTransition::new(SMatrix::identity(), noise).unwrap();
            filter.predict(&transition, &none).unwrap();
            assert!(close(estimator.parameters(), filter.state(), 1e-10), "{k}");
            assert!(close(&estimator.covariance().matrix(), &filter.covariance().matrix(), 1e-10));
        }
    }
}

#[test]
fn selective_forgetting_is_its_definition_on_the_information() {
    const K: usize = 3;
    let (lambda, mut noise) = (0.95, Noise(3));
    let mut estimator = estimator::<f64, K>(Forgetting::Selective { factor: lambda });
    let (mut information, mut theta) = (SMatrix::<f64, K, K>::identity() / 100.0, SVector::<f64, K>::zeros());
    let mut forgotten = [0; K];
    for k in 0..300 {
        // Correlated regressors; for some time the last of them says little that is new.
        let mut phi: SVector<f64, K> = random(&mut noise);
        phi[1] += phi[0];
        phi[2] = phi[1] + phi[2] * if (100..200).contains(&k) { 0.01 } else { 1.0 };
        let y = phi.sum() + 0.1 * noise.next();
        estimator.update(&phi, y).unwrap();
        // P⁻¹ = L Δ L', and f = L⁻¹φ are the regressors without what those before them tell.
        let (mut lower, mut rest, mut f) = (SMatrix::<f64, K, K>::identity(), information, phi);
        let mut kept = SMatrix::<f64, K, K>::zeros();
        for j in 0..K {
            kept[(j, j)] = rest[(j, j)];
            let column = rest.column(j) / rest[(j, j)];
            rest -= column * column.transpose() * kept[(j, j)];
            lower.set_column(j, &column);
            for i in j + 1..K {
                f[i] -= column[i] * f[j];
            }
            if f[j] * f[j] > (1.0 - lambda) / 100.0 * kept[(j, j)] {
                kept[(j, j)] *= lambda;
                forgotten[j] += 1;
            }
        }
        information = lower * kept * lower.transpose() + phi * phi.transpose();
        theta += information.try_inverse().unwrap() * phi * (y - phi.dot(&theta));
        assert!(close(estimator.parameters(), &theta, 1e-10));
        assert!(close(&estimator.covariance().matrix(), &information.try_inverse().unwrap(), 1e-10));
    }
    assert!(forgotten[0] > 250 && forgotten[2] < 250, "{forgotten:?}");
}

#[test]
fn selective_forgetting_keeps_what_is_not_excited() {
    let mut estimator = estimator::<f64, 2>(Forgetting::Selective { factor: 0.98 });
    let mut noise = Noise(4);
    for _ in 0..500 {
        let phi = random(&mut noise);
        estimator.update(&phi, phi.sum() + 0.01 * noise.next()).unwrap();
    }
    let before = estimator.covariance().variances()[1];
    let known = estimator.parameters()[1];
    // The second regressor is silent, and the first parameter changes.
    for _ in 0..100_000 {
        let u = noise.next();
        estimator.update(&Vector2::new(u, 0.0), 3.0 * u + 0.01 * noise.next()).unwrap();
    }
    assert!((estimator.parameters()[0] - 3.0).abs() < 0.01);
    assert!((estimator.parameters()[1] - known).abs() < 0.1);
    assert!(estimator.covariance().variances()[1] <= 1.5 * before);
}

#[test]
fn selective_forgetting_does_not_depend_on_units() {
    // Powers of 2: the same to the bit.
    let scales = Vector3::new(1.0, 64.0, 1.0 / 1024.0);
    let policy = Forgetting::Selective { factor: 0.98 };
    let mut plain = estimator::<f64, 3>(policy);
    let mut scaled = RecursiveLeastSquares::new(&scales, policy).unwrap();
    let mut noise = Noise(23);
    for k in 0..500 {
        let mut phi: SVector<f64, 3> = random(&mut noise);
        phi[1] += phi[0];
        if (200..400).contains(&k) {
            phi *= 1e-3;
        }
        let y = phi.sum() + noise.next();
        plain.update(&phi, y).unwrap();
        scaled.update(&phi.component_mul(&scales), 8.0 * y).unwrap();
        assert_eq!(*plain.parameters() * 8.0, scaled.parameters().component_mul(&scales));
    }
}

#[test]
fn one_factor_is_one_memory() {
    // The mean variance of the parameters in the steady state is that of exponential forgetting.
    let factor = 0.98;
    let variance = |policy| {
        let mut estimator = estimator::<f64, 4>(policy);
        let (mut noise, mut sum) = (Noise(5), 0.0);
        for k in 0..6000 {
            let phi: SVector<f64, 4> = random(&mut noise);
            estimator.update(&phi, phi.sum() + 0.1 * noise.next()).unwrap();
            if k >= 1000 {
                sum += (estimator.parameters() - SVector::repeat(1.0)).norm_squared() / 5000.0;
            }
        }
        sum
    };
    let exponential = variance(Forgetting::Exponential { factor });
    let selective = variance(Forgetting::Selective { factor });
    let noise_variance = 0.01 / 3.0;
    let variable = variance(Forgetting::Variable { factor, minimum: 0.9, noise_variance });
    // Measured: 1.02 and 0.96.
    assert!((selective / exponential - 1.0).abs() < 0.1, "{}", selective / exponential);
    assert!((variable / exponential - 1.0).abs() < 0.1, "{}", variable / exponential);
}

#[test]
fn variable_forgetting_is_its_formula() {
    // One parameter: everything by hand.
    let (factor, minimum, noise_variance) = (0.95, 0.6, 0.01);
    let mut estimator = estimator::<f64, 1>(Forgetting::Variable { factor, minimum, noise_variance });
    let (mut p, mut theta, mut noise) = (100.0_f64, 0.0, Noise(6));
    for k in 0..200 {
        let (phi, truth) = (1.0 + 0.5 * noise.next(), if k < 100 { 1.0 } else { 5.0 });
        let y = phi * truth + 0.1 * noise.next();
        estimator.update(&Vector1::new(phi), y).unwrap();
        let error = y - phi * theta;
        let lambda =
            (1.0 - (1.0 - factor) * error * error / (noise_variance * (1.0 + phi * p * phi))).max(minimum);
        let total = lambda + phi * p * phi;
        theta += p * phi * error / total;
        p = (p * lambda / total / lambda).min(100.0);
        assert!((estimator.parameters()[0] - theta).abs() < 1e-12);
        assert!((estimator.covariance().matrix()[0] - p).abs() < 1e-12 * p);
    }
    assert!((theta - 5.0).abs() < 0.1);
}

#[test]
fn the_exact_start_is_the_batch_solution() {
    let theta = Vector4::new(1.0, -2.0, 50.0, 3.0);
    let mut compared = 0;
    for seed in 0..10 {
        let data = samples(seed, &theta, 0.3, 30);
        let mut estimator = estimator(Forgetting::None).with_start(RlsStart::Exact).unwrap();
        let mut collected = 0;
        for (index, (phi, y)) in data.iter().enumerate() {
            if estimator.update(phi, *y).unwrap().action == Action::Collecting {
                collected += 1;
                continue;
            }
            let (expected, covariance) = batch(&data[..=index], |_| 1.0, None);
            assert!(close(estimator.parameters(), &expected, 1e-10));
            assert!(close(&estimator.covariance().matrix(), &covariance, 1e-10));
            // So are the residuals.
            if let Some(noise) = estimator.noise_variance() {
                let squares: f64 =
                    data[..=index].iter().map(|(phi, y)| (y - phi.dot(&expected)).powi(2)).sum();
                assert!((noise - squares / (index - 3) as f64).abs() < 1e-9);
                compared += 1;
            }
        }
        // Full rank needs four rows.
        assert_eq!(collected, 3);
    }
    assert_eq!(compared, 260);
}

#[test]
fn the_noise_variance_after_an_exact_start_is_that_of_the_batch() {
    let theta = Vector3::new(1.0, -2.0, 5.0);
    let mut compared = 0;
    for seed in 0..40 {
        // Many a sample tells more of the parameters than of the noise. None may be left out.
        let data = samples(seed, &theta, 0.3, 12);
        for start in [RlsStart::Exact, RlsStart::Mixed { blend: 0 }] {
            let mut estimator = estimator(Forgetting::None).with_start(start).unwrap();
            let mut problem = LeastSquares::<f64, Const<3>>::new();
            for (phi, y) in &data {
                let (phi, y) = (phi * 30.0, *y * 30.0);
                estimator.update(&phi, y).unwrap();
                problem.add(&phi, y).unwrap();
                if estimator.phase != super::Phase::Free {
                    continue;
                }
                if let Some(noise) = estimator.noise_variance() {
                    let expected = problem.solve().unwrap().residual_variance().unwrap();
                    assert!((noise - expected).abs() < 1e-9 * expected.max(1.0), "{noise} {expected}");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 400, "{compared}");

    // Once a variance is at its bound, that is a prior again.
    let policy = Forgetting::Exponential { factor: 0.8 };
    let mut estimator = estimator::<f64, 1>(policy).with_start(RlsStart::Exact).unwrap();
    estimator.update(&Vector1::new(1.0), 2.0).unwrap();
    assert_eq!(estimator.phase, super::Phase::Free);
    while estimator.update(&Vector1::new(0.0), 0.0).unwrap().action != Action::Capped {}
    assert_eq!(estimator.phase, super::Phase::Running);
    // The parameter has changed meanwhile: that is no noise.
    estimator.update(&Vector1::new(1.0), 100.0).unwrap();
    assert!(estimator.noise_variance().unwrap() < 1e-6);
}

#[test]
fn the_exact_start_is_accurate_in_single_precision() {
    // Scales over eight decades; the prior of the standard start pulls at the estimate.
    let scales = SVector::<f32, 4>::new(1e-4, 1.0, 1e4, 10.0);
    let error = |start| {
        let mut estimator =
            RecursiveLeastSquares::new(&scales, Forgetting::None).unwrap().with_start(start).unwrap();
        let mut noise = Noise(7);
        for _ in 0..12 {
            let phi = scales.map(|scale| scale * noise.next() as f32);
            let y = phi.component_div(&scales).sum();
            estimator.update(&phi, y).unwrap();
        }
        (estimator.parameters().component_mul(&scales) - SVector::repeat(1.0)).amax()
    };
    let (standard, exact) = (error(RlsStart::Standard), error(RlsStart::Exact));
    // Measured: 6e-3 and 6e-8.
    assert!(standard > 1e-3, "{standard}");
    assert!(exact < 1e-5, "{exact}");
}

#[test]
fn the_exact_start_does_not_wait_for_regressors_that_are_nearly_dependent() {
    let theta = Vector3::new(1.0, -2.0, 5.0);
    for kappa in [10.0, 100.0_f64] {
        let data: Vec<_> = samples(24, &theta, 0.1, 200)
            .into_iter()
            .map(|(d, noise)| {
                let phi = Vector3::new(d[0], d[0] + d[1] / kappa, d[0] + d[2] / kappa);
                (phi, phi.dot(&theta) + noise - d.dot(&theta))
            })
            .collect();
        let mut exact = estimator::<f64, 3>(Forgetting::None).with_start(RlsStart::Exact).unwrap();
        // The cap must not hold a first estimate that is poor.
        let mut forgetting = estimator::<f64, 3>(POLICIES[1]).with_start(RlsStart::Exact).unwrap();
        for (k, (phi, y)) in data.iter().enumerate() {
            let action = exact.update(phi, *y).unwrap().action;
            assert_eq!(action, if k < 2 { Action::Collecting } else { Action::Updated });
            if k >= 2 {
                let (expected, _) = batch(&data[..=k], |_| 1.0, None);
                assert!(close(exact.parameters(), &expected, 1e-8), "{kappa} {k}");
            }
            let collecting = forgetting.update(phi, *y).unwrap().action == Action::Collecting;
            assert!(collecting || forgetting.excitation() > 0.0);
        }
    }
    // A warm start has nothing of it.
    let start = estimator::<f64, 3>(Forgetting::None).with_start(RlsStart::Exact).unwrap();
    let warm = start.with_parameters(theta).unwrap();
    assert_eq!(warm.covariance().variances(), Vector3::repeat(100.0));
}

#[test]
fn the_mixed_start_is_standard_then_exact() {
    let theta = Vector4::new(1.0, -2.0, 50.0, 3.0);
    let data = samples(8, &theta, 0.3, 40);
    let start = |start| estimator(Forgetting::None).with_start(start).unwrap();
    let (mut standard, mut exact) = (start(RlsStart::Standard), start(RlsStart::Exact));
    let (mut mixed, mut blended) =
        (start(RlsStart::Mixed { blend: 0 }), start(RlsStart::Mixed { blend: 10 }));
    let mut moment = None;
    for (k, (phi, y)) in data.iter().enumerate() {
        standard.update(phi, *y).unwrap();
        exact.update(phi, *y).unwrap();
        assert_eq!(mixed.update(phi, *y).unwrap().action, Action::Updated);
        let collecting = mixed.phase == super::Phase::Waiting;
        assert_eq!(blended.update(phi, *y).unwrap().action, Action::Updated);
        if !collecting && moment.is_none() {
            moment = Some(k);
        }
        if collecting {
            assert_eq!(mixed.parameters(), standard.parameters());
        } else {
            assert!(close(mixed.parameters(), exact.parameters(), 1e-11));
        }
        match k - moment.unwrap_or(k) {
            _ if moment.is_none() => assert_eq!(blended.parameters(), standard.parameters()),
            age @ 0..9 => {
                // A share of (age + 1) / 10 of the prior is out.
                let left = 1.0 - (age + 1) as f64 / 10.0;
                let (expected, _) = batch(&data[..=k], |_| 1.0, Some((&SVector::repeat(100.0), left)));
                assert!(close(blended.parameters(), &expected, 1e-10));
            }
            _ => assert!(close(blended.parameters(), exact.parameters(), 1e-10)),
        }
    }
    assert!(moment.is_some_and(|moment| moment < 10));
}

#[test]
fn nothing_is_forgotten_before_the_start_is_over() {
    // A silent start of any length, then a few samples: the batch solution, to rounding.
    let theta = Vector2::new(3.0, -1.0);
    for policy in POLICIES {
        let mut estimator = estimator::<f64, 2>(policy).with_start(RlsStart::Exact).unwrap();
        for _ in 0..10_000 {
            assert_eq!(estimator.update(&Vector2::new(1.0, 1.0), 2.0).unwrap().action, Action::Collecting);
        }
        let (phi, y) = (Vector2::new(1.0, -1.0), 4.0);
        assert_eq!(estimator.update(&phi, y).unwrap().action, Action::Updated);
        assert!(close(estimator.parameters(), &theta, 1e-9), "{policy:?}");
    }
}

#[test]
fn it_goes_on_from_a_batch_solution() {
    let theta = Vector3::new(1.0, -2.0, 0.5);
    let data = samples(9, &theta, 0.3, 80);
    let mut problem = LeastSquares::<f64, Const<3>>::new();
    for (phi, y) in &data[..50] {
        problem.add(phi, *y).unwrap();
    }
    let solution = problem.solve().unwrap();
    let mut estimator = estimator(Forgetting::None).with_solution(&solution).unwrap();
    assert!(
        (estimator.noise_variance().unwrap() / solution.residual_variance().unwrap() - 1.0).abs() < 1e-12
    );
    let covariance = estimator.parameter_covariance().unwrap().matrix();
    assert!(close(&covariance, &solution.covariance().unwrap(), 1e-13));
    for (phi, y) in &data[50..] {
        estimator.update(phi, *y).unwrap();
        problem.add(phi, *y).unwrap();
    }
    let solution = problem.solve().unwrap();
    assert!(close(estimator.parameters(), solution.parameters(), 1e-13));
    assert!(
        (estimator.noise_variance().unwrap() / solution.residual_variance().unwrap() - 1.0).abs() < 1e-12
    );
}

#[test]
fn a_parameter_of_variance_0_is_held() {
    for policy in POLICIES {
        let covariance = Covariance::from_diagonal(&Vector3::new(100.0, 0.0, 100.0)).unwrap();
        let mut estimator = estimator::<f64, 3>(policy)
            .with_parameters(Vector3::new(0.0, 7.0, 0.0))
            .unwrap()
            .with_covariance(covariance)
            .unwrap();
        for (phi, y) in samples(15, &Vector3::new(1.0, 7.0, 2.0), 0.01, 300) {
            estimator.update(&phi, y).unwrap();
        }
        assert_eq!(estimator.parameters()[1], 7.0);
        assert_eq!(estimator.covariance().variances()[1], 0.0);
        assert!(close(estimator.parameters(), &Vector3::new(1.0, 7.0, 2.0), 2e-2), "{policy:?}");
    }
}

#[test]
fn beside_a_held_parameter_the_others_are_forgotten_as_alone() {
    // In every place of the order.
    for held in 0..3 {
        for policy in POLICIES {
            // A turn of the random walk is one of n.
            if let Forgetting::RandomWalk { .. } = policy {
                continue;
            }
            let mut variances = Vector3::repeat(1.0);
            variances[held] = 0.0;
            let mut parameters = Vector3::zeros();
            parameters[held] = 7.0;
            let mut three = estimator::<f64, 3>(policy)
                .with_parameters(parameters)
                .unwrap()
                .with_covariance(Covariance::from_diagonal(&variances).unwrap())
                .unwrap();
            let mut two = estimator::<f64, 2>(policy)
                .with_covariance(Covariance::from_diagonal(&Vector2::repeat(1.0)).unwrap())
                .unwrap();
            for (phi, y) in samples(22, &Vector3::new(1.0, 2.0, 3.0), 0.1, 300) {
                let free = phi.remove_row(held);
                three.update(&phi, y + 7.0 * phi[held]).unwrap();
                two.update(&free, y).unwrap();
                assert!(close(&three.parameters().remove_row(held), two.parameters(), 1e-10), "{policy:?}");
                let covariance = three.covariance().matrix().remove_row(held).remove_column(held);
                assert!(close(&covariance, &two.covariance().matrix(), 1e-10), "{policy:?}");
            }
            assert_eq!(three.parameters()[held], 7.0);
        }
    }
}

#[test]
fn residuals_are_forgotten_as_lambda_says() {
    // Without an innovation λ(k) is 1.
    let policy = Forgetting::Variable { factor: 0.9, minimum: 0.8, noise_variance: 1.0 };
    let mut estimator = estimator::<f64, 1>(policy);
    for _ in 0..100 {
        estimator.update(&Vector1::new(1.0), 0.0).unwrap();
    }
    assert_eq!(estimator.residuals.weights, 100.0);
}

/// Everything finite, D positive, and the variances near or below their bounds, if they are kept there.
fn check_sound<T: Real, N: Dimension + Dimension<M>, M: Dimension>(
    estimator: &RecursiveLeastSquares<T, N, M>,
    bounded: bool,
) {
    let factor = estimator.covariance.as_slice();
    let n = estimator.bounds.len();
    assert!(estimator.parameters().iter().all(T::is_finite));
    for (index, &bound) in estimator.bounds.iter().enumerate() {
        let (pivot, variance) = (ud::variance(factor, n, index), ud::diagonal(factor, n, index));
        assert!(pivot > T::zero() && variance.is_finite());
        // (1 + 1/n)^n < e, and rounding.
        assert!(!bounded || variance < nalgebra::convert::<f64, T>(2.8) * bound);
    }
    assert!(ud::is_finite(factor, n));
    assert!(estimator.residuals.mean_squares.iter().all(|mean| *mean >= T::zero() && mean.is_finite()));
}
