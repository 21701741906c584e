//! Models in equations, driven by their inputs from the state that they begin in:
//!
//! ```text
//! y(k) = h(x(k), u(k), t),   x(k+1) = f(x(k), u(k), t, dt)      or dx/dt = f, in steps of the classical method of order four (Kutta 1901)
//! ```
//!
//! with the operations that the equations were compiled into. Predictors and observers correct the state by an extended
//! Kalman filter.

mod kalman;
mod translation;

use super::program::{Array, Counter, Entry, Index, Program, Statement, Value};
use super::signals::{FREE_RUN, Signals};
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::equations::{GreyBox, Operation, Program as Compiled};
use crate::model::{EquationsModel, Model};
use kalman::Kalman;
use translation::{Leaves, translated};

/// The program of a model.
///
/// # Errors
/// [`Error::Model`] and [`Error::Report`] for equations that are none any more; [`Error::Argument`] for what such a
/// model has not.
pub(super) fn form(whole: &Model, model: &EquationsModel, purpose: Purpose) -> Result<Form, Error> {
    let is_corrected = match purpose {
        Purpose::Simulator => false,
        Purpose::Predictor | Purpose::Observer => true,
        _ => return Err(refused(purpose, "a model in equations", "simulator, predictor or observer")),
    };
    let equations = model.with_values()?;
    let mut program = Program::default();
    let signals = Signals::of(&mut program, whole)?;
    let run = Run::new(&mut program, &equations, model, is_corrected);
    program.entries = match purpose {
        Purpose::Simulator => vec![run.simulator(&mut program, &signals)],
        _ => {
            let kalman = Kalman::new(&mut program, &equations, run);
            match purpose {
                Purpose::Predictor => kalman.predictor(&mut program, &signals),
                _ => vec![kalman.observer(&mut program, &signals)],
            }
        }
    };
    let steps = equations.compiled().1;
    let each =
        model.parameters.iter().map(|own| format!("{} = {}", crate::text::harmless(&own.name), own.value));
    let mut lines = vec![model_name(model, steps), "The equations are:".to_owned()];
    lines.extend(model.equations.lines().map(|line| format!("    {}", crate::text::harmless(line))));
    lines.extend(["with:".to_owned()].into_iter().chain(each));
    Ok(Form { program, equations: lines, start: "in the state that the equations begin in".to_owned() })
}

fn model_name(model: &EquationsModel, steps: Option<usize>) -> String {
    let count = model.states.len();
    let how = match steps {
        None => "of the next state".to_owned(),
        Some(1) => "of derivatives, one step of Runge and Kutta in a sample".to_owned(),
        Some(steps) => format!("of derivatives, {steps} steps of Runge and Kutta in a sample"),
    };
    format!("Equations of {count} state{}, {how}.", if count == 1 { "" } else { "s" })
}

/// The state, and what leads it from one sample to the next.
#[derive(Clone, Copy)]
struct Run<'e> {
    transition: &'e Compiled,
    /// The steps of an integration in a sample; none where the equations are of the next state.
    steps: Option<usize>,
    observation: &'e Compiled,
    states: usize,
    inputs: usize,
    outputs: usize,
    sample_time: f64,
    x: Array,
    u: Option<Array>,
    rate: Array,
    /// How many samples have gone by, where the equations say t.
    clock: Option<Array>,
    derivatives: Option<Derivatives>,
}

/// M = dx(k+1)/dx(k), row by row, and what its integration takes: the Jacobian of the equations, M at a stage, its
/// derivative, and the sum of these.
#[derive(Clone, Copy)]
struct Derivatives {
    m: Array,
    of_steps: Option<[Array; 4]>,
}

impl<'e> Run<'e> {
    fn new(
        program: &mut Program,
        equations: &'e GreyBox,
        model: &EquationsModel,
        with_derivatives: bool,
    ) -> Self {
        let (transition, steps, observation) = equations.compiled();
        let (states, inputs, outputs) = (equations.states().len(), model.inputs.len(), model.outputs.len());
        let mut memory = |name: &str, doc: &str, values: Vec<f64>| program.memory(name, doc, values);
        let x =
            memory("x", &format!("The state: {}.", model.states.join(", ")), equations.start().0.to_vec());
        let u = (inputs > 0).then(|| memory("held_u", "The inputs.", vec![0.0; inputs]));
        let rate = memory("rate", "The next state, or its derivative.", vec![0.0; states]);
        let columns = if with_derivatives { 1 + states } else { 1 };
        let clock = (uses_time(transition, columns * states) || uses_time(observation, columns * outputs))
            .then(|| memory("samples", "How many samples have gone by.", vec![0.0]));
        let derivatives = with_derivatives.then(|| {
            let mut square = |name: &str, doc: &str| memory(name, doc, vec![0.0; states * states]);
            let m = square("m", "The derivative of the next state by the state, row by row.");
            let of_steps = steps.map(|_| {
                [
                    square("jacobian", "That of the equations."),
                    square("stage_m", "M at a stage of a step."),
                    square("rate_m", "Its derivative."),
                    square("sum_m", "The sum of these."),
                ]
            });
            Derivatives { m, of_steps }
        });
        let sample_time = model.sample_time;
        Self {
            transition,
            steps,
            observation,
            states,
            inputs,
            outputs,
            sample_time,
            x,
            u,
            rate,
            clock,
            derivatives,
        }
    }

    /// t, so long after the start of the sample.
    fn time(&self, since: Option<Value>) -> Option<Value> {
        let now = self.clock?.at(0) * self.sample_time;
        Some(since.map_or(now.clone(), |since| now + since))
    }

    /// Takes the inputs.
    fn take_inputs(&self, program: &mut Program, signals: &Signals) -> Vec<Statement> {
        let Some(u) = self.u else { return Vec::new() };
        program.repeat(self.inputs, |_, i| signals.hold_input(u, &i))
    }

    /// So many results of the equations of the outputs: these, then their derivatives by the states, column after
    /// column.
    fn observed(&self, program: &mut Program, count: usize) -> (Vec<Statement>, Vec<Value>) {
        let leaves = Leaves { states: self.x, inputs: self.u, time: self.time(None), step: 0.0 };
        translated(program, self.observation, count, &leaves)
    }

    /// What the equations of the states say, and where they are kept.
    fn rates(&self, program: &mut Program, leaves: &Leaves, jacobian: Option<Array>) -> Vec<Statement> {
        let n = self.states;
        let count = if jacobian.is_some() { n + n * n } else { n };
        let (mut statements, mut results) = translated(program, self.transition, count, leaves);
        let columns = results.split_off(n);
        statements.extend(stored(self.rate, results));
        let places = (0..n * n).map(|place| place % n * n + place / n);
        statements.extend(
            places
                .zip(columns)
                .filter_map(|(place, value)| Some(Statement::Store(jacobian?, place.into(), value))),
        );
        statements
    }

    /// Goes on to the next state.
    fn advance(&self, program: &mut Program) -> Vec<Statement> {
        let (n, x, rate, dt) = (self.states, self.x, self.rate, self.sample_time);
        let Some(count) = self.steps else {
            let leaves = Leaves { states: x, inputs: self.u, time: self.time(None), step: dt };
            let mut body = self.rates(program, &leaves, self.derivatives.map(|own| own.m));
            body.extend(program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), rate.at(i))]));
            return body;
        };
        let stage = program.memory("stage", "The state at a stage of a step.", vec![0.0; n]);
        let sum = program.memory("sum", "The sum of the derivatives.", vec![0.0; n]);
        let shares = program.table("A", "Where the stages stand in a step.", vec![0.0, 0.5, 0.5, 1.0]);
        let weights = program.table("B", "Their weights.", vec![1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0]);
        let h = dt / count as f64;
        // What is added up in stages: the state, and with derivatives M, by the chain rule.
        let mut added = vec![(n, x, rate, stage, sum)];
        let derivatives = self.derivatives.and_then(|own| Some((own.m, own.of_steps?)));
        added.extend(derivatives.map(|(m, [_, stage, rate, sum])| (n * n, m, rate, stage, sum)));
        let mut body = Vec::new();
        if let Some((m, _)) = derivatives {
            body.extend(program.repeat(n * n, |_, i| vec![Statement::Store(m, i, 0.0.into())]));
            body.extend(program.repeat(n, |_, i| vec![Statement::Store(m, i.entry(n, &i), 1.0.into())]));
        }
        let begun = self.clock.map(|_| program.variable("begun"));
        body.extend(begun.map(|begun| Statement::Let(begun, 0.0.into())));
        // The first stage takes nothing of the derivative before.
        for (size, _, rate, ..) in &added {
            body.extend(program.repeat(*size, |_, i| vec![Statement::Store(*rate, i, 0.0.into())]));
        }
        body.extend(program.repeat(count, |program, _| {
            let mut step = Vec::new();
            for (size, .., sum) in &added {
                step.extend(program.repeat(*size, |_, i| vec![Statement::Store(*sum, i, 0.0.into())]));
            }
            let s = Counter(program.counters);
            program.counters += 1;
            let at = Index::from(s);
            let mut inner = Vec::new();
            for &(size, value, rate, stage, _) in &added {
                inner.extend(program.repeat(size, |_, i| {
                    let moved = value.at(i.clone()) + rate.at(i.clone()) * (shares.at(at.clone()) * h);
                    vec![Statement::Store(stage, i, moved)]
                }));
            }
            let since = begun.map(|begun| (begun + shares.at(at.clone())) * h);
            let leaves = Leaves { states: stage, inputs: self.u, time: self.time(since), step: h };
            inner.extend(self.rates(program, &leaves, derivatives.map(|(_, [jacobian, ..])| jacobian)));
            if let Some((_, [jacobian, stage, rate, _])) = derivatives {
                inner.extend(multiplied(program, n, [jacobian, stage, rate], false));
            }
            for &(size, _, rate, _, sum) in &added {
                inner.extend(program.repeat(size, |_, i| {
                    let more = sum.at(i.clone()) + rate.at(i.clone()) * weights.at(at.clone());
                    vec![Statement::Store(sum, i, more)]
                }));
            }
            step.push(Statement::Repeat { counter: s, times: 4, body: inner });
            for &(size, value, .., sum) in &added {
                step.extend(program.repeat(size, |_, i| {
                    vec![Statement::Store(value, i.clone(), value.at(i.clone()) + sum.at(i) * h)]
                }));
            }
            step.extend(begun.map(|begun| Statement::Set(begun, begun + 1.0)));
            step
        }));
        body
    }

    /// The sample is over.
    fn finish(&self) -> Option<Statement> {
        self.clock.map(|clock| Statement::Store(clock, 0.into(), clock.at(0) + 1.0))
    }

    fn simulator(&self, program: &mut Program, signals: &Signals) -> Entry {
        let mut body = self.take_inputs(program, signals);
        let (statements, outputs) = self.observed(program, self.outputs);
        body.extend(statements);
        body.extend(outputs.into_iter().enumerate().map(|(place, value)| signals.say(&place.into(), value)));
        body.extend(self.advance(program));
        body.extend(self.finish());
        signals.responds("step", FREE_RUN, body)
    }
}

/// `into = a b`, or `a b'`, of square matrices row by row.
fn multiplied(program: &mut Program, n: usize, [a, b, into]: [Array; 3], transposed: bool) -> Vec<Statement> {
    let sum = program.variable("product");
    program.repeat(n, |program, i| {
        program.repeat(n, |program, j| {
            let mut body = vec![Statement::Let(sum, 0.0.into())];
            body.extend(program.repeat(n, |_, k| {
                let other = if transposed { j.entry(n, &k) } else { k.entry(n, &j) };
                vec![Statement::Set(sum, sum + a.at(i.entry(n, &k)) * b.at(other))]
            }));
            body.push(Statement::Store(into, i.entry(n, &j), sum.into()));
            body
        })
    })
}

fn uses_time(program: &Compiled, count: usize) -> bool {
    program.first(count).0.iter().any(|(_, operation)| *operation == Operation::Time)
}

/// Each value in its place, after all of them were computed.
fn stored(array: Array, values: Vec<Value>) -> impl Iterator<Item = Statement> {
    values.into_iter().enumerate().map(move |(place, value)| Statement::Store(array, place.into(), value))
}
