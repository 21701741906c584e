//! Models in equations, driven by their inputs from the state that they begin in:
//!
//! ```text
//! y(k) = h(x(k), u(k), t),   x(k+1) = f(x(k), u(k), t, dt)      or dx/dt = f, in steps of the classical method of order four (Kutta 1901)
//! ```
//!
//! with the operations that the equations were compiled into.

use std::collections::HashMap;

use super::program::{
    Array, Condition, Counter, Entry, Function, Index, Program, Statement, Value, Variable,
};
use super::signals::Signals;
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::equations::{Function as Named, Operation, Program as Compiled};
use crate::model::{EquationsModel, Model};

/// Powers up to this one are products.
const PRODUCTS: i32 = 8;

/// The program of a model.
///
/// # Errors
/// [`Error::Model`] and [`Error::Report`] for equations that are none any more; [`Error::Argument`] for what such a model has not.
pub(super) fn form(whole: &Model, model: &EquationsModel, purpose: Purpose) -> Result<Form, Error> {
    if purpose != Purpose::Simulator {
        return Err(refused(purpose, "a model in equations", "simulator"));
    }
    let equations = model.with_values()?;
    let mut program = Program::default();
    let signals = Signals::of(&mut program, whole)?;
    let (transition, steps, observation) = equations.compiled();
    let n = equations.states().len();
    let dt = model.sample_time;
    let mut memory = |name: &str, doc: &str, values: Vec<f64>| program.memory(name, doc, values);
    let x = memory("x", &format!("The state: {}.", model.states.join(", ")), equations.start().0.to_vec());
    let inputs = model.inputs.len();
    let u = (inputs > 0).then(|| memory("held_u", "The inputs.", vec![0.0; inputs]));
    let rate = memory("rate", "The next state, or its derivative.", vec![0.0; n]);
    let clock = (uses_time(transition, n) || uses_time(observation, model.outputs.len()))
        .then(|| memory("samples", "How many samples have gone by.", vec![0.0]));
    let time = |since: Option<Value>| {
        clock.map(|clock| {
            let now = clock.at(0) * dt;
            since.map_or(now.clone(), |since| now + since)
        })
    };

    let mut body = u.map_or_else(Vec::new, |u| program.repeat(inputs, |_, i| signals.hold_input(u, &i)));
    let leaves = Leaves { states: x, inputs: u, time: time(None), step: 0.0 };
    let (statements, outputs) = translated(&mut program, observation, model.outputs.len(), &leaves);
    body.extend(statements);
    body.extend(outputs.into_iter().enumerate().map(|(place, value)| signals.say(&place.into(), value)));
    match steps {
        None => {
            let leaves = Leaves { states: x, inputs: u, time: time(None), step: dt };
            let (statements, next) = translated(&mut program, transition, n, &leaves);
            body.extend(statements);
            body.extend(stored(rate, next));
            body.extend(program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), rate.at(i))]));
        }
        Some(count) => {
            let stage = program.memory("stage", "The state at a stage of a step.", vec![0.0; n]);
            let sum = program.memory("sum", "The sum of the derivatives.", vec![0.0; n]);
            let shares = program.table("A", "Where the stages stand in a step.", vec![0.0, 0.5, 0.5, 1.0]);
            let weights =
                program.table("B", "Their weights.", vec![1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0]);
            let h = dt / count as f64;
            let begun = clock.map(|_| program.variable("begun"));
            if let Some(begun) = begun {
                body.push(Statement::Let(begun, 0.0.into()));
            }
            // The first stage takes nothing of the derivative before.
            body.extend(program.repeat(n, |_, i| vec![Statement::Store(rate, i, 0.0.into())]));
            body.extend(program.repeat(count, |program, _| {
                let mut step = program.repeat(n, |_, i| vec![Statement::Store(sum, i, 0.0.into())]);
                let s = Counter(program.counters);
                program.counters += 1;
                let at = Index::from(s);
                let mut inner = program.repeat(n, |_, i| {
                    let moved = x.at(i.clone()) + rate.at(i.clone()) * (shares.at(at.clone()) * h);
                    vec![Statement::Store(stage, i, moved)]
                });
                let since = begun.map(|begun| (begun + shares.at(at.clone())) * h);
                let leaves = Leaves { states: stage, inputs: u, time: time(since), step: h };
                let (statements, rates) = translated(program, transition, n, &leaves);
                inner.extend(statements);
                inner.extend(stored(rate, rates));
                inner.extend(program.repeat(n, |_, i| {
                    vec![Statement::Store(
                        sum,
                        i.clone(),
                        sum.at(i.clone()) + rate.at(i) * weights.at(at.clone()),
                    )]
                }));
                step.push(Statement::Repeat { counter: s, times: 4, body: inner });
                step.extend(
                    program.repeat(n, |_, i| {
                        vec![Statement::Store(x, i.clone(), x.at(i.clone()) + sum.at(i) * h)]
                    }),
                );
                if let Some(begun) = begun {
                    step.push(Statement::Set(begun, begun + 1.0));
                }
                step
            }));
        }
    }
    if let Some(clock) = clock {
        body.push(Statement::Store(clock, 0.into(), clock.at(0) + 1.0));
    }
    program.entries = vec![Entry {
        name: "step",
        doc: vec!["The next sample: takes u(k), and gives y(k) of the free run.".to_owned()],
        arguments: signals.inputs.into_iter().collect(),
        result: Some(signals.outputs),
        body,
    }];
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

fn uses_time(program: &Compiled, count: usize) -> bool {
    program.first(count).0.iter().any(|(_, operation)| *operation == Operation::Time)
}

/// Each value in its place, after all of them were computed.
fn stored(array: Array, values: Vec<Value>) -> impl Iterator<Item = Statement> {
    values.into_iter().enumerate().map(move |(place, value)| Statement::Store(array, place.into(), value))
}

/// What the leaves of equations stand for.
struct Leaves {
    states: Array,
    inputs: Option<Array>,
    time: Option<Value>,
    step: f64,
}

/// The statements that the first `count` results of a program need, and these results. What is used once stands where it is used.
fn translated(
    program: &mut Program,
    compiled: &Compiled,
    count: usize,
    leaves: &Leaves,
) -> (Vec<Statement>, Vec<Value>) {
    let (operations, results) = compiled.first(count);
    let mut uses: HashMap<usize, usize> = HashMap::new();
    let arguments = operations.iter().flat_map(|(_, operation)| operation.arguments().into_iter().flatten());
    arguments.chain(results.iter().copied()).for_each(|place| *uses.entry(place).or_default() += 1);
    let mut translation = Translation { program, leaves, values: HashMap::new(), statements: Vec::new() };
    for (place, operation) in &operations {
        let value = translation.value(*operation);
        let is_leaf = matches!(value, Value::Number(_) | Value::Variable(_) | Value::At(..));
        let value = match uses.get(place) {
            Some(1) => value,
            _ if is_leaf => value,
            _ => translation.named(value).into(),
        };
        translation.values.insert(*place, value);
    }
    let results = results.iter().map(|place| translation.at(*place)).collect();
    (translation.statements, results)
}

struct Translation<'a> {
    program: &'a mut Program,
    leaves: &'a Leaves,
    values: HashMap<usize, Value>,
    statements: Vec<Statement>,
}

impl Translation<'_> {
    fn at(&self, place: usize) -> Value {
        self.values.get(&place).cloned().unwrap_or(Value::Number(f64::NAN))
    }

    /// A variable with this value.
    fn named(&mut self, value: Value) -> Variable {
        let variable = self.program.variable("v");
        self.statements.push(Statement::Let(variable, value));
        variable
    }

    fn choose(&mut self, variable: Variable, cases: [(Condition, Value); 2]) {
        let mut otherwise = Vec::new();
        for (condition, value) in cases.into_iter().rev() {
            otherwise =
                vec![Statement::Choose { condition, then: vec![Statement::Set(variable, value)], otherwise }];
        }
        self.statements.extend(otherwise);
    }

    fn value(&mut self, operation: Operation) -> Value {
        match operation {
            Operation::Constant(bits) => f64::from_bits(bits).into(),
            Operation::State(state) => self.leaves.states.at(state),
            Operation::Input(input) => self.leaves.inputs.map_or(f64::NAN.into(), |inputs| inputs.at(input)),
            // The parameters of a fitted model are constants.
            Operation::Parameter(_) => f64::NAN.into(),
            Operation::Time => self.leaves.time.clone().unwrap_or(Value::Number(f64::NAN)),
            Operation::Step => self.leaves.step.into(),
            Operation::Add(a, b) => self.at(a) + self.at(b),
            Operation::Subtract(a, b) => self.at(a) - self.at(b),
            Operation::Multiply(a, b) => self.at(a) * self.at(b),
            Operation::Divide(a, b) => self.at(a) / self.at(b),
            Operation::Integer(x, power) if power != 0 && power.abs() <= PRODUCTS => {
                let own = self.at(x);
                let x = Value::from(self.named(own));
                let product = (1..power.abs()).fold(x.clone(), |product, _| product * x.clone());
                if power > 0 { product } else { Value::from(1.0) / product }
            }
            Operation::Integer(x, power) => {
                let x = self.at(x);
                self.program.call(Function::Power, vec![x, f64::from(power).into()])
            }
            Operation::Real(x, bits) => {
                let x = self.at(x);
                self.program.call(Function::Power, vec![x, f64::from_bits(bits).into()])
            }
            Operation::Atan2(y, x) => {
                let arguments = vec![self.at(y), self.at(x)];
                self.program.call(Function::Angle, arguments)
            }
            Operation::Choose([a, b, c, d]) => {
                let [a, b, c, d] = [a, b, c, d].map(|place| self.at(place));
                let chosen = self.named(f64::NAN.into());
                self.choose(
                    chosen,
                    [(Condition::AtMost(a.clone(), b.clone()), c), (Condition::Less(b, a), d)],
                );
                chosen.into()
            }
            Operation::Apply(function, x) => {
                let x = self.at(x);
                self.applied(function, x)
            }
        }
    }

    fn applied(&mut self, function: Named, x: Value) -> Value {
        let function = match function {
            Named::Negative => return -x,
            Named::Sign => {
                let x = self.named(x);
                let sign = self.named(x.into());
                let (below, above) =
                    (Condition::Less(x.into(), 0.0.into()), Condition::Less(0.0.into(), x.into()));
                self.choose(sign, [(below, (-1.0).into()), (above, 1.0.into())]);
                return sign.into();
            }
            Named::Sqrt => Function::SquareRoot,
            Named::Exp => Function::Exponential,
            Named::Ln => Function::Logarithm,
            Named::Sin => Function::Sine,
            Named::Cos => Function::Cosine,
            Named::Tan => Function::Tangent,
            Named::Asin => Function::ArcSine,
            Named::Acos => Function::ArcCosine,
            Named::Atan => Function::ArcTangent,
            Named::Sinh => Function::HyperbolicSine,
            Named::Cosh => Function::HyperbolicCosine,
            Named::Tanh => Function::HyperbolicTangent,
            Named::Abs => Function::Absolute,
        };
        self.program.call(function, vec![x])
    }
}
