//! From options to a fitted model: the one way in, whatever the kind of model.
//!
//! [`FitDraft::new`] checks [`FitOptions`] and says what of a log is wanted; [`FitDraft::plan`] makes a [`FitPlan`] for
//! its channels, which [`FitPlan::fit`] carries out. [`FitPlan::pieces`] are for logs that are read part by part.

mod arima;
mod blocks;
mod method;
mod nonlinear_arx;
mod orders;
mod polynomial;
mod process;
mod search;
mod state_space;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use thetahat_numerics::optimize::Monitor;

use crate::Error;
use crate::data::{Detrend, Log, Rows, Source, Split};
use crate::model::GreyBox;
use crate::options::{ColumnName, Kind};
use crate::plan::{FitOptions, Fitted};
use crate::report::{
    EquationsPlan, NormalEquations, PendingEvaluation, Plan, Report, fit_equations, fit_equations_to_response,
};
use crate::spectrum::MeasuredResponse;
use arima::ArimaDraft;
use blocks::BlocksDraft;
use nonlinear_arx::NonlinearArxDraft;
use polynomial::PolynomialDraft;
use process::ProcessDraft;
use state_space::StateSpaceDraft;

/// A fit of which everything is said but the channels of the log.
///
/// ```
/// use std::borrow::Cow;
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::fit::FitDraft;
/// use thetahat::plan::{FitOptions, Fitted};
///
/// let options: FitOptions = serde_json::from_str(r#"{"model": "arx", "na": 0, "nb": 1}"#)?;
/// let draft = FitDraft::new(&options, Fitted::Log { several_outputs: false })?;
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let y = [vec![0.0], u[..199].to_vec()].concat();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let plan = draft.plan(vec!["u".into()], vec!["y".into()])?;
/// let report = plan.fit(Cow::Owned(log), &[], &|_| ControlFlow::Continue(()))?;
/// assert!((report.model.parameters()[0].value - 1.0).abs() < 1e-9);
/// assert_eq!(report.plan.unwrap().input[0].0, "u");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct FitDraft {
    options: FitOptions,
    draft: Box<dyn Draft>,
}

/// A fit of which everything is said.
#[derive(Debug, Clone)]
pub struct FitPlan {
    options: FitOptions,
    plan: Arc<dyn KindPlan>,
}

/// A fit of one kind of model of which the channels are open.
trait Draft: fmt::Debug + Send + Sync {
    /// Whether the model has inputs.
    fn is_driven(&self) -> bool {
        true
    }

    /// What asks for a model without inputs, as a message names it.
    fn asks_for_no_inputs(&self) -> &'static str {
        "another `model`"
    }

    /// Whether rows may be any time apart.
    fn takes_any_clock(&self) -> bool {
        false
    }

    /// Whether the fit takes memory for little more than the log itself.
    fn is_one_step(&self) -> bool {
        false
    }

    /// Whether the options go with so many inputs.
    fn check_inputs(&self, _count: usize) -> Result<(), Error> {
        Ok(())
    }

    /// The plan for the channels of a log.
    fn plan(&self, inputs: Vec<String>, outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error>;

    /// What is asked of a fit of equations, if it is one.
    fn of_equations(&self) -> Option<&EquationsPlan> {
        None
    }
}

/// A fit of one kind of model of which everything is said.
trait KindPlan: fmt::Debug + Send + Sync {
    /// Fits the model to a log and reports on it.
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error>;

    /// The same with figures that wait until somebody asks for them, where they take long.
    fn begin(
        &self,
        log: Cow<'_, Log>,
        sources: &[Source],
        monitor: Monitor<'_>,
    ) -> Result<PendingEvaluation, Error> {
        self.fit(log, sources, monitor).map(PendingEvaluation::of)
    }

    /// Whether logs that are read part by part make this model.
    fn check_pieces(&self) -> Result<(), Error> {
        Err(whole_log())
    }

    /// How many rows of the part before it a part of a log needs.
    fn lags(&self) -> usize {
        0
    }

    /// The normal equations of a part of a log.
    fn pieces(&self, _log: &Log, _sources: &[Source], _past: usize) -> Result<NormalEquations, Error> {
        Err(whole_log())
    }

    /// Fits the model to a frequency response.
    fn fit_response(&self, _response: &MeasuredResponse, _monitor: Monitor<'_>) -> Result<Report, Error> {
        Err(Error::argument("from", "the options ask for a kind of model that no frequency response tells"))
    }

    /// It, if it is of a model of polynomials.
    fn polynomial(&self) -> Option<&Plan> {
        None
    }
}

/// A model that is not made part by part.
fn whole_log() -> Error {
    Error::argument("stream", "this kind of model needs its whole log; leave it out")
}

impl FitDraft {
    /// Checks everything that needs no data.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go together, or with this kind of model.
    pub fn new(options: &FitOptions, fitted: Fitted) -> Result<Self, Error> {
        let draft: Box<dyn Draft> = match options.kind(fitted)?.kind {
            Kind::POLYNOMIAL | Kind::IMPULSE_RESPONSE => Box::new(PolynomialDraft::new(options)?),
            Kind::ARIMA => Box::new(ArimaDraft::new(options)?),
            kind @ (Kind::STATE_SPACE | Kind::VECTOR_ARX | Kind::RESPONSE_STATES) => {
                Box::new(StateSpaceDraft::new(options, kind)?)
            }
            Kind::PROCESS | Kind::RESPONSE => Box::new(ProcessDraft::new(options, fitted)?),
            Kind::NONLINEAR_ARX => Box::new(NonlinearArxDraft::new(options)?),
            Kind::BLOCKS => Box::new(BlocksDraft::new(options)?),
            Kind::EQUATIONS => Box::new(equations(options)?),
            _ => return Err(Error::argument("model", "a log does not say a model of this kind")),
        };
        Ok(Self { options: options.clone(), draft })
    }

    /// The options that it was made of.
    pub fn options(&self) -> &FitOptions {
        &self.options
    }

    /// Whether the model has inputs.
    pub fn is_driven(&self) -> bool {
        self.draft.is_driven()
    }

    /// What asks for a model without inputs, as a message names it.
    pub fn asks_for_no_inputs(&self) -> &'static str {
        self.draft.asks_for_no_inputs()
    }

    /// Whether rows may be any time apart.
    pub fn takes_any_clock(&self) -> bool {
        self.draft.takes_any_clock()
    }

    /// Whether the fit takes memory for little more than the log itself.
    pub fn is_one_step(&self) -> bool {
        self.draft.is_one_step()
    }

    /// Whether the options go with so many inputs.
    ///
    /// # Errors
    /// [`Error::Argument`] for lists that are not one value for each.
    pub fn check_inputs(&self, count: usize) -> Result<(), Error> {
        self.draft.check_inputs(count)
    }

    /// The plan for the channels of a log.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go with so many channels.
    pub fn plan(self, inputs: Vec<String>, outputs: Vec<String>) -> Result<FitPlan, Error> {
        let inputs = if self.is_driven() { inputs } else { Vec::new() };
        let names = |names: &[String]| names.iter().cloned().map(ColumnName).collect();
        let options = FitOptions { input: names(&inputs), output: names(&outputs), ..self.options };
        Ok(FitPlan { options, plan: self.draft.plan(inputs, outputs)? })
    }

    /// Fits the unknown parameters of a model in equations.
    ///
    /// # Errors
    /// As for [`fit_equations`]; [`Error::Argument`] for options of another kind of model.
    pub fn fit_equations(
        &self,
        model: &GreyBox,
        log: &Log,
        sources: &[Source],
        monitor: Monitor<'_>,
    ) -> Result<Report, Error> {
        let report = fit_equations(model, log, sources, self.equations_plan()?, monitor)?;
        Ok(Report { plan: Some(self.options.clone()), ..report })
    }

    /// The same to a frequency response.
    ///
    /// # Errors
    /// As for [`fit_equations_to_response`]; [`Error::Argument`] for options of another kind of model.
    pub fn fit_equations_to_response(
        &self,
        model: &GreyBox,
        response: &MeasuredResponse,
        monitor: Monitor<'_>,
    ) -> Result<Report, Error> {
        let report = fit_equations_to_response(model, response, self.equations_plan()?, monitor)?;
        Ok(Report { plan: Some(self.options.clone()), ..report })
    }

    /// What is asked of a fit of equations.
    ///
    /// # Errors
    /// [`Error::Argument`] for options of another kind of model.
    pub fn equations_plan(&self) -> Result<&EquationsPlan, Error> {
        let plan = self.draft.of_equations();
        plan.ok_or_else(|| Error::argument("grey", "the options ask for another kind of model"))
    }

    /// Fits a process or a model in state space to a frequency response, from all its inputs if none are named.
    ///
    /// # Errors
    /// As for [`fit_process_to_response`](crate::report::fit_process_to_response) and
    /// [`fit_states_to_response`](crate::report::fit_states_to_response); [`Error::Argument`] for options of another
    /// kind of model.
    pub fn fit_response(self, response: &MeasuredResponse, monitor: Monitor<'_>) -> Result<Report, Error> {
        if let Some(other) = self.options.output.iter().find(|output| output.0 != response.output) {
            let message = format!("the response is of '{}', not of '{}'", response.output, other.0);
            return Err(Error::argument("output", message));
        }
        let all = || response.responses.iter().filter_map(|own| own.input.clone()).collect();
        let inputs = self.options.inputs().unwrap_or_else(all);
        let plan = self.draft.plan(inputs, vec![response.output.clone()])?;
        let report = plan.fit_response(response, monitor)?;
        Ok(Report { plan: Some(self.options), ..report })
    }
}

impl FitPlan {
    /// Fits the model to a log and reports on it. A model of polynomials uses the log up: it is copied where it is
    /// borrowed.
    ///
    /// # Errors
    /// Those of the kind of model: [`Error::Argument`] and [`Error::Data`] for channels or rows that are not there,
    /// [`Error::Undetermined`] if the data cannot determine the parameters.
    pub fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        let report = self.plan.fit(log, sources, monitor)?;
        Ok(Report { plan: Some(self.options.clone()), ..report })
    }

    /// The same with figures that wait until somebody asks for them, where they take long.
    ///
    /// # Errors
    /// As for [`fit`](Self::fit).
    pub fn begin(
        &self,
        log: Cow<'_, Log>,
        sources: &[Source],
        monitor: Monitor<'_>,
    ) -> Result<PendingEvaluation, Error> {
        Ok(self.plan.begin(log, sources, monitor)?.with_plan(&self.options))
    }

    /// The channels of the log that the fit reads, the inputs first.
    pub fn channels(&self) -> Vec<String> {
        self.options.input.iter().chain(&self.options.output).map(|name| name.0.clone()).collect()
    }

    /// Whether a fit of logs that are read part by part makes this model.
    ///
    /// # Errors
    /// [`Error::Argument`] for what needs the log more than once.
    pub fn check_pieces(&self) -> Result<(), Error> {
        self.plan.check_pieces()
    }

    /// How many rows of the part before it a part of a log needs.
    pub fn lags(&self) -> usize {
        self.plan.lags()
    }

    /// The normal equations of a part of a log, of which the first `past` rows are of the part before it.
    ///
    /// # Errors
    /// As for [`NormalEquations::new`], and as for [`check_pieces`](Self::check_pieces).
    pub fn pieces(&self, log: &Log, sources: &[Source], past: usize) -> Result<NormalEquations, Error> {
        self.plan.pieces(log, sources, past)
    }

    /// The options that it was made of, with the channels of the log.
    pub fn options(&self) -> &FitOptions {
        &self.options
    }

    /// The plan of a model of polynomials.
    ///
    /// # Errors
    /// [`Error::Argument`] for another kind of model.
    pub fn polynomial(&self) -> Result<&Plan, Error> {
        let plan = self.plan.polynomial();
        plan.ok_or_else(|| {
            Error::argument("model", "this is for models of polynomials; name one, such as oe")
        })
    }
}

/// What most kinds of model have in common.
struct Common {
    estimate: Vec<Rows>,
    validate: Vec<Rows>,
    split: Option<Split>,
    detrend: Detrend,
    offsets: Vec<(String, f64)>,
}

fn common(options: &FitOptions) -> Result<Common, Error> {
    let mut offsets: Vec<(String, f64)> = Vec::new();
    for offset in &options.offset {
        if offsets.iter().any(|(name, _)| *name == offset.name) {
            return Err(Error::argument("offset", format!("'{}' has two; give one", offset.name)));
        }
        offsets.push((offset.name.clone(), offset.value));
    }
    if options.split.is_some() && !options.validate.is_empty() {
        return Err(Error::argument("split", "does not work with `validate`; leave one of the two out"));
    }
    Ok(Common {
        estimate: options.estimate.clone(),
        validate: options.validate.clone(),
        split: options.split,
        detrend: options.detrend.unwrap_or(Detrend::Mean),
        offsets,
    })
}

fn equations(options: &FitOptions) -> Result<EquationsPlan, Error> {
    let Common { estimate, validate, split, .. } = common(options)?;
    // Where no number is given there are more if they are needed.
    let own_start_only = options.starts == Some(0);
    let search = search::search(options)?;
    Ok(EquationsPlan { estimate, validate, split, search, own_start_only, profile: options.profile })
}

impl Draft for EquationsPlan {
    fn takes_any_clock(&self) -> bool {
        true
    }

    fn plan(&self, _: Vec<String>, _: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        Err(Error::argument("grey", "equations name their own channels"))
    }

    fn of_equations(&self) -> Option<&EquationsPlan> {
        Some(self)
    }
}

/// What is wrong with the value of an option.
fn of_option(option: &str, error: Error) -> Error {
    match error {
        Error::Argument { message, .. } => Error::argument(option, message),
        other => other,
    }
}
