//! System identification: models of dynamic systems from logged data.
//!
//! A model has the form
//!
//! ```text
//! A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t)
//! ```
//!
//! with A, C, D, F monic in q^-1 and e white (Ljung, System Identification: Theory for the User, 2nd ed. 1999).
//! [`Orders`] say how many coefficients each has, and with that the [`Structure`]: ARX, ARMAX, output error, Box-Jenkins, AR,
//! ARMA or any other.
//!
//! - [`Log`] holds channels on a common clock, [`Record`] the signals that an estimate sees.
//! - [`estimate`] gives an [`Estimate`] from a [`Record`], [`Orders`] and a [`Method`]. [`arx`] is its short form for models
//!   that are linear in their parameters; [`arx_factor`] gives a triangular factor that merges with others.
//! - [`predict`], [`simulate`] and [`forecast`] say what a [`PolynomialModel`] says, [`draw`] what it leaves open;
//!   [`frequency_response`], [`step_response`] and [`impulse_response`] what it is to sines, steps and impulses; [`Fit`] says
//!   how close that is.
//! - [`PolynomialModel::state_space`] writes a model as a recursion of first order, for filters and controllers.
//! - [`StateFilter`] estimates the state of a [`StateModel`] row by row: of a report, of matrices, or of a model in equations,
//!   a [`GreyBox`], of which parameters may be unknown.
//! - [`inspect`] says what a log is worth before any fit.
//! - [`identify`] goes the whole way from a [`Log`] to a [`Report`], the JSON document; [`apply`] takes a stored model to a log.
//! - [`validate()`] says how a stored model does on a log and what is left of it, [`compare`] puts several side by side, a
//!   [`Requirement`] makes a gate of it.
//! - A [`Tracker`] estimates ARX and ARMAX models while the plant runs, sample by sample, with predictions and with alarms
//!   where the plant changes.
//! - With the feature `html`, `fit_page` and its like make pages with charts of them.
//!
//! Rows of a log are counted from 1 and ranges include both ends; sample positions inside a [`Record`] are counted from 0.
//! The same input gives the same bits, whatever the number of threads.
//!
//! What it does not do: open files, print, or run without a heap. For the last see `thetahat-core`, whose estimators a
//! [`Tracker`] and a [`StateFilter`] are made of.

mod data;
mod distribution;
mod document;
mod error;
mod estimate;
pub mod figures;
mod filter;
mod inspect;
mod model;
mod optimize;
mod regression;
mod report;
mod respond;
mod select;
pub mod text;
mod track;
mod validate;

pub use data::{
    AntiAlias, Channel, Detrend, Interpolation, Log, Offset, Prefilter, Record, Recording, Resample,
    Resampling, Rows, Source, Split, Times,
};
pub use document::{Document, is_document};
pub use error::Error;
pub use estimate::{
    Bound, Constant, Criteria, Criterion, CriterionOutcome, EquationsOutcome, Estimate, GainBound,
    InformationCriterion, Initial, LikelihoodOutcome, LikelihoodSearch, Loss, Method, Norm, Procedure,
    Robust, RobustOutcome, RunFigures, SearchOutcome, Solver, StartOutcome, TermStep, TermsOutcome,
    UnknownParameter, arx, arx_factor, estimate, estimate_monitored,
};
pub use filter::{
    EstimatedNumber, Estimator, FilterSnapshot, FilterSummary, InitialState, ObserverGain, SmoothedStates,
    StateEstimate, StateFilter, StateModel, StateValues,
};
pub use inspect::{
    ChannelQuality, Clock, DelayEstimate, Excitation, Feedback, Inspection, InspectionPlan, Saturation,
    SpectrumPoint, inspect, inspect_log,
};
pub use model::{
    EquationsModel, GreyBox, Interval, Map, Model, NonlinearArxModel, OffsetCovariance, Orders, Parameter,
    PolynomialModel, Quantity, Regressor, Root, Signal, StateSpace, Structure,
};
pub use optimize::{Algorithm, Monitor, Progress, Search, Step, Stopped};
pub use report::{
    Applied, AppliedOutput, Centres, Comparison, Coverage, Data, EquationsPlan, Estimation, InputLags,
    MapPlan, Missing, NoiseLevel, NonlinearArxPlan, OutputSignals, Parts, Plan, Report, Requirement, Seen,
    Signals, Unjudged, Validated, Validation, ValidationPlan, apply, compare, fit_equations,
    fit_nonlinear_arx, held_out_runs, identify, identify_monitored, sample, validate,
};
#[cfg(feature = "html")]
pub use report::{comparison_page, fit_page, inspection_page, validation_page};
pub use respond::{
    Drawn, Draws, Forecast, FrequencyPoint, FrequencyResponse, Horizon, NisSummary, Response, Start,
    TransientResponse, draw, forecast, frequency_response, impulse_response, logarithmic_frequencies,
    predict, prediction_deviation, prediction_deviations, simulate, step_response,
};
pub use select::{
    Automatic, Best, Choice, Delay, Focus, Grid, HeldOut, OrderRange, Path, Scan, Scored, Select, Selection,
    choose_orders,
};
pub use thetahat_core;
pub use track::{
    Beginning, PerChannel, Policy, TrackMethod, TrackPlan, TrackScore, TrackSummary, Tracked, Tracker,
    TrackerSummary, change_detector,
};
pub use validate::{Anderson, AndersonLevel, Fit, Independence, Nonlinearity, Part, Residuals, Test};
