//! The filter on random models, beside the textbook's formulas.

use nalgebra::{Const, Matrix3, SMatrix, SVector, Vector3};

use super::{Filter, NONE, covariance, difference, filter, observation, transition};
use crate::noise::Noise;
use crate::textbook::{Square, Textbook, random, random_covariance, stable};
use crate::{Action, Covariance, LinearObservation, LinearTransition, ud};

/// Replaces the missing elements of a measurement by such as say nothing: y = 0 = 0 x + v, var v = 1.
pub(super) fn without<const M: usize, const N: usize>(
    missing: usize,
    h: &SMatrix<f64, M, N>,
    r: &Square<M>,
    y: &SVector<f64, M>,
) -> (SMatrix<f64, M, N>, Square<M>, SVector<f64, M>) {
    let (mut h, mut r, mut y) = (*h, *r, *y);
    for index in (0..M).filter(|index| missing >> index & 1 == 1) {
        h.row_mut(index).fill(0.0);
        r.row_mut(index).fill(0.0);
        r.column_mut(index).fill(0.0);
        r[(index, index)] = 1.0;
        y[index] = 0.0;
    }
    (h, r, y)
}

/// The same measurement with NaN where an element is missing.
pub(super) fn masked<const M: usize>(missing: usize, y: &SVector<f64, M>) -> SVector<f64, M> {
    SVector::from_fn(|index, _| if missing >> index & 1 == 1 { f64::NAN } else { y[index] })
}

fn check_random_models<const N: usize, const M: usize>(noise: &mut Noise, correlated: bool) {
    for _ in 0..10 {
        let (f, h) = (stable::<N>(noise, 0.98), random::<M, N>(noise));
        let q = random_covariance::<N>(noise);
        let mut r = random_covariance::<M>(noise);
        if !correlated {
            r = Square::from_diagonal(&r.diagonal());
        }
        let g: SMatrix<f64, N, 2> = random(noise);
        let d: SMatrix<f64, M, 2> = random(noise);
        let model = LinearTransition::new(f, covariance(&q)).unwrap().with_input(g).unwrap();
        let sensor = LinearObservation::new(h, covariance(&r)).unwrap().with_input(d).unwrap();
        let mut textbook = Textbook { x: random(noise), p: random_covariance(noise) };
        let mut filter: Filter<N> = filter(&textbook.x, &textbook.p);
        for k in 0..30 {
            let (u, y): (SVector<f64, 2>, SVector<f64, M>) = (random(noise), random(noise));
            filter.predict(&model, &u).unwrap();
            textbook.predict(&f, &(g * u), &q);
            assert!((filter.state() - textbook.x).amax() < 1e-12);

            let missing = if k % 3 == 0 { 0 } else { k * 7 % (1 << M) };
            let error = y - h * textbook.x - d * u;
            let (h, r, seen) = without(missing, &h, &r, &(y - d * u));
            let (s, log_likelihood) = textbook.correct(&h, &r, &seen);
            if missing == 0 {
                let found = filter.innovation_covariance(&sensor).unwrap().matrix();
                assert!(difference(&found, &s) < 1e-12);
            }
            let innovation = filter.correct(&sensor, &u, &masked(missing, &y)).unwrap();
            let measured = M - missing.count_ones() as usize;
            let silent = 0.5 * (M - measured) as f64 * core::f64::consts::TAU.ln();
            assert!((innovation.log_likelihood() - log_likelihood - silent).abs() < 1e-11);
            let action = if measured == 0 { Action::Missing } else { Action::Updated };
            assert_eq!(innovation.action, action);
            let determinant: f64 = innovation.variance.iter().filter(|variance| !variance.is_nan()).product();
            assert!((determinant / crate::textbook::determinant(&s) - 1.0).abs() < 1e-11);
            for index in 0..M {
                let is_missing = missing >> index & 1 == 1;
                assert_eq!(innovation.variance[index].is_nan(), is_missing);
                assert_eq!(innovation.error[index].is_nan(), is_missing);
                assert!(is_missing || (innovation.error[index] - error[index]).abs() < 1e-12);
            }
            assert!((filter.state() - textbook.x).amax() < 1e-11);
            assert!(difference(&filter.covariance().matrix(), &textbook.p) < 1e-11);
        }
    }
}

#[test]
fn random_models() {
    let mut noise = Noise(1);
    for correlated in [false, true] {
        check_random_models::<1, 1>(&mut noise, correlated);
        check_random_models::<2, 3>(&mut noise, correlated);
        check_random_models::<4, 2>(&mut noise, correlated);
        check_random_models::<6, 3>(&mut noise, correlated);
        check_random_models::<9, 4>(&mut noise, correlated);
    }
}

#[test]
fn the_variance_of_an_element_is_that_given_the_elements_after_it() {
    let mut noise = Noise(2);
    let (h, r) = (random::<3, 4>(&mut noise), random_covariance::<3>(&mut noise));
    let mut filter: Filter<4> = filter(&SVector::zeros(), &random_covariance(&mut noise));
    let s = filter.innovation_covariance(&observation(&h, &r)).unwrap();
    let innovation = filter.correct(&observation(&h, &r), &NONE, &SVector::zeros()).unwrap();
    for index in 0..3 {
        let expected = ud::variance(s.as_slice(), 3, index);
        assert!((innovation.variance[index] - expected).abs() < 1e-13 * expected);
    }
}

#[test]
fn the_order_of_uncorrelated_elements_does_not_matter() {
    let mut noise = Noise(3);
    let (f, q) = (stable::<5>(&mut noise, 0.95), random_covariance::<5>(&mut noise));
    let h: SMatrix<f64, 3, 5> = random(&mut noise);
    let r = Vector3::new(0.1, 1.0, 10.0);
    let start: Filter<5> = filter(&random(&mut noise), &random_covariance(&mut noise));
    let mut filters = [start.clone(), start.clone(), start.clone(), start];
    for _ in 0..50 {
        let y: Vector3<f64> = random(&mut noise);
        for (filter, order) in filters.iter_mut().zip([[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1]]) {
            filter.predict(&transition(&f, &q), &NONE).unwrap();
            let h = SMatrix::from_fn(|i, j| h[(order[i], j)]);
            let r = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| r[order[i]]));
            let y = Vector3::from_fn(|i, _| y[order[i]]);
            filter.correct(&observation(&h, &r), &NONE, &y).unwrap();
        }
        // And one by one, as three sensors.
        let mut alone = filters[0].clone();
        alone.predict(&transition(&f, &q), &NONE).unwrap();
        let mut together = alone.clone();
        for index in 0..3 {
            let row = h.row(index).into_owned();
            let sensor = observation(&row, &SVector::<f64, 1>::new(r[index]));
            alone.correct(&sensor, &NONE, &SVector::<f64, 1>::new(y[index])).unwrap();
        }
        together.correct(&observation(&h, &Matrix3::from_diagonal(&r)), &NONE, &y).unwrap();
        for (one, other) in [(&filters[0], &filters[1]), (&filters[0], &filters[2]), (&alone, &together)] {
            assert!((one.state() - other.state()).amax() < 1e-12);
            assert!((one.covariance().matrix() - other.covariance().matrix()).amax() < 1e-12);
        }
    }
}

#[test]
fn the_normalised_innovation_squared_has_the_mean_it_must_have() {
    // A state of three numbers that are made, and seen, as the model says: each nis is 2 on average.
    let mut noise = Noise(4);
    let (f, h) = (stable::<3>(&mut noise, 0.9), random::<2, 3>(&mut noise));
    let (root_q, root_r): (Square<3>, Square<2>) = (random(&mut noise), random(&mut noise));
    // Uniform in -1 … 1 has variance 1/3.
    let (q, r) = (root_q * root_q.transpose() / 3.0, root_r * root_r.transpose() / 3.0);
    let (model, sensor) = (transition(&f, &q), observation(&h, &r));
    let mut state = SVector::<f64, 3>::zeros();
    let mut filter: Filter<3> = filter(&state, &Square::zeros());
    let (mut sum, steps) = (0.0, 4000);
    for _ in 0..steps {
        state = f * state + root_q * random::<3, 1>(&mut noise);
        filter.predict(&model, &NONE).unwrap();
        let y = h * state + root_r * random::<2, 1>(&mut noise);
        sum += filter.correct(&sensor, &NONE, &y).unwrap().nis;
    }
    // Its standard deviation is below 2, that of the mean below 0.032: three times that.
    let mean = sum / f64::from(steps);
    assert!((mean - 2.0).abs() < 0.1, "{mean}");
}

#[test]
fn certain_states_and_states_without_noise_are_fine() {
    let mut noise = Noise(5);
    let (f, h) = (random::<3, 3>(&mut noise), random::<2, 3>(&mut noise));
    let model = LinearTransition::new(f, Covariance::zero(Const)).unwrap();
    let sensor = observation(&h, &Square::identity());
    let mut filter: Filter<3> = filter(&random(&mut noise), &Square::zeros());
    let mut expected = *filter.state();
    for _ in 0..20 {
        filter.predict(&model, &NONE).unwrap();
        filter.correct(&sensor, &NONE, &random(&mut noise)).unwrap();
        expected = f * expected;
        assert!((filter.state() - expected).amax() < 1e-14);
        assert_eq!(filter.covariance(), &Covariance::zero(Const));
    }
}
