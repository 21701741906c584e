//! A pendulum, driven or not.
//!
//! ```text
//! d2 angle/dt2 = -(g/l) sin(angle - zero) - d d angle/dt + torque/J
//! ```

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::Task;
use super::{Column, Setting, Template};
use crate::Error;

const ANGLE: usize = 0;
const TORQUE: usize = 1;

pub(super) static PENDULUM: Template = Template {
    name: "pendulum",
    title: "a pendulum that swings, driven by a torque or not",
    columns: &[
        Column {
            name: "angle",
            unit: "rad",
            meaning: "angle from where it hangs",
            optional: false,
            aliases: &["theta", "phi", "position", "y"],
        },
        Column {
            name: "torque",
            unit: "N m",
            meaning: "torque at the pivot, or what it is proportional to",
            optional: true,
            aliases: &["tau", "u", "input", "force"],
        },
    ],
    settings: &[Setting {
        name: "gravity",
        unit: "m/s^2",
        default: Some(9.80665),
        meaning: "acceleration of gravity",
    }],
    parameters: &[("length", "m"), ("damping", "1/s"), ("zero", "rad"), ("inertia", "kg m^2")],
    draft,
};

fn draft(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    task.must_move(ANGLE)?;
    let gravity = task.positive("gravity")?;
    if task.largest(ANGLE) > 60.0 {
        let message = format!(
            "column '{}' goes to {}: the angle must be in rad, and this looks like degrees",
            task.channel(ANGLE),
            task.largest(ANGLE)
        );
        return Err(Error::in_channel(task.channel(ANGLE), None, message));
    }
    let angle = |derivative| Term::smooth(task, derivative, |run, row| run.values[ANGLE][row]);
    let mut right = vec![
        angle(1),
        Term::smooth(task, 0, |run, row| run.values[ANGLE][row].sin()),
        Term::smooth(task, 0, |run, row| run.values[ANGLE][row].cos()),
    ];
    if task.has(TORQUE) {
        task.must_move(TORQUE)?;
        right.push(Term::held(task, 0, |run, row| run.values[TORQUE][row]));
    }
    let mut drafts = Vec::new();
    for length in lengths(task) {
        let Some(theta) = regress(task, length, &angle(2), &right, None) else { continue };
        // -(g/l) sin(angle - zero) = -(g/l) (sin(angle) cos(zero) - cos(angle) sin(zero))
        let square = theta[1].hypot(theta[2]);
        let zero = theta[2].atan2(-theta[1]);
        let inertia = theta.get(3).map(|torque| 1.0 / torque);
        if inertia.is_some_and(|inertia| inertia <= 0.0) || theta[1] >= 0.0 {
            continue;
        }
        // A pendulum without friction has no place to start from on a logarithmic scale.
        let damping = (-theta[0]).max(1e-3 * square.sqrt());
        drafts.push(written(task, [gravity / square, damping, zero], inertia, gravity));
    }
    if drafts.is_empty() {
        let message = "the angle does not swing as that of a pendulum does: it must count from where the pendulum hangs, in rad, and be \
                       sampled several times in each swing";
        return Err(Error::undetermined(["length", "damping"].map(str::to_owned).to_vec(), message));
    }
    Ok(drafts)
}

fn written(task: &Task<'_>, [length, damping, zero]: [f64; 3], inertia: Option<f64>, gravity: f64) -> Draft {
    let frequency = (gravity / length).sqrt();
    let mut parameters = vec![
        Parameter::positive("length", "m", length),
        Parameter::positive("damping", "1/s", damping),
        Parameter::free("zero", "rad", zero, 0.1),
    ];
    let mut torque = "";
    let mut inputs = Vec::new();
    if let Some(inertia) = inertia {
        parameters.push(Parameter::positive("inertia", "kg m^2", inertia));
        inputs.push(("torque", TORQUE));
        torque = " + torque / inertia";
    }
    parameters.push(Parameter::known("gravity", "m/s^2", gravity));
    let [angle, rate] = oscillation(task, ANGLE, frequency, ["rad", "rad/s"]);
    Draft {
        about: vec!["A pendulum; length is that of a point mass which swings as it does.".to_owned()],
        states: vec![State { name: "angle", ..angle }, State { name: "rate", ..rate }],
        inputs,
        parameters,
        substeps: (task.step * frequency / 0.3).ceil().clamp(1.0, 20.0) as usize,
        equations: vec![
            ("angle", "rate".to_owned()),
            ("rate", format!("-gravity / length * sin(angle - zero) - damping * rate{torque}")),
        ],
        outputs: vec![Output { column: ANGLE, expression: "angle".to_owned(), noise: task.noise(ANGLE) }],
        figures: vec![
            figure("natural_frequency", "sqrt(gravity / length)", "rad/s"),
            figure("period", "2 * pi * sqrt(length / gravity)", "s"),
            figure("damping_ratio", "damping / (2 * sqrt(gravity / length))", ""),
            figure("decay_time", "2 / damping", "s"),
        ],
        process: vec![("rate", 0, 0.1 * frequency)],
        ..Draft::default()
    }
}

/// The states of something that swings at a frequency, of which a position is measured: where it is and how fast, at
/// the first row.
pub(super) fn oscillation(
    task: &Task<'_>,
    column: usize,
    frequency: f64,
    units: [&'static str; 2],
) -> [State; 2] {
    let (start, far) = task.first(column);
    let noise = task.noise(column);
    // Straight lines through the first twentieth of a swing, at least three rows.
    let slope = |run: &super::task::Run| {
        let rows =
            run.time.iter().take_while(|time| **time * frequency < 0.3).count().max(3).min(run.time.len());
        let (time, values) = (&run.time[..rows], &run.values[column][..rows]);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / rows as f64;
        let (centre, level) = (mean(time), mean(values));
        let product: f64 = time.iter().zip(values).map(|(t, y)| (t - centre) * (y - level)).sum();
        let square: f64 = time.iter().map(|t| (t - centre).powi(2)).sum();
        if square > 0.0 { product / square } else { 0.0 }
    };
    let slopes: Vec<f64> = task.runs.iter().map(slope).collect();
    let rate = slopes.iter().sum::<f64>() / slopes.len().max(1) as f64;
    let apart = slopes.iter().map(|slope| (slope - rate).abs()).fold(0.0, f64::max);
    [
        State { name: "", unit: units[0], start, deviation: far + 3.0 * noise + 0.01 * task.span(column) },
        State {
            name: "",
            unit: units[1],
            start: rate,
            deviation: apart + 0.2 * task.span(column) * frequency,
        },
    ]
}
