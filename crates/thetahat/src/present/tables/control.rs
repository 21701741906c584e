//! A controller as a table for people.

use crate::control::Control;
use crate::figures::{fixed, number};
use crate::present::Layout;
use crate::text::harmless;

use super::text::{Text, columns, or_dash};

/// The coefficients and what the loop does.
pub fn control(found: &Control, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let (input, output) = (harmless(&found.input.name), harmless(&found.output.name));
    text.line(&format!("{} from {input} to {output}: {}", found.model, found.design));
    text.line("R(q) u = T(q) u_c - S(q) y, every sample, in deviations from the working point");
    text.line("");
    let own = &found.controller;
    let longest = [&own.r, &own.s, &own.t].into_iter().map(Vec::len).max().unwrap_or(0);
    let mut coefficients = columns(&["power of q^-1", "R", "S", "T"]);
    for place in 0..longest {
        let at = |values: &[f64]| number(values.get(place).copied().unwrap_or(0.0));
        coefficients.row([place.to_string(), at(&own.r), at(&own.s), at(&own.t)]);
    }
    text.table(coefficients);
    if let Some(feedback) = &found.state_feedback {
        let each: Vec<String> = feedback.iter().map(|gain| number(*gain)).collect();
        text.line(&format!("state feedback in the controllable form: {}", each.join(", ")));
        text.line("");
    }
    let of = &found.closed_loop;
    let mut poles = columns(&["pole of the loop", "modulus"]);
    for pole in &of.poles {
        let written = match pole.im {
            0.0 => number(pole.re),
            im => format!("{} {} {}i", number(pole.re), if im > 0.0 { "+" } else { "-" }, number(im.abs())),
        };
        poles.row([written, number(pole.re.hypot(pole.im))]);
    }
    text.table(poles);
    let head = [
        "rise [s]",
        "overshoot [%]",
        "settling [s]",
        "Ms",
        "Mt",
        "gain margin",
        "phase margin",
        "dev. of output",
        "dev. of input",
    ];
    let mut loops = columns(&head).none("not reached, not crossed, or nothing said of the noise");
    let two = |value: f64| fixed(value, 2);
    loops.row([
        or_dash(of.rise_time, number),
        or_dash(of.overshoot, |value| fixed(100.0 * value, 1)),
        or_dash(of.settling_time, number),
        two(of.peak_sensitivity),
        two(of.peak_complementary_sensitivity),
        or_dash(of.gain_margin, two),
        or_dash(of.phase_margin, |value| fixed(value, 1)),
        or_dash(of.output_deviation, number),
        or_dash(of.input_deviation, number),
    ]);
    loops.legend(
        "a step of the set point by 1; Ms and Mt: the peaks of 1/|1 + L| and |L/(1 + L)|, 1.2 to 2 is usual",
    );
    text.table(loops);
    match &found.robustness {
        Some(share) => {
            let part = fixed(100.0 * share.stable_share, 1);
            text.line(&format!(
                "stable with {part} % of {} models within the covariance of the parameters",
                share.draws
            ));
            if let Some(peak) = share.peak_sensitivity_95 {
                text.line(&format!("Ms below {} with 95 % of them", two(peak)));
            }
        }
        None => text
            .line("the covariance of the parameters is not known: nothing is said of how sure the loop is"),
    }
    text.finish()
}
