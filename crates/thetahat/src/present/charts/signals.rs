//! Signals over time: one above the other on a common clock, so that they are zoomed together.

use serde_json::{Value, json};

use super::decimate::{Curve, decimate};
use super::figure::{self, COLOURS, Drawn, NEUTRAL, axis, chart, layout, line, plain_line, significant};
use super::object::{Object, marker, scatter, stroke};
use super::text;
use crate::data::{Rows, Source};

/// More panels than these go into a further figure.
const MOST_PANELS: usize = 8;
/// More shaded segments than these are no help.
const MOST_SHADES: usize = 40;
/// The height of a panel, of one that has several curves, and of what else a figure has, in pixels.
const HEIGHTS: [usize; 3] = [130, 280, 90];
/// What was measured.
const MEASURED: &str = "rgba(128,128,128,0.6)";
/// Parts of a panel's share that stay free between panels.
const SPACE: f64 = 0.03;

/// Rows to be told apart from the others.
pub(crate) struct Shade {
    pub(crate) name: String,
    pub(crate) rows: Vec<Rows>,
}

/// Panels above each other over one time axis.
pub(crate) struct Stack<'a> {
    time: &'a [f64],
    /// Where times are dates: seconds from 1970 to the first one, as the clocks on the wall show it.
    start: Option<f64>,
    /// A step of the clock above this one is a gap.
    longest: f64,
    /// The most points of a curve.
    points: usize,
    traces: Vec<Object>,
    panels: Vec<Panel>,
    curves: usize,
}

struct Panel {
    title: String,
    height: usize,
    /// As much again above and below what was measured, if something was.
    window: Option<[f64; 2]>,
    /// Whether a curve leaves the window.
    left: bool,
}

impl Panel {
    fn new(title: String, height: usize) -> Self {
        Self { title, height, window: None, left: false }
    }
}

impl<'a> Stack<'a> {
    pub(crate) fn new(time: &'a [f64], sample_time: f64, points: usize) -> Self {
        let longest = 1.5 * sample_time;
        Self { time, start: None, longest, points, traces: vec![], panels: vec![], curves: 0 }
    }

    /// The same with dates on its axis, where these are one log whose times are dates.
    pub(crate) fn dated(self, logs: &[Source]) -> Self {
        let start = match logs {
            [log] => log.wall_seconds(),
            _ => None,
        };
        Self { start, ..self }
    }

    /// A time as the axis has it: in seconds, or in milliseconds since 1970.
    fn at(&self, time: f64) -> f64 {
        self.start.map_or_else(|| significant(time), |start| ((start + time) * 1e6).round() / 1e3)
    }

    /// The points of a curve that are shown.
    fn points(&self, values: &[f64]) -> Curve {
        let mut curve = decimate(self.time, values, self.points, self.longest);
        if self.start.is_some() {
            curve.x.iter_mut().for_each(|time| *time = self.at(*time));
        }
        curve
    }

    /// Whether no further panel fits.
    pub(crate) fn is_full(&self) -> bool {
        self.panels.len() == MOST_PANELS
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.panels.is_empty()
    }

    /// A further panel below the others, for several curves.
    pub(crate) fn panel(&mut self, name: &str) {
        self.panels.push(Panel::new(text::plain(name), HEIGHTS[1]));
    }

    /// What was measured. The panel scales to it: a curve that diverges leaves the chart.
    pub(crate) fn measured(&mut self, name: &str, values: &[f64]) {
        if let Some(panel) = self.panels.last_mut() {
            panel.window = window(values);
        }
        let curve = self.points(values);
        // Wide and faint: what lies on it leaves it in sight.
        let wide = stroke(MEASURED, 4.0);
        self.traces.push(plain_line(name, curve, NEUTRAL).with("line", wide).with("yaxis", self.axis()));
    }

    /// A signal in the next colour.
    pub(crate) fn curve(&mut self, name: &str, values: &[f64]) {
        let position = self.curves;
        self.curves += 1;
        self.coloured(name, values, position, true);
    }

    /// A signal in a further panel of its own.
    pub(crate) fn alone(&mut self, name: &str, values: &[f64], position: usize) {
        self.panels.push(Panel::new(text::brief(name), HEIGHTS[0]));
        // Nothing else is there to be told apart from: no dashes.
        self.coloured(name, values, position % COLOURS.len(), false);
    }

    fn coloured(&mut self, name: &str, values: &[f64], position: usize, legend: bool) {
        if let Some(Panel { window: Some([low, high]), left, .. }) = self.panels.last_mut() {
            *left |= values.iter().any(|value| value < low || value > high);
        }
        let curve = self.points(values);
        let trace =
            line(&text::plain(name), curve, position).with("yaxis", self.axis()).with("showlegend", legend);
        self.traces.push(trace);
    }

    /// Marks rows of a signal under a name, which the legend has once: single rows, or from the first to the last where
    /// the signal stays at a value.
    pub(crate) fn marks(&mut self, name: &str, rows: &[Rows], values: &[f64], legend: bool) {
        let at = |row: usize| Some((self.at(*self.time.get(row)?), significant(*values.get(row)?)));
        let ends = rows.iter().filter_map(|rows| Some([at(rows.first() - 1)?, at(rows.last() - 1)?]));
        let lines = ends.filter(|ends| ends.iter().all(|(_, value)| value.is_finite()));
        // A value that is no number ends a line.
        let points = lines.flat_map(|[first, last]| [first, last, (last.0, f64::NAN)]);
        let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
        if x.is_empty() {
            return;
        }
        let trace = scatter(name, x, y, "lines+markers")
            .with("line", stroke(COLOURS[1], 2.5))
            .with("marker", marker(COLOURS[1], 10).with("symbol", "circle-open"))
            .with("legendgroup", name)
            .with("showlegend", legend)
            .with("yaxis", self.axis());
        self.traces.push(trace);
    }

    fn axis(&self) -> String {
        format!("y{}", number(self.panels.len()))
    }

    /// The figure.
    pub(crate) fn draw(self, title: &str, words: &str, shades: &[Shade]) -> Drawn {
        let all: usize = self.panels.iter().map(|panel| panel.height).sum();
        let mut layout = layout();
        let mut top = 1.0;
        for (position, panel) in self.panels.iter().enumerate() {
            let below = top - panel.height as f64 / all as f64;
            let bottom = if position + 1 == self.panels.len() { 0.0 } else { below + SPACE };
            let mut own = axis(&panel.title).with("domain", json!([bottom.max(0.0), top.max(bottom)]));
            if let (Some(window), true) = (panel.window, panel.left) {
                own = own.with("range", json!(window.map(significant)));
            }
            layout = layout.with(&format!("yaxis{}", number(position + 1)), own);
            top = below;
        }
        let anchor = self.axis();
        let clock = match self.start {
            Some(_) => axis("time").with("type", "date"),
            None => axis("time [s]").with("exponentformat", "none"),
        };
        layout = layout.with("xaxis", clock.with("anchor", anchor));
        let (shapes, labels) = self.shades(shades);
        layout = layout.with("shapes", shapes).with("annotations", labels);
        chart(title, words, all + HEIGHTS[2], self.traces, layout)
    }

    /// Areas behind the curves, with their names.
    fn shades(&self, shades: &[Shade]) -> (Vec<Value>, Vec<Value>) {
        let segments = shades
            .iter()
            .enumerate()
            .flat_map(|(k, shade)| shade.rows.iter().map(move |rows| (k, shade, rows)));
        let (mut shapes, mut labels) = (Vec::new(), Vec::new());
        for (position, shade, rows) in segments.take(MOST_SHADES) {
            let (Some(first), Some(last)) = (self.time.get(rows.first() - 1), self.time.get(rows.last() - 1))
            else {
                continue;
            };
            let (first, last) = (self.at(*first), self.at(*last));
            if !(first.is_finite() && last.is_finite()) {
                continue;
            }
            let (colour, _) = figure::style(position);
            shapes.push(json!({
                "type": "rect", "layer": "below", "xref": "x", "yref": "paper",
                "x0": first, "x1": last, "y0": 0, "y1": 1,
                "fillcolor": format!("{colour}14"), "line": {"width": 0},
            }));
            labels.push(json!({
                "text": text::plain(&shade.name), "showarrow": false, "xref": "x", "yref": "paper",
                "x": first, "y": 1, "xanchor": "left", "yanchor": "top",
                "font": {"size": 11, "color": NEUTRAL},
            }));
        }
        (shapes, labels)
    }
}

/// Measured and modelled outputs of several models.
pub(crate) fn outputs(
    title: &str,
    words: &str,
    stack: Stack<'_>,
    output: &str,
    measured: &[f64],
    modelled: &[(String, &[f64])],
) -> Drawn {
    let mut stack = stack;
    stack.panel(output);
    stack.measured("measured", measured);
    for (name, values) in modelled {
        stack.curve(name, values);
    }
    stack.draw(title, words, &[])
}

/// What follows the name of the axis of a panel, counted from 1: the first has no number.
fn number(panel: usize) -> String {
    if panel > 1 { panel.to_string() } else { String::new() }
}

/// As much again above and below these values as they span; none if none of them is a number.
fn window(values: &[f64]) -> Option<[f64; 2]> {
    let there = values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = there
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let span = match high - low {
        span if span > 0.0 => span,
        _ if high != 0.0 => high.abs(),
        _ => 1.0,
    };
    (low <= high).then_some([low - span, high + span])
}

#[cfg(test)]
mod tests;
