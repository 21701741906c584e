//! Fits: what a model is, how it was found, and how it does on each part of the log.

use crate::data::Rows;
use crate::present::Layout;
use crate::report::{Report, Validated, Validation};
use crate::validate::Part;

use super::charts::{self, Shade, Stack};
use super::data;
use super::fits::lead;
use super::html::Page;
use super::kinds;
use super::outputs::{outputs, points};
use super::residuals::residuals_of_parts;
use super::tree::{Medium, Sections};
use super::words::{self, some};

/// The report's main figures.
pub fn report(report: &Report, layout: Layout) -> String {
    written(report, layout, false)
}

/// The model of a report that was converted, which has no figures of a fit.
pub fn converted(report: &Report, layout: Layout) -> String {
    written(report, layout, true)
}

fn written(report: &Report, layout: Layout, converted: bool) -> String {
    let on = &mut Sections::new(Medium::Text);
    kinds::present(on, report, converted);
    if !report.purpose.is_empty() {
        on.line(&report.purpose);
    }
    super::text::written(on, layout)
}

/// The page of a fit: what the model is, how it was found, and how it does on each part of the log.
///
/// `validated` has one entry for each part: estimation, validation, test, as far as there are any, all on the whole
/// log. `held_out` is what [`held_out_runs`](crate::report::held_out_runs) gives, or nothing. `command` is shown as
/// what made the page.
pub fn fit_page(
    report: &Report,
    validated: &[Validated],
    held_out: &[(String, Validated)],
    command: &str,
) -> String {
    let model = &report.model;
    let parts: Vec<(String, &Validated)> =
        validated.iter().map(|validated| (part_name(report, &validated.validation), validated)).collect();
    let mut document = Sections::new(Medium::Page);
    lead(&mut document, model, &report.fit);
    document.line(&report.purpose);
    outputs(&mut document, model, &parts, &shades(report), &report.fit, &report.data.logs);
    residuals_of_parts(&mut document, &parts);
    free_runs(&mut document, report, held_out);
    kinds::present(&mut document, report, false);
    document.section("Data");
    document.table(data::logs(&report.data.logs));
    document.table(data::data(report));
    let names: Vec<&str> = model.outputs().iter().map(|output| output.name.as_str()).collect();
    Page {
        title: format!("Fit of {}{}", names.join(", "), data::of(&report.data.logs)),
        warnings: &report.warnings,
        document,
        command,
        generator: &report.generator,
    }
    .write()
}

/// The free runs of the best models of a search on held-out rows.
fn free_runs(on: &mut Sections, report: &Report, held_out: &[(String, Validated)]) {
    let Some((_, Validated { signals, .. })) = held_out.first() else { return };
    let runs = held_out
        .iter()
        .filter_map(|(name, run)| Some((name, run.signals.outputs.first()?.simulated.as_deref()?)));
    let there = |run: &[f64]| {
        let first = run.iter().position(|value| value.is_finite())?;
        Some(first..run.iter().rposition(|value| value.is_finite())? + 1)
    };
    let rows = runs.clone().find_map(|(_, run)| there(run)).unwrap_or(0..0);
    let runs: Vec<(String, &[f64])> = runs.map(|(name, run)| (name.clone(), &run[rows.clone()])).collect();
    let Some(output) = signals.outputs.first() else { return };
    let stack = Stack::new(&signals.time[rows.clone()], report.model.sample_time(), points(1 + runs.len()));
    on.section("Free runs");
    on.chart(|| charts::outputs(
        "Free runs on held-out rows",
        "Measured output, and what the best models make of the inputs alone in the last third of the rows. Each was fitted to \
         the other two thirds for this picture.",
        stack.dated(&report.data.logs),
        &output.name,
        &output.measured[rows],
        &runs,
    ));
}

/// What the rows of a validation served for.
fn part_name(report: &Report, validation: &Validation) -> String {
    let named = validation.fit.iter().find_map(|fit| fit.part);
    let data = &report.data;
    let part = named.or_else(|| match &data.split {
        Some(split) if validation.rows == split.test => Some(Part::Test),
        Some(split) if validation.rows == split.validation => Some(Part::Validation),
        _ if validation.rows == data.estimation => Some(Part::Estimation),
        _ if validation.rows == data.validation => Some(Part::Validation),
        _ => None,
    });
    part.map_or_else(
        || format!("rows {}", some(&validation.rows, 20, ", ")),
        |part| words::part(part).to_owned(),
    )
}

/// The parts of the log, where there are several; else the logs, where there are several.
fn shades(report: &Report) -> Vec<Shade> {
    let data = &report.data;
    let shade = |name: &str, rows: &[Rows]| Shade { name: name.to_owned(), rows: rows.to_vec() };
    let all = match &data.split {
        Some(split) => vec![
            shade("estimation", &split.estimation),
            shade("validation", &split.validation),
            shade("test", &split.test),
        ],
        None => vec![shade("estimation", &data.estimation), shade("validation", &data.validation)],
    };
    let all: Vec<Shade> = all.into_iter().filter(|shade| !shade.rows.is_empty()).collect();
    if all.len() > 1 {
        return all;
    }
    match data.logs.as_slice() {
        [] | [_] => Vec::new(),
        logs => logs.iter().map(|log| shade(&log.file, &[log.rows])).collect(),
    }
}
