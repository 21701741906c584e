use serde::{Deserialize, Serialize};
use thetahat_core::{ArmaxMethod, Forgetting, Outliers, RlsStart};

/// How a model is tracked.
///
/// ```
/// use thetahat::track::{TrackStart, Policy, TrackPlan};
///
/// let plan = TrackPlan { forgetting: "0.98".parse()?, start: "exact".parse()?, ..TrackPlan::default() };
/// assert_eq!(plan.forgetting.to_string(), "exponential:0.98");
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrackPlan {
    /// Least squares for models without C, one of the two others for models with it.
    pub method: TrackMethod,
    /// What is forgotten.
    pub forgetting: Policy,
    /// What becomes of the prior. A model with C, and one that goes on from a report, has the standard start.
    pub start: TrackStart,
    /// An innovation of at most this size corrects nothing, in the output's units. 0: no dead zone.
    pub dead_zone: f64,
    /// What becomes of samples whose innovations are far larger than the noise makes them.
    pub outliers: TrackOutliers,
    /// Whether a constant is estimated beside the model: A y = B u + constant + C e, for signals whose offsets are not
    /// known.
    pub constant: bool,
    /// What is taken from each channel before, in its own units, and put back in predictions. None: what the report
    /// says; without a report nothing, or with a constant the first value of each channel. (Far from 0, signals that
    /// hardly change look like one constant: the prior would pull at what tells them apart.)
    pub offsets: Option<PerChannel>,
    /// The typical magnitude of each channel without its offset, in its own units, 1e-98 to 1e98. None: found in the
    /// first rows, or in the report.
    pub scales: Option<PerChannel>,
    /// The typical magnitude of e, in the output's units, 1e-98 to 1e98; only a model with C asks for it. None: a tenth
    /// of that of the output, or what the report says.
    pub noise_scale: Option<f64>,
    /// Whether to watch for changes, and how many samples shall be between two false alarms on average, 10 to 1e9. With
    /// a short memory they come more seldom: with 4 parameters and a factor of 0.99 about half as often as asked
    /// (measured). See [`change_detector`](crate::track::change_detector).
    pub alarm_interval: Option<f64>,
}

/// Least squares from the prior, a memory of 100 samples, no detection of changes.
impl Default for TrackPlan {
    fn default() -> Self {
        Self {
            method: TrackMethod::Rls,
            forgetting: Policy::default(),
            start: TrackStart::default(),
            dead_zone: 0.0,
            outliers: TrackOutliers::default(),
            constant: false,
            offsets: None,
            scales: None,
            noise_scale: None,
            alarm_interval: None,
        }
    }
}

/// One number for each channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PerChannel {
    /// Of the inputs, in their order.
    pub inputs: Vec<f64>,
    /// Of the output.
    pub output: f64,
}

/// By which gradient a model is corrected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TrackMethod {
    /// Recursive least squares, for AR and ARX.
    Rls,
    /// Extended least squares, for ARMA and ARMAX. See [`ArmaxMethod::ExtendedLeastSquares`].
    Els,
    /// The recursive prediction error method, for ARMA and ARMAX. See [`ArmaxMethod::PredictionError`].
    Rpem,
}

impl TrackMethod {
    /// What the method is to an estimator with C.
    pub(super) fn with_noise_model(self) -> Option<ArmaxMethod> {
        match self {
            Self::Rls => None,
            Self::Els => Some(ArmaxMethod::ExtendedLeastSquares),
            Self::Rpem => Some(ArmaxMethod::PredictionError),
        }
    }
}

/// What a tracker forgets, written as a word and its numbers, with a colon before each: `none`, `selective:0.99`. The
/// words and numbers are those of [`Forgetting::policies`]; a factor alone is that of `exponential`, and 1 alone is
/// `none`.
///
/// What is written is read back as the same. That a factor is above n/(n + 1), for n parameters, is checked when a
/// tracker is made.
///
/// ```
/// use thetahat::thetahat_core::Forgetting;
/// use thetahat::track::Policy;
///
/// let policy: Policy = "selective:0.99".parse()?;
/// assert_eq!(policy.0, Forgetting::Selective { factor: 0.99 });
/// assert_eq!("1".parse::<Policy>()?.to_string(), "none");
/// assert!("0.99:0.98".parse::<Policy>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Policy(pub Forgetting<f64>);

/// How a tracker starts, written as a word: `standard`, `exact`, `mixed` or `mixed:K`, with K samples in which the
/// prior is taken out. See [`RlsStart`].
///
/// ```
/// use thetahat::thetahat_core::RlsStart;
/// use thetahat::track::TrackStart;
///
/// assert_eq!("mixed:20".parse::<TrackStart>()?.0, RlsStart::Mixed { blend: 20 });
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrackStart(pub RlsStart);

/// The standard start.
impl Default for TrackStart {
    fn default() -> Self {
        Self(RlsStart::Standard)
    }
}

/// What becomes of outliers, written as a word: `used`, `huber` or `huber:THRESHOLD` in standard deviations, `gate`,
/// `gate:NIS` or `gate:NIS:RELEASE`. Alone `huber` is `huber:3`, `gate` is `gate:25:20` and `gate:NIS` is released
/// after 20 in a row. See [`Outliers`].
///
/// ```
/// use thetahat::thetahat_core::Outliers;
/// use thetahat::track::TrackOutliers;
///
/// assert_eq!("huber".parse::<TrackOutliers>()?.0, Outliers::Huber { threshold: 3.0 });
/// assert_eq!("gate:16".parse::<TrackOutliers>()?.to_string(), "gate:16.0:20");
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TrackOutliers(pub Outliers<f64>);
