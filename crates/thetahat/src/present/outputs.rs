//! Measured and modelled outputs over time.

use std::ops::Range;

use super::charts::{self, Shade, Stack};
use super::fits::fits;
use super::tree::Sections;
use crate::data::Source;
use crate::model::Model;
use crate::report::{OutputSignals, Report, Validated};
use crate::validate::Fit;

/// The most points of a curve over time.
const POINTS: usize = 4000;
/// The most points of all such curves of a page, at about 20 bytes each.
const ALL_POINTS: usize = 100_000;
/// The rows that are shown one by one where the whole log is too dense for that.
const DETAIL: usize = 1000;
/// Inputs in the picture of the outputs; the others have one of their own.
const INPUTS: usize = 5;

/// How many points each of several curves may have.
pub(super) fn points(curves: usize) -> usize {
    (ALL_POINTS / curves.max(1)).clamp(20, POINTS)
}

/// Times that put several logs one after the other, each with a clock of its own, and a space between them.
pub(super) fn timeline(time: &[f64], logs: &[Source], sample_time: f64) -> Vec<f64> {
    let mut shown = time.to_vec();
    let space = sample_time * (2 + time.len() / 100) as f64;
    for pair in logs.windows(2) {
        let (first, last) = (pair[1].rows.first() - 1, pair[1].rows.last().min(time.len()));
        let Some(shift) =
            first.checked_sub(1).and_then(|before| Some(shown.get(before)? + space - time.get(first)?))
        else {
            continue;
        };
        shown[first..last.max(first)].iter_mut().for_each(|time| *time += shift);
    }
    shown
}

/// Measured, predicted and simulated output, what is left, and the inputs.
pub(super) fn outputs(
    on: &mut Sections,
    model: &Model,
    parts: &[(String, &Validated)],
    shades: &[Shade],
    found: &[Fit],
    logs: &[Source],
) {
    on.section("Measured and modelled");
    let Some((_, Validated { signals, .. })) = parts.first() else {
        on.line("There are no signals to show.");
        on.table(fits(found));
        return;
    };
    let there = |values: &[f64]| values.iter().any(|value| value.is_finite());
    let rows = signals.time.len();
    let time = timeline(&signals.time, logs, model.sample_time());
    // Steps of a clock without a rhythm are no gaps.
    let step = if model.takes_any_clock() { f64::INFINITY } else { model.sample_time() };
    let (near, far) = signals.inputs.split_at(signals.inputs.len().min(INPUTS));
    let stack = |index: usize, output: &OutputSignals, shown: Range<usize>, points: usize| {
        let own = || parts.iter().filter_map(move |(_, validated)| validated.signals.outputs.get(index));
        let predicted = merged(own().map(|output| output.predicted.as_slice()));
        let simulated = merged(own().filter_map(|output| output.simulated.as_deref()));
        let errors: Vec<f64> =
            output.measured.iter().zip(&predicted).map(|(y, predicted)| y - predicted).collect();
        let part = |values: &[f64]| values.get(shown.clone()).map(<[f64]>::to_vec).unwrap_or_default();
        let mut stack = Stack::new(&time[shown.clone()], step, points).dated(logs);
        stack.panel(&output.name);
        stack.measured("measured", &part(&output.measured));
        if there(&simulated) {
            stack.curve("free run", &part(&simulated));
        }
        if there(&predicted) {
            stack.curve("1 step ahead", &part(&predicted));
            stack.alone("residual", &part(&errors), 4);
        }
        for (position, (name, values)) in near.iter().enumerate() {
            stack.alone(name, &part(values), 2 + position);
        }
        stack
    };
    let points = points(4 + signals.inputs.len());
    let words = "Measured output, the model's prediction one step ahead and its free run, driven by the inputs alone; below \
                 them what the prediction leaves, and the inputs. One time axis: zooming one zooms all.";
    let anew = if parts.len() > 1 { " Each part has a free run of its own." } else { "" };
    let dense = if rows > points {
        format!(" Of each {} rows the smallest and the largest value are shown.", rows.div_ceil(points / 2))
    } else {
        String::new()
    };
    let several =
        if logs.len() > 1 { " The logs stand one after the other, whenever they were made." } else { "" };
    for (index, output) in signals.outputs.iter().enumerate() {
        let which = if signals.outputs.len() > 1 { format!(" {}", output.name) } else { String::new() };
        on.chart(|| {
            stack(index, output, 0..rows, points).draw(
                &format!("Output{which} over time"),
                &format!("{words}{anew}{several}{dense}"),
                shades,
            )
        });
        if rows > points {
            // Of the rows that the fit knows least.
            let last = parts.last().and_then(|(_, validated)| validated.signals.outputs.get(index));
            let start = last.and_then(|output| output.predicted.iter().position(|y| y.is_finite()));
            let start = start.unwrap_or(0).min(rows);
            let shown = start..(start + DETAIL).min(rows);
            let words = format!("The same, with each of the rows {} to {}.", shown.start + 1, shown.end);
            let chart = stack(index, output, shown, DETAIL);
            on.chart(|| chart.draw(&format!("Output{which} in detail"), &words, &[]));
        }
    }
    for group in far.chunks(8) {
        let mut stack = Stack::new(&time, step, points).dated(logs);
        for (position, (name, values)) in group.iter().enumerate() {
            stack.alone(name, values, 2 + position);
        }
        let words = "The inputs that are not in the picture above.";
        on.chart(|| stack.draw("Further inputs", words, shades));
    }
    on.table(fits(found));
}

/// One signal of several that are there at different rows.
pub(super) fn merged<'a>(signals: impl Iterator<Item = &'a [f64]>) -> Vec<f64> {
    let mut merged: Vec<f64> = Vec::new();
    for signal in signals {
        if merged.len() < signal.len() {
            merged.resize(signal.len(), f64::NAN);
        }
        for (merged, value) in merged.iter_mut().zip(signal) {
            if !merged.is_finite() {
                *merged = *value;
            }
        }
    }
    merged
}

/// The outputs of several models on one log.
pub(super) fn compared_outputs(
    on: &mut Sections,
    reports: &[Report],
    models: &[(String, &Validated)],
    logs: &[Source],
) {
    let Some((_, Validated { signals, .. })) = models.first() else { return };
    let any_clock = reports.iter().any(|report| report.model.takes_any_clock());
    let sample_time = reports.first().map_or(1.0, |report| report.model.sample_time());
    let step = if any_clock { f64::INFINITY } else { sample_time };
    let points = points(2 * (models.len() + 1));
    let stack = || Stack::new(&signals.time, step, points).dated(logs);
    let mut outputs: Vec<&OutputSignals> = Vec::new();
    for output in models.iter().flat_map(|(_, validated)| &validated.signals.outputs) {
        if !outputs.iter().any(|known| known.name == output.name) {
            outputs.push(output);
        }
    }
    for output in &outputs {
        let which = if outputs.len() > 1 { format!(": {}", output.name) } else { String::new() };
        on.section(format!("Measured and modelled{which}"));
        let own = || {
            models.iter().filter_map(|(name, validated)| {
                let own = validated.signals.outputs.iter().find(|own| own.name == output.name)?;
                Some((name.clone(), own))
            })
        };
        let simulated: Vec<(String, &[f64])> =
            own().filter_map(|(name, own)| Some((name, own.simulated.as_deref()?))).collect();
        let predicted: Vec<(String, &[f64])> =
            own().map(|(name, own)| (name, own.predicted.as_slice())).collect();
        if simulated.is_empty() {
            on.line("No model has inputs: there is no free run.");
        } else {
            let words = "Measured output, and what each model makes of the inputs alone.";
            let (name, measured) = (&output.name, &output.measured);
            on.chart(|| charts::outputs("Free run", words, stack(), name, measured, &simulated));
        }
        let words = "Measured output, and what each model says of it one sample earlier.";
        let (name, measured) = (&output.name, &output.measured);
        on.chart(|| charts::outputs("One step ahead", words, stack(), name, measured, &predicted));
    }
}
