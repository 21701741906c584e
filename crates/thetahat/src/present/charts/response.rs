//! Measured responses, and models over them.

use serde_json::json;

use super::decimate::Curve;
use super::figure::{
    Drawn, NEUTRAL, axis, band, chart, layout, line, logarithmic, plain_line, positive_range, significant,
};
use super::object::{Object, marker};
use super::text;
use crate::model::{LinearModel, Quantity};
use crate::respond::FrequencyPoint;
use crate::spectrum::MeasuredResponse;

/// Points nearer than this factor are one in a picture.
const APART: f64 = 1.002;
/// Fewer points than this are shown as such.
const FEW: usize = 60;

/// Magnitude, phase and coherence from one input, with the same of models.
pub(crate) fn measured(
    found: &MeasuredResponse,
    input: &str,
    models: &[(String, &LinearModel<'_>)],
) -> Drawn {
    let title = format!("Response from {input}");
    let Some(response) = found.from_input(input).filter(|response| !response.points.is_empty()) else {
        return Err(format!("{title}: none, the input has no power of its own."));
    };
    let points = apart(&response.points, |point| point.frequency);
    let frequencies: Vec<f64> = points.iter().map(|point| point.frequency).collect();
    let x: Vec<f64> = frequencies.iter().copied().map(significant).collect();
    let mut traces: Vec<Object> = Vec::new();
    let mut add = |name: &str, points: &[&FrequencyPoint], position: usize, alone: bool| {
        for (axis, turn) in [("y", false), ("y2", true)] {
            let shown = |value: f64| significant(if turn { value.to_degrees() } else { value });
            let of = |point: &&FrequencyPoint| if turn { point.phase } else { point.magnitude };
            if alone {
                let end = |of: Quantity, upper: bool| {
                    let end = of.interval.and_then(|ends| if upper { ends.upper } else { ends.lower });
                    // The logarithm of zero has no place.
                    end.filter(|end| turn || *end > 0.0)
                        .or(of.interval.map(|_| of.value / 100.0))
                        .map_or(f64::NAN, shown)
                };
                let [low, high] = [false, true]
                    .map(|upper| points.iter().map(|point| end(of(point), upper)).collect::<Vec<f64>>());
                if low.iter().any(|end| end.is_finite()) {
                    let band = band("95 % band", &x, &low, &high, super::figure::COLOURS[0]);
                    traces.push(band.with("yaxis", axis).with("showlegend", !turn));
                }
            }
            let y = points.iter().map(|point| shown(of(point).value)).collect();
            let mut curve = line(name, Curve { x: x.clone(), y }, position).with("yaxis", axis);
            if alone && points.len() <= FEW {
                let dots = marker(super::figure::COLOURS[0], 5);
                curve = curve.with("mode", "lines+markers").with("marker", dots);
            }
            traces.push(curve.with("legendgroup", name).with("showlegend", !turn));
        }
    };
    add("measured", &points, 0, true);
    let mut refused = String::new();
    for (position, (name, model)) in models.iter().enumerate() {
        match model.frequency_response(&frequencies) {
            Ok(responses) => {
                if let Some(of) = responses.iter().find(|of| of.input.as_deref() == Some(input)) {
                    add(&text::plain(name), &of.points.iter().collect::<Vec<_>>(), position + 1, false);
                }
            }
            Err(error) => refused.push_str(&format!(" {name} is left out: {error}.")),
        }
    }
    let coherence = apart(&found.noise, |point| point.frequency);
    let known: Vec<(f64, f64)> = coherence
        .iter()
        .filter_map(|point| Some((significant(point.frequency), significant(point.coherence?))))
        .collect();
    let (from, to) = positive_range(frequencies.iter().copied());
    let (least, largest) = positive_range(points.iter().map(|point| point.magnitude.value));
    let mut layout = layout()
        .with("xaxis", logarithmic("frequency [rad/s]", from, to).with("anchor", "y3"))
        .with("yaxis", logarithmic("magnitude", least, largest).with("domain", json!([0.6, 1.0])))
        .with("yaxis2", axis("phase [°]").with("domain", json!([0.24, 0.56])));
    if !known.is_empty() {
        let (x, y) = known.into_iter().unzip();
        let curve = plain_line("coherence", Curve { x, y }, NEUTRAL);
        traces.push(curve.with("yaxis", "y3").with("showlegend", false));
    }
    layout = layout.with(
        "yaxis3",
        axis("coherence").with("domain", json!([0.0, 0.2])).with("range", json!([0.0, 1.02])),
    );
    let words = format!(
        "How much of a sine of each frequency arrives at the output, in its units for each unit of the input, by how many degrees it is \
         turned, and which part of the output's power the inputs explain.{}{refused}",
        match found.bands.honest {
            Some(true) => " Shaded: 95 % intervals of each point.",
            Some(false) => " Shaded: 95 % intervals of each point, which are not honest here.",
            None => "",
        }
    );
    chart(title, words, 560, traces, layout)
}

/// The power spectral density of what the inputs do not explain.
pub(crate) fn measured_noise(found: &MeasuredResponse) -> Drawn {
    let there = found.noise.iter().filter(|point| point.density.is_some_and(|density| density > 0.0));
    let there: Vec<_> = there.copied().collect();
    if there.is_empty() {
        return Err("Spectrum of the noise: none, the method does not tell.".to_owned());
    }
    let points = apart(&there, |point| point.frequency);
    let (x, y): (Vec<f64>, Vec<f64>) = points
        .iter()
        .map(|point| (significant(point.frequency), significant(point.density.unwrap_or(f64::NAN))))
        .unzip();
    let (from, to) = positive_range(x.iter().copied());
    let (least, largest) = positive_range(y.iter().copied());
    let layout = layout()
        .with("xaxis", logarithmic("frequency [rad/s]", from, to))
        .with("yaxis", logarithmic("power spectral density", least, largest));
    let traces = vec![line("noise", Curve { x, y }, 0).with("showlegend", false)];
    let words = "What the inputs do not explain of the output: its power spectral density in units squared per rad/s.";
    chart("Spectrum of the noise", words, 320, traces, layout)
}

/// Some of many points, each a factor above the one before.
fn apart<T>(points: &[T], frequency: impl Fn(&T) -> f64) -> Vec<&T> {
    let mut last = 0.0;
    let far = |point: &&T| {
        let far = frequency(point) >= APART * last;
        if far {
            last = frequency(point);
        }
        far
    };
    points.iter().filter(far).collect()
}
