//! The textbook's covariance forms, as one writes them with nalgebra.

use std::convert::Infallible;
use std::fmt::Debug;

use nalgebra::{RealField, SMatrix, SVector};

use crate::data::{FORGETTING, Model, PRIOR};
use crate::kalman::{Kalman, rows};

/// A matrix of nalgebra from rows.
pub(crate) fn matrix<T: RealField + Copy, const R: usize, const C: usize>(
    rows: &[[T; C]; R],
) -> SMatrix<T, R, C> {
    SMatrix::from_fn(|i, j| rows[i][j])
}

/// A Kalman filter with P - K H P. If `ONCE`, H P is taken as the transpose of P H', which is there already.
pub(crate) struct PlainKalman<T, const N: usize, const M: usize, const ONCE: bool> {
    f: SMatrix<T, N, N>,
    q: SMatrix<T, N, N>,
    h: SMatrix<T, M, N>,
    r: SMatrix<T, M, M>,
    x: SVector<T, N>,
    p: SMatrix<T, N, N>,
}

impl<T: RealField + Copy + Into<f64>, const N: usize, const M: usize, const ONCE: bool> Kalman<T, N, M>
    for PlainKalman<T, N, M, ONCE>
{
    const NAME: &'static str = if ONCE { "plain nalgebra, P H' once" } else { "plain nalgebra" };
    type Error = &'static str;

    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error> {
        Ok(Self {
            f: matrix(&model.f),
            q: matrix(&model.q),
            h: matrix(&model.h),
            r: matrix(&model.r),
            x: SVector::zeros(),
            p: matrix(&model.p),
        })
    }

    fn predict(&mut self) -> Result<(), Self::Error> {
        self.x = self.f * self.x;
        self.p = self.f * self.p * self.f.transpose() + self.q;
        Ok(())
    }

    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        let p_ht = self.p * self.h.transpose();
        let s = self.h * p_ht + self.r;
        let gain = p_ht * s.cholesky().ok_or("the innovation covariance is not positive definite")?.inverse();
        self.x += gain * (SVector::from(*measurement) - self.h * self.x);
        self.p -= gain * if ONCE { p_ht.transpose() } else { self.h * self.p };
        Ok(())
    }

    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error> {
        self.h = matrix(h);
        Ok(())
    }

    fn state(&self) -> [T; N] {
        self.x.into()
    }

    fn covariance(&self) -> [[f64; N]; N] {
        rows(|i, j| self.p[(i, j)])
    }
}

/// One way to do recursive least squares with exponential forgetting.
pub(crate) trait LeastSquares<const N: usize>: Sized {
    /// What the table calls it.
    const NAME: &'static str;

    /// What it may answer instead of going on.
    type Error: Debug;

    /// With parameters 0 and covariance `PRIOR` I.
    fn new() -> Result<Self, Self::Error>;

    /// Takes a sample.
    fn update(&mut self, regressor: &SVector<f64, N>, target: f64) -> Result<(), Self::Error>;

    /// The estimate.
    fn parameters(&self) -> &SVector<f64, N>;
}

/// The textbook's expressions: k = P phi / (lambda + phi' P phi), P = (P - k phi' P) / lambda, with P phi
/// computed once.
///
/// The product is grouped so that it is exactly symmetric. As `gain * p_phi.transpose()` it is not quite, the
/// division by lambda magnifies the difference at every step, and after some 4,000 steps the estimate is
/// lost.
pub(crate) struct PlainLeastSquares<const N: usize> {
    theta: SVector<f64, N>,
    p: SMatrix<f64, N, N>,
}

impl<const N: usize> LeastSquares<N> for PlainLeastSquares<N> {
    const NAME: &'static str = "plain nalgebra";
    type Error = Infallible;

    fn new() -> Result<Self, Self::Error> {
        Ok(Self { theta: SVector::zeros(), p: SMatrix::identity() * PRIOR })
    }

    fn update(&mut self, regressor: &SVector<f64, N>, target: f64) -> Result<(), Self::Error> {
        let p_phi = self.p * regressor;
        let inverse = 1.0 / (FORGETTING + regressor.dot(&p_phi));
        self.theta += p_phi * (inverse * (target - regressor.dot(&self.theta)));
        self.p -= p_phi * p_phi.transpose() * inverse;
        self.p /= FORGETTING;
        Ok(())
    }

    fn parameters(&self) -> &SVector<f64, N> {
        &self.theta
    }
}

/// The same in place and by one triangle: the fastest form we found.
pub(crate) struct InPlaceLeastSquares<const N: usize>(PlainLeastSquares<N>);

impl<const N: usize> LeastSquares<N> for InPlaceLeastSquares<N> {
    const NAME: &'static str = "plain nalgebra, in place";
    type Error = Infallible;

    fn new() -> Result<Self, Self::Error> {
        PlainLeastSquares::new().map(Self)
    }

    fn update(&mut self, regressor: &SVector<f64, N>, target: f64) -> Result<(), Self::Error> {
        let PlainLeastSquares { theta, p } = &mut self.0;
        let p_phi = *p * regressor;
        let inverse = 1.0 / (FORGETTING + regressor.dot(&p_phi));
        theta.axpy(inverse * (target - regressor.dot(theta)), &p_phi, 1.0);
        p.syger(-inverse / FORGETTING, &p_phi, &p_phi, 1.0 / FORGETTING);
        p.fill_upper_triangle_with_lower_triangle();
        Ok(())
    }

    fn parameters(&self) -> &SVector<f64, N> {
        &self.0.theta
    }
}
