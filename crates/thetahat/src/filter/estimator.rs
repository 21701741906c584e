use thetahat_core::nalgebra::{Complex, DMatrix, DVector};

use super::bounded::Bounded;
use super::kind::{Filter, Kind, Motion, Observer, Unscented};
use super::model::StateModel;
use super::row::Certainty;
use crate::Error;
use crate::figures::number;

/// How a state is estimated.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Estimator {
    /// The Kalman filter, for a model that is linear in its state and has no unknown parameters.
    Kalman,
    /// The extended Kalman filter: for any model. Unknown parameters are estimated with the state. With a linear model
    /// it is the Kalman filter.
    Extended,
    /// The extended Kalman filter with iterated measurement updates, at most ten linearisations each: for accurate
    /// measurements that bend within the uncertainty of the state. See
    /// [`with_iterations`](thetahat_core::ExtendedKalmanFilter::with_iterations).
    Iterated,
    /// The unscented Kalman filter: for any model. Its deviations know how the model bends within them. Unknown
    /// parameters are estimated with the state. See [`UnscentedKalmanFilter`](thetahat_core::UnscentedKalmanFilter).
    Unscented,
    /// A set in which the state is for certain as long as noises keep their bounds, for a linear model in matrices, or
    /// a report of polynomials or state space: see [`ZonotopeFilter`](thetahat_core::ZonotopeFilter). A row that no
    /// state of the set explains is told, see [`contradiction`](super::StateEstimate::contradiction), and is not used.
    Bounded {
        /// So many standard deviations of its noises bound those of a model that says no bounds; of a Gaussian noise
        /// none is exceeded for certain.
        deviations: Option<f64>,
    },
    /// The Luenberger observer, for a model without unknown parameters: see
    /// [`LuenbergerObserver`](thetahat_core::LuenbergerObserver).
    Luenberger(ObserverGain),
}

/// The gain of an observer.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum ObserverGain {
    /// The poles that the error of the estimate is to have in the z plane: one for each state, inside the unit circle,
    /// complex ones beside their conjugates.
    ///
    /// For a model in equations they are placed again in each row, at the estimate. Several outputs are weighed by the
    /// inverse of the standard deviation of their noise, or equally if one of them has none.
    Poles(Vec<Complex<f64>>),
    /// The gain L, row by row: a row for each state, a column for each output.
    Matrix(Vec<Vec<f64>>),
}

impl Estimator {
    /// The word for it.
    pub(super) fn word(&self) -> &'static str {
        match self {
            Self::Kalman => "kalman",
            Self::Extended => "ekf",
            Self::Iterated => "iekf",
            Self::Unscented => "ukf",
            Self::Bounded { .. } => "bounded",
            Self::Luenberger(_) => "luenberger",
        }
    }
}

/// How often an iterated measurement update linearises at most.
const ITERATIONS: usize = 10;

/// What does the work of an [`Estimator`].
#[derive(Debug, Clone)]
pub(super) enum Engine {
    Filter(Filter),
    Unscented(Unscented),
    Bounded(Bounded),
    Observer { observer: Observer, poles: Option<DVector<Complex<f64>>> },
}

impl Engine {
    /// What it says beside an estimate.
    pub(super) fn certainty(&self) -> Certainty {
        match self {
            Self::Filter(_) | Self::Unscented(_) => Certainty::Deviations,
            Self::Bounded(_) => Certainty::Bounds,
            Self::Observer { .. } => Certainty::Nothing,
        }
    }

    pub(super) fn new(model: &StateModel, estimator: Estimator) -> Result<Self, Error> {
        let filter = model.kind.started().map_err(|error| Error::argument("start", error.to_string()))?;
        let unknown: Vec<&str> = model.unknown().collect();
        match estimator {
            Estimator::Kalman if !model.is_linear() => {
                let reason = match unknown.as_slice() {
                    [] => "the model is not linear in its state".to_owned(),
                    names => format!("the model has unknown parameters ({})", names.join(", ")),
                };
                let message =
                    format!("{reason}: use the extended Kalman filter (ekf) or the unscented one (ukf)");
                Err(Error::argument("estimator", message))
            }
            Estimator::Kalman | Estimator::Extended => Ok(Self::Filter(filter)),
            Estimator::Iterated => {
                let iterated = filter.with_iterations(ITERATIONS);
                Ok(Self::Filter(iterated.map_err(|error| Error::argument("estimator", error.to_string()))?))
            }
            Estimator::Unscented => {
                let unscented = Unscented::new(filter.state().clone(), filter.covariance().clone());
                Ok(Self::Unscented(unscented.map_err(|error| Error::argument("start", error.to_string()))?))
            }
            Estimator::Bounded { deviations } => Ok(Self::Bounded(Bounded::new(&model.kind, deviations)?)),
            Estimator::Luenberger(_) if !unknown.is_empty() => Err(Error::argument(
                "estimator",
                format!(
                    "an observer estimates no parameters ({}): use the extended Kalman filter (ekf), or make them known",
                    unknown.join(", ")
                ),
            )),
            Estimator::Luenberger(gain) => observer(model, filter.state(), gain),
        }
    }
}

/// An observer with its gain; for a model in equations the poles are placed later, at each estimate.
fn observer(model: &StateModel, start: &DVector<f64>, gain: ObserverGain) -> Result<Engine, Error> {
    let (n, m) = (model.states().len(), model.outputs().len());
    let wrong = |error: thetahat_core::Error| Error::argument("gain", error.to_string());
    match gain {
        ObserverGain::Matrix(rows) => {
            if rows.len() != n || rows.iter().any(|row| row.len() != m) {
                let message =
                    format!("it must have {n} rows, one for each state, of {m} numbers, one for each output");
                return Err(Error::argument("gain", message));
            }
            let gain = DMatrix::from_row_iterator(n, m, rows.into_iter().flatten());
            if !gain.iter().all(|entry: &f64| entry.is_finite()) {
                return Err(Error::argument("gain", "it must be finite numbers"));
            }
            if let Kind::Sampled(frame, Motion::Linear(linear)) = &model.kind {
                let error = linear.transition.state_matrix() - &gain * &frame.output_matrix;
                let largest =
                    error.complex_eigenvalues().iter().map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
                if largest >= 1.0 {
                    let message = format!(
                        "with it the error of the estimate does not die out: F - L H has a pole of modulus {}; \
                         give a gain that brings all poles inside the unit circle, or the poles themselves",
                        number(largest)
                    );
                    return Err(Error::argument("gain", message));
                }
            }
            let observer = Observer::new(start.clone(), gain).map_err(wrong)?;
            Ok(Engine::Observer { observer, poles: None })
        }
        ObserverGain::Poles(poles) => {
            if poles.len() != n {
                let message =
                    format!("there are {}, but the model has {n} states: give one for each", poles.len());
                return Err(Error::argument("poles", message));
            }
            let mut observer = Observer::new(start.clone(), DMatrix::zeros(n, m)).map_err(wrong)?;
            let poles = DVector::from_vec(poles);
            let none = DVector::zeros(model.inputs().len());
            let wrong = |error: thetahat_core::Error| Error::argument("poles", error.to_string());
            if let Kind::Sampled(frame, Motion::Linear(linear)) = &model.kind {
                let weights = model.kind.weights();
                let placed = observer.place(&linear.transition, &frame.observation, &none, &weights, &poles);
                placed.map_err(wrong)?;
                return Ok(Engine::Observer { observer, poles: None });
            }
            Observer::check_poles(&poles).map_err(wrong)?;
            Ok(Engine::Observer { observer, poles: Some(poles) })
        }
    }
}
