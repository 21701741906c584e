//! Settings of controllers as a table for people.

use crate::figures::{fixed, number, seconds, short};
use crate::present::Layout;
use crate::text::harmless;
use crate::tune::{ReducedProcess, Tuning};

use super::text::{Text, columns, or_dash};

/// The settings by each rule, and what the loops with them do.
pub fn tuning(found: &Tuning, layout: Layout) -> String {
    let mut text = Text::new(layout);
    text.line(&format!("{} from {} to {}", found.model, harmless(&found.input), harmless(&found.output)));
    text.line("C(s) = Kc (1 + 1/(Ti s) + Td s/(1 + Td s/10)), the derivative of the output");
    text.line("");
    let mut settings =
        columns(&["rule", "controller", "for the process", "closed loop [s]", "Kc", "Ti [s]", "Td [s]"])
            .words(&[2]);
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
    let mut loops =
        columns(&head).none("not reached, not crossed, or not stable at an end of the 95 % intervals");
    for own in &found.settings {
        let (rule, controller) = (own.rule.name().to_owned(), own.controller.name().to_owned());
        settings.row([
            rule.clone(),
            controller.clone(),
            process(&own.process),
            number(own.closed_loop_time),
            number(own.gain),
            number(own.integral_time),
            number(own.derivative_time),
        ]);
        let of = &own.closed_loop;
        let two = |value: f64| fixed(value, 2);
        loops.row([
            rule,
            controller,
            or_dash(of.rise_time, number),
            or_dash(of.overshoot, |value| fixed(100.0 * value, 1)),
            or_dash(of.settling_time, number),
            two(of.peak_sensitivity),
            or_dash(of.worst_peak_sensitivity, two),
            or_dash(of.gain_margin, two),
            or_dash(of.phase_margin, |value| fixed(value, 1)),
            or_dash(of.load_absolute_error, number),
        ]);
    }
    text.table(settings);
    loops.legend("steps of the set point, and of the load at the input, by 1; load error: the integral of its absolute value");
    loops.legend(
        "Ms: the peak of 1/|1 + L|, 1.2 to 2 is usual; worst: at the ends of the parameters' 95 % intervals",
    );
    text.table(loops);
    text.finish()
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
