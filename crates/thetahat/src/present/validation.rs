//! Validations, and comparisons of several models.

use crate::Error;
use crate::data::Source;
use crate::estimate::{Criteria, InformationCriterion};
use crate::figures::{chance, fixed, number, three};
use crate::model::{LinearModel, Orders};
use crate::present::Layout;
use crate::report::{
    Comparison, InSample, LikelihoodRatio, Report, Requirement, Validated, Validation, compare,
};
use crate::respond::Horizon;
use crate::text::harmless;
use crate::validate::{Fit, Residuals};

use super::charts;
use super::data;
use super::fits::{ERRORS, NO_FIT, fits, lead, several};
use super::html::Page;
use super::kinds::{self, responses_of};
use super::outputs::{compared_outputs, outputs};
use super::residuals::{self, coverage, figures, noise, residuals_in, residuals_of_parts};
use super::selection;
use super::tree::{Cell, Medium, Sections, Table, columns, figure, known, word};
use super::words::{in_sample, or_dash, orders_legend, rows, some, stable, yes};

/// This many of a list are written.
const MOST: usize = 8;
/// The level of the intervals of which a comparison says the coverage.
const LEVEL: f64 = 0.95;

/// How a model does on a log, and what was required of it.
pub fn validation(found: &Validation, requirements: &[Requirement], alpha: f64, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    on.line(format!(
        "{}, {}, on {} rows {}: {}",
        or_dash(found.report.as_deref(), harmless),
        found.model,
        files(&found.logs),
        rows(&found.rows),
        match found.in_sample {
            InSample::No => "held out, the fit did not use them",
            InSample::Partly => "the model was fitted to some of them",
            InSample::Yes => "the model was fitted to them",
        }
    ));
    if let Some(orders) = &found.orders {
        on.line(orders_legend([orders]));
    }
    if let Some(is_stable) = found.stable {
        on.line(stable(is_stable));
    }
    on.gap();
    on.table(fits(&found.fit));
    on.table(errors(&found.fit));
    noise(on, "", found);
    on.gap();
    on.table(coverage("", &[(String::new(), found)]));
    residuals::residuals(on, found, alpha);
    if !requirements.is_empty() {
        let mut table = columns("Required", ["required", ""]).words(&[1]);
        for requirement in requirements {
            let met = requirement.unmet(found, alpha).is_none();
            table.row([word(requirement), word(if met { "met" } else { "not met" })]);
        }
        on.table(table);
    }
    super::text::written(on, layout)
}

/// The page of a validation: how a stored model does on a log.
pub fn validation_page(report: &Report, validated: &Validated, command: &str) -> String {
    let (model, validation) = (&report.model, &validated.validation);
    let rows = match validation.rows.as_slice() {
        [rows] => format!("rows {rows}"),
        _ => "all rows evaluated".to_owned(),
    };
    let parts = [(rows, validated)];
    let mut document = Sections::new(Medium::Page);
    lead(&mut document, model, &validation.fit);
    document.line(match validation.in_sample {
        InSample::No => "The model was not fitted to these rows.",
        InSample::Partly => "The model was fitted to some of these rows.",
        InSample::Yes => "The model was fitted to these rows: the figures flatter it.",
    });
    outputs(&mut document, model, &parts, &[], &validation.fit, &validation.logs);
    residuals_of_parts(&mut document, &parts);
    kinds::present(&mut document, report, false);
    // How the model was chosen says nothing of this log.
    document.sections.retain(|section| section.title != selection::TITLE);
    document.section("Data");
    document.line("The log that the model was validated on, and what it was fitted to.");
    document.table(data::logs(&validation.logs));
    document.table(data::logs(&report.data.logs));
    document.table(data::data(report));
    Page {
        title: format!("Validation of {}{}", name(validation, 0), data::of(&validation.logs)),
        warnings: &validation.warnings,
        document,
        command,
        generator: &validation.generator,
    }
    .write()
}

/// Several models, a column for each.
pub fn comparison(comparison: &Comparison, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    if let Some(first) = comparison.models.first() {
        on.line(format!("{} rows {}", files(&first.logs), rows(&first.rows)));
        on.gap();
    }
    let named = |model: &Validation| or_dash(model.report.as_deref(), str::to_owned);
    let models: Vec<(String, &Validation)> =
        comparison.models.iter().map(|model| (named(model), model)).collect();
    side_by_side(on, &models, comparison.criteria.as_deref());
    likelihood_ratios(on, &models, &comparison.likelihood_ratios);
    super::text::written(on, layout)
}

/// The page of a comparison: several models on one log. `reports` and `validated` are in the same order.
///
/// # Errors
/// [`Error::Report`] if there are not as many of the one as of the other.
pub fn comparison_page(reports: &[Report], validated: &[Validated], command: &str) -> Result<String, Error> {
    if reports.len() != validated.len() {
        return Err(Error::report(format!("{} models and {} validations", reports.len(), validated.len())));
    }
    let names = distinct(validated);
    let logs = validated.first().map_or(&[][..], |validated| &validated.validation.logs);
    let named: Vec<(String, &Validated)> = names.iter().cloned().zip(validated).collect();
    let models: Vec<(String, &Validation)> =
        names.iter().cloned().zip(validated.iter().map(|validated| &validated.validation)).collect();
    let warnings: Vec<String> = models
        .iter()
        .flat_map(|(name, found)| found.warnings.iter().map(move |warning| format!("{name}: {warning}")))
        .collect();

    let mut document = Sections::new(Medium::Page);
    let on = &mut document;
    for (name, report) in names.iter().zip(reports) {
        on.line(format!("{name} is {}", report.model.headline()));
    }
    on.section("Side by side");
    let comparison = compare(validated).ok();
    let criteria = comparison.as_ref().and_then(|comparison| comparison.criteria.as_deref());
    side_by_side(on, &models, criteria);
    likelihood_ratios(on, &models, comparison.as_ref().map_or(&[], |own| &own.likelihood_ratios));
    on.line("Anderson stops at the smallest alpha at which a fraction alpha of the correlations of the residuals, or more, lies \
             outside the band of that level. The larger, the better; it is no verdict.");
    compared_outputs(on, reports, &named, logs);
    on.section("Residuals");
    let left: Vec<(String, &Residuals)> =
        residuals_in(&models).map(|(name, _, residuals)| (name, residuals)).collect();
    on.chart(|| charts::compared_autocorrelations(&left));
    figures(on, "model", &models);

    let of_several = reports.iter().any(|report| report.model.outputs().len() > 1);
    let mut linear: Vec<(String, LinearModel<'_>)> = Vec::new();
    for (name, report) in names.iter().zip(reports) {
        // What is not linear has no responses of this kind.
        for model in report.model.linear("a response").unwrap_or_default() {
            let of = if of_several { format!(" to {}", model.output().name) } else { String::new() };
            linear.push((format!("{name}{of}"), model));
        }
    }
    let linear: Vec<(String, &LinearModel<'_>)> =
        linear.iter().map(|(name, model)| (name.clone(), model)).collect();
    let inputs = linear.iter().flat_map(|(_, model)| model.inputs());
    let inputs = distinct_of(inputs.map(|input| input.name.as_str()));
    if !linear.is_empty() {
        responses_of(on, &linear, &inputs, linear.iter().any(|(_, model)| model.has_noise()));
    }
    on.section("Data");
    on.table(data::logs(logs));
    Ok(Page {
        title: format!("Comparison of {} models{}", names.len(), data::of(logs)),
        warnings: &warnings,
        document,
        command,
        generator: validated.first().map_or("thetahat", |validated| &validated.validation.generator),
    }
    .write())
}

/// Whether the further parameters of a model say something.
fn likelihood_ratios(on: &mut Sections, models: &[(String, &Validation)], ratios: &[LikelihoodRatio]) {
    for LikelihoodRatio { smaller, larger, ratio, parameters, p_value } in ratios {
        let (Some((smaller, _)), Some((larger, _))) = (models.get(*smaller), models.get(*larger)) else {
            continue;
        };
        on.line(format!(
            "{larger} has {} beside what {smaller} has: likelihood ratio {}, p-value {}",
            parameters.join(", "),
            number(*ratio),
            chance(*p_value)
        ));
    }
}

/// The figures of several models.
fn side_by_side(on: &mut Sections, models: &[(String, &Validation)], criteria: Option<&[Criteria]>) {
    let each = || models.iter().map(|(_, model)| *model);
    let head = std::iter::once(String::new()).chain(models.iter().map(|(name, _)| name.clone()));
    let mut table =
        columns("Figures", head).none("the model or the log does not have it, or too few samples count");
    let mut row = |what: String, of: &dyn Fn(&Validation) -> Cell| {
        table.row(std::iter::once(word(what)).chain(each().map(of)));
    };
    row("model".to_owned(), &|model| word(&model.model));
    row("parameters".to_owned(), &|model| word(model.parameters));
    row("stable".to_owned(), &|model| known(model.stable, yes));
    row("fitted to these rows".to_owned(), &|model| word(in_sample(model.in_sample)));
    let mut horizons: Vec<Horizon> =
        distinct_of(each().flat_map(|model| model.fit.iter().map(|fit| fit.horizon)));
    // A free run comes last, also where the first model has none.
    horizons.sort_by_key(|horizon| match horizon {
        Horizon::Steps { steps } => *steps,
        Horizon::FreeRun => usize::MAX,
    });
    let outputs = distinct_of(each().flat_map(|model| &model.noise).map(|noise| noise.output.as_str()));
    for output in &outputs {
        let of = if outputs.len() > 1 { format!("{output}: ") } else { String::new() };
        let fit = |model: &'_ Validation, horizon: Horizon| {
            model.fit.iter().find(|fit| fit.horizon == horizon && fit.output == **output).cloned()
        };
        for horizon in &horizons {
            row(format!("{of}fit [%], {horizon}"), &|model| {
                figure(fit(model, *horizon).and_then(|fit| fit.percent), |percent| fixed(percent, 3))
            });
        }
        for (what, error) in ERRORS {
            row(format!("{of}{what}, 1 step ahead"), &|model| {
                figure(fit(model, Horizon::Steps { steps: 1 }).as_ref().and_then(error), number)
            });
        }
        let noise = |model: &Validation| model.noise.iter().find(|noise| noise.output == **output).cloned();
        row(format!("{of}mean square error"), &|model| {
            figure(noise(model).and_then(|noise| noise.mse), number)
        });
        row(format!("{of}  of that expected"), &|model| {
            figure(noise(model).and_then(|noise| noise.ratio), three)
        });
        let residuals = |model: &Validation| {
            model.residuals.iter().find(|residuals| residuals.output == **output).cloned()
        };
        row(format!("{of}Ljung-Box p-value"), &|model| {
            figure(residuals(model).and_then(|residuals| residuals.ljung_box.p_value), chance)
        });
        row(format!("{of}Anderson: stops at alpha"), &|model| {
            known(residuals(model), |found| {
                let stops = found.anderson.stops_at;
                stops.map_or_else(|| "none up to 0.5".to_owned(), |alpha| fixed(alpha, 3))
            })
        });
        let tests = each().flat_map(|model| &model.residuals).flat_map(|residuals| &residuals.independence);
        for input in distinct_of(tests.map(|test| test.input.as_str())) {
            row(format!("{of}independence p-value, {input}"), &|model| {
                let tests = residuals(model).into_iter().flat_map(|residuals| residuals.independence);
                let mut tests = tests.filter(|test| test.input == input);
                figure(tests.find_map(|test| test.past.p_value), chance)
            });
        }
        row(format!("{of}95 % intervals hold [%]"), &|model| {
            let mut at_one = model.coverage.iter().filter(|one| one.steps == 1 && one.level == LEVEL);
            let own = at_one.find(|one| one.output == **output);
            figure(own.and_then(|one| one.actual), |share| fixed(100.0 * share, 2))
        });
    }
    let agreements = each().flat_map(|model| &model.response);
    for input in distinct_of(agreements.map(|agreement| agreement.input.as_str())) {
        let own = |model: &Validation| model.response.iter().find(|own| own.input == input).cloned();
        row(format!("outside of the response, {input}"), &|model| {
            known(own(model), |own| format!("{} of {}", own.outside, own.points))
        });
        row(format!("apart from the response, {input} [%]"), &|model| {
            figure(own(model).map(|own| 100.0 * own.relative_difference), |share| fixed(share, 2))
        });
    }
    for criterion in InformationCriterion::all().filter(|_| criteria.is_some()) {
        let written: fn(f64) -> String =
            if criterion.is_logarithmic() { |value| fixed(value, 4) } else { number };
        let own = criteria.into_iter().flatten().map(|own| figure(own.of(criterion), written));
        table.row(std::iter::once(word(format!("{} of the fit", criterion.name()))).chain(own));
    }
    let orders: Vec<&Orders> = each().filter_map(|model| model.orders.as_ref()).collect();
    if !orders.is_empty() {
        table.legend(orders_legend(orders));
    }
    on.table(table);
    let silent = models.iter().filter(|(_, model)| !model.white_expected);
    let silent: Vec<String> = silent.map(|(name, _)| harmless(name)).collect();
    if !silent.is_empty() {
        on.line(format!(
            "need not be white (output error, instrumental variables): {}",
            some(&silent, MOST, ", ")
        ));
    }
}

/// The mean and the largest of the errors.
fn errors(fits: &[Fit]) -> Table {
    let head = std::iter::once("errors").chain(ERRORS.map(|(what, _)| what));
    let mut table = columns("Errors", head).none(NO_FIT);
    for fit in fits {
        let of = if several(fits) { format!("{}, ", fit.output) } else { String::new() };
        let own = ERRORS.map(|(_, of)| figure(of(fit), number));
        table.row(std::iter::once(word(format!("{of}{}", fit.horizon))).chain(own));
    }
    table
}

/// The names of logs.
fn files(logs: &[Source]) -> String {
    let files: Vec<String> = logs.iter().map(|log| harmless(&log.file)).collect();
    some(&files, MOST, ", ")
}

/// Each of these once, in the order of the first.
fn distinct_of<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut distinct = Vec::new();
    for one in all {
        if !distinct.contains(&one) {
            distinct.push(one);
        }
    }
    distinct
}

/// The name of the file that a model comes from.
fn name(validation: &Validation, position: usize) -> String {
    validation.report.clone().unwrap_or_else(|| format!("model {}", position + 1))
}

/// A name for each model, no two the same.
fn distinct(validated: &[Validated]) -> Vec<String> {
    let names: Vec<String> = validated
        .iter()
        .enumerate()
        .map(|(position, validated)| name(&validated.validation, position))
        .collect();
    let again = |name: &String| names.iter().filter(|other| *other == name).count() > 1;
    let number = |(position, name): (usize, &String)| match again(name) {
        true => format!("{name} ({})", position + 1),
        false => name.clone(),
    };
    names.iter().enumerate().map(number).collect()
}
