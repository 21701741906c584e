//! A measured response as a table for people.

use crate::data::Rows;
use crate::figures::{error, fixed, number, seconds, three};
use crate::present::Layout;
use crate::spectrum::MeasuredResponse;
use crate::text::{brief, harmless};

use super::text::{Text, columns, or_dash, some};

/// This many frequencies are shown of each input, and segments of rows.
const MOST: usize = 20;
const SEGMENTS: usize = 4;

/// How it was found, some of its points, and the warnings.
pub fn response(found: &MeasuredResponse, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let files: Vec<String> = found.logs.iter().map(|log| harmless(&log.file)).collect();
    let rows: usize = found.rows.iter().map(Rows::len).sum();
    text.line(&format!(
        "{}: {rows} rows ({}), sample time {}",
        some(&files, SEGMENTS, ", "),
        some(&found.rows, SEGMENTS, ", "),
        seconds(found.sample_time)
    ));
    let title = found.method.title();
    let mut first = title.chars();
    let title: String =
        first.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default() + first.as_str();
    text.line(&format!("{title}: {} frequencies", found.noise.len()));
    text.line("");
    for response in &found.responses {
        let input = response.input.as_deref().unwrap_or_default();
        let mut table = columns(&[
            "frequency [rad/s]",
            "magnitude",
            "standard error",
            "phase [deg]",
            "standard error",
            "coherence",
            "noise",
        ])
        .none("the method does not tell");
        let count = response.points.len();
        let shown = count.min(MOST);
        for k in 0..shown {
            // Evenly among all, both ends included.
            let point = &response.points[if shown > 1 { k * (count - 1) / (shown - 1) } else { 0 }];
            let noise = found.noise.iter().find(|noise| noise.frequency == point.frequency);
            table.row([
                number(point.frequency),
                number(point.magnitude.value),
                or_dash(point.magnitude.standard_error, error),
                fixed(point.phase.value.to_degrees(), 2),
                or_dash(point.phase.standard_error, |turn| error(turn.to_degrees())),
                or_dash(noise.and_then(|noise| noise.coherence), three),
                or_dash(noise.and_then(|noise| noise.density), error),
            ]);
        }
        if shown < count {
            table.legend(format!("{shown} of {count} frequencies; CSV and JSON have all of them (`format`)"));
        }
        text.line(&format!("from {} to {}", brief(input, 40), brief(&found.output, 40)));
        text.table(table);
    }
    let bands = &found.bands;
    text.line(&match bands.honest {
        Some(true) => format!("95 % bands: honest ({})", bands.reason),
        Some(false) => format!("95 % bands: not honest ({})", bands.reason),
        None => format!("95 % bands: not known to be honest, or none ({})", bands.reason),
    });
    for warning in &found.warnings {
        text.line(&format!("warning: {}", harmless(warning)));
    }
    text.finish()
}
