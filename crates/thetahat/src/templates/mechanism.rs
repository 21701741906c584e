//! The feedforward of a mechanism: what voltage moves it as is wished.
//!
//! ```text
//! V = kS sign(v) + kV v + kA a            a flywheel, a drivetrain, a turret
//! V = kS sign(v) + kV v + kA a + kG       an elevator
//! V = kS sign(v) + kV v + kA a + kG cos(angle + offset)      an arm
//! ```
//!
//! From row to row the voltage is held, so that the step of the velocity is exact, and friction that stops the
//! mechanism holds it: with E = exp(-dt kV/kA) and B = (1 - E)/kV,
//!
//! ```text
//! v(k+1) = D(E v + B (V - kG)),    D(x) = x - B kS above B kS, x + B kS below -B kS, else 0
//! x(k+1) = x + kA B v + (dt - kA B) F/kV,    F = (v(k+1) - E v)/B, the mean force in volts
//! ```
//!
//! The logs are those of quasistatic runs, in which a voltage rises slowly, and of dynamic ones, in which it steps: the
//! first tell kS and kV, the second kA. The figures are gains of feedback that is optimal by a linear-quadratic
//! measure, sampled each `period` (WPILib, SysId, FeedbackAnalysis.cpp): with x' = A x + B u sampled as x(k+1) = Ad x +
//! Bd u,
//!
//! ```text
//! J = sum x' Q x + R u^2,    Q = diag(1/position_error^2, 1/velocity_error^2),    R = 1/effort^2
//! ```
//!
//! The gains come from the closed loop's polynomial, by spectral factorisation (Åström and Wittenmark,
//! Computer-Controlled Systems, 3rd ed. 1997, section 11.4): with d(z) = (z - 1)(z - ad), n1 and n2 the polynomials
//! from u to position and velocity,
//!
//! ```text
//! R d(z) d(1/z) + n1(z) n1(1/z)/position_error^2 + n2(z) n2(1/z)/velocity_error^2 = s^2 P(z) P(1/z)
//! ```
//!
//! whose values at z = 1 and z = -1 give P(z) = z^2 + c1 z + c0 by square roots alone.

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::{Run, Task};
use super::{Column, Setting, Template};
use crate::Error;

const VOLTAGE: usize = 0;
const VELOCITY: usize = 1;
const POSITION: usize = 2;

const VOLTAGE_COLUMN: Column = Column {
    name: "voltage",
    unit: "V",
    meaning: "voltage of the motors",
    optional: false,
    aliases: &["volts", "volt", "u", "motor_voltage", "applied_volts", "appliedvolts", "output_voltage"],
};
const VELOCITY_COLUMN: Column = Column {
    name: "velocity",
    unit: "units/s",
    meaning: "velocity of the mechanism",
    optional: false,
    aliases: &["v", "speed", "rate", "vel", "angular_velocity", "omega"],
};
const POSITION_COLUMN: Column = Column {
    name: "position",
    unit: "units",
    meaning: "position, in the units of the velocity",
    optional: true,
    aliases: &["pos", "x", "distance", "height"],
};
const ANGLE_COLUMN: Column = Column {
    name: "angle",
    unit: "rad",
    meaning: "angle of the arm, 0 where it is level",
    optional: false,
    aliases: &["position", "pos", "theta"],
};
const SETTINGS: &[Setting] = &[
    Setting {
        name: "max_voltage",
        unit: "V",
        default: Some(12.0),
        meaning: "voltage of the largest velocity and acceleration",
    },
    Setting {
        name: "position_error",
        unit: "units",
        default: Some(1.0),
        meaning: "position error that is as bad as effort",
    },
    Setting {
        name: "velocity_error",
        unit: "units/s",
        default: Some(1.5),
        meaning: "velocity error that is as bad as effort",
    },
    Setting { name: "effort", unit: "V", default: Some(7.0), meaning: "voltage that feedback should use" },
    Setting {
        name: "period",
        unit: "s",
        default: Some(0.02),
        meaning: "time from one run of the controller to the next",
    },
];

pub(super) static MECHANISM: Template = Template {
    name: "mechanism",
    title: "feedforward of a mechanism that gravity does not move: kS, kV, kA, from quasistatic and dynamic runs",
    columns: &[VOLTAGE_COLUMN, VELOCITY_COLUMN, POSITION_COLUMN],
    settings: SETTINGS,
    parameters: &[("kS", "V"), ("kV", "V s/unit"), ("kA", "V s^2/unit")],
    draft: |task| draft(task, Kind::Simple),
};

pub(super) static ELEVATOR: Template = Template {
    name: "elevator",
    title: "feedforward of an elevator: kS, kV, kA and kG, from quasistatic and dynamic runs",
    columns: &[VOLTAGE_COLUMN, VELOCITY_COLUMN, POSITION_COLUMN],
    settings: SETTINGS,
    parameters: &[("kS", "V"), ("kV", "V s/unit"), ("kA", "V s^2/unit"), ("kG", "V")],
    draft: |task| draft(task, Kind::Elevator),
};

pub(super) static ARM: Template = Template {
    name: "arm",
    title: "feedforward of an arm: kS, kV, kA and kG cos(angle + offset), from quasistatic and dynamic runs",
    columns: &[VOLTAGE_COLUMN, Column { unit: "rad/s", ..VELOCITY_COLUMN }, ANGLE_COLUMN],
    settings: SETTINGS,
    parameters: &[("kS", "V"), ("kV", "V s/rad"), ("kA", "V s^2/rad"), ("kG", "V"), ("offset", "rad")],
    draft: |task| draft(task, Kind::Arm),
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Simple,
    Elevator,
    Arm,
}

/// kS, kV, kA, kG and the offset of the angle.
type Gains = [f64; 5];

fn draft(task: &Task<'_>, kind: Kind) -> Result<Vec<Draft>, Error> {
    [VOLTAGE, VELOCITY].iter().try_for_each(|column| task.must_move(*column))?;
    for setting in SETTINGS {
        task.positive(setting.name)?;
    }
    // Below it the mechanism may stand still, where friction is anything up to kS.
    let slow = (3.0 * task.noise(VELOCITY)).max(0.02 * task.largest(VELOCITY));
    let moving: Vec<Vec<bool>> =
        task.runs.iter().map(|run| run.values[VELOCITY].iter().map(|v| v.abs() > slow).collect()).collect();
    let mut right = vec![
        Term::held(task, 0, |run, row| run.values[VOLTAGE][row]),
        Term::smooth(task, 0, |run, row| run.values[VELOCITY][row]),
        Term::smooth(task, 0, |run, row| run.values[VELOCITY][row].signum()),
    ];
    match kind {
        Kind::Simple => {}
        Kind::Elevator => right.push(Term::smooth(task, 0, |_, _| 1.0)),
        Kind::Arm => {
            task.must_move(POSITION)?;
            right.push(Term::smooth(task, 0, |run: &Run, row| run.values[POSITION][row].cos()));
            right.push(Term::smooth(task, 0, |run: &Run, row| run.values[POSITION][row].sin()));
        }
    }
    let acceleration = Term::smooth(task, 1, |run, row| run.values[VELOCITY][row]);
    let mut found: Vec<Gains> = Vec::new();
    for length in lengths(task) {
        // a = (V - kV v - kS sign v - kG cos(angle) cos(offset) + kG sin(angle) sin(offset)) / kA
        let Some(theta) = regress(task, length, &acceleration, &right, Some(&moving)) else { continue };
        let gain = |place: usize| theta.get(place).map_or(0.0, |value| -value / theta[0]);
        let (kg, offset) = match kind {
            // kG has the sign with which the offset is the smaller one.
            Kind::Arm => {
                let side = if gain(3) < 0.0 { -1.0 } else { 1.0 };
                (side * gain(3).hypot(gain(4)), (-side * gain(4)).atan2(side * gain(3)))
            }
            _ => (gain(3), 0.0),
        };
        found.push([gain(2), gain(1), 1.0 / theta[0], kg, offset]);
    }
    possible(task, kind, &found)?;
    let usable = found.iter().filter(|[_, kv, ka, ..]| *kv > 0.0 && *ka > 0.0);
    Ok(usable.map(|gains| written(task, kind, *gains)).collect())
}

/// That some window gives a mechanism; else why not.
fn possible(task: &Task<'_>, kind: Kind, found: &[Gains]) -> Result<(), Error> {
    if found.iter().any(|[_, kv, ka, ..]| *kv > 0.0 && *ka > 0.0) {
        return Ok(());
    }
    let names = ["kS", "kV", "kA"].map(str::to_owned).to_vec();
    // What windows of a middle length say.
    let Some([_, kv, ka, ..]) = found.get(found.len() / 2) else {
        let gravity = if kind == Kind::Simple { "" } else { ", in both directions" };
        let message = format!(
            "the log does not tell kS, kV and kA apart: it needs quasistatic runs (a voltage that rises slowly) and dynamic ones (a step of \
             voltage){gravity}, with {} rows in motion or more",
            3 * 6
        );
        return Err(Error::undetermined(names, message));
    };
    let reason = if *kv < 0.0 && *ka < 0.0 {
        format!(
            "column '{}' falls where column '{}' rises: one of the two has the wrong sign; invert the motor or the encoder",
            task.channel(VELOCITY),
            task.channel(VOLTAGE)
        )
    } else if *ka < 0.0 {
        "the velocity changes against the voltage: the log has no dynamic run that shows the acceleration, the rows are too far apart for \
         it, or the velocity is filtered so that it lags the voltage"
            .to_owned()
    } else {
        "the mechanism is faster at a smaller voltage: is the voltage that of its motor, and the log that of a free mechanism?".to_owned()
    };
    let figures =
        if *ka < 0.0 { format!("kA = {ka:.3} is below 0") } else { format!("kV = {kv:.3} is below 0") };
    Err(Error::undetermined(names, format!("{figures}, which no mechanism has: {reason}")))
}

fn written(task: &Task<'_>, kind: Kind, [ks, kv, ka, kg, offset]: Gains) -> Draft {
    let angle = kind == Kind::Arm;
    let (unit_v, unit_a, name, unit) = if angle {
        ("V s/rad", "V s^2/rad", "angle", "rad")
    } else {
        ("V s/unit", "V s^2/unit", "position", "units")
    };
    let has_position = task.has(POSITION);
    let state = |name, unit, column: usize| {
        let (start, far) = task.first(column);
        State { name, unit, start, deviation: far + 3.0 * task.noise(column) + 1e-3 * task.span(column) }
    };
    let mut states = vec![state("velocity", if angle { "rad/s" } else { "units/s" }, VELOCITY)];
    // Gravity on an arm is that in the middle of the step.
    let gravity = match kind {
        Kind::Simple => "",
        Kind::Elevator => " - kG",
        Kind::Arm => " - kG * cos(angle + dt * velocity / 2 + offset)",
    };
    let (e, b) = ("exp(-dt * kV / kA)", "(1 - exp(-dt * kV / kA)) / kV");
    let next = format!("dead({e} * velocity + {b} * (voltage{gravity}), -{b} * kS, {b} * kS)");
    let mut equations = vec![("velocity", next.clone())];
    let output =
        |state: &str, column| Output { column, expression: state.to_owned(), noise: task.noise(column) };
    let mut outputs = vec![output("velocity", VELOCITY)];
    if has_position {
        states.push(state(name, unit, POSITION));
        let force = format!("({next} - {e} * velocity) / ({b})");
        equations.push((name, format!("{name} + kA * {b} * velocity + (dt - kA * {b}) * {force} / kV")));
        outputs.push(output(name, POSITION));
    }
    let mut parameters = vec![
        Parameter::free("kS", "V", ks, 0.1 * task.largest(VOLTAGE)),
        Parameter::positive("kV", unit_v, kv),
        Parameter::positive("kA", unit_a, ka),
    ];
    if kind != Kind::Simple {
        parameters.push(Parameter::free("kG", "V", kg, 0.1 * task.largest(VOLTAGE)));
    }
    if angle {
        parameters.push(Parameter::free("offset", "rad", offset, 0.5));
    }
    parameters.extend(
        SETTINGS.iter().map(|Setting { name, unit, .. }| Parameter::known(*name, *unit, task.setting(name))),
    );
    Draft {
        about: vec![
            "What voltage moves a mechanism: kS against friction, kV for the velocity, kA for the acceleration.".to_owned(),
            "Gains of feedback are optimal for the errors and the effort below, one run each period.".to_owned(),
        ],
        states,
        inputs: vec![("voltage", VOLTAGE)],
        parameters,
        next: true,
        equations,
        outputs,
        figures: figures(kind),
        process: vec![("velocity", 0, 0.1)],
        ..Draft::default()
    }
}

fn figures(kind: Kind) -> Vec<super::draft::Figure> {
    let (speed, acceleration) =
        if kind == Kind::Arm { ("rad/s", "rad/s^2") } else { ("units/s", "units/s^2") };
    let (gain, gain_d) = if kind == Kind::Arm { ("V/rad", "V s/rad") } else { ("V/unit", "V s/unit") };
    let gravity =
        if kind == Kind::Simple { "(max_voltage - kS) / kA" } else { "(max_voltage - kS - kG) / kA" };
    let fastest =
        if kind == Kind::Elevator { "(max_voltage - kS - kG) / kV" } else { "(max_voltage - kS) / kV" };
    vec![
        figure("time_constant", "kA / kV", "s"),
        figure("max_velocity", fastest, speed),
        figure("max_acceleration", gravity, acceleration),
        // x(k+1) = [1 a12; 0 ad] x + [b1; b2] u.
        figure("_ad", "exp(-kV / kA * period)", ""),
        figure("_a12", "kA / kV * (1 - _ad)", ""),
        figure("_b1", "(period - _a12) / kV", ""),
        figure("_b2", "(1 - _ad) / kV", ""),
        // A velocity loop: R (z - ad)(1/z - ad) + b2^2/velocity_error^2 has the roots p and 1/p.
        figure("_m", "1 / _ad + _ad + (_b2 * effort / velocity_error)^2 / _ad", ""),
        figure("velocity_kp", "(_ad - 2 / (_m + sqrt(_m^2 - 4))) / _b2", gain_d),
        // A position loop; the left side at z = 1 is _plus^2, at z = -1 _minus^2.
        figure("_c", "_a12 * _b2 - _ad * _b1", ""),
        figure("_plus", "(_b1 + _c) / position_error", ""),
        figure(
            "_minus",
            "sqrt(4 * ((1 + _ad) / effort)^2 + ((_c - _b1) / position_error)^2 + 4 * (_b2 / velocity_error)^2)",
            "",
        ),
        figure("_half", "(_plus + _minus) / 2", ""),
        figure("_s", "(_half + sqrt(_half^2 - 4 * _ad / effort^2)) / 2", ""),
        figure("_c0", "_ad / (effort * _s)^2", ""),
        figure("_c1", "(_plus - _minus) / (2 * _s)", ""),
        figure("position_kp", "(1 + _c0 + _c1) / (_b1 + _c)", gain),
        figure("position_kd", "(_c1 + 1 + _ad - position_kp * _b1) / _b2", gain_d),
    ]
}
