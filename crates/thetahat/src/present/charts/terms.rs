//! How the functions of a nonlinear ARX model were chosen, and what it is.

use super::decimate::{Curve, rounded};
use super::figure::{Drawn, axis, chart, layout, line};
use super::object::Object;
use super::text;
use crate::estimate::{RunFigures, TermsOutcome};
use crate::model::NonlinearArxModel;
use crate::respond::nonlinear_arx::slice;

/// Points of a slice.
const POINTS: usize = 101;

/// Errors against the number of parameters.
pub(crate) fn complexity(outcome: &TermsOutcome) -> Drawn {
    let curve = |name: &str, values: Vec<Option<f64>>, position: usize| -> Option<Object> {
        let there = outcome.path.iter().zip(values);
        let there = there.filter_map(|(step, value)| Some((step.parameters as f64, value?)));
        let (x, y): (Vec<f64>, Vec<f64>) = there.unzip();
        // Maps of which each is another kind are no curve.
        let mode = if x.is_sorted() { "lines+markers" } else { "markers" };
        (!x.is_empty()).then(|| line(name, Curve { x, y: rounded(&y) }, position).with("mode", mode))
    };
    let of = |figure: fn(&RunFigures) -> Option<f64>| -> Vec<Option<f64>> {
        outcome.path.iter().map(|step| step.free_run.as_ref().and_then(figure)).collect()
    };
    let held_out = |figure: fn(&RunFigures) -> Option<f64>| -> Vec<Option<f64>> {
        outcome.path.iter().map(|step| step.held_out.as_ref().and_then(figure)).collect()
    };
    let one_step = outcome.path.iter().map(|step| Some(step.rmse)).collect();
    let traces: Vec<Object> = [
        curve("one step ahead, estimation rows", one_step, 0),
        curve("free run, estimation rows", of(|run| run.rmse), 1),
        curve("free run, held-out rows", held_out(|run| run.rmse), 2),
        curve("largest error of the free run, held-out rows", held_out(|run| run.largest_error), 3),
    ]
    .into_iter()
    .flatten()
    .collect();
    if traces.is_empty() {
        return Err("There is no picture of the choice: no model on its path has a finite error.".to_owned());
    }
    let layout = layout()
        .with("xaxis", axis("number of parameters"))
        .with("yaxis", axis("error, in units of the output").with("type", "log"))
        .with("hovermode", "closest");
    let words = format!(
        "The root mean square and the largest errors against the number of parameters, of {} to choose from.",
        outcome.candidates
    );
    chart("Complexity", words, 340, traces, layout)
}

/// The next output against each regressor, the others in the middle of what the estimation rows had.
pub(crate) fn slices(model: &NonlinearArxModel, output: usize) -> Drawn {
    let mut traces: Vec<Object> = Vec::new();
    for (place, regressor) in model.regressors.iter().enumerate() {
        let (x, y): (Vec<f64>, Vec<f64>) = slice(model, output, place, POINTS).into_iter().unzip();
        traces.push(line(&text::plain(&regressor.name()), Curve { x, y: rounded(&y) }, place));
    }
    let layout = layout()
        .with("xaxis", axis("regressor, from the least (0) to the largest (1) value of the estimation rows"))
        .with(
            "yaxis",
            axis(&format!("{} one step ahead, less its offset", text::plain(&model.outputs[output].name))),
        )
        .with("hovermode", "closest");
    chart(
        "Slices of g",
        "What the model says of the next output where one regressor moves through its range, and the others stay in the middle of theirs.",
        340,
        traces,
        layout,
    )
}
