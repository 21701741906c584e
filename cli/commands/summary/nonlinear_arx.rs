//! What a fit of a nonlinear ARX model found, as a table for people.

use thetahat::estimate::{Procedure, TermStep, TermsOutcome};
use thetahat::figures::{error, number, scientific, short};
use thetahat::model::NonlinearArxModel;
use thetahat::report::Report;
use thetahat::text::harmless;

use super::text::{Text, columns, or_dash};
use super::{NO_ERROR, criteria, fits, signal};

/// The main figures of a fit of a nonlinear ARX model.
pub(super) fn table(report: &Report, model: &NonlinearArxModel, width: usize) -> String {
    let mut text = Text::new(width);
    text.line(&format!("{}, sample time {} s", report.model.name(), short(model.sample_time)));
    let signals = model.inputs.iter().map(|input| signal("input", input));
    let signals: Vec<String> = signals.chain([signal("output", &model.output)]).collect();
    text.line(&signals.join(", "));
    let regressors: Vec<String> = model.regressors.iter().map(|one| harmless(&one.name())).collect();
    text.line(&format!("regressors {}{}", regressors.join(", "), scales(model)));
    text.line("");
    let Procedure::ForwardRegression(outcome) = &report.estimation.procedure else { return text.finish() };
    let held_out = outcome.path.iter().any(|step| step.held_out.is_some());
    let mut head = vec!["function", "parameter", "standard error", "error reduction", "free run"];
    head.extend(held_out.then_some("held out"));
    let mut parameters = columns(&head).none(NO_ERROR);
    for parameter in &model.parameters {
        let step = outcome.path.iter().find(|step| step.term == parameter.name);
        let run = |figure: fn(&TermStep) -> Option<f64>| or_dash(step.and_then(figure), number);
        let mut cells = vec![
            harmless(&parameter.name),
            number(parameter.value),
            or_dash(parameter.standard_error, error),
            or_dash(step, |step| scientific(step.error_reduction, 3)),
            run(|step| step.free_run.and_then(|run| run.rmse)),
        ];
        cells.extend(held_out.then(|| run(|step| step.held_out.and_then(|run| run.rmse))));
        parameters.row(cells);
    }
    text.table(parameters);
    let estimation = &report.estimation;
    text.line(&format!(
        "{} samples, noise variance {}, condition number {}",
        estimation.samples,
        number(model.noise_variance),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    text.line(&criteria(&estimation.criteria));
    text.line(&choice(outcome, model.parameters.len()));
    text.line("");
    fits(&mut text, &report.fit);
    text.finish()
}

/// What regressors are divided by, where they are.
fn scales(model: &NonlinearArxModel) -> String {
    let mut known: Vec<(&str, f64)> = Vec::new();
    for regressor in &model.regressors {
        if !known.iter().any(|(channel, _)| *channel == regressor.channel) {
            known.push((&regressor.channel, regressor.scale));
        }
    }
    if known.iter().all(|(_, scale)| *scale == 1.0) {
        return String::new();
    }
    let each: Vec<String> =
        known.iter().map(|(channel, scale)| format!("{} by {}", harmless(channel), short(*scale))).collect();
    format!("; less their offsets, divided: {}", each.join(", "))
}

/// How the functions were chosen.
fn choice(outcome: &TermsOutcome, taken: usize) -> String {
    let how = match outcome.selected_by.as_str() {
        "given" => "as many as asked for".to_owned(),
        "validation" => "as many as run best on the validation rows".to_owned(),
        "cv" => "as many as run best on five blocks, each by a model of the others".to_owned(),
        criterion => format!("as many as have the least {criterion}"),
    };
    format!(
        "forward regression, {taken} of {} functions, {how} (of {} looked at)",
        outcome.candidates,
        outcome.path.len()
    )
}
