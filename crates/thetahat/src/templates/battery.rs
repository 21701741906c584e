//! A battery: an open-circuit voltage that depends on the state of charge, a resistance, and one or two resistances
//! with capacitors beside them.
//!
//! ```text
//! d soc/dt = i/(3600 Q)      dv_j/dt = (R_j i - v_j)/T_j      v = OCV(soc) + R0 i + v_1 + v_2
//! ```
//!
//! With the time constants T_j given, the voltage is linear in all the rest: in the values of the table of the
//! open-circuit voltage at its knots, in R0, and in R_j by the current through a first-order lag. The starting
//! procedure tries time constants on a grid, and as many knots as Schwarz's criterion is for.
//!
//! Source: Plett, Battery Management Systems I, 2015, sections 2.3 to 2.10.

use super::draft::{Draft, Output, Parameter, State, figure};
use super::modulated::solve;
use super::task::{Run, Task, above_zero};
use super::{Column, Setting, Template};
use crate::Error;

const CURRENT: usize = 0;
const VOLTAGE: usize = 1;

const COLUMNS: &[Column] = &[
    Column {
        name: "current",
        unit: "A",
        meaning: "current; in charge or in discharge above 0, which the log shows",
        optional: false,
        aliases: &[
            "i",
            "amps",
            "amp",
            "i_batt",
            "batt_current",
            "battery_current",
            "cell_current",
            "pack_current",
        ],
    },
    Column {
        name: "voltage",
        unit: "V",
        meaning: "voltage at the terminals",
        optional: false,
        aliases: &[
            "v",
            "u",
            "volts",
            "volt",
            "batt_voltage",
            "battery_voltage",
            "cell_voltage",
            "terminal_voltage",
            "pack_voltage",
        ],
    },
];
const SETTINGS: &[Setting] = &[
    Setting {
        name: "capacity",
        unit: "Ah",
        default: None,
        meaning: "capacity; else the charge between the fullest and the emptiest row of the log",
    },
    Setting {
        name: "first_soc",
        unit: "",
        default: None,
        meaning: "state of charge at the first row, 0 … 1; else such that the fullest row has 1",
    },
    Setting {
        name: "knots",
        unit: "",
        default: None,
        meaning: "knots of the table of the open-circuit voltage; else as many as the log is for",
    },
];

pub(super) static BATTERY: Template = Template {
    name: "battery",
    title: "a battery with its table of open-circuit voltages, a resistance, and one RC pair",
    columns: COLUMNS,
    settings: SETTINGS,
    parameters: &[("r0", "Ohm"), ("r1", "Ohm"), ("tau1", "s"), ("ocv_…", "V")],
    draft: |task| draft(task, 1),
};

pub(super) static BATTERY_TWO: Template = Template {
    name: "battery2",
    title: "a battery with its table of open-circuit voltages, a resistance, and two RC pairs",
    columns: COLUMNS,
    settings: SETTINGS,
    parameters: &[("r0", "Ohm"), ("r1", "Ohm"), ("tau1", "s"), ("r2", "Ohm"), ("tau2", "s"), ("ocv_…", "V")],
    draft: |task| draft(task, 2),
};

/// What is linear in the voltage, once the time constants are given.
struct Solution {
    taus: Vec<f64>,
    ocv: Vec<f64>,
    r0: f64,
    resistances: Vec<f64>,
    samples: f64,
    squares: f64,
    /// Of an error with the one before it.
    correlation: f64,
}

fn draft(task: &Task<'_>, pairs: usize) -> Result<Vec<Draft>, Error> {
    [CURRENT, VOLTAGE].iter().try_for_each(|column| task.must_move(*column))?;
    let sign = sign(task)?;
    // The charge that has gone in since the first row, in Ah.
    let charges: Vec<Vec<f64>> = task.runs.iter().map(|run| charge(run, sign)).collect();
    let (low, high) =
        charges.iter().flatten().fold((0.0_f64, 0.0_f64), |(low, high), q| (low.min(*q), high.max(*q)));
    let capacity = above_zero("capacity", task.known("capacity").unwrap_or(high - low))?;
    let first = task.known("first_soc").unwrap_or(1.0 - high / capacity);
    if !(-1e-9..=1.0 + 1e-9).contains(&first) {
        return Err(Error::argument("known", format!("first_soc is {first}; give one from 0 to 1")));
    }
    let (low, high) = (first + low / capacity, first + high / capacity);
    let span = task.runs.iter().filter_map(|run| run.time.last()).fold(0.0_f64, |span, last| span.max(*last));
    let fastest = 1.5 * task.step;
    let grid: Vec<f64> = (0..14)
        .map(|place| fastest * (0.3 * span / fastest).max(2.0).powf(f64::from(place) / 13.0))
        .collect();
    let taus: Vec<Vec<f64>> = if pairs == 1 {
        grid.iter().map(|tau| vec![*tau]).collect()
    } else {
        let pairs = grid
            .iter()
            .enumerate()
            .flat_map(|(place, fast)| grid.iter().skip(place + 2).map(move |slow| vec![*fast, *slow]));
        pairs.collect()
    };
    let counts: Vec<usize> = match task.known("knots") {
        Some(knots) if knots.fract() == 0.0 && (2.0..=40.0).contains(&knots) => vec![knots as usize],
        Some(knots) => {
            return Err(Error::argument(
                "known",
                format!("knots is {knots}; give a whole number from 2 to 40"),
            ));
        }
        None => vec![2, 3, 4, 6, 8, 11, 16],
    };
    let problem = Problem { task, charges: &charges, capacity, first, sign };
    let knots = |count: usize| -> Vec<f64> {
        (0..count).map(|place| low + (high - low) * place as f64 / (count - 1) as f64).collect()
    };
    let sound = |found: &Solution| found.r0 > 0.0 && found.resistances.iter().all(|r| *r > 0.0);
    // Time constants first, with a table in the middle; the table with those that do best.
    let middle = knots(counts.get(counts.len() / 2).copied().unwrap_or(6));
    let mut ranked: Vec<(f64, &Vec<f64>)> = taus
        .iter()
        .filter_map(|taus| problem.solved(&middle, taus).filter(sound).map(|found| (found.squares, taus)))
        .collect();
    ranked.sort_by(|one, other| one.0.total_cmp(&other.0));
    ranked.truncate(4);
    let of_count = |count: &usize| {
        let knots = knots(*count);
        let each = ranked.iter().filter_map(|(_, taus)| problem.solved(&knots, taus).filter(sound));
        each.min_by(|one, other| one.squares.total_cmp(&other.squares)).map(|found| (found, knots))
    };
    let found: Vec<(Solution, Vec<f64>)> = counts.iter().filter_map(of_count).collect();
    // Schwarz's criterion; errors that go on from row to row are as few as their correlation says.
    let independent = found.last().map_or(1.0, |(found, _)| {
        found.samples * ((1.0 - found.correlation) / (1.0 + found.correlation)).clamp(0.001, 1.0)
    });
    let criterion = |(found, knots): &(Solution, Vec<f64>)| {
        independent * (found.squares / found.samples).max(1e-30).ln() + knots.len() as f64 * independent.ln()
    };
    let best = found.into_iter().min_by(|one, other| criterion(one).total_cmp(&criterion(other)));
    let Some((found, knots)) = best else {
        let message = "the log does not tell the resistances of the battery: it needs steps of the current, and rest after them; is the \
                       battery that of both columns, and the current in A?";
        return Err(Error::undetermined(["r0", "r1"].map(str::to_owned).to_vec(), message));
    };
    Ok(vec![written(task, &found, &knots, capacity, first, sign)])
}

/// 1 if the current is above 0 in charge, -1 if in discharge: the voltage steps as the current that goes in does.
fn sign(task: &Task<'_>) -> Result<f64, Error> {
    let steps = task.runs.iter().flat_map(|run| {
        let change = |column: usize, row: usize| run.values[column][row] - run.values[column][row - 1];
        (1..run.time.len()).map(move |row| change(CURRENT, row) * change(VOLTAGE, row))
    });
    let sum: f64 = steps.sum();
    if sum == 0.0 {
        return Err(Error::undetermined(
            vec!["r0".to_owned()],
            "the voltage does not change where the current steps: are the two columns those of one battery?",
        ));
    }
    Ok(sum.signum())
}

fn charge(run: &Run, sign: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = vec![0.0];
    for row in 1..run.time.len() {
        sum += sign * run.values[CURRENT][row - 1] * (run.time[row] - run.time[row - 1]) / 3600.0;
        all.push(sum);
    }
    all
}

/// The rows for one grid of time constants and knots.
struct Problem<'a> {
    task: &'a Task<'a>,
    charges: &'a [Vec<f64>],
    capacity: f64,
    first: f64,
    sign: f64,
}

impl Problem<'_> {
    fn solved(&self, knots: &[f64], taus: &[f64]) -> Option<Solution> {
        // Rows enough for the parameters, few enough for the grid.
        const MOST: usize = 4000;
        let total: usize = self.task.runs.iter().map(|run| run.time.len()).sum();
        let stride = total.div_ceil(MOST).max(1);
        let width = knots.len() + 1 + taus.len();
        let (mut rows, mut targets) = (Vec::new(), Vec::new());
        for (run, charges) in self.task.runs.iter().zip(self.charges) {
            let mut lags = vec![0.0; taus.len()];
            for (row, charge) in charges.iter().enumerate() {
                let current = self.sign * run.values[CURRENT][row];
                if row > 0 {
                    let dt = run.time[row] - run.time[row - 1];
                    let before = self.sign * run.values[CURRENT][row - 1];
                    for (lag, tau) in lags.iter_mut().zip(taus) {
                        *lag = before + (*lag - before) * (-dt / tau).exp();
                    }
                }
                // Rows around a step of the current tell the resistances.
                let steps = row > 0
                    && (run.values[CURRENT][row] - run.values[CURRENT][row - 1]).abs()
                        > 0.05 * self.task.span(CURRENT);
                if row % stride != 0 && !steps {
                    continue;
                }
                let soc = self.first + charge / self.capacity;
                let start = rows.len();
                rows.resize(start + width, 0.0);
                hats(knots, soc, &mut rows[start..start + knots.len()]);
                rows[start + knots.len()] = current;
                rows[start + knots.len() + 1..].copy_from_slice(&lags);
                targets.push(run.values[VOLTAGE][row]);
            }
        }
        let theta = solve(rows.clone(), targets.clone(), width)?;
        let errors = rows
            .chunks_exact(width)
            .zip(&targets)
            .map(|(row, target)| target - row.iter().zip(&theta).map(|(a, b)| a * b).sum::<f64>());
        let errors: Vec<f64> = errors.collect();
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        let products: f64 = errors.windows(2).map(|pair| pair[0] * pair[1]).sum();
        Some(Solution {
            taus: taus.to_vec(),
            squares,
            correlation: if squares > 0.0 { products / squares } else { 0.0 },
            samples: targets.len() as f64,
            ocv: theta[..knots.len()].to_vec(),
            r0: theta[knots.len()],
            resistances: theta[knots.len() + 1..].to_vec(),
        })
    }
}

/// The weights of the values at the knots, by straight lines between them.
fn hats(knots: &[f64], x: f64, weights: &mut [f64]) {
    let last = knots.len() - 1;
    let x = x.clamp(knots[0], knots[last]);
    let place = knots.iter().rposition(|knot| *knot <= x).unwrap_or(0).min(last - 1);
    let share = (x - knots[place]) / (knots[place + 1] - knots[place]);
    weights[place] = 1.0 - share;
    weights[place + 1] = share;
}

fn written(task: &Task<'_>, found: &Solution, knots: &[f64], capacity: f64, first: f64, sign: f64) -> Draft {
    let charging = if sign > 0.0 { "" } else { "-" };
    // Adding 0 makes 0 of -0.
    let rounded = |value: f64| -> f64 { format!("{value:.5}").parse().unwrap_or(value) + 0.0 };
    let mut states = vec![State { name: "soc", unit: "0 … 1", start: first, deviation: 0.0 }];
    let mut equations = vec![("soc", format!("soc + dt * {charging}current / (3600 * capacity)"))];
    let mut parameters = vec![Parameter::positive("r0", "Ohm", found.r0)];
    let mut voltage = format!("r0 * {charging}current");
    let sd = 0.1 * task.largest(CURRENT);
    for (place, (tau, r)) in found.taus.iter().zip(&found.resistances).enumerate() {
        let (name, resistance, constant) = [("v1", "r1", "tau1"), ("v2", "r2", "tau2")][place.min(1)];
        states.push(State { name, unit: "V", start: 0.0, deviation: sd * r });
        let end = format!("{resistance} * {charging}current");
        equations.push((name, format!("{end} + ({name} - {end}) * exp(-dt / {constant})")));
        parameters.push(Parameter::positive(resistance, "Ohm", *r));
        parameters.push(Parameter::positive(constant, "s", *tau));
        voltage = format!("{name} + {voltage}");
    }
    let mut table = Vec::new();
    for (place, (knot, value)) in knots.iter().zip(&found.ocv).enumerate() {
        let name = format!("ocv_{}", place + 1);
        table.push(format!("{}:{name}", rounded(*knot)));
        let unit = format!("V at {}", rounded(*knot));
        parameters.push(Parameter::free(name, unit, *value, 0.2 * task.span(VOLTAGE)));
    }
    parameters.push(Parameter::known("capacity", "Ah", capacity));
    let mut figures = vec![
        figure("capacitor1", "tau1 / r1", "F"),
        figure("resistance", "r0 + r1", "Ohm"),
        figure("capacity_used", "capacity", "Ah"),
    ];
    if found.taus.len() > 1 {
        figures[1] = figure("resistance", "r0 + r1 + r2", "Ohm");
        figures.insert(1, figure("capacitor2", "tau2 / r2", "F"));
    }
    let ends = [knots.first(), knots.last()].map(|end| end.map_or(0.0, |end| rounded(*end)));
    let current = if sign > 0.0 { "above 0 in charge" } else { "above 0 in discharge" };
    Draft {
        about: vec![
            format!("A battery; the current is {current}."),
            format!(
                "The log goes through states of charge from {} to {}: beyond them the table keeps its ends.",
                ends[0], ends[1]
            ),
        ],
        states,
        inputs: vec![("current", CURRENT)],
        parameters,
        next: true,
        equations,
        outputs: vec![Output {
            column: VOLTAGE,
            expression: format!("table(soc; {}) + {voltage}", table.join(", ")),
            noise: task.noise(VOLTAGE),
        }],
        figures,
        ..Draft::default()
    }
}
