extern crate std;
use std::println;
use std::string::ToString;

use nalgebra::{
    Const, Matrix2, Matrix3, RowVector2, RowVector3, SMatrix, SVector, Vector1, Vector2, Vector3,
};

use crate::noise::Noise;
use crate::textbook::{Square, inverse, random, random_covariance, stable};
use crate::{Covariance, Error, GainSchedule, KalmanFilter, LinearObservation, LinearTransition, Real};

type None = SVector<f64, 0>;

fn unit<T: Real, const N: usize>() -> Covariance<T, Const<N>> {
    Covariance::from_diagonal(&SVector::from_element(T::one())).unwrap()
}

fn alpha_beta<T: Real>() -> (LinearTransition<T, Const<2>>, LinearObservation<T, Const<2>, Const<1>>) {
    let (zero, one) = (T::zero(), T::one());
    let noise = unit::<T, 1>().transformed(&Vector2::new(nalgebra::convert(0.5), one)).unwrap();
    let motion = LinearTransition::new(Matrix2::new(one, one, zero, one), noise).unwrap();
    (motion, LinearObservation::new(RowVector2::new(one, zero), unit()).unwrap())
}

#[test]
fn the_alpha_beta_filter() {
    let (motion, sensor) = alpha_beta::<f64>();
    let steady = GainSchedule::new(unit()).steady_state(&motion, &sensor, 100).unwrap();
    assert!((steady.gain - Vector2::new(0.75, 0.5)).amax() < 1e-14);
    assert!((steady.predictor_gain - Vector2::new(1.25, 0.5)).amax() < 1e-14);
    assert!((steady.predicted.matrix() - Matrix2::new(3.0, 2.0, 2.0, 2.0)).amax() < 1e-14);
    assert!((steady.filtered.matrix() - Matrix2::new(0.75, 0.5, 0.5, 1.0)).amax() < 1e-14);
    assert!(steady.steps < 60, "{}", steady.steps);

    let (motion, sensor) = alpha_beta::<f32>();
    let steady = GainSchedule::new(unit()).steady_state(&motion, &sensor, 100).unwrap();
    assert!((steady.gain - Vector2::new(0.75, 0.5)).amax() < 1e-6);
    // From a start that says nothing.
    let vague = Covariance::from_diagonal(&Vector2::new(1e12, 1e12)).unwrap();
    let steady = GainSchedule::new(vague).steady_state(&motion, &sensor, 100).unwrap();
    assert!((steady.gain - Vector2::new(0.75, 0.5)).amax() < 1e-6);
}

#[test]
fn three_states_driven_by_one_noise() {
    let f = Matrix3::new(1.1269, -0.494, 0.1129, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let noise: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(2.3)).unwrap();
    let noise = noise.transformed(&Vector3::new(-0.3832, 0.5919, 0.5191)).unwrap();
    let model = LinearTransition::new(f, noise).unwrap();
    let sensor = LinearObservation::new(RowVector3::new(1.0, 0.0, 0.0), unit()).unwrap();
    let steady = GainSchedule::new(unit()).steady_state(&model, &sensor, 1000).unwrap();
    let expected = Vector3::new(0.53453754, 0.01013319, -0.47756789);
    assert!((steady.gain - expected).amax() < 1e-8, "{}", steady.gain);
}

#[test]
fn a_schedule_is_that_of_the_filter() {
    let mut noise = Noise(1);
    let prior = Covariance::new(&random_covariance::<3>(&mut noise)).unwrap();
    let mut filter = KalmanFilter::new(SVector::zeros(), prior.clone()).unwrap();
    let mut schedule = GainSchedule::new(prior);
    for k in 0..40 {
        // The model varies, and two sensors of different sizes take turns.
        let q = Covariance::new(&random_covariance::<3>(&mut noise)).unwrap();
        let model = LinearTransition::new(stable::<3>(&mut noise, 0.9), q).unwrap();
        filter.predict(&model, &None::zeros()).unwrap();
        schedule.predict(&model).unwrap();
        assert_eq!(schedule.covariance(), filter.covariance());
        let (before, p) = (*filter.state(), filter.covariance().matrix());
        if k % 2 == 0 {
            let (h, r) = (random::<2, 3>(&mut noise), random_covariance::<2>(&mut noise));
            let sensor = LinearObservation::new(h, Covariance::new(&r).unwrap()).unwrap();
            let gain = schedule.correct(&sensor).unwrap();
            let innovation = filter.correct(&sensor, &None::zeros(), &random(&mut noise)).unwrap();
            assert!((before + gain * innovation.error - filter.state()).amax() < 1e-13);
            let expected = p * h.transpose() * inverse(&(h * p * h.transpose() + r));
            assert!((gain - expected).amax() < 1e-13);
        } else {
            let sensor = LinearObservation::new(random::<1, 3>(&mut noise), unit()).unwrap();
            let gain = schedule.correct(&sensor).unwrap();
            let innovation = filter.correct(&sensor, &None::zeros(), &random(&mut noise)).unwrap();
            assert!((before + gain * innovation.error - filter.state()).amax() < 1e-13);
        }
        assert_eq!(schedule.covariance(), filter.covariance());
    }
}

/// The largest residual of the Riccati equation, beside the variances.
fn riccati_residual<T: Real + Into<f64>, const N: usize, const M: usize>(
    noise: &mut Noise,
    radius: f64,
) -> f64 {
    let (f, h) = (stable::<N>(noise, radius), random::<M, N>(noise));
    let (q, r) = (random_covariance::<N>(noise), random_covariance::<M>(noise));
    let narrow = |matrix: &Square<N>| -> SMatrix<T, N, N> { nalgebra::convert(*matrix) };
    let model = LinearTransition::new(narrow(&f), Covariance::new(&narrow(&q)).unwrap()).unwrap();
    let narrow_r: SMatrix<T, M, M> = nalgebra::convert(r);
    let narrow_h: SMatrix<T, M, N> = nalgebra::convert(h);
    let sensor = LinearObservation::new(narrow_h, Covariance::new(&narrow_r).unwrap()).unwrap();
    let steady = GainSchedule::new(unit()).steady_state(&model, &sensor, 5000).unwrap();

    let (f, h) = (narrow(&f).map(Into::into), narrow_h.map(Into::into));
    let (q, r): (Square<N>, Square<M>) = (narrow(&q).map(Into::into), narrow_r.map(Into::into));
    let p: Square<N> = steady.predicted.matrix().map(Into::into);
    let gain = p * h.transpose() * inverse(&(h * p * h.transpose() + r));
    let filtered = p - gain * h * p;
    let next = f * filtered * f.transpose() + q;
    let share = |i: usize, j: usize| (next[(i, j)] - p[(i, j)]).abs() / (p[(i, i)] * p[(j, j)]).sqrt();
    let residual = (0..N * N).map(|k| share(k / N, k % N)).fold(0.0, f64::max);
    let tolerance: f64 = T::EPSILON.into() * 1000.0;
    assert!((steady.gain.map(Into::into) - gain).amax() < tolerance);
    assert!((steady.predictor_gain.map(Into::into) - f * gain).amax() < 2.0 * tolerance);
    assert!((steady.filtered.matrix().map(Into::into) - filtered).amax() < tolerance * p.amax());
    residual
}

#[test]
fn the_fixed_point_solves_the_riccati_equation() {
    let mut noise = Noise(2);
    let (mut double, mut single) = (0.0_f64, 0.0_f64);
    for radius in [0.5, 0.99, 1.0, 1.5] {
        for _ in 0..10 {
            double = double.max(riccati_residual::<f64, 2, 1>(&mut noise, radius));
            double = double.max(riccati_residual::<f64, 4, 2>(&mut noise, radius));
            double = double.max(riccati_residual::<f64, 6, 3>(&mut noise, radius));
            single = single.max(riccati_residual::<f32, 2, 1>(&mut noise, radius));
            single = single.max(riccati_residual::<f32, 4, 2>(&mut noise, radius));
        }
    }
    println!("{double:e} {single:e}");
    assert!(double < 1e-13 && single < 1e-4, "{double:e} {single:e}");
}

#[test]
fn what_does_not_settle_is_an_error() {
    let one = Vector1::new(1.0);
    let blind = LinearObservation::new(Vector1::new(0.0), unit::<f64, 1>()).unwrap();
    // A random walk that nothing measures grows for ever.
    let walk = LinearTransition::new(one, unit()).unwrap();
    let error = GainSchedule::new(unit()).steady_state(&walk, &blind, 1000).unwrap_err();
    assert_eq!(error, Error::NotConverged { steps: 1000 });
    assert!(error.to_string().contains("1000"));
    // What is unstable, and not measured, overflows.
    let unstable = LinearTransition::new(2.0 * one, unit()).unwrap();
    let error = GainSchedule::new(unit()).steady_state(&unstable, &blind, 10_000).unwrap_err();
    assert_eq!(error, Error::Overflow);
    let sensor = LinearObservation::new(one, unit()).unwrap();
    let error = GainSchedule::new(unit()).steady_state(&walk, &sensor, 0).unwrap_err();
    assert_eq!(error, Error::NotConverged { steps: 0 });

    let exact = LinearObservation::new(one, Covariance::zero(Const)).unwrap();
    let known = LinearTransition::new(one, Covariance::zero(Const)).unwrap();
    let mut schedule = GainSchedule::new(Covariance::zero(Const));
    let before = schedule.clone();
    assert_eq!(schedule.predict(&known), Ok(()));
    assert_eq!(schedule.correct(&exact).unwrap_err(), Error::NoVariance { index: 0 });
    assert_eq!(schedule, before);
}

#[test]
fn it_is_given_up_when_asked() {
    let (motion, sensor) = alpha_beta::<f64>();
    let mut asked = 0;
    let third = || {
        asked += 1;
        asked > 3
    };
    let given_up = GainSchedule::new(unit()).steady_state_unless(&motion, &sensor, 100, third);
    assert_eq!(given_up.unwrap_err(), Error::NotConverged { steps: 3 });
}

#[test]
fn what_is_stable_and_not_driven_becomes_known() {
    let known = LinearTransition::new(Matrix2::new(0.5, 0.0, 0.0, 0.9), Covariance::zero(Const)).unwrap();
    let sensor = LinearObservation::new(Matrix2::identity(), unit()).unwrap();
    let steady = GainSchedule::new(unit::<f64, 2>()).steady_state(&known, &sensor, 10_000).unwrap();
    assert!(steady.predicted.variances().amax() < 1e-300);
}

#[cfg(feature = "alloc")]
#[test]
fn sizes_at_run_time_give_the_same_bits() {
    use nalgebra::{DMatrix, DVector};

    let (motion, sensor) = alpha_beta::<f64>();
    let steady = GainSchedule::new(unit()).steady_state(&motion, &sensor, 100).unwrap();
    let noise = Covariance::from_diagonal(&DVector::from_element(1, 1.0)).unwrap();
    let process = noise.transformed(&DMatrix::from_column_slice(2, 1, &[0.5, 1.0])).unwrap();
    let motion =
        LinearTransition::new(DMatrix::from_column_slice(2, 2, &[1.0, 0.0, 1.0, 1.0]), process).unwrap();
    let sensor = LinearObservation::new(DMatrix::from_column_slice(1, 2, &[1.0, 0.0]), noise).unwrap();
    let prior = Covariance::from_diagonal(&DVector::from_element(2, 1.0)).unwrap();
    let found = GainSchedule::new(prior).steady_state(&motion, &sensor, 100).unwrap();
    assert_eq!(found.gain.as_slice(), steady.gain.as_slice());
    assert_eq!(found.predictor_gain.as_slice(), steady.predictor_gain.as_slice());
    assert_eq!(found.predicted.factor().as_slice(), steady.predicted.factor().as_slice());

    let other = LinearObservation::new(
        DMatrix::from_element(1, 3, 1.0),
        Covariance::from_diagonal(&DVector::from_element(1, 1.0)).unwrap(),
    );
    let prior = Covariance::from_diagonal(&DVector::from_element(2, 1.0)).unwrap();
    let error = GainSchedule::new(prior).correct(&other.unwrap()).unwrap_err();
    assert_eq!(error, Error::Length { argument: "observation", expected: 2, found: 3 });
}

/// The relative error of P before a measurement, for a random walk with variance q measured with variance 1.
fn error_of_a_random_walk<T: Real + Into<f64>>(q: f64) -> f64 {
    let noise = Covariance::from_diagonal(&Vector1::new(nalgebra::convert(q))).unwrap();
    let walk = LinearTransition::new(Vector1::new(T::one()), noise).unwrap();
    let sensor = LinearObservation::new(Vector1::new(T::one()), unit()).unwrap();
    let steady = GainSchedule::new(unit::<T, 1>()).steady_state(&walk, &sensor, 1_000_000).unwrap();
    let found: f64 = steady.predicted.variances()[0].into();
    let exact = 0.5 * (q + (q * q + 4.0 * q).sqrt());
    println!("{q:e}: {:e} after {}", found / exact - 1.0, steady.steps);
    (found / exact - 1.0).abs()
}

#[test]
fn it_does_not_settle_early_where_the_filter_is_slow() {
    for (q, single, double) in
        [(1e-2, 1e-6, 1e-14), (1e-4, 1e-5, 1e-13), (1e-6, 1e-4, 1e-12), (1e-8, 1e-3, 1e-11)]
    {
        assert!(error_of_a_random_walk::<f32>(q) < single);
        assert!(error_of_a_random_walk::<f64>(q) < double);
    }
}
