//! How a model was chosen.

use crate::figures::{fixed, number};
use crate::report::Report;
use crate::select::{Candidate, Select};

use super::charts;
use super::tree::{Sections, columns, figure, word};
use super::words::{orders_legend, rows};

/// The title of the section.
pub(super) const TITLE: &str = "Order search";
/// This many of the best are in a text, and on a page; the report has more.
const SHOWN: usize = 8;
const SHOWN_ON_PAGES: usize = 20;

/// The parts that the rows were cut into, what was done, and the best models.
pub(super) fn selection(on: &mut Sections, report: &Report) {
    on.section(TITLE);
    // Pages have it with the data.
    if let (Some(parts), false) = (&report.data.split, on.is_page()) {
        let named =
            [("estimation", &parts.estimation), ("validation", &parts.validation), ("test", &parts.test)];
        let named = named.iter().filter(|(_, rows)| !rows.is_empty());
        let named: Vec<String> = named.map(|(name, parts)| format!("{name} {}", rows(parts))).collect();
        on.line(format!("split: {}; the model is fitted to all but the test part", named.join(", ")));
        on.gap();
    }
    report.decisions.iter().for_each(|decision| on.line(decision.to_string()));
    if !report.decisions.is_empty() {
        on.gap();
    }
    // The linear models that a nonlinear one was compared with are on pages alone.
    let shown = report.model.as_nonlinear_arx().is_none() || on.is_page();
    let Some(selection) = report.selection.as_ref().filter(|_| shown) else { return };
    selection.steps.iter().for_each(|step| on.line(step));
    on.gap();
    if selection.failed > 0 && on.is_page() {
        on.line(format!("Models skipped as not identifiable from this log: {}.", selection.failed));
    }
    on.chart(|| charts::search(selection));
    if !selection.delays.is_empty() {
        on.chart(|| charts::delays(selection));
    }
    let held_out = selection.best.iter().any(|scored| scored.held_out_mse.is_some());
    let criterion = match selection.select {
        Select::Criterion(criterion) => Some(criterion),
        Select::Validation | Select::Cv => None,
    };
    let head = ["", "model", "parameters", "MSE", "MSE held out", charts::score(selection.select)];
    let caption =
        format!("The best models of the search, on the {} samples that all share", selection.samples);
    let mut table = columns(caption, head)
        .words(&[1])
        .none("not defined: the model is exact, or has too many parameters")
        .without(if held_out { &[] } else { &[4] })
        // Of one that has no column of its own.
        .on_pages(if criterion.is_some() { &[] } else { &[5] });
    let score: fn(f64) -> String = match criterion {
        Some(criterion) if criterion.is_logarithmic() => |score| fixed(score, 4),
        _ => number,
    };
    // The smallest model within a percent of the least may stand far behind it.
    let chosen = std::iter::once(&selection.chosen);
    let others = selection.best.iter().filter(|scored| scored.orders != selection.chosen.orders);
    let most = if on.is_page() { SHOWN_ON_PAGES } else { SHOWN };
    let shown: Vec<&Candidate> = chosen.chain(others).take(most).collect();
    for (position, scored) in shown.iter().enumerate() {
        let role = match &selection.least {
            _ if position == 0 && report.model.as_polynomial().is_none() => "polynomial",
            _ if position == 0 => "chosen",
            Some(least) if least.orders == scored.orders => "least",
            _ if selection.second.as_ref().is_some_and(|second| second.orders == scored.orders) => "second",
            _ => "",
        };
        table.row([
            word(role),
            word(&scored.orders),
            word(scored.parameters),
            figure(scored.mse, number),
            figure(scored.held_out_mse, number),
            figure(scored.score, score),
        ]);
    }
    table.legend(orders_legend(shown.iter().map(|scored| &scored.orders)));
    if let Some(name) = criterion.map(|criterion| criterion.name()) {
        let what = if name == "FPE" { "" } else { " for each sample," };
        table.legend(format!(
            "{name}:{what} on the {} samples that all models share; below on all samples of the fit",
            selection.samples
        ));
    }
    on.table(table);
}
