//! How many states a model needs.

use super::decimate::{Curve, rounded};
use super::figure::{COLOURS, Drawn, axis, chart, layout, line, significant};
use super::object::{Object, bars, marker, scatter};
use crate::estimate::SubspaceOutcome;

/// The singular values; those of the states that were taken stand out.
pub(crate) fn singular_values(outcome: &SubspaceOutcome, order: usize) -> Drawn {
    let values: Vec<f64> = outcome.singular_values.iter().map(|value| significant(*value)).collect();
    if values.is_empty() {
        return Err("There are no singular values to show.".to_owned());
    }
    let order = order.min(values.len());
    let part = |name: &str, from: usize, to: usize, colour: &str| {
        let x = (from..to).map(|place| (place + 1) as f64).collect();
        bars(name, x, values[from..to].to_vec()).with("marker", Object::default().with("color", colour))
    };
    let mut traces = vec![part("states of the model", 0, order, COLOURS[0])];
    if order < values.len() {
        traces.push(part("left out", order, values.len(), COLOURS[1]));
    }
    let layout = layout()
        .with("xaxis", axis("state"))
        .with("yaxis", axis("singular value").with("type", "log"))
        .with("bargap", 0.2);
    let words =
        format!("How much of the outputs to come each state says, from a past of {} samples.", outcome.past);
    chart("Singular values", words, 340, traces, layout)
}

/// MDL by the order, above the least.
pub(crate) fn orders(outcome: &SubspaceOutcome, order: usize) -> Drawn {
    let known: Vec<(f64, f64)> =
        outcome.orders.iter().filter_map(|score| Some((score.order as f64, score.mdl?))).collect();
    let least = known.iter().map(|(_, mdl)| *mdl).fold(f64::INFINITY, f64::min);
    let (x, y): (Vec<f64>, Vec<f64>) = known.into_iter().map(|(order, mdl)| (order, mdl - least)).unzip();
    let mut traces = vec![line("MDL", Curve { x, y: rounded(&y) }, 0).with("mode", "lines+markers")];
    let taken = scatter("taken", vec![order as f64], vec![0.0], "markers");
    traces.push(taken.with("marker", marker(COLOURS[1], 12)));
    let layout = layout().with("xaxis", axis("order")).with("yaxis", axis("MDL above the least"));
    let words =
        "The minimum description length of the prediction errors of each order, the parameters counted.";
    chart("Choice of the order", words.to_owned(), 340, traces, layout)
}
