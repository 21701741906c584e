//! For tests: the Kalman filter as textbooks print it, in `f64`, and random systems to run it on.

use nalgebra::{SMatrix, SVector};

use crate::noise::Noise;

pub(crate) type Square<const N: usize> = SMatrix<f64, N, N>;

/// A Kalman filter on a covariance matrix, in Joseph's form.
#[derive(Clone, Debug)]
pub(crate) struct Textbook<const N: usize> {
    pub(crate) x: SVector<f64, N>,
    pub(crate) p: Square<N>,
}

impl<const N: usize> Textbook<N> {
    /// x <- F x + b, P <- F P F' + Q.
    pub(crate) fn predict(&mut self, f: &Square<N>, b: &SVector<f64, N>, q: &Square<N>) {
        self.x = f * self.x + b;
        self.p = f * self.p * f.transpose() + q;
    }

    /// Returns S and the log-likelihood of the measurement.
    pub(crate) fn correct<const M: usize>(
        &mut self,
        h: &SMatrix<f64, M, N>,
        r: &Square<M>,
        y: &SVector<f64, M>,
    ) -> (Square<M>, f64) {
        let e = y - h * self.x;
        let s = h * self.p * h.transpose() + r;
        let inverse = inverse(&s);
        let k = self.p * h.transpose() * inverse;
        let c = Square::identity() - k * h;
        self.x += k * e;
        self.p = c * self.p * c.transpose() + k * r * k.transpose();
        let exponent = (e.transpose() * inverse * e).sum();
        (s, -0.5 * (M as f64 * core::f64::consts::TAU.ln() + determinant(&s).ln() + exponent))
    }
}

/// By Gauss-Jordan elimination with pivots from the diagonal, as for positive definite matrices; beside it the
/// determinant.
fn eliminate<const N: usize>(matrix: &Square<N>) -> (Square<N>, f64) {
    let (mut a, mut inverse, mut determinant) = (*matrix, Square::identity(), 1.0);
    for k in 0..N {
        let pivot = a[(k, k)];
        determinant *= pivot;
        for j in 0..N {
            a[(k, j)] /= pivot;
            inverse[(k, j)] /= pivot;
        }
        for i in (0..N).filter(|&i| i != k) {
            let factor = a[(i, k)];
            for j in 0..N {
                a[(i, j)] -= factor * a[(k, j)];
                inverse[(i, j)] -= factor * inverse[(k, j)];
            }
        }
    }
    (inverse, determinant)
}

pub(crate) fn inverse<const N: usize>(matrix: &Square<N>) -> Square<N> {
    eliminate(matrix).0
}

pub(crate) fn determinant<const N: usize>(matrix: &Square<N>) -> f64 {
    eliminate(matrix).1
}

/// A matrix of numbers between -1 and 1.
pub(crate) fn random<const R: usize, const C: usize>(noise: &mut Noise) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| noise.next())
}

/// A random covariance matrix, of condition number about 10 N².
pub(crate) fn random_covariance<const N: usize>(noise: &mut Noise) -> Square<N> {
    let root: Square<N> = random(noise);
    root * root.transpose() + 0.1 * Square::identity()
}

/// The largest difference of two covariance matrices, beside the variances of the two elements.
pub(crate) fn difference<const N: usize>(a: &Square<N>, b: &Square<N>) -> f64 {
    let share = |i: usize, j: usize| {
        let change = (a[(i, j)] - b[(i, j)]).abs();
        if change == 0.0 { 0.0 } else { change / (b[(i, i)] * b[(j, j)]).sqrt() }
    };
    (0..N * N).map(|k| share(k / N, k % N)).fold(0.0, f64::max)
}

/// The largest magnitude of an eigenvalue.
pub(crate) fn spectral_radius<const N: usize>(matrix: &Square<N>) -> f64 {
    let (mut power, mut logarithm, mut exponent) = (*matrix, 0.0, 1.0);
    for _ in 0..12 {
        let norm = power.norm();
        if norm == 0.0 {
            return 0.0;
        }
        power /= norm;
        logarithm += norm.ln() / exponent;
        power = power * power;
        exponent *= 2.0;
    }
    logarithm.exp()
}

/// A random matrix whose eigenvalues lie within a circle of this radius, at least one on it.
pub(crate) fn stable<const N: usize>(noise: &mut Noise, radius: f64) -> Square<N> {
    let matrix: Square<N> = random(noise);
    matrix * (radius / spectral_radius(&matrix))
}
