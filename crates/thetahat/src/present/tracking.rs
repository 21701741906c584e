//! What `track` says at its end.

use crate::figures::{fixed, number, short};
use crate::present::Layout;
use crate::track::{TrackSummary, TrackerSummary};

use super::kinds::parameters;
use super::tree::{Medium, Sections, columns, figure, word};
use super::words::{formula, or_dash, some};

/// This many of a list are written.
const MOST: usize = 8;

/// How the ways to forget did, and where each has come to.
pub fn tracking(summary: &TrackSummary, faults: &str, watched: bool, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let gaps = match summary.gaps {
        0 => String::new(),
        1 => ", 1 gap".to_owned(),
        count => format!(", {count} gaps"),
    };
    if let Some(tracker) = summary.trackers.first() {
        match &tracker.map {
            None if tracker.coupled.is_some() => {
                on.line(format!(
                    "{}, with the past of all outputs in the equation of each",
                    formula(&tracker.orders)
                ));
            }
            None => on.line(formula(&tracker.orders)),
            Some(map) => on.line(map.name(map.parameters(tracker.orders.parameters()))),
        }
        on.line(format!("{} rows{faults}{gaps}", summary.rows));
        // The outputs are the last ones, each of its tracker.
        let (_, inputs) = tracker.offsets.split_last().unwrap_or((&0.0, &[]));
        let alike = |other: &&TrackerSummary| other.forgetting == tracker.forgetting;
        let outputs: Vec<&f64> =
            summary.trackers.iter().filter(alike).filter_map(|tracker| tracker.offsets.last()).collect();
        let several = if outputs.len() > 1 { "outputs" } else { "output" };
        let offsets: Vec<f64> = inputs.iter().chain(outputs).copied().collect();
        if offsets.iter().any(|&offset| offset != 0.0) {
            let shown: Vec<String> = offsets.into_iter().map(short).collect();
            on.line(format!("offsets of the inputs and the {several}: {}", some(&shown, MOST, ", ")));
        }
    }
    let has_outputs = summary.trackers.iter().any(|tracker| tracker.output.is_some());
    on.gap();
    let titles =
        ["forgetting", "output", "predicted", "mse", "fit [%]", "mean nis", "log-likelihood", "alarms"];
    let mut scores = columns("Scores", titles)
        .none("no row was predicted, or a sum of squares overflows")
        .without(if has_outputs { &[] } else { &[1] })
        .without(if watched { &[] } else { &[7] });
    for tracker in &summary.trackers {
        scores.row([
            word(&tracker.forgetting),
            word(tracker.output.clone().unwrap_or_default()),
            word(tracker.samples),
            figure(tracker.mean_squared_error, number),
            figure(tracker.fit, |fit| fixed(fit, 2)),
            figure(tracker.mean_nis, |nis| fixed(nis, 3)),
            figure(tracker.log_likelihood, |sum| fixed(sum, 2)),
            word(tracker.alarms),
        ]);
    }
    on.table(scores);
    for tracker in &summary.trackers {
        match &tracker.output {
            Some(output) => on.line(format!("{output}, {}", tracker.forgetting)),
            None if summary.trackers.len() > 1 => on.line(&tracker.forgetting),
            None => {}
        }
        if tracker.parameters.is_empty() {
            on.line("no estimate yet: there were too few samples, or a channel that never left zero");
            continue;
        }
        on.table(parameters(&tracker.parameters));
        on.line(format!("noise variance {}", or_dash(tracker.noise_variance, short)));
        on.gap();
    }
    super::text::written(on, layout)
}
