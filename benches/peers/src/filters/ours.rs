//! thetahat-core's side.

use nalgebra::{Const, SMatrix, SVector};
use thetahat_core::{
    Covariance, Error, Forgetting, KalmanFilter, LinearObservation, LinearTransition, Real,
    RecursiveLeastSquares,
};

use crate::data::{FORGETTING, Model};
use crate::kalman::{Kalman, rows};
use crate::nalgebra_form::{LeastSquares, matrix};

/// The Kalman filter and its models.
pub(crate) struct OurKalman<T: Real, const N: usize, const M: usize> {
    filter: KalmanFilter<T, Const<N>>,
    transition: LinearTransition<T, Const<N>>,
    observation: LinearObservation<T, Const<N>, Const<M>>,
    noise: Covariance<T, Const<M>>,
}

impl<T: Real + Into<f64>, const N: usize, const M: usize> Kalman<T, N, M> for OurKalman<T, N, M> {
    const NAME: &'static str = "thetahat";
    type Error = Error;

    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error> {
        let noise = Covariance::new(&matrix(&model.r))?;
        Ok(Self {
            filter: KalmanFilter::new(SVector::zeros(), Covariance::new(&matrix(&model.p))?)?,
            transition: LinearTransition::new(matrix(&model.f), Covariance::new(&matrix(&model.q))?)?,
            observation: LinearObservation::new(matrix(&model.h), noise.clone())?,
            noise,
        })
    }

    fn predict(&mut self) -> Result<(), Self::Error> {
        self.filter.predict(&self.transition, &SVector::zeros())
    }

    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        self.filter.correct(&self.observation, &SVector::zeros(), &SVector::from(*measurement))?;
        Ok(())
    }

    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error> {
        self.observation = LinearObservation::new(matrix(h), self.noise.clone())?;
        Ok(())
    }

    fn state(&self) -> [T; N] {
        (*self.filter.state()).into()
    }

    // The product of the factors, which are what the filter keeps.
    fn covariance(&self) -> [[f64; N]; N] {
        let factor = self.filter.covariance().factor().map(Into::<f64>::into);
        let mut u = factor;
        u.fill_diagonal(1.0);
        let p = u * SMatrix::from_diagonal(&factor.diagonal()) * u.transpose();
        rows(|i, j| p[(i, j)])
    }
}

/// Recursive least squares. Regressors of scale 1 give the prior of the others.
pub(crate) struct OurLeastSquares<const N: usize>(RecursiveLeastSquares<f64, Const<N>>);

impl<const N: usize> LeastSquares<N> for OurLeastSquares<N> {
    const NAME: &'static str = "thetahat";
    type Error = Error;

    fn new() -> Result<Self, Self::Error> {
        let forgetting = Forgetting::Exponential { factor: FORGETTING };
        RecursiveLeastSquares::new(&SVector::repeat(1.0), forgetting).map(Self)
    }

    fn update(&mut self, regressor: &SVector<f64, N>, target: f64) -> Result<(), Self::Error> {
        self.0.update(regressor, target)?;
        Ok(())
    }

    fn parameters(&self) -> &SVector<f64, N> {
        self.0.parameters()
    }
}
