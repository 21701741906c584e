//! Models in state space:
//!
//! ```text
//! y^(t)  = H x(t) + D u(t)
//! x(t+1) = (F - K H) x(t) + (G - K D) u(t) + K y(t)      simulators: F x(t) + G u(t)
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, section 4.3), each sum one column after the other, as the recursion of
//! [`respond`](crate::respond) has it.

use thetahat_core::nalgebra::DMatrix;

use super::program::{Array, Entry, Index, Kind, Program, Statement, Variable};
use super::signals::{FREE_RUN, PREDICTION, Signals, UPDATE};
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::{Model, StateSpace, StateSpaceModel};

/// The program of a model.
///
/// # Errors
/// [`Error::Report`] for an offset that moves; [`Error::Argument`] for what such a model has not.
pub(super) fn form(whole: &Model, model: &StateSpaceModel, purpose: Purpose) -> Result<Form, Error> {
    let mut program = Program::default();
    let signals = Signals::of(&mut program, whole)?;
    let matrices = model.matrices();
    let StateSpace { f, g, h, d, k, .. } = &matrices;
    let mut equations = vec![
        model.name(),
        "x(t+1) = F x(t) + G u(t) + K e(t), y(t) = H x(t) + D u(t) + e(t); the states at rest are zero"
            .to_owned(),
    ];
    let delays = model.inputs.iter().zip(&model.delays).filter(|(_, delay)| **delay > 0);
    equations.extend(delays.map(|(input, delay)| {
        format!("'{}' waits {delay} samples, in the last states", crate::text::harmless(&input.name))
    }));
    let system = match purpose {
        Purpose::Simulator if model.inputs.is_empty() => {
            return Err(Error::argument(
                "what",
                "a simulator runs on inputs, and no input drives this model; take predictor",
            ));
        }
        Purpose::Simulator => System::new(&mut program, [f, g, h, d], None),
        Purpose::Predictor | Purpose::Observer => {
            System::new(&mut program, [&(f - k * h), &(g - k * d), h, d], Some(k))
        }
        _ => return Err(refused(purpose, "a model in state space", "predictor, simulator or observer")),
    };
    program.entries = match purpose {
        Purpose::Simulator => vec![system.simulator(&mut program, &signals)],
        Purpose::Predictor => system.predictor(&mut program, &signals),
        _ => vec![system.observer(&mut program, &signals)],
    };
    Ok(Form { program, equations, start: "in the state 0, at rest at the offsets".to_owned() })
}

/// The matrices, the state, and what is known of the signals of a sample.
struct System {
    states: usize,
    inputs: usize,
    outputs: usize,
    /// From the state, the inputs and the outputs to the next state; from the state and the inputs to the outputs. None is of no columns.
    to_state: [Option<Array>; 3],
    to_output: [Option<Array>; 2],
    x: Option<Array>,
    next: Option<Array>,
    u: Option<Array>,
    /// The predictions, in deviations; then what was measured.
    y: Option<Array>,
}

impl System {
    fn new(program: &mut Program, [f, g, h, d]: [&DMatrix<f64>; 4], k: Option<&DMatrix<f64>>) -> Self {
        let mut table = |name: &str, doc: &str, matrix: &DMatrix<f64>| {
            (!matrix.is_empty()).then(|| {
                let rows = matrix.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>());
                program.table(name, &format!("{doc}, row by row."), rows.collect())
            })
        };
        let (from_state, from_input) = match k {
            Some(_) => (["XX", "F - K H"], ["XU", "G - K D"]),
            None => (["F", "F"], ["G", "G"]),
        };
        let to_state = [
            table(from_state[0], from_state[1], f),
            table(from_input[0], from_input[1], g),
            k.and_then(|k| table("K", "K", k)),
        ];
        let to_output = [table("H", "H", h), table("D", "D", d)];
        let (states, inputs, outputs) = (f.nrows(), g.ncols(), h.nrows());
        let mut memory = |name: &str, doc: &str, size: usize| {
            (size > 0).then(|| program.memory(name, doc, vec![0.0; size]))
        };
        Self {
            states,
            inputs,
            outputs,
            to_state,
            to_output,
            x: memory("x", "The state.", states),
            next: memory("next", "The next state.", states),
            u: memory("held_u", "The inputs, as deviations.", inputs),
            y: k.and_then(|_| {
                memory("deviation", "The outputs: as predicted, then as measured; as deviations.", outputs)
            }),
        }
    }

    /// Takes the inputs.
    fn take_inputs(&self, program: &mut Program, signals: &Signals) -> Vec<Statement> {
        let Some(u) = self.u else { return Vec::new() };
        program.repeat(self.inputs, |_, i| signals.hold_input(u, &i))
    }

    /// `into[row] = sum of the products of rows of matrices with columns`, for each row.
    fn product(
        &self,
        program: &mut Program,
        rows: usize,
        factors: &[(Option<Array>, Option<Array>, usize)],
        finish: impl FnOnce(Variable, &Index) -> Vec<Statement>,
    ) -> Vec<Statement> {
        let sum = program.variable("sum");
        program.repeat(rows, |program, row| {
            let mut body = vec![Statement::Let(sum, 0.0.into())];
            for (matrix, column, size) in factors {
                let (Some(matrix), Some(column)) = (matrix, column) else { continue };
                body.extend(program.repeat(*size, |_, j| {
                    let index = row.entry(*size, &j);
                    vec![Statement::Set(sum, sum + matrix.at(index) * column.at(j))]
                }));
            }
            body.extend(finish(sum, &row));
            body
        })
    }

    /// The outputs.
    fn outputs(
        &self,
        program: &mut Program,
        finish: impl FnOnce(Variable, &Index) -> Vec<Statement>,
    ) -> Vec<Statement> {
        let factors = [(self.to_output[0], self.x, self.states), (self.to_output[1], self.u, self.inputs)];
        self.product(program, self.outputs, &factors, finish)
    }

    /// Goes on to the next state.
    fn go_on(&self, program: &mut Program) -> Vec<Statement> {
        let (Some(x), Some(next)) = (self.x, self.next) else { return Vec::new() };
        let factors = [
            (self.to_state[0], self.x, self.states),
            (self.to_state[1], self.u, self.inputs),
            (self.to_state[2], self.y, self.outputs),
        ];
        let mut statements = self.product(program, self.states, &factors, |sum, row| {
            vec![Statement::Store(next, row.clone(), sum.into())]
        });
        statements
            .extend(program.repeat(self.states, |_, i| vec![Statement::Store(x, i.clone(), next.at(i))]));
        statements
    }

    fn simulator(&self, program: &mut Program, signals: &Signals) -> Entry {
        let mut body = self.take_inputs(program, signals);
        body.extend(self.outputs(program, |sum, row| vec![signals.say(row, sum)]));
        body.extend(self.go_on(program));
        signals.responds("step", FREE_RUN, body)
    }

    /// Takes what was measured; a prediction stays where it is missing.
    fn take_measured(&self, program: &mut Program, signals: &Signals) -> Vec<Statement> {
        let Some(y) = self.y else { return Vec::new() };
        program.repeat(self.outputs, |_, i| vec![signals.hold_output(y, &i)])
    }

    fn predictor(&self, program: &mut Program, signals: &Signals) -> Vec<Entry> {
        let Some(y) = self.y else { return Vec::new() };
        let mut predict = self.take_inputs(program, signals);
        predict.extend(self.outputs(program, |sum, row| {
            vec![Statement::Store(y, row.clone(), sum.into()), signals.say(row, sum)]
        }));
        let mut update = self.take_measured(program, signals);
        update.extend(self.go_on(program));
        vec![signals.responds("predict", PREDICTION, predict), signals.updates(UPDATE, update)]
    }

    fn observer(&self, program: &mut Program, signals: &Signals) -> Entry {
        let (Some(y), Some(x)) = (self.y, self.x) else { return signals.observes("", None, Vec::new()) };
        let mut body = self.take_inputs(program, signals);
        body.extend(self.outputs(program, |sum, row| vec![Statement::Store(y, row.clone(), sum.into())]));
        body.extend(self.take_measured(program, signals));
        body.extend(self.go_on(program));
        let state = program.array(Kind::Result, "state", "The state.", vec![0.0; self.states]);
        body.extend(program.repeat(self.states, |_, i| vec![Statement::Store(state, i.clone(), x.at(i))]));
        let doc = "A sample: takes u(k) and y(k), and gives the estimate of the state x(k+1). A missing output (NaN) corrects nothing.";
        signals.observes(doc, Some(state), body)
    }
}
