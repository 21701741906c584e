//! From options to a fitted model: the one way in, whatever the kind of model.
//!
//! [`FitDraft::new`] checks [`FitOptions`] and says what of a log is wanted; [`FitDraft::plan`] makes a [`FitPlan`] for
//! its channels, which [`FitPlan::fit`] carries out. [`FitPlan::pieces`] are for logs that are read part by part.

mod method;
mod nonlinear_arx;
mod orders;
mod polynomial;
mod process;
mod search;
mod state_space;

use std::borrow::Cow;

use thetahat_numerics::optimize::Monitor;

use crate::Error;
use crate::data::{Detrend, Log, Rows, Source, Split};
use crate::model::GreyBox;
use crate::options::{ColumnName, Kind};
use crate::plan::{FitOptions, Fitted};
use crate::report::{
    EquationsPlan, NonlinearArxPlan, NormalEquations, PendingEvaluation, Plan, ProcessPlan, Report,
    StateSpacePlan, fit_equations, fit_nonlinear_arx_monitored, fit_process, fit_process_to_response,
};
use crate::select::Choice;
use crate::spectrum::MeasuredResponse;
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
    draft: Draft,
}

#[derive(Debug)]
enum Draft {
    Polynomial(Box<PolynomialDraft>),
    StateSpace(Box<StateSpaceDraft>),
    Process(Box<ProcessDraft>),
    NonlinearArx(Box<NonlinearArxDraft>),
    Equations(EquationsPlan),
}

/// A fit of which everything is said.
#[derive(Debug, Clone)]
pub struct FitPlan {
    options: FitOptions,
    plan: KindPlan,
}

#[derive(Debug, Clone)]
enum KindPlan {
    Polynomial(Plan),
    StateSpace(StateSpacePlan),
    Process(ProcessPlan),
    NonlinearArx(NonlinearArxPlan),
}

impl FitDraft {
    /// Checks everything that needs no data.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go together, or with this kind of model.
    pub fn new(options: &FitOptions, fitted: Fitted) -> Result<Self, Error> {
        let kind = options.kind(fitted)?.kind;
        let draft = match options.narx {
            Some(map) if kind == Kind::NONLINEAR_ARX => {
                Draft::NonlinearArx(Box::new(NonlinearArxDraft::new(options, map)?))
            }
            _ if kind == Kind::EQUATIONS => Draft::Equations(equations(options)?),
            _ if kind == Kind::PROCESS || kind == Kind::RESPONSE => {
                Draft::Process(Box::new(ProcessDraft::new(options, fitted)?))
            }
            _ if kind == Kind::STATE_SPACE || kind == Kind::VECTOR_ARX => {
                let is_arx = kind == Kind::VECTOR_ARX;
                Draft::StateSpace(Box::new(StateSpaceDraft::new(options, is_arx)?))
            }
            _ => Draft::Polynomial(Box::new(PolynomialDraft::new(options)?)),
        };
        Ok(Self { options: options.clone(), draft })
    }

    /// The options that it was made of.
    pub fn options(&self) -> &FitOptions {
        &self.options
    }

    /// Whether the model has inputs.
    pub fn is_driven(&self) -> bool {
        match &self.draft {
            Draft::Polynomial(draft) => draft.orders.has_inputs(),
            Draft::StateSpace(draft) => draft.driven,
            Draft::Process(_) | Draft::Equations(_) => true,
            Draft::NonlinearArx(draft) => draft.driven,
        }
    }

    /// What asks for a model without inputs, as a message names it.
    pub fn asks_for_no_inputs(&self) -> &'static str {
        match &self.draft {
            Draft::Polynomial(_) | Draft::StateSpace(_) => "`nb` 0",
            Draft::NonlinearArx(_) => "`nu` 0",
            Draft::Process(_) | Draft::Equations(_) => "another `model`",
        }
    }

    /// Whether rows may be any time apart.
    pub fn takes_any_clock(&self) -> bool {
        matches!(self.draft, Draft::Process(_) | Draft::Equations(_))
    }

    /// Whether the fit takes memory for little more than the log itself.
    pub fn is_one_step(&self) -> bool {
        matches!(&self.draft, Draft::Polynomial(draft) if draft.is_one_step())
    }

    /// Whether the options go with so many inputs.
    ///
    /// # Errors
    /// [`Error::Argument`] for lists that are not one value for each.
    pub fn check_inputs(&self, count: usize) -> Result<(), Error> {
        match &self.draft {
            Draft::Polynomial(draft) => draft.orders.of(count).map(|_| ()),
            Draft::StateSpace(_) | Draft::Process(_) | Draft::NonlinearArx(_) | Draft::Equations(_) => Ok(()),
        }
    }

    /// The plan for the channels of a log.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go with so many channels.
    pub fn plan(self, inputs: Vec<String>, outputs: Vec<String>) -> Result<FitPlan, Error> {
        let inputs = if self.is_driven() { inputs } else { Vec::new() };
        let names = |names: &[String]| names.iter().cloned().map(ColumnName).collect();
        let options = FitOptions { input: names(&inputs), output: names(&outputs), ..self.options };
        let plan = match self.draft {
            Draft::Polynomial(draft) => KindPlan::Polynomial(draft.plan(inputs, outputs)?),
            Draft::StateSpace(draft) => KindPlan::StateSpace(draft.plan(inputs, outputs)?),
            Draft::Process(draft) => KindPlan::Process(draft.plan(inputs, outputs)?),
            Draft::NonlinearArx(draft) => KindPlan::NonlinearArx(draft.plan(inputs, outputs)?),
            Draft::Equations(_) => {
                return Err(Error::argument("grey", "equations name their own channels"));
            }
        };
        Ok(FitPlan { options, plan })
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

    /// What is asked of a fit of equations.
    ///
    /// # Errors
    /// [`Error::Argument`] for options of another kind of model.
    pub fn equations_plan(&self) -> Result<&EquationsPlan, Error> {
        match &self.draft {
            Draft::Equations(plan) => Ok(plan),
            _ => Err(Error::argument("grey", "the options ask for another kind of model")),
        }
    }

    /// Fits a process to a frequency response.
    ///
    /// # Errors
    /// As for [`fit_process_to_response`]; [`Error::Argument`] for options of another kind of model.
    pub fn fit_response(self, response: &MeasuredResponse, monitor: Monitor<'_>) -> Result<Report, Error> {
        let Draft::Process(draft) = self.draft else {
            return Err(Error::argument("from", "the options ask for another kind of model than a process"));
        };
        let report = fit_process_to_response(response, &draft.plan_of_response(), monitor)?;
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
        let report = match &self.plan {
            KindPlan::Polynomial(plan) => {
                crate::report::identify_monitored(log.into_owned(), sources, plan, monitor)
            }
            KindPlan::StateSpace(plan) => {
                crate::report::fit_state_space_monitored(&log, sources, plan, monitor)
            }
            KindPlan::Process(plan) => fit_process(&log, sources, plan, monitor),
            KindPlan::NonlinearArx(plan) => fit_nonlinear_arx_monitored(&log, sources, plan, monitor),
        };
        Ok(Report { plan: Some(self.options.clone()), ..report? })
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
        let pending = match &self.plan {
            KindPlan::Polynomial(plan) => PendingEvaluation::new(log.into_owned(), sources, plan, monitor)?,
            KindPlan::StateSpace(plan) => PendingEvaluation::of_states(&log, sources, plan, monitor)?,
            KindPlan::Process(plan) => PendingEvaluation::of(fit_process(&log, sources, plan, monitor)?),
            KindPlan::NonlinearArx(plan) => {
                PendingEvaluation::of(fit_nonlinear_arx_monitored(&log, sources, plan, monitor)?)
            }
        };
        Ok(pending.with_plan(&self.options))
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
        match &self.plan {
            KindPlan::Polynomial(Plan { choice: Choice::Known(_), .. })
            | KindPlan::StateSpace(_)
            | KindPlan::NonlinearArx(_) => Ok(()),
            KindPlan::Polynomial(_) => Err(Error::argument(
                "stream",
                "one pass over the log makes one model; give its orders, such as `na` 2 and `nb` 2",
            )),
            KindPlan::Process(_) => Err(Error::argument(
                "stream",
                "a process in continuous time needs its whole log; leave it out",
            )),
        }
    }

    /// How many rows of the part before it a part of a log needs.
    pub fn lags(&self) -> usize {
        match &self.plan {
            KindPlan::Polynomial(Plan { choice: Choice::Known(orders), .. }) => orders.maximum_lag(),
            KindPlan::Polynomial(_) | KindPlan::Process(_) => 0,
            KindPlan::StateSpace(plan) => plan.lags(),
            KindPlan::NonlinearArx(plan) => plan.lags(),
        }
    }

    /// The normal equations of a part of a log, of which the first `past` rows are of the part before it.
    ///
    /// # Errors
    /// As for [`NormalEquations::new`], and as for [`check_pieces`](Self::check_pieces).
    pub fn pieces(&self, log: &Log, sources: &[Source], past: usize) -> Result<NormalEquations, Error> {
        match &self.plan {
            KindPlan::Polynomial(plan) => NormalEquations::new(log, sources, plan, past),
            KindPlan::StateSpace(plan) => NormalEquations::of_states(log, sources, plan, past),
            KindPlan::NonlinearArx(plan) => NormalEquations::of_nonlinear_arx(log, sources, plan, past),
            KindPlan::Process(_) => Err(self.check_pieces().err().unwrap_or(Error::Interrupted)),
        }
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
        match &self.plan {
            KindPlan::Polynomial(plan) => Ok(plan),
            _ => Err(Error::argument("model", "this is for models of polynomials; name one, such as oe")),
        }
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
    Ok(EquationsPlan { estimate, validate, split, search: search::search(options)? })
}

/// What is wrong with the value of an option.
fn of_option(option: &str, error: Error) -> Error {
    match error {
        Error::Argument { message, .. } => Error::argument(option, message),
        other => other,
    }
}
