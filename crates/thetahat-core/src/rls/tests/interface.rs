//! What goes in and comes out: missing, refused and skipped samples, several outputs, sizes.

use super::*;

#[test]
fn several_outputs_are_several_estimators() {
    for policy in POLICIES {
        let mut together: RecursiveLeastSquares<f64, Const<3>, Const<2>> =
            RecursiveLeastSquares::with_outputs(&SVector::repeat(1.0), Const, policy).unwrap();
        let mut apart = [(); 2].map(|()| estimator::<f64, 3>(policy));
        let mut noise = Noise(10);
        for k in 0..300 {
            let phi: Vector3<f64> = if k < 250 { random(&mut noise) } else { Vector3::zeros() };
            let mut y = Vector2::new(phi.sum(), phi[0] - phi[2]) + random::<2>(&mut noise) * 0.1;
            if k % 7 == 3 {
                // One is missing: all are.
                y[1] = f64::NAN;
            }
            // Variable forgetting takes both into account: no separate run is the same.
            let innovation = together.update_all(&phi, &y).unwrap();
            if matches!(policy, Forgetting::Variable { .. }) {
                continue;
            }
            let missing = y[1].is_nan();
            for (index, apart) in apart.iter_mut().enumerate() {
                let alone = apart.update(&phi, if missing { f64::NAN } else { y[index] }).unwrap();
                assert_eq!(alone.action, innovation.action);
                assert_eq!(apart.parameters(), &together.parameters().column(index));
                assert_eq!(apart.covariance(), together.covariance());
                assert_eq!(
                    apart.noise_variance(),
                    together.noise_variances().map(|variances| variances[index])
                );
                assert_eq!(apart.parameter_covariance(), together.parameter_covariance_of(index));
                assert_eq!(apart.predict(&phi).unwrap(), together.predict_all(&phi).unwrap()[index]);
                if !missing {
                    assert_eq!(alone.error, innovation.error[index]);
                    assert_eq!(debug(&alone.variance), debug(&innovation.variance[index]));
                }
            }
        }
        assert!((together.parameters().column(1) - Vector3::new(1.0, 0.0, -1.0)).amax() < 0.1);
        assert!(together.parameter_covariance_of(2).is_none());
    }
}

#[test]
fn a_missing_sample_corrects_nothing() {
    for policy in POLICIES {
        let mut estimator = estimator::<f64, 2>(policy);
        for (phi, y) in samples(11, &Vector2::new(1.0, 2.0), 0.1, 50) {
            estimator.update(&phi, y).unwrap();
        }
        let before = estimator.clone();
        let gaps = [(Vector2::new(1.0, 1.0), f64::NAN), (Vector2::new(f64::NAN, 1.0), 3.0)];
        for (phi, y) in gaps {
            let innovation = estimator.update(&phi, y).unwrap();
            assert_eq!(innovation.action, Action::Missing);
            assert!(innovation.error.is_nan() && innovation.variance.is_nan());
            assert_eq!((innovation.nis, innovation.log_likelihood()), (0.0, 0.0));
        }
        assert_eq!(estimator.parameters(), before.parameters());
        assert_eq!(estimator.noise_variance(), before.noise_variance());
        if let Forgetting::RandomWalk { variance } = policy {
            // Time went on: in two samples each parameter had its turn.
            let growth = estimator.covariance().matrix() - before.covariance().matrix();
            assert!(close(&growth, &(Matrix2::identity() * 2.0 * variance), 1e-15));
        } else {
            assert_eq!(debug(&estimator), debug(&before));
        }
    }
}

#[test]
fn a_refused_sample_changes_nothing() {
    for policy in POLICIES.map(convert::<f32>) {
        for start in [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 3 }] {
            let mut estimator = estimator::<f32, 2>(policy).with_start(start).unwrap();
            for k in 0..20 {
                let before = debug(&estimator);
                let infinite = |argument| Error::Infinite { argument };
                let large = |argument| Error::TooLarge { argument };
                let cases = [
                    (Vector2::new(f32::INFINITY, 1.0), 1.0, infinite("regressor")),
                    (Vector2::new(1.0, f32::NEG_INFINITY), f32::NAN, infinite("regressor")),
                    (Vector2::new(f32::NAN, 1.0), f32::INFINITY, infinite("output")),
                    (Vector2::new(1.0, 1.0), f32::NEG_INFINITY, infinite("output")),
                    (Vector2::new(1e30, 1.0), 1.0, large("regressor")),
                    (Vector2::new(1.0, 1e16), 1.0, large("regressor")),
                    (Vector2::new(1.0, 1.0), 1e16, large("output")),
                    (Vector2::new(0.0, 0.0), f32::MAX, large("output")),
                ];
                for (phi, y, error) in cases {
                    assert_eq!(estimator.update(&phi, y), Err(error));
                }
                assert_eq!(debug(&estimator), before);
                let phi = Vector2::new(1.0, (k % 3) as f32);
                estimator.update(&phi, phi.sum()).unwrap();
            }
        }
    }
}

#[test]
fn the_largest_samples_that_are_accepted_do_no_harm() {
    let mut noise = Noise(12);
    for policy in POLICIES.map(convert::<f32>) {
        for scale in [1e-9, 1.0, 1e9_f32] {
            let scales = Vector2::new(scale, 1.0 / scale);
            let mut estimator = RecursiveLeastSquares::new(&scales, policy).unwrap();
            let mut accepted = 0;
            for _ in 0..2000 {
                let size = |noise: &mut Noise| 10_f64.powf(14.0 * noise.next()) * noise.next().signum();
                let phi = Vector2::new(size(&mut noise), size(&mut noise)).map(|element| element as f32);
                accepted += usize::from(estimator.update(&phi, size(&mut noise) as f32).is_ok());
                check_sound(&estimator, true);
            }
            assert!(accepted > 500, "{policy:?} {scale} {accepted}");
        }
    }
}

#[test]
fn a_dead_zone_skips_small_innovations() {
    let mut estimator =
        estimator::<f64, 1>(Forgetting::Exponential { factor: 0.9 }).with_dead_zone(0.5).unwrap();
    for _ in 0..100 {
        estimator.update(&Vector1::new(1.0), 10.0).unwrap();
    }
    let before = estimator.clone();
    assert!((before.parameters()[0] - 10.0).abs() < 0.5);
    for k in 0..1000 {
        let innovation =
            estimator.update(&Vector1::new(1.0), 10.0 + if k % 2 == 0 { 0.2 } else { -0.2 }).unwrap();
        assert_eq!(innovation.action, Action::Skipped);
    }
    // Nothing is corrected and nothing forgotten, but the residuals are known.
    assert_eq!(estimator.parameters(), before.parameters());
    assert_eq!(estimator.covariance(), before.covariance());
    assert!((estimator.noise_variance().unwrap() / 0.04 - 1.0).abs() < 0.3);
    assert_eq!(estimator.update(&Vector1::new(1.0), 11.0).unwrap().action, Action::Updated);

    let error = Error::OutOfRange { argument: "width", range: "finite and at least 0" };
    for width in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(estimator.clone().with_dead_zone(width).unwrap_err(), error);
    }
}

#[test]
fn a_frozen_estimator_only_looks() {
    for policy in POLICIES {
        let mut estimator = estimator::<f64, 2>(policy);
        for (phi, y) in samples(13, &Vector2::new(1.0, 2.0), 0.1, 50) {
            estimator.update(&phi, y).unwrap();
        }
        assert!(estimator.is_adapting());
        estimator.set_adaptation(false);
        let before = debug(&estimator);
        let phi = Vector2::new(1.0, -1.0);
        let predicted = estimator.predict(&phi).unwrap();
        for _ in 0..10 {
            let innovation = estimator.update(&phi, 5.0).unwrap();
            assert_eq!(innovation.action, Action::Frozen);
            assert_eq!(innovation.error, 5.0 - predicted);
            // Something has changed in the plant: an alarm.
            assert!(innovation.nis > 100.0);
            assert_eq!(estimator.update(&phi, f64::NAN).unwrap().action, Action::Missing);
        }
        assert_eq!(debug(&estimator), before);
        estimator.set_adaptation(true);
        assert_ne!(estimator.update(&phi, 5.0).unwrap().action, Action::Frozen);
    }
}

#[test]
fn what_does_not_fit_is_not_a_result() {
    let phi = Vector2::new(1.0, 1.0_f32);
    let mut estimator = estimator::<f32, 2>(Forgetting::None);
    for k in 0..10 {
        estimator.update(&Vector2::new(1.0, (k % 3) as f32), if k % 2 == 0 { 1e13 } else { -1e13 }).unwrap();
    }
    assert!(estimator.parameter_covariance().is_some());
    let large = Covariance::from_diagonal(&Vector2::repeat(1e18)).unwrap();
    let unsure = estimator.clone().with_covariance(large).unwrap();
    assert!(unsure.noise_variance().is_some());
    assert!(unsure.parameter_covariance().is_none());

    let not_finite = Err(Error::NotFinite { argument: "regressor" });
    for element in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(estimator.predict(&Vector2::new(1.0, element)), not_finite);
        assert!(estimator.predict_all(&Vector2::new(element, 1.0)).is_err());
    }
    let estimator = estimator.with_parameters(Vector2::repeat(1e15)).unwrap();
    let too_large = estimator.clone().with_parameters(Vector2::repeat(1e30)).map(|_| ());
    assert_eq!(too_large, Err(Error::TooLarge { argument: "parameters" }));
    assert_eq!(estimator.predict(&(phi * 1e25)), Err(Error::Overflow));
    assert_eq!(estimator.predict_all(&(phi * 1e25)), Err(Error::Overflow));
}

#[test]
fn another_start_knows_nothing_of_the_noise() {
    let mut used = estimator::<f64, 2>(Forgetting::default());
    for (phi, y) in samples(23, &Vector2::new(1.0, 2.0), 0.1, 51) {
        used.update(&phi, y).unwrap();
    }
    for start in [RlsStart::Standard, RlsStart::Exact] {
        let fresh = estimator::<f64, 2>(Forgetting::default()).with_start(start).unwrap();
        assert_eq!(debug(&used.clone().with_start(start).unwrap()), debug(&fresh));
    }
}

#[test]
fn what_is_given_to_start_from_stays_whatever_the_order() {
    let parameters = Vector2::new(1.0, 2.0);
    let covariance = Covariance::from_diagonal(&Vector2::new(0.3, 0.2)).unwrap();
    let new = || estimator::<f64, 2>(Forgetting::Exponential { factor: 0.9 });
    for start in [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 3 }] {
        let orders = [
            [
                new().with_parameters(parameters).unwrap().with_start(start).unwrap(),
                new().with_start(start).unwrap().with_parameters(parameters).unwrap(),
            ],
            [
                new().with_covariance(covariance.clone()).unwrap().with_start(start).unwrap(),
                new().with_start(start).unwrap().with_covariance(covariance.clone()).unwrap(),
            ],
        ];
        for [mut first, mut second] in orders {
            assert_eq!(first.parameters(), second.parameters());
            assert_eq!(first.covariance(), second.covariance());
            for (phi, y) in samples(52, &Vector2::new(1.0, -1.0), 0.1, 30) {
                assert_eq!(debug(&first.update(&phi, y)), debug(&second.update(&phi, y)));
                assert_eq!(first.parameters(), second.parameters());
                assert_eq!(first.covariance(), second.covariance());
            }
        }
    }
    let given = new().with_parameters(parameters).unwrap().with_start(RlsStart::Exact).unwrap();
    assert_eq!(*given.parameters(), parameters);
    assert_eq!(given.covariance(), new().covariance());
}

#[test]
fn a_spread_that_forgetting_would_carry_over_is_refused() {
    let scales = Vector2::new(1e-9, 1.0_f32);
    let factor = 0.9;
    let policies = [
        Forgetting::Exponential { factor },
        Forgetting::Variable { factor, minimum: factor, noise_variance: 1e-6 },
    ];
    for policy in policies {
        let mut estimator = RecursiveLeastSquares::new(&scales, policy).unwrap();
        let refused = estimator.update(&Vector2::new(1.28 * 1.4e9, 1e9), 1.0);
        assert_eq!(refused, Err(Error::TooLarge { argument: "regressor" }));
        for k in 0..100 {
            let phi = Vector2::new(0.8e9 * (k % 3) as f32, 1e9);
            estimator.update(&phi, 1.0).unwrap();
            check_sound(&estimator, true);
        }
    }
}

#[test]
fn arguments_are_checked() {
    let scales = Vector4::new(1.0, 1.0, 1.0, 1.0_f32);
    let new = |scales: &Vector4<f32>, policy| Estimator::<f32, 4>::new(scales, policy).map(|_| ());
    let argument = |result: Result<(), Error>| match result.unwrap_err() {
        Error::OutOfRange { argument, .. } | Error::NotFinite { argument } => argument,
        other => panic!("{other:?}"),
    };
    for factor in [0.79, 1.01, 0.0, -1.0, f32::NAN] {
        assert_eq!(argument(new(&scales, Forgetting::Exponential { factor })), "factor");
        assert_eq!(argument(new(&scales, Forgetting::Selective { factor })), "factor");
        let variable = Forgetting::Variable { factor, minimum: 0.8, noise_variance: 1.0 };
        assert_eq!(argument(new(&scales, variable)), "factor");
        let variable = Forgetting::Variable { factor: 0.98, minimum: factor, noise_variance: 1.0 };
        assert_eq!(argument(new(&scales, variable)), "minimum");
    }
    for factor in [4.0 / 5.0, 0.9, 1.0] {
        assert_eq!(new(&scales, Forgetting::Exponential { factor }), Ok(()));
    }
    for variance in [-0.1, 101.0, f32::NAN] {
        assert_eq!(argument(new(&scales, Forgetting::RandomWalk { variance })), "variance");
    }
    for noise_variance in [0.0, -1.0, f32::INFINITY, f32::NAN] {
        let variable = Forgetting::Variable { factor: 0.98, minimum: 0.9, noise_variance };
        assert_eq!(argument(new(&scales, variable)), "noise_variance");
    }
    for scale in [0.0, -1.0, 1e-10, 1e10, f32::NAN, f32::INFINITY] {
        assert_eq!(argument(new(&Vector4::new(1.0, scale, 1.0, 1.0), Forgetting::None)), "scales");
    }
    for scale in [1e-9, 1e9] {
        assert_eq!(new(&Vector4::repeat(scale), Forgetting::default()), Ok(()));
    }

    let estimator = estimator::<f32, 4>(Forgetting::default());
    let error = estimator.clone().with_parameters(Vector4::repeat(f32::NAN)).unwrap_err();
    assert_eq!(error, Error::NotFinite { argument: "parameters" });
    let large = Covariance::from_diagonal(&Vector4::repeat(1e21)).unwrap();
    assert_eq!(estimator.with_covariance(large).unwrap_err(), Error::TooLarge { argument: "covariance" });
}

#[test]
fn a_noise_variance_that_is_known_is_that_of_a_batch() {
    let mut batch = LeastSquares::<f64, Const<3>>::new();
    let mut noise = Noise(30);
    let row = |noise: &mut Noise| {
        let phi: Vector3<f64> = random(noise);
        (phi, phi.sum() + 0.3 * noise.next())
    };
    for _ in 0..40 {
        let (phi, y) = row(&mut noise);
        batch.add(&phi, y).unwrap();
    }
    let solution = batch.solve().unwrap();
    let variance = solution.residual_variance().unwrap();
    let relative = Covariance::new(&(solution.covariance().unwrap() / variance)).unwrap();
    for policy in POLICIES {
        let mut expected = estimator::<f64, 3>(policy).with_solution(&solution).unwrap();
        let mut found = estimator::<f64, 3>(policy)
            .with_parameters(*solution.parameters())
            .and_then(|estimator| {
                estimator.with_covariance(relative.clone())?.with_noise_variance(variance, 40)
            })
            .unwrap();
        assert!((found.noise_variance().unwrap() / variance - 1.0).abs() < 1e-14);
        for _ in 0..50 {
            let (phi, y) = row(&mut noise);
            expected.update(&phi, y).unwrap();
            found.update(&phi, y).unwrap();
            let ratio = found.noise_variance().unwrap() / expected.noise_variance().unwrap();
            // Rounding of P, which was formed from R.
            assert!((ratio - 1.0).abs() < 1e-10, "{policy:?} {ratio}");
        }
    }
    let fresh = || estimator::<f64, 3>(Forgetting::None);
    let too_few = Error::TooFewRows { needed: 4, found: 3 };
    assert_eq!(fresh().with_noise_variance(1.0, 3).unwrap_err(), too_few);
    assert_eq!(fresh().with_noise_variance(0.0, 4).unwrap().noise_variance(), Some(0.0));
    for variance in [-1.0, f64::NAN, f64::INFINITY] {
        let error = fresh().with_noise_variance(variance, 9).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { argument: "variance", .. }));
    }
}

#[test]
fn standard_errors_are_written_where_they_are_asked_for() {
    let mut estimator = estimator::<f64, 3>(Forgetting::default());
    let (mut noise, mut errors) = (Noise(31), [0.0; 3]);
    for k in 0..20 {
        estimator.write_standard_errors(&mut errors).unwrap();
        match estimator.standard_errors() {
            Some(expected) => assert_eq!(errors, expected.as_slice()),
            None => assert!(k <= 3 && errors.iter().all(|error| error.is_nan())),
        }
        let phi: Vector3<f64> = random(&mut noise);
        estimator.update(&phi, noise.next()).unwrap();
    }
    let error = estimator.write_standard_errors(&mut [0.0; 2]).unwrap_err();
    assert_eq!(error, Error::Length { argument: "target", expected: 3, found: 2 });
}

#[test]
fn a_clone_goes_on_as_the_original() {
    for policy in POLICIES {
        let mut original = estimator::<f64, 3>(policy);
        let data = samples(18, &Vector3::new(1.0, 2.0, 3.0), 0.1, 200);
        for (phi, y) in &data[..100] {
            original.update(phi, *y).unwrap();
        }
        let mut copy = original.clone();
        for (phi, y) in &data[100..] {
            assert_eq!(debug(&original.update(phi, *y)), debug(&copy.update(phi, *y)));
        }
        assert_eq!(debug(&original), debug(&copy));
    }
}

#[cfg(feature = "alloc")]
#[test]
fn run_time_sizes_give_the_same_bits() {
    use nalgebra::{DVector, Dyn};

    for policy in POLICIES {
        for start in [RlsStart::Standard, RlsStart::Mixed { blend: 5 }] {
            let mut fixed = estimator::<f64, 3>(policy).with_start(start).unwrap();
            let mut free: RecursiveLeastSquares<f64, Dyn> =
                RecursiveLeastSquares::new(&DVector::repeat(3, 1.0), policy)
                    .unwrap()
                    .with_start(start)
                    .unwrap();
            let mut several: RecursiveLeastSquares<f64, Dyn, Dyn> =
                RecursiveLeastSquares::with_outputs(&DVector::repeat(3, 1.0), Dyn(1), policy)
                    .unwrap()
                    .with_start(start)
                    .unwrap();
            for (phi, y) in samples(19, &Vector3::new(1.0, 2.0, 3.0), 0.1, 100) {
                let row = DVector::from_column_slice(phi.as_slice());
                let expected = fixed.update(&phi, y).unwrap();
                assert_eq!(debug(&free.update(&row, y).unwrap()), debug(&expected));
                let innovation = several.update_all(&row, &DVector::from_element(1, y)).unwrap();
                assert_eq!(innovation.error[0], expected.error);
                assert_eq!(free.parameters().as_slice(), fixed.parameters().as_slice());
                assert_eq!(several.parameters().as_slice(), fixed.parameters().as_slice());
                assert_eq!(free.covariance().matrix().as_slice(), fixed.covariance().matrix().as_slice());
            }
            let length = |argument, found, expected| Some(Error::Length { argument, expected, found });
            assert_eq!(free.update(&DVector::zeros(2), 0.0).err(), length("regressor", 2, 3));
            assert_eq!(free.predict(&DVector::zeros(4)).err(), length("regressor", 4, 3));
            let wrong = several.update_all(&DVector::zeros(3), &DVector::zeros(2));
            assert_eq!(wrong.err(), length("outputs", 2, 1));
        }
    }
}

#[cfg(feature = "alloc")]
#[test]
fn more_parameters_than_are_counted_are_an_error() {
    use nalgebra::{DVector, Dyn};

    let many = DVector::repeat(65_536, 1.0_f32);
    let made = RecursiveLeastSquares::<f32, Dyn>::new(&many, Forgetting::None);
    assert_eq!(made.err(), Some(Error::Length { argument: "scales", expected: 65_535, found: 65_536 }));
}

/// What follows a sample is a pointer, which no snapshot and no change of size keeps: it is found out again.
#[cfg(feature = "alloc")]
#[test]
fn a_copy_in_another_size_goes_on_with_its_policy_and_start() {
    use nalgebra::{DVector, Dyn};

    for policy in POLICIES {
        for start in [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 5 }] {
            let mut fixed = estimator::<f64, 3>(policy).with_start(start).unwrap();
            for (k, (phi, y)) in samples(20, &Vector3::new(1.0, 2.0, 3.0), 0.1, 60).into_iter().enumerate() {
                let mut copy = fixed.to_size(Dyn(3)).unwrap();
                let row = DVector::from_column_slice(phi.as_slice());
                let expected = debug(&fixed.update(&phi, y).unwrap());
                assert_eq!(debug(&copy.update(&row, y).unwrap()), expected, "{policy:?} {start:?} {k}");
                for _ in 0..3 {
                    fixed.advance();
                    copy.advance();
                }
                assert_eq!(fixed.covariance().factor().as_slice(), copy.covariance().factor().as_slice());
                assert_eq!(fixed.parameters().as_slice(), copy.parameters().as_slice());
            }
        }
    }
}

#[test]
fn it_is_small() {
    // On a microcontroller 4, 8 and 16 parameters take 176, 420 and 1292 bytes; here the pointer is a longer word,
    // to which all is aligned.
    let word = size_of::<usize>() - 4;
    assert!(size_of::<Estimator<f32, 4>>() <= 176 + 2 * word);
    assert!(size_of::<Estimator<f32, 8>>() <= 420 + 2 * word);
    assert!(size_of::<Estimator<f32, 16>>() <= 1292 + 2 * word);
}
