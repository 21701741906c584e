//! How close responses come.

use crate::figures::{fixed, number, short};
use crate::model::Model;
use crate::validate::Fit;

use super::tree::{Sections, Table, columns, figure as cell, word};
use super::words::{part, rows, stable, start};

/// Why there may be no figure.
pub(super) const NO_FIT: &str = "the output is constant, no sample counts, or the response overflows";

/// The figures of the absolute errors.
type ErrorFigure = (&'static str, fn(&Fit) -> Option<f64>);
pub(super) const ERRORS: [ErrorFigure; 2] =
    [("mean |e|", |fit| fit.mean_absolute_error), ("largest |e|", |fit| fit.largest_error)];

/// Whether fits are of several outputs.
pub(super) fn several(fits: &[Fit]) -> bool {
    fits.iter().any(|fit| fit.output != fits[0].output)
}

pub(super) fn fits(fits: &[Fit]) -> Table {
    let [mean, largest] = ERRORS.map(|(name, _)| name);
    let head = ["output", "part", "rows", "horizon", "initial", "samples", "fit [%]", "RMSE", mean, largest];
    let mut table = columns("Fit", head).words(&[1, 2, 3, 4]).none(NO_FIT).on_pages(&[8, 9]);
    table = table.without(if several(fits) { &[] } else { &[0] });
    if fits.iter().all(|fit| fit.part.is_none()) {
        table = table.in_text(&[1]);
    }
    for fit in fits {
        let own = [
            word(&fit.output),
            word(fit.part.map_or("", part)),
            word(rows(&fit.rows)),
            word(fit.horizon),
            word(start(fit.initial)),
            word(fit.samples),
            cell(fit.percent, |percent| fixed(percent, 3)),
            cell(fit.rmse, number),
        ];
        table.row(own.into_iter().chain(ERRORS.map(|(_, of)| cell(of(fit), number))));
    }
    table
}

/// One line that says how close a response is.
pub fn figure(fit: &Fit) -> String {
    let percent = fit.percent.map_or_else(|| "none".to_owned(), |percent| format!("{} %", fixed(percent, 3)));
    let rmse = fit.rmse.map_or_else(|| "none".to_owned(), number);
    format!(
        "fit {percent}, RMSE {rmse} ({}, initial {}, rows {}, {} samples)",
        fit.horizon,
        start(fit.initial),
        rows(&fit.rows),
        fit.samples
    )
}

/// The model in a sentence, and how close it comes.
pub(super) fn lead(on: &mut Sections, model: &Model, fits: &[Fit]) {
    let stable = model.stability().map_or(String::new(), |is_stable| format!(", {}", stable(is_stable)));
    on.line(format!("{}.", model.headline()));
    on.line(format!(
        "Sample time {} s, {} parameters{stable}.",
        short(model.sample_time()),
        model.free_parameters()
    ));
    let closeness = |fit: &Fit| {
        let on = fit.part.map_or_else(String::new, |own| format!(", {} rows", part(own)));
        let of = if model.outputs().len() > 1 { format!("{}, ", fit.output) } else { String::new() };
        Some(format!("{} % ({of}{}{on})", fixed(fit.percent?, 1), fit.horizon))
    };
    let figures: Vec<String> = fits.iter().filter_map(closeness).collect();
    if !figures.is_empty() {
        on.line(format!("Fit: {}.", figures.join(", ")));
    }
}
