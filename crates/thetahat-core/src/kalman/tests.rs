mod correlated;
mod definiteness;
mod interface;
mod reference;
mod textbook;

use nalgebra::{Const, SMatrix, SVector};

use crate::textbook::Square;
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

/// The largest difference of two covariance matrices, beside the variances of the two elements.
fn difference<const N: usize>(a: &Square<N>, b: &Square<N>) -> f64 {
    let share = |i: usize, j: usize| {
        let change = (a[(i, j)] - b[(i, j)]).abs();
        if change == 0.0 { 0.0 } else { change / (b[(i, i)] * b[(j, j)]).sqrt() }
    };
    (0..N * N).map(|k| share(k / N, k % N)).fold(0.0, f64::max)
}
