use std::path::{Path, PathBuf};

use thetahat::data::Rows;
use thetahat::estimate::NoiseStructure;
use thetahat::filter::{Estimator, InitialState, ObserverGain, StateModel};

use super::{LineJob, LogJob, parsed, pole};
use crate::args::{EstimatorArgument, FilterArguments, FilterStartArgument, NoiseArgument};
use crate::failure::Failure;

/// A state to estimate.
#[derive(Debug)]
pub(crate) struct FilterJob {
    pub(crate) model: PathBuf,
    pub(crate) path: PathBuf,
    pub(crate) log: LogJob,
    /// Seconds from one row to the next, if that is given.
    pub(crate) sample_time: Option<f64>,
    pub(crate) rows: Option<Rows>,
    /// How a report's model starts, if that was said.
    pub(crate) initial: Option<InitialState>,
    /// Standard deviations of what is measured; none: those of the model.
    pub(crate) measurement_noise: Vec<f64>,
    pub(crate) smooth: bool,
    pub(crate) lines: LineJob,
    pub(crate) summary: Option<PathBuf>,
    /// What is unknown of the noises, if they are to be found.
    pub(crate) noise_structure: Option<NoiseStructure>,
    estimator: Option<Estimator>,
}

impl FilterJob {
    pub(crate) fn resolve(arguments: &FilterArguments) -> Result<Self, Failure> {
        let (log, sample_time) = LogJob::live(&arguments.log, &arguments.clock)?;
        let gain = match (&arguments.gain, arguments.poles.as_slice()) {
            (Some(text), _) => Some(ObserverGain::Matrix(matrix(text)?)),
            (None, []) => None,
            (None, poles) => Some(ObserverGain::Poles(
                poles.iter().map(|text| pole("--poles", text)).collect::<Result<_, _>>()?,
            )),
        };
        let estimator = match (arguments.estimator, gain) {
            (Some(EstimatorArgument::Luenberger), Some(gain)) => Some(Estimator::Luenberger(gain)),
            (Some(EstimatorArgument::Luenberger), None) => {
                return Err(Failure::usage("--estimator luenberger needs --poles or --gain"));
            }
            (_, Some(_)) => return Err(Failure::usage("--poles and --gain are for --estimator luenberger")),
            (Some(EstimatorArgument::Kalman), None) => Some(Estimator::Kalman),
            (Some(EstimatorArgument::Ekf), None) => Some(Estimator::Extended),
            (Some(EstimatorArgument::Iekf), None) => Some(Estimator::Iterated),
            (Some(EstimatorArgument::Ukf), None) => Some(Estimator::Unscented),
            (Some(EstimatorArgument::Bounded), None) => {
                Some(Estimator::Bounded { deviations: arguments.deviations })
            }
            (None, None) => None,
        };
        if arguments.deviations.is_some() && !matches!(estimator, Some(Estimator::Bounded { .. })) {
            return Err(Failure::usage("--deviations is for --estimator bounded"));
        }
        let reason = match estimator {
            Some(Estimator::Luenberger(_)) => Some("an observer knows no covariance"),
            Some(Estimator::Bounded { .. }) => Some("a set for bounded noise is not smoothed"),
            _ => None,
        };
        if let Some(reason) = reason.filter(|_| arguments.smooth) {
            return Err(Failure::usage(format!("--smooth: {reason}; use kalman, ekf, iekf or ukf")));
        }
        if arguments.clock.time.is_some() && sample_time.is_some() {
            return Err(Failure::usage(
                "--sample-time: with --time each step has its own length; leave one of them out",
            ));
        }
        if arguments.model == Path::new("-") && arguments.path == Path::new("-") {
            return Err(Failure::usage("only one of the model and the log can come from standard input (-)"));
        }
        Ok(Self {
            model: arguments.model.clone(),
            path: arguments.path.clone(),
            log,
            sample_time,
            initial: arguments.initial.map(|initial| match initial {
                FilterStartArgument::Zero => InitialState::Zero,
                FilterStartArgument::Unknown => InitialState::Unknown,
            }),
            rows: arguments.rows.as_deref().map(|text| parsed("--rows", text)).transpose()?,
            measurement_noise: arguments.measurement_noise.clone(),
            smooth: arguments.smooth,
            lines: LineJob::resolve(&arguments.lines),
            summary: arguments.lines.summary.clone(),
            noise_structure: arguments.fit_noise.map(|structure| match structure {
                NoiseArgument::Diagonal => NoiseStructure::Diagonal,
                NoiseArgument::Full => NoiseStructure::Full,
                NoiseArgument::Scaled => NoiseStructure::Scaled,
                NoiseArgument::Innovations => NoiseStructure::Innovations,
            }),
            estimator,
        })
    }

    /// What was asked for, or what goes with the model.
    pub(crate) fn estimator(&self, model: &StateModel) -> Estimator {
        let usual = || if model.is_linear() { Estimator::Kalman } else { Estimator::Extended };
        self.estimator.clone().unwrap_or_else(usual)
    }
}

/// Rows of numbers.
fn matrix(text: &str) -> Result<Vec<Vec<f64>>, Failure> {
    let row =
        |row: &str| row.split(',').map(|number| number.trim().parse::<f64>().ok()).collect::<Option<_>>();
    text.split(';').map(row).collect::<Option<_>>().ok_or_else(|| {
        Failure::usage(format!(
            "--gain {text}: write numbers, rows apart by ; and columns by , as in 0.5,0;0.1,0.2"
        ))
    })
}
