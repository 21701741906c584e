//! What a fit of a nonlinear ARX model found, as a table for people.

use crate::estimate::{Procedure, RunFigures, TermStep, TermsOutcome, TrainingOutcome};
use crate::figures::{error, number, scientific, seconds, short};
use crate::model::{NonlinearArxModel, Parameter};
use crate::present::Layout;
use crate::report::Report;
use crate::text::harmless;

use super::text::{Table, Text, columns, or_dash};
use super::{NO_ERROR, counted, criteria, fits, signal, stopped, word};

/// Why a step of a choice has no figure.
const NO_RUN: &str = "functions that are always there are still to come, or the run grows without bound";

/// The main figures of a fit of a nonlinear ARX model.
pub(super) fn table(report: &Report, model: &NonlinearArxModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    text.line(&format!("{}, sample time {}", harmless(&report.model.name()), seconds(model.sample_time)));
    let signals = model.inputs.iter().map(|input| signal("input", input));
    let outputs = model.outputs.iter().map(|output| signal("output", output));
    let signals: Vec<String> = signals.chain(outputs).collect();
    text.line(&signals.join(", "));
    let regressors: Vec<String> = model.regressors.iter().map(|one| harmless(&one.name())).collect();
    text.line(&format!("regressors {}{}", regressors.join(", "), scales(model)));
    let (estimation, mut parameters) = (&report.estimation, &*model.parameters);
    for ((outcome, map), output) in estimation.procedure.terms().iter().zip(&model.maps).zip(&model.outputs) {
        let own;
        (own, parameters) =
            parameters.split_at(map.functions.parameters(model.regressors.len()).min(parameters.len()));
        let of = if model.outputs.len() > 1 { format!("{}: ", output.name) } else { String::new() };
        text.line("");
        text.table(match estimation.procedure {
            Procedure::ForwardRegression(_) => functions(outcome, own, &of),
            // Parameters of boxes are many, and samples more: both are in the report.
            Procedure::Neighbours(_) => path(outcome, "a free run over the kept samples would read them"),
            Procedure::Training(_) => path(outcome, "no start leads to a run that keeps within bounds"),
            _ => path(outcome, NO_RUN),
        });
        text.line(&format!("{}{}", harmless(&of), choice(&estimation.procedure, outcome)));
        if let Some(training) = &outcome.training {
            text.line(&trained(training));
        }
    }
    let noise: Vec<String> =
        model.noise_covariance.iter().enumerate().map(|(place, row)| number(row[place])).collect();
    text.line(&format!(
        "{} samples, noise variance {}, condition number {}",
        estimation.samples,
        noise.join(", "),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    text.line(&criteria(&estimation.criteria));
    text.line("");
    fits(&mut text, &report.fit);
    text.finish()
}

/// The functions with their parameters, and what the choice says of each.
fn functions(outcome: &TermsOutcome, own: &[Parameter], of: &str) -> Table {
    let held_out = outcome.path.iter().any(|step| step.held_out.is_some());
    let mut head = vec!["function", "parameter", "standard error", "error reduction", "free run"];
    head.extend(held_out.then_some("held out"));
    let known = own.iter().all(|parameter| parameter.standard_error.is_some());
    let mut parameters = columns(&head).none(if known { NO_RUN } else { NO_ERROR });
    for parameter in own {
        let name = parameter.name.strip_prefix(of).unwrap_or(&parameter.name);
        let step = outcome.path.iter().find(|step| step.term == name);
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
    parameters
}

/// The steps of the choice; that which was taken is marked. `none` says why a figure is not there.
fn path(outcome: &TermsOutcome, none: &'static str) -> Table {
    let held_out = outcome.path.iter().any(|step| step.held_out.is_some());
    let mut head = vec!["", "step", "parameters", "RMSE", "free run"];
    head.extend(held_out.then_some("held out"));
    let mut steps = columns(&head).words(&[1]).none(none);
    for (at, step) in (1..).zip(&outcome.path) {
        let run = |run: Option<RunFigures>| or_dash(run.and_then(|run| run.rmse), number);
        let mut cells = vec![
            if at == outcome.taken { "*".to_owned() } else { String::new() },
            harmless(&step.term),
            step.parameters.to_string(),
            number(step.rmse),
            run(step.free_run),
        ];
        cells.extend(held_out.then(|| run(step.held_out)));
        steps.row(cells);
    }
    steps
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

/// How a search for all numbers went.
fn trained(training: &TrainingOutcome) -> String {
    let starts: Vec<String> = training.starts.iter().map(|cost| or_dash(*cost, short)).collect();
    let of =
        if starts.len() > 1 { format!("; costs of the starts {}", starts.join(", ")) } else { String::new() };
    format!(
        "errors of the {} made small: {} ({}), {}, cost {}{of}",
        training.horizon,
        counted(training.iterations),
        word(training.algorithm),
        stopped(training.stopped),
        number(training.cost)
    )
}

/// How the functions were chosen.
fn choice(procedure: &Procedure, outcome: &TermsOutcome) -> String {
    let how = match outcome.selected_by.as_str() {
        "given" => "as many as asked for".to_owned(),
        "validation" => "as many as run best on the validation rows".to_owned(),
        "cv" => "as many as run best on five blocks, each by a model of the others".to_owned(),
        criterion => format!("as many as have the least {criterion}"),
    };
    let (taken, looked_at) = (outcome.taken, outcome.path.len());
    match procedure {
        Procedure::Splits(_) => {
            format!("local models, grown by splitting: {taken}, {how} (of {looked_at} looked at)")
        }
        Procedure::Neighbours(_) => {
            let asked = outcome.last().map_or_else(String::new, |step| step.term.clone());
            format!(
                "{asked} of {} samples, {how}; RMSE: on five blocks, each by the samples of the others",
                outcome.candidates
            )
        }
        Procedure::Training(_) => {
            let best = match outcome.selected_by.as_str() {
                "given" => "as asked for",
                "validation" => "the one that runs best on the validation rows",
                _ => &how,
            };
            format!(
                "trained: {}, {best} (of {looked_at} tried)",
                outcome.last().map_or("", |step| &step.term)
            )
        }
        _ => format!(
            "forward regression, {taken} of {} functions, {how} (of {looked_at} looked at)",
            outcome.candidates
        ),
    }
}
