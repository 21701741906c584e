//! Fits whose figures wait until somebody asks for them.

use super::evaluate::evaluate;
use super::fitted_rows::{estimation_record, estimation_start};
use super::schema::Report;
use super::warnings::{at_the_stability_boundary, unstable_plant};
use crate::Error;
use crate::data::{Log, Offset};
use crate::model::{PolynomialModel, StateSpaceModel};
use crate::plan::FitOptions;
use crate::respond::PolynomialOnLog;
use crate::respond::state_space::StateSpaceOnLog;
use crate::select::{Focus, Grid};
use crate::validate::Part;

/// A fit before its figures: they take several times as long as least squares, and not every caller needs them.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::Orders;
/// use thetahat::report::{PendingEvaluation, Plan, StateSpacePlan, fit_state_space, identify};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let y = [vec![0.0], u[..199].to_vec()].concat();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let plan = Plan::new(&["u"], "y", Orders::arx(0, &[1], &[1])?);
/// let pending = PendingEvaluation::new(log.clone(), &[], &plan, &|_| ControlFlow::Continue(()))?;
/// assert_eq!(pending.evaluate(log.clone())?, identify(log.clone(), &[], &plan)?);
///
/// let plan = StateSpacePlan { orders: Some(1..=1), ..StateSpacePlan::new(&["u"], &["y"]) };
/// let pending = PendingEvaluation::of_states(&log, &[], &plan, &|_| ControlFlow::Continue(()))?;
/// assert_eq!(pending.evaluate(log.clone())?, fit_state_space(&log, &[], &plan)?);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PendingEvaluation {
    report: Report,
    /// What the figures are of; none: they are there.
    open: Option<Open>,
}

/// What the figures are computed of.
#[derive(Debug, Clone)]
pub(super) enum Open {
    Polynomial(Box<OpenPolynomial>),
    StateSpace(Box<StateSpaceModel>),
}

#[derive(Debug, Clone)]
pub(super) struct OpenPolynomial {
    pub(super) model: PolynomialModel,
    pub(super) grid: Option<Grid>,
    pub(super) focus: Focus,
    /// What was taken from the output before the fit, and after it.
    pub(super) taken: [Offset; 2],
}

impl PendingEvaluation {
    /// Of this model the figures wait.
    pub(super) fn open(report: Report, open: Open) -> Self {
        Self { report, open: Some(open) }
    }

    /// The figures are there.
    pub(super) fn done(report: Report) -> Self {
        Self { report: report.with_purpose(), open: None }
    }

    /// The figures are there, in a report of any kind of model.
    pub(crate) fn of(report: Report) -> Self {
        Self { report, open: None }
    }

    /// The same with the options that it was made of in the report.
    pub(crate) fn with_plan(mut self, options: &FitOptions) -> Self {
        self.report.plan = Some(options.clone());
        self
    }

    /// The report so far: without figures of how well the model fits, and what they give reason to warn of.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The whole report, given the same log again: its values are not compared.
    ///
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there.
    pub fn evaluate(self, mut log: Log) -> Result<Report, Error> {
        match &self.open {
            None => return Ok(self.report),
            Some(Open::Polynomial(open)) => {
                for signal in &open.model.inputs {
                    log.remove(&signal.name, &signal.offset);
                }
                // One after the other as the fit did: their sum has another rounding.
                for offset in open.taken.iter().filter(|offset| **offset != Offset::default()) {
                    log.remove(&open.model.output.name, offset);
                }
            }
            Some(Open::StateSpace(model)) => {
                for signal in model.inputs.iter().chain(&model.outputs) {
                    log.remove(&signal.name, &signal.offset);
                }
            }
        }
        self.evaluate_on(&log)
    }

    /// The same on deviations.
    pub(super) fn evaluate_on(self, log: &Log) -> Result<Report, Error> {
        let Self { mut report, open } = self;
        match open {
            None => {}
            Some(Open::Polynomial(open)) => evaluate_polynomials(&mut report, &open, log)?,
            Some(Open::StateSpace(model)) => {
                let own = StateSpaceOnLog::new(&model, log, &report.data.estimation, None)?;
                evaluate(&mut report, &own, Part::Estimation, Focus::Auto);
                for (part, rows) in report.data.held_out() {
                    let held_out = StateSpaceOnLog::new(&model, log, &rows, None)?;
                    evaluate(&mut report, &held_out, part, Focus::Auto);
                }
            }
        }
        Ok(report.with_purpose())
    }
}

fn evaluate_polynomials(report: &mut Report, open: &OpenPolynomial, log: &Log) -> Result<(), Error> {
    let OpenPolynomial { model, grid, focus, .. } = open;
    let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
    // The rows of the fit as it saw them; other rows begin in the middle of a run.
    let seen = estimation_record(report, model, log, &inputs)?;
    let start = estimation_start(report, model);
    let own = PolynomialOnLog::new(model, log, &report.data.estimation, None)?.with_predictions(seen, start);
    evaluate(report, &own, Part::Estimation, *focus);
    for (part, rows) in report.data.held_out() {
        evaluate(report, &PolynomialOnLog::new(model, log, &rows, None)?, part, *focus);
    }
    if let Some(grid) = grid {
        report.warnings.extend(at_the_stability_boundary(&model.orders, grid));
    }
    report.warnings.extend(unstable_plant(report));
    Ok(())
}
