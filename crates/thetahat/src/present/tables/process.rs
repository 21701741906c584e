//! What a fit of a process found, as a table for people.

use crate::figures::{error, number, seconds, unit_of};
use crate::model::ProcessModel;
use crate::present::Layout;
use crate::report::Report;
use crate::text::harmless;

use super::selection::selection;
use super::text::{Text, columns, or_dash};
use super::{NO_ERROR, counted, fits, samples, signal, stopped};

/// The main figures of a fit of a process.
pub(super) fn table(report: &Report, model: &ProcessModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    selection(&mut text, report);
    text.line(&format!("{}, sample time {}", report.model.name(), seconds(model.sample_time)));
    let formulas: Vec<String> = model.structures.iter().map(|structure| structure.equation()).collect();
    for (formula, input) in formulas.iter().zip(&model.inputs) {
        text.line(&format!("G = {formula} from {}", harmless(&input.name)));
    }
    let signals = model.inputs.iter().map(|input| signal("input", input));
    let signals: Vec<String> = signals.chain([signal("output", &model.output)]).collect();
    text.line(&signals.join(", "));
    text.line("");
    let procedure = &report.estimation.procedure;
    let Some(outcome) = procedure.process() else { return text.finish() };
    let of_points = procedure.frequency_response().is_some();
    let plain = if of_points { "by the points alone" } else { "if errors were white" };
    let head = ["parameter", "value", "unit", "standard error", plain];
    let mut parameters = columns(&head).words(&[2]).none(NO_ERROR);
    let units = model.structures.iter().zip(model.of_inputs());
    let units =
        units.flat_map(|(structure, own)| own.iter().map(|parameter| structure.unit(&parameter.name)));
    for ((parameter, white), unit) in model.parameters.iter().zip(&outcome.white_standard_errors).zip(units) {
        parameters.row([
            parameter.name.clone(),
            number(parameter.value),
            unit_of(parameter.value, unit),
            or_dash(parameter.standard_error, error),
            or_dash(*white, error),
        ]);
    }
    text.table(parameters);
    let estimation = &report.estimation;
    if of_points {
        text.line(&format!(
            "{} parts of points, missed by {} of their standard deviations in the mean, {}, {}",
            estimation.samples,
            number(estimation.mse.sqrt()),
            counted(outcome.iterations),
            stopped(outcome.stopped)
        ));
        return text.finish();
    }
    samples(&mut text, estimation, model.noise_variance, &model.output);
    let start = match outcome.initial_conditions {
        0 => "logs begin at rest".to_owned(),
        1 => "1 initial condition estimated".to_owned(),
        count => format!("{count} initial conditions estimated"),
    };
    text.line(&format!(
        "least errors of the free run, {}, {}, {start}",
        counted(outcome.iterations),
        stopped(outcome.stopped)
    ));
    text.line(&match outcome.noise_order {
        0 => "standard errors of white errors, which the residuals are".to_owned(),
        order => format!(
            "standard errors of errors with the colour of the residuals, an autoregression of order {order}"
        ),
    });
    text.line("");
    fits(&mut text, &report.fit);
    text.finish()
}
