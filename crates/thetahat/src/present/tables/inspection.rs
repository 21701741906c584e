//! An inspection as a table for people.

use crate::figures::{chance, fixed, number, seconds, short};
use crate::inspect::{ChannelQuality, Excitation, Inspection, SpectrumPoint};
use crate::present::Layout;
use crate::text::{brief, harmless};

use super::text::{Text, columns, or_dash};

/// This many channels, and warnings, are shown of very many.
const MOST: usize = 10;

/// What was found, the warnings, and the line that would fit a model.
pub fn inspection(inspection: &Inspection, layout: Layout) -> String {
    let mut text = Text::new(layout);
    text.line(&clock(inspection));
    text.line("");
    let brief = inspection.brief(MOST);
    values(&mut text, &brief.channels);
    quality(&mut text, &brief.channels);
    more(&mut text, inspection.channels.len(), brief.channels.len(), "channels");
    inputs(&mut text, &brief);
    for warning in brief.warnings() {
        text.line(&format!("warning: {}", harmless(&warning)));
    }
    if !brief.findings.is_empty() {
        text.line("");
    }
    more(&mut text, inspection.findings.len(), brief.findings.len(), "warnings");
    if let Some(command) = &inspection.command {
        text.verbatim(&harmless(command));
    }
    text.finish()
}

/// Says what is not shown.
fn more(text: &mut Text, all: usize, shown: usize, what: &str) {
    if shown < all {
        text.line(&format!("and {} more {what}, which the JSON document has", all - shown));
        text.line("");
    }
}

fn clock(inspection: &Inspection) -> String {
    let clock = &inspection.clock;
    let (file, step) = (harmless(&inspection.log.file), seconds(clock.sample_time));
    let rows = match inspection.experiments {
        1 => format!("{} rows", inspection.rows),
        experiments => format!("{} rows in {experiments} experiments", inspection.rows),
    };
    if !clock.measured {
        return format!("{file}: {rows}, sample time {step}");
    }
    let (shortest, longest) = clock.steps;
    format!(
        "{file}: {rows}, {} clock: steps from {} to {}, median {step}, jitter {} %, {} gap{}",
        if clock.irregular { "irregular" } else { "regular" },
        seconds(shortest),
        seconds(longest),
        fixed(100.0 * clock.jitter, 2),
        clock.gaps,
        if clock.gaps == 1 { "" } else { "s" }
    )
}

fn name(name: &str) -> String {
    brief(name, 24)
}

fn values(text: &mut Text, channels: &[ChannelQuality]) {
    let mut table =
        columns(&["channel", "role", "minimum", "maximum", "mean", "deviation", "trend [1/s]", "[%]"])
            .words(&[1])
            .none("there is no value, or all are the same");
    for channel in channels {
        table.row([
            name(&channel.name),
            channel.role.clone().unwrap_or_default(),
            or_dash(channel.minimum, number),
            or_dash(channel.maximum, number),
            or_dash(channel.mean, number),
            or_dash(channel.standard_deviation, number),
            or_dash(channel.trend, number),
            or_dash(channel.trend_share, |share| fixed(100.0 * share, 1)),
        ]);
    }
    table.legend("trend: the slope of the best straight line, and the part of the variance that it explains");
    text.table(table);
}

fn quality(text: &mut Text, channels: &[ChannelQuality]) {
    let mut table = columns(&[
        "channel",
        "missing",
        "repeated",
        "longest hold",
        "rounded to",
        "lowest",
        "highest",
        "outliers",
    ])
    .none("it is not rounded, and does not rest at a limit");
    for channel in channels {
        table.row([
            name(&channel.name),
            channel.missing.to_string(),
            channel.repeated.to_string(),
            channel.longest_hold.to_string(),
            or_dash(channel.quantization, short),
            or_dash(channel.saturation.as_ref(), |saturation| saturation.low.to_string()),
            or_dash(channel.saturation.as_ref(), |saturation| saturation.high.to_string()),
            channel.outlier_count.to_string(),
        ]);
    }
    table.legend("lowest, highest: rows in which it rests at its smallest and at its largest value");
    text.table(table);
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
        "feedback",
        "p-value",
    ])
    .none("nothing stands out, or there are too few rows");
    for excitation in &inspection.excitation {
        let delay = inspection.delays.iter().find(|delay| delay.input == excitation.input);
        let feedback = inspection.feedback.iter().find(|feedback| feedback.input == excitation.input);
        table.row([
            name(&excitation.input),
            order(excitation),
            fixed(100.0 * excitation.changes, 1),
            or_dash(half_power(&excitation.spectrum), number),
            or_dash(delay.and_then(|delay| delay.nk), |nk| nk.to_string()),
            or_dash(delay.and_then(|delay| delay.confidence), |confidence| {
                // No rounding up to certainty.
                fixed((1e4 * confidence).floor() / 100.0, 2)
            }),
            or_dash(feedback.filter(|feedback| feedback.p_value.is_some()), |feedback| {
                (if feedback.found { "suspected" } else { "none seen" }).to_owned()
            }),
            or_dash(feedback.and_then(|feedback| feedback.p_value), chance),
        ]);
    }
    text.table(table);
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
