//! The response to a step, with what is read off it.

use serde_json::json;

use super::decimate::{Curve, decimate, rounded};
use super::figure::{COLOURS, Drawn, NEUTRAL, axis, chart, layout, plain_line, significant};
use super::object::{marker, scatter, stroke};
use super::text;
use crate::step_test::{Shape, Step, StepEstimate, StepFigure, StepMethod, StepResponse};

/// Points of the curves that are laid over the data.
const POINTS: usize = 200;
/// 1 - exp(-1).
const LEVEL: f64 = 0.632_120_558_828_557_7;
/// What was measured.
const MEASURED: &str = "rgba(128,128,128,0.7)";

/// Measured values against seconds since the step; the levels, the tangent, the point at 63.2 % or the peak, and the
/// response of a first or of a second order with the figures to trust.
pub(crate) fn step_response(
    number: usize,
    step: &Step,
    response: &StepResponse,
    output: &str,
    (time, values): (&[f64], &[f64]),
    points: usize,
) -> Drawn {
    let (start, end) = (response.initial.value, response.regime.value);
    let last = time.last().copied().unwrap_or(0.0);
    let first = time.first().copied().unwrap_or(0.0);
    let curve = decimate(time, values, points, f64::INFINITY);
    let dots = scatter("measured", curve.x, curve.y, "lines+markers")
        .with("marker", marker(MEASURED, 4))
        .with("line", stroke(MEASURED, 1.0));
    let flat = |name: &str, level: f64, from: f64| {
        let x = vec![significant(from), significant(last)];
        let line = stroke(NEUTRAL, 1.2).with("dash", "dot");
        plain_line(name, Curve { x, y: vec![significant(level); 2] }, NEUTRAL).with("line", line)
    };
    let mut traces = vec![dots, flat("level before", start, first), flat("final steady state", end, 0.0)];
    let point = |name: &str, x: f64, s: f64, colour: &str| {
        let y = start + s * (end - start);
        scatter(name, vec![significant(x)], vec![significant(y)], "markers").with(
            "marker",
            marker(colour, 11).with("symbol", "circle-open").with("line", stroke(colour, 2.5)),
        )
    };
    let value = |figure, method| response.estimate(figure, method).map(|of: &StepEstimate| of.value.value);
    let trusted = |figure| response.trusted(figure).map(|of| of.value.value);
    let theta = trusted(StepFigure::DeadTime).unwrap_or(0.0);
    let modelled = |name: &str, at: &dyn Fn(f64) -> f64| {
        let x: Vec<f64> = (0..=POINTS).map(|k| last * k as f64 / POINTS as f64).collect();
        let y: Vec<f64> = x.iter().map(|t| start + (end - start) * at((t - theta).max(0.0))).collect();
        plain_line(name, Curve { x: rounded(&x), y: rounded(&y) }, COLOURS[0])
            .with("line", stroke(COLOURS[0], 2.0))
    };
    if let Some(tau) = trusted(StepFigure::TimeConstant) {
        traces.push(modelled("first order", &|t| 1.0 - (-t / tau).exp()));
    }
    if let (Some(zeta), Some(omega)) = (trusted(StepFigure::Damping), trusted(StepFigure::NaturalFrequency)) {
        let rest = (1.0 - zeta * zeta).max(0.0).sqrt();
        traces.push(modelled("second order", &|t| {
            let angle = omega * rest * t;
            1.0 - (-zeta * omega * t).exp() * (angle.cos() + zeta / rest * angle.sin())
        }));
    }
    let tangent = value(StepFigure::DeadTime, StepMethod::Tangent)
        .zip(value(StepFigure::TimeConstant, StepMethod::Tangent));
    if let Some((begins, tau)) = tangent {
        let x = vec![significant(begins), significant(begins + tau)];
        let y = vec![significant(start), significant(end)];
        traces.push(plain_line("tangent", Curve { x, y }, COLOURS[1]).with("line", stroke(COLOURS[1], 2.0)));
    }
    if let Some(tau) = value(StepFigure::TimeConstant, StepMethod::Level) {
        traces.push(point("63.2 %", theta + tau, LEVEL, COLOURS[2]));
    }
    let peak =
        value(StepFigure::PeakTime, StepMethod::Peak).zip(value(StepFigure::Overshoot, StepMethod::Peak));
    if let Some((time, above)) = peak {
        traces.push(point("first peak", time, 1.0 + above, COLOURS[2]));
    }
    let words = match response.shape {
        Shape::FirstOrder => {
            "Measured output over the seconds since the step; the steepest tangent, from the level before to the final steady state; where 63.2 % of the \
             change are reached; and the response of a first order with the figures to trust."
        }
        Shape::Overdamped => {
            "Measured output over the seconds since the step. The response is no first order: the tangent at its inflection, and the first \
             order with dead time through 28.3 % and 63.2 % of the change, are pictures of it."
        }
        Shape::Underdamped => {
            "Measured output over the seconds since the step; the first peak by a parabola; and the response of a second order with the \
             figures to trust."
        }
    };
    let layout = layout()
        .with(
            "xaxis",
            axis("time since the step [s]").with("range", json!([significant(first), significant(last)])),
        )
        .with("yaxis", axis(&text::brief(output)));
    let title = format!("Step {number}, at {} s", crate::figures::short(step.time));
    chart(title, words, 420, traces, layout)
}
