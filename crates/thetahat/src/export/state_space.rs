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

use super::program::{Array, Condition, Entry, Index, Kind, Program, Statement, Value, Variable};
use super::signals::{FREE_RUN, Innovations, PREDICTION, Signals, UPDATE};
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
        _ => vec![system.observer(&mut program, &signals, &matrices.noise_covariance)],
    };
    Ok(Form { program, equations, start: "in the state 0, at rest at the offsets".to_owned() })
}

/// The matrices, the state, and what is known of the signals of a sample.
struct System {
    states: usize,
    inputs: usize,
    outputs: usize,
    /// From the state, the inputs and the outputs to the next state; from the state and the inputs to the outputs. None
    /// is of no columns.
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

    /// What was measured, and the innovations: e, and where their covariance has an inverse their variances and e' S^-1
    /// e, one output after the other, the last one first, each less what those after it predict of it (S = U D U',
    /// Bierman 1977).
    fn innovations(
        &self,
        program: &mut Program,
        signals: &Signals,
        y: Array,
        covariance: &DMatrix<f64>,
    ) -> Vec<Statement> {
        let m = self.outputs;
        let told = Innovations::new(program, m);
        let [error, rest, share] = ["error", "rest", "share"].map(|name| program.variable(name));
        let several = (m > 1).then(|| {
            let table: Vec<f64> = covariance.transpose().iter().copied().collect();
            (
                program.table("S", "The covariance of the innovations, row by row.", table),
                program.memory("s", "That of what is not predicted yet.", vec![0.0; m * m]),
                program.memory("rest", "What is not predicted yet of the innovations.", vec![0.0; m]),
            )
        });
        let mut body = vec![told.begin()];
        if let Some((table, s, _)) = several {
            body.extend(program.repeat(m * m, |_, i| vec![Statement::Store(s, i.clone(), table.at(i))]));
        }
        // Whether the errors are there is known before the first of them is used.
        body.extend(program.repeat(m, |_, j| {
            let mut known = vec![
                Statement::Let(error, signals.output(&j) - y.at(j.clone())),
                Statement::Store(told.errors, j.clone(), error.into()),
                Statement::Store(y, j.clone(), signals.output(&j)),
            ];
            let mut missed = vec![Statement::Miss];
            missed.extend(told.miss(&j));
            match several {
                None => known.extend(told.count(&j, error, covariance[0].into())),
                Some((.., left)) => {
                    known.push(Statement::Store(left, j.clone(), error.into()));
                    missed.push(Statement::Store(left, j.clone(), 0.0.into()));
                }
            }
            let condition = Condition::Missing(signals.measured.at(j));
            vec![Statement::Choose { condition, then: missed, otherwise: known }]
        }));
        let Some((_, s, left)) = several else { return body };
        body.extend(program.repeat(m, |program, place| {
            let j = place.mirrored(m);
            let mut own = vec![Statement::Let(rest, left.at(j.clone()))];
            own.extend(told.count(&j, rest, s.at(j.entry(m, &j))));
            own.extend(program.repeat(m, |program, k| {
                let mut row = vec![
                    Statement::Let(share, s.at(k.entry(m, &j)) / told.variances.at(j.clone())),
                    Statement::Store(left, k.clone(), left.at(k.clone()) - Value::from(share) * rest),
                ];
                row.extend(program.repeat(m, |_, l| {
                    let entry = k.entry(m, &l);
                    let less = Value::from(share) * s.at(j.entry(m, &l));
                    vec![Statement::Store(s, entry.clone(), s.at(entry) - less)]
                }));
                row
            }));
            vec![Statement::unless_missing(signals.measured.at(j), own)]
        }));
        body
    }

    fn observer(&self, program: &mut Program, signals: &Signals, covariance: &DMatrix<f64>) -> Entry {
        let (Some(y), Some(x)) = (self.y, self.x) else { return signals.observes("", None, Vec::new()) };
        let mut body = self.take_inputs(program, signals);
        body.extend(self.outputs(program, |sum, row| vec![Statement::Store(y, row.clone(), sum.into())]));
        body.extend(match covariance.clone().cholesky() {
            Some(_) => self.innovations(program, signals, y, covariance),
            None => self.take_measured(program, signals),
        });
        body.extend(self.go_on(program));
        let state = program.array(Kind::Result, "state", "The state.", vec![0.0; self.states]);
        body.extend(program.repeat(self.states, |_, i| vec![Statement::Store(state, i.clone(), x.at(i))]));
        let doc = "A sample: takes u(k) and y(k), and gives the estimate of the state x(k+1). A missing output (NaN) corrects nothing.";
        signals.observes(doc, Some(state), body)
    }
}
