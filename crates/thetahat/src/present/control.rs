//! A controller.

use crate::control::Control;
use crate::figures::{fixed, number};
use crate::present::Layout;
use crate::text::harmless;

use super::tree::{Medium, Sections, columns, figure, word};

/// The coefficients and what the loop does.
pub fn control(found: &Control, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let (input, output) = (harmless(&found.input.name), harmless(&found.output.name));
    on.line(format!("{} from {input} to {output}: {}", found.model, found.design));
    on.line("R(q) u = T(q) u_c - S(q) y, every sample, in deviations from the working point");
    on.gap();
    let own = &found.controller;
    let longest = [&own.r, &own.s, &own.t].into_iter().map(Vec::len).max().unwrap_or(0);
    let mut coefficients = columns("Coefficients", ["power of q^-1", "R", "S", "T"]);
    for place in 0..longest {
        let at = |values: &[f64]| figure(values.get(place).copied().unwrap_or(0.0), number);
        coefficients.row([word(place), at(&own.r), at(&own.s), at(&own.t)]);
    }
    on.table(coefficients);
    if let Some(feedback) = &found.state_feedback {
        let each: Vec<String> = feedback.iter().map(|gain| number(*gain)).collect();
        on.line(format!("state feedback in the controllable form: {}", each.join(", ")));
        on.gap();
    }
    let of = &found.closed_loop;
    let mut poles = columns("Poles", ["pole of the loop", "modulus"]);
    for pole in &of.poles {
        let written = match pole.im {
            0.0 => number(pole.re),
            im => format!("{} {} {}i", number(pole.re), if im > 0.0 { "+" } else { "-" }, number(im.abs())),
        };
        poles.row([word(written), figure(pole.re.hypot(pole.im), number)]);
    }
    on.table(poles);
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
    let mut loops =
        columns("Closed loop", head).none("not reached, not crossed, or nothing said of the noise");
    let two: fn(f64) -> String = |value| fixed(value, 2);
    loops.row([
        figure(of.rise_time, number),
        figure(of.overshoot, |value| fixed(100.0 * value, 1)),
        figure(of.settling_time, number),
        figure(of.peak_sensitivity, two),
        figure(of.peak_complementary_sensitivity, two),
        figure(of.gain_margin, two),
        figure(of.phase_margin, |value| fixed(value, 1)),
        figure(of.output_deviation, number),
        figure(of.input_deviation, number),
    ]);
    loops.legend(
        "a step of the set point by 1; Ms and Mt: the peaks of 1/|1 + L| and |L/(1 + L)|, 1.2 to 2 is usual",
    );
    on.table(loops);
    match &found.robustness {
        Some(share) => {
            let part = fixed(100.0 * share.stable_share, 1);
            on.line(format!(
                "stable with {part} % of {} models within the covariance of the parameters",
                share.draws
            ));
            if let Some(peak) = share.peak_sensitivity_95 {
                on.line(format!("Ms below {} with 95 % of them", two(peak)));
            }
        }
        None => {
            on.line("the covariance of the parameters is not known: nothing is said of how sure the loop is")
        }
    }
    super::text::written(on, layout)
}
