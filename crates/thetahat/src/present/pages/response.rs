//! The page of a measured response.

use super::page::{Page, Section, Table};
use super::{charts, of, tables};
use crate::data::Rows;
use crate::figures::{fixed, seconds};
use crate::model::LinearModel;
use crate::spectrum::{Agreement, MeasuredResponse};

/// The page of a measured response: magnitude, phase and coherence from each input with their bands, models over them,
/// and the spectrum of the noise. `command` is shown as what made the page.
pub fn response_page(
    found: &MeasuredResponse,
    models: &[(String, &LinearModel<'_>)],
    command: &str,
) -> String {
    let title = format!("Response of {}{}", found.output, of(&found.logs));
    let mut page = Page::new(title, command, &found.generator);
    let rows: usize = found.rows.iter().map(Rows::len).sum();
    page.lead = vec![format!(
        "By {}, from {rows} rows of {}, at {} frequencies.",
        match found.method.title() {
            title if title.starts_with("local") => format!("the {title}"),
            title => title,
        },
        seconds(found.sample_time),
        found.noise.len()
    )];
    page.lead.push(match found.bands.honest {
        Some(true) => format!("The 95 % bands are honest: {}.", found.bands.reason),
        Some(false) => format!("The 95 % bands are not honest: {}.", found.bands.reason),
        None => {
            format!("There are no bands, or it is not known whether they are honest: {}.", found.bands.reason)
        }
    });
    page.warnings = &found.warnings;
    let mut section = Section::new("Response");
    for input in found.responses.iter().filter_map(|response| response.input.as_deref()) {
        section.chart(charts::measured(found, input, models));
    }
    if !models.is_empty() {
        section.table(agreements(found, models));
    }
    page.sections.push(section);
    let mut section = Section::new("Noise");
    section.chart(charts::measured_noise(found));
    page.sections.push(section);
    let mut section = Section::new("Data");
    section.table(tables::logs(&found.logs));
    page.sections.push(section);
    page.write()
}

/// How models agree with what was measured.
fn agreements(found: &MeasuredResponse, models: &[(String, &LinearModel<'_>)]) -> Table {
    let caption = "Models and measured points: how many lie outside of the 95 % region of their difference, by chance 5 %";
    let mut table = Table::new(caption, &["model", "input", "points", "outside", "outside [%]"]);
    for (name, model) in models {
        // What cannot be compared the chart says.
        for Agreement { input, points, outside, .. } in found.agreement(model).unwrap_or_default() {
            let share = 100.0 * outside as f64 / points.max(1) as f64;
            table.row([name.clone(), input, points.to_string(), outside.to_string(), fixed(share, 1)]);
        }
    }
    table
}
