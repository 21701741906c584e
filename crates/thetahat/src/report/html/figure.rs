//! What all charts have in common: they are described here and drawn by the charting library.

use plotly::common::{
    Anchor, DashType, ExponentFormat, Fill, Font, HoverInfo, Label, Line, Mode, Orientation, Title,
};
use plotly::configuration::{Configuration, DisplayModeBar, DoubleClick, ModeBarButtonName};
use plotly::layout::{Axis, AxisType, HoverMode, Legend, Margin, ModeBar};
use plotly::{Layout, Scatter, Trace};
use serde::Serialize;

use super::decimate::Curve;
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
pub(super) struct Chart {
    /// What it shows, in a few words.
    pub(super) title: String,
    /// How to read it.
    pub(super) words: String,
    /// In pixels.
    pub(super) height: usize,
    /// For the charting library; may stand inside a script element.
    pub(super) json: String,
}

/// A chart, or a sentence that says why there is none.
pub(super) type Drawn = Result<Chart, String>;

#[derive(Serialize)]
struct Figure {
    data: Vec<Box<dyn Trace>>,
    layout: Layout,
    config: Configuration,
}

/// A chart of these traces.
pub(super) fn chart(
    title: impl Into<String>,
    words: impl Into<String>,
    height: usize,
    traces: Vec<Box<dyn Trace>>,
    layout: Layout,
) -> Drawn {
    let figure = Figure { data: traces, layout: layout.height(height), config: configuration() };
    let json =
        serde_json::to_string(&figure).map_err(|error| format!("This chart cannot be written: {error}."))?;
    Ok(Chart { title: title.into(), words: words.into(), height, json: text::inside_script(&json) })
}

fn configuration() -> Configuration {
    Configuration::new()
        .responsive(true)
        .display_logo(false)
        .display_mode_bar(DisplayModeBar::Hover)
        .double_click(DoubleClick::ResetAutoSize)
        .typeset_math(false)
        .mode_bar_buttons_to_remove(vec![ModeBarButtonName::Select2d, ModeBarButtonName::Lasso2d])
}

/// A layout without its axes. Text gets its colour from the page.
pub(super) fn layout() -> Layout {
    let legend = Legend::new()
        .orientation(Orientation::Horizontal)
        .x(0.0)
        .x_anchor(Anchor::Left)
        .y(1.02)
        .y_anchor(Anchor::Bottom)
        .background_color(CLEAR);
    Layout::new()
        .auto_size(true)
        .paper_background_color(CLEAR)
        .plot_background_color(CLEAR)
        .font(Font::new().family("system-ui, sans-serif").size(13).color(NEUTRAL))
        .margin(Margin::new().left(56).right(12).top(40).bottom(52))
        .legend(legend)
        .mode_bar(ModeBar::new().background_color(CLEAR).color(NEUTRAL).active_color(COLOURS[1]))
        .show_legend(true)
        .hover_mode(HoverMode::XUnified)
        // The whole name.
        .hover_label(Label::new().name_length(-1))
}

/// An axis with a title, in which names are [`text::plain`].
pub(super) fn axis(title: &str) -> Axis {
    Axis::new()
        .title(Title::with_text(title))
        .auto_margin(true)
        .grid_color(GRID)
        .zero_line_color("rgba(128,128,128,0.6)")
        .line_color(GRID)
}

/// A logarithmic axis for values between these.
pub(super) fn logarithmic(title: &str, low: f64, high: f64) -> Axis {
    let axis = axis(title).type_(AxisType::Log).exponent_format(ExponentFormat::Power);
    // Over a decade and more their names are enough.
    if high > 10.0 * low { axis.dtick(1.0) } else { axis.n_ticks(5) }
}

/// The smallest and the largest of the values that a logarithmic axis can show.
pub(super) fn positive_range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let there = values.filter(|value| value.is_finite() && *value > 0.0);
    there.fold((f64::INFINITY, 0.0), |(low, high), value| (low.min(value), high.max(value)))
}

/// The colour and the dashes of the curve at a position: a second round has the colours again, but dashed.
pub(super) fn look(position: usize) -> (&'static str, DashType) {
    const DASHES: [DashType; 4] = [DashType::Solid, DashType::Dash, DashType::Dot, DashType::LongDashDot];
    (COLOURS[position % COLOURS.len()], DASHES[position / COLOURS.len() % DASHES.len()].clone())
}

/// A line with a name, which is [`text::plain`].
pub(super) fn line(name: &str, curve: Curve, position: usize) -> Box<Scatter<f64, f64>> {
    let (colour, dash) = look(position);
    plain_line(name, curve, colour).line(Line::new().color(colour).dash(dash).width(1.6))
}

/// A line in a colour of its own.
pub(super) fn plain_line(name: &str, curve: Curve, colour: &'static str) -> Box<Scatter<f64, f64>> {
    Scatter::new(curve.x, curve.y).name(name).mode(Mode::Lines).line(Line::new().color(colour).width(1.4))
}

/// The area between two curves over the same x.
pub(super) fn band(name: &str, x: &[f64], low: &[f64], high: &[f64], colour: &str) -> Box<Scatter<f64, f64>> {
    let there = (0..x.len()).filter(|&k| low[k].is_finite() && high[k].is_finite());
    let there: Vec<usize> = there.collect();
    let forth = there.iter().map(|&k| (x[k], high[k]));
    let back = there.iter().rev().map(|&k| (x[k], low[k]));
    let (x, y) = forth.chain(back).map(|(x, y)| (significant(x), significant(y))).unzip();
    Scatter::new(x, y)
        .name(name)
        .mode(Mode::Lines)
        .fill(Fill::ToSelf)
        .fill_color(faint(colour))
        .line(Line::new().color(CLEAR).width(0.0))
        .hover_info(HoverInfo::Skip)
}

/// The colour as that of an area.
pub(super) fn faint(colour: &str) -> String {
    format!("{colour}38")
}

/// A number with as many digits as a picture can show.
pub(super) fn significant(value: f64) -> f64 {
    super::decimate::significant(value, 7)
}
