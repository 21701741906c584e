//! A motor for direct current.
//!
//! ```text
//! L di/dt = u - R i - k w          J dw/dt = k i - b w - c sign(w)
//! ```

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::Task;
use super::{Column, Setting, Template};
use crate::Error;

const VOLTAGE: usize = 0;
const CURRENT: usize = 1;
const SPEED: usize = 2;

pub(super) static MOTOR: Template = Template {
    name: "motor",
    title: "a motor for direct current, with its current and its speed measured",
    columns: &[
        Column {
            name: "voltage",
            unit: "V",
            meaning: "armature voltage",
            optional: false,
            aliases: &["u", "v", "volt", "volts", "armature_voltage", "motor_voltage", "voltage_v"],
        },
        Column {
            name: "current",
            unit: "A",
            meaning: "armature current",
            optional: false,
            aliases: &["i", "amps", "armature_current", "motor_current"],
        },
        Column {
            name: "speed",
            unit: "rad/s",
            meaning: "speed of the shaft",
            optional: false,
            aliases: &["omega", "w", "velocity", "angular_velocity", "rate"],
        },
    ],
    settings: &[Setting {
        name: "rated_voltage",
        unit: "V",
        default: None,
        meaning: "voltage of the no-load and the stall figures; that of the log at its largest",
    }],
    parameters: &[
        ("resistance", "Ohm"),
        ("inductance", "H"),
        ("torque_constant", "N m/A"),
        ("inertia", "kg m^2"),
        ("friction", "N m s/rad"),
        ("dry_friction", "N m"),
    ],
    draft,
};

fn draft(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    [VOLTAGE, CURRENT, SPEED].iter().try_for_each(|column| task.must_move(*column))?;
    let rated = task.known("rated_voltage").unwrap_or_else(|| task.largest(VOLTAGE));
    let rated = super::task::above_zero("rated_voltage", rated)?;
    let column = |column: usize, derivative: usize| {
        Term::smooth(task, derivative, move |run, row| run.values[column][row])
    };
    let width = 0.02 * task.largest(SPEED);
    let electric =
        [Term::held(task, 0, |run, row| run.values[VOLTAGE][row]), column(CURRENT, 0), column(SPEED, 0)];
    // Dry friction is told apart from a constant torque only if the motor turns both ways, and from friction that grows
    // with the speed only if that changes: it is left out where it is not determined.
    let sign = Term::smooth(task, 0, move |run, row| (run.values[SPEED][row] / width).tanh());
    let mechanic = [column(CURRENT, 0), column(SPEED, 0), sign];
    let mut drafts = Vec::new();
    let grid = lengths(task);
    // R and k where the current does not change, for logs too slow for the inductance.
    let still: Vec<[f64; 3]> = grid
        .iter()
        .filter_map(|length| {
            let held = Term::held(task, 0, |run, row| run.values[VOLTAGE][row]);
            let found = regress(task, *length, &held, &[column(CURRENT, 0), column(SPEED, 0)], None)?;
            (found[0] > 0.0 && found[1] > 0.0).then(|| [found[0], found[1], 0.0])
        })
        .collect();
    let whole = |length: &usize| {
        let found = regress(task, *length, &column(CURRENT, 1), &electric, None)?;
        (found[0] > 0.0).then(|| [-found[1] / found[0], -found[2] / found[0], 1.0 / found[0]])
    };
    let mut electrics: Vec<[f64; 3]> = grid.iter().filter_map(whole).collect();
    for times in [0.5, 2.0, 8.0] {
        electrics.extend(still.iter().map(|[r, k, _]| [*r, *k, times * task.step * r]));
    }
    electrics.retain(|found| found.iter().all(|value| *value > 0.0));
    for length in &grid {
        let Some(found) = regress(task, *length, &column(SPEED, 1), &mechanic, None)
            .or_else(|| regress(task, *length, &column(SPEED, 1), &mechanic[..2], None))
        else {
            continue;
        };
        if found[0] <= 0.0 {
            continue;
        }
        for [resistance, constant, inductance] in &electrics {
            let inertia = constant / found[0];
            let friction = (-found[1] * inertia).max(1e-3 * constant * constant / resistance);
            let dry = found.get(2).map_or(0.0, |dry| -dry * inertia);
            drafts.push(written(
                task,
                [*resistance, *inductance, *constant, inertia, friction, dry],
                width,
                rated,
            ));
        }
    }
    if drafts.is_empty() {
        let message = "the columns do not fit a motor: a larger voltage must raise the current, and a current the speed; are the signs of \
                       voltage, current and speed the same way round?";
        return Err(Error::undetermined(Vec::new(), message));
    }
    Ok(drafts)
}

fn written(task: &Task<'_>, [r, l, k, inertia, friction, dry]: [f64; 6], width: f64, rated: f64) -> Draft {
    let state = |name, unit, column: usize| {
        let (start, far) = task.first(column);
        State { name, unit, start, deviation: far + 3.0 * task.noise(column) + 0.01 * task.span(column) }
    };
    // Runge and Kutta's method is stable for steps of up to 2.78 time constants, and accurate for those of one.
    let substeps = (task.step * r / l).ceil().clamp(1.0, 20.0) as usize;
    Draft {
        about: vec!["A motor for direct current: armature current and speed, driven by a voltage.".to_owned()],
        states: vec![state("current", "A", CURRENT), state("speed", "rad/s", SPEED)],
        inputs: vec![("voltage", VOLTAGE)],
        parameters: vec![
            Parameter::positive("resistance", "Ohm", r),
            Parameter::positive("inductance", "H", l),
            Parameter::positive("torque_constant", "N m/A", k),
            Parameter::positive("inertia", "kg m^2", inertia),
            Parameter::positive("friction", "N m s/rad", friction),
            Parameter::free("dry_friction", "N m", dry, 0.1 * k * task.largest(CURRENT)),
            Parameter::known("friction_width", "rad/s", width),
            Parameter::known("rated_voltage", "V", rated),
        ],
        substeps,
        equations: vec![
            ("current", "(voltage - resistance * current - torque_constant * speed) / inductance".to_owned()),
            (
                "speed",
                "(torque_constant * current - friction * speed - dry_friction * tanh(speed / friction_width)) / inertia".to_owned(),
            ),
        ],
        outputs: [("current", CURRENT), ("speed", SPEED)]
            .map(|(state, column)| Output { column, expression: state.to_owned(), noise: task.noise(column) })
            .into(),
        figures: vec![
            figure("electrical_time_constant", "inductance / resistance", "s"),
            figure("mechanical_time_constant", "inertia * resistance / (torque_constant^2 + resistance * friction)", "s"),
            figure("speed_constant", "60 / (2 * pi * torque_constant)", "rpm/V"),
            figure(
                "no_load_speed",
                "(torque_constant * rated_voltage - resistance * dry_friction) / (torque_constant^2 + resistance * friction)",
                "rad/s",
            ),
            figure("no_load_current", "(friction * no_load_speed + dry_friction) / torque_constant", "A"),
            figure("stall_current", "rated_voltage / resistance", "A"),
            figure("stall_torque", "torque_constant * stall_current - dry_friction", "N m"),
        ],
        process: vec![("speed", 1, 0.1)],
        ..Draft::default()
    }
}
