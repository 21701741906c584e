//! Models that go from sample to sample, and of which the outputs are linear in the state.

use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, Error, LinearObservation};

use super::lags::Lags;
use super::linear::Linear;
use crate::data::Offset;

/// y(k) = H x(k) + D u(k) + v(k), v ~ (0, R), of deviations from the offsets of the channels, with x from a [`Motion`].
#[derive(Debug, Clone)]
pub(super) struct Sampled {
    pub(super) names: Names,
    /// What is taken from the channels, and put back.
    pub(super) input_offsets: Vec<Offset>,
    pub(super) output_offsets: Vec<Offset>,
    /// x0 and P0.
    pub(super) start: DVector<f64>,
    pub(super) start_covariance: Covariance<f64, Dyn>,
    /// H, D and R.
    pub(super) observation: LinearObservation<f64, Dyn, Dyn, Dyn>,
    /// H: the observation keeps it transposed.
    pub(super) output_matrix: DMatrix<f64>,
    /// R.
    pub(super) output_noise: DMatrix<f64>,
    pub(super) motion: Motion,
}

/// The channels of a model and its sample time.
#[derive(Debug, Clone)]
pub(super) struct Names {
    pub(super) states: Vec<String>,
    pub(super) inputs: Vec<String>,
    pub(super) outputs: Vec<String>,
    pub(super) sample_time: f64,
}

/// How the state goes on.
#[derive(Debug, Clone)]
pub(super) enum Motion {
    Linear(Box<Linear>),
    Lags(Box<Lags>),
}

/// What is known of the state at the first row: x0 and P0.
pub(super) type Start = (DVector<f64>, Covariance<f64, Dyn>);

impl Sampled {
    /// A model whose channels have no offsets.
    ///
    /// # Errors
    /// If a number overflows.
    pub(super) fn new(
        names: Names,
        (start, start_covariance): Start,
        (h, d, r): (DMatrix<f64>, DMatrix<f64>, Covariance<f64, Dyn>),
        motion: Motion,
    ) -> Result<Self, Error> {
        let offsets = |channels: &[String]| vec![Offset::default(); channels.len()];
        Ok(Self {
            input_offsets: offsets(&names.inputs),
            output_offsets: offsets(&names.outputs),
            names,
            start,
            start_covariance,
            output_noise: r.matrix(),
            observation: LinearObservation::new(h.clone(), r)?.with_input(d)?,
            output_matrix: h,
            motion,
        })
    }

    /// The same with outputs that are measured with white noise of these variances.
    ///
    /// # Errors
    /// If one is negative or no number.
    pub(super) fn with_output_variances(self, variances: DVector<f64>) -> Result<Self, Error> {
        let Self { names, start, start_covariance, output_matrix, observation, motion, .. } = self;
        let seen =
            (output_matrix, observation.input_matrix().clone(), Covariance::from_diagonal(&variances)?);
        let fresh = Self::new(names, (start, start_covariance), seen, motion)?;
        Ok(Self { input_offsets: self.input_offsets, output_offsets: self.output_offsets, ..fresh })
    }
}

/// Refuses the noise variance of a report by which nothing can be weighed.
pub(super) fn check_noise(variance: f64) -> Result<(), crate::Error> {
    if variance > 0.0 {
        return Ok(());
    }
    Err(crate::Error::report(
        "its noise variance is 0, so that a filter has nothing to weigh the measurements by; simulate the model instead",
    ))
}
