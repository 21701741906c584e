//! What an inspection says.

use super::yes;
use crate::figures::{chance, number, seconds, short, three};
use crate::inspect::Inspection;
use crate::present::pages::page::Table;
use crate::present::pages::text::{or_dash, percent};

/// Fewer channels than this stand beside each other, more below each other.
const BESIDE: usize = 5;

pub(in crate::present::pages) fn clock(inspection: &Inspection) -> Table {
    let clock = &inspection.clock;
    let mut table = Table::new("Clock", &["figure", "value"]);
    let mut add = |name: &str, value: String| table.row([name.to_owned(), value]);
    add("rows", inspection.rows.to_string());
    let source = if clock.measured { "" } else { " (the log has no times)" };
    add("median step", format!("{}{source}", seconds(clock.sample_time)));
    add("shortest and longest step", format!("{}, {}", seconds(clock.steps.0), seconds(clock.steps.1)));
    add("jitter", percent(clock.jitter));
    add("gaps", clock.gaps.to_string());
    add("has to be resampled", yes(clock.irregular));
    table
}

pub(in crate::present::pages) fn channels(inspection: &Inspection) -> Table {
    let head = [
        "channel",
        "role",
        "missing",
        "smallest",
        "largest",
        "mean",
        "standard deviation",
        "trend [1/s]",
        "trend's share",
        "repeated",
        "longest hold",
        "quantization",
        "at the smallest, largest",
        "outliers",
    ];
    let mut table = Table::new("Quality", &head);
    for channel in &inspection.channels {
        let outliers = match (channel.outlier_count, channel.outliers.as_slice()) {
            (0, _) => "0".to_owned(),
            (count, rows) => {
                let shown: Vec<String> = rows.iter().take(3).map(usize::to_string).collect();
                let more = if shown.len() < count { ", …" } else { "" };
                format!("{count} (rows {}{more})", shown.join(", "))
            }
        };
        table.row([
            channel.name.clone(),
            channel.role.clone().unwrap_or_default(),
            channel.missing.to_string(),
            or_dash(channel.minimum, number),
            or_dash(channel.maximum, number),
            or_dash(channel.mean, number),
            or_dash(channel.standard_deviation, number),
            or_dash(channel.trend, three),
            or_dash(channel.trend_share, percent),
            channel.repeated.to_string(),
            channel.longest_hold.to_string(),
            channel.quantization.map_or_else(|| "none".to_owned(), short),
            channel
                .saturation
                .as_ref()
                .map_or_else(|| "no".to_owned(), |rests| format!("{}, {}", rests.low, rests.high)),
            outliers,
        ]);
    }
    if inspection.channels.len() < BESIDE { table.turned() } else { table }
}

pub(in crate::present::pages) fn excitation(inspection: &Inspection) -> Table {
    let alike = inspection.excitation.iter().any(|input| input.same_as.is_some());
    let head = ["input", "persistently exciting of order", "changes at", "the same but for scale and offset"];
    let mut table = Table::new("Excitation", if alike { &head } else { &head[..3] });
    for input in &inspection.excitation {
        let most = if input.order == input.highest { " or more" } else { "" };
        let mut cells = vec![
            input.input.clone(),
            format!("{}{most}", input.order),
            format!("{} of samples", percent(input.changes)),
        ];
        if alike {
            cells.push(input.same_as.clone().unwrap_or_default());
        }
        table.row(cells);
    }
    table
}

/// Delays and feedback.
pub(in crate::present::pages) fn delays(inspection: &Inspection) -> Table {
    let mut table =
        Table::new("Delay and feedback", &["input", "delay [samples]", "confidence", "feedback", "p-value"]);
    for delay in &inspection.delays {
        let feedback = inspection.feedback.iter().find(|feedback| feedback.input == delay.input);
        table.row([
            delay.input.clone(),
            delay.nk.map_or_else(|| "none found".to_owned(), |nk| nk.to_string()),
            or_dash(delay.confidence, confidence),
            or_dash(feedback, |feedback| yes(feedback.found)),
            or_dash(feedback.and_then(|feedback| feedback.p_value), chance),
        ]);
    }
    table
}

/// Nothing is as sure as all digits rounded up would have it.
fn confidence(fraction: f64) -> String {
    if fraction > 0.9994 { "> 99.9 %".to_owned() } else { percent(fraction) }
}
