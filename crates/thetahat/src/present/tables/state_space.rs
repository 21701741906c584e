//! What a fit of a state-space model found, as a table for people.

use crate::estimate::{Coupling, RefinementOutcome, SubspaceOutcome, VectorArxOutcome};
use crate::figures::{fixed, number, of_unit, seconds, three};
use crate::model::{Quantity, Signal, StateSpaceModel};
use crate::present::{Layout, words::complex};
use crate::report::Report;
use crate::text::harmless;

use super::selection::selection;
use super::text::{self, Text, columns, or_dash};
use super::{MOST, criteria, fits, interval, quantity, signal};

/// Why an order has no figure, a pole no time constant, or two outputs no correlation.
const NO_PREDICTOR: &str = "no model of this order has a stable predictor";
const NO_TIME: &str = "no time constant goes with a pole on or outside of the unit circle, or at 0";
const NO_ERROR: &str = "no time constant goes with a pole on or outside of the unit circle, or at 0; no standard error with poles that \
                         are too close for one";
const NOT_COUPLED: &str = "without coupling an output does not depend on the past of others";
const INTEGRATES: &str = "the model integrates";
const NO_NOISE: &str = "nothing is left of an output";

/// The recursion.
const EQUATION: &str = "x(t+1) = F x + G u + K e, y = H x + D u + e";

/// The main figures of a fit in state space.
pub(super) fn table(report: &Report, model: &StateSpaceModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    if report.selection.is_some() {
        selection(&mut text, report);
    }
    let procedure = &report.estimation.procedure;
    let equation = match procedure.vector_arx() {
        Some(_) => "A(q) y = B(q) u + e, as x(t+1) = F x + G u + K e, y = H x + D u + e",
        None => EQUATION,
    };
    head(&mut text, report, model, equation);
    let estimation = &report.estimation;
    if let Some(outcome) = procedure.subspace() {
        text.line(&found(outcome));
        if let Some(RefinementOutcome { errors, search }) = &outcome.refinement {
            text.line(&format!(
                "refined for the least errors of {}: {}",
                errors.of(),
                super::outcome(search)
            ));
        }
        text.line("");
        states(&mut text, outcome, model.order());
    }
    if let Some(outcome) = procedure.vector_arx() {
        text.line(&orders(outcome));
        text.line("");
        coefficients(&mut text, outcome, model);
    }
    text.line(&format!("{} samples, {} free parameters", estimation.samples, model.free_parameters));
    text.line(&criteria(&estimation.criteria));
    text.line("");
    figures(&mut text, model);
    text.line("");
    fits(&mut text, &report.fit);
    text.finish()
}

/// The same without what a fit says.
pub(super) fn model_alone(report: &Report, model: &StateSpaceModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    head(&mut text, report, model, EQUATION);
    text.line("");
    figures(&mut text, model);
    text.finish()
}

/// What it is, and of what.
fn head(text: &mut Text, report: &Report, model: &StateSpaceModel, equation: &str) {
    text.line(&format!("{}, sample time {}", report.model.name(), seconds(model.sample_time)));
    text.line(equation);
    let signals = model.inputs.iter().map(|input| signal("input", input));
    let outputs = model.outputs.iter().map(|output| signal("output", output));
    text.line(&signals.chain(outputs).collect::<Vec<String>>().join(", "));
}

/// What follows from the matrices.
fn figures(text: &mut Text, model: &StateSpaceModel) {
    poles(text, model);
    gains(text, (&model.inputs, &model.outputs), &model.dc_gain);
    noise(text, model);
    text.line(if model.stable { "stable" } else { "unstable" });
}

/// How the states were found.
fn found(outcome: &SubspaceOutcome) -> String {
    let feedthrough = match (outcome.feedthrough, outcome.feedthrough_given) {
        (true, true) => "inputs act at once, as asked for",
        (false, true) => "no input acts at once, as asked for",
        (true, false) => "inputs act at once, which lowers MDL",
        (false, false) => "no input acts at once",
    };
    let method = outcome.weighting.to_string().to_uppercase();
    let levels = if outcome.constant { "; levels of the outputs estimated with the matrices" } else { "" };
    format!("subspace method {method}, a past of {} samples; {feedthrough}{levels}", outcome.past)
}

/// The orders of an ARX model, and among how many models it was chosen.
fn orders(outcome: &VectorArxOutcome) -> String {
    let VectorArxOutcome { na, nb, nk, coupling, constant, tried, .. } = outcome;
    let list = |numbers: &[usize]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let inputs = if nb.is_empty() { String::new() } else { format!(", nb {}, nk {}", list(nb), list(nk)) };
    let coupling = match coupling {
        Coupling::Full => "A full",
        Coupling::None => "A diagonal",
    };
    let levels = if *constant { "; levels of the outputs estimated with the coefficients" } else { "" };
    let chosen =
        if tried.is_empty() { String::new() } else { format!("; the least MDL of {} models", tried.len()) };
    format!("least squares, na {na}{inputs}, {coupling}{levels}{chosen}")
}

/// A row for each coefficient, a column for the equation of each output.
fn coefficients(text: &mut Text, outcome: &VectorArxOutcome, model: &StateSpaceModel) {
    let head: Vec<String> = std::iter::once("coefficient".to_owned())
        .chain(model.outputs.iter().map(|output| format!("equation of {}", harmless(&output.name))))
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = columns(&head).none(NOT_COUPLED);
    let shown = |value: &Quantity| or_dash(value.standard_error.map(|_| *value), quantity);
    for (lag, rows) in (1..).zip(&outcome.a) {
        for (place, output) in model.outputs.iter().enumerate() {
            let name = format!("A{lag} {}", harmless(&output.name));
            table.row(std::iter::once(name).chain(rows.iter().map(|row| shown(&row[place]))));
        }
    }
    for ((input, lags), first) in model.inputs.iter().zip(&outcome.b).zip(&outcome.nk) {
        for (lag, values) in (*first..).zip(lags) {
            let name = format!("B{lag} {}", harmless(&input.name));
            table.row(std::iter::once(name).chain(values.iter().map(shown)));
        }
    }
    text.table(table);
}

/// The singular values, and the order's choice.
fn states(text: &mut Text, outcome: &SubspaceOutcome, order: usize) {
    let scored: Vec<(usize, Option<f64>)> =
        outcome.orders.iter().map(|score| (score.order, score.mdl)).collect();
    let least = scored.iter().filter_map(|(_, mdl)| *mdl).fold(f64::INFINITY, f64::min);
    let head = ["", "order", "singular value", "MDL above the least"];
    let head = if scored.is_empty() { &head[..3] } else { &head[..] };
    let mut table = columns(head).none(NO_PREDICTOR);
    let shown = outcome.singular_values.len().min((order + MOST / 2).max(MOST));
    for (place, value) in (1..).zip(&outcome.singular_values[..shown]) {
        let mark = if place == order { "*" } else { "" };
        let mut cells = vec![mark.to_owned(), place.to_string(), number(*value)];
        if !scored.is_empty() {
            let score = scored.iter().find(|(order, _)| *order == place);
            cells.push(match score {
                Some((_, mdl)) => or_dash(*mdl, |mdl| fixed(mdl - least, 1)),
                None => String::new(),
            });
        }
        table.row(cells);
    }
    text.table(table);
}

fn poles(text: &mut Text, model: &StateSpaceModel) {
    let known = model.covariance.is_some();
    let all = ["pole", "standard error", "modulus", "time constant [s]", "95 % interval"];
    let few = ["pole", "modulus", "time constant [s]"];
    let mut table =
        if known { columns(&all).words(&[4]).none(NO_ERROR) } else { columns(&few).none(NO_TIME) };
    // One of a pair stands for both.
    for (pole, time) in model.poles.iter().zip(&model.time_constants).filter(|(pole, _)| pole.im >= 0.0) {
        let value = complex(pole);
        let value = if pole.im > 0.0 { format!("{value} and conjugate") } else { value };
        let spread = known.then(|| text::spread(pole));
        let interval = known.then(|| or_dash(time.and_then(|time| time.interval), interval));
        let figures = [three(pole.re.hypot(pole.im)), or_dash(*time, |time| of_unit(time.value, "s"))];
        table.row(std::iter::once(value).chain(spread).chain(figures).chain(interval));
    }
    if !model.poles.is_empty() {
        text.table(table);
    }
}

/// The static gain from each input to each output.
pub(super) fn gains(
    text: &mut Text,
    (inputs, outputs): (&[Signal], &[Signal]),
    gains: &[Vec<Option<Quantity>>],
) {
    if inputs.is_empty() {
        return;
    }
    let head: Vec<String> = std::iter::once("DC gain from".to_owned())
        .chain(outputs.iter().map(|output| format!("to {}", harmless(&output.name))))
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = columns(&head).none(INTEGRATES);
    for (place, input) in inputs.iter().enumerate() {
        let gains = gains.iter().map(|gains| or_dash(gains.get(place).copied().flatten(), quantity));
        table.row(std::iter::once(harmless(&input.name)).chain(gains));
    }
    text.table(table);
}

/// The deviations of the innovations, and their correlations.
fn noise(text: &mut Text, model: &StateSpaceModel) {
    let covariance = &model.noise_covariance;
    let deviation = |place: usize| covariance[place][place].max(0.0).sqrt();
    if let [output] = &*model.outputs {
        text.line(&format!("innovations of {}: deviation {}", harmless(&output.name), number(deviation(0))));
        return;
    }
    let head: Vec<String> = ["innovations of", "deviation"]
        .map(str::to_owned)
        .into_iter()
        .chain(model.outputs.iter().map(|output| format!("correlation with {}", harmless(&output.name))))
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = columns(&head).none(NO_NOISE);
    for (place, output) in model.outputs.iter().enumerate() {
        let correlation = |other: usize| {
            let product = deviation(place) * deviation(other);
            or_dash((product > 0.0).then(|| covariance[place][other] / product), |value| fixed(value, 3))
        };
        let own = [harmless(&output.name), number(deviation(place))];
        table.row(own.into_iter().chain((0..model.outputs.len()).map(correlation)));
    }
    text.table(table);
}
