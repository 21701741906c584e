//! The heat of a room.
//!
//! ```text
//! C dT/dt = (T_out - T)/R + P + A S                                     one state
//! C dT/dt = (T_w - T)/R_i + P + A S,  C_w dT_w/dt = (T - T_w)/R_i + (T_out - T_w)/R_o      two states, T_w of the walls
//! ```
//!
//! Source: Bacher and Madsen, Identifying suitable models for the heat dynamics of buildings, Energy and Buildings 43,
//! 2011: the models TiTe and simpler ones.

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::{Term, lengths, regress};
use super::task::Task;
use super::{Column, Template};
use crate::Error;

const TEMPERATURE: usize = 0;
const HEATER: usize = 1;
const OUTDOOR: usize = 2;
const SUN: usize = 3;

const COLUMNS: &[Column] = &[
    Column {
        name: "temperature",
        unit: "degC",
        meaning: "temperature of the room",
        optional: false,
        aliases: &[
            "temp",
            "t_in",
            "ti",
            "t_room",
            "indoor",
            "indoor_temperature",
            "room_temperature",
            "t_indoor",
            "tin",
            "t1",
        ],
    },
    Column {
        name: "heater",
        unit: "W",
        meaning: "power of the heater",
        optional: false,
        aliases: &["power", "heating", "heat", "ph", "p", "q", "heater_power", "heating_power", "q1"],
    },
    Column {
        name: "outdoor",
        unit: "degC",
        meaning: "temperature outside; else one that does not change is found",
        optional: true,
        aliases: &[
            "t_out",
            "ta",
            "t_outdoor",
            "outdoor_temperature",
            "ambient",
            "ambient_temperature",
            "outside",
            "tout",
        ],
    },
    Column {
        name: "sun",
        unit: "W/m2",
        meaning: "radiation of the sun",
        optional: true,
        aliases: &["solar", "gs", "ghi", "irradiance", "radiation", "solar_radiation", "sunshine"],
    },
];

pub(super) static ROOM: Template = Template {
    name: "room",
    title: "a room with one heat capacity, a heater, and the sun if it is there",
    columns: COLUMNS,
    settings: &[],
    parameters: &[("resistance", "K/W"), ("capacity", "J/K"), ("aperture", "m^2"), ("outside", "degC")],
    draft: one,
};

pub(super) static ROOM_TWO: Template = Template {
    name: "room2",
    title: "a room with two heat capacities, air and walls, a heater, and the sun if it is there",
    columns: COLUMNS,
    settings: &[],
    parameters: &[
        ("resistance_inside", "K/W"),
        ("resistance_outside", "K/W"),
        ("capacity_air", "J/K"),
        ("capacity_walls", "J/K"),
        ("aperture", "m^2"),
        ("outside", "degC"),
    ],
    draft: two,
};

/// The terms of heater, sun, and the temperature outside, differentiated so often.
fn drives(task: &Task<'_>, derivative: usize) -> Vec<Term> {
    let held = |column: usize| Term::held(task, derivative, move |run, row| run.values[column][row]);
    let mut all = vec![held(HEATER)];
    if task.has(SUN) {
        all.push(held(SUN));
    }
    all
}

/// The temperature outside, or 1 where it is a parameter.
fn outside(task: &Task<'_>) -> Term {
    match task.has(OUTDOOR) {
        true => Term::held(task, 0, |run, row| run.values[OUTDOOR][row]),
        false => Term::smooth(task, 0, |_, _| 1.0),
    }
}

fn temperature(task: &Task<'_>, derivative: usize) -> Term {
    Term::smooth(task, derivative, |run, row| run.values[TEMPERATURE][row])
}

fn check(task: &Task<'_>) -> Result<(), Error> {
    [TEMPERATURE, HEATER].iter().try_for_each(|column| task.must_move(*column))
}

/// What has no candidate.
fn hopeless() -> Error {
    let message = "the temperature does not rise with the heater as that of a room does: is the heater's column the power that goes into it, \
                   and does the log show it switched on and off for long enough?";
    Error::undetermined(["resistance", "capacity"].map(str::to_owned).to_vec(), message)
}

fn one(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    check(task)?;
    let mut drafts = Vec::new();
    let first = task.first(TEMPERATURE).0;
    for length in lengths(task) {
        // dT/dt = P/C + A S/C + (T_out - T)/(R C)
        let mut right = drives(task, 0);
        if task.has(OUTDOOR) {
            right.push(Term::smooth(task, 0, |run, row| {
                run.values[OUTDOOR][row] - run.values[TEMPERATURE][row]
            }));
        } else {
            right.push(Term::smooth(task, 0, move |run, row| first - run.values[TEMPERATURE][row]));
            right.push(outside(task));
        }
        let Some(theta) = regress(task, length, &temperature(task, 1), &right, None) else { continue };
        let capacity = 1.0 / theta[0];
        let sun = usize::from(task.has(SUN));
        let aperture = if sun == 1 { theta[1] * capacity } else { 0.0 };
        let loss = theta[1 + sun];
        if !(capacity > 0.0 && loss > 0.0) {
            continue;
        }
        let ambient = theta.get(2 + sun).map_or(0.0, |level| first + level / loss);
        drafts.push(written_one(task, 1.0 / (loss * capacity), capacity, aperture, ambient));
    }
    if drafts.is_empty() { Err(hopeless()) } else { Ok(drafts) }
}

/// What both have: states, inputs, and the parameters of sun and outside.
fn common(task: &Task<'_>, aperture: f64, ambient: f64) -> (Draft, &'static str, &'static str) {
    let (start, far) = task.first(TEMPERATURE);
    let deviation = far + 3.0 * task.noise(TEMPERATURE) + 0.01 * task.span(TEMPERATURE);
    let mut draft = Draft {
        states: vec![State { name: "temperature", unit: "degC", start, deviation }],
        inputs: vec![("heater", HEATER)],
        outputs: vec![Output {
            column: TEMPERATURE,
            expression: "temperature".to_owned(),
            noise: task.noise(TEMPERATURE),
        }],
        process: vec![("temperature", 0, 0.1)],
        ..Draft::default()
    };
    let mut sunshine = "";
    if task.has(SUN) {
        draft.inputs.push(("sun", SUN));
        draft.parameters.push(Parameter::free(
            "aperture",
            "m^2",
            aperture,
            aperture.abs() + 1e-3 * task.largest(HEATER) / task.largest(SUN).max(1e-9),
        ));
        sunshine = " + aperture * sun";
    }
    let outside = if task.has(OUTDOOR) {
        draft.inputs.push(("outdoor", OUTDOOR));
        "outdoor"
    } else {
        draft.parameters.push(Parameter::free("outside", "degC", ambient, task.span(TEMPERATURE)));
        "outside"
    };
    (draft, sunshine, outside)
}

fn written_one(task: &Task<'_>, resistance: f64, capacity: f64, aperture: f64, ambient: f64) -> Draft {
    let (mut draft, sunshine, outside) = common(task, aperture, ambient);
    draft.about = vec!["A room with one heat capacity.".to_owned()];
    draft.parameters.insert(0, Parameter::positive("resistance", "K/W", resistance));
    draft.parameters.insert(1, Parameter::positive("capacity", "J/K", capacity));
    draft.equations = vec![(
        "temperature",
        format!("(({outside} - temperature) / resistance + heater{sunshine}) / capacity"),
    )];
    draft.substeps = (task.step / (resistance * capacity)).ceil().clamp(1.0, 20.0) as usize;
    draft.figures = vec![
        figure("heat_loss", "1 / resistance", "W/K"),
        figure("time_constant", "resistance * capacity / 3600", "h"),
        figure("capacity_kwh", "capacity / 3.6e6", "kWh/K"),
    ];
    draft
}

fn two(task: &Task<'_>) -> Result<Vec<Draft>, Error> {
    check(task)?;
    let mut drafts = Vec::new();
    let sun = usize::from(task.has(SUN));
    let first = task.first(TEMPERATURE).0;
    for length in lengths(task) {
        // T'' = -a1 T' - a0 T + b1 P' + b0 P + s1 S' + s0 S + a0 T_out
        let mut right = vec![temperature(task, 1)];
        right.extend(drives(task, 1));
        right.extend(drives(task, 0));
        if task.has(OUTDOOR) {
            right.push(Term::smooth(task, 0, |run, row| {
                run.values[OUTDOOR][row] - run.values[TEMPERATURE][row]
            }));
        } else {
            right.push(Term::smooth(task, 0, move |run, row| first - run.values[TEMPERATURE][row]));
            right.push(outside(task));
        }
        let Some(theta) = regress(task, length, &temperature(task, 2), &right, None) else { continue };
        let (a1, b1, b0, a0) = (-theta[0], theta[1], theta[2 + sun], theta[3 + 2 * sun]);
        let s1 = if sun == 1 { theta[2] } else { 0.0 };
        let ambient = theta.get(4 + 2 * sun).map_or(0.0, |level| first + level / a0);
        // b1 = 1/C, b0/b1 = (1/R_i + 1/R_o)/C_w = m, a1 = 1/(R_i C) + m, b0/a0 = R_i + R_o.
        let (capacity, m) = (1.0 / b1, b0 / b1);
        let inside = 1.0 / (capacity * (a1 - m));
        let outer = b0 / a0 - inside;
        let walls = (1.0 / inside + 1.0 / outer) / m;
        if [capacity, m, inside, outer, walls].iter().all(|value| *value > 0.0) {
            drafts.push(written_two(task, [inside, outer, capacity, walls], s1 * capacity, ambient));
        }
    }
    // The walls take from what one capacity has: the short windows see the air alone, the long ones all.
    let single = one(task)?;
    for draft in &single {
        let value =
            |name: &str| draft.parameters.iter().find(|own| own.name == name).map_or(0.0, |own| own.start);
        let (r, c) = (value("resistance"), value("capacity"));
        for (share, part) in [(0.05, 0.1), (0.2, 0.1), (0.1, 0.3), (0.4, 0.3)] {
            let values = [part * r, (1.0 - part) * r, share * c, (1.0 - share) * c];
            drafts.push(written_two(task, values, value("aperture"), value("outside")));
        }
    }
    Ok(drafts)
}

fn written_two(
    task: &Task<'_>,
    [inside, outer, capacity, walls]: [f64; 4],
    aperture: f64,
    ambient: f64,
) -> Draft {
    let (mut draft, sunshine, outside) = common(task, aperture, ambient);
    draft.about =
        vec!["A room with two heat capacities: air, and walls between it and the outside.".to_owned()];
    let State { start, .. } = draft.states[0];
    // Between the room and the outside, at rest.
    let beyond = if task.has(OUTDOOR) { task.first(OUTDOOR).0 } else { ambient };
    let wall = start + (beyond - start) * inside / (inside + outer);
    let deviation = 0.3 * (start - beyond).abs() + 0.1 * task.span(TEMPERATURE);
    draft.states.push(State { name: "walls", unit: "degC", start: wall, deviation });
    let own = [
        ("resistance_inside", "K/W", inside),
        ("resistance_outside", "K/W", outer),
        ("capacity_air", "J/K", capacity),
        ("capacity_walls", "J/K", walls),
    ];
    let own = own.map(|(name, unit, value)| Parameter::positive(name, unit, value));
    draft.parameters.splice(0..0, own);
    draft.equations = vec![
        (
            "temperature",
            format!("((walls - temperature) / resistance_inside + heater{sunshine}) / capacity_air"),
        ),
        (
            "walls",
            format!(
                "((temperature - walls) / resistance_inside + ({outside} - walls) / resistance_outside) / capacity_walls"
            ),
        ),
    ];
    draft.substeps = (task.step / (inside * capacity)).ceil().clamp(1.0, 20.0) as usize;
    draft.figures = vec![
        figure("heat_loss", "1 / (resistance_inside + resistance_outside)", "W/K"),
        // The eigenvalues of the two balances.
        figure("_a", "1 / (resistance_inside * capacity_air)", ""),
        figure("_b", "1 / (resistance_inside * capacity_walls)", ""),
        figure("_c", "1 / (resistance_outside * capacity_walls)", ""),
        figure("_root", "sqrt((_a + _b + _c)^2 - 4 * _a * _c)", ""),
        figure("slow_time_constant", "(_a + _b + _c + _root) / (2 * _a * _c) / 3600", "h"),
        figure("fast_time_constant", "2 / (_a + _b + _c + _root) / 3600", "h"),
    ];
    draft
}
