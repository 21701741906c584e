//! From models with their scores to a choice.

use std::cmp::Ordering;

use super::candidates::{Compared, total};
use super::compare::Outcome;
use super::prose::{both, described, models, named};
use super::winners::winners;
use super::{Best, Candidate, Path, SelectedModel, Selection, Task};
use crate::Error;
use crate::estimate::{Method, estimate_of_channels};

/// Models of a table.
const BEST: usize = 50;
/// The smallest model within this fraction of the least cost on held-out samples is taken.
const CLOSE: f64 = 0.01;

/// The choice among models that were compared; `path` is none where there was no grid.
///
/// # Errors
/// What a fit of the smallest model says, if the data determine none.
pub(super) fn ranked(task: &Task<'_>, outcome: Outcome, path: Option<Path>) -> Result<SelectedModel, Error> {
    let Outcome { models: compared, failed, hopeless, samples, remarks, smallest, drift } = outcome;
    let by_held_out_mse = task.select.is_held_out();
    let mut compared: Vec<&Compared> = compared.iter().collect();
    compared.sort_by(|a, b| better(&a.scored, &b.scored, by_held_out_mse));
    // With ranges of orders the criterion alone decides.
    let on_circle = |model: &&Compared| {
        path.is_none() && !is_exact(&model.scored, by_held_out_mse) && model.has_ended_on_circle()
    };
    let last = compared.iter().filter(|model| on_circle(model)).count();
    compared.sort_by_key(on_circle);
    let order: Vec<&Candidate> = compared.iter().map(|model| &model.scored).collect();
    let (Some(&first), count) = (order.first(), compared.len()) else {
        if let Some(orders) = smallest {
            let method = Method::PredictionError(task.search.clone());
            let Task { inputs, initial, monitor, .. } = *task;
            estimate_of_channels(&task.named_record(), inputs, &orders, &method, initial, monitor)?;
        }
        return Err(Error::undetermined(
            Vec::new(),
            format!(
                "the data determine none of the {failed} models on the {samples} samples that all of them have; give more \
                 rows, excite the input more, or lower the orders"
            ),
        ));
    };
    let mut chosen = first;
    if by_held_out_mse {
        let limit = first.held_out_mse.map_or(f64::INFINITY, |least| least * (1.0 + CLOSE));
        let close = order.iter().take_while(|model| model.held_out_mse.is_some_and(|cost| cost <= limit));
        // The best of equal size comes first.
        chosen = close.min_by_key(|model| model.parameters).unwrap_or(&first);
    }
    let winners = winners(task.focus, &compared, total(task.estimation));
    if let Some(winners) = winners {
        chosen = order[winners.chosen];
    }
    let second = order.iter().find(|model| model.orders != chosen.orders);
    let mut of_size: Vec<Candidate> = Vec::new();
    let mut by_size = order.clone();
    by_size.sort_by_key(|model| model.parameters);
    for model in by_size {
        if of_size.last().is_none_or(|last| last.parameters < model.parameters) {
            of_size.push(model.clone());
        }
    }
    let mut steps = remarks;
    steps.push(format!("Compared {} on {samples} common samples by {}.", models(count), named(task.select)));
    if hopeless > 0 {
        steps.push(format!(
            "Not fitted: {} more, as larger ones with the same plant show that their MDL cannot be the least.",
            models(hopeless)
        ));
    }
    if failed > 0 {
        steps.push(format!("{} skipped: not identifiable from this log.", models(failed)));
    }
    if last > 0 {
        steps.push(format!("Models whose C ended on the unit circle come last: {last}."));
    }
    if by_held_out_mse && first.orders != chosen.orders {
        steps.push(format!("Least: {}.", described(first, task.select)));
    }
    let why = if by_held_out_mse { ", the smallest within 1 % of the least" } else { "" };
    steps.extend(winners.iter().flat_map(|winners| both(winners, &order, task)));
    steps.push(format!("Chosen: {}{why}.", described(chosen, task.select)));
    if let Some(second) = second {
        steps.push(format!("Second: {}.", described(second, task.select)));
    }
    let initial_parameters = compared.iter().find(|model| model.scored.orders == chosen.orders);
    let initial_parameters = initial_parameters.and_then(|model| model.initial_parameters.clone());
    let selection = Selection {
        select: task.select,
        focus: task.focus,
        path,
        steps,
        samples,
        models: count,
        failed,
        hopeless,
        delays: Vec::new(),
        chosen: chosen.clone(),
        second: second.copied().cloned(),
        winners: winners.map(|winners| Best {
            prediction: order[winners.prediction].clone(),
            simulation: order[winners.simulation].clone(),
        }),
        least: by_held_out_mse.then(|| first.clone()),
        best: order.iter().take(BEST).copied().cloned().collect(),
        of_size,
        level_window: drift.map(|drift| drift.window),
        noise_integrates: drift.is_some_and(|drift| drift.integrates),
        processes: Vec::new(),
        state_space: None,
    };
    Ok(SelectedModel { selection, decisions: Vec::new(), initial_parameters })
}

/// Exact models first, the smallest of them first; then by score. Of equal ones the smaller, then the one that was made
/// first.
fn better(a: &Candidate, b: &Candidate, by_held_out_mse: bool) -> Ordering {
    let score = |model: &Candidate| {
        if is_exact(model, by_held_out_mse) {
            f64::NEG_INFINITY
        } else {
            model.score.unwrap_or(f64::INFINITY)
        }
    };
    score(a).total_cmp(&score(b)).then(a.parameters.cmp(&b.parameters))
}

fn is_exact(model: &Candidate, by_held_out_mse: bool) -> bool {
    if by_held_out_mse { model.held_out_mse == Some(0.0) } else { model.mse == 0.0 }
}
