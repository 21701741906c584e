//! A mass on a spring with a damper.
//!
//! ```text
//! m d2x/dt2 = F - k (x - rest) - c dx/dt
//! ```

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::pendulum::oscillation;
use super::task::Task;
use super::{Column, Template};
use crate::Error;

const FORCE: usize = 0;
const POSITION: usize = 1;

pub(super) static SPRING: Template = Template {
    name: "spring",
    title: "a mass on a spring with a damper, driven by a force",
    columns: &[
        Column {
            name: "force",
            unit: "N",
            meaning: "force on the mass",
            optional: false,
            aliases: &["f", "u", "load"],
        },
        Column {
            name: "position",
            unit: "m",
            meaning: "position of the mass",
            optional: false,
            aliases: &["x", "y", "displacement", "pos", "deflection"],
        },
    ],
    settings: &[],
    parameters: &[("mass", "kg"), ("stiffness", "N/m"), ("damping", "N s/m"), ("rest", "m")],
    draft,
};

fn draft(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    [FORCE, POSITION].iter().try_for_each(|column| task.must_move(*column))?;
    let position = |derivative| Term::smooth(task, derivative, |run, row| run.values[POSITION][row]);
    let right = [
        Term::held(task, 0, |run, row| run.values[FORCE][row]),
        position(0),
        position(1),
        Term::smooth(task, 0, |_, _| 1.0),
    ];
    let mut drafts = Vec::new();
    for length in lengths(task) {
        let Some(theta) = regress(task, length, &position(2), &right, None) else { continue };
        let mass = 1.0 / theta[0];
        let stiffness = -theta[1] * mass;
        if !(mass > 0.0 && stiffness > 0.0) {
            continue;
        }
        let damping = (-theta[2] * mass).max(1e-3 * (mass * stiffness).sqrt());
        drafts.push(written(task, [mass, stiffness, damping, theta[3] * mass / stiffness]));
    }
    if drafts.is_empty() {
        let message = "the position does not follow the force as that of a mass on a spring does: a force that stays must move it the same \
                       way, and the log must have several rows in each swing";
        return Err(Error::undetermined(["mass", "stiffness"].map(str::to_owned).to_vec(), message));
    }
    Ok(drafts)
}

fn written(task: &Task<'_>, [mass, stiffness, damping, rest]: [f64; 4]) -> Draft {
    let frequency = (stiffness / mass).sqrt();
    let [position, velocity] = oscillation(task, POSITION, frequency, ["m", "m/s"]);
    Draft {
        about: vec!["A mass on a spring with a damper.".to_owned()],
        states: vec![State { name: "position", ..position }, State { name: "velocity", ..velocity }],
        inputs: vec![("force", FORCE)],
        parameters: vec![
            Parameter::positive("mass", "kg", mass),
            Parameter::positive("stiffness", "N/m", stiffness),
            Parameter::positive("damping", "N s/m", damping),
            Parameter::free("rest", "m", rest, 0.1 * task.span(POSITION)),
        ],
        substeps: (task.step * frequency.max(damping / mass) / 0.3).ceil().clamp(1.0, 20.0) as usize,
        equations: vec![
            ("position", "velocity".to_owned()),
            ("velocity", "(force - stiffness * (position - rest) - damping * velocity) / mass".to_owned()),
        ],
        outputs: vec![Output {
            column: POSITION,
            expression: "position".to_owned(),
            noise: task.noise(POSITION),
        }],
        figures: vec![
            figure("natural_frequency", "sqrt(stiffness / mass)", "rad/s"),
            figure("natural_frequency_hz", "sqrt(stiffness / mass) / (2 * pi)", "Hz"),
            figure("damping_ratio", "damping / (2 * sqrt(stiffness * mass))", ""),
            figure("compliance", "1 / stiffness", "m/N"),
            figure("decay_time", "2 * mass / damping", "s"),
        ],
        process: vec![("velocity", 0, 0.1 * frequency)],
        ..Draft::default()
    }
}
