//! Where the data of a fit by prediction errors are: at hand, as a record, or with others who are asked for sums over
//! them.

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, Dyn};
use thetahat_numerics::optimize::Objective;

use super::arx::signals;
use super::polynomials::Unusable;
use super::predictor::{InitialCondition, Predictor};
use super::thinning::{Packed, energy, thinned};
use super::uncertainty::{Autoregression, autoregression, restricted};
use crate::Error;
use crate::data::Record;
use crate::model::Orders;

/// The data of some experiments.
pub(crate) trait ExperimentData {
    /// Their prediction errors.
    type Errors<'e>: PredictionErrors
    where
        Self: 'e;
    /// The same data with further inputs.
    type Wider<'e>: ExperimentData
    where
        Self: 'e;

    /// All of them, where they are at hand.
    fn record(&self) -> Option<&Record<'_>>;

    /// Parts of them that are enough for starts, where they are many.
    fn thinned(&self) -> Option<Packed>;

    /// The same with further inputs after their own: constants, and what is known for every row at hand.
    fn with_inputs<'e>(&'e self, signals: &'e [Vec<f64>]) -> Self::Wider<'e>;

    /// # Errors
    /// [`Error::Argument`] if they do not have the inputs of these orders.
    fn check(&self, orders: &Orders) -> Result<(), Error>;

    /// Their prediction errors as a function of the parameters.
    fn errors<'e>(&'e self, orders: &Orders, begin: InitialCondition) -> Self::Errors<'e>;

    /// The sum of squares of the output.
    fn energy(&self) -> f64;

    /// Samples directly before each segment that are known.
    fn past(&self) -> &[usize];

    /// Whether anything is known of what was before a segment.
    fn is_measured_before(&self) -> bool {
        self.past().iter().any(|past| *past > 0)
    }

    /// Whether there are more initial conditions where inputs before those that were measured are unknown.
    fn has_unknown_inputs(&self, orders: &Orders) -> bool {
        Predictor::has_unknown_inputs(self.past(), orders)
    }
}

/// Prediction errors as a function of the parameters, and what their covariance asks of them where they stand.
pub(crate) trait PredictionErrors: Objective<Refusal = Unusable> {
    /// By how much a column of psi is at most larger than what the initial-condition responses leave of it.
    fn cancellation(&self) -> f64;

    /// The triangular factor of psi without the initial-condition responses, as exact as Householder QR. None where an
    /// entry is too large for squares.
    fn factor(&self) -> Option<LeastSquares<f64, Dyn>>;

    /// The autoregression of the errors that count; `taken` degrees of freedom were used by what left them.
    fn autoregression(&self, taken: usize) -> Option<Autoregression>;

    /// The autoregression of the errors of which the fit has left these. For models of output error.
    fn restricted_autoregression(&self, taken: usize) -> Option<Autoregression>;

    /// sum zeta zeta' over all samples, zeta being `weights` psi without the initial-condition responses, filtered
    /// backwards in time by 1/A(q^+1), A = `monic`. For models of output error.
    fn backward_filtered_products(&self, weights: &DMatrix<f64>, monic: &[f64]) -> Option<DMatrix<f64>>;
}

impl ExperimentData for Record<'_> {
    type Errors<'e>
        = Predictor<'e>
    where
        Self: 'e;
    type Wider<'e>
        = Record<'e>
    where
        Self: 'e;

    fn record(&self) -> Option<&Record<'_>> {
        Some(self)
    }

    fn thinned(&self) -> Option<Packed> {
        thinned(self)
    }

    fn with_inputs<'e>(&'e self, signals: &'e [Vec<f64>]) -> Record<'e> {
        Record::with_inputs(self, signals)
    }

    fn check(&self, orders: &Orders) -> Result<(), Error> {
        signals(self, orders).map(drop)
    }

    fn errors<'e>(&'e self, orders: &Orders, begin: InitialCondition) -> Predictor<'e> {
        Predictor::new(self, orders, begin)
    }

    fn energy(&self) -> f64 {
        energy(self)
    }

    fn past(&self) -> &[usize] {
        &self.past
    }
}

impl PredictionErrors for Predictor<'_> {
    fn cancellation(&self) -> f64 {
        Predictor::cancellation(self)
    }

    fn factor(&self) -> Option<LeastSquares<f64, Dyn>> {
        Predictor::factor(self).ok()
    }

    fn autoregression(&self, taken: usize) -> Option<Autoregression> {
        let (residuals, segments) = self.residuals();
        Some(autoregression(&residuals, &segments, taken))
    }

    fn restricted_autoregression(&self, taken: usize) -> Option<Autoregression> {
        let (residuals, segments) = self.residuals_by_section();
        Some(restricted(&residuals, || self.sensitivities(), &segments, taken))
    }

    fn backward_filtered_products(&self, weights: &DMatrix<f64>, monic: &[f64]) -> Option<DMatrix<f64>> {
        Some(Predictor::backward_filtered_products(self, weights, monic))
    }
}
