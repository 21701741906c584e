//! Process and measurement noise that go together.

use nalgebra::{Const, Matrix2, SMatrix, SVector, Vector1, Vector2};

use super::textbook::{masked, without};
use super::{Filter, NONE, covariance, difference, filter, observation, transition};
use crate::noise::Noise;
use crate::textbook::{Square, inverse, random, random_covariance, stable};
use crate::{Covariance, Error, KalmanFilter, LinearObservation, LinearTransition};

/// The one-step predictor as textbooks print it, with the covariance of the two noises:
/// x <- F x + G u + K e, P <- F P F' + Q - K S K', K = (F P H' + cov(w, v)) S⁻¹.
fn predictor<const N: usize, const M: usize>(
    (x, p): (&mut SVector<f64, N>, &mut Square<N>),
    (f, q): (&Square<N>, &Square<N>),
    (h, r): (&SMatrix<f64, M, N>, &Square<M>),
    cross: &SMatrix<f64, N, M>,
    y: &SVector<f64, M>,
) {
    let s = h * *p * h.transpose() + r;
    let gain = (f * *p * h.transpose() + cross) * inverse(&s);
    *x = f * *x + gain * (y - h * *x);
    *p = f * *p * f.transpose() + q - gain * s * gain.transpose();
}

fn check_random_models<const N: usize, const M: usize, const J: usize>(noise: &mut Noise) {
    assert_eq!(N + M, J);
    for _ in 0..10 {
        let (f, h) = (stable::<N>(noise, 0.95), random::<M, N>(noise));
        let joint = random_covariance::<J>(noise);
        let q = joint.fixed_view::<N, N>(0, 0).into_owned();
        let r = joint.fixed_view::<M, M>(N, N).into_owned();
        let cross = joint.fixed_view::<N, M>(0, N).into_owned();
        let (g, d): (SMatrix<f64, N, 2>, SMatrix<f64, M, 2>) = (random(noise), random(noise));
        let model = LinearTransition::new(f, covariance(&q)).unwrap().with_input(g).unwrap();
        let sensor = LinearObservation::new(h, covariance(&r)).unwrap().with_input(d).unwrap();
        let (mut x, mut p) = (random(noise), random_covariance::<N>(noise));
        let mut filter: Filter<N> = filter(&x, &p);
        for k in 0..40 {
            let (u, y): (SVector<f64, 2>, SVector<f64, M>) = (random(noise), random(noise));
            let missing = if k % 3 == 0 { 0 } else { k % (1 << M) };
            let (h, r, seen) = without(missing, &h, &r, &(y - d * u));
            let mut cross_seen = cross;
            for index in (0..M).filter(|index| missing >> index & 1 == 1) {
                cross_seen.column_mut(index).fill(0.0);
            }
            predictor((&mut x, &mut p), (&f, &q), (&h, &r), &cross_seen, &seen);
            x += g * u;

            let y = masked(missing, &y);
            filter.correct(&sensor, &u, &y).unwrap();
            filter.predict_correlated(&model, &sensor, &cross, &u, &y).unwrap();
            assert!((filter.state() - x).amax() < 1e-11, "{N} {M} {k}");
            assert!(difference(&filter.covariance().matrix(), &p) < 1e-11, "{N} {M} {k}");
        }
    }
}

#[test]
fn random_models() {
    let mut noise = Noise(1);
    check_random_models::<1, 1, 2>(&mut noise);
    check_random_models::<3, 2, 5>(&mut noise);
    check_random_models::<4, 1, 5>(&mut noise);
    check_random_models::<2, 3, 5>(&mut noise);
}

#[test]
fn all_missing_or_no_covariance_is_the_plain_prediction() {
    let mut noise = Noise(2);
    let model = transition(&stable::<3>(&mut noise, 0.9), &random_covariance(&mut noise));
    let sensor = observation(&random::<2, 3>(&mut noise), &random_covariance(&mut noise));
    let cross: SMatrix<f64, 3, 2> = random::<3, 2>(&mut noise) * 0.01;
    let given: Filter<3> = filter(&random(&mut noise), &random_covariance(&mut noise));
    let mut plain = given.clone();
    plain.predict(&model, &NONE).unwrap();
    for (cross, y) in [
        (cross, Vector2::new(f64::NAN, f64::NAN)),
        (SMatrix::zeros(), Vector2::new(1.0, 2.0)),
        (SMatrix::zeros(), Vector2::new(1.0, f64::NAN)),
    ] {
        let mut filter = given.clone();
        filter.predict_correlated(&model, &sensor, &cross, &NONE, &y).unwrap();
        assert!((filter.state() - plain.state()).amax() < 1e-15);
        assert!(difference(&filter.covariance().matrix(), &plain.covariance().matrix()) < 1e-14);
    }
}

#[test]
fn innovations_form_learns_the_noise_from_the_measurements() {
    // x(k+1) = F x + K e, y = H x + e: once the state is known, each e is, and so the next state. With an F - K H
    // that is stable, the start is forgotten.
    let mut noise = Noise(3);
    let (f, h) = (stable::<3>(&mut noise, 0.9), random::<2, 3>(&mut noise));
    let mut gain: SMatrix<f64, 3, 2> = random(&mut noise);
    while crate::textbook::spectral_radius(&(f - gain * h)) > 0.8 {
        gain = random(&mut noise);
    }
    let r = random_covariance::<2>(&mut noise);
    let noise_covariance = covariance::<f64, 2>(&r).transformed(&gain).unwrap();
    let model = LinearTransition::new(f, noise_covariance).unwrap();
    let sensor = observation(&h, &r);
    let cross = gain * r;
    let mut known: Filter<3> = filter(&SVector::zeros(), &Square::zeros());
    let mut unknown: Filter<3> = filter(&SVector::from_element(3.0), &(10.0 * Square::identity()));
    let mut state = SVector::<f64, 3>::zeros();
    for k in 0..200 {
        let error: Vector2<f64> = random(&mut noise);
        let y = h * state + error;
        for filter in [&mut known, &mut unknown] {
            let innovation = filter.correct(&sensor, &NONE, &y).unwrap();
            filter.predict_correlated(&model, &sensor, &cross, &NONE, &y).unwrap();
            assert!(k < 150 || (innovation.error - error).amax() < 1e-12);
        }
        state = f * state + gain * error;
        assert!((known.state() - state).amax() < 1e-12);
        // Q - S R⁻¹ S' is no more than rounding.
        assert!(known.covariance().matrix().amax() < 1e-14);
    }
    assert!((unknown.state() - state).amax() < 1e-12);
    assert!(unknown.covariance().matrix().amax() < 1e-14);
}

#[test]
fn an_exact_element_may_not_go_together_with_the_process() {
    let model = transition(&Matrix2::identity(), &Matrix2::identity());
    let sensor = observation(&Matrix2::identity(), &Matrix2::new(1.0, 0.0, 0.0, 0.0));
    let mut filter: Filter<2> = filter(&Vector2::zeros(), &Matrix2::identity());
    let y = Vector2::new(1.0, 1.0);
    let fine = Matrix2::new(0.5, 0.0, 0.5, 0.0);
    assert_eq!(filter.predict_correlated(&model, &sensor, &fine, &NONE, &y), Ok(()));
    let before = filter.clone();
    let wrong = Matrix2::new(0.5, 0.1, 0.5, 0.0);
    let error = filter.predict_correlated(&model, &sensor, &wrong, &NONE, &y).unwrap_err();
    assert!(matches!(error, Error::NotPositive { index: 1, .. }), "{error}");
    assert_eq!(filter, before);
    // But it may be missing.
    assert_eq!(
        filter.predict_correlated(&model, &sensor, &wrong, &NONE, &Vector2::new(1.0, f64::NAN)),
        Ok(())
    );
}

#[test]
fn what_is_impossible_is_an_error_and_changes_nothing() {
    let one = Vector1::new(1.0);
    let (model, sensor) = (transition(&one, &one), observation(&one, &one));
    let mut filter: Filter<1> = filter(&one, &one);
    let before = filter.clone();
    let mut predict = |cross: f64, y: f64| {
        filter.predict_correlated(&model, &sensor, &Vector1::new(cross), &NONE, &Vector1::new(y))
    };
    // |cov(w, v)| is at most 1 where both variances are.
    let argument = "process noise given the measurement";
    assert_eq!(predict(1.0 + 1e-12, 1.0), Err(Error::NotPositive { argument, index: 0 }));
    assert_eq!(predict(-2.0, 1.0), Err(Error::NotPositive { argument, index: 0 }));
    assert_eq!(predict(f64::NAN, 1.0), Err(Error::NotFinite { argument: "cross_covariance" }));
    assert_eq!(predict(0.5, f64::INFINITY), Err(Error::Infinite { argument: "measurement" }));
    assert_eq!(predict(0.5, f64::MAX), Ok(()));
    filter.clone_from(&before);
    let huge = LinearObservation::new(Vector1::new(1e200), covariance(&Vector1::new(1e-200))).unwrap();
    let y = Vector1::new(1e200);
    let large = LinearTransition::new(one, covariance(&Vector1::new(1e200))).unwrap();
    let error = filter.predict_correlated(&large, &huge, &Vector1::new(0.9), &NONE, &y);
    assert_eq!(error, Err(Error::Overflow));
    assert_eq!(filter, before);

    let with_input = LinearTransition::new(one, Covariance::zero(Const)).unwrap().with_input(one).unwrap();
    let with_feedthrough = LinearObservation::new(one, covariance(&one)).unwrap().with_input(one).unwrap();
    let mut filter: KalmanFilter<f64, Const<1>> = before.clone();
    let input = Vector1::new(f64::NAN);
    let error = filter.predict_correlated(&with_input, &with_feedthrough, &Vector1::zeros(), &input, &one);
    assert_eq!(error, Err(Error::NotFinite { argument: "input" }));
    assert_eq!(filter, before);
}
