//! Nonlinear ARX models.

use super::polynomial::NO_ERROR;
use super::{closing, mean_square, signals};
use crate::estimate::{Procedure, RunFigures, TermStep, TermsOutcome, TrainingOutcome};
use crate::figures::{number, scientific, seconds, short};
use crate::model::{NonlinearArxModel, Parameter};
use crate::present::charts;
use crate::present::tree::{Cell, Sections, Table, columns, error, figure, word};
use crate::present::words::{algorithm, counted, criteria, or_dash, stopped};
use crate::report::Report;
use crate::text::harmless;

/// Why a step of a choice has no figure.
const NO_RUN: &str = "functions that are always there are still to come, or the run grows without bound";

pub(super) fn present(on: &mut Sections, report: &Report, model: &NonlinearArxModel) {
    on.section("Model");
    on.line(format!("{}, sample time {}", harmless(&report.model.name()), seconds(model.sample_time)));
    signals(on, &model.inputs, &model.outputs);
    let regressors: Vec<String> = model.regressors.iter().map(|one| harmless(&one.name())).collect();
    on.line(format!("regressors {}{}", regressors.join(", "), scales(model)));
    if on.is_page() {
        on.table(ranges(model));
    }
    let (estimation, mut parameters) = (&report.estimation, &*model.parameters);
    let terms = estimation.procedure.terms();
    for (place, ((outcome, map), output)) in terms.iter().zip(&model.maps).zip(&model.outputs).enumerate() {
        let own;
        (own, parameters) =
            parameters.split_at(map.functions.parameters(model.regressors.len()).min(parameters.len()));
        let of = if model.outputs.len() > 1 { format!("{}: ", output.name) } else { String::new() };
        on.section(format!("{of}Choice of functions"));
        on.chart(|| charts::complexity(outcome));
        on.chart(|| charts::slices(model, place));
        on.gap();
        // Of parameters of boxes, which are many, and of samples, which are more, a text has the choice alone.
        let (is_long, none) = match estimation.procedure {
            Procedure::ForwardRegression(_) => (false, NO_RUN),
            Procedure::Neighbours(_) => (true, "a free run over the kept samples would read them"),
            Procedure::Training(_) => (true, "no start leads to a run that keeps within bounds"),
            _ => (true, NO_RUN),
        };
        if is_long || on.is_page() {
            on.table(path(outcome, none));
        }
        if !is_long || on.is_page() && !matches!(estimation.procedure, Procedure::Neighbours(_)) {
            on.table(functions(outcome, own, &of));
        }
        on.line(format!("{}{}", harmless(&of), choice(&estimation.procedure, outcome)));
        if let Some(training) = &outcome.training {
            on.line(trained(training));
        }
    }
    on.section("Estimation");
    let noise: Vec<String> =
        model.noise_covariance.iter().enumerate().map(|(place, row)| number(row[place])).collect();
    on.line(format!(
        "{} samples, noise variance {}, condition number {}",
        estimation.samples,
        noise.join(", "),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    mean_square(on, estimation);
    on.line(criteria(&estimation.criteria));
    closing(on, report);
}

/// The functions with their parameters, and what the choice says of each.
fn functions(outcome: &TermsOutcome, own: &[Parameter], of: &str) -> Table {
    let known = own.iter().all(|parameter| parameter.standard_error.is_some());
    let head = ["function", "parameter", "standard error", "error reduction", "free run", "held out"];
    let mut parameters = columns("Parameters", head).none(if known { NO_RUN } else { NO_ERROR });
    parameters = parameters.without(if is_held_out(outcome) { &[] } else { &[5] });
    for parameter in own {
        let name = parameter.name.strip_prefix(of).unwrap_or(&parameter.name);
        let step = outcome.path.iter().find(|step| step.term == name);
        let run = |run: fn(&TermStep) -> Option<RunFigures>| rmse(step.and_then(run));
        parameters.row([
            word(&parameter.name),
            figure(parameter.value, number),
            error(parameter.standard_error),
            figure(step.map(|step| step.error_reduction), |value| scientific(value, 3)),
            run(|step| step.free_run),
            run(|step| step.held_out),
        ]);
    }
    parameters
}

/// The steps of the choice; that which was taken is marked. `none` says why a figure is not there.
fn path(outcome: &TermsOutcome, none: &'static str) -> Table {
    let head = [
        "",
        "step",
        "parameters",
        "error reduction",
        "RMSE",
        "free run",
        "held out",
        "cannot be told from it",
    ];
    let mut steps = columns("Path of the choice", head).words(&[1, 7]).none(none).on_pages(&[3, 7]);
    steps = steps.without(if is_held_out(outcome) { &[] } else { &[6] });
    for (at, step) in (1..).zip(&outcome.path) {
        steps.row([
            word(if at == outcome.taken { "*" } else { "" }),
            word(&step.term),
            word(step.parameters),
            figure(step.error_reduction, |value| scientific(value, 3)),
            figure(step.rmse, number),
            rmse(step.free_run),
            rmse(step.held_out),
            word(step.aliases.join(", ")),
        ]);
    }
    steps
}

fn is_held_out(outcome: &TermsOutcome) -> bool {
    outcome.path.iter().any(|step| step.held_out.is_some())
}

fn rmse(run: Option<RunFigures>) -> Cell {
    figure(run.and_then(|run| run.rmse), number)
}

/// What the model reads.
fn ranges(model: &NonlinearArxModel) -> Table {
    let mut table = columns("Regressors", ["regressor", "divided by", "least", "largest"]);
    for regressor in &model.regressors {
        let figures = [regressor.scale, regressor.range[0], regressor.range[1]];
        table.row(std::iter::once(word(regressor.name())).chain(figures.map(|value| figure(value, number))));
    }
    table
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
        algorithm(training.algorithm),
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
    let (taken, evaluated) = (outcome.taken, outcome.path.len());
    match procedure {
        Procedure::Splits(_) => {
            format!("local models, grown by splitting: {taken}, {how} (of {evaluated} evaluated)")
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
                "trained: {}, {best} (of {evaluated} tried)",
                outcome.last().map_or("", |step| &step.term)
            )
        }
        _ => format!(
            "forward regression, {taken} of {} functions, {how} (of {evaluated} evaluated)",
            outcome.candidates
        ),
    }
}
