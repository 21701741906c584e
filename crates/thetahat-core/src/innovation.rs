//! What a sample told an estimator, and what the estimator did with it.

use crate::{Dimension, Real};
use nalgebra::OVector;

/// What an estimator did with a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Action {
    /// The estimate was corrected.
    Updated,
    /// The estimate was corrected, and a variance that had grown to its bound was brought back to it.
    Capped,
    /// The estimate was corrected by less than the innovation asks for, so that C(q) or F(q) stays stable, or parameters stay
    /// within limits.
    Projected,
    /// The measurement is missing (NaN): time went on, nothing was corrected.
    Missing,
    /// The delay lines are not filled yet, at the start or after missing samples, or hold numbers too large to be
    /// absorbed: time went on, nothing was corrected.
    NotReady,
    /// Regressors are collected until they have full rank: there is no estimate yet, or that of an earlier window stays.
    Collecting,
    /// Adaptation is off: the innovation is computed, nothing was corrected.
    Frozen,
    /// The innovation lies in the dead zone: nothing was corrected.
    Skipped,
    /// The normalised innovation squared is above the gate: the measurement was not used.
    Gated,
    /// It is above the gate, and so were those before it, so many in a row that the filter must be wrong and not they: the
    /// measurement was used.
    Released,
}

impl Action {
    /// The action in a word or two, as tables show it.
    ///
    /// ```
    /// assert_eq!(thetahat_core::Action::NotReady.word(), "not ready");
    /// ```
    pub const fn word(self) -> &'static str {
        match self {
            Action::Updated => "updated",
            Action::Capped => "capped",
            Action::Projected => "projected",
            Action::Missing => "missing",
            Action::NotReady => "not ready",
            Action::Collecting => "collecting",
            Action::Frozen => "frozen",
            Action::Skipped => "skipped",
            Action::Gated => "gated",
            Action::Released => "released",
        }
    }
}

/// The innovation of a sample: the part of the measurement that was not predicted.
///
/// ```text
/// e = y - ŷ                     error: the measurement less its prediction
/// S = H P H' + R                its covariance; for a scalar, variance
/// e' S⁻¹ e                      nis: the normalised innovation squared
/// ```
///
/// If the model is right, `nis` is a sample of a chi-square distribution with as many degrees of freedom as
/// elements were measured: 95 % lie in 0.0010 … 5.0239 for one, 0.0506 … 7.3778 for two, 0.2158 … 9.3484 for
/// three (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
/// section 5.4).
///
/// `E` is the type of a measurement: a number, or a vector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Innovation<T, E = T> {
    /// The measurement less its prediction, in the unit of the measurement. NaN where it is missing.
    pub error: E,
    /// The variance of each element, given those after it in the same measurement. (So the product of all
    /// is the determinant of S; for one element it is S.) NaN where the element is missing, or where a recursive
    /// least squares estimator does not know the variance of its noise yet.
    pub variance: E,
    /// The normalised innovation squared. 0 if nothing was measured, or the variance is not known.
    pub nis: T,
    /// What was done with the sample.
    pub action: Action,
}

impl<T: Real> Innovation<T> {
    /// ln p(y): the log-likelihood of this measurement, given all before it, if the innovation is Gaussian.
    ///
    /// ```text
    /// -1/2 (ln(2π S) + e²/S)
    /// ```
    ///
    /// 0 if nothing was measured. Sum it over the samples to compare models.
    pub fn log_likelihood(&self) -> T {
        log_likelihood(&[self.variance], self.nis)
    }
}

impl<T: Real, M: Dimension> Innovation<T, OVector<T, M>> {
    /// ln p(y): the log-likelihood of this measurement, given all before it, if the innovation is Gaussian.
    ///
    /// ```text
    /// -1/2 (m ln 2π + ln |S| + e'S⁻¹e)          m: the number of elements measured
    /// ```
    ///
    /// 0 if nothing was measured. Sum it over the samples to compare models.
    pub fn log_likelihood(&self) -> T {
        log_likelihood(self.variance.as_slice(), self.nis)
    }
}

fn log_likelihood<T: Real>(variances: &[T], nis: T) -> T {
    let measured = variances.iter().filter(|variance| variance.is_finite());
    let sum = measured.fold(nis, |sum, &variance| sum + (T::two_pi() * variance).ln());
    -sum / T::from_count(2)
}
