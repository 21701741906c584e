//! What a document says of its model: each kind contributes its sections once.

mod continuous;
mod equations;
mod nonlinear_arx;
mod polynomial;
mod procedure;
mod process;
mod state_space;

use super::charts;
use super::fits::fits;
use super::selection::selection;
use super::tree::{Cell, Sections, columns, known, word};
use super::words::{quantity, signal};
use crate::model::{LinearModel, Model, Quantity, Signal};
use crate::report::{Estimation, Report};

pub(super) use polynomial::parameters;

/// Appends what a report says of its model. `converted` is a model that has no figures of a fit.
pub(super) fn present(on: &mut Sections, report: &Report, converted: bool) {
    if !converted || on.is_page() {
        selection(on, report);
    }
    match &report.model {
        Model::Polynomial(model) => polynomial::present(on, report, model),
        Model::Equations(model) => equations::present(on, report, model),
        Model::NonlinearArx(model) => nonlinear_arx::present(on, report, model),
        Model::Process(model) => process::present(on, report, model),
        Model::StateSpace(model) => state_space::present(on, report, model, converted),
        Model::ContinuousStateSpace(model) => continuous::present(on, report, model),
    }
}

/// The fits at the end of a text. Pages have them below the outputs.
fn closing(on: &mut Sections, report: &Report) {
    if !on.is_page() && !report.fit.is_empty() {
        on.gap();
        on.table(fits(&report.fit));
    }
}

/// The channels, with what is taken from them.
fn signals(on: &mut Sections, inputs: &[Signal], outputs: &[Signal]) {
    let inputs = inputs.iter().map(|input| signal("input", input));
    let outputs = outputs.iter().map(|output| signal("output", output));
    on.line(inputs.chain(outputs).collect::<Vec<String>>().join(", "));
}

/// The static gain from each input to each output.
fn gains(on: &mut Sections, (inputs, outputs): (&[Signal], &[Signal]), gains: &[Vec<Option<Quantity>>]) {
    if inputs.is_empty() {
        return;
    }
    let to = outputs.iter().map(|output| format!("to {}", output.name));
    let head = std::iter::once("DC gain from".to_owned()).chain(to);
    let mut table = columns("Static gains", head).none("the model integrates");
    for (place, input) in inputs.iter().enumerate() {
        let gains = gains.iter().map(|gains| known(gains.get(place).copied().flatten(), quantity));
        table.row(std::iter::once(word(&input.name)).chain(gains));
    }
    on.table(table);
}

/// What pages add to the figures of an estimate.
fn mean_square(on: &mut Sections, estimation: &Estimation) {
    if on.is_page() {
        on.line(format!("mean of e² {}", crate::figures::number(estimation.mse)));
    }
}

/// Bode plots, step and impulse responses of the model, as far as it is linear.
fn responses(on: &mut Sections, report: &Report, has_noise: bool) {
    if on.is_page() {
        let linear = report.model.linear("a response").unwrap_or_default();
        let name = |model: &LinearModel<'_>| match report.model.outputs() {
            [_] => "estimate".to_owned(),
            _ => format!("to {}", model.output().name),
        };
        let named: Vec<(String, &LinearModel<'_>)> =
            linear.iter().map(|model| (name(model), model)).collect();
        let inputs: Vec<&str> = report.model.inputs().iter().map(|input| input.name.as_str()).collect();
        if !named.is_empty() {
            responses_of(on, &named, &inputs, has_noise);
        }
    }
}

/// The same of several models.
pub(super) fn responses_of(
    on: &mut Sections,
    models: &[(String, &LinearModel<'_>)],
    inputs: &[&str],
    has_noise: bool,
) {
    on.section("Frequency response");
    inputs.iter().for_each(|input| on.chart(|| charts::bode(models, Some(input))));
    if has_noise {
        on.chart(|| charts::bode(models, None));
    }
    on.section("Step and impulse response");
    for input in inputs {
        charts::transients(models, input).into_iter().for_each(|drawn| on.chart(|| drawn));
    }
    if inputs.is_empty() {
        on.line("Without inputs there is no step response.");
    }
}

/// A value, and that of its conjugate if there is one.
fn pair(pole: &crate::model::Root) -> Cell {
    let value = super::words::complex(pole);
    word(if pole.im > 0.0 { format!("{value} and conjugate") } else { value })
}
