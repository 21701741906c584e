//! What all charts have in common: they are described here and drawn by the charting library.

use serde::Serialize;
use serde_json::json;

use super::decimate::Curve;
use super::object::{Object, scatter, stroke};
use super::text;

/// Colours that differ in lightness and hue for people who see colours differently (Okabe and Ito 2008, Color Universal
/// Design), each with a contrast of 3:1 at least to white and to the page's dark ground.
pub(super) const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#00906a", "#b8579a", "#8c6d1f", "#6478d8"];
/// What was measured.
pub(super) const NEUTRAL: &str = "#808080";
/// Lines of the grid.
const GRID: &str = "rgba(128,128,128,0.25)";
const CLEAR: &str = "rgba(0,0,0,0)";
/// Two-sided 95 % of the normal distribution.
pub(super) const NORMAL_95: f64 = 1.959_964;

/// A chart as the page carries it.
#[derive(Debug, Clone)]
pub(crate) struct Chart {
    /// What it shows, in a few words.
    pub(crate) title: String,
    /// How to read it.
    pub(crate) words: String,
    /// In pixels.
    pub(crate) height: usize,
    /// For the charting library; may stand inside a script element.
    pub(crate) json: String,
}

/// A chart, or a sentence that says why there is none.
pub(crate) type Drawn = Result<Chart, String>;

#[derive(Serialize)]
struct Figure {
    data: Vec<Object>,
    layout: Object,
    config: Object,
}

/// A chart of these traces.
pub(super) fn chart(
    title: impl Into<String>,
    words: impl Into<String>,
    height: usize,
    traces: Vec<Object>,
    layout: Object,
) -> Drawn {
    let figure = Figure { data: traces, layout: layout.with("height", height), config: configuration() };
    let json =
        serde_json::to_string(&figure).map_err(|error| format!("This chart cannot be written: {error}."))?;
    Ok(Chart { title: title.into(), words: words.into(), height, json: text::inside_script(&json) })
}

fn configuration() -> Object {
    Object::default()
        .with("responsive", true)
        .with("displaylogo", false)
        .with("displayModeBar", "hover")
        .with("doubleClick", "reset+autosize")
        .with("typesetMath", false)
        .with("modeBarButtonsToRemove", json!(["select2d", "lasso2d"]))
}

/// A layout without its axes. Text gets its colour from the page.
pub(super) fn layout() -> Object {
    let legend = json!({
        "orientation": "h", "x": 0, "xanchor": "left", "y": 1.02, "yanchor": "bottom", "bgcolor": CLEAR,
    });
    Object::default()
        .with("autosize", true)
        .with("paper_bgcolor", CLEAR)
        .with("plot_bgcolor", CLEAR)
        .with("font", json!({"family": "system-ui, sans-serif", "size": 13, "color": NEUTRAL}))
        .with("margin", json!({"l": 56, "r": 12, "t": 40, "b": 52}))
        .with("legend", legend)
        .with("modebar", json!({"bgcolor": CLEAR, "color": NEUTRAL, "activecolor": COLOURS[1]}))
        .with("showlegend", true)
        .with("hovermode", "x unified")
        // The whole name.
        .with("hoverlabel", json!({"namelength": -1}))
}

/// An axis with a title, in which names are [`text::plain`].
pub(super) fn axis(title: &str) -> Object {
    Object::default()
        .with("title", json!({"text": title}))
        .with("automargin", true)
        .with("gridcolor", GRID)
        .with("zerolinecolor", "rgba(128,128,128,0.6)")
        .with("linecolor", GRID)
}

/// A logarithmic axis for values between these.
pub(super) fn logarithmic(title: &str, low: f64, high: f64) -> Object {
    let axis = axis(title).with("type", "log").with("exponentformat", "power");
    // Over a decade and more their names are enough.
    if high > 10.0 * low { axis.with("dtick", 1) } else { axis.with("nticks", 5) }
}

/// The smallest and the largest of the values that a logarithmic axis can show.
pub(super) fn positive_range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let there = values.filter(|value| value.is_finite() && *value > 0.0);
    there.fold((f64::INFINITY, 0.0), |(low, high), value| (low.min(value), high.max(value)))
}

/// The colour and the dashes of the curve at a position: a second round has the colours again, but dashed.
pub(super) fn style(position: usize) -> (&'static str, &'static str) {
    const DASHES: [&str; 4] = ["solid", "dash", "dot", "longdashdot"];
    (COLOURS[position % COLOURS.len()], DASHES[position / COLOURS.len() % DASHES.len()])
}

/// A line with a name, which is [`text::plain`].
pub(super) fn line(name: &str, curve: Curve, position: usize) -> Object {
    let (colour, dash) = style(position);
    plain_line(name, curve, colour).with("line", stroke(colour, 1.6).with("dash", dash))
}

/// A line in a colour of its own.
pub(super) fn plain_line(name: &str, curve: Curve, colour: &str) -> Object {
    scatter(name, curve.x, curve.y, "lines").with("line", stroke(colour, 1.4))
}

/// The area between two curves over the same x.
pub(super) fn band(name: &str, x: &[f64], low: &[f64], high: &[f64], colour: &str) -> Object {
    let there = (0..x.len()).filter(|&k| low[k].is_finite() && high[k].is_finite());
    let there: Vec<usize> = there.collect();
    let forth = there.iter().map(|&k| (x[k], high[k]));
    let back = there.iter().rev().map(|&k| (x[k], low[k]));
    let (x, y) = forth.chain(back).map(|(x, y)| (significant(x), significant(y))).unzip();
    scatter(name, x, y, "lines")
        .with("fill", "toself")
        .with("fillcolor", faint(colour))
        .with("line", stroke(CLEAR, 0.0))
        .with("hoverinfo", "skip")
}

/// The colour as that of an area.
pub(super) fn faint(colour: &str) -> String {
    format!("{colour}38")
}

/// A number with as many digits as a picture can show.
pub(super) fn significant(value: f64) -> f64 {
    super::decimate::significant(value, 7)
}
