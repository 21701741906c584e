//! Power over frequency.

use super::decimate::Curve;
use super::figure::{Drawn, chart, layout, line, logarithmic, positive_range, significant};
use super::object::Object;
use super::text;
use crate::inspect::Excitation;

/// The most points of a spectrum, and of all of them: neighbours are averaged.
const POINTS: [usize; 2] = [2000, 20_000];

/// The power spectral densities of the inputs.
pub(crate) fn spectrum(inputs: &[Excitation]) -> Drawn {
    let most = (POINTS[1] / inputs.len().max(1)).clamp(20, POINTS[0]);
    let mut traces: Vec<Object> = Vec::new();
    for (position, input) in inputs.iter().enumerate() {
        let there = input.spectrum.iter().filter(|point| point.frequency > 0.0 && point.density > 0.0);
        let points: Vec<_> =
            there.filter(|point| point.frequency.is_finite() && point.density.is_finite()).collect();
        let width = points.len().div_ceil(most).max(1);
        let mean = |values: &mut dyn Iterator<Item = f64>, count: usize| {
            significant(values.sum::<f64>() / count as f64)
        };
        let (x, y): (Vec<f64>, Vec<f64>) = points
            .chunks(width)
            .map(|chunk| {
                let frequency = mean(&mut chunk.iter().map(|point| point.frequency), chunk.len());
                (frequency, mean(&mut chunk.iter().map(|point| point.density), chunk.len()))
            })
            .unzip();
        if !x.is_empty() {
            traces.push(line(&text::plain(&input.input), Curve { x, y }, position));
        }
    }
    if traces.is_empty() {
        return Err("No input has a spectrum: none changes.".to_owned());
    }
    let points = || inputs.iter().flat_map(|input| &input.spectrum);
    let (first, last) = positive_range(points().map(|point| point.frequency));
    let (least, largest) = positive_range(points().map(|point| point.density));
    let layout = layout()
        .with("xaxis", logarithmic("frequency [rad/s]", first, last))
        .with("yaxis", logarithmic("power spectral density", least, largest));
    let words = "Power spectral density of the inputs in units squared per rad/s, the mean removed. Where an input has no \
                 power, a fit learns nothing.";
    chart("Spectra of the inputs", words, 340, traces, layout)
}
