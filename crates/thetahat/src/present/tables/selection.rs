//! How a model was chosen, for people.

use crate::figures::{fixed, number};
use crate::report::Report;
use crate::select::{Candidate, Select, Selection};

use super::orders_legend;
use super::text::{Text, columns, or_dash};

/// This many of the best are shown; the report has more.
const SHOWN: usize = 8;

/// The parts that the rows were cut into, what was done, and the best models.
pub(super) fn selection(text: &mut Text, report: &Report) {
    if let Some(parts) = &report.data.split {
        let named =
            [("estimation", &parts.estimation), ("validation", &parts.validation), ("test", &parts.test)];
        let named = named.iter().filter(|(_, rows)| !rows.is_empty());
        let named: Vec<String> = named.map(|(name, rows)| format!("{name} {}", super::rows(rows))).collect();
        text.line(&format!("split: {}; the model is fitted to all but the test part", named.join(", ")));
        text.line("");
    }
    report.decisions.iter().for_each(|decision| text.line(&decision.to_string()));
    if !report.decisions.is_empty() {
        text.line("");
    }
    let Some(selection) = &report.selection else { return };
    selection.steps.iter().for_each(|step| text.line(step));
    text.line("");
    let held_out = selection.best.iter().any(|scored| scored.held_out_mse.is_some());
    let score = score(selection);
    let mut names = vec!["", "model", "parameters", "MSE"];
    names.extend(held_out.then_some("MSE held out").into_iter().chain(score));
    let mut table =
        columns(&names).words(&[1]).none("not defined: the model is exact, or has too many parameters");
    // The smallest model within a percent of the least may stand far behind it.
    let chosen = std::iter::once(&selection.chosen);
    let others = selection.best.iter().filter(|scored| scored.orders != selection.chosen.orders);
    let shown: Vec<&Candidate> = chosen.chain(others).take(SHOWN).collect();
    for (position, scored) in shown.iter().enumerate() {
        let role = match &selection.least {
            _ if position == 0 && report.model.as_polynomial().is_none() => "polynomial",
            _ if position == 0 => "chosen",
            Some(least) if least.orders == scored.orders => "least",
            _ if selection.second.as_ref().is_some_and(|second| second.orders == scored.orders) => "second",
            _ => "",
        };
        let mut row = vec![
            role.to_owned(),
            scored.orders.to_string(),
            scored.parameters.to_string(),
            number(scored.mse),
        ];
        row.extend(held_out.then(|| or_dash(scored.held_out_mse, number)));
        row.extend(score.map(|_| criterion(selection.select, scored)));
        table.row(row);
    }
    table.legend(orders_legend(shown.iter().map(|scored| &scored.orders)));
    if let Some(score) = score {
        let what = if score == "FPE" { "" } else { " for each sample," };
        table.legend(format!(
            "{score}:{what} on the {} samples that all models share; below on all samples of the fit",
            selection.samples
        ));
    }
    text.table(table);
}

/// The name of a score that has no column of its own.
fn score(selection: &Selection) -> Option<&'static str> {
    match selection.select {
        Select::Criterion(criterion) => Some(criterion.name()),
        Select::Validation | Select::Cv => None,
    }
}

fn criterion(select: Select, scored: &Candidate) -> String {
    let logarithmic = matches!(select, Select::Criterion(criterion) if criterion.is_logarithmic());
    or_dash(scored.score, |score| if logarithmic { fixed(score, 4) } else { number(score) })
}
