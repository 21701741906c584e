//! The list of Kalman filters, and those of other crates, each used as its documentation shows.

use std::convert::Infallible;
use std::marker::PhantomData;

use adskalman::{
    CovarianceUpdateMethod, KalmanFilterNoControl, ObservationModel, StateAndCovariance,
    TransitionModelLinearNoControl,
};
use kfilter::kalman::{KalmanFilter as _, KalmanLinearNoInput, KalmanPredict, KalmanUpdate, KfError};
use kfilter::measurement::{LinearMeasurement, Measurement};
use minikalman::matrix::MatrixDataType;
use minikalman::prelude::*;
use minikalman::regular::builder::{KalmanFilterBuilder, KalmanFilterObservationType, KalmanFilterType};
use multicalc::error::EstimationError;
use multicalc::estimation::{CovarianceUpdate, KalmanFilter, KalmanModel};
use multicalc::linear_algebra::{Matrix, Vector};
use multicalc::scalar::Numeric;
use nalgebra::{Const, DimMin, RealField, SMatrix, SVector};
use nalgebra_kfilter as na34;
use thetahat_core::Real;

use crate::data::Model;
use crate::kalman::{Kalman, rows};
use crate::nalgebra_form::{PlainKalman, matrix};
use crate::ours::OurKalman;

/// Numbers that every crate here takes.
pub(crate) trait Number:
    RealField + Real + na34::RealField + MatrixDataType + Numeric + Default + Into<f64> + Copy
{
}

impl Number for f32 {}
impl Number for f64 {}

/// Something to be done with every filter.
pub(crate) trait Visit<T, const N: usize, const M: usize> {
    /// Does it with one.
    fn visit<K: Kalman<T, N, M>>(&mut self);
}

/// Does it with every filter.
pub(crate) fn visit_all<T: Number, const N: usize, const M: usize>(visitor: &mut impl Visit<T, N, M>)
where
    Const<M>: DimMin<Const<M>, Output = Const<M>>,
{
    visitor.visit::<OurKalman<T, N, M>>();
    visitor.visit::<Adskalman<T, N, M, Joseph>>();
    visitor.visit::<Adskalman<T, N, M, Symmetrised>>();
    visitor.visit::<Adskalman<T, N, M, Plain>>();
    visitor.visit::<Kfilter<T, N, M>>();
    visitor.visit::<Minikalman<T, N, M>>();
    visitor.visit::<Multicalc<T, N, M, Joseph>>();
    visitor.visit::<Multicalc<T, N, M, Plain>>();
    visitor.visit::<PlainKalman<T, N, M, false>>();
    visitor.visit::<PlainKalman<T, N, M, true>>();
}

/// The covariance update (I - K H) P (I - K H)' + K R K'.
pub(crate) struct Joseph;

/// The covariance update (I - K H) P, then its symmetric part.
pub(crate) struct Symmetrised;

/// The covariance update (I - K H) P.
pub(crate) struct Plain;

/// The covariance updates of adskalman.
pub(crate) trait AdskalmanMethod {
    const NAME: &'static str;
    const METHOD: CovarianceUpdateMethod;
}

impl AdskalmanMethod for Joseph {
    const NAME: &'static str = "adskalman, Joseph";
    const METHOD: CovarianceUpdateMethod = CovarianceUpdateMethod::JosephForm;
}

impl AdskalmanMethod for Symmetrised {
    const NAME: &'static str = "adskalman, symmetrised";
    const METHOD: CovarianceUpdateMethod = CovarianceUpdateMethod::OptimalKalmanForcedSymmetric;
}

impl AdskalmanMethod for Plain {
    const NAME: &'static str = "adskalman, plain";
    const METHOD: CovarianceUpdateMethod = CovarianceUpdateMethod::OptimalKalman;
}

/// adskalman's models and estimate. Its filter type only refers to the models.
pub(crate) struct Adskalman<T: RealField, const N: usize, const M: usize, C> {
    transition: AdskalmanTransition<T, N>,
    observation: AdskalmanObservation<T, N, M>,
    estimate: StateAndCovariance<T, Const<N>>,
    method: PhantomData<C>,
}

struct AdskalmanTransition<T, const N: usize> {
    f: SMatrix<T, N, N>,
    f_transposed: SMatrix<T, N, N>,
    q: SMatrix<T, N, N>,
}

impl<T: RealField, const N: usize> TransitionModelLinearNoControl<T, Const<N>> for AdskalmanTransition<T, N> {
    fn F(&self) -> &SMatrix<T, N, N> {
        &self.f
    }

    fn FT(&self) -> &SMatrix<T, N, N> {
        &self.f_transposed
    }

    fn Q(&self) -> &SMatrix<T, N, N> {
        &self.q
    }
}

struct AdskalmanObservation<T, const N: usize, const M: usize> {
    h: SMatrix<T, M, N>,
    h_transposed: SMatrix<T, N, M>,
    r: SMatrix<T, M, M>,
}

impl<T: RealField, const N: usize, const M: usize> ObservationModel<T, Const<N>, Const<M>>
    for AdskalmanObservation<T, N, M>
where
    Const<M>: DimMin<Const<M>, Output = Const<M>>,
{
    fn H(&self) -> &SMatrix<T, M, N> {
        &self.h
    }

    fn HT(&self) -> &SMatrix<T, N, M> {
        &self.h_transposed
    }

    fn R(&self) -> &SMatrix<T, M, M> {
        &self.r
    }
}

impl<T: RealField + Into<f64> + Copy, const N: usize, const M: usize, C: AdskalmanMethod> Kalman<T, N, M>
    for Adskalman<T, N, M, C>
where
    Const<M>: DimMin<Const<M>, Output = Const<M>>,
{
    const NAME: &'static str = C::NAME;
    type Error = adskalman::Error;

    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error> {
        let (f, h) = (matrix(&model.f), matrix(&model.h));
        Ok(Self {
            transition: AdskalmanTransition { f, f_transposed: f.transpose(), q: matrix(&model.q) },
            observation: AdskalmanObservation { h, h_transposed: h.transpose(), r: matrix(&model.r) },
            estimate: StateAndCovariance::new(SVector::zeros(), matrix(&model.p)),
            method: PhantomData,
        })
    }

    fn predict(&mut self) -> Result<(), Self::Error> {
        self.estimate = self.transition.predict(&self.estimate);
        Ok(())
    }

    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        let measurement = SVector::from(*measurement);
        self.estimate = self.observation.update(&self.estimate, &measurement, C::METHOD)?;
        Ok(())
    }

    fn step(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        let filter = KalmanFilterNoControl::new(&self.transition, &self.observation);
        self.estimate = filter.step_with_options(&self.estimate, &SVector::from(*measurement), C::METHOD)?;
        Ok(())
    }

    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error> {
        self.observation.h = matrix(h);
        self.observation.h_transposed = self.observation.h.transpose();
        Ok(())
    }

    fn state(&self) -> [T; N] {
        (*self.estimate.state()).into()
    }

    fn covariance(&self) -> [[f64; N]; N] {
        let p = self.estimate.covariance();
        rows(|i, j| p[(i, j)])
    }
}

/// kfilter's filter and its measurement.
pub(crate) struct Kfilter<T: na34::RealField, const N: usize, const M: usize> {
    filter: KalmanLinearNoInput<T, N>,
    measurement: LinearMeasurement<T, N, M>,
}

/// A matrix of kfilter's nalgebra from rows.
pub(crate) fn matrix34<T: na34::RealField + Copy, const R: usize, const C: usize>(
    rows: &[[T; C]; R],
) -> na34::SMatrix<T, R, C> {
    na34::SMatrix::from_fn(|i, j| rows[i][j])
}

impl<T: na34::RealField + Into<f64> + Copy, const N: usize, const M: usize> Kalman<T, N, M>
    for Kfilter<T, N, M>
{
    const NAME: &'static str = "kfilter";
    type Error = KfError;

    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error> {
        let (f, q, p) = (matrix34(&model.f), matrix34(&model.q), matrix34(&model.p));
        let (h, r) = (matrix34(&model.h), matrix34(&model.r));
        Ok(Self {
            filter: KalmanLinearNoInput::new(f, q, na34::SVector::zeros(), p),
            measurement: LinearMeasurement::new(h, r, na34::SVector::zeros()),
        })
    }

    fn predict(&mut self) -> Result<(), Self::Error> {
        self.filter.predict()?;
        Ok(())
    }

    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        self.measurement.set_measurement(na34::SVector::from(*measurement));
        self.filter.update(&self.measurement)?;
        Ok(())
    }

    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error> {
        self.measurement = LinearMeasurement::new(matrix34(h), self.measurement.R, self.measurement.z);
        Ok(())
    }

    fn state(&self) -> [T; N] {
        (*self.filter.state()).into()
    }

    fn covariance(&self) -> [[f64; N]; N] {
        let p = self.filter.covariance();
        rows(|i, j| p[(i, j)])
    }
}

/// minikalman's filter and its observation, in buffers of their own.
pub(crate) struct Minikalman<T, const N: usize, const M: usize> {
    filter: KalmanFilterType<N, T>,
    observation: KalmanFilterObservationType<N, M, T>,
}

/// Writes rows into a matrix of minikalman.
fn fill<T: Copy, const R: usize, const C: usize>(matrix: &mut impl MatrixMut<R, C, T>, rows: &[[T; C]; R]) {
    for (i, row) in rows.iter().enumerate() {
        for (j, &element) in row.iter().enumerate() {
            matrix.set_at(i, j, element);
        }
    }
}

impl<T: MatrixDataType + Default + Into<f64>, const N: usize, const M: usize> Kalman<T, N, M>
    for Minikalman<T, N, M>
{
    const NAME: &'static str = "minikalman";
    type Error = Infallible;

    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error> {
        let builder = KalmanFilterBuilder::<N, T>::default();
        let (mut filter, mut observation) = (builder.build(), builder.observations().build::<M>());
        fill(filter.state_transition_mut().as_matrix_mut(), &model.f);
        fill(filter.direct_process_noise_mut().as_matrix_mut(), &model.q);
        fill(filter.estimate_covariance_mut().as_matrix_mut(), &model.p);
        fill(observation.observation_matrix_mut().as_matrix_mut(), &model.h);
        fill(observation.measurement_noise_covariance_mut().as_matrix_mut(), &model.r);
        Ok(Self { filter, observation })
    }

    fn predict(&mut self) -> Result<(), Self::Error> {
        self.filter.predict();
        Ok(())
    }

    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        let vector = self.observation.measurement_vector_mut().as_matrix_mut();
        for (i, &element) in measurement.iter().enumerate() {
            vector.set_at(i, 0, element);
        }
        self.filter.correct(&mut self.observation);
        Ok(())
    }

    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error> {
        fill(self.observation.observation_matrix_mut().as_matrix_mut(), h);
        Ok(())
    }

    fn state(&self) -> [T; N] {
        let x = self.filter.state_vector().as_matrix();
        std::array::from_fn(|i| x.get_at(i, 0))
    }

    fn covariance(&self) -> [[f64; N]; N] {
        let p = self.filter.estimate_covariance().as_matrix();
        rows(|i, j| p.get_at(i, j))
    }
}

/// The covariance updates of multicalc.
pub(crate) trait MulticalcMethod {
    const NAME: &'static str;
    const METHOD: CovarianceUpdate;
}

impl MulticalcMethod for Joseph {
    const NAME: &'static str = "multicalc, Joseph";
    const METHOD: CovarianceUpdate = CovarianceUpdate::Joseph;
}

impl MulticalcMethod for Plain {
    const NAME: &'static str = "multicalc, plain";
    const METHOD: CovarianceUpdate = CovarianceUpdate::Naive;
}

/// multicalc's filter.
pub(crate) struct Multicalc<T, const N: usize, const M: usize, C> {
    filter: KalmanFilter<N, M, T>,
    method: PhantomData<C>,
}

impl<T: Numeric + Into<f64>, const N: usize, const M: usize, C: MulticalcMethod> Kalman<T, N, M>
    for Multicalc<T, N, M, C>
{
    const NAME: &'static str = C::NAME;
    type Error = EstimationError;

    fn new(model: &Model<T, N, M>) -> Result<Self, Self::Error> {
        let parts = KalmanModel {
            state_transition: Matrix::new(model.f),
            measurement_model: Matrix::new(model.h),
            process_noise: Matrix::new(model.q),
            measurement_noise: Matrix::new(model.r),
        };
        let filter = KalmanFilter::new(Vector::zeros(), Matrix::new(model.p), parts);
        Ok(Self { filter: filter.with_covariance_update(C::METHOD), method: PhantomData })
    }

    fn predict(&mut self) -> Result<(), Self::Error> {
        self.filter.predict();
        Ok(())
    }

    fn correct(&mut self, measurement: &[T; M]) -> Result<(), Self::Error> {
        self.filter.update(Vector::new(*measurement))
    }

    fn observe(&mut self, h: &[[T; N]; M]) -> Result<(), Self::Error> {
        self.filter.set_measurement_model(Matrix::new(*h));
        Ok(())
    }

    fn state(&self) -> [T; N] {
        let x = self.filter.state();
        std::array::from_fn(|i| x[i])
    }

    fn covariance(&self) -> [[f64; N]; N] {
        let p = self.filter.covariance();
        rows(|i, j| p[(i, j)])
    }
}
