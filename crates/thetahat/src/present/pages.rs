//! Reports as pages: one file of HTML that loads nothing, with charts that can be zoomed.
//!
//! Names of channels and files are shown as they are, whatever is in them: text is escaped where it is written, data
//! inside scripts by [`text::inside_script`], and text for the charting library, which reads some HTML itself, by
//! [`text::plain`]. A content security policy forbids every request and every script but the page's own.

mod charts;
mod decimate;
mod figure;
mod object;
mod outputs;
mod page;
mod response;
mod step_test;
mod tables;
mod text;
mod tuning;

pub use charts::Transient;
use charts::{Shade, Stack};
use outputs::{compared_outputs, outputs, points};
use page::{Block, Page, Section};
pub use response::response_page;
pub use step_test::{step_test_page, transient_page};
pub use tuning::tuning_page;

use crate::Error;
use crate::data::{Finding, FindingKind, Rows, Source};
use crate::figures::{self, fixed};
use crate::inspect::Inspection;
use crate::model::{
    ContinuousStateSpaceModel, EquationsModel, LinearModel, Map, Model, NonlinearArxModel, ProcessModel,
    StateSpaceModel,
};
use crate::present::words;
use crate::report::{InSample, Report, Validated, Validation, compare};
use crate::validate::{Fit, Part, Residuals};

/// The channels of a log of very many that are on its page.
const CHANNELS: usize = 16;
/// What is said of models whose residuals need not be white.
const UNASKED: &str = "Not asked: models of output error and those by instrumental variables say nothing of the noise, so their \
                       residuals are not asked to be white.";

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
    let names: Vec<&str> = model.outputs().iter().map(|output| output.name.as_str()).collect();
    let title = format!("Fit of {}{}", names.join(", "), of(&report.data.logs));
    let mut page = Page::new(title, command, &report.generator);
    page.lead = lead(model, &report.fit);
    page.lead.extend(Some(report.purpose.clone()).filter(|purpose| !purpose.is_empty()));
    page.warnings = &report.warnings;
    let parts: Vec<(String, &Validated)> =
        validated.iter().map(|validated| (part_name(report, &validated.validation), validated)).collect();
    page.sections =
        vec![outputs(model, &parts, &shades(report), &report.fit, &report.data.logs), residuals(&parts)];
    page.sections.extend(of_model(report));
    if let Some(selection) = &report.selection {
        let mut section = Section::new("Order search");
        for decision in &report.decisions {
            section.text(decision.to_string());
        }
        for step in &selection.steps {
            section.text(step);
        }
        let failed = match selection.failed {
            0 => String::new(),
            failed => format!("Models that the data could not determine: {failed}."),
        };
        if !failed.is_empty() {
            section.text(failed);
        }
        section.chart(charts::search(selection));
        if !selection.delays.is_empty() {
            section.chart(charts::delays(selection));
        }
        section.table(tables::best(selection));
        if let Some((_, Validated { signals, .. })) = held_out.first() {
            let runs = held_out
                .iter()
                .filter_map(|(name, run)| Some((name, run.signals.outputs.first()?.simulated.as_deref()?)));
            let there = |run: &[f64]| {
                let first = run.iter().position(|value| value.is_finite())?;
                Some(first..run.iter().rposition(|value| value.is_finite())? + 1)
            };
            let rows = runs.clone().find_map(|(_, run)| there(run)).unwrap_or(0..0);
            let runs: Vec<(String, &[f64])> =
                runs.map(|(name, run)| (name.clone(), &run[rows.clone()])).collect();
            let stack = Stack::new(&signals.time[rows.clone()], model.sample_time(), points(1 + runs.len()))
                .dated(&report.data.logs);
            let measured = signals.outputs.first().map(|output| (&output.name, &output.measured[rows]));
            section.chart(measured.map_or_else(|| Err(String::new()), |(name, measured)| charts::outputs(
                "Free runs on rows held out",
                "Measured output, and what the best models make of the inputs alone in the last third of the rows. Each was fitted \
                 to the other two thirds for this picture.",
                stack,
                name,
                measured,
                &runs,
            )));
        }
        page.sections.insert(2, section);
    }
    page.sections.push(provenance(report));
    page.write()
}

/// The page of a validation: how a stored model does on a log.
pub fn validation_page(report: &Report, validated: &Validated, command: &str) -> String {
    let (model, validation) = (&report.model, &validated.validation);
    let title = format!("Validation of {}{}", model_name(validation, 0), of(&validation.logs));
    let mut page = Page::new(title, command, &validation.generator);
    page.lead = lead(model, &validation.fit);
    page.lead.push(match validation.in_sample {
        InSample::No => "The model was not fitted to these rows.".to_owned(),
        InSample::Partly => "The model was fitted to some of these rows.".to_owned(),
        InSample::Yes => "The model was fitted to these rows: the figures flatter it.".to_owned(),
    });
    page.warnings = &validation.warnings;
    let rows = match validation.rows.as_slice() {
        [rows] => format!("rows {rows}"),
        _ => "all rows evaluated".to_owned(),
    };
    let parts = [(rows, validated)];
    page.sections = vec![outputs(model, &parts, &[], &validation.fit, &validation.logs), residuals(&parts)];
    page.sections.extend(of_model(report));
    let mut section = Section::new("Data");
    section.text("The log that the model was validated on, and what it was fitted to.");
    section.table(tables::logs(&validation.logs));
    section.table(tables::logs(&report.data.logs));
    section.table(tables::data(report));
    page.sections.push(section);
    page.write()
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
    let generator = validated.first().map_or("thetahat", |validated| &validated.validation.generator);
    let logs = validated.first().map_or(&[][..], |validated| &validated.validation.logs);
    let mut page = Page::new(format!("Comparison of {} models{}", names.len(), of(logs)), command, generator);
    let named: Vec<(String, &Validated)> = names.iter().cloned().zip(validated).collect();
    let each = || names.iter().zip(reports);
    page.lead = each().map(|(name, report)| format!("{name} is {}", report.model.headline())).collect();
    let several = reports.iter().any(|report| report.model.outputs().len() > 1);
    let mut linear: Vec<(String, LinearModel<'_>)> = Vec::new();
    for (name, report) in each() {
        // What is not linear has no responses of this kind.
        for model in report.model.linear("a response").unwrap_or_default() {
            let of = if several { format!(" to {}", model.output().name) } else { String::new() };
            linear.push((format!("{name}{of}"), model));
        }
    }
    let models: Vec<(String, &LinearModel<'_>)> =
        linear.iter().map(|(name, model)| (name.clone(), model)).collect();
    let warnings: Vec<String> = named
        .iter()
        .flat_map(|(name, validated)| {
            validated.validation.warnings.iter().map(move |warning| format!("{name}: {warning}"))
        })
        .collect();
    page.warnings = &warnings;

    let mut section = Section::new("Side by side");
    let criteria = compare(validated).ok().and_then(|comparison| comparison.criteria);
    section.table(tables::comparison(&named, criteria.as_deref()));
    section.text("Too many outside from alpha on: the smallest alpha at which a fraction alpha of the correlations of the residuals, \
                  or more, lies outside the band of that level. The larger, the better; it is no verdict.");
    if validated.iter().any(|validated| !validated.validation.white_expected) {
        section.text(UNASKED);
    }
    page.sections.push(section);
    page.sections.extend(compared_outputs(reports, &named, logs));

    let mut section = Section::new("Residuals");
    let all: Vec<(String, &Residuals)> = residuals_of(&named).collect();
    section.chart(charts::compared_autocorrelations(&all));
    let each = validations(&named);
    section.table(tables::tests("model", &each));
    section.table(tables::anderson("model", &each));
    section.table(tables::noise("model", &each));
    section.table(tables::coverage("model", &each));
    page.sections.push(section);

    let mut inputs: Vec<&str> = Vec::new();
    for input in models.iter().flat_map(|(_, model)| model.inputs()) {
        if !inputs.contains(&input.name.as_str()) {
            inputs.push(&input.name);
        }
    }
    if !models.is_empty() {
        let has_noise = models.iter().any(|(_, model)| model.has_noise());
        page.sections.extend(responses(&models, &inputs, has_noise));
    }
    let mut section = Section::new("Data");
    section.table(tables::logs(logs));
    page.sections.push(section);
    Ok(page.write())
}

/// The page of an inspection: what a log is worth, before any fit.
///
/// `signals` are the channels with their names, one value for each row; `time` is in seconds, one value for each row.
pub fn inspection_page(
    inspection: &Inspection,
    signals: &[(String, Vec<f64>)],
    time: &[f64],
    command: &str,
) -> String {
    let title = format!("Inspection{}", of(std::slice::from_ref(&inspection.log)));
    let mut page = Page::new(title, command, &inspection.generator);
    page.lead = vec![format!(
        "{} rows of {} channels, {} s apart.",
        inspection.rows,
        inspection.channels.len(),
        figures::short(inspection.clock.sample_time)
    )];
    let brief = inspection.brief(CHANNELS);
    let warnings = brief.warnings();
    page.warnings = &warnings;

    let mut section = Section::new("Channels");
    let left_out = inspection.channels.len() - brief.channels.len();
    if left_out > 0 {
        section.text(format!(
            "The channels that matter most; the JSON document has {left_out} more, and {} warnings in all.",
            inspection.findings.len()
        ));
    }
    let inspection = &brief;
    let shown = |name: &str| inspection.channels.iter().find(|channel| channel.name == name);
    let signals: Vec<_> = signals.iter().filter(|(name, _)| left_out == 0 || shown(name).is_some()).collect();
    // Steps of a clock without a rhythm are no gaps.
    let step = if inspection.clock.irregular { f64::INFINITY } else { inspection.clock.sample_time };
    let dated = || Stack::new(time, step, points(signals.len())).dated(std::slice::from_ref(&inspection.log));
    let mut stack = dated();
    let mut named: Vec<&str> = Vec::new();
    let marked = inspection.findings.iter().any(|finding| place(finding).is_some());
    let circles = if marked { " Circles: where findings are, the first of each channel." } else { "" };
    let words = &format!("One time axis: zooming one zooms all.{circles}");
    for (position, (name, values)) in signals.iter().enumerate() {
        if stack.is_full() {
            section.chart(std::mem::replace(&mut stack, dated()).draw("Channels over time", words, &[]));
            named.clear();
        }
        stack.alone(name, values, position);
        for finding in inspection.findings.iter().filter(|finding| finding.channels.contains(name)) {
            let Some(what) = place(finding) else { continue };
            stack.marks(what, &finding.rows, values, !named.contains(&what));
            named.push(what);
        }
    }
    if !stack.is_empty() {
        section.chart(stack.draw("Channels over time", words, &[]));
    }
    section.table(tables::channels(inspection));
    section.table(tables::clock(inspection));
    page.sections.push(section);

    if !inspection.excitation.is_empty() {
        let mut section = Section::new("Excitation");
        section.chart(charts::spectrum(&inspection.excitation));
        section.table(tables::excitation(inspection));
        page.sections.push(section);
    }
    if !inspection.delays.is_empty() {
        let mut section = Section::new("Delay and feedback");
        for delay in &inspection.delays {
            section.chart(charts::prewhitened(delay));
            if let Some(response) = charts::impulse_response(delay) {
                section.chart(response);
            }
        }
        section.table(tables::delays(inspection));
        page.sections.push(section);
    }
    if let Some(suggested) = &inspection.command {
        let mut section = Section::new("Suggested fit");
        section.blocks.push(Block::Command(suggested.clone()));
        page.sections.push(section);
    }
    let mut section = Section::new("Data");
    section.table(tables::logs(std::slice::from_ref(&inspection.log)));
    page.sections.push(section);
    page.write()
}

/// What a picture of a channel calls a finding that it can show.
fn place(finding: &Finding) -> Option<&'static str> {
    match finding.kind {
        FindingKind::Outliers => Some("outliers"),
        FindingKind::Stuck => Some("stuck"),
        FindingKind::Saturation => Some("at its limit"),
        _ => None,
    }
}

/// The files of a title.
fn of(logs: &[Source]) -> String {
    match logs {
        [] => String::new(),
        [log] => format!(": {}", log.file),
        [log, rest @ ..] => format!(": {} and {} more", log.file, rest.len()),
    }
}

/// The model in a sentence, and how close it comes.
fn lead(model: &Model, fits: &[Fit]) -> Vec<String> {
    let stable = model.stability().map_or("", |stable| if stable { ", stable" } else { ", unstable" });
    let several = model.outputs().len() > 1;
    let mut lead = vec![
        format!("{}.", model.headline()),
        format!(
            "Sample time {} s, {} parameters{stable}.",
            figures::short(model.sample_time()),
            model.free_parameters()
        ),
    ];
    let figure = |fit: &Fit| {
        let on = fit.part.map_or_else(String::new, |part| format!(", {} rows", words::part(part)));
        let of = if several { format!("{}, ", fit.output) } else { String::new() };
        Some(format!("{} % ({of}{}{on})", fixed(fit.percent?, 1), fit.horizon))
    };
    let figures: Vec<String> = fits.iter().filter_map(figure).collect();
    if !figures.is_empty() {
        lead.push(format!("Fit: {}.", figures.join(", ")));
    }
    lead
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
    part.map_or_else(|| format!("rows {}", text::rows(&validation.rows)), |part| words::part(part).to_owned())
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

/// What the models leave of each part.
fn residuals(parts: &[(String, &Validated)]) -> Section {
    let mut section = Section::new("Residuals");
    let several = parts.len() > 1;
    for (name, Validated { validation, .. }) in parts {
        if validation.residuals.is_empty() {
            section.text(format!("There are no residuals to test ({name}): too few samples count."));
        }
        let outputs = validation.noise.len();
        for residuals in &validation.residuals {
            let on = |drawn: figure::Drawn| {
                drawn.map(|mut chart| {
                    if outputs > 1 {
                        chart.title.push_str(&format!(" of {}", residuals.output));
                    }
                    if several {
                        chart.title.push_str(&format!(", {name} rows"));
                    }
                    chart
                })
            };
            section.chart(on(charts::autocorrelation(residuals, validation.white_expected)));
            for independence in &residuals.independence {
                section.chart(on(charts::cross_correlation(independence)));
            }
        }
    }
    let all = validations(parts);
    if all.iter().any(|(_, validation)| !validation.white_expected) {
        section.text(UNASKED);
    }
    section.table(tables::tests("rows", &all));
    let levels = tables::anderson("rows", &all);
    if !levels.rows.is_empty() {
        section.text(
            "Of white residuals about a fraction alpha of the correlations lies outside the band of that level. The p-value says \
             how likely more than that many are, with half of how likely just as many are (mid-p-value of the binomial \
             distribution); residuals are called white where it is not below the level of the validation.",
        );
    }
    for (name, residuals) in residuals_of(parts) {
        section.text(match residuals.anderson.stops_at {
            Some(alpha) => {
                format!(
                    "The smallest alpha at which the fraction outside is not below alpha ({name}): {}.",
                    figures::short(alpha)
                )
            }
            None => format!("At every alpha up to 0.5 the fraction outside is below alpha ({name})."),
        });
    }
    section.table(levels);
    section.table(tables::noise("rows", &all));
    section.table(tables::coverage("rows", &all));
    section
}

fn residuals_of<'a>(parts: &'a [(String, &'a Validated)]) -> impl Iterator<Item = (String, &'a Residuals)> {
    parts.iter().flat_map(|(name, Validated { validation, .. })| {
        let of = |residuals: &Residuals| tables::which(name, validation, &residuals.output);
        validation.residuals.iter().map(move |residuals| (of(residuals), residuals))
    })
}

fn validations<'a>(parts: &[(String, &'a Validated)]) -> Vec<(String, &'a Validation)> {
    parts.iter().map(|(name, validated)| (name.clone(), &validated.validation)).collect()
}

/// What a model is: responses, roots, parameters.
fn of_model(report: &Report) -> Vec<Section> {
    let model = match &report.model {
        Model::Polynomial(model) => model,
        Model::Equations(model) => return of_equations(report, model),
        Model::NonlinearArx(model) => return of_nonlinear_arx(report, model),
        Model::Process(model) => return of_process(report, model),
        Model::StateSpace(model) => return of_state_space(report, model),
        Model::ContinuousStateSpace(model) => return of_continuous(report, model),
    };
    let inputs: Vec<&str> = model.inputs.iter().map(|input| input.name.as_str()).collect();
    let linear = LinearModel::Polynomial(model);
    let mut sections = responses(&[("estimate".to_owned(), &linear)], &inputs, true);
    let mut section = Section::new("Poles and zeros");
    section.chart(charts::roots(model));
    section.table(tables::roots(model));
    sections.push(section);
    let mut section = Section::new("Model");
    section.table(tables::parameters(model));
    section.table(tables::signals(model));
    section.table(tables::estimation(&report.estimation, Some(model.noise_variance)));
    sections.push(section);
    sections
}

fn of_nonlinear_arx(report: &Report, model: &NonlinearArxModel) -> Vec<Section> {
    let of = |title: &str, output: usize| match &*model.outputs {
        [_] => title.to_owned(),
        outputs => format!("{title}, {}", outputs[output].name),
    };
    let mut sections = Vec::new();
    for (output, outcome) in report.estimation.procedure.terms().iter().enumerate() {
        let mut choice = Section::new(of("Choice of functions", output));
        choice.chart(charts::complexity(outcome));
        choice.table(tables::path(outcome));
        sections.push(choice);
    }
    for (output, places) in model.places().into_iter().enumerate() {
        let mut section = Section::new(of("Model", output));
        section.chart(charts::slices(model, output));
        // Samples are many, and in the report.
        if !matches!(model.maps[output].functions, Map::Neighbours { .. }) {
            section.table(tables::functions(&model.parameters[places]));
        }
        sections.push(section);
    }
    let mut section = Section::new("Regressors and estimation");
    section.table(tables::regressors(model));
    let noise = if let [only] = &*model.noise_covariance { only.first().copied() } else { None };
    section.table(tables::estimation(&report.estimation, noise));
    sections.push(section);
    sections
}

fn of_process(report: &Report, model: &ProcessModel) -> Vec<Section> {
    let linear = report.model.linear("a response").unwrap_or_default();
    let named: Vec<(String, &LinearModel<'_>)> =
        linear.iter().map(|model| ("estimate".to_owned(), model)).collect();
    let inputs: Vec<&str> = model.inputs.iter().map(|input| input.name.as_str()).collect();
    let mut sections = responses(&named, &inputs, false);
    let mut section = Section::new("Model");
    section.table(tables::process_parameters(report, model));
    for linear in &linear {
        if let LinearModel::Transfer(linear) = linear {
            section.table(tables::signals(linear));
        }
    }
    section.table(tables::estimation(&report.estimation, Some(model.noise_variance)));
    sections.push(section);
    sections
}

fn of_equations(report: &Report, model: &EquationsModel) -> Vec<Section> {
    let mut section = Section::new("Model");
    section.table(tables::unknown_parameters(report, model));
    section.table(tables::starts(report, model));
    section.table(tables::estimation(&report.estimation, None));
    section.text("The model as it was written, before the fit:");
    section.blocks.push(Block::Command(model.equations.clone()));
    // Equations that are not linear have no responses of this kind.
    let linear = report.model.linear("a response").unwrap_or_default();
    let named: Vec<(String, &LinearModel<'_>)> =
        linear.iter().map(|model| (format!("to {}", model.output().name), model)).collect();
    let inputs: Vec<&str> = model.inputs.iter().map(|input| input.name.as_str()).collect();
    let mut sections = match named.is_empty() || inputs.is_empty() {
        true => Vec::new(),
        false => responses(&named, &inputs, false),
    };
    sections.push(section);
    sections
}

fn of_state_space(report: &Report, model: &StateSpaceModel) -> Vec<Section> {
    let linear = report.model.linear("a response").unwrap_or_default();
    let named: Vec<(String, &LinearModel<'_>)> =
        linear.iter().map(|model| (format!("to {}", model.output().name), model)).collect();
    let inputs: Vec<&str> = model.inputs.iter().map(|input| input.name.as_str()).collect();
    let mut sections = Vec::new();
    if let Some(outcome) = report.estimation.procedure.subspace() {
        let mut section = Section::new("Order");
        section.chart(charts::singular_values(outcome, model.order()));
        if !outcome.orders.is_empty() {
            section.chart(charts::orders(outcome, model.order()));
        }
        sections.push(section);
    }
    sections.extend(responses(&named, &inputs, model.outputs.len() == 1));
    let mut section = Section::new("Poles");
    section.chart(charts::eigenvalues(model));
    section.table(tables::eigenvalues(model));
    sections.push(section);
    let mut section = Section::new("Model");
    section.table(tables::signals_and_gains(model));
    // Of a model that was made of another one they are none of its own.
    if let (Some(outcome), false) = (report.estimation.procedure.vector_arx(), report.fit.is_empty()) {
        section.table(tables::matrix_coefficients(outcome, model));
    }
    section.table(tables::noise_of_outputs(model));
    section.table(tables::estimation(&report.estimation, None));
    sections.push(section);
    sections
}

fn of_continuous(report: &Report, model: &ContinuousStateSpaceModel) -> Vec<Section> {
    let linear = report.model.linear("a response").unwrap_or_default();
    let named: Vec<(String, &LinearModel<'_>)> =
        linear.iter().map(|model| (format!("to {}", model.output().name), model)).collect();
    let inputs: Vec<&str> = model.inputs.iter().map(|input| input.name.as_str()).collect();
    let mut sections = responses(&named, &inputs, false);
    let mut section = Section::new("Model");
    section.table(tables::continuous_poles(model));
    section.table(tables::estimation(&report.estimation, None));
    sections.push(section);
    sections
}

/// Bode plots, step and impulse responses.
fn responses(models: &[(String, &LinearModel<'_>)], inputs: &[&str], has_noise: bool) -> Vec<Section> {
    let mut frequency = Section::new("Frequency response");
    let mut transient = Section::new("Step and impulse response");
    for input in inputs {
        frequency.chart(charts::bode(models, Some(input)));
        charts::transients(models, input).into_iter().for_each(|drawn| transient.chart(drawn));
    }
    if has_noise {
        frequency.chart(charts::bode(models, None));
    }
    if inputs.is_empty() {
        transient.text("Without inputs there is no step response.");
    }
    vec![frequency, transient]
}

fn provenance(report: &Report) -> Section {
    let mut section = Section::new("Data");
    section.table(tables::logs(&report.data.logs));
    section.table(tables::data(report));
    section
}

/// The name of the file that a model comes from.
fn model_name(validation: &Validation, position: usize) -> String {
    validation.report.clone().unwrap_or_else(|| format!("model {}", position + 1))
}

/// A name for each model, no two the same.
fn distinct(validated: &[Validated]) -> Vec<String> {
    let names: Vec<String> = validated
        .iter()
        .enumerate()
        .map(|(position, validated)| model_name(&validated.validation, position))
        .collect();
    let again = |position: usize| names.iter().filter(|name| **name == names[position]).count() > 1;
    (0..names.len())
        .map(|position| {
            if again(position) {
                format!("{} ({})", names[position], position + 1)
            } else {
                names[position].clone()
            }
        })
        .collect()
}
