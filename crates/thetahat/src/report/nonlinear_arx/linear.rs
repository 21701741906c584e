//! The linear model that the data choose: it says lags that nobody named, and competes with nonlinear ones.

use super::plan::{InputLags, NonlinearArxPlan};
use crate::Error;
use crate::data::{Log, Rows, Source};
use crate::estimate::{RunFigures, TermStep};
use crate::model::Model;
use crate::optimize::Monitor;
use crate::report::{Plan, Report, apply, identify_monitored};
use crate::respond::{Horizon, InitialCondition};
use crate::select::{Automatic, Choice};

/// The plan of a linear model of the same channels and rows, all of which the data choose. `output` is the only one.
fn linear(plan: &NonlinearArxPlan, output: &str) -> Plan {
    let inputs: Vec<&str> = plan.inputs.iter().map(String::as_str).collect();
    Plan {
        estimate: plan.estimate.clone(),
        validate: plan.validate.clone(),
        split: plan.split,
        detrend: plan.detrend,
        offsets: plan.offsets.clone(),
        ..Plan::new(&inputs, output, Choice::Automatic(Automatic::default()))
    }
}

/// The plan with the lags of that model: as many past outputs as A or F reads, and of each input those of B and the one before them, as a
/// nonlinear plant may answer sooner.
///
/// # Errors
/// [`Error::Argument`] for several outputs; those of the choice.
pub(super) fn from_a_linear_choice(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    monitor: Monitor<'_>,
) -> Result<NonlinearArxPlan, Error> {
    let [output] = &*plan.outputs else {
        return Err(Error::argument("ny", "lags are chosen for one output; name those of several"));
    };
    let report = identify_monitored(log.clone(), sources, &linear(plan, output), monitor)?;
    // A step test may come to a process, which has no lags: then those that stand in the plan are as good.
    let Model::Polynomial(linear) = &report.model else { return Ok(plan.clone()) };
    let orders = &linear.orders;
    let past = orders.nf.iter().copied().fold(orders.na, usize::max).max(1);
    let input_lags = orders.nb.iter().zip(&orders.nk).map(|(&nb, &nk)| {
        let sooner = nk.min(1);
        InputLags { lags: nb + sooner, delay: nk - sooner }
    });
    Ok(NonlinearArxPlan { output_lags: vec![past], input_lags: input_lags.collect(), ..plan.clone() })
}

/// The linear model that the data choose from some rows, judged on others: its row of the table, and its squared errors there. None for
/// several outputs, and where these rows determine none.
///
/// # Errors
/// Those of the choice.
pub(super) fn judged(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    (rows, held_out): (&[Rows], &[Rows]),
    monitor: Monitor<'_>,
) -> Result<Option<(TermStep, Vec<f64>)>, Error> {
    let [output] = &*plan.outputs else { return Ok(None) };
    let own = Plan { estimate: rows.to_vec(), validate: Vec::new(), split: None, ..linear(plan, output) };
    let report = match identify_monitored(log.clone(), sources, &own, monitor) {
        Ok(report) => report,
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        Err(_) => return Ok(None),
    };
    let (horizon, initial) = match plan.inputs.is_empty() {
        true => (Horizon::Steps { steps: 1 }, InitialCondition::Drop),
        false => (Horizon::FreeRun, InitialCondition::Estimate),
    };
    let run = |rows: &[Rows]| -> Option<(RunFigures, Vec<f64>)> {
        let applied = apply(&report.model, log, rows, None, horizon, initial).ok()?;
        let [said] = &*applied.outputs else { return None };
        let measured = said.measured.as_ref()?;
        let errors: Vec<f64> =
            measured.iter().zip(&said.predicted).map(|(measured, said)| (measured - said).powi(2)).collect();
        let fit = said.fit.as_ref()?;
        let figures = RunFigures {
            rmse: fit.rmse,
            largest_error: fit.largest_error,
            percent: fit.percent,
            in_range: fit.rmse.is_some(),
        };
        Some((figures, errors))
    };
    let (Some((own, _)), Some((fresh, errors))) = (run(rows), run(held_out)) else { return Ok(None) };
    let step = TermStep {
        term: format!("linear: {}", report.model.name()),
        parameters: report.model.parameters().len(),
        error_reduction: 0.0,
        aliases: Vec::new(),
        rmse: report.estimation.mse.sqrt(),
        free_run: Some(own),
        held_out: Some(fresh),
    };
    Ok(Some((step, errors)))
}

/// The report of the linear model, which says that no nonlinear one runs better.
///
/// # Errors
/// Those of the choice.
pub(super) fn taken(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let output = plan.outputs.first().map_or("", String::as_str);
    let mut report = identify_monitored(log.clone(), sources, &linear(plan, output), monitor)?;
    if let Some(selection) = &mut report.selection {
        selection.steps.push(
            "Polynomials and networks were tried as nonlinear ARX models: none runs better on rows held out from it.".to_owned(),
        );
    }
    Ok(report)
}
