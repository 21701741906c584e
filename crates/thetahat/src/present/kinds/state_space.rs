//! State-space models.

use super::procedure::procedure;
use super::{closing, gains, mean_square, pair, responses, signals};
use crate::estimate::{SubspaceOutcome, VectorArxOutcome};
use crate::figures::{fixed, number, of_unit, seconds, three};
use crate::model::{Quantity, StateSpaceModel};
use crate::present::charts;
use crate::present::tree::{Sections, columns, figure, known, word};
use crate::present::words::{complex, criteria, interval, quantity, spread, stable};
use crate::report::Report;
use crate::text::harmless;

/// This many singular values are written, or some beyond the order.
const MOST: usize = 8;
/// Why an order has no figure, a pole no time constant, or two outputs no correlation.
const NO_PREDICTOR: &str = "no model of this order has a stable predictor";
const NO_TIME: &str = "no time constant goes with a pole on or outside of the unit circle, or at 0";
const NO_ERROR: &str = "no time constant goes with a pole on or outside of the unit circle, or at 0; no standard error with poles that \
                         are too close for one";
const NOT_COUPLED: &str = "without coupling an output does not depend on the past of others";
const NO_NOISE: &str = "nothing is left of an output";

/// The recursion.
const EQUATION: &str = "x(t+1) = F x + G u + K e, y = H x + D u + e";

/// Of a model that was `converted` a text has what follows from its matrices.
pub(super) fn present(on: &mut Sections, report: &Report, model: &StateSpaceModel, converted: bool) {
    let is_fit = !converted;
    let estimation = &report.estimation;
    on.section("Model");
    on.line(format!("{}, sample time {}", report.model.name(), seconds(model.sample_time)));
    on.line(match estimation.procedure.vector_arx() {
        Some(_) if is_fit => "A(q) y = B(q) u + e, as x(t+1) = F x + G u + K e, y = H x + D u + e",
        _ => EQUATION,
    });
    signals(on, &model.inputs, &model.outputs);
    if on.is_page() {
        let delays = model.inputs.iter().zip(&model.delays);
        let delays = delays.filter(|(_, delay)| **delay > 0);
        delays.for_each(|(input, delay)| on.line(format!("delay of {}: {delay} samples", input.name)));
    }
    if is_fit {
        let (subspace, vector_arx) = (estimation.procedure.subspace(), estimation.procedure.vector_arx());
        let of_response = estimation.procedure.shared_poles().is_some();
        if subspace.is_some()
            || vector_arx.is_some()
            || of_response
            || estimation.procedure.is_given()
            || on.is_page()
        {
            procedure(on, report);
        }
        if let Some(outcome) = subspace {
            on.gap();
            states(on, outcome, model.order());
        }
        if let Some(outcome) = vector_arx {
            on.gap();
            // Of a model that was made of another one they are none of its own.
            if !(on.is_page() && report.fit.is_empty()) {
                coefficients(on, outcome, model);
            }
        }
        if !estimation.procedure.is_given() {
            on.line(format!("{} samples, {} free parameters", estimation.samples, model.free_parameters));
            mean_square(on, estimation);
            on.line(criteria(&estimation.criteria));
        }
    }
    on.gap();
    on.section("Poles");
    on.chart(|| charts::eigenvalues(model));
    poles(on, model);
    gains(on, (&model.inputs, &model.outputs), &model.dc_gain);
    noise(on, model);
    on.line(stable(model.stable));
    responses(on, report, model.outputs.len() == 1);
    if is_fit {
        closing(on, report);
    }
}

/// A row for each coefficient, a column for the equation of each output.
fn coefficients(on: &mut Sections, outcome: &VectorArxOutcome, model: &StateSpaceModel) {
    let of = model.outputs.iter().map(|output| format!("equation of {}", output.name));
    let head = std::iter::once("coefficient".to_owned()).chain(of);
    let mut table = columns("Coefficients", head).none(NOT_COUPLED);
    let shown = |value: Option<&Quantity>| {
        // A report that was edited may have other numbers of them.
        known(value.filter(|value| value.standard_error.is_some()), |value| quantity(*value))
    };
    for (lag, rows) in (1_usize..).zip(&outcome.a) {
        for (place, output) in model.outputs.iter().enumerate() {
            let name = word(format!("A{lag} {}", output.name));
            table.row(std::iter::once(name).chain(rows.iter().map(|row| shown(row.get(place)))));
        }
    }
    for ((input, lags), first) in model.inputs.iter().zip(&outcome.b).zip(&outcome.nk) {
        for (later, values) in lags.iter().enumerate() {
            let name = word(format!("B{} {}", first.saturating_add(later), input.name));
            table.row(std::iter::once(name).chain(values.iter().map(|value| shown(Some(value)))));
        }
    }
    on.table(table);
}

/// The singular values, and the order's choice.
fn states(on: &mut Sections, outcome: &SubspaceOutcome, order: usize) {
    on.section("Order");
    on.chart(|| charts::singular_values(outcome, order));
    if !outcome.orders.is_empty() {
        on.chart(|| charts::orders(outcome, order));
    }
    let least = outcome.orders.iter().filter_map(|score| score.mdl).fold(f64::INFINITY, f64::min);
    let head = ["", "order", "singular value", "MDL above the least"];
    let mut table = columns("Singular values", head).none(NO_PREDICTOR);
    table = table.without(if outcome.orders.is_empty() { &[3] } else { &[] });
    let shown = outcome.singular_values.len().min((order + MOST / 2).max(MOST));
    for (place, value) in (1..).zip(&outcome.singular_values[..shown]) {
        let score = outcome.orders.iter().find(|score| score.order == place);
        table.row([
            word(if place == order { "*" } else { "" }),
            word(place),
            figure(*value, number),
            score.map_or(word(""), |score| known(score.mdl, |mdl| fixed(mdl - least, 1))),
        ]);
    }
    on.table(table);
}

fn poles(on: &mut Sections, model: &StateSpaceModel) {
    let is_certain = model.covariance.is_some();
    let head = ["pole", "standard error", "modulus", "time constant [s]", "95 % interval"];
    let mut table = columns("Poles", head).words(&[4]).none(if is_certain { NO_ERROR } else { NO_TIME });
    table = table.without(if is_certain { &[] } else { &[1, 4] });
    // One of a pair stands for both.
    for (pole, time) in model.poles.iter().zip(&model.time_constants).filter(|(pole, _)| pole.im >= 0.0) {
        table.row([
            pair(pole),
            known(spread(pole), |spread| spread),
            figure(pole.re.hypot(pole.im), three),
            known(*time, |time| of_unit(time.value, "s")),
            known(time.and_then(|time| time.interval), interval),
        ]);
    }
    if !model.poles.is_empty() {
        on.table(table);
    }
    let head = ["pole", "standard error", "modulus"];
    let mut table = columns("Poles of the predictor", head).none("no standard error is known");
    for pole in &model.predictor_poles {
        let modulus = figure(pole.re.hypot(pole.im), number);
        table.row([word(complex(pole)), known(spread(pole), |spread| spread), modulus]);
    }
    if on.is_page() {
        on.table(table);
    }
}

/// The deviations of the innovations, and their correlations.
fn noise(on: &mut Sections, model: &StateSpaceModel) {
    let covariance = &model.noise_covariance;
    let deviation = |place: usize| covariance[place][place].max(0.0).sqrt();
    if let [output] = &*model.outputs {
        on.line(format!("innovations of {}: deviation {}", harmless(&output.name), number(deviation(0))));
        return;
    }
    let with = model.outputs.iter().map(|output| format!("correlation with {}", output.name));
    let head = ["innovations of", "deviation"].map(str::to_owned).into_iter().chain(with);
    let mut table = columns("Noise", head).none(NO_NOISE);
    for (place, output) in model.outputs.iter().enumerate() {
        let correlation = |other: usize| {
            let product = deviation(place) * deviation(other);
            figure((product > 0.0).then(|| covariance[place][other] / product), |value| fixed(value, 3))
        };
        let own = [word(&output.name), figure(deviation(place), number)];
        table.row(own.into_iter().chain((0..model.outputs.len()).map(correlation)));
    }
    on.table(table);
}
