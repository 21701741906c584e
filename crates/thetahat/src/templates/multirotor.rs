//! One axis of a multirotor: a command to its motors, which answer after a delay and with a lag, and turn it.
//!
//! ```text
//! T dm/dt = k u(t - delay) - m          dw/dt = m - d w + b
//! ```
//!
//! The gains of the rate loop are those of Skogestad, Simple analytic rules for model reduction and PID controller
//! tuning, Journal of Process Control 13, 2003, for an integrating process with a lag and a delay: the derivative part
//! takes the lag away, and the loop has the time constant `loop_time`.

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::Task;
use super::{Column, Setting, Template};
use crate::Error;

const COMMAND: usize = 0;
const RATE: usize = 1;
/// Delays of up to so many rows are tried.
const LATEST: usize = 15;

pub(super) static MULTIROTOR: Template = Template {
    name: "multirotor",
    title: "an axis of a multirotor: gain, lag of the motors, and delay, with gains of its rate loop",
    columns: &[
        Column {
            name: "command",
            unit: "1",
            meaning: "command to the axis: what the mixer is given, or the difference of the motors",
            optional: false,
            aliases: &["u", "cmd", "torque", "control", "actuator", "output", "mixer"],
        },
        Column {
            name: "rate",
            unit: "rad/s",
            meaning: "angular rate of the axis",
            optional: false,
            aliases: &[
                "gyro",
                "omega",
                "p",
                "q",
                "r",
                "y",
                "rollspeed",
                "pitchspeed",
                "yawspeed",
                "angular_velocity",
            ],
        },
    ],
    settings: &[Setting {
        name: "loop_time",
        unit: "s",
        default: None,
        meaning: "time constant that the rate loop is to have; else the lag of the motors as it starts",
    }],
    parameters: &[
        ("gain", "rad/s^2"),
        ("motor_lag", "s"),
        ("delay", "s"),
        ("damping", "1/s"),
        ("trim", "rad/s^2"),
    ],
    draft,
};

fn draft(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    [COMMAND, RATE].iter().try_for_each(|column| task.must_move(*column))?;
    let rate = |derivative| Term::smooth(task, derivative, |run, row| run.values[RATE][row]);
    let mut drafts = Vec::new();
    for late in 0..=LATEST {
        // w'' = -(1/T + d) w' - d/T w + k/T u + b/T
        let right = [
            rate(1),
            rate(0),
            Term::held(task, 0, move |run, row| run.values[COMMAND][row.saturating_sub(late)]),
            Term::smooth(task, 0, |_, _| 1.0),
        ];
        for length in lengths(task) {
            let Some(theta) = regress(task, length, &rate(2), &right, None) else { continue };
            // 1/T and d are the roots of s^2 + theta_1 s - theta_2.
            let root = theta[0] * theta[0] + 4.0 * theta[1];
            let faster = 0.5 * (root.max(0.0).sqrt() - theta[0]);
            let (gain, trim) = (theta[2] / faster, theta[3] / faster);
            if faster > 0.0 && gain != 0.0 {
                let damping = -theta[0] - faster;
                drafts.push(written(task, [gain, 1.0 / faster, late as f64 * task.step, damping, trim])?);
            }
        }
    }
    if drafts.is_empty() {
        let message = "the rate does not follow the command as that of an axis does: are the columns those of one axis, and does the command \
                       step often enough, faster than the axis turns away?";
        return Err(Error::undetermined(["gain", "motor_lag"].map(str::to_owned).to_vec(), message));
    }
    Ok(drafts)
}

fn written(task: &Task<'_>, [gain, lag, delay, damping, trim]: [f64; 5]) -> Result<Draft, Error> {
    let (start, far) = task.first(RATE);
    let deviation = far + 3.0 * task.noise(RATE) + 0.01 * task.span(RATE);
    let torque = gain.abs() * task.largest(COMMAND);
    let loop_time = super::task::above_zero("loop_time", task.known("loop_time").unwrap_or(lag))?;
    Ok(Draft {
        about: vec![
            "An axis of a multirotor: the motors answer a command after a delay, and with a lag.".to_owned(),
        ],
        states: vec![
            State { name: "rate", unit: "rad/s", start, deviation },
            State {
                name: "motor",
                unit: "rad/s^2",
                start: gain * task.first(COMMAND).0,
                deviation: 0.3 * torque,
            },
        ],
        inputs: vec![("command", COMMAND)],
        parameters: vec![
            Parameter::free("gain", "rad/s^2", gain, gain.abs()),
            Parameter::positive("motor_lag", "s", lag),
            Parameter::positive("delay", "s", delay.max(0.1 * task.step)),
            Parameter::free("damping", "1/s", damping, 0.3 / lag),
            Parameter::free("trim", "rad/s^2", trim, 0.1 * torque),
            Parameter::known("loop_time", "s", loop_time),
        ],
        equations: vec![
            ("rate", "motor - damping * rate + trim".to_owned()),
            ("motor", "(gain * command(t - delay) - motor) / motor_lag".to_owned()),
        ],
        outputs: vec![Output { column: RATE, expression: "rate".to_owned(), noise: task.noise(RATE) }],
        process: vec![("rate", 0, 0.1)],
        figures: vec![
            figure("rate_kp", "1 / (gain * (loop_time + delay))", "1/(rad/s)"),
            figure("rate_kd", "rate_kp * motor_lag", "1/(rad/s^2)"),
            figure("crossover", "1 / (loop_time + delay)", "rad/s"),
            figure("phase_margin", "90 - 180 / pi * delay / (loop_time + delay)", "deg"),
        ],
        ..Draft::default()
    })
}
