//! What `track` says at its end.

use thetahat::Tracker;

use super::formula;
use super::text::{Text, columns, number, or_dash, short, uncertainty};

/// How the policies did, and where each has come to.
pub(crate) fn tracking(trackers: &[Tracker], alarms: &[u64], counts: &str) -> String {
    let mut text = Text::default();
    if let Some(tracker) = trackers.first() {
        text.line(&formula(tracker.orders()));
    }
    text.line(counts);
    if let Some(tracker) = trackers.first() {
        let offsets = tracker.offsets();
        let all: Vec<f64> = offsets.inputs.iter().chain([&offsets.output]).copied().collect();
        if all.iter().any(|&offset| offset != 0.0) {
            let shown: Vec<String> = all.iter().map(|&offset| short(offset)).collect();
            text.line(&format!("offsets of the inputs and the output: {}", shown.join(", ")));
        }
    }
    text.line("");
    let watched = trackers.iter().any(|tracker| tracker.detector().is_some());
    let mut titles = vec!["forgetting", "predicted", "mse", "fit [%]", "mean nis", "log-likelihood"];
    titles.extend(watched.then_some("alarms"));
    let mut scores = columns(&titles);
    for (tracker, alarms) in trackers.iter().zip(alarms) {
        let score = tracker.score();
        let mut row = vec![
            tracker.plan().forgetting.to_string(),
            score.samples().to_string(),
            or_dash(score.mean_squared_error(), number),
            or_dash(score.fit(), |fit| format!("{fit:.2}")),
            or_dash(score.mean_nis(), |nis| format!("{nis:.3}")),
            or_dash(score.log_likelihood(), |sum| format!("{sum:.2}")),
        ];
        row.extend(watched.then(|| alarms.to_string()));
        scores.add_row(row);
    }
    text.table(scores, &[1, 2, 3, 4, 5, 6][..titles.len() - 1]);
    for tracker in trackers {
        let Some(parameters) = tracker.parameters() else {
            text.line("no estimate yet: there were too few samples, or a channel that never left zero");
            continue;
        };
        if trackers.len() > 1 {
            text.line(&tracker.plan().forgetting.to_string());
        }
        let mut deviations = vec![f64::NAN; parameters.len()];
        // There is one place for each.
        let _ = tracker.write_standard_errors(&mut deviations);
        let mut table = columns(&["parameter", "value", "standard error"]);
        for ((name, &value), &deviation) in tracker.names().iter().zip(parameters).zip(&deviations) {
            let known = Some(deviation).filter(|deviation| deviation.is_finite());
            table.add_row([name.clone(), number(value), or_dash(known, uncertainty)]);
        }
        text.table(table, &[1, 2]);
        text.line(&format!("noise variance {}", or_dash(tracker.noise_variance(), short)));
        text.line("");
    }
    text.finish()
}
