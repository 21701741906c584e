//! Closed loops side by side.

use super::decimate::{Curve, rounded};
use super::figure::{COLOURS, Drawn, axis, chart, layout, plain_line};
use super::object::stroke;
use super::text;
use crate::tune::{ClosedLoop, Tuning};

/// Which of the responses.
type Values = fn(&ClosedLoop) -> &Vec<f64>;

/// The output after a step of the set point, what the controller does, and the output after a step of the load.
pub(crate) fn closed_loops(found: &Tuning) -> Vec<Drawn> {
    let charts: [(&str, &str, &str, Values); 3] = [
        (
            "After a step of the set point",
            "The output after a step of the set point by 1 at time 0, from rest.",
            found.output.as_str(),
            |of| &of.setpoint_response,
        ),
        (
            "What the controller does then",
            "What the controller adds to the input in the same time.",
            found.input.as_str(),
            |of| &of.controller_output,
        ),
        (
            "After a step of the load",
            "The output after a step of 1 at the input of the process, which the controller takes away.",
            found.output.as_str(),
            |of| &of.load_response,
        ),
    ];
    charts
        .into_iter()
        .map(|(title, words, channel, values)| {
            let traces = found.settings.iter().zip(COLOURS.iter().cycle()).map(|(own, colour)| {
                let name = format!("{} {}", own.rule.name(), own.controller.name());
                let of = &own.closed_loop;
                let curve = Curve { x: rounded(&of.time), y: rounded(values(of)) };
                plain_line(&name, curve, colour).with("line", stroke(colour, 2.0))
            });
            chart(
                title,
                words,
                340,
                traces.collect(),
                layout().with("xaxis", axis("time [s]")).with("yaxis", axis(&text::brief(channel))),
            )
        })
        .collect()
}
