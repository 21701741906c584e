//! A tank with an inflow and an outlet in its floor.
//!
//! ```text
//! A dh/dt = q - c sqrt(h)          c = Cd a sqrt(2 g), Torricelli's law
//! ```

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::Task;
use super::{Column, Template};
use crate::Error;

const INFLOW: usize = 0;
const LEVEL: usize = 1;

pub(super) static TANK: Template = Template {
    name: "tank",
    title: "a tank with an inflow, and an outlet in its floor",
    columns: &[
        Column {
            name: "inflow",
            unit: "m3/s",
            meaning: "inflow, or the voltage of a pump that it is proportional to",
            optional: false,
            aliases: &["flow", "q", "qin", "q_in", "pump", "u", "flow_in", "pump_voltage"],
        },
        Column {
            name: "level",
            unit: "m",
            meaning: "level above the outlet",
            optional: false,
            aliases: &["h", "height", "y", "water_level", "lvl"],
        },
    ],
    settings: &[],
    parameters: &[("area", "m^2"), ("outflow", "m^2.5/s")],
    draft,
};

fn draft(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    [INFLOW, LEVEL].iter().try_for_each(|column| task.must_move(*column))?;
    let (low, high) = task.range(LEVEL);
    if low < -0.1 * high {
        let message = format!(
            "column '{}' goes down to {low}: the level counts from the outlet and is not below 0; add the offset to the column",
            task.channel(LEVEL)
        );
        return Err(Error::in_channel(task.channel(LEVEL), None, message));
    }
    let right = [
        Term::held(task, 0, |run, row| run.values[INFLOW][row]),
        Term::smooth(task, 0, |run, row| run.values[LEVEL][row].max(0.0).sqrt()),
    ];
    let change = Term::smooth(task, 1, |run, row| run.values[LEVEL][row]);
    let mut drafts = Vec::new();
    for length in lengths(task) {
        let Some(theta) = regress(task, length, &change, &right, None) else { continue };
        let (area, outflow) = (1.0 / theta[0], -theta[1] / theta[0]);
        if area > 0.0 && outflow > 0.0 {
            drafts.push(written(task, area, outflow));
        }
    }
    if drafts.is_empty() {
        let message = "the level does not rise with the inflow and fall without it as that of a tank with an outlet does: is the level in one \
                       column and the inflow of this tank in the other?";
        return Err(Error::undetermined(["area", "outflow"].map(str::to_owned).to_vec(), message));
    }
    Ok(drafts)
}

fn written(task: &Task<'_>, area: f64, outflow: f64) -> Draft {
    let (start, far) = task.first(LEVEL);
    let deviation = far + 3.0 * task.noise(LEVEL) + 0.01 * task.span(LEVEL);
    let mean = task.mean(LEVEL).max(0.01 * task.largest(LEVEL));
    // The fastest time constant is that of the lowest level.
    let low = task.range(LEVEL).0.max(0.01 * mean);
    Draft {
        about: vec![
            "A tank with an outlet in its floor: the outflow grows with the root of the level.".to_owned(),
        ],
        states: vec![State { name: "level", unit: "m", start, deviation }],
        inputs: vec![("inflow", INFLOW)],
        parameters: vec![
            Parameter::positive("area", "m^2", area),
            Parameter::positive("outflow", "m^2.5/s", outflow),
            Parameter::known("mean_level", "m", mean),
            Parameter::known("empty", "m", 1e-3 * task.span(LEVEL)),
        ],
        substeps: (task.step * outflow / (2.0 * area * low.sqrt())).ceil().clamp(1.0, 20.0) as usize,
        equations: vec![("level", "(inflow - outflow * sqrt(max(level, 0 within empty))) / area".to_owned())],
        outputs: vec![Output { column: LEVEL, expression: "level".to_owned(), noise: task.noise(LEVEL) }],
        figures: vec![
            figure("time_constant", "2 * area * sqrt(mean_level) / outflow", "s"),
            figure("gain", "2 * sqrt(mean_level) / outflow", "m/(m3/s)"),
            figure("inflow_at_mean_level", "outflow * sqrt(mean_level)", "m3/s"),
            // The outlet of a discharge coefficient of 1.
            figure("outlet_area", "outflow / sqrt(2 * 9.80665)", "m^2"),
        ],
        process: vec![("level", 0, 0.1)],
        ..Draft::default()
    }
}
