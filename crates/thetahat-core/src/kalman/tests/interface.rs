//! Gates, missing elements, errors, snapshots, sizes at run time.

use nalgebra::{Const, Matrix2, Matrix3, SVector, Vector1, Vector2, Vector3};

use super::{Filter, NONE, covariance, filter, observation, transition};
use crate::noise::Noise;
use crate::textbook::{random, random_covariance, stable};
use crate::{Action, Covariance, Error, KalmanFilter, LinearObservation, LinearTransition, Real};

#[test]
fn a_measurement_above_the_gate_is_not_used() {
    let sensor = observation(&Matrix2::identity(), &Matrix2::identity());
    let given: Filter<2> = filter(&Vector2::zeros(), &(3.0 * Matrix2::identity()));
    assert_eq!(given.gate(), f64::INFINITY);
    let mut gated = given.clone().with_gate(7.3778).unwrap();
    assert_eq!(gated.gate(), 7.3778);
    // S = 4 I: nis = 4, then 8.
    let inside = Vector2::new(4.0, 0.0);
    let innovation = gated.correct(&sensor, &NONE, &inside).unwrap();
    assert_eq!((innovation.action, innovation.nis), (Action::Updated, 4.0));
    let mut gated = given.clone().with_gate(7.3778).unwrap();
    let outside = Vector2::new(4.0, 4.0);
    let innovation = gated.correct(&sensor, &NONE, &outside).unwrap();
    assert_eq!((innovation.action, innovation.nis), (Action::Gated, 8.0));
    assert_eq!((innovation.error, innovation.variance), (outside, Vector2::new(4.0, 4.0)));
    assert_eq!((gated.state(), gated.covariance()), (given.state(), given.covariance()));
    // Of an element that is missing nothing is asked.
    let innovation = gated.correct(&sensor, &NONE, &Vector2::new(4.0, f64::NAN)).unwrap();
    assert_eq!((innovation.action, innovation.nis), (Action::Updated, 4.0));

    for gate in [0.0, -1.0, f64::NAN] {
        let error = Error::OutOfRange { argument: "gate", range: "above 0" };
        assert_eq!(given.clone().with_gate(gate).unwrap_err(), error);
    }
}

/// What each of these measurements of a level becomes, and how many in a row were above the gate after it.
fn gate_of<const K: usize>(filter: &mut Filter<1>, measurements: [f64; K]) -> [(Action, u16); K] {
    let one = Vector1::new(1.0);
    let (model, sensor) = (transition(&one, &(0.01 * one)), observation::<f64, 1, 1>(&one, &one));
    measurements.map(|y| {
        filter.predict(&model, &NONE).unwrap();
        let action = filter.correct(&sensor, &NONE, &Vector1::new(y)).unwrap().action;
        (action, filter.gated_in_a_row())
    })
}

#[test]
fn a_gate_that_locks_out_says_so_and_lets_go_where_it_may() {
    use Action::{Gated, Missing, Released, Updated};

    let one = Vector1::new(1.0);
    let given: Filter<1> = filter(&Vector1::zeros(), &one).with_gate(9.0).unwrap();
    assert_eq!((given.release(), given.gated_in_a_row()), (0, 0));
    // It never lets go by itself, and tells how long that has been so.
    let mut locked = given.clone();
    let actions = gate_of(&mut locked, [100.0; 400]);
    assert!(actions.iter().enumerate().all(|(k, &found)| found == (Gated, k as u16 + 1)));
    assert_eq!(gate_of(&mut locked, [0.5]), [(Updated, 0)]);

    // After three in a row it lets go, until one is within again; a missing one says nothing.
    let mut released = given.clone().with_release(3);
    let actions = gate_of(&mut released, [100.0, 100.0, f64::NAN, 100.0, 100.0, f64::NAN, 100.0]);
    let expected =
        [(Gated, 1), (Gated, 2), (Missing, 2), (Gated, 3), (Released, 4), (Missing, 4), (Released, 5)];
    assert_eq!(actions, expected);
    let actions = gate_of(&mut released, [100.0; 40]);
    let first = actions.iter().position(|&(action, _)| action == Updated).unwrap();
    assert!(actions[..first].iter().all(|&(action, _)| action == Released));
    assert!(actions[first..].iter().all(|&found| found == (Updated, 0)) && first < 30, "{first}");
    // Then it counts anew.
    assert_eq!(
        gate_of(&mut released, [0.0, 0.0, 0.0, 0.0]).map(|(action, _)| action),
        [Gated, Gated, Gated, Released]
    );
    // An outlier alone is none of that, and one that is within starts the count anew.
    let mut filter = given.with_release(1);
    let actions = gate_of(&mut filter, [0.0, 50.0, 0.0, 50.0, 0.0]).map(|(action, _)| action);
    assert_eq!(actions, [Updated, Gated, Updated, Gated, Updated]);
    // It goes with the size, and a released measurement is weighed as any other.
    let free = filter.clone().with_gate(f64::INFINITY).unwrap();
    let copies = [filter.clone(), filter.to_size(Const::<1>).unwrap()];
    for mut copy in copies {
        let mut free = free.clone();
        gate_of(&mut copy, [50.0]);
        gate_of(&mut free, [f64::NAN]);
        assert_eq!(gate_of(&mut copy, [50.0]), [(Released, 2)]);
        gate_of(&mut free, [50.0]);
        assert_eq!((copy.state(), copy.covariance()), (free.state(), free.covariance()));
    }
}

#[test]
fn a_measurement_that_is_missing_changes_nothing_and_says_so() {
    let mut noise = Noise(1);
    let sensor = observation(&random::<2, 3>(&mut noise), &random_covariance(&mut noise));
    let mut filter: Filter<3> = filter(&random(&mut noise), &random_covariance(&mut noise));
    let before = filter.clone();
    let innovation = filter.correct(&sensor, &NONE, &Vector2::new(f64::NAN, f64::NAN)).unwrap();
    assert_eq!((innovation.action, innovation.nis), (Action::Missing, 0.0));
    assert!(innovation.error.iter().chain(innovation.variance.iter()).all(|number| number.is_nan()));
    assert_eq!(innovation.log_likelihood(), 0.0);
    assert_eq!(filter, before);
}

#[test]
fn errors_name_the_argument_and_change_nothing() {
    let one = Vector1::new(1.0);
    let model = transition::<f64, 1>(&one, &one).with_input(one).unwrap();
    let sensor = observation::<f64, 1, 1>(&one, &one).with_input(one).unwrap();
    let mut filter: Filter<1> = filter(&one, &one);
    let before = filter.clone();

    for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
        let (input, error) = (Vector1::new(bad), Error::NotFinite { argument: "input" });
        assert_eq!(filter.predict(&model, &input), Err(error));
        assert_eq!(filter.correct(&sensor, &input, &one).unwrap_err(), error);
    }
    for bad in [f64::INFINITY, -f64::INFINITY] {
        let error = Error::Infinite { argument: "measurement" };
        assert_eq!(filter.correct(&sensor, &one, &Vector1::new(bad)).unwrap_err(), error);
    }
    let error = Error::TooLarge { argument: "measurement" };
    assert_eq!(filter.correct(&sensor, &one, &Vector1::new(1e200)).unwrap_err(), error);
    assert_eq!(filter.correct(&sensor, &one, &Vector1::new(-f64::MAX)).unwrap_err(), error);
    // What is predicted does not fit.
    let large = observation::<f64, 1, 1>(&Vector1::new(f64::MAX), &one).with_input(one).unwrap();
    let error = Error::NotFinite { argument: "predicted measurement" };
    assert_eq!(filter.correct(&large, &Vector1::new(f64::MAX), &one).unwrap_err(), error);
    let error = Error::TooLarge { argument: "measurement" };
    assert_eq!(filter.correct(&large, &one, &one).unwrap_err(), error);
    // The state, or its variance, overflows.
    let large = transition::<f64, 1>(&Vector1::new(1e200), &one).with_input(one).unwrap();
    assert_eq!(filter.predict(&large, &one), Err(Error::Overflow));
    let large = transition::<f64, 1>(&Vector1::new(f64::MAX), &one).with_input(one).unwrap();
    assert_eq!(filter.predict(&large, &Vector1::new(f64::MAX)), Err(Error::Overflow));
    // Both are known exactly.
    let exact = observation::<f64, 1, 1>(&Vector1::zeros(), &Vector1::zeros());
    assert_eq!(filter.correct(&exact, &NONE, &one).unwrap_err(), Error::NoVariance { index: 0 });
    assert_eq!(filter, before);

    let infinite = KalmanFilter::new(Vector1::new(f64::INFINITY), Covariance::<f64, _>::zero(Const));
    assert_eq!(infinite.unwrap_err(), Error::NotFinite { argument: "state" });
}

#[test]
fn an_error_in_the_last_element_takes_back_the_others() {
    // Elements are used from the last to the first.
    let sensor = observation::<f64, 2, 3>(
        &nalgebra::Matrix3x2::new(0.0, 0.0, 1.0, 0.0, 0.0, 1.0),
        &Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0)),
    );
    let mut filter: Filter<2> = filter(&Vector2::zeros(), &Matrix2::identity());
    let before = filter.clone();
    let error = filter.correct(&sensor, &NONE, &Vector3::new(1.0, 1.0, 1.0)).unwrap_err();
    assert_eq!(error, Error::NoVariance { index: 0 });
    assert_eq!(filter, before);
    let error = filter.correct(&sensor, &NONE, &Vector3::new(f64::NAN, 1e300, 1.0)).unwrap_err();
    assert_eq!(error, Error::TooLarge { argument: "measurement" });
    assert_eq!(filter, before);
    assert!(filter.correct(&sensor, &NONE, &Vector3::new(f64::NAN, 1.0, 1.0)).is_ok());
}

#[test]
fn numbers_that_overflow_in_whitening_are_not_taken_for_missing_ones() {
    // V⁻¹ y makes infinity less infinity here.
    let r = Matrix3::new(1.0, 0.99, 0.99, 0.99, 1.0, 0.99, 0.99, 0.99, 1.0);
    let sensor = observation::<f64, 1, 3>(&Vector3::new(1.0, 1.0, 1.0), &r);
    let mut filter: Filter<1> = filter(&Vector1::zeros(), &Vector1::new(1.0));
    let before = filter.clone();
    let y = Vector3::new(-f64::MAX, f64::MAX, -f64::MAX);
    let error = filter.correct(&sensor, &NONE, &y).unwrap_err();
    assert_eq!(error, Error::TooLarge { argument: "measurement" });
    assert_eq!(filter, before);
}

fn check_snapshot<T: Real>() {
    let mut noise = Noise(2);
    let model = transition::<T, 3>(&stable(&mut noise, 0.9), &random_covariance(&mut noise));
    let sensor = observation::<T, 3, 2>(&random(&mut noise), &random_covariance(&mut noise));
    let mut filter = filter::<T, 3>(&random(&mut noise), &random_covariance(&mut noise))
        .with_gate(nalgebra::convert(50.0))
        .unwrap();
    let mut restored = filter.clone();
    for k in 0..40 {
        let y: SVector<T, 2> = nalgebra::convert(random::<2, 1>(&mut noise));
        for filter in [&mut filter, &mut restored] {
            filter.predict(&model, &SVector::zeros()).unwrap();
            filter.correct(&sensor, &SVector::zeros(), &y).unwrap();
        }
        assert!(filter == restored);
        if k == 20 {
            let covariance = Covariance::from_factor(filter.covariance().factor()).unwrap();
            restored =
                KalmanFilter::new(*filter.state(), covariance).unwrap().with_gate(filter.gate()).unwrap();
            assert!(filter == restored);
        }
    }
}

#[test]
fn a_filter_is_restored_to_the_bit() {
    check_snapshot::<f32>();
    check_snapshot::<f64>();
}

#[cfg(feature = "alloc")]
mod dynamic {
    use nalgebra::{DMatrix, DVector, Dyn, OMatrix};

    use super::*;

    fn dynamic<const R: usize, const C: usize>(
        matrix: &nalgebra::SMatrix<f64, R, C>,
    ) -> OMatrix<f64, Dyn, Dyn> {
        DMatrix::from_column_slice(R, C, matrix.as_slice())
    }

    #[test]
    fn sizes_at_run_time_give_the_same_bits() {
        let mut noise = Noise(3);
        let (f, q, g) =
            (stable::<4>(&mut noise, 1.0), random_covariance::<4>(&mut noise), random::<4, 2>(&mut noise));
        let (h, r, d) =
            (random::<3, 4>(&mut noise), random_covariance::<3>(&mut noise), random::<3, 2>(&mut noise));
        let cross = random::<4, 3>(&mut noise) * 1e-3;
        let model = transition::<f64, 4>(&f, &q).with_input(g).unwrap();
        let sensor = observation::<f64, 4, 3>(&h, &r).with_input(d).unwrap();
        let p = 1e6 * random_covariance::<4>(&mut noise);
        let mut filter: Filter<4> = filter(&random(&mut noise), &p);

        let model_at_run_time = LinearTransition::new(dynamic(&f), Covariance::new(&dynamic(&q)).unwrap())
            .unwrap()
            .with_input(dynamic(&g))
            .unwrap();
        let sensor_at_run_time = LinearObservation::new(dynamic(&h), Covariance::new(&dynamic(&r)).unwrap())
            .unwrap()
            .with_input(dynamic(&d))
            .unwrap();
        let state = DVector::from_column_slice(filter.state().as_slice());
        let mut at_run_time = KalmanFilter::new(state, Covariance::new(&dynamic(&p)).unwrap()).unwrap();

        for k in 0..60 {
            let (u, mut y) = (random::<2, 1>(&mut noise), random::<3, 1>(&mut noise));
            if k % 4 == 1 {
                y[k % 3] = f64::NAN;
            }
            let u_at_run_time = DVector::from_column_slice(u.as_slice());
            let y_at_run_time = DVector::from_column_slice(y.as_slice());
            let innovation = filter.correct(&sensor, &u, &y).unwrap();
            let found = at_run_time.correct(&sensor_at_run_time, &u_at_run_time, &y_at_run_time).unwrap();
            assert_eq!((innovation.nis, innovation.action), (found.nis, found.action));
            if k % 2 == 0 {
                filter.predict(&model, &u).unwrap();
                at_run_time.predict(&model_at_run_time, &u_at_run_time).unwrap();
            } else {
                filter.predict_correlated(&model, &sensor, &cross, &u, &y).unwrap();
                at_run_time
                    .predict_correlated(
                        &model_at_run_time,
                        &sensor_at_run_time,
                        &dynamic(&cross),
                        &u_at_run_time,
                        &y_at_run_time,
                    )
                    .unwrap();
            }
            assert_eq!(filter.state().as_slice(), at_run_time.state().as_slice());
            assert_eq!(filter.covariance().factor().as_slice(), at_run_time.covariance().factor().as_slice());
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_errors() {
        let unit = |size| Covariance::<f64, Dyn>::from_diagonal(&DVector::from_element(size, 1.0)).unwrap();
        let model = |size, inputs| {
            LinearTransition::new(DMatrix::identity(size, size), unit(size))
                .unwrap()
                .with_input(DMatrix::<f64>::zeros(size, inputs))
                .unwrap()
        };
        let sensor = |size: usize, outputs: usize, inputs: usize| {
            LinearObservation::new(DMatrix::<f64>::zeros(outputs, size), unit(outputs))
                .unwrap()
                .with_input(DMatrix::<f64>::zeros(outputs, inputs))
                .unwrap()
        };
        let ones = |size| DVector::from_element(size, 1.0);
        let mut filter = KalmanFilter::new(ones(3), unit(3)).unwrap();
        let before = filter.clone();
        let length = |argument, expected, found| Error::Length { argument, expected, found };

        assert_eq!(KalmanFilter::new(ones(2), unit(3)).unwrap_err(), length("state", 3, 2));
        assert_eq!(filter.predict(&model(2, 1), &ones(1)), Err(length("transition", 3, 2)));
        assert_eq!(filter.predict(&model(3, 1), &ones(2)), Err(length("input", 1, 2)));
        let mut correct = |sensor, u, y| filter.correct(&sensor, &ones(u), &ones(y)).unwrap_err();
        assert_eq!(correct(sensor(2, 1, 1), 1, 1), length("observation", 3, 2));
        assert_eq!(correct(sensor(3, 2, 1), 1, 1), length("measurement", 2, 1));
        assert_eq!(correct(sensor(3, 2, 1), 2, 2), length("input", 1, 2));
        let mut predict = |cross: (usize, usize), d| {
            let cross = DMatrix::<f64>::zeros(cross.0, cross.1);
            filter.predict_correlated(&model(3, 1), &sensor(3, 2, d), &cross, &ones(1), &ones(2)).unwrap_err()
        };
        assert_eq!(predict((3, 1), 1), length("cross_covariance", 2, 1));
        assert_eq!(predict((2, 2), 1), length("cross_covariance", 6, 4));
        assert_eq!(predict((3, 2), 2), length("observation", 1, 2));
        let error = filter.innovation_covariance(&sensor(2, 1, 1)).unwrap_err();
        assert_eq!(error, length("matrix", 3, 2));
        assert_eq!(filter, before);
    }
}

#[test]
fn a_linear_model_answers_with_its_parts() {
    let mut noise = Noise(4);
    let (f, q, g) =
        (random::<2, 2>(&mut noise), random_covariance::<2>(&mut noise), random::<2, 3>(&mut noise));
    let model = LinearTransition::new(f, covariance::<f64, 2>(&q)).unwrap().with_input(g).unwrap();
    assert_eq!((model.state_matrix(), model.input_matrix(), model.noise()), (&f, &g, &covariance(&q)));
    let (h, r, d) =
        (random::<4, 2>(&mut noise), random_covariance::<4>(&mut noise), random::<4, 3>(&mut noise));
    let sensor = LinearObservation::new(h, covariance::<f64, 4>(&r)).unwrap().with_input(d).unwrap();
    assert_eq!((sensor.output_matrix(), sensor.input_matrix(), sensor.noise()), (h, &d, &covariance(&r)));

    let not_finite = |argument| Error::NotFinite { argument };
    let bad = Matrix2::new(1.0, f64::NAN, 0.0, 1.0);
    let noise = Covariance::<f64, Const<2>>::zero(Const);
    assert_eq!(LinearTransition::new(bad, noise.clone()).unwrap_err(), not_finite("state_matrix"));
    let error = LinearObservation::new(bad, noise).unwrap_err();
    assert_eq!(error, not_finite("output_matrix"));
    assert_eq!(model.with_input(bad).unwrap_err(), not_finite("input_matrix"));
    let bad = nalgebra::Matrix4x2::from_element(f64::INFINITY);
    assert_eq!(sensor.with_input(bad).unwrap_err(), not_finite("input_matrix"));
}

#[test]
fn a_measurement_with_next_to_no_noise_leaves_no_nan() {
    fn check<T: Real + Into<f64>>(h: [f64; 2], r: f64, expected: [f64; 2]) {
        let unit = Covariance::from_diagonal(&Vector2::from_element(T::one())).unwrap();
        let mut filter = KalmanFilter::new(Vector2::zeros(), unit).unwrap();
        let noise = Covariance::<T, Const<1>>::from_diagonal(&Vector1::new(nalgebra::convert(r))).unwrap();
        let row = nalgebra::RowVector2::new(nalgebra::convert(h[0]), nalgebra::convert(h[1]));
        let sensor = LinearObservation::new(row, noise).unwrap();
        let none = SVector::<T, 0>::zeros();
        let innovation = filter.correct(&sensor, &none, &Vector1::new(T::one())).unwrap();
        assert_eq!(innovation.action, Action::Updated);
        assert!(filter.covariance().matrix().iter().all(T::is_finite));
        let found = filter.covariance().variances().map(Into::into);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{h:?} {r:e} {found:?}");
        }
        let state: f64 = filter.state()[1].into();
        assert!((state * h[1] - expected[0]).abs() < 1e-6, "{h:?} {r:e} {state:e}");
    }
    // What is not measured, or but for 1e-20 or 1e-26 of the variance, stays as it was.
    for h in [[0.0, 100.0], [0.0, 1e10], [1e-20, 1.0], [1e-13, 1e10], [0.01, 1e12]] {
        for r in [0.0, 1e-38, 1.2e-37, 1e-30, 1e-20] {
            check::<f64>(h, r, [1.0, 0.0]);
            check::<f64>(h, 1e-305, [1.0, 0.0]);
            check::<f32>(h, r, [1.0, 0.0]);
        }
    }
    check::<f32>([0.0, 1e18], 1e-19, [1.0, 0.0]);
    check::<f64>([0.0, 1e150], 1e-305, [1.0, 0.0]);
}

#[test]
fn an_infinite_variance_is_an_overflow() {
    // D = (1, 1.3e38) and U_01 = 1.7: they are finite, but 1.7² 1.3e38 is not.
    let covariance = Covariance::from_diagonal(&Vector2::new(1.0_f32, 1.3e38)).unwrap();
    let transition = Matrix2::new(1.0, 1.7, 0.0, 1.0);
    assert_eq!(covariance.transformed(&transition), Err(Error::Overflow));
    let model = LinearTransition::new(transition, Covariance::zero(Const)).unwrap();
    let mut filter = KalmanFilter::new(Vector2::zeros(), covariance).unwrap();
    let before = filter.clone();
    assert_eq!(filter.predict(&model, &SVector::<f32, 0>::zeros()), Err(Error::Overflow));
    assert_eq!(filter, before);
    // What just fits is kept: 1.5e38 + 1.5e38.
    let unit = Covariance::from_diagonal(&Vector1::new(1.5e38_f32)).unwrap();
    let model = LinearTransition::new(Vector1::new(1.0), unit.clone()).unwrap();
    let mut filter = KalmanFilter::new(Vector1::new(0.0), unit).unwrap();
    filter.predict(&model, &SVector::<f32, 0>::zeros()).unwrap();
    assert_eq!(filter.covariance().variances()[0], 3e38);
    assert_eq!(filter.predict(&model, &SVector::<f32, 0>::zeros()), Err(Error::Overflow));
}
