//! Inspections: checks of a log before a fit.

use crate::data::{Finding, FindingKind};
use crate::figures::{chance, fixed, number, seconds, short, three};
use crate::inspect::{ChannelQuality, Excitation, Inspection, SpectrumPoint};
use crate::present::Layout;
use crate::text::{brief, harmless};

use super::charts::{self, Stack};
use super::data;
use super::html::Page;
use super::outputs::points;
use super::tree::{Cell, Medium, Sections, columns, figure, known, word, written};

/// This many channels, and warnings, are shown of very many: in a text, and on a page.
const MOST: usize = 10;
const MOST_ON_PAGES: usize = 16;

/// What was found, the warnings, and the line that would fit a model.
pub fn inspection(inspection: &Inspection, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let brief = inspection.brief(MOST);
    on.line(clock(inspection));
    on.gap();
    channels(on, inspection, &brief);
    inputs(on, &brief);
    for warning in brief.warnings() {
        on.line(format!("warning: {}", harmless(&warning)));
    }
    if !brief.findings.is_empty() {
        on.gap();
    }
    more(on, inspection.findings.len(), brief.findings.len(), "warnings");
    if let Some(command) = &inspection.command {
        on.command(command);
    }
    super::text::written(on, layout)
}

/// The page of an inspection: the checks of a log before a fit.
///
/// `signals` are the channels with their names, one value for each row; `time` is in seconds, one value for each row.
pub fn inspection_page(
    inspection: &Inspection,
    signals: &[(String, Vec<f64>)],
    time: &[f64],
    command: &str,
) -> String {
    let mut on = Sections::new(Medium::Page);
    let brief = inspection.brief(MOST_ON_PAGES);
    on.line(clock(inspection));
    on.section("Channels");
    signals_over_time(&mut on, &brief, inspection.channels.len(), signals, time);
    channels(&mut on, inspection, &brief);
    more(&mut on, inspection.findings.len(), brief.findings.len(), "warnings");
    inputs(&mut on, &brief);
    if let Some(suggested) = &inspection.command {
        on.section("Suggested fit");
        on.command(suggested);
    }
    on.section("Data");
    on.table(data::logs(std::slice::from_ref(&inspection.log)));
    Page {
        title: format!("Inspection{}", data::of(std::slice::from_ref(&inspection.log))),
        warnings: &brief.warnings(),
        document: on,
        command,
        generator: &inspection.generator,
    }
    .write()
}

/// The channels, and where findings are, above each other.
fn signals_over_time(
    on: &mut Sections,
    inspection: &Inspection,
    all: usize,
    signals: &[(String, Vec<f64>)],
    time: &[f64],
) {
    let shown = |name: &str| inspection.channels.iter().any(|channel| channel.name == name);
    let is_whole = all == inspection.channels.len();
    let signals: Vec<_> = signals.iter().filter(|(name, _)| is_whole || shown(name)).collect();
    // Steps of a clock without a rhythm are no gaps.
    let step = if inspection.clock.irregular { f64::INFINITY } else { inspection.clock.sample_time };
    let dated = || Stack::new(time, step, points(signals.len())).dated(std::slice::from_ref(&inspection.log));
    let mut stack = dated();
    let mut named: Vec<&str> = Vec::new();
    let marked = inspection.findings.iter().any(|finding| place(finding).is_some());
    let circles = if marked { " Circles: where findings are, the first of each channel." } else { "" };
    let words = &format!("One time axis: zooming one zooms all.{circles}");
    for (position, (name, values)) in signals.iter().enumerate() {
        if stack.is_full() {
            let full = std::mem::replace(&mut stack, dated());
            on.chart(|| full.draw("Channels over time", words, &[]));
            named.clear();
        }
        stack.alone(name, values, position);
        for finding in inspection.findings.iter().filter(|finding| finding.channels.contains(name)) {
            let Some(what) = place(finding) else { continue };
            stack.marks(what, &finding.rows, values, !named.contains(&what));
            named.push(what);
        }
    }
    if !stack.is_empty() {
        on.chart(|| stack.draw("Channels over time", words, &[]));
    }
}

/// What a picture of a channel calls a finding that it can show.
fn place(finding: &Finding) -> Option<&'static str> {
    match finding.kind {
        FindingKind::Outliers => Some("outliers"),
        FindingKind::Stuck => Some("stuck"),
        FindingKind::Saturation => Some("at its limit"),
        _ => None,
    }
}

/// Says what is not shown.
fn more(on: &mut Sections, all: usize, shown: usize, what: &str) {
    if shown < all {
        on.line(format!("and {} more {what}, which the JSON document has", all - shown));
        on.gap();
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

/// A name as there is room for it.
fn name(on: &Sections, name: &str) -> Cell {
    word(if on.is_page() { name.to_owned() } else { brief(name, 24) })
}

/// A share in percent.
fn share(share: impl Into<Option<f64>>) -> Cell {
    written(share, [|share| fixed(100.0 * share, 1), |share| three(100.0 * share)])
}

/// The values and the quality of the channels that matter most.
fn channels(on: &mut Sections, inspection: &Inspection, brief: &Inspection) {
    let head = ["channel", "role", "minimum", "maximum", "mean", "deviation", "trend [1/s]", "[%]"];
    let mut values = columns("Values", head).words(&[1]).none("there is no value, or all are the same");
    let head = [
        "channel",
        "missing",
        "repeated",
        "longest hold",
        "rounded to",
        "lowest",
        "highest",
        "outliers",
        "the first in rows",
    ];
    let mut quality = columns("Quality", head)
        .words(&[8])
        .none("it is not rounded, and does not rest at a limit")
        .on_pages(&[8]);
    for channel in &brief.channels {
        let ChannelQuality { minimum, maximum, mean, standard_deviation, trend, .. } = channel;
        let numbers = [minimum, maximum, mean, standard_deviation, trend];
        let own = [name(on, &channel.name), word(channel.role.clone().unwrap_or_default())];
        let share = share(channel.trend_share);
        let numbers = numbers.map(|value| figure(*value, number));
        values.row(own.into_iter().chain(numbers).chain([share]));
        let rows: Vec<String> = channel.outliers.iter().take(3).map(usize::to_string).collect();
        quality.row([
            name(on, &channel.name),
            word(channel.missing),
            word(channel.repeated),
            word(channel.longest_hold),
            figure(channel.quantization, short),
            known(channel.saturation.as_ref(), |saturation| saturation.low.to_string()),
            known(channel.saturation.as_ref(), |saturation| saturation.high.to_string()),
            word(channel.outlier_count),
            word(rows.join(", ")),
        ]);
    }
    values
        .legend("trend: the slope of the best straight line, and the part of the variance that it explains");
    on.table(values);
    quality.legend("lowest, highest: rows in which it rests at its smallest and at its largest value");
    on.table(quality);
    more(on, inspection.channels.len(), brief.channels.len(), "channels");
}

/// What the inputs excite, and how the output follows.
fn inputs(on: &mut Sections, inspection: &Inspection) {
    if inspection.excitation.is_empty() {
        return;
    }
    on.section("Excitation, delay and feedback");
    on.chart(|| charts::spectrum(&inspection.excitation));
    for delay in &inspection.delays {
        on.chart(|| charts::prewhitened(delay));
        if let Some(response) = charts::impulse_response(delay) {
            on.chart(|| response);
        }
    }
    let head = [
        "input",
        "excites order",
        "changes [%]",
        "half its power below [rad/s]",
        "delay [rows]",
        "confidence [%]",
        "feedback",
        "p-value",
        "the same but for scale and offset",
    ];
    let mut table = columns("Inputs", head).words(&[8]).none("nothing stands out, or there are too few rows");
    let is_alike = inspection.excitation.iter().any(|input| input.same_as.is_some());
    table = if is_alike { table.on_pages(&[8]) } else { table.without(&[8]) };
    for excitation in &inspection.excitation {
        let delay = inspection.delays.iter().find(|delay| delay.input == excitation.input);
        let feedback = inspection.feedback.iter().find(|feedback| feedback.input == excitation.input);
        table.row([
            name(on, &excitation.input),
            word(order(excitation)),
            share(excitation.changes),
            figure(half_power(&excitation.spectrum), number),
            known(delay.and_then(|delay| delay.nk), |nk| nk.to_string()),
            // No rounding up to certainty.
            figure(delay.and_then(|delay| delay.confidence), |share| fixed((1e4 * share).floor() / 100.0, 2)),
            known(feedback.filter(|feedback| feedback.p_value.is_some()), |feedback| {
                (if feedback.found { "suspected" } else { "none seen" }).to_owned()
            }),
            figure(feedback.and_then(|feedback| feedback.p_value), chance),
            word(excitation.same_as.clone().unwrap_or_default()),
        ]);
    }
    on.table(table);
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
