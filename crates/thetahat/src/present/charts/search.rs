//! How the orders were found.

use super::decimate::{Curve, rounded};
use super::figure::{COLOURS, Drawn, axis, chart, layout, line, significant};
use super::object::{Object, marker, scatter, stroke};
use super::text;
use crate::figures;
use crate::select::{Candidate, Select, Selection};

/// What models were chosen by.
pub(crate) fn score(select: Select) -> &'static str {
    match select {
        Select::Criterion(criterion) => criterion.name(),
        Select::Validation => "mean of e² on the validation rows",
        Select::Cv => "mean of e² in cross-validation",
    }
}

/// The best model of each size.
pub(crate) fn search(selection: &Selection) -> Drawn {
    let scored = |models: &[Candidate]| -> Vec<(f64, f64, String)> {
        let one = |model: &Candidate| {
            let score = model.score.filter(|score| score.is_finite())?;
            Some((model.parameters as f64, significant(score), model.orders.to_string()))
        };
        models.iter().filter_map(one).collect()
    };
    let name = score(selection.select);
    let sizes = scored(&selection.of_size);
    if sizes.is_empty() {
        return Err(format!("There is no picture of the search: no model has a finite {name}."));
    }
    let trace = |name: &str, points: Vec<(f64, f64, String)>, mode: &str| {
        let mut said = Vec::new();
        let (x, y): (Vec<f64>, Vec<f64>) = points
            .into_iter()
            .map(|(x, y, words)| {
                said.push(format!("{words}<br>{x} parameters, {}", figures::short(y)));
                (x, y)
            })
            .unzip();
        scatter(name, x, y, mode).with("text", said).with("hoverinfo", "text")
    };
    let mut traces: Vec<Object> = vec![
        trace("best of each size", sizes, "lines+markers")
            .with("line", stroke(COLOURS[0], 1.6))
            .with("marker", marker(COLOURS[0], 7)),
    ];
    let chosen = scored(std::slice::from_ref(&selection.chosen));
    if !chosen.is_empty() {
        let star = marker(COLOURS[1], 16).with("symbol", "star-open").with("line", stroke(COLOURS[1], 2.0));
        traces.push(trace("chosen", chosen, "markers").with("marker", star));
    }
    let layout = layout()
        .with("xaxis", axis("number of parameters"))
        .with("yaxis", axis(&format!("{name}, the smaller the better")))
        .with("hovermode", "closest");
    let words = format!(
        "The least {name} for each number of parameters, and the polynomial model that was chosen: {}.",
        selection.chosen.orders
    );
    chart("The best of each size", words, 340, traces, layout)
}

/// What each delay costs.
pub(crate) fn delays(selection: &Selection) -> Drawn {
    let mut traces: Vec<Object> = Vec::new();
    for (position, delay) in selection.delays.iter().enumerate() {
        let scans = delay.mdl.iter().filter(|scan| scan.mdl.is_finite());
        let (x, y): (Vec<f64>, Vec<f64>) = scans.map(|scan| (scan.nk as f64, scan.mdl)).unzip();
        let curve = line(&text::plain(&delay.input), Curve { x, y: rounded(&y) }, position);
        traces.push(curve.with("mode", "lines+markers"));
    }
    let found: Vec<String> =
        selection.delays.iter().map(|delay| format!("{} {}", delay.input, delay.nk)).collect();
    let words =
        format!("MDL of models that differ in their delay alone. Found: {} samples.", found.join(", "));
    let layout = layout().with("xaxis", axis("delay [samples]")).with("yaxis", axis("MDL"));
    chart("Delay", words, 300, traces, layout)
}
