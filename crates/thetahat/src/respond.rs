//! How a model responds: to a record of inputs and outputs, to steps, to impulses and to each frequency.
//!
//! - [`predict`] gives the k-step prediction, [`simulate`] the free run, which sees the inputs alone;
//!   [`InitialCondition`] says what they start from. [`forecast`] goes on after the last sample of a record.
//! - [`prediction_deviation`] is how far predictions are off because of the noise, [`prediction_deviations`] what
//!   uncertain parameters add to that. [`draw`] gives random free runs and forecasts of models that the data do not
//!   tell apart.
//! - [`step_response`] and [`impulse_response`] are those in time, [`frequency_response`] that to sines, with standard
//!   errors.
//! - [`Horizon`] says how far ahead a figure looks, [`NisSummary`] whether the errors of a filter are as large as it
//!   expects.
//!
//! All of these take and give deviations from the model's offsets. [`report::apply`](crate::report::apply) takes a
//! whole log, with its offsets. The sources are named at each function; most are Ljung, System Identification, 2nd ed.
//! 1999, chapters 2 and 3.
//!
//! ```
//! use thetahat::data::Record;
//! use thetahat::estimate::{Initial, arx};
//! use thetahat::model::{Orders, Signal};
//! use thetahat::respond::{InitialCondition, predict, simulate};
//!
//! let u: Vec<f64> = (0..50_u32).map(|t| f64::from(t * t % 7)).collect();
//! let mut y = vec![0.0];
//! for t in 1..u.len() {
//!     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
//! }
//! let (record, orders) = (Record::new(&y, vec![&u])?, Orders::arx(1, &[1], &[1])?);
//! let estimate = arx(&record, &orders, Initial::Drop)?;
//! let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
//! let next = predict(&model, &record, 1, InitialCondition::Drop)?;
//! let run = simulate(&model, &record, InitialCondition::Zero)?;
//! assert!((next.values[40] - y[40]).abs() < 1e-9 && (run.values[40] - y[40]).abs() < 1e-9);
//! # Ok::<(), thetahat::Error>(())
//! ```

pub(crate) mod arima;
mod continuous;
mod correlation;
mod draws;
pub(crate) mod equations;
mod forecast;
mod frequency;
mod horizon;
mod initial_condition;
mod initial_responses;
mod innovations;
mod kinds;
mod linear;
mod nis;
pub(crate) mod nonlinear_arx;
mod on_log;
mod predict;
pub(crate) mod process;
mod regressors;
mod response;
mod sensitivities;
mod simulate;
pub(crate) mod state_space;
mod step_figures;
mod tested;
#[cfg(test)]
mod tests;
mod transient;

pub(crate) use correlation::Correlation;
pub(crate) use draws::Spread;
pub use draws::{Drawn, Draws, draw};
pub use forecast::{Forecast, forecast};
pub use frequency::{FrequencyPoint, FrequencyResponse, frequency_response, logarithmic_frequencies};
pub use horizon::Horizon;
pub use initial_condition::InitialCondition;
pub(crate) use initial_condition::{NOTHING_LEFT, are_worth};
use initial_condition::{check_inputs, history};
pub(crate) use initial_responses::until_negligible;
pub(crate) use innovations::{Innovations, innovations};
pub(crate) use nis::NisCount;
pub use nis::NisSummary;
pub(crate) use on_log::{OnLog, PolynomialOnLog, record_for};
pub(crate) use predict::check_steps;
pub use predict::{predict, prediction_deviation};
pub(crate) use regressors::{Regressor, RegressorSignal, Regressors};
pub use response::Response;
pub use sensitivities::prediction_deviations;
pub use simulate::simulate;
pub(crate) use step_figures::StepFigures;
pub(crate) use tested::{Tested, TestedInput};
pub use transient::{TransientResponse, impulse_response, step_response};
