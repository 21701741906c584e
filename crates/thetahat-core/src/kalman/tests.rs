mod correlated;
mod definiteness;
mod interface;
mod reference;
mod textbook;

use nalgebra::{Const, SMatrix, SVector};

use crate::textbook::{Square, difference};
use crate::{Covariance, KalmanFilter, LinearObservation, LinearTransition, Real};

type Filter<const N: usize> = KalmanFilter<f64, Const<N>>;

/// No inputs.
const NONE: SVector<f64, 0> = SVector::<f64, 0>::from_array_storage(nalgebra::ArrayStorage([[]]));

fn covariance<T: Real, const N: usize>(matrix: &Square<N>) -> Covariance<T, Const<N>> {
    let matrix: SMatrix<T, N, N> = nalgebra::convert(*matrix);
    Covariance::new(&matrix).unwrap()
}

fn transition<T: Real, const N: usize>(f: &Square<N>, q: &Square<N>) -> LinearTransition<T, Const<N>> {
    LinearTransition::new(nalgebra::convert(*f), covariance(q)).unwrap()
}

fn observation<T: Real, const N: usize, const M: usize>(
    h: &SMatrix<f64, M, N>,
    r: &Square<M>,
) -> LinearObservation<T, Const<N>, Const<M>> {
    LinearObservation::new(nalgebra::convert(*h), covariance(r)).unwrap()
}

fn filter<T: Real, const N: usize>(x: &SVector<f64, N>, p: &Square<N>) -> KalmanFilter<T, Const<N>> {
    KalmanFilter::new(nalgebra::convert(*x), covariance(p)).unwrap()
}
