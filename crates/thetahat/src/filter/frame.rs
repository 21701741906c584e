//! What models that go from sample to sample have in common: channels, start, and outputs that are linear in the state.

use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, Error, LinearObservation};

use crate::data::Offset;

/// What is known of the state in which the model of a report starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitialState {
    /// It is 0: the plant is at rest, the channels at their offsets.
    Zero,
    /// Nothing: each state, which is in units of the output, has a standard deviation of a thousand times that of the
    /// noise e. The lags of a nonlinear ARX model are anywhere in the range of the rows that it was fitted to, half of
    /// which is their standard deviation.
    Unknown,
}

/// y(k) = H x(k) + D u(k) + v(k), v ~ (0, R), of deviations from the offsets of the channels.
#[derive(Debug, Clone)]
pub(super) struct Frame {
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
}

/// The channels of a model and its sample time.
#[derive(Debug, Clone)]
pub(super) struct Names {
    pub(super) states: Vec<String>,
    pub(super) inputs: Vec<String>,
    pub(super) outputs: Vec<String>,
    pub(super) sample_time: f64,
}

/// What is known of the state at the first row: x0 and P0.
pub(super) type Start = (DVector<f64>, Covariance<f64, Dyn>);

impl Frame {
    /// A model whose channels have no offsets.
    ///
    /// # Errors
    /// If a number overflows.
    pub(super) fn new(
        names: Names,
        (start, start_covariance): Start,
        (h, d, r): (DMatrix<f64>, DMatrix<f64>, Covariance<f64, Dyn>),
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
        })
    }

    /// The same with outputs that are measured with white noise of these variances.
    ///
    /// # Errors
    /// If one is negative or no number.
    pub(super) fn with_output_variances(self, variances: DVector<f64>) -> Result<Self, Error> {
        let Self { names, start, start_covariance, output_matrix, observation, .. } = self;
        let seen =
            (output_matrix, observation.input_matrix().clone(), Covariance::from_diagonal(&variances)?);
        let fresh = Self::new(names, (start, start_covariance), seen)?;
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
