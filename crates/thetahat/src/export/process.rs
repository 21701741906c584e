//! Processes in continuous time with held inputs, at their sample time T. With the dead time theta = m T - p, 0 <= p <
//! T, and the chain of lags of an input,
//!
//! ```text
//! c(t+1) = e^(A T) c(t) + int_0^T e^(A s) ds B u(t-m)
//! y(t)   = sum of w'(C (e^(A p) c(t) + int_0^p e^(A s) ds B u(t-m)) + D u(t-m))
//! ```
//!
//! (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 2.3), exact at the samples. A process has
//! been at rest with its first input before.

use super::program::{Array, Condition, Program, Statement, Variable};
use super::signals::Signals;
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::{Model, Parts, ProcessModel, ProcessStructure, State};

/// A dead time that is so many roundings longer than whole samples is no longer than these.
const ROUNDINGS: f64 = 8.0;
/// Samples of a dead time at most.
const LONGEST: f64 = 65_535.0;

/// The program of a model.
///
/// # Errors
/// [`Error::Report`] for an offset that moves; [`Error::Argument`] for what such a model has not.
pub(super) fn form(whole: &Model, model: &ProcessModel, purpose: Purpose) -> Result<Form, Error> {
    let name = match purpose {
        Purpose::Predictor => "predict",
        Purpose::Simulator => "step",
        _ => return Err(refused(purpose, "a process", "predictor or simulator")),
    };
    let mut program = Program::default();
    let signals = Signals::of(&mut program, whole)?;
    let started = program.memory("started", "1 after the first sample.", vec![0.0]);
    let mut equations = vec![model.name()];
    let mut body = Vec::new();
    let total = program.variable("total");
    body.push(Statement::Let(total, 0.0.into()));
    let each = model.structures.iter().zip(model.parts()).zip(&model.inputs).enumerate();
    for (input, ((structure, parts), signal)) in each {
        let own = Sampled::new(structure, &parts, model.sample_time)?;
        equations.push(format!(
            "'{}': {}, dead time {} s, which is {} samples less {} s",
            crate::text::harmless(&signal.name),
            structure.equation(),
            parts.dead_time,
            own.samples,
            own.ahead
        ));
        body.extend(own.statements(&mut program, &signals, (input, started), total));
    }
    body.push(Statement::Store(started, 0.into(), 1.0.into()));
    body.push(signals.say(&0.into(), total));
    let doc = "The next sample: takes u(k), and gives y(k). Past outputs say nothing of it.";
    program.entries = vec![signals.responds(name, doc, body)];
    Ok(Form { program, equations, start: "at rest with its first input".to_owned() })
}

/// The lags of an input, from sample to sample.
struct Sampled {
    /// m, and p in seconds.
    samples: usize,
    ahead: f64,
    states: usize,
    /// Row by row.
    f: Vec<f64>,
    g: Vec<f64>,
    c: Vec<f64>,
    d: f64,
    /// The state that an input of 1 has left m samples before the start.
    rest: Vec<f64>,
}

impl Sampled {
    fn new(structure: &ProcessStructure, parts: &Parts<f64>, time: f64) -> Result<Self, Error> {
        let samples = (parts.dead_time / time * (1.0 - ROUNDINGS * f64::EPSILON)).ceil();
        if samples > LONGEST {
            return Err(Error::argument(
                "what",
                format!(
                    "the dead time is {samples} samples long, and {LONGEST} are the most that are exported"
                ),
            ));
        }
        let ahead = (samples * time - parts.dead_time).max(0.0);
        let chain = structure.chain(&parts.shape);
        let n = chain.states();
        let (whole, part) = (chain.transition(time), chain.transition(ahead));
        let none = chain.at_rest(0.0, 0.0);
        let seen = |state: State<f64>, u: f64| -> f64 {
            let columns = chain.columns(&part.apply(&state, u), u);
            parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum()
        };
        let unit = |place: usize| {
            let mut state = none;
            state[place] = 1.0;
            state
        };
        let driven = whole.apply(&none, 1.0);
        Ok(Self {
            samples: samples as usize,
            ahead,
            states: n,
            f: (0..n)
                .flat_map(|row| (0..n).map(move |column| (row, column)))
                .map(|(row, column)| whole.entry(row, column))
                .collect(),
            g: driven[..n].to_vec(),
            c: (0..n).map(|place| seen(unit(place), 0.0)).collect(),
            d: seen(none, 1.0),
            rest: chain.at_rest(1.0, -samples * time)[..n].to_vec(),
        })
    }

    /// Takes an input, and adds what it does to `total`.
    fn statements(
        &self,
        program: &mut Program,
        signals: &Signals,
        (input, started): (usize, Array),
        total: Variable,
    ) -> Vec<Statement> {
        let (n, number) = (self.states, input + 1);
        let line = program.memory(
            &format!("u{number}"),
            "The input, the oldest value first.",
            vec![0.0; self.samples + 1],
        );
        let mut statements = signals.take_input(program, input, line);
        let d = program.table(
            &format!("D{number}"),
            &format!("From input {number} to the output."),
            vec![self.d],
        );
        let sum = program.variable(&format!("y{number}"));
        let last = self.samples;
        let mut first = program.repeat(last, |_, i| vec![Statement::Store(line, i, line.at(last))]);
        let matrices = (n > 0).then(|| {
            let mut table = |name: &str, doc: &str, values: &[f64]| {
                program.table(&format!("{name}{number}"), doc, values.to_vec())
            };
            let matrices = [
                table("F", "From the lags to the next ones, row by row.", &self.f),
                table("G", "From the input to the next lags.", &self.g),
                table("C", "From the lags to the output.", &self.c),
                table("REST", "The lags at rest with an input of 1.", &self.rest),
            ];
            let x = program.memory(&format!("x{number}"), "The lags.", vec![0.0; n]);
            (matrices, x, program.memory(&format!("next{number}"), "The next lags.", vec![0.0; n]))
        });
        if let Some(([.., rest], x, _)) = matrices {
            first.extend(
                program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), rest.at(i) * line.at(last))]),
            );
        }
        if !first.is_empty() {
            let condition = Condition::Less(started.at(0), 0.5.into());
            statements.push(Statement::Choose { condition, then: first, otherwise: Vec::new() });
        }
        statements.push(Statement::Let(sum, d.at(0) * line.at(0)));
        if let Some(([f, g, c, _], x, next)) = matrices {
            statements
                .extend(program.repeat(n, |_, i| vec![Statement::Set(sum, sum + c.at(i.clone()) * x.at(i))]));
            let moved = program.variable("lag");
            statements.extend(program.repeat(n, |program, row| {
                let mut body = vec![Statement::Let(moved, g.at(row.clone()) * line.at(0))];
                body.extend(
                    program.repeat(n, |_, j| {
                        vec![Statement::Set(moved, moved + f.at(row.entry(n, &j)) * x.at(j))]
                    }),
                );
                body.push(Statement::Store(next, row, moved.into()));
                body
            }));
            statements.extend(program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), next.at(i))]));
        }
        statements.push(Statement::Set(total, total + sum));
        statements
    }
}
