//! A heat exchanger with a flow that is heated, or cooled, by a medium of one temperature.
//!
//! ```text
//! M dT/dt = m (T_in - T) + (UA/cp) (m/m_mean)^n (T_medium - T)          m the flow, T the outlet's temperature
//! ```
//!
//! The holdup M is mixed, so that T is the temperature at the outlet.

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::{Run, Task};
use super::{Column, Setting, Template};
use crate::Error;

const FLOW: usize = 0;
const OUTLET: usize = 1;
const INLET: usize = 2;
const MEDIUM: usize = 3;

pub(super) static EXCHANGER: Template = Template {
    name: "exchanger",
    title: "a heat exchanger whose flow changes: holdup, UA and effectiveness",
    columns: &[
        Column {
            name: "flow",
            unit: "kg/s",
            meaning: "flow that is heated or cooled",
            optional: false,
            aliases: &["m", "mdot", "u", "flow_rate", "flowrate", "q"],
        },
        Column {
            name: "outlet",
            unit: "degC",
            meaning: "temperature at the outlet",
            optional: false,
            aliases: &["temperature", "t_out", "tout", "outlet_temperature", "y", "temp"],
        },
        Column {
            name: "inlet",
            unit: "degC",
            meaning: "temperature at the inlet; else one that does not change is found",
            optional: true,
            aliases: &["t_in", "tin", "inlet_temperature"],
        },
        Column {
            name: "medium",
            unit: "degC",
            meaning: "temperature of the other side, such as steam; else one that does not change is found",
            optional: true,
            aliases: &["steam", "hot", "t_hot", "steam_temperature", "t_steam", "jacket", "t_jacket"],
        },
    ],
    settings: &[
        Setting {
            name: "heat_capacity",
            unit: "J/(kg K)",
            default: Some(4186.0),
            meaning: "of the flow; that of water",
        },
        Setting {
            name: "exponent",
            unit: "",
            default: Some(0.0),
            meaning: "n: how UA grows with the flow, 0.8 where the flow's side decides in a turbulent flow",
        },
    ],
    parameters: &[
        ("holdup", "kg"),
        ("ua", "W/K"),
        ("inlet_temperature", "degC"),
        ("medium_temperature", "degC"),
    ],
    draft,
};

fn draft(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    [FLOW, OUTLET].iter().try_for_each(|column| task.must_move(*column))?;
    let capacity = task.positive("heat_capacity")?;
    let exponent = task.setting("exponent");
    let mean = task.mean(FLOW);
    if !(mean > 0.0 && task.range(FLOW).0 >= 0.0) {
        return Err(Error::in_channel(
            task.channel(FLOW),
            None,
            "the flow must not be below 0, nor 0 all the time",
        ));
    }
    // The flow is held from row to row, while the temperature goes on: their product is taken as the flow is.
    let share = move |run: &Run, row: usize| {
        if exponent == 0.0 { 1.0 } else { (run.values[FLOW][row].max(1e-9 * mean) / mean).powf(exponent) }
    };
    let flow = |run: &Run, row: usize| run.values[FLOW][row];
    let value = |run: &Run, column: usize, row: usize| run.values[column][row];
    let outlet = Term::smooth(task, 1, |run, row| run.values[OUTLET][row]);
    let mut right = if task.has(INLET) {
        vec![Term::held(task, 0, |run, row| {
            flow(run, row) * (value(run, INLET, row) - value(run, OUTLET, row))
        })]
    } else {
        vec![
            Term::held(task, 0, |run, row| -flow(run, row) * value(run, OUTLET, row)),
            Term::held(task, 0, flow),
        ]
    };
    if task.has(MEDIUM) {
        right.push(Term::held(task, 0, |run, row| {
            share(run, row) * (value(run, MEDIUM, row) - value(run, OUTLET, row))
        }));
    } else {
        right.push(Term::held(task, 0, |run, row| -share(run, row) * value(run, OUTLET, row)));
        right.push(Term::held(task, 0, share));
    }
    let mut drafts = Vec::new();
    for length in lengths(task) {
        let Some(theta) = regress(task, length, &outlet, &right, None) else { continue };
        let mut theta = theta.into_iter();
        let mut next = || theta.next().unwrap_or(f64::NAN);
        let inverse = next();
        let inlet = if task.has(INLET) { 0.0 } else { next() / inverse };
        let transfer = next();
        let medium = if task.has(MEDIUM) { 0.0 } else { next() / transfer };
        if inverse > 0.0 && transfer > 0.0 {
            drafts.push(written(task, [1.0 / inverse, transfer / inverse * capacity, inlet, medium], mean));
        }
    }
    if drafts.is_empty() {
        let message = "the temperature does not follow the flow as that of a heat exchanger does: more flow must bring the outlet nearer to \
                       the inlet; are the columns right, and does the flow change enough?";
        return Err(Error::undetermined(["holdup", "ua"].map(str::to_owned).to_vec(), message));
    }
    Ok(drafts)
}

fn written(task: &Task<'_>, [holdup, ua, inlet, medium]: [f64; 4], mean: f64) -> Draft {
    let (start, far) = task.first(OUTLET);
    let deviation = far + 3.0 * task.noise(OUTLET) + 0.01 * task.span(OUTLET);
    let mut parameters =
        vec![Parameter::positive("holdup", "kg", holdup), Parameter::positive("ua", "W/K", ua)];
    let mut inputs = vec![("flow", FLOW)];
    let mut from = |name: &'static str, found: &'static str, column: usize, value: f64| {
        if task.has(column) {
            inputs.push((name, column));
            name
        } else {
            parameters.push(Parameter::free(found, "degC", value, task.span(OUTLET)));
            found
        }
    };
    let inlet = from("inlet", "inlet_temperature", INLET, inlet);
    let medium = from("medium", "medium_temperature", MEDIUM, medium);
    let exponent = task.setting("exponent");
    let share = if exponent == 0.0 { "" } else { " * (max(flow, 1e-9 * mean_flow) / mean_flow)^exponent" };
    parameters.push(Parameter::known("heat_capacity", "J/(kg K)", task.setting("heat_capacity")));
    parameters.push(Parameter::known("exponent", "", exponent));
    parameters.push(Parameter::known("mean_flow", "kg/s", mean));
    let rate = (task.largest(FLOW) + ua / task.setting("heat_capacity")) / holdup;
    Draft {
        about: vec!["A heat exchanger whose holdup is mixed.".to_owned()],
        states: vec![State { name: "outlet", unit: "degC", start, deviation }],
        inputs,
        parameters,
        substeps: (task.step * rate).ceil().clamp(1.0, 20.0) as usize,
        equations: vec![(
            "outlet",
            format!("(flow * ({inlet} - outlet) + ua / heat_capacity{share} * ({medium} - outlet)) / holdup"),
        )],
        outputs: vec![Output { column: OUTLET, expression: "outlet".to_owned(), noise: task.noise(OUTLET) }],
        figures: vec![
            // At the mean flow.
            figure("transfer_units", "ua / (heat_capacity * mean_flow)", ""),
            figure("effectiveness", "transfer_units / (1 + transfer_units)", ""),
            figure("time_constant", "holdup / (mean_flow + ua / heat_capacity)", "s"),
            figure("residence_time", "holdup / mean_flow", "s"),
        ],
        process: vec![("outlet", 0, 0.1)],
        ..Draft::default()
    }
}
