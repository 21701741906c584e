//! Processes.

use super::polynomial::{NO_ERROR, static_gains};
use super::procedure::{procedure, samples};
use super::{closing, responses, signals};
use crate::figures::{number, seconds, unit_of};
use crate::model::{LinearModel, ProcessModel};
use crate::present::tree::{Sections, columns, error, figure, word};
use crate::report::Report;
use crate::text::harmless;

pub(super) fn present(on: &mut Sections, report: &Report, model: &ProcessModel) {
    on.section("Model");
    on.line(format!("{}, sample time {}", report.model.name(), seconds(model.sample_time)));
    for (structure, input) in model.structures.iter().zip(&model.inputs) {
        on.line(format!("G = {} from {}", structure.equation(), harmless(&input.name)));
    }
    signals(on, &model.inputs, std::slice::from_ref(&model.output));
    on.gap();
    let Some(outcome) = report.estimation.procedure.process() else { return };
    let of_points = report.estimation.procedure.frequency_response().is_some();
    let plain = if of_points { "by the points alone" } else { "assuming white residuals" };
    let head = ["parameter", "value", "unit", "standard error", plain];
    let mut parameters = columns("Parameters", head).words(&[2]).none(NO_ERROR);
    let units = model.structures.iter().zip(model.of_inputs());
    let units =
        units.flat_map(|(structure, own)| own.iter().map(|parameter| structure.unit(&parameter.name)));
    for ((parameter, white), unit) in model.parameters.iter().zip(&outcome.white_standard_errors).zip(units) {
        parameters.row([
            word(&parameter.name),
            figure(parameter.value, number),
            word(unit_of(parameter.value, unit)),
            error(parameter.standard_error),
            error(*white),
        ]);
    }
    on.table(parameters);
    if !of_points || on.is_page() {
        samples(on, &report.estimation, model.noise_variance, &model.output);
    }
    procedure(on, report);
    if on.is_page() {
        for linear in report.model.linear("a gain").into_iter().flatten() {
            if let LinearModel::Transfer(linear) = linear {
                static_gains(on, &linear);
            }
        }
    }
    responses(on, report, false);
    if !of_points {
        closing(on, report);
    }
}
