//! The page of settings.

use super::charts;
use super::page::{Page, Section, Table};
use super::text::or_dash;
use crate::figures::{fixed, number};
use crate::tune::Tuning;

/// The page of settings of controllers: the closed loops side by side, and their figures. `command` is shown as what
/// made the page.
pub fn tuning_page(found: &Tuning, command: &str) -> String {
    let title = format!("Controllers from {} to {}", found.input, found.output);
    let mut page = Page::new(title, command, &found.generator);
    page.lead = vec![format!("{}.", found.model)];
    page.warnings = &found.warnings;
    let mut section = Section::new("Settings");
    let mut table = Table::new(
        "C(s) = Kc (1 + 1/(Ti s) + Td s/(1 + Td s/10))",
        &["rule", "controller", "closed-loop time [s]", "Kc", "Ti [s]", "Td [s]"],
    );
    for own in &found.settings {
        table.row([
            own.rule.name().to_owned(),
            own.controller.name().to_owned(),
            number(own.closed_loop_time),
            number(own.gain),
            number(own.integral_time),
            number(own.derivative_time),
        ]);
    }
    section.table(table);
    page.sections.push(section);
    let mut section = Section::new("Closed loop");
    for drawn in charts::closed_loops(found) {
        section.chart(drawn);
    }
    let head = [
        "rule",
        "controller",
        "rise time [s]",
        "overshoot [%]",
        "settling time [s]",
        "Ms",
        "worst Ms",
        "gain margin",
        "phase margin [°]",
        "load error",
    ];
    let mut table = Table::new("Figures", &head);
    for own in &found.settings {
        let of = &own.closed_loop;
        table.row([
            own.rule.name().to_owned(),
            own.controller.name().to_owned(),
            or_dash(of.rise_time, number),
            or_dash(of.overshoot, |value| fixed(100.0 * value, 1)),
            or_dash(of.settling_time, number),
            fixed(of.peak_sensitivity, 2),
            or_dash(of.worst_peak_sensitivity, |value| fixed(value, 2)),
            or_dash(of.gain_margin, |value| fixed(value, 2)),
            or_dash(of.phase_margin, |value| fixed(value, 1)),
            or_dash(of.load_absolute_error, number),
        ]);
    }
    section.table(table);
    page.sections.push(section);
    page.write()
}
