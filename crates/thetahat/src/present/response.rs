//! Measured frequency responses.

use crate::data::Rows;
use crate::figures::{fixed, number, seconds, three};
use crate::model::LinearModel;
use crate::present::Layout;
use crate::spectrum::{Agreement, MeasuredResponse};
use crate::text::{brief, harmless};

use super::charts;
use super::data;
use super::html::Page;
use super::tree::{Medium, Sections, Table, columns, error, figure, word};
use super::words::some;

/// This many frequencies are shown of each input, and segments of rows.
const MOST: usize = 20;
const SEGMENTS: usize = 4;

/// How it was found, some of its points, and the warnings.
pub fn response(found: &MeasuredResponse, layout: Layout) -> String {
    let mut document = document(found, &[], Medium::Text);
    for warning in &found.warnings {
        document.line(format!("warning: {}", harmless(warning)));
    }
    super::text::written(&document, layout)
}

/// The page of a measured response: magnitude, phase and coherence from each input with their bands, models over them,
/// and the spectrum of the noise. `command` is shown as what made the page.
pub fn response_page(
    found: &MeasuredResponse,
    models: &[(String, &LinearModel<'_>)],
    command: &str,
) -> String {
    Page {
        title: format!("Response of {}{}", found.output, data::of(&found.logs)),
        warnings: &found.warnings,
        document: document(found, models, Medium::Page),
        command,
        generator: &found.generator,
    }
    .write()
}

fn document(found: &MeasuredResponse, models: &[(String, &LinearModel<'_>)], medium: Medium) -> Sections {
    let mut on = Sections::new(medium);
    let files: Vec<String> = found.logs.iter().map(|log| harmless(&log.file)).collect();
    let rows: usize = found.rows.iter().map(Rows::len).sum();
    let clock = if found.continuous {
        "sines in continuous time".to_owned()
    } else {
        format!("sample time {}", seconds(found.sample_time))
    };
    on.line(format!(
        "{}: {rows} rows ({}), {clock}",
        some(&files, SEGMENTS, ", "),
        some(&found.rows, SEGMENTS, ", "),
    ));
    let title = found.method.title();
    let mut first = title.chars();
    let title: String =
        first.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default() + first.as_str();
    on.line(format!("{title}: {} frequencies", found.noise.len()));
    on.gap();
    on.section("Response");
    for response in &found.responses {
        let input = response.input.as_deref().unwrap_or_default();
        if response.input.is_some() {
            on.chart(|| charts::measured(found, input, models));
        }
        let title = format!("from {} to {}", brief(input, 40), brief(&found.output, 40));
        if !on.is_page() {
            on.line(&title);
        }
        let head = [
            "frequency [rad/s]",
            "magnitude",
            "standard error",
            "phase [deg]",
            "standard error",
            "coherence",
            "noise",
        ];
        let mut table = columns(title, head).none("the method does not tell");
        let count = response.points.len();
        let shown = count.min(MOST);
        for k in 0..shown {
            // Evenly among all, both ends included.
            let point = &response.points[if shown > 1 { k * (count - 1) / (shown - 1) } else { 0 }];
            let noise = found.noise.iter().find(|noise| noise.frequency == point.frequency);
            table.row([
                word(number(point.frequency)),
                figure(point.magnitude.value, number),
                error(point.magnitude.standard_error),
                figure(point.phase.value.to_degrees(), |turn| fixed(turn, 2)),
                error(point.phase.standard_error.map(f64::to_degrees)),
                figure(noise.and_then(|noise| noise.coherence), three),
                error(noise.and_then(|noise| noise.density)),
            ]);
        }
        if shown < count {
            let formats = if on.is_page() { "" } else { " (`format`)" };
            table.legend(format!("{shown} of {count} frequencies; CSV and JSON have all of them{formats}"));
        }
        on.table(table);
    }
    let bands = &found.bands;
    on.line(match bands.honest {
        Some(true) => format!("95 % bands: honest ({})", bands.reason),
        Some(false) => format!("95 % bands: not honest ({})", bands.reason),
        None => format!("95 % bands: not known to be honest, or none ({})", bands.reason),
    });
    if !models.is_empty() {
        on.table(agreements(found, models));
    }
    on.section("Noise");
    on.chart(|| charts::measured_noise(found));
    if on.is_page() {
        on.section("Data");
        on.table(data::logs(&found.logs));
    }
    on
}

/// How models agree with what was measured.
fn agreements(found: &MeasuredResponse, models: &[(String, &LinearModel<'_>)]) -> Table {
    let caption = "Models and measured points: how many lie outside of the 95 % region of their difference, by chance 5 %";
    let mut table = columns(caption, ["model", "input", "points", "outside", "outside [%]"]).words(&[1]);
    for (name, model) in models {
        // What cannot be compared the chart says.
        for Agreement { input, points, outside, .. } in found.agreement(model).unwrap_or_default() {
            let share = 100.0 * outside as f64 / points.max(1) as f64;
            table.row([
                word(name),
                word(input),
                word(points),
                word(outside),
                figure(share, |share| fixed(share, 1)),
            ]);
        }
    }
    table
}
