//! A choice in sentences.

use super::winners::Winners;
use super::{Candidate, Focus, Select, Task};
use crate::figures::{fixed, scientific};
use crate::respond::Horizon;

/// The best models for two purposes, and why one of them was taken. One figure is given of each: the one that decided.
pub(super) fn both(winners: &Winners, order: &[&Candidate], task: &Task<'_>) -> Vec<String> {
    let Winners { prediction, simulation, chosen } = *winners;
    let how = match task.focus.horizon() {
        Horizon::FreeRun => "free run".to_owned(),
        horizon => format!("prediction {horizon}"),
    };
    let percent = |k: usize| order[k].held_out.map(|seen| format!("{} %", fixed(seen.percent(), 1)));
    let (own, other) = (percent(prediction), percent(simulation).unwrap_or_default());
    let on_blocks = match &own {
        Some(own) => format!("its {how} fits {own} of held-out blocks"),
        None => "it was not evaluated without some of the rows, or these do not determine it".to_owned(),
    };
    let mut words =
        vec![format!("Best one step ahead: {}; {on_blocks}.", described(order[prediction], task.select))];
    if simulation == prediction {
        words.extend(own.is_some().then(|| format!("No other model has a better {how} on held-out blocks.")));
    } else if !other.is_empty() {
        words.push(format!("Best {how} on held-out blocks: {}, {other}.", order[simulation].orders));
    }
    let auto = task.focus == Focus::Auto && simulation != prediction;
    words.extend(match own {
        _ if chosen != prediction && chosen != simulation => Some(
            "Taken: a model that is unstable however the rows are cut; none that is stable comes near it."
                .to_owned(),
        ),
        Some(own) if auto && chosen == simulation => {
            Some(format!("Taken for its better {how} on held-out blocks: {other} against {own}."))
        }
        Some(own) if auto => Some(format!(
            "Taken: the best one step ahead, as {other} against {own} is no clear difference; `focus` simulation takes the other."
        )),
        None if auto => Some(
            "Taken: the best one step ahead, as the two cannot be compared; `focus` simulation takes the other.".to_owned(),
        ),
        _ => None,
    });
    words
}

pub(super) fn models(count: usize) -> String {
    if count == 1 { "1 model".to_owned() } else { format!("{count} models") }
}

pub(super) fn named(select: Select) -> &'static str {
    match select {
        Select::Criterion(criterion) => criterion.name(),
        Select::Validation => "the mean of e^2 on the validation rows",
        Select::Cv => "cross-validation",
    }
}

/// A model with its score.
pub(super) fn described(model: &Candidate, select: Select) -> String {
    let score = match model.score {
        Some(score) => number(score),
        None => "not defined: the model is exact".to_owned(),
    };
    let name = match select {
        Select::Validation | Select::Cv => "mean of e^2",
        _ => named(select),
    };
    format!("{} ({name} {score})", model.orders)
}

/// Five digits or more.
pub(super) fn number(value: f64) -> String {
    if (0.01..1e5).contains(&value.abs()) { fixed(value, 4) } else { scientific(value, 4) }
}
