//! Filters of models that are not linear: ours, and those of other crates that have both.

use std::fmt::Debug;

use ::multicalc::linear_algebra::{Matrix, Vector};
use ::multicalc::scalar::{Numeric, VectorFn};
use kfilter::kalman::{Kalman as KfilterKalman, KalmanFilter as _, KalmanPredict, KalmanUpdate};
use kfilter::measurement::{LinearMeasurement, Measurement};
use kfilter::system::{LinearisableSystem, NoInputSystem, System};
use kfilter::ukf::{UKFParameters, UnscentedKalman};
use multicalc::estimation as multicalc;
use nalgebra::{Const, SMatrix, SVector};
use nalgebra_kfilter as na34;
use thetahat_core::{Covariance, ExtendedKalmanFilter, Observation, Transition, UnscentedKalmanFilter};

use crate::Result;
use crate::data::{DT, Model};
use crate::nalgebra_form::matrix;
use crate::peers::{Joseph, MulticalcMethod, Plain, matrix34};

/// A filter of the motion of `Motion`.
pub(crate) trait Nonlinear<const N: usize, const M: usize>: Sized {
    /// What the tables call it.
    const NAME: &'static str;

    /// A filter at state 0 with the model's covariances.
    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self>;

    /// Both updates.
    fn step(&mut self, measurement: &[f64; M]) -> Result<()>;

    /// The estimate.
    fn state(&self) -> [f64; N];
}

/// M positions and M velocities that a drag slows: p(k+1) = p + T v, v(k+1) = v - T c v³. The positions are measured.
#[derive(Clone, Copy)]
struct Motion {
    drag: f64,
}

impl Motion {
    fn next<const N: usize>(self, x: &[f64; N]) -> [f64; N] {
        let axes = N / 2;
        std::array::from_fn(|i| if i < axes { x[i] + DT * x[i + axes] } else { x[i] - self.slowed(x[i]) })
    }

    fn slowed(self, velocity: f64) -> f64 {
        DT * self.drag * velocity * velocity * velocity
    }

    /// Entry i, j of the Jacobian of `next`.
    fn slope<const N: usize>(self, x: &[f64; N], i: usize, j: usize) -> f64 {
        let axes = N / 2;
        match (i == j, i < axes) {
            (true, true) => 1.0,
            (true, false) => 1.0 - 3.0 * DT * self.drag * x[i] * x[i],
            (false, true) if j == i + axes => DT,
            _ => 0.0,
        }
    }
}

/// The motion with its noises, for thetahat-core.
struct Noisy<const N: usize, const M: usize> {
    motion: Motion,
    process: Covariance<f64, Const<N>>,
    measurement: Covariance<f64, Const<M>>,
}

impl<const N: usize, const M: usize> Noisy<N, M> {
    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let (process, measurement) =
            (Covariance::new(&matrix(&model.q))?, Covariance::new(&matrix(&model.r))?);
        Ok(Noisy { motion: Motion { drag }, process, measurement })
    }
}

impl<const N: usize, const M: usize> Transition<f64, Const<N>> for Noisy<N, M> {
    fn next(&self, x: &SVector<f64, N>, _: &SVector<f64, 0>) -> SVector<f64, N> {
        self.motion.next(&(*x).into()).into()
    }

    fn next_jacobian(&self, x: &SVector<f64, N>, _: &SVector<f64, 0>) -> SMatrix<f64, N, N> {
        let x = (*x).into();
        SMatrix::from_fn(|i, j| self.motion.slope::<N>(&x, i, j))
    }

    fn process_noise(&self, _: &SVector<f64, N>, _: &SVector<f64, 0>) -> Covariance<f64, Const<N>> {
        self.process.clone()
    }
}

impl<const N: usize, const M: usize> Observation<f64, Const<N>, Const<M>> for Noisy<N, M> {
    fn output(&self, x: &SVector<f64, N>, _: &SVector<f64, 0>) -> SVector<f64, M> {
        SVector::from_fn(|i, _| x[i])
    }

    fn output_jacobian(&self, _: &SVector<f64, N>, _: &SVector<f64, 0>) -> SMatrix<f64, M, N> {
        SMatrix::identity()
    }

    fn measurement_noise(&self, _: &SVector<f64, N>, _: &SVector<f64, 0>) -> Covariance<f64, Const<M>> {
        self.measurement.clone()
    }
}

/// Our extended filter.
pub(crate) struct OurExtended<const N: usize, const M: usize> {
    filter: ExtendedKalmanFilter<f64, Const<N>>,
    model: Noisy<N, M>,
}

impl<const N: usize, const M: usize> Nonlinear<N, M> for OurExtended<N, M> {
    const NAME: &'static str = "thetahat";

    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let filter = ExtendedKalmanFilter::new(SVector::zeros(), Covariance::new(&matrix(&model.p))?)?;
        Ok(Self { filter, model: Noisy::new(model, drag)? })
    }

    fn step(&mut self, measurement: &[f64; M]) -> Result<()> {
        self.filter.predict(&self.model, &SVector::zeros())?;
        self.filter.correct(&self.model, &SVector::zeros(), &SVector::from(*measurement))?;
        Ok(())
    }

    fn state(&self) -> [f64; N] {
        (*self.filter.state()).into()
    }
}

/// Our unscented filter.
pub(crate) struct OurUnscented<const N: usize, const M: usize> {
    filter: UnscentedKalmanFilter<f64, Const<N>>,
    model: Noisy<N, M>,
}

impl<const N: usize, const M: usize> Nonlinear<N, M> for OurUnscented<N, M> {
    const NAME: &'static str = "thetahat";

    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let filter = UnscentedKalmanFilter::new(SVector::zeros(), Covariance::new(&matrix(&model.p))?)?;
        Ok(Self { filter, model: Noisy::new(model, drag)? })
    }

    fn step(&mut self, measurement: &[f64; M]) -> Result<()> {
        self.filter.predict(&self.model, &SVector::zeros())?;
        self.filter.correct(&self.model, &SVector::zeros(), &SVector::from(*measurement))?;
        Ok(())
    }

    fn state(&self) -> [f64; N] {
        (*self.filter.state()).into()
    }
}

/// The motion as a system of kfilter's own, which keeps Q: its `NonLinearSystem` would compute it at each step.
struct KfilterMotion<const N: usize> {
    motion: Motion,
    x: na34::SVector<f64, N>,
    q: na34::SMatrix<f64, N, N>,
    f: na34::SMatrix<f64, N, N>,
    f_transposed: na34::SMatrix<f64, N, N>,
}

impl<const N: usize> KfilterMotion<N> {
    fn new<const M: usize>(model: &Model<f64, N, M>, drag: f64) -> Self {
        let (f, x) = (na34::SMatrix::zeros(), na34::SVector::zeros());
        KfilterMotion { motion: Motion { drag }, x, q: matrix34(&model.q), f, f_transposed: f }
    }
}

impl<const N: usize> System<f64, N, 0> for KfilterMotion<N> {
    fn covariance(&self) -> &na34::SMatrix<f64, N, N> {
        &self.q
    }

    fn state(&self) -> &na34::SVector<f64, N> {
        &self.x
    }

    fn state_mut(&mut self) -> &mut na34::SVector<f64, N> {
        &mut self.x
    }
}

impl<const N: usize> LinearisableSystem<f64, N, 0> for KfilterMotion<N> {
    fn transition(&self) -> &na34::SMatrix<f64, N, N> {
        &self.f
    }

    fn transition_transpose(&self) -> &na34::SMatrix<f64, N, N> {
        &self.f_transposed
    }
}

impl<const N: usize> NoInputSystem<f64, N> for KfilterMotion<N> {
    fn step(&mut self) -> &na34::SVector<f64, N> {
        let x = self.x.into();
        self.f = na34::SMatrix::from_fn(|i, j| self.motion.slope::<N>(&x, i, j));
        self.f_transposed = self.f.transpose();
        self.x = self.motion.next(&x).into();
        &self.x
    }

    fn predict(&self, x: &na34::SVector<f64, N>) -> na34::SVector<f64, N> {
        self.motion.next(&(*x).into()).into()
    }
}

/// kfilter's measurement of the positions. (Its nonlinear one has no way to set H.)
fn kfilter_measurement<const N: usize, const M: usize>(
    model: &Model<f64, N, M>,
) -> LinearMeasurement<f64, N, M> {
    LinearMeasurement::new(matrix34(&model.h), matrix34(&model.r), na34::SVector::zeros())
}

/// kfilter's extended filter.
pub(crate) struct KfilterExtended<const N: usize, const M: usize> {
    filter: KfilterKalman<f64, N, 0, KfilterMotion<N>>,
    measurement: LinearMeasurement<f64, N, M>,
}

impl<const N: usize, const M: usize> Nonlinear<N, M> for KfilterExtended<N, M> {
    const NAME: &'static str = "kfilter";

    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let filter = KfilterKalman::new_custom(KfilterMotion::new(model, drag), matrix34(&model.p));
        Ok(Self { filter, measurement: kfilter_measurement(model) })
    }

    fn step(&mut self, measurement: &[f64; M]) -> Result<()> {
        self.filter.predict().map_err(message)?;
        self.measurement.set_measurement(na34::SVector::from(*measurement));
        self.filter.update(&self.measurement).map_err(message)?;
        Ok(())
    }

    fn state(&self) -> [f64; N] {
        (*self.filter.state()).into()
    }
}

/// kfilter's unscented filter, of 2 N + 1 = X points.
pub(crate) struct KfilterUnscented<const N: usize, const M: usize, const X: usize> {
    filter: UnscentedKalman<f64, N, 0, X, KfilterMotion<N>>,
    measurement: LinearMeasurement<f64, N, M>,
}

impl<const N: usize, const M: usize, const X: usize> Nonlinear<N, M> for KfilterUnscented<N, M, X> {
    const NAME: &'static str = "kfilter";

    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let (system, [alpha, beta, kappa]) = (KfilterMotion::new(model, drag), SCALING);
        let parameters = UKFParameters::new(alpha, beta, kappa).map_err(message)?;
        let filter = UnscentedKalman::new_custom_with_params(system, matrix34(&model.p), parameters);
        Ok(Self { filter, measurement: kfilter_measurement(model) })
    }

    fn step(&mut self, measurement: &[f64; M]) -> Result<()> {
        self.filter.predict().map_err(message)?;
        self.measurement.set_measurement(na34::SVector::from(*measurement));
        self.filter.update(&self.measurement).map_err(message)?;
        Ok(())
    }

    fn state(&self) -> [f64; N] {
        (*self.filter.state()).into()
    }
}

/// alpha, beta and kappa of the usual unscented transform: the points of the cubature rule, whose centre has no weight
/// in the mean. With the usual alpha = 1e-3 weights of ±10^6 cancel, and estimates agree to fewer digits.
const SCALING: [f64; 3] = [1.0, 0.0, 0.0];

impl<const N: usize> VectorFn<N, N> for Motion {
    fn eval<S: Numeric>(&self, x: &[S; N]) -> [S; N] {
        let (axes, dt, drag) = (N / 2, S::from_f64(DT), S::from_f64(DT * self.drag));
        std::array::from_fn(
            |i| if i < axes { x[i] + dt * x[i + axes] } else { x[i] - drag * x[i] * x[i] * x[i] },
        )
    }
}

/// The first M of N states, for multicalc.
struct Positions;

impl<const N: usize, const M: usize> VectorFn<N, M> for Positions {
    fn eval<S: Numeric>(&self, x: &[S; N]) -> [S; M] {
        std::array::from_fn(|i| x[i])
    }
}

/// multicalc's extended filter, which differentiates by itself.
pub(crate) struct MulticalcExtended<const N: usize, const M: usize, C> {
    filter: multicalc::ExtendedKalmanFilter<N, M>,
    motion: Motion,
    method: std::marker::PhantomData<C>,
}

impl<const N: usize, const M: usize, C: MulticalcMethod> Nonlinear<N, M> for MulticalcExtended<N, M, C> {
    const NAME: &'static str = C::NAME;

    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let (q, r) = (Matrix::new(model.q), Matrix::new(model.r));
        let filter = multicalc::ExtendedKalmanFilter::new(Vector::zeros(), Matrix::new(model.p), q, r);
        let filter = filter.with_covariance_update(C::METHOD);
        Ok(Self { filter, motion: Motion { drag }, method: std::marker::PhantomData })
    }

    fn step(&mut self, measurement: &[f64; M]) -> Result<()> {
        self.filter.predict(&self.motion).map_err(message)?;
        self.filter.update(&Positions, Vector::new(*measurement)).map_err(message)?;
        Ok(())
    }

    fn state(&self) -> [f64; N] {
        let x = self.filter.state();
        std::array::from_fn(|i| x[i])
    }
}

/// multicalc's unscented filter.
pub(crate) struct MulticalcUnscented<const N: usize, const M: usize> {
    filter: multicalc::UnscentedKalmanFilter<N, M>,
    motion: Motion,
}

impl<const N: usize, const M: usize> Nonlinear<N, M> for MulticalcUnscented<N, M> {
    const NAME: &'static str = "multicalc";

    fn new(model: &Model<f64, N, M>, drag: f64) -> Result<Self> {
        let ([alpha, beta, kappa], q, r) = (SCALING, Matrix::new(model.q), Matrix::new(model.r));
        let filter = multicalc::UnscentedKalmanFilter::new(Vector::zeros(), Matrix::new(model.p), q, r);
        let filter = filter.with_scaling(alpha, beta, kappa).map_err(message)?;
        Ok(Self { filter, motion: Motion { drag } })
    }

    fn step(&mut self, measurement: &[f64; M]) -> Result<()> {
        self.filter.predict(&self.motion).map_err(message)?;
        self.filter.update(&Positions, Vector::new(*measurement)).map_err(message)?;
        Ok(())
    }

    fn state(&self) -> [f64; N] {
        let x = self.filter.state();
        std::array::from_fn(|i| x[i])
    }
}

/// Something to be done with every filter of a kind.
pub(crate) trait VisitNonlinear<const N: usize, const M: usize> {
    /// Does it with one.
    fn visit<F: Nonlinear<N, M>>(&mut self);
}

/// Does it with every extended filter.
pub(crate) fn visit_extended<const N: usize, const M: usize>(visitor: &mut impl VisitNonlinear<N, M>) {
    visitor.visit::<OurExtended<N, M>>();
    visitor.visit::<KfilterExtended<N, M>>();
    visitor.visit::<MulticalcExtended<N, M, Joseph>>();
    visitor.visit::<MulticalcExtended<N, M, Plain>>();
}

/// Does it with every unscented filter, of 2 N + 1 = X points.
pub(crate) fn visit_unscented<const N: usize, const M: usize, const X: usize>(
    visitor: &mut impl VisitNonlinear<N, M>,
) {
    visitor.visit::<OurUnscented<N, M>>();
    visitor.visit::<KfilterUnscented<N, M, X>>();
    visitor.visit::<MulticalcUnscented<N, M>>();
}

/// An error of some crate, in words.
pub(crate) fn message(error: impl Debug) -> String {
    format!("{error:?}")
}
