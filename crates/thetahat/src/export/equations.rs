//! Models in equations, driven by their inputs from the state that they begin in:
//!
//! ```text
//! y(k) = h(x(k), u(k), t),   x(k+1) = f(x(k), u(k), t, dt)      or dx/dt = f, in steps of the classical method of order four (Kutta 1901)
//! ```
//!
//! or in the exact step of linear equations, with the operations that the equations were compiled into. Predictors and
//! observers correct the state by an extended Kalman filter.

mod kalman;
mod translation;

use super::program::{Array, Condition, Counter, Entry, Index, Program, Statement, Value};
use super::signals::{FREE_RUN, Signals};
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::equations::{GreyBox, Operation, Program as Compiled, Step};
use crate::model::{EquationsModel, Model};
use kalman::Kalman;
use translation::{Leaves, translated};

/// The program of a model.
///
/// # Errors
/// [`Error::Model`] and [`Error::Report`] for equations that are none any more, and for inputs that go in lines and act
/// later; [`Error::Argument`] for what such a model has not.
pub(super) fn form(whole: &Model, model: &EquationsModel, purpose: Purpose) -> Result<Form, Error> {
    let is_corrected = match purpose {
        Purpose::Simulator => false,
        Purpose::Predictor | Purpose::Observer => true,
        _ => return Err(refused(purpose, "a model in equations", "simulator, predictor or observer")),
    };
    let equations = model.with_values()?;
    let mut lines = equations.delays().into_iter().zip(equations.linear_holds());
    if lines.any(|(delay, is_line)| delay.is_some() && *is_line) {
        return Err(Error::report(
            "an input that goes in straight lines and acts later cannot be exported: hold it (hold = \"zero\"), or leave out its \
             delay",
        ));
    }
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
    let step = equations.compiled().1;
    let each =
        model.parameters.iter().map(|own| format!("{} = {}", crate::text::harmless(&own.name), own.value));
    let mut lines = vec![model_name(model, step), "The equations are:".to_owned()];
    lines.extend(model.equations.lines().map(|line| format!("    {}", crate::text::harmless(line))));
    lines.extend(["with:".to_owned()].into_iter().chain(each));
    Ok(Form { program, equations: lines, start: "in the state that the equations begin in".to_owned() })
}

fn model_name(model: &EquationsModel, step: Step) -> String {
    let count = model.states.len();
    let how = match step {
        Step::Next => "of the next state".to_owned(),
        Step::Exact(_) => "of derivatives, which are linear: an exact step in a sample".to_owned(),
        Step::Integrated(1) => "of derivatives, one step of Runge and Kutta in a sample".to_owned(),
        Step::Integrated(steps) => format!("of derivatives, {steps} steps of Runge and Kutta in a sample"),
    };
    format!("Equations of {count} state{}, {how}.", if count == 1 { "" } else { "s" })
}

/// The state, and what leads it from one sample to the next.
#[derive(Clone)]
struct Run<'e> {
    /// Which inputs go in lines.
    lines: &'e [bool],
    /// Of each input that acts later, what it was in the latest samples, the last one last.
    pasts: Vec<Option<Array>>,
    transition: &'e Compiled,
    step: Step,
    /// Of an exact step Psi, and X where an input goes in a line.
    exact: Option<(Array, Option<Array>)>,
    observation: &'e Compiled,
    states: usize,
    inputs: usize,
    outputs: usize,
    sample_time: f64,
    x: Array,
    u: Option<Array>,
    /// Where an input goes in a line to the next sample: what it is there, and whether there was one.
    ahead: Option<(Array, Array)>,
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
        let (transition, step, observation) = equations.compiled();
        let (states, inputs, outputs) = (equations.states().len(), model.inputs.len(), model.outputs.len());
        let mut memory = |name: &str, doc: &str, values: Vec<f64>| program.memory(name, doc, values);
        let x = memory("x", &format!("The state: {}.", model.states.join(", ")), equations.started().0);
        let u = (inputs > 0).then(|| memory("held_u", "The inputs.", vec![0.0; inputs]));
        let rate = memory("rate", "The next state, or its derivative.", vec![0.0; states]);
        let columns = if with_derivatives { 1 + states } else { 1 };
        let clock = (uses_time(transition, columns * states) || uses_time(observation, columns * outputs))
            .then(|| memory("samples", "How many samples have gone by.", vec![0.0]));
        let lines = equations.linear_holds();
        let ahead = u.filter(|_| !lines.is_empty()).map(|_| {
            let ahead = memory("next_u", "The inputs of the sample.", vec![0.0; inputs]);
            (ahead, memory("begun", "Whether there was a sample.", vec![0.0]))
        });
        let pasts = delays(equations).into_iter().enumerate().map(|(input, samples)| {
            let length = samples? + 2;
            let doc = "An input in the latest samples, the last one last.";
            Some(memory(&format!("past_{}", input + 1), doc, vec![f64::NAN; length]))
        });
        let pasts: Vec<Option<Array>> = pasts.collect();
        let matrices = equations.exact_matrices();
        let derivatives = with_derivatives.then(|| {
            let doc = "The derivative of the next state by the state, row by row.";
            if let Some([transition, ..]) = &matrices {
                return Derivatives {
                    m: program.table("M", doc, transposed(transition, states)),
                    of_steps: None,
                };
            }
            let mut square = |name: &str, doc: &str| program.memory(name, doc, vec![0.0; states * states]);
            let m = square("m", doc);
            let of_steps = matches!(step, Step::Integrated(_)).then(|| {
                [
                    square("jacobian", "That of the equations."),
                    square("stage_m", "M at a stage of a step."),
                    square("rate_m", "Its derivative."),
                    square("sum_m", "The sum of these."),
                ]
            });
            Derivatives { m, of_steps }
        });
        let exact = matrices.map(|[_, integral, second, _]| {
            let mut square =
                |name: &str, doc: &str, of: &[f64]| program.table(name, doc, transposed(of, states));
            let stays = "What a derivative that stays leaves to the state, row by row.";
            let integral = square("PSI", stays, &integral);
            (integral, ahead.map(|_| square("X", "What one that grows by 1 in a second does.", &second)))
        });
        let sample_time = model.sample_time;
        Self {
            lines,
            pasts,
            ahead,
            transition,
            step,
            exact,
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

    /// Begins a sample: takes the inputs. Where one of them goes in lines, the state first goes on to this sample.
    fn begin(
        &self,
        program: &mut Program,
        signals: &Signals,
        advance: impl FnOnce(&mut Program) -> Vec<Statement>,
    ) -> Vec<Statement> {
        let Some(u) = self.u else { return Vec::new() };
        let into = self.ahead.map_or(u, |(ahead, _)| ahead);
        let mut body = program.repeat(self.inputs, |_, i| signals.hold_input(into, &i));
        if let Some((ahead, begun)) = self.ahead {
            let condition = Condition::Less(0.0.into(), begun.at(0));
            let mut then = advance(program);
            then.extend(self.finish());
            body.push(Statement::Choose { condition, then, otherwise: Vec::new() });
            body.extend(
                program.repeat(self.inputs, |_, i| vec![Statement::Store(u, i.clone(), ahead.at(i))]),
            );
            body.push(Statement::Store(begun, 0.into(), 1.0.into()));
        }
        for (input, past) in self.pasts.iter().enumerate() {
            let Some(past) = *past else { continue };
            body.extend(program.push(past, u.at(input)));
            // Before the first sample an input was as in it.
            body.extend(program.repeat(program.length(past), |_, i| {
                let condition = Condition::Missing(past.at(i.clone()));
                let then = vec![Statement::Store(past, i, u.at(input))];
                vec![Statement::Choose { condition, then, otherwise: Vec::new() }]
            }));
        }
        body
    }

    /// Ends a sample: goes on to the next, where the inputs of this one lead there.
    fn end(
        &self,
        program: &mut Program,
        advance: impl FnOnce(&mut Program) -> Vec<Statement>,
    ) -> Vec<Statement> {
        if self.ahead.is_some() {
            return Vec::new();
        }
        let mut body = advance(program);
        body.extend(self.finish());
        body
    }

    /// What the equations are made of at a state, so long after the start of the sample, in parts of it.
    fn leaves(&self, states: Array, since: Option<Value>, share: Option<Value>, step: f64) -> Leaves<'_> {
        let ahead = self.ahead.map(|(ahead, _)| ahead).zip(share);
        let (lines, pasts) = (self.lines, &self.pasts);
        let time = self.time(since);
        Leaves { states, inputs: self.u, ahead, lines, pasts, time, step, sample_time: self.sample_time }
    }

    /// So many results of the equations of the outputs: these, then their derivatives by the states, column after
    /// column.
    fn observed(&self, program: &mut Program, count: usize) -> (Vec<Statement>, Vec<Value>) {
        translated(program, self.observation, count, &self.leaves(self.x, None, None, 0.0))
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
        let count = match self.step {
            Step::Next => {
                let leaves = self.leaves(x, None, None, dt);
                let mut body = self.rates(program, &leaves, self.derivatives.map(|own| own.m));
                body.extend(program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), rate.at(i))]));
                return body;
            }
            Step::Exact(_) => return self.exactly(program),
            Step::Integrated(count) => count,
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
        let knows_time = self.clock.is_some() || self.ahead.is_some();
        let begun = knows_time.then(|| program.variable("begun_steps"));
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
            let share = begun.map(|begun| (begun + shares.at(at.clone())) / count as f64);
            let leaves = self.leaves(stage, since, share, h);
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

    /// The exact step x + Psi f + X (f(end) - f)/dt.
    fn exactly(&self, program: &mut Program) -> Vec<Statement> {
        let (n, x, rate) = (self.states, self.x, self.rate);
        let Some((integral, second)) = self.exact else { return Vec::new() };
        let moved = program.memory("moved_x", "The state after the step.", vec![0.0; n]);
        let add = |program: &mut Program, into: Array, matrix: Array, of: Array| {
            program.repeat(n, |program, i| {
                program.repeat(n, |_, k| {
                    let sum = into.at(i.clone()) + matrix.at(i.entry(n, &k)) * of.at(k);
                    vec![Statement::Store(into, i.clone(), sum)]
                })
            })
        };
        let mut body = self.rates(program, &self.leaves(x, None, Some(0.0.into()), 0.0), None);
        body.extend(program.repeat(n, |_, i| vec![Statement::Store(moved, i.clone(), x.at(i))]));
        body.extend(add(program, moved, integral, rate));
        if let Some(second) = second {
            let bend = program.memory("bend", "How fast the derivative grows.", vec![0.0; n]);
            body.extend(program.repeat(n, |_, i| vec![Statement::Store(bend, i.clone(), rate.at(i))]));
            body.extend(self.rates(program, &self.leaves(x, None, Some(1.0.into()), 0.0), None));
            body.extend(program.repeat(n, |_, i| {
                let grown = (rate.at(i.clone()) - bend.at(i.clone())) / self.sample_time;
                vec![Statement::Store(bend, i, grown)]
            }));
            body.extend(add(program, moved, second, bend));
        }
        body.extend(program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), moved.at(i))]));
        body
    }

    /// The sample is over.
    fn finish(&self) -> Option<Statement> {
        self.clock.map(|clock| Statement::Store(clock, 0.into(), clock.at(0) + 1.0))
    }

    fn simulator(&self, program: &mut Program, signals: &Signals) -> Entry {
        let mut body = self.begin(program, signals, |program| self.advance(program));
        let (statements, outputs) = self.observed(program, self.outputs);
        body.extend(statements);
        body.extend(outputs.into_iter().enumerate().map(|(place, value)| signals.say(&place.into(), value)));
        body.extend(self.end(program, |program| self.advance(program)));
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

/// A matrix column after column, row by row.
fn transposed(matrix: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|place| matrix[place % n * n + place / n]).collect()
}

/// The longest delay of each input in whole samples; none of one that acts at once.
fn delays(equations: &GreyBox) -> Vec<Option<usize>> {
    let samples = |delay: f64| (delay / equations.sample_time()).floor() as usize;
    equations.delays().into_iter().map(|longest| longest.map(samples)).collect()
}

fn uses_time(program: &Compiled, count: usize) -> bool {
    program.first(count).0.iter().any(|(_, operation)| *operation == Operation::Time)
}

/// Each value in its place, after all of them were computed.
fn stored(array: Array, values: Vec<Value>) -> impl Iterator<Item = Statement> {
    values.into_iter().enumerate().map(move |(place, value)| Statement::Store(array, place.into(), value))
}
