//! An inspection as a table for people.

use thetahat::{ChannelQuality, Excitation, Inspection, SpectrumPoint};

use super::text::{Text, columns, number, or_dash, short};
use crate::output::harmless;

/// What was found, the warnings, and the line that would fit a model.
pub fn inspection(inspection: &Inspection) -> String {
    let mut text = Text::default();
    text.line(&clock(inspection));
    text.line("");
    values(&mut text, &inspection.channels);
    quality(&mut text, &inspection.channels);
    inputs(&mut text, inspection);
    for warning in &inspection.warnings {
        text.line(&format!("warning: {}", harmless(warning)));
    }
    if let Some(command) = &inspection.command {
        text.line("");
        text.line(&harmless(command));
    }
    text.finish()
}

fn clock(inspection: &Inspection) -> String {
    let clock = &inspection.clock;
    let (file, step) = (harmless(&inspection.log.file), short(clock.sample_time));
    let rows = match inspection.experiments {
        1 => format!("{} rows", inspection.rows),
        experiments => format!("{} rows in {experiments} experiments", inspection.rows),
    };
    if !clock.measured {
        return format!("{file}: {rows}, sample time {step} s");
    }
    let (shortest, longest) = clock.steps;
    format!(
        "{file}: {rows}, {} clock: steps from {} s to {} s, median {step} s, jitter {:.2} %, {} gap{}",
        if clock.irregular { "irregular" } else { "regular" },
        short(shortest),
        short(longest),
        100.0 * clock.jitter,
        clock.gaps,
        if clock.gaps == 1 { "" } else { "s" }
    )
}

fn values(text: &mut Text, channels: &[ChannelQuality]) {
    let mut table = columns(&[
        "channel",
        "role",
        "minimum",
        "maximum",
        "mean",
        "standard deviation",
        "trend [1/s]",
        "trend [% of variance]",
    ]);
    for channel in channels {
        table.add_row([
            harmless(&channel.name),
            channel.role.clone().unwrap_or_default(),
            or_dash(channel.minimum, number),
            or_dash(channel.maximum, number),
            or_dash(channel.mean, number),
            or_dash(channel.standard_deviation, number),
            or_dash(channel.trend, number),
            or_dash(channel.trend_share, |share| format!("{:.1}", 100.0 * share)),
        ]);
    }
    text.table(table, &[2, 3, 4, 5, 6, 7]);
}

fn quality(text: &mut Text, channels: &[ChannelQuality]) {
    let mut table = columns(&[
        "channel",
        "missing",
        "repeated",
        "longest hold",
        "rounded to",
        "at minimum",
        "at maximum",
        "outliers",
    ]);
    for channel in channels {
        table.add_row([
            harmless(&channel.name),
            channel.missing.to_string(),
            channel.repeated.to_string(),
            channel.longest_hold.to_string(),
            or_dash(channel.quantization, short),
            or_dash(channel.saturation, |saturation| saturation.low.to_string()),
            or_dash(channel.saturation, |saturation| saturation.high.to_string()),
            channel.outlier_count.to_string(),
        ]);
    }
    text.table(table, &[1, 2, 3, 4, 5, 6, 7]);
}

fn inputs(text: &mut Text, inspection: &Inspection) {
    if inspection.excitation.is_empty() {
        return;
    }
    let mut table = columns(&[
        "input",
        "excites order",
        "changes [%]",
        "half its power below [rad/s]",
        "delay [rows]",
        "confidence [%]",
        "feedback p-value",
    ]);
    for excitation in &inspection.excitation {
        let delay = inspection.delays.iter().find(|delay| delay.input == excitation.input);
        let feedback = inspection.feedback.iter().find(|feedback| feedback.input == excitation.input);
        table.add_row([
            harmless(&excitation.input),
            order(excitation),
            format!("{:.1}", 100.0 * excitation.changes),
            or_dash(half_power(&excitation.spectrum), number),
            or_dash(delay.and_then(|delay| delay.nk), |nk| nk.to_string()),
            or_dash(delay.and_then(|delay| delay.confidence), |confidence| {
                // No rounding up to certainty.
                format!("{:.2}", (1e4 * confidence).floor() / 100.0)
            }),
            or_dash(feedback.and_then(|feedback| feedback.p_value), |p_value| format!("{p_value:.4}")),
        ]);
    }
    text.table(table, &[1, 2, 3, 4, 5, 6]);
}

fn order(excitation: &Excitation) -> String {
    let Excitation { order, highest, .. } = excitation;
    if order == highest && *order > 0 { format!("{order} or more") } else { order.to_string() }
}

/// The frequency below which half of the power lies.
fn half_power(spectrum: &[SpectrumPoint]) -> Option<f64> {
    let areas = || {
        spectrum.windows(2).map(|pair| {
            (
                pair[1].frequency,
                (pair[1].frequency - pair[0].frequency) * 0.5 * (pair[0].density + pair[1].density),
            )
        })
    };
    let whole: f64 = areas().map(|(_, area)| area).sum();
    let mut below = 0.0;
    areas()
        .find(|(_, area)| {
            below += area;
            whole > 0.0 && below >= 0.5 * whole
        })
        .map(|(frequency, _)| frequency)
}
