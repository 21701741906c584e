//! Models of any kind beside a log.

use std::borrow::Cow;

use super::arima::ArimaOnLog;
use super::equations::EquationsOnLog;
use super::nonlinear_arx::NonlinearArxOnLog;
use super::on_log::{OnLog, PolynomialOnLog};
use super::process::ProcessOnLog;
use super::state_space::StateSpaceOnLog;
use super::{Horizon, InitialCondition};
use crate::Error;
use crate::data::{Log, Rows};
use crate::model::Model;

impl Model {
    /// The model beside some rows of a log of which its offsets were taken; responses start naturally unless it is said
    /// otherwise. A model in continuous time is sampled as the log is. `fitted` are the rows of this log that it was
    /// fitted to.
    ///
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there, and a clock or numbers that the model cannot follow.
    pub(crate) fn on_log<'l>(
        &'l self,
        log: &'l Log,
        rows: &[Rows],
        asked: Option<InitialCondition>,
        fitted: &[Rows],
    ) -> Result<Box<dyn OnLog + 'l>, Error> {
        Ok(match self {
            Self::Polynomial(model) => match &model.factors {
                Some(factors) => Box::new(ArimaOnLog::new(model, factors, log, rows)?),
                None => Box::new(PolynomialOnLog::new(model, log, rows, asked)?),
            },
            Self::Equations(model) => Box::new(EquationsOnLog::new(model, log, rows, fitted)?),
            Self::NonlinearArx(model) => Box::new(NonlinearArxOnLog::new(model, log, rows)?),
            Self::Process(model) => Box::new(ProcessOnLog::new(model, log, rows)?),
            Self::StateSpace(model) => Box::new(StateSpaceOnLog::new(model, log, rows, asked)?),
            Self::ContinuousStateSpace(model) => {
                let sampled = model.sampled(log.sample_time(), model.hold).map_err(|error| match error {
                    // It is the log that says how it is sampled.
                    Error::Argument { message, .. } => {
                        Error::data(format!("the model cannot be sampled as the log is: {message}"))
                    }
                    error => error,
                })?;
                Box::new(StateSpaceOnLog::of(Cow::Owned(sampled), log, rows, asked)?)
            }
        })
    }

    /// The same with free runs of which the outputs are kept within the range of what the model was fitted to.
    ///
    /// # Errors
    /// As before; [`Error::Argument`] for models that have no such range.
    pub(crate) fn clamped_on_log<'l>(
        &'l self,
        log: &'l Log,
        rows: &[Rows],
    ) -> Result<Box<dyn OnLog + 'l>, Error> {
        match self {
            Self::NonlinearArx(model) => Ok(Box::new(NonlinearArxOnLog::new(model, log, rows)?.with_clamp())),
            Self::Polynomial(_)
            | Self::Equations(_)
            | Self::Process(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => {
                Err(Error::argument("clamp", "it is of nonlinear ARX models; leave it out"))
            }
        }
    }

    /// The default initial condition of a response to measured data: see [`InitialCondition::natural`]. Predictions of
    /// models in equations start from the states that their text gives for the first row of a log; free runs start from
    /// the state that explains the outputs best, as state-space models do. Nonlinear ARX models start from measured
    /// samples, processes at rest, as they were fitted.
    pub fn natural_start(&self, horizon: Horizon) -> InitialCondition {
        match self {
            Self::Polynomial(model) => InitialCondition::natural(model, horizon),
            Self::Equations(_) | Self::StateSpace(_) | Self::ContinuousStateSpace(_) => {
                InitialCondition::Estimate
            }
            Self::NonlinearArx(_) => InitialCondition::Drop,
            Self::Process(model) if model.free_start => InitialCondition::Estimate,
            Self::Process(_) => InitialCondition::Zero,
        }
    }
}
