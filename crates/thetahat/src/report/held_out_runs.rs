//! The free runs of the winners of a choice on rows that neither was fitted to.

use std::ops::ControlFlow;

use super::identify::identify;
use super::plan::Plan;
use super::process::{ProcessPlan, fit_process};
use super::schema::Report;
use super::state_space::{StateSpacePlan, fit_state_space};
use super::validation::{Validated, ValidationPlan, validate};
use crate::Error;
use crate::data::{Detrend, Log, Rows, between};
use crate::estimate::Constant;
use crate::model::StateSpaceModel;
use crate::respond::Horizon;

/// The rows that a choice was made on are cut into this many parts, of which the last is held out.
const PARTS: usize = 3;

/// Where a choice found one model for prediction and another for simulation, or took a process or a model in state
/// space: these, by name, fitted to the first two thirds of the rows that it was made on, and evaluated on the last
/// third of `log`. None where there was no such choice, and none of a model that these rows do not determine.
///
/// Cost: a fit of each.
///
/// # Errors
/// [`Error::Argument`] and [`Error::Data`] if the log does not have the report's channels and rows.
pub fn held_out_runs(report: &Report, log: &Log) -> Result<Vec<(String, Validated)>, Error> {
    let Some(selection) = &report.selection else { return Ok(Vec::new()) };
    let Some(winners) = &selection.winners else { return Ok(Vec::new()) };
    let (prediction, simulation) = (&winners.prediction.orders, &winners.simulation.orders);
    let process = report.model.as_process();
    let order = report.model.as_state_space().map(StateSpaceModel::order);
    let alone = process.is_none() && order.is_none();
    if selection.focus.horizon() != Horizon::FreeRun || (prediction == simulation && alone) {
        return Ok(Vec::new());
    }
    let data = &report.data;
    let rows = data.split.as_ref().map_or(&data.estimation, |parts| &parts.estimation);
    let count: usize = rows.iter().map(Rows::len).sum();
    let last = (PARTS - 1) * count / PARTS;
    let (fitted, left_out) = (between(rows, 0, last), between(rows, last, count));
    let names: Vec<&str> = report.model.inputs().iter().map(|input| input.name.as_str()).collect();
    let Some(output) = report.model.outputs().first().map(|output| output.name.as_str()) else {
        return Ok(Vec::new());
    };
    let with_level = report.estimation.level.is_some();
    let mut winners = vec![("for prediction", prediction)];
    winners.extend((prediction != simulation).then_some(("for simulation", simulation)));
    let refits = winners.into_iter().map(|(purpose, orders)| {
        let plan = Plan {
            estimate: fitted.clone(),
            detrend: if process.is_some() { Detrend::Mean } else { data.detrend.parse()? },
            prefilter: data.prefilter,
            constant: match order {
                // What is known of the level is that of the model in state space.
                Some(_) => Constant::Auto,
                None if with_level => Constant::Yes,
                None => Constant::No,
            },
            trend: report.estimation.slope.is_some(),
            ..Plan::new(&names, output, orders.clone())
        };
        Ok((format!("{purpose}: {orders}"), identify(log.clone(), &[], &plan)))
    });
    let mut refits = refits.collect::<Result<Vec<_>, Error>>()?;
    if let Some((model, &structure)) = process.and_then(|model| Some((model, model.structures.first()?))) {
        let plan = ProcessPlan {
            structures: model.structures.clone(),
            estimate: fitted.clone(),
            trend: report.estimation.slope.is_some(),
            ..ProcessPlan::new(&names, output, structure)
        };
        let refit = fit_process(log, &[], &plan, &|_| ControlFlow::Continue(()));
        refits.push((format!("process: {structure}"), refit));
    }
    if let Some(order) = order {
        let plan = StateSpacePlan {
            estimate: fitted,
            detrend: data.detrend.parse()?,
            constant: if with_level { Constant::Yes } else { Constant::No },
            orders: Some(order..=order),
            ..StateSpacePlan::new(&names, &[output])
        };
        refits.push((format!("state space: order {order}"), fit_state_space(log, &[], &plan)));
    }
    let mut runs = Vec::new();
    for (name, refit) in refits {
        let refit = match refit {
            Ok(refit) => refit,
            Err(Error::Undetermined { .. }) => continue,
            Err(error) => return Err(error),
        };
        let plan = ValidationPlan { rows: left_out.clone(), ..ValidationPlan::default() };
        let validated = validate(&refit, None, log, &[], &plan)?;
        let figure = validated.validation.fit.iter().find(|fit| fit.horizon == Horizon::FreeRun);
        let percent = figure.and_then(|fit| fit.percent);
        let percent =
            percent.map_or_else(String::new, |value| format!(", {} %", crate::figures::fixed(value, 1)));
        runs.push((format!("{name}{percent}"), validated));
    }
    Ok(runs)
}
