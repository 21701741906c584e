//! What `track` says at its end.

use crate::figures::{error, fixed, number, short};
use crate::present::Layout;
use crate::track::{TrackSummary, TrackerSummary};

use super::text::{Text, columns, or_dash, some};
use super::{MOST, NO_ERROR, formula};

/// How the ways to forget did, and where each has come to.
pub fn tracking(summary: &TrackSummary, faults: &str, watched: bool, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let gaps = match summary.gaps {
        0 => String::new(),
        1 => ", 1 gap".to_owned(),
        count => format!(", {count} gaps"),
    };
    if let Some(tracker) = summary.trackers.first() {
        match &tracker.map {
            None if tracker.coupled.is_some() => {
                text.line(&format!(
                    "{}, with the past of all outputs in the equation of each",
                    formula(&tracker.orders)
                ));
            }
            None => text.line(&formula(&tracker.orders)),
            Some(map) => text.line(&map.name(map.parameters(tracker.orders.parameters()))),
        }
        text.line(&format!("{} rows{faults}{gaps}", summary.rows));
        // The outputs are the last ones, each of its tracker.
        let (_, inputs) = tracker.offsets.split_last().unwrap_or((&0.0, &[]));
        let alike = |other: &&TrackerSummary| other.forgetting == tracker.forgetting;
        let outputs: Vec<&f64> =
            summary.trackers.iter().filter(alike).filter_map(|tracker| tracker.offsets.last()).collect();
        let several = if outputs.len() > 1 { "outputs" } else { "output" };
        let offsets: Vec<f64> = inputs.iter().chain(outputs).copied().collect();
        if offsets.iter().any(|&offset| offset != 0.0) {
            let shown: Vec<String> = offsets.into_iter().map(short).collect();
            text.line(&format!("offsets of the inputs and the {several}: {}", some(&shown, MOST, ", ")));
        }
    }
    let has_outputs = summary.trackers.iter().any(|tracker| tracker.output.is_some());
    text.line("");
    let mut titles = vec!["forgetting"];
    titles.extend(has_outputs.then_some("output"));
    titles.extend(["predicted", "mse", "fit [%]", "mean nis", "log-likelihood"]);
    titles.extend(watched.then_some("alarms"));
    let mut scores = columns(&titles).none("no row was predicted, or a sum of squares overflows");
    for tracker in &summary.trackers {
        let mut row = vec![tracker.forgetting.clone()];
        row.extend(tracker.output.clone());
        row.extend([
            tracker.samples.to_string(),
            or_dash(tracker.mean_squared_error, number),
            or_dash(tracker.fit, |fit| fixed(fit, 2)),
            or_dash(tracker.mean_nis, |nis| fixed(nis, 3)),
            or_dash(tracker.log_likelihood, |sum| fixed(sum, 2)),
        ]);
        row.extend(watched.then(|| tracker.alarms.to_string()));
        scores.row(row);
    }
    text.table(scores);
    for tracker in &summary.trackers {
        match &tracker.output {
            Some(output) => text.line(&format!("{output}, {}", tracker.forgetting)),
            None if summary.trackers.len() > 1 => text.line(&tracker.forgetting),
            None => {}
        }
        if tracker.parameters.is_empty() {
            text.line("no estimate yet: there were too few samples, or a channel that never left zero");
            continue;
        }
        let mut table = columns(&["parameter", "value", "standard error"]).none(NO_ERROR);
        for parameter in &tracker.parameters {
            let error = or_dash(parameter.standard_error, error);
            table.row([parameter.name.clone(), number(parameter.value), error]);
        }
        text.table(table);
        text.line(&format!("noise variance {}", or_dash(tracker.noise_variance, short)));
        text.line("");
    }
    text.finish()
}
