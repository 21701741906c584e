//! What a sample told an estimator, and what the estimator did with it.

use crate::{Dimension, Real};
use nalgebra::OVector;

/// What an estimator did with a sample.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Action, Error, Forgetting, RecursiveLeastSquares};
///
/// let mut gain: RecursiveLeastSquares<f32, Const<1>> =
///     RecursiveLeastSquares::new(&Vector1::new(1.0), Forgetting::default())?;
/// match gain.update(&Vector1::new(1.0), f32::NAN)?.action {
///     Action::Updated | Action::Capped => panic!("nothing was measured"),
///     action => assert_eq!(action.word(), "missing"),
/// }
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(all(feature = "defmt", target_os = "none"), derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Action {
    /// The estimate was corrected.
    Updated,
    /// The estimate was corrected, and a variance has grown to its bound: samples tell too little of some direction of
    /// the parameters, and nothing is forgotten there. See [`Forgetting`](crate::Forgetting#the-bound).
    Capped,
    /// The estimate was corrected by less than the innovation asks for, so that C(q) or F(q) stays stable, or
    /// parameters stay within limits.
    Projected,
    /// The measurement is missing (NaN): time went on, nothing was corrected.
    Missing,
    /// The delay lines are not filled yet, at the start or after missing samples, or hold numbers too large to be
    /// absorbed: time went on, nothing was corrected.
    NotReady,
    /// Regressors are collected until they have full rank: there is no estimate yet, or that of an earlier window
    /// stays.
    Collecting,
    /// Adaptation is off: the innovation is computed, nothing was corrected.
    Frozen,
    /// The innovation lies in the dead zone: nothing was corrected.
    Skipped,
    /// The normalised innovation squared is above the gate: the measurement was not used.
    Gated,
    /// It is above the gate, and so were those before it, so many in a row that the filter must be wrong and not they:
    /// the measurement was used.
    Released,
    /// The innovation is an outlier: the estimate was corrected by less than it asks for. See
    /// [`Outliers::Huber`](crate::Outliers::Huber).
    Bounded,
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
            Action::Bounded => "bounded",
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
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, Vector1};
/// use thetahat_core::{Action, Covariance, Error, KalmanFilter, LinearObservation};
///
/// // A level of 2 with variance 3, a gauge with variance 1, and a measurement of 6: e = 4, S = 3 + 1.
/// let variance = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
/// let gauge = LinearObservation::new(Matrix1::new(1.0), variance(1.0)?)?;
/// let mut level = KalmanFilter::new(Vector1::new(2.0), variance(3.0)?)?;
/// let innovation = level.correct(&gauge, &Default::default(), &Vector1::new(6.0))?;
/// assert_eq!((innovation.error[0], innovation.variance[0], innovation.nis), (4.0, 4.0, 4.0));
/// assert_eq!(innovation.action, Action::Updated);
/// assert!(innovation.nis < 5.0239); // 95 % of those of a right model are below
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(all(feature = "defmt", target_os = "none"), derive(defmt::Format))]
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

impl<T, E> Innovation<T, E> {
    /// What a predictor of another kind has found, for a [`ChangeDetector`](crate::ChangeDetector) for instance.
    ///
    /// ```
    /// use thetahat_core::{Action, Innovation};
    ///
    /// let (error, variance) = (0.5_f32, 0.25);
    /// let innovation = Innovation::new(error, variance, error * error / variance, Action::Updated);
    /// assert_eq!(innovation.nis, 1.0);
    /// ```
    pub const fn new(error: E, variance: E, nis: T, action: Action) -> Self {
        Innovation { error, variance, nis, action }
    }
}

impl<T: Real> Innovation<T> {
    /// Of a sample that could not be predicted.
    pub(crate) fn not_ready() -> Self {
        Innovation { error: T::NAN, variance: T::NAN, nis: T::zero(), action: Action::NotReady }
    }

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
