//! Settings of controllers.

use crate::figures::{fixed, number, seconds, short};
use crate::present::Layout;
use crate::text::harmless;
use crate::tune::{ReducedProcess, Tuning};

use super::charts;
use super::html::Page;
use super::tree::{Medium, Sections, columns, figure, word};

/// The settings by each rule, and what the loops with them do.
pub fn tuning(found: &Tuning, layout: Layout) -> String {
    super::text::written(&document(found, Medium::Text), layout)
}

/// The page of settings of controllers: the closed loops side by side, and their figures. `command` is shown as what
/// made the page.
pub fn tuning_page(found: &Tuning, command: &str) -> String {
    Page {
        title: format!("Controllers from {} to {}", found.input, found.output),
        warnings: &found.warnings,
        document: document(found, Medium::Page),
        command,
        generator: &found.generator,
    }
    .write()
}

fn document(found: &Tuning, medium: Medium) -> Sections {
    let mut on = Sections::new(medium);
    on.line(format!("{} from {} to {}", found.model, harmless(&found.input), harmless(&found.output)));
    on.line("C(s) = Kc (1 + 1/(Ti s) + Td s/(1 + Td s/10)), the derivative of the output");
    on.gap();
    on.section("Settings");
    let head = ["rule", "controller", "for the process", "closed loop [s]", "Kc", "Ti [s]", "Td [s]"];
    let mut settings = columns("Settings", head).words(&[2]);
    for own in &found.settings {
        let figures = [own.closed_loop_time, own.gain, own.integral_time, own.derivative_time];
        let words = [word(own.rule.name()), word(own.controller.name()), word(process(&own.process))];
        settings.row(words.into_iter().chain(figures.map(|value| figure(value, number))));
    }
    on.table(settings);
    on.section("Closed loop");
    if on.is_page() {
        charts::closed_loops(found).into_iter().for_each(|drawn| on.chart(|| drawn));
    }
    let head = [
        "rule",
        "controller",
        "rise [s]",
        "overshoot [%]",
        "settling [s]",
        "Ms",
        "worst Ms",
        "gain margin",
        "phase margin",
        "load error",
    ];
    let mut loops = columns("Figures", head)
        .none("not reached, not crossed, or not stable at an end of the 95 % intervals");
    for own in &found.settings {
        let of = &own.closed_loop;
        let two: fn(f64) -> String = |value| fixed(value, 2);
        loops.row([
            word(own.rule.name()),
            word(own.controller.name()),
            figure(of.rise_time, number),
            figure(of.overshoot, |value| fixed(100.0 * value, 1)),
            figure(of.settling_time, number),
            figure(of.peak_sensitivity, two),
            figure(of.worst_peak_sensitivity, two),
            figure(of.gain_margin, two),
            figure(of.phase_margin, |value| fixed(value, 1)),
            figure(of.load_absolute_error, number),
        ]);
    }
    loops.legend("steps of the set point, and of the load at the input, by 1; load error: the integral of its absolute value");
    loops.legend(
        "Ms: the peak of 1/|1 + L|, 1.2 to 2 is usual; worst: at the ends of the parameters' 95 % intervals",
    );
    on.table(loops);
    on
}

fn process(seen: &ReducedProcess) -> String {
    let mut words = format!("K {}", short(seen.gain));
    match seen.time_constant {
        Some(tau) => words += &format!(", tau1 {}", seconds(tau)),
        None => words += ", integrating",
    }
    if seen.second_time_constant > 0.0 {
        words += &format!(", tau2 {}", seconds(seen.second_time_constant));
    }
    words + &format!(", theta {}", seconds(seen.dead_time))
}
