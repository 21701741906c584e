//! A model in blocks as a text of equations.

use std::fmt::Write;

use super::curve::Curve;
use super::machine::{Machine, Run};
use super::{BlockStructure, Levels, Trained};
use crate::model::toml_text;

/// A gain at rest below this part of what its terms are in size is that of a filter that lets nothing through at rest.
const NO_GAIN: f64 = 1e-3;

/// How the scale of a linear system is fixed.
enum Fixed {
    /// The place whose value follows from a gain of 1 at rest, and the expression.
    Gain(usize, String),
    /// The place that stays as it is.
    Value(usize),
}

/// The text, with what was found as start values.
pub(super) fn written(
    trained: &Trained,
    runs: &[Run],
    (inputs, output): (&[String], &str),
    (offsets, sample_time): (&Levels, f64),
) -> String {
    let mut trained = trained.clone();
    let fixed = scaled(&mut trained);
    let Trained { shape, machine, theta, .. } = &trained;
    let (n, m, q) = (machine.states, machine.inputs, machine.curves.len());
    let mut text = String::new();
    let title = match shape.structure {
        BlockStructure::Hammerstein => "A Hammerstein model: a curve of each input, then a linear system.",
        BlockStructure::Wiener => "A Wiener model: a linear system, then a curve.",
        BlockStructure::WienerHammerstein => {
            "A Wiener-Hammerstein model: a curve between two linear systems."
        }
        BlockStructure::Feedback => "A linear system around a curve w of z.",
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "# {title}\nsample_time = {sample_time}\n\n[states]");
    for (state, (mean, deviation)) in spread(&trained, runs).into_iter().enumerate() {
        let _ = writeln!(text, "x{} = {{ start = {mean:e}, sd = {deviation:e} }}", state + 1);
    }
    text.push_str("\n[inputs]\n");
    let own = |letter: &str, index: usize, count: usize| {
        if count > 1 { format!("{letter}{}", index + 1) } else { letter.to_owned() }
    };
    for (index, channel) in inputs.iter().enumerate() {
        let _ = writeln!(text, "{} = {}", own("u", index, m), toml_text(channel));
    }
    text.push_str("\n[parameters]\n");
    let mut parameter = |name: &str, value: f64, deviation: f64, unit: &str| {
        let unit = if unit.is_empty() { String::new() } else { format!(", unit = {}", toml_text(unit)) };
        let sd = deviation.max(value.abs()).max(f64::MIN_POSITIVE);
        let _ = writeln!(text, "{name} = {{ start = {value:e}, sd = {sd:e}, unknown = true{unit} }}");
    };
    for (index, (place, value)) in machine.places.iter().zip(theta).enumerate() {
        let is_fixed =
            |fixed: &Fixed| matches!(fixed, Fixed::Gain(own, _) | Fixed::Value(own) if *own == index);
        if !fixed.iter().any(is_fixed) {
            parameter(&place.name, *value, 0.0, "");
        }
    }
    for (index, curve) in machine.curves.iter().enumerate() {
        let numbers = &theta[machine.numbers(index)];
        let size = numbers.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let letter = own("w", index, q);
        for (name, unit, value) in named(curve, &letter, numbers) {
            parameter(&name, value, size, &unit);
        }
    }
    let inputs_of = |input: usize| {
        let name = own("u", input, m);
        let late = shape.delays[input].saturating_sub(1);
        let name = if late > 0 { format!("{name}(t - {})", late as f64 * sample_time) } else { name };
        match offsets.inputs[input] {
            0.0 => name,
            offset => format!("({name} - {offset})"),
        }
    };
    let signals: Vec<String> = (0..n)
        .map(|state| format!("x{}", state + 1))
        .chain((0..m).map(inputs_of))
        .chain((0..q).map(|curve| own("w", curve, q)))
        .collect();
    text.push_str("\n[signals]\n");
    for (index, curve) in machine.curves.iter().enumerate() {
        let z = own("z", index, q);
        let _ = writeln!(text, "{z} = \"{}\"", sum(machine, theta, &fixed, n + index, &signals));
        let _ = writeln!(text, "{} = \"{}\"", own("w", index, q), form(curve, &z, &own("w", index, q)));
    }
    text.push_str("\n[next]\n");
    for state in 0..n {
        let _ = writeln!(text, "x{} = \"{}\"", state + 1, sum(machine, theta, &fixed, state, &signals));
    }
    let seen = sum(machine, theta, &fixed, n + q, &signals);
    let seen = if offsets.output == 0.0 { seen } else { format!("{} + {seen}", offsets.output) };
    let noise = (trained.cost / trained.samples as f64).sqrt().max(1e-9 * size_of(runs)).max(1e-12);
    let channel = toml_text(output);
    let _ = writeln!(text, "\n[outputs]\n{channel} = \"{seen}\"\n");
    let _ = writeln!(
        text,
        "[noise]\nmeasurement = {{ {channel} = {{ start = {noise:e}, unknown = true, min = {:e} }} }}",
        noise / 10.0
    );
    text
}

/// The largest output.
fn size_of(runs: &[Run]) -> f64 {
    let measured = runs.iter().flat_map(|run| &run.output).filter(|value| value.is_finite());
    measured.fold(0.0, |largest: f64, value| largest.max(value.abs()))
}

/// Where each state starts, and its standard deviation over the runs: of one run, where it did; of several, the mean.
fn spread(trained: &Trained, runs: &[Run]) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); trained.machine.states];
    let mut rows = 0.0;
    trained.walk(runs, |states, _| {
        rows += 1.0;
        for ((mean, squares), state) in sums.iter_mut().zip(states) {
            // Welford's recursion.
            let before = state - *mean;
            *mean += before / rows;
            *squares += before * (state - *mean);
        }
    });
    let largest = sums.iter().map(|(_, squares)| *squares).fold(0.0, f64::max);
    let deviation = |squares: f64| (squares.max(1e-6 * largest) / f64::max(rows, 1.0)).sqrt();
    let start = |state: usize, mean: f64| match runs {
        [_] => trained.starts[state],
        _ => mean,
    };
    let each = sums.into_iter().enumerate();
    each.map(|(state, (mean, squares))| (start(state, mean), deviation(squares).max(1e-12))).collect()
}

/// The numbers of a curve with their names, and where they are.
fn named(curve: &Curve, letter: &str, numbers: &[f64]) -> Vec<(String, String, f64)> {
    match curve {
        Curve::Lines { knots, pinned } => {
            let free = knots.iter().enumerate().filter(|(knot, _)| Some(*knot) != *pinned);
            let each = free.zip(numbers);
            each.map(|((knot, at), value)| {
                (format!("{letter}_{}", knot + 1), format!("at {}", short(*at)), *value)
            })
            .collect()
        }
        Curve::Polynomial { powers, .. } => {
            let each = powers.iter().zip(numbers);
            each.map(|(power, value)| (format!("{letter}_{power}"), String::new(), *value)).collect()
        }
    }
}

/// A curve as an expression.
fn form(curve: &Curve, z: &str, letter: &str) -> String {
    match curve {
        Curve::Lines { knots, pinned } => {
            let value = |knot: usize| {
                if Some(knot) == *pinned { "0".to_owned() } else { format!("{letter}_{}", knot + 1) }
            };
            // Straight on beyond an end, through it and the knot before.
            let beyond = |at: f64, end: usize, before: usize| {
                let times = (at - knots[end]) / (knots[end] - knots[before]);
                let (end, before) = (value(end), value(before));
                format!("{at:e}:{end} + {times:e} * ({end} - {before})")
            };
            let ([low, high], last) = (Curve::reach(knots), knots.len() - 1);
            let inside = knots.iter().enumerate().map(|(knot, at)| format!("{at:e}:{}", value(knot)));
            let each = std::iter::once(beyond(low, 0, 1)).chain(inside).chain(std::iter::once(beyond(
                high,
                last,
                last - 1,
            )));
            format!("lines({z}; {})", each.collect::<Vec<_>>().join(", "))
        }
        Curve::Polynomial { middle, scale, powers } => {
            let term = |power: &i32| match power {
                0 => format!("{letter}_0"),
                1 => format!("{letter}_1 * (({z} - {middle}) / {scale})"),
                _ => format!("{letter}_{power} * (({z} - {middle}) / {scale})^{power}"),
            };
            powers.iter().map(term).collect::<Vec<_>>().join(" + ")
        }
    }
}

/// A row of the matrix as an expression.
fn sum(machine: &Machine, theta: &[f64], fixed: &[Fixed], row: usize, signals: &[String]) -> String {
    let mut text = String::new();
    for (column, signal) in signals.iter().enumerate().take(machine.width()) {
        let place = machine.places.iter().position(|place| (place.row, place.column) == (row, column));
        let (sign, factor) = match place {
            None if machine.is_known_one(row, column) => (1.0, String::new()),
            None => continue,
            Some(index) => {
                let own = fixed.iter().find_map(|fixed| match fixed {
                    Fixed::Gain(place, expression) if *place == index => Some(format!("({expression}) * ")),
                    Fixed::Value(place) if *place == index => Some(format!("{:e} * ", theta[index])),
                    _ => None,
                });
                let place = &machine.places[index];
                (place.sign, own.unwrap_or_else(|| format!("{} * ", place.name)))
            }
        };
        text.push_str(match (text.is_empty(), sign < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        });
        text.push_str(&factor);
        text.push_str(signal);
    }
    text
}

/// Shares the scales of linear systems and curves as they are written, and says what follows from the others.
fn scaled(trained: &mut Trained) -> Vec<Fixed> {
    let (n, m) = (trained.machine.states, trained.machine.inputs);
    match trained.shape.structure {
        BlockStructure::Hammerstein => {
            let last = n + trained.machine.curves.len();
            (0..m).map(|input| trained.after(n + m + input, last, input)).collect()
        }
        BlockStructure::Wiener => vec![trained.before(n, n)],
        BlockStructure::WienerHammerstein => vec![trained.before(n, n), trained.after(n + m, n + 1, 0)],
        BlockStructure::Feedback => {
            let Trained { machine, theta, .. } = trained;
            let of_w = |place: &usize| machine.places[*place].column == n + m;
            let largest = (0..machine.places.len())
                .filter(of_w)
                .max_by(|one, other| theta[*one].abs().total_cmp(&theta[*other].abs()));
            let Some(largest) = largest.filter(|largest| theta[*largest] != 0.0) else { return Vec::new() };
            let scale = theta[largest];
            let places: Vec<usize> = (0..machine.places.len()).filter(of_w).collect();
            places.into_iter().for_each(|place| theta[place] /= scale);
            let numbers = machine.numbers(0);
            theta[numbers].iter_mut().for_each(|number| *number *= scale);
            vec![Fixed::Value(largest)]
        }
    }
}

/// The entries of a linear system: of one input to one output.
struct System {
    /// Those of the input, the direct one last if there is one.
    entries: Vec<usize>,
    has_direct: bool,
    denominator: Vec<usize>,
}

impl Trained {
    /// The system from a signal to a row of the matrix.
    fn system(&self, column: usize, row: usize) -> System {
        let n = self.machine.states;
        let of = |wanted: &dyn Fn(usize, usize) -> bool| -> Vec<usize> {
            let each = self.machine.places.iter().enumerate();
            each.filter(|(_, place)| wanted(place.row, place.column)).map(|(index, _)| index).collect()
        };
        let mut entries = of(&|own, other| own < n && other == column);
        let states: Vec<usize> = entries.iter().map(|entry| self.machine.places[*entry].row).collect();
        let direct = of(&|own, other| own == row && other == column);
        let has_direct = !direct.is_empty();
        entries.extend(direct);
        let first = states.first().copied().unwrap_or(0);
        System { entries, has_direct, denominator: of(&|own, other| states.contains(&own) && other == first) }
    }

    /// Its gain at rest; none where it has none or grows.
    fn gain(&self, system: &System) -> Option<f64> {
        let states = system.entries.len() - usize::from(system.has_direct);
        let b = || system.entries[..states].iter().map(|entry| self.theta[*entry]);
        let denominator = 1.0 + system.denominator.iter().map(|entry| self.theta[*entry]).sum::<f64>();
        let direct = system.entries[states..].iter().map(|entry| self.theta[*entry]).sum::<f64>();
        let sum = b().sum::<f64>() + direct * denominator;
        let size = b().map(f64::abs).sum::<f64>() + (direct * denominator).abs();
        let is_there = sum.abs() > NO_GAIN * size && denominator > 1.0 / self.samples as f64;
        is_there.then_some(sum / denominator)
    }

    /// What is fixed of a system whose gain at rest is 1, or has none.
    fn fixed(&self, system: &System) -> Fixed {
        let states = system.entries.len() - usize::from(system.has_direct);
        let name = |entry: &usize| self.machine.places[*entry].name.clone();
        if self.gain(system).is_none() || states == 0 {
            let largest = system
                .entries
                .iter()
                .max_by(|one, other| self.theta[**one].abs().total_cmp(&self.theta[**other].abs()));
            return Fixed::Value(largest.copied().unwrap_or(0));
        }
        let mut expression = String::from("1");
        system.denominator.iter().for_each(|entry| expression.push_str(&format!(" + {}", name(entry))));
        if let [direct] = &system.entries[states..] {
            expression = format!("({expression}) * (1 - {})", name(direct));
        }
        system.entries[..states - 1]
            .iter()
            .for_each(|entry| expression.push_str(&format!(" - {}", name(entry))));
        Fixed::Gain(system.entries[states - 1], expression)
    }

    /// Gives the gain of a system after a curve to the curve.
    fn after(&mut self, column: usize, row: usize, curve: usize) -> Fixed {
        let system = self.system(column, row);
        if let Some(gain) = self.gain(&system) {
            system.entries.iter().for_each(|entry| self.theta[*entry] /= gain);
            let numbers = self.machine.numbers(curve);
            self.theta[numbers].iter_mut().for_each(|number| *number *= gain);
        }
        self.fixed(&system)
    }

    /// Gives the gain of the first input to the argument of the curve behind it, and what it says of the others.
    fn before(&mut self, column: usize, row: usize) -> Fixed {
        let system = self.system(column, row);
        if let Some(gain) = self.gain(&system) {
            for input in 0..self.machine.inputs {
                let own = self.system(column + input, row);
                own.entries.iter().for_each(|entry| self.theta[*entry] /= gain);
            }
            // What the signals say too.
            for state in 0..self.starts.len() {
                if self.is_of(&system, state % self.machine.states) {
                    self.starts[state] /= gain;
                }
            }
            let numbers = self.machine.numbers(0);
            let values = &mut self.theta[numbers];
            match &mut self.machine.curves[0] {
                Curve::Lines { knots, .. } => {
                    knots.iter_mut().for_each(|knot| *knot /= gain);
                    if gain < 0.0 {
                        knots.reverse();
                        values.reverse();
                    }
                }
                Curve::Polynomial { middle, scale, powers } => {
                    *middle /= gain;
                    *scale /= gain.abs();
                    if gain < 0.0 {
                        let odd = powers.iter().zip(values).filter(|(power, _)| **power % 2 != 0);
                        odd.for_each(|(_, value)| *value = -*value);
                    }
                }
            }
        }
        self.fixed(&system)
    }

    /// Whether a state is one of a system.
    fn is_of(&self, system: &System, state: usize) -> bool {
        system.entries.iter().any(|entry| self.machine.places[*entry].row == state)
    }
}

/// A number with four digits.
fn short(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value) + 0.0
}
